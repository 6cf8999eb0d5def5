"""Limits of what can be requested, which no parameter changes."""

from __future__ import annotations

MIN_ALTITUDE_M = 0.3
MAX_DISTANCE_M = 100_000.0
