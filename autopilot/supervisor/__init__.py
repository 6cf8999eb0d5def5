"""Which phase the flight is in, what is watched, and what is allowed."""
