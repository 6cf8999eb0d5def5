"""Tolerances of the report tests, each with its reason."""

# positions travel as single precision: 2^-24 relative, of figures up to about ten metres
WIRE_M = 1e-6
# a quotient of such figures
WIRE_RELATIVE = 1e-5
# crossings are interpolated by straight lines over 8 ms: h^2/8 times the acceleration over the speed
CROSSING_S = 1e-3
# a peak falls between two samples: (w h)^2/8 of the overshoot, w = 4 rad/s, h = 8 ms
PEAK_RELATIVE = 2e-3
# the same formula evaluated by arrays and by scalars
ROUNDING = 1e-15
# angles go through arcus functions, whose slope is up to ten within the drawn ranges
ANGLE = 1e-13
# a polynomial with coefficients up to 5 over a few seconds, relative to its greatest value
POLYNOMIAL = 1e-12
# a time of some 10 s in seconds, from whole microseconds
STAMP_S = 1e-9
