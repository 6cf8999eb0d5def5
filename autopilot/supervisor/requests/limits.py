"""Limits of what can be requested, which no parameter changes."""

from __future__ import annotations

LEAST_ALTITUDE_M = 0.3
FARTHEST_M = 100_000.0
SLOWEST_M_S, FASTEST_M_S = 0.05, 15.0
