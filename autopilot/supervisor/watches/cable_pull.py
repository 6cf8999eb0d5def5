"""The pull of the cable as it is felt, and what counts as one."""

from __future__ import annotations

from math import isfinite

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import View

SLACK, PULLED = 0.1, 0.3  # weights of the load: less is no pull of the cable, more is one
PULL_US = 100_000  # for which a cable must pull to be taut


def share_pulled(view: View, settings: Settings) -> float:
    """Pull of the cable in weights of the load; by its length alone where no accelerometer tells."""
    if isfinite(view.pull_n):
        return view.pull_n / settings.load_weight_n
    return 1.0 if view.taut else 0.0
