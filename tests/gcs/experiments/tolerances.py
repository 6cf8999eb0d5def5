"""Tolerances of the experiment tests, each with its reason."""

# least squares through an exact exponential
FIT_EXACT = 1e-9
# the envelope of a swing is a staircase: the fit through it is off by part of the last step
FIT_SWING = 0.1
# a bound may touch what it bounds
TOUCH = 1e-9
# a setpoint's time stamp: one telemetry tick
TICK_S = 0.008
# the tables of the documentation are rounded: half of the last digit
ROUNDED = {"rise_time_90_s": 0.006, "overshoot_pct": 0.06, "settling_time_5pct_s": 0.006}
