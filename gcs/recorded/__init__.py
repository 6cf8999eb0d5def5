"""Recorded flights of other people's vehicles: their motion, their load, and what can be learnt from both."""
