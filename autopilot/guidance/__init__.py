"""What is flown now: the legs of a flight, and the following of setpoints."""
