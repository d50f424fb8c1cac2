"""The stepping solver: fixed steps in phase, cut at the events inside them.

A rule is the polynomial through the rate of the relative velocity, Üg − Ü, at one, two or
three points of a step; V and W are its first and second integrals.

==========  =====================  =====  ==================================
rule        rate taken at          order  also known as
==========  =====================  =====  ==================================
rectangle   start                  1      Euler (Eq. 12 is written this way)
trapezoid   start, end             2      linear acceleration
simpson     start, middle, end     4      Runge-Kutta 4 for a rate free of V
==========  =====================  =====  ==================================

Steps end where a piece of the waveform does (`kernels.excitation`): on its jumps, kinks, turns and zeros, and are
of one length on each piece (`table.steps_of`).  The orders hold because a step in which something happens (t1, a
switch to or from the hold, a turn of Eq. 4, the stop) is divided there by `pulse.rise_step` and `rates.take`, and
because a slide or a layer of friction shorter than a few steps is given steps of its own.  Steps in
which nothing happens, nearly all, are taken many at a time: with b held their sums are in a table for all cells
(`table`), by Eq. 4 their rates are computed in the lanes of SIMD loops (`lanes`).
Orders, and what slides shorter than steps need: docs/numerics.md#step-solver.
"""
