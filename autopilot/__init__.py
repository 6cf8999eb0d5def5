"""The flight software: estimator, control cascade, mixer and the MAVLink face of the vehicle."""
