"""Paths of the load: signals, splines, shaping, feasibility, and the preparation of missions."""
