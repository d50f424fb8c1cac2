"""Calibration: friction measured on a shaking table, and the parameters of the model from it.

A test records the acceleration of the table and the acceleration, velocity or displacement of the
block on it.  Two functions start from a test:

- `measured_friction` computes without a model.  It gives the friction coefficient over time by
  Eq. 1 and by statics, and the slides that the block made.
- `calibrate` estimates Üy, λ and Δμ.  It computes the motion of the model's block on the recorded
  motion of the table, and fits it to the channels that were measured, each weighted by its noise.
  It reports the three parameters with standard errors, 95 % intervals and correlation, each cycle
  by itself, the misfit of each channel, sentences on what the tests do not determine, and tables
  to paste into a sweep file.

Three things make the fit more than a least-squares fit of three numbers.  The sensors have noise
whose size and colour are not known, and may have offsets and drifts.  The recorded motion of the
table has noise, too, and its errors shake the computed block.  And several branches of the model
may fit equally well, so that an interval is a union.  docs/calibration.md gives the reasons and
measured coverage.

In the order in which a test passes through them:

========================  =========================================================================
shaking_test.py           a test as it is read from a CSV file, and its channels
measured_friction.py      `measured_friction`; Eq. 1, statics, slides and their threshold
noise.py                  noise of sensors: size, colour, steps of converters, clipped channels
table_motion.py           the motion of the table behind its record: a spline, and its errors
observation.py            a test: its channels, noise, offsets and drifts, samples left out
likelihood.py             residuals of a test near a solution, made independent; noise by residuals
scale.py                  scaled parameters of the search; what decides the block's acceleration
search.py                 least squares, and intervals by profile likelihood
estimate.py               from starts to the best values and all that the data allow
corrected.py              a test less offsets, drifts and steps; its slides
findings.py               sentences on what is not determined, and what would determine it
sweep_tables.py           tables for a sweep file
calibrate.py              `calibrate`: all of this, and its results as a dataset
========================  =========================================================================
"""
