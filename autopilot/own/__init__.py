"""User code in the autopilot: custom control laws, estimators and path planners, each in its own file."""
