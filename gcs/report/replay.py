"""What the page replays: the flight's samples and events as JSON values, for `flight_data.js`.

World ENU from home, SI units; attitudes as the scene takes them, FRD in NED. Where the log has a gap longer
than a report interpolates, a row without numbers is inserted, so that nothing is drawn across the gap.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.align import MAX_GAP_S, as_of, linear
from gcs.analysis.axes import Floats, quat_enu_flu_from_ned_frd
from gcs.analysis.record import FlightMeta
from gcs.analysis.samples import PHASE_NAMES, Samples, samples_of
from gcs.analysis.tracks import Telemetry, rotor_names
from gcs.report.missing import no_error_reason
from gcs.report.packing import Column, pack
from gcs.report.steps import step_texts
from gcs.report.style import phase_spans

LEVELS = ("emergency", "alert", "critical", "error", "warning", "notice", "info", "debug")
KINDS = {  # of phases: what the band behind a plot looks like
    mavlink.PLUMBLINE_PHASE_TAUTEN: "earth",
    mavlink.PLUMBLINE_PHASE_LIFT: "earth",
    mavlink.PLUMBLINE_PHASE_HOLD: "calm",
    mavlink.PLUMBLINE_PHASE_MISSION: "busy",
    mavlink.PLUMBLINE_PHASE_RETURN: "home",
    mavlink.PLUMBLINE_PHASE_LOWER: "earth",
    mavlink.PLUMBLINE_PHASE_SET_DOWN: "earth",
    mavlink.PLUMBLINE_PHASE_FAILSAFE: "alarm",
    mavlink.PLUMBLINE_PHASE_GUIDED: "busy",
}
MAX_ROWS = 30_000  # four minutes at 125 Hz
_DEFAULT_VEHICLE = "bebop"  # drawn if it is not known which vehicle flew
# steps to which numbers are rounded
_POSITION_M, _SPEED_M_S, _UNIT, _FORCE_N, _TIME_S, _PSI = 1e-6, 1e-4, 1e-5, 1e-3, 1e-6, 1e-8
_VOLTAGE_V, _CHARGE_PCT = 1e-3, 1.0

Json = dict[str, Any]


def replay_of(
    telemetry: Telemetry, samples: Samples, meta: FlightMeta, columns: Collection[str] | None = None
) -> Json:
    """Everything that a page draws; if the log has no truth, the vehicle's estimate.

    `columns` are the wanted columns, by the part of their name before the first underscore; None: all.
    """
    has_truth = bool(len(samples.time_s))
    if not has_truth:
        telemetry = _with_estimate_as_truth(telemetry)
        samples = samples_of(telemetry)
    setpoint = telemetry.setpoint
    return {
        "source": "truth" if has_truth else "estimate" if len(samples.time_s) else None,
        "span": list(telemetry.span_s or (0.0, 0.0)),
        "vehicle": layout_of(meta.vehicle),
        "limits_n": _rotor_limits(telemetry),
        "phases": [
            {"from": begin, "to": end, "name": _phase_name(phase), "kind": KINDS.get(phase, "none")}
            for begin, end, phase in phase_spans(setpoint.time_s, setpoint.phase)
        ],
        "texts": [
            {
                "time": text.time_s,
                "level": level_name(text.severity),
                "tone": _tone(text.severity),
                "text": text.text,
            }
            for text in telemetry.texts
        ],
        "steps": steps_of(telemetry),
        "worst": worst_moment(samples),
        "no_error": "" if np.isfinite(samples.error_m).any() else no_error_reason(telemetry, samples),
        "wind": _wind(telemetry),
        "samples": pack(*_columns(telemetry, samples, columns)),
    }


def level_name(severity: int) -> str:
    """MAV_SEVERITY in words."""
    return LEVELS[severity] if 0 <= severity < len(LEVELS) else str(severity)


def _tone(severity: int) -> str:
    if severity <= mavlink.MAV_SEVERITY_ERROR:
        return "bad"
    return "warn" if severity == mavlink.MAV_SEVERITY_WARNING else ""


def _phase_name(phase: int) -> str:
    return PHASE_NAMES.get(phase, str(phase)).replace("_", " ")


def layout_of(vehicle: str | None) -> Json:
    """Positions of the rotors (body FRD, m), their directions of rotation (about the body's z axis) and
    sizes; those of `_DEFAULT_VEHICLE` if the vehicle's file no longer exists."""
    try:
        flown: Vehicle = load_vehicle(vehicle or _DEFAULT_VEHICLE)
    except (VehicleFileError, OSError):
        flown = load_vehicle(_DEFAULT_VEHICLE)
    arm, z = flown.arm_m, -flown.rotor_height_m
    return {
        "rotors": [
            {"position": [arm * rotor.x, -arm * rotor.y, z], "spin": -1 if rotor.yaw < 0.0 else 1}
            for rotor in flown.layout
        ],
        "arm": arm,
        "cable": flown.cable_length_m,
        "load_radius": flown.load_radius_m,
        "rotor_max_n": flown.rotor_max_n if flown.limited else None,
    }


def worst_moment(samples: Samples) -> Json | None:
    """Time and size of the greatest load position error, over the samples of `load_error_max_m`."""
    distance = np.where(samples.position_tracked, np.linalg.norm(samples.error_m, axis=1), np.nan)
    known = np.isfinite(distance)
    if not known.any():
        return None
    at = int(np.argmax(np.where(known, distance, -1.0)))
    return {"time": round(float(samples.time_s[at]), 6), "error_m": float(distance[at])}


def _with_estimate_as_truth(telemetry: Telemetry) -> Telemetry:
    return replace(
        telemetry,
        load_truth=telemetry.load_estimated,
        attitude_truth=telemetry.attitude_estimated,
        rotors_truth=telemetry.rotors_commanded,
    )


def _rotor_limits(telemetry: Telemetry) -> list[float] | None:
    for track in (telemetry.rotors_commanded, telemetry.rotors_truth):
        if len(track.time_s) and np.isfinite(track.force_max_n[-1]) and np.isfinite(track.force_min_n[-1]):
            return [float(track.force_min_n[-1]), float(track.force_max_n[-1])]
    return None


def steps_of(telemetry: Telemetry) -> list[Json]:
    """The steps of the mission; `time` is when one of the step's items was first flown, None if never; of an
    item that a jump repeats, when it was flown after the step before."""
    setpoint = telemetry.setpoint
    flown = np.isin(setpoint.phase, list(KINDS))
    items, at = setpoint.item[flown], setpoint.time_s[flown]
    found, before = [], 0
    for step in step_texts(telemetry.mission, telemetry.home):
        when = np.flatnonzero((items >= step.first) & (items <= step.last))
        later = when[when >= before]
        before = later[0] if len(later) else before
        first = before if len(later) else next(iter(when), None)  # where the user has changed the order
        found.append({**step._asdict(), "time": None if first is None else float(at[first])})
    return found


def _wind(telemetry: Telemetry) -> list[list[float]]:
    """[time, east, north, up] at each change of the wind (mean plus gust); empty if there was none."""
    wind = telemetry.wind
    total = wind.wind_m_s + wind.gust_m_s
    if not len(wind.time_s) or not total.any():
        return []
    changed = np.append(True, (np.diff(total, axis=0) != 0.0).any(axis=1))
    return [[float(t), *map(float, row)] for t, row in zip(wind.time_s[changed], total[changed], strict=True)]


def _columns(
    telemetry: Telemetry, samples: Samples, wanted_columns: Collection[str] | None
) -> tuple[list[Column], int]:
    """The columns, with a row without numbers within each gap, and the number of rows."""
    t, truth = samples.time_s, telemetry.load_truth
    rotors, commanded, cascade = telemetry.rotors_truth, telemetry.rotors_commanded, telemetry.cascade
    battery = telemetry.battery
    found = [
        *_xyz("load", samples.actual_m, _POSITION_M),
        *_xyz("vehicle", samples.vehicle_m, _POSITION_M),
        *_xyz("asked", samples.requested_m, _POSITION_M),
        *_xyz("flown_for", samples.desired_m, _POSITION_M),
        *_xyz("believed", np.where(samples.attached[:, None], samples.estimated_m, np.nan), _POSITION_M),
        *_xyz("velocity", samples.actual_m_s, _SPEED_M_S),
        *_xyz("asked_velocity", samples.requested_m_s, _SPEED_M_S),
        *_components("quat", "wxyz", quat_enu_flu_from_ned_frd(samples.quat_wxyz), _UNIT),  # its own inverse
        *_xyz("cable", truth.q_cable, _UNIT),
        Column("tension", np.where(samples.attached, truth.tension_n, np.nan), _FORCE_N),
        *_components("rotor", rotor_names(rotors), as_of(rotors.time_s, rotors.force_n, t), _FORCE_N),
        *_components(
            "command", rotor_names(commanded), as_of(commanded.time_s, commanded.force_n, t), _FORCE_N
        ),
        Column("psi_R", linear(cascade.time_s, cascade.psi_R, t), _PSI),
        Column("psi_q", linear(cascade.time_s, cascade.psi_q, t), _PSI),
        Column("voltage", as_of(battery.time_s, battery.voltage_v, t, battery.GAP_S), _VOLTAGE_V),
        Column("charge", as_of(battery.time_s, battery.left_pct, t, battery.GAP_S), _CHARGE_PCT),
        Column("taut", (truth.taut == 1).astype(np.float64), 1.0),
        Column("attached", samples.attached.astype(np.float64), 1.0),
        Column("scored", samples.position_tracked.astype(np.float64), 1.0),
    ]
    kept = _kept_samples(telemetry, samples)
    t = t[kept]
    gaps = np.flatnonzero(_before_gaps(samples.time_s)[kept][:-1])
    columns = [
        Column("time", np.insert(t, gaps + 1, 0.5 * (t[gaps] + t[gaps + 1])), _TIME_S),
        *(
            Column(name, np.insert(values[kept], gaps + 1, np.nan), step)
            for name, values, step in found
            if wanted_columns is None or name.partition("_")[0] in wanted_columns
        ),
    ]
    return columns, len(t) + len(gaps)


def _before_gaps(time_s: Floats) -> NDArray[np.bool_]:
    """(n,) True at the last sample before a gap."""
    return np.append(np.diff(time_s) > MAX_GAP_S, False)


def _kept_samples(telemetry: Telemetry, samples: Samples) -> NDArray[np.intp]:
    """The samples that the page carries: all; of a long flight every `stride`-th, and besides the peaks of
    error and tension, both sides of each gap, and the moments at which the load leaves the cable."""
    n = len(samples.time_s)
    stride = -(-n // MAX_ROWS)
    kept = np.zeros(n, dtype=np.bool_)
    kept[:: max(stride, 1)] = True
    if stride > 1:
        before_gap = _before_gaps(samples.time_s)
        kept |= before_gap | np.roll(before_gap, 1)
        kept[1:] |= np.diff(samples.attached)
        kept[-1] = True
        error = np.linalg.norm(samples.error_m, axis=1)
        for values in (error, telemetry.load_truth.tension_n, -telemetry.load_truth.tension_n):
            blocks = np.full(-(-n // stride) * stride, -np.inf)
            blocks[:n] = np.where(np.isfinite(values), values, -np.inf)
            peaks = blocks.reshape(-1, stride).argmax(axis=1) + np.arange(0, n, stride)
            kept[np.minimum(peaks, n - 1)] = True
    return np.flatnonzero(kept)


def _xyz(name: str, values: Floats, step: float) -> list[Column]:
    return _components(name, "xyz", values, step)


def _components(name: str, parts: Sequence[str], values: Floats, step: float) -> list[Column]:
    return [Column(f"{name}_{part}", values[:, i], step) for i, part in enumerate(parts)]
