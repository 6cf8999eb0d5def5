"""What users bring to the autopilot: control laws of their own, in files of their own."""
