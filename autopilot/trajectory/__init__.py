"""Paths of the load: signals, splines, shaping, feasibility, and what a mission becomes."""
