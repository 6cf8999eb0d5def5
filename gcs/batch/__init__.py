"""Many flights: which must be flown, which processes fly them, and the display of progress."""
