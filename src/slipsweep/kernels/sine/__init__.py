"""The cycle solver for the sine and other plain waves: the common kinds of motion in SIMD lanes.

The cells of a tile are sorted by the kind of their motion; those of one kind are laid out side by side and
solved together (`pulse`, `cycles`, `carried`, `continuous`), in loops that LLVM turns into SIMD: Newton with a fixed
number of iterations, quadrature nodes outside, cells inside.  A cell whose iteration has not converged, or that is of
another kind, is left to `kernels.cycle`, which solves any waveform; in continuous sliding under a sine it is solved
here, by symmetry from one quarter of the cycle.  `cosine` is the sine from a peak on; triangle and square are
solved as the sine is, with other `shapes` of a quarter.

Rows of lanes are those of `lanes`: flat arrays, (LANES_SIZE,), in which row + j is lane j.
docs/numerics.md#lanes-of-the-sine
"""
