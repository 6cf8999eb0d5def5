"""The names with which a custom control law is written: see `docs/laws.md`.

World ENU, body FLU, SI.
"""

from __future__ import annotations

from autopilot.control.law_exchange import Asked, Believed, Held, Now
from autopilot.control.records import Cable, Reference, State
from autopilot.own.compiled import kernel
from autopilot.own.law_commands import attitude, force, rates, wrench
from autopilot.own.loaded_class import Parameter

__all__ = [
    "Asked",
    "Believed",
    "Cable",
    "Held",
    "Now",
    "Parameter",
    "Reference",
    "State",
    "attitude",
    "force",
    "kernel",
    "rates",
    "wrench",
]
