"""The whole autopilot without sockets."""
