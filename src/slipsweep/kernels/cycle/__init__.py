"""The cycle solver: the response to any periodic shaking, event by event.

Between two events the block's acceleration is either held (polynomials of the phase) or follows
Eq. 4 (closed forms on a straight piece of the wave, Gauss-Legendre quadrature of a smooth function
on a curved one), so that no step is taken and the result carries rounding errors only.  The shaking
comes in monotone pieces (`kernels.excitation`).  Along one the block moves by `pulse.rise` (stick, slide and follow
Eq. 4; from t1 on) or by `pulse.hold` (to the stop, or to Üg = 0, t5); `kernels.pulse` goes through them and on by
Eq. 12 or the hold, and `kernels.train` strings pulses together.
In continuous sliding Eq. 4 is integrated over a cycle, and the cycles are a series.  Plain waves have
shorter ways to the same (`kernels.sine`).  Notation: τ is the phase on a piece, from its anchor, x the plane's
acceleration, b the block's, V and W velocity and displacement (see `kernels.block`).

Events need not be located to the last digit: at an onset the rate of V is zero, at a stop
V itself, so an error δ in an event's phase moves W by δ² or less.
"""
