"""The pull of the cable as measured by the accelerometer, and its thresholds."""

from __future__ import annotations

from math import isfinite

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import View

# weights of the load: less than the first is no pull, more than the second is one
SLACK_PULL_SHARE, TAUT_PULL_SHARE = 0.1, 0.3
PULL_US = 100_000  # time for which a cable must pull to count as taut


def cable_pull_share(view: View, settings: Settings) -> float:
    """Pull of the cable in weights of the load; without an accelerometer, one if it is taut by its length."""
    if isfinite(view.pull_n):
        return view.pull_n / settings.load_weight_n
    return 1.0 if view.taut else 0.0
