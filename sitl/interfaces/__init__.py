"""How third-party autopilots fly the vehicle: one file per interface, bytes in and bytes out."""

from __future__ import annotations

PLUMBLINE = "plumbline"  # our own autopilot
THIRD_PARTY = ("ardupilot", "px4", "betaflight")
