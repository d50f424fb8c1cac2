"""The exact kernel for a sine: cells of one kind of motion are computed together, in SIMD.

`solve` puts cells into batches (`batch`) by the kind of their motion (`kinds`), and solves one when
it is full: pulses of stick-slip and of Newmark's block (`pulse`), continuous sliding
(`continuous`).  A cell of no such kind, or whose iteration has not converged, is solved by itself
(`alone`).  docs/numerics.md#batches-of-the-sine
"""
