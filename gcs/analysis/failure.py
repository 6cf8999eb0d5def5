"""When a flight failed: the vehicle gave it up because a part of it failed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.samples import AIRBORNE, Samples, phase_at
from gcs.analysis.tracks import Telemetry

_TOLD_S = 0.5  # between a failure and the end of the mission by it, at most
_TEXTS = ("Failsafe: ", "Flight given up: ")  # beginnings of the vehicle's texts about a failure


def failure_s(telemetry: Telemetry, samples: Samples) -> float | None:
    """Time (s), by the vehicle's clock, at which the vehicle gave up its mission, or the flight behind it,
    because a part of it failed: it reported a failure, or entered FAILSAFE; None if it did not.

    A failure with which the mission goes on is none: the figures over the mission window include it.
    """
    mission = samples.time_s[samples.in_mission]
    told = np.array([text.time_s for text in telemetry.texts if text.text.startswith(_TEXTS)])
    given_up = telemetry.setpoint.time_s[telemetry.setpoint.phase == mavlink.PLUMBLINE_PHASE_FAILSAFE]
    times = np.concatenate([told[np.isin(phase_at(telemetry, told), AIRBORNE)], given_up[:1]])
    times = times[times >= mission[-1] - _TOLD_S] if len(mission) else times
    return float(times.min()) if len(times) else None


def after_failure(samples: Samples, failed_s: float) -> NDArray[np.bool_]:
    """(n,) True from the failure until the load is requested to be below where it came to lie, by which the
    autopilot sets it down: then it has no error any more."""
    after = (samples.time_s >= failed_s) & np.isin(samples.phase, AIRBORNE)
    ground_m = np.nanmin(samples.actual_m[after, 2], initial=np.inf)
    return np.asarray(after & ~(samples.requested_m[:, 2] < ground_m))
