"""The world: the true vehicle, its sensors and the simulator end of the MAVLink link."""
