"""What is really flying; it may differ from what the autopilot believes."""
