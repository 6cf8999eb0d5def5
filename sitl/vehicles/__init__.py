"""The true vehicle; it may differ from the vehicle that the autopilot assumes."""
