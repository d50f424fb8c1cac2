"""Calibration: what a test on a shaking table says of a block's friction.

measured_friction.py   friction over time by Eq. 1 and by statics, without a model
calibrate.py           `calibrate`: Üy, λ and Δμ from one or several tests, with their report
estimate.py            the best Üy, λ and Δμ, and intervals of all that the data allow
likelihood.py          one test: residuals and their likelihood
noise.py               noise of sensors
table_motion.py        the motion of the table behind its record
"""
