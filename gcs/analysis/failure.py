"""When a flight failed: the vehicle gave it up because a part of it failed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.samples import AIRBORNE, Samples, given_up_s, phase_at
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
    times = np.append(told[np.isin(phase_at(telemetry, told), AIRBORNE)], _failsafe_s(telemetry))
    times = times[times >= mission[-1] - _TOLD_S] if len(mission) else times
    failed_s = min(times.min(initial=np.inf), given_up_s(telemetry))
    return float(failed_s) if np.isfinite(failed_s) else None


def lost_s(telemetry: Telemetry) -> float:
    """Time (s) from which a flight counts as diverged: the vehicle entered FAILSAFE, or reported in the air
    what is critical; infinite if it did neither."""
    critical = np.array(
        [text.time_s for text in telemetry.texts if text.severity <= mavlink.MAV_SEVERITY_CRITICAL]
    )
    reported = critical[np.isin(phase_at(telemetry, critical), AIRBORNE)]
    return float(min(_failsafe_s(telemetry), reported.min(initial=np.inf)))


def _failsafe_s(telemetry: Telemetry) -> float:
    """Time (s) at which the vehicle entered FAILSAFE; infinite if it did not."""
    setpoint = telemetry.setpoint
    entered = setpoint.time_s[setpoint.phase == mavlink.PLUMBLINE_PHASE_FAILSAFE]
    return float(entered.min(initial=np.inf))


def after_failure(samples: Samples, failed_s: float) -> NDArray[np.bool_]:
    """(n,) True from the failure until the load is requested to be below where it came to lie, by which the
    autopilot sets it down: then it has no error any more."""
    after = (samples.time_s >= failed_s) & np.isin(samples.phase, AIRBORNE)
    ground_m = np.nanmin(samples.actual_m[after, 2], initial=np.inf)
    return np.asarray(after & ~(samples.requested_m[:, 2] < ground_m))
