"""The ground station: command line, capture of telemetry, and reports."""
