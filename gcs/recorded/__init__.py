"""Recorded flights of other vehicles: their motion, their load, and parameters identified from both."""
