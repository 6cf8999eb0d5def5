"""Tolerances of the report tests, each with its reason."""

# positions are sent in single precision: 2^-24 relative, of values up to about ten metres
WIRE_M = 1e-6
# a quotient of such values
WIRE_RELATIVE = 1e-5
# crossings are interpolated by straight lines over 8 ms: h^2/8 times the acceleration over the speed
CROSSING_S = 1e-3
# a peak falls between two samples: (w h)^2/8 of the overshoot, w = 4 rad/s, h = 8 ms
PEAK_RELATIVE = 2e-3
# the same formula evaluated by arrays and by scalars
ROUNDING = 1e-15
# angles come from inverse trigonometric functions, whose slope is up to ten within the drawn ranges
ANGLE = 1e-13
# a polynomial with coefficients up to 5 over a few seconds, relative to its greatest value
POLYNOMIAL = 1e-12
# a time of about 10 s in seconds, computed from whole microseconds
STAMP_S = 1e-9
