"""The flight software: estimator, control cascade, mixer and the MAVLink interface of the vehicle."""
