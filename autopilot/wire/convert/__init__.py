"""Messages built and read in Plumbline's own frames and units.

If both ends are Plumbline's, a message has a record, a builder `x_message(...)` that takes the record's
fields in their order, and its inverse `read_x(message)`; common telemetry has builders. Arguments are SI,
world ENU from home, body FLU, `quat_wxyz` from body to world; the messages are NED and FRD. Numbers are
rounded to the float32 or the scaled integer of the field; integers saturate at the ends of their range, NaN
becomes 0 in an integer. Values that were not measured are None here and NaN on the wire.
"""
