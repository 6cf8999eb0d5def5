"""Numbers of a flight. Each function returns some keys of the record; None stands for an unknown value.

The mission window (`gcs.analysis.samples.in_window`) is taken at the time stamps of the true load state, or
of the quantity itself for values that the autopilot sends. `metrics.toml` defines the meaning of every key.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.axes import Floats, swing, tilt
from gcs.analysis.failure import after_failure, failure_s, lost_s
from gcs.analysis.samples import (
    AIRBORNE,
    ATTITUDE_MODES,
    CARRIED,
    HOLD,
    MISSION,
    Samples,
    given_up_s,
    in_window,
    phase_at,
)
from gcs.analysis.step import find_step, step_response
from gcs.analysis.tracks import Telemetry, WindTrack

Numbers = dict[str, float | int | None]

_LEAD_S = 0.5  # of hold before a step: shows that it begins at rest
RECOVERED_M = 0.05  # once the load error stays below this, the load has recovered from a gust
SNAP_S = 0.5  # after a snap: the time in which its peak tension is searched
_COUNTER_RANGE = 65536  # slack_events is a uint16
_AXES = "xyz"


def _statistic(values: Floats, function: Callable[[Floats], float]) -> float | None:
    """`function` of the finite values; None if there are none."""
    finite = values[np.isfinite(values)]
    return float(function(finite)) if finite.size else None


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values * values)))


def time_numbers(telemetry: Telemetry, wall_s: float | None, diverged: bool) -> Numbers:
    """Durations on the vehicle's clock, and their ratio to wall time. A flight that `diverged` is recorded
    for a moment longer, in which nothing is flown any more."""
    setpoint = telemetry.setpoint
    flown = setpoint.time_s <= (lost_s(telemetry) if diverged else np.inf)
    airborne = np.flatnonzero(np.isin(setpoint.phase, AIRBORNE) & flown)
    in_mission = (setpoint.phase == MISSION)[:-1] & flown[1:]
    span = telemetry.span_s
    recorded = None if span is None else span[1] - span[0]
    return {
        "recorded_s": recorded,
        "flight_s": float(setpoint.time_s[airborne[-1]] - setpoint.time_s[airborne[0]])
        if len(airborne)
        else None,
        "mission_s": float(np.diff(setpoint.time_s)[in_mission].sum()) if in_mission.any() else None,
        "wall_s": wall_s,
        "real_time_factor": recorded / wall_s if recorded is not None and wall_s else None,
    }


def tracking_numbers(samples: Samples) -> Numbers:
    """Load position error over the mission window, norm and axes, (3-40), and its two parts: the distance of
    the shaped path from the requested path, and of the load from the shaped path."""
    error = samples.error_m[samples.position_tracked]
    norm = np.linalg.norm(error, axis=1)
    known = norm[np.isfinite(norm)]
    numbers: Numbers = {
        "load_error_max_m": _statistic(norm, np.max),
        "load_error_rms_m": _statistic(norm, _rms),
        "load_error_final_m": float(known[-1]) if len(known) else None,
    }
    tracked = samples.position_tracked
    shaped = np.linalg.norm((samples.desired_m - samples.requested_m)[tracked], axis=1)
    numbers["shaping_distance_max_m"] = _statistic(shaped, np.max)
    tracking = np.linalg.norm((samples.actual_m - samples.desired_m)[tracked], axis=1)
    numbers["tracking_error_max_m"] = _statistic(tracking, np.max)
    for i, axis in enumerate(_AXES):
        numbers[f"load_error_max_{axis}_m"] = _statistic(np.abs(error[:, i]), np.max)
    for i, axis in enumerate(_AXES):
        numbers[f"load_error_rms_{axis}_m"] = _statistic(error[:, i], _rms)
    speed = np.linalg.norm(samples.actual_m_s[samples.carried], axis=1)
    numbers["load_speed_max_m_s"] = _statistic(speed, np.max)
    return numbers


def failure_numbers(telemetry: Telemetry, samples: Samples) -> Numbers:
    """When the vehicle gave up because a part of it failed, and the load position error from then on."""
    failed_s = failure_s(telemetry, samples)
    if failed_s is None:
        return {"failure_s": None, "failure_error_max_m": None}
    after = after_failure(samples, failed_s) & samples.attached
    return {
        "failure_s": failed_s,
        "failure_error_max_m": _statistic(np.linalg.norm(samples.error_m[after], axis=1), np.max),
    }


def step_window(samples: Samples) -> NDArray[np.bool_]:
    """(n,) True from half a second before the mission to the end of the hold after it, where there is a
    desired path."""
    window = np.zeros(len(samples.time_s), dtype=np.bool_)
    first = np.flatnonzero(samples.in_mission)
    if len(first) == 0:
        return window
    begin = int(first[0])
    hold_or_mission = np.isin(samples.phase, (MISSION, HOLD))
    end = begin + int(np.argmin(np.append(hold_or_mission[begin:], False)))
    earliest = samples.time_s[begin] - _LEAD_S
    while begin > 0 and hold_or_mission[begin - 1] and samples.time_s[begin - 1] >= earliest:
        begin -= 1
    window[begin:end] = True
    return window & np.isfinite(samples.desired_m).all(axis=1) & np.isfinite(samples.desired_m_s).all(axis=1)


def step_numbers(samples: Samples) -> Numbers:
    """Step response; all None unless the mission is one step."""
    numbers: Numbers = dict.fromkeys(
        ("step_height_m", "rise_time_90_s", "overshoot_pct", "settling_time_5pct_s")
    )
    window = step_window(samples)
    if not samples.position_tracked[window].any():
        return numbers
    time_s = samples.time_s[window]
    step = find_step(time_s, samples.requested_m[window], samples.requested_m_s[window])
    if step is None:
        return numbers
    response = step_response(step, time_s, samples.actual_m[window])
    return dict(zip(numbers, response, strict=True))


def cascade_numbers(telemetry: Telemetry) -> Numbers:
    """Error functions of the cascade over the mission window; (3-1), (3-8). None: the law does not define
    it."""
    cascade = telemetry.cascade
    window = in_window(telemetry, cascade.time_s)
    return {
        "psi_R_max": _statistic(cascade.psi_R[window], np.max),
        "psi_q_max": _statistic(cascade.psi_q[window], np.max),
    }


def rotor_numbers(telemetry: Telemetry) -> Numbers:
    """Use of the rotors over the mission window: saturation of the commands, and the true forces."""
    commanded, true = telemetry.rotors_commanded, telemetry.rotors_truth
    saturated = commanded.saturated[in_window(telemetry, commanded.time_s)] != 0
    force = true.force_n[in_window(telemetry, true.time_s)]
    return {
        "saturated_fraction": float(np.mean(saturated)) if len(saturated) else None,
        "rotor_force_min_n": _statistic(force, np.min),
        "rotor_force_max_n": _statistic(force, np.max),
    }


def cable_numbers(telemetry: Telemetry, samples: Samples) -> Numbers:
    """True tilt, swing and tension over the mission window; slack events while the load is carried."""
    truth = telemetry.load_truth
    window = samples.carried
    tilt_max = _statistic(tilt(samples.quat_wxyz[samples.in_mission]), np.max)
    swing_max = _statistic(swing(truth.q_cable[window]), np.max)
    went_slack = np.diff(truth.slack_events, prepend=truth.slack_events[:1]) % _COUNTER_RANGE
    carried = np.isin(samples.phase, CARRIED) & samples.attached
    carried &= samples.time_s <= given_up_s(telemetry)
    return {
        "tilt_max_deg": None if tilt_max is None else float(np.degrees(tilt_max)),
        "swing_max_deg": None if swing_max is None else float(np.degrees(swing_max)),
        "tension_min_n": _statistic(truth.tension_n[window], np.min),
        "tension_max_n": _statistic(truth.tension_n[window], np.max),
        "slack_events": int(went_slack[carried].sum()) if carried.any() else None,
    }


def gust_intervals(wind: WindTrack) -> list[tuple[float, float]]:
    """Beginning and end (s) of every gust pulse; the end is NaN if the log ends before it."""
    gusting = (wind.gust_m_s != 0.0).any(axis=1)
    edges = np.flatnonzero(np.diff(gusting, prepend=False))
    times = [float(t) for t in wind.time_s[edges]]
    return list(zip(times[::2], [*times[1::2], np.nan][: len(times[::2])], strict=True))


def gust_numbers(telemetry: Telemetry, samples: Samples) -> Numbers:
    """Effect of gust pulses on the load while it was carried.

    A gust counts if it begins and ends while the load is carried and its position is tracked. It is
    evaluated from its beginning until the load is no longer carried or the next gust begins.
    """
    carried = np.isin(samples.phase, CARRIED) & ~np.isin(samples.control_mode, ATTITUDE_MODES)
    carried &= samples.attached
    error = np.linalg.norm(samples.error_m, axis=1)
    complete, worst_m, recovery_s = 0, 0.0, 0.0
    gusts = gust_intervals(telemetry.wind)
    for i, (begin, end) in enumerate(gusts):
        next_begin = gusts[i + 1][0] if i + 1 < len(gusts) else np.inf
        after = samples.time_s >= begin
        ends = samples.time_s[after & ~carried]
        evaluated_until = min(next_begin, ends[0] if len(ends) else np.inf)
        window = after & (samples.time_s < evaluated_until) & np.isfinite(error)
        if not end < evaluated_until or not (window & (samples.time_s >= end)).any():
            continue
        complete += 1
        worst_m = max(worst_m, float(error[window].max()))
        outside = samples.time_s[window & (error > RECOVERED_M)]
        last = samples.time_s[window][-1]
        if len(outside):
            recovery_s = max(recovery_s, np.inf if outside[-1] == last else float(outside[-1]) - end)
    return {
        "gusts": complete,
        "gust_error_max_m": worst_m if complete else None,
        "gust_recovery_50mm_s": recovery_s if complete and np.isfinite(recovery_s) else None,
    }


def snap_numbers(telemetry: Telemetry) -> Numbers:
    """How hard the slack cable came taut, from take-off to touchdown."""
    snaps, truth = telemetry.snaps, telemetry.load_truth
    airborne = np.isin(phase_at(telemetry, snaps.time_s), AIRBORNE)
    times, speeds = snaps.time_s[airborne], snaps.speed_m_s[airborne]
    # the last snap before each sample, and whether it is recent
    last = np.searchsorted(times, truth.time_s, side="right") - 1
    recent = (last >= 0) & (truth.time_s - np.append(times, 0.0)[last] <= SNAP_S)
    return {
        "snaps": int(airborne.sum()) if len(truth.time_s) else None,
        "snap_speed_max_m_s": _statistic(speeds, np.max),
        "snap_impulse_max_n_s": _statistic(snaps.impulse_n_s[airborne], np.max),
        "snap_tension_max_n": _statistic(truth.tension_n[recent], np.max),
    }


def battery_numbers(telemetry: Telemetry) -> Numbers:
    """The state of a simulated battery at the end of the log, and its least voltage; all None without one."""
    battery = telemetry.battery

    def last(values: Floats) -> float | None:
        return _statistic(values, lambda known: float(known[-1]))

    return {
        "battery_left_pct": last(battery.left_pct),
        "battery_used_mah": last(battery.used_mah),
        "battery_voltage_min_v": _statistic(battery.voltage_v, np.min),
    }


def estimator_numbers(samples: Samples) -> Numbers:
    """Estimated minus true, and estimated minus requested, load position over the mission window."""
    norm = np.linalg.norm((samples.estimated_m - samples.actual_m)[samples.carried], axis=1)
    followed = (samples.estimated_m - samples.requested_m)[samples.position_tracked]
    followed_norm = np.linalg.norm(followed, axis=1)
    filter_norm = np.linalg.norm((samples.filtered_m - samples.actual_m)[samples.carried], axis=1)
    return {
        "estimator_error_max_m": _statistic(norm, np.max),
        "estimator_error_rms_m": _statistic(norm, _rms),
        "estimated_load_error_max_m": _statistic(followed_norm, np.max),
        "estimated_load_error_rms_m": _statistic(followed_norm, _rms),
        "filter_error_max_m": _statistic(filter_norm, np.max),
        "filter_error_rms_m": _statistic(filter_norm, _rms),
    }


def clock_numbers(telemetry: Telemetry) -> Numbers:
    """How well the simulator kept its rate; None in lockstep, where no tick has a wall-clock deadline."""
    status = telemetry.simulation
    timed = status.rate_hz > 0.0

    def worst(late_us: NDArray[np.int64]) -> int | None:
        return int(late_us[timed].max()) if timed.any() else None

    return {
        "rate_hz": _statistic(status.rate_hz[timed], lambda v: float(np.median(v))),
        "late_p50_us": worst(status.late_p50_us),
        "late_p99_us": worst(status.late_p99_us),
        "late_max_us": worst(status.late_max_us),
        "missed_ticks": int(status.missed.max() - status.missed.min()) if len(status.missed) else None,
    }


def coverage_numbers(samples: Samples) -> Numbers:
    """Completeness of the capture, which limits the accuracy of the numbers above."""
    window = samples.in_mission
    steps_s = np.diff(samples.time_s)[window[1:] & window[:-1]]  # none across a pause
    error = samples.error_m[samples.position_tracked]
    return {
        "samples": int(window.sum()),
        "gap_max_s": float(steps_s.max()) if len(steps_s) else None,
        "matched_fraction": float(np.isfinite(error).all(axis=1).mean()) if len(error) else None,
    }


def _disarmed(telemetry: Telemetry) -> bool:
    """Whether the vehicle was disarmed at the end: a HEARTBEAT reports it at once, the phase comes later."""
    modes, phase = telemetry.heartbeat.base_mode, telemetry.setpoint.phase
    stopped = len(modes) > 0 and not modes[-1] & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return stopped or bool((phase[-1:] == mavlink.PLUMBLINE_PHASE_DISARMED).any())


def outcome_of(telemetry: Telemetry, samples: Samples) -> str:
    """The outcome of the flight judged from telemetry, for logs without a recorded outcome: by what the
    vehicle reported and did, as the client judges that flies it. How far the load was from its path decides
    nothing: a receiver's bias alone may be metres, and the vehicle itself tells when it cannot follow."""
    phase = telemetry.setpoint.phase
    if len(phase) == 0 and len(samples.time_s) == 0:
        return "no telemetry"
    # an autopilot that knows of no load has other reasons for critical texts, and flies on
    told_loss = telemetry.setpoint.is_reported and np.isfinite(lost_s(telemetry))
    if not np.isfinite(samples.actual_m).all() or told_loss:
        return "diverged"
    if not _disarmed(telemetry):
        return "incomplete"
    if failure_s(telemetry, samples) is not None or _left_mission(telemetry):
        return "interrupted"
    carried = np.isin(phase, (*CARRIED, mavlink.PLUMBLINE_PHASE_LOWER)).any()
    return "completed" if carried else "incomplete"


def _left_mission(telemetry: Telemetry) -> bool:
    """Whether a mission was begun that is in the log and whose last item was not flown."""
    setpoint, reached = telemetry.setpoint, telemetry.mission_reached
    last = len(telemetry.mission) - 1
    if last < 0 or not (setpoint.phase == MISSION).any():
        return False
    landing = np.isin(setpoint.phase, (mavlink.PLUMBLINE_PHASE_LOWER, mavlink.PLUMBLINE_PHASE_SET_DOWN))
    flown = np.isin(phase_at(telemetry, reached.time_s), AIRBORNE) & (reached.item == last)
    return not (flown.any() or (landing & (setpoint.item == last)).any())
