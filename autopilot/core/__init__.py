"""One tick of the flight software."""
