"""The record of a flight: the keys of summary.json, their meaning, and how they are filled from telemetry."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any, NamedTuple

from gcs.analysis import metrics
from gcs.analysis.samples import Samples, samples_of
from gcs.analysis.tracks import Telemetry

Record = dict[str, Any]

_DIGITS = 9  # wire values are single precision: what follows is noise of their conversion


@dataclass(frozen=True)
class FlightMeta:
    """What telemetry does not say about a flight; kept as meta.json beside the log. None: not known."""

    mission: str | None = None
    title: str | None = None  # of the mission, for people
    law: str | None = None
    sensors: str | None = None
    vehicle: str | None = None
    seed: int | None = None
    outcome: str | None = None  # of the client that flew it; else it is judged from telemetry
    reason: str | None = None  # for that outcome, one line
    wall_s: float | None = None  # wall time over which the log was recorded
    command: str | None = None  # command line that flies it again
    version: str | None = None  # of Plumbline
    settings: dict[str, float | str] = field(default_factory=dict)  # parameters that were changed

    def to_json(self) -> Record:
        """Plain JSON values, NaN as null."""
        return jsonable(asdict(self))

    @classmethod
    def from_json(cls, values: Record) -> FlightMeta:
        """The known keys of `values`; unknown ones, of later versions, are passed over."""
        known = {f.name for f in fields(cls)}
        return cls(**{name: value for name, value in values.items() if name in known and value is not None})


class Key(NamedTuple):
    """One key of the record as people read it."""

    name: str
    label: str
    unit: str  # as shown
    scale: float  # shown value = scale * recorded value
    decimals: int | None  # None: text or a whole number
    definition: str  # what the recorded value is, with its own unit in the name


class Group(NamedTuple):
    """Keys that are shown together."""

    title: str
    keys: tuple[Key, ...]


GROUPS: tuple[Group, ...] = (
    Group(
        "Flight",
        (
            Key("mission", "Mission", "", 1.0, None, "name or path of the mission flown"),
            Key("law", "Control law", "", 1.0, None, "`thesis`, `lqr` or `plumbline`"),
            Key("sensors", "Sensors", "", 1.0, None, "sensor profile"),
            Key("vehicle", "Vehicle", "", 1.0, None, "true vehicle"),
            Key("seed", "Seed", "", 1.0, None, "seed of the sensor noise"),
            Key("outcome", "Outcome", "", 1.0, None, "how the flight ended, see below"),
            Key(
                "flight_s",
                "Flight",
                "s",
                1.0,
                1,
                "vehicle clock from take-off (first airborne phase) to touchdown",
            ),
            Key("mission_s", "Mission", "s", 1.0, 1, "vehicle clock spent in phase MISSION"),
            Key(
                "recorded_s",
                "Recorded",
                "s",
                1.0,
                1,
                "vehicle clock from the first to the last stamped message",
            ),
            Key("wall_s", "Wall time", "s", 1.0, 1, "wall clock over which the log was recorded"),
            Key("real_time_factor", "Real-time factor", "×", 1.0, 1, "recorded_s / wall_s"),
        ),
    ),
    Group(
        "Load position error",
        (
            Key(
                "load_error_max_m",
                "Maximum",
                "mm",
                1e3,
                1,
                "greatest distance from asked to true load position",
            ),
            Key("load_error_rms_m", "RMS", "mm", 1e3, 1, "root of the mean square of that distance"),
            Key(
                "load_error_final_m",
                "At the end",
                "mm",
                1e3,
                1,
                "that distance at the last sample of the window",
            ),
            Key(
                "shaping_distance_max_m",
                "Path flown from path asked",
                "mm",
                1e3,
                1,
                "greatest distance from the asked path to the one that is flown",
            ),
            Key(
                "tracking_error_max_m",
                "Load from path flown",
                "mm",
                1e3,
                1,
                "greatest distance from the flown path to the true load position",
            ),
            Key("load_error_max_x_m", "Maximum x", "mm", 1e3, 1, "greatest absolute error along x (east)"),
            Key("load_error_max_y_m", "Maximum y", "mm", 1e3, 1, "greatest absolute error along y (north)"),
            Key("load_error_max_z_m", "Maximum z", "mm", 1e3, 1, "greatest absolute error along z (up)"),
            Key("load_error_rms_x_m", "RMS x", "mm", 1e3, 1, "root mean square error along x"),
            Key("load_error_rms_y_m", "RMS y", "mm", 1e3, 1, "root mean square error along y"),
            Key("load_error_rms_z_m", "RMS z", "mm", 1e3, 1, "root mean square error along z"),
            Key(
                "load_speed_max_m_s", "Load speed, maximum", "m/s", 1.0, 2, "greatest true speed of the load"
            ),
        ),
    ),
    Group(
        "Step response",
        (
            Key(
                "step_height_m", "Step height", "m", 1.0, 3, "distance from start to end of the desired path"
            ),
            Key("rise_time_90_s", "Rise to 90 %", "s", 1.0, 3, "first time at 90 % of the height"),
            Key(
                "overshoot_pct",
                "Overshoot",
                "%",
                1.0,
                1,
                "greatest excess over the height, percent of the height",
            ),
            Key(
                "settling_time_5pct_s", "Settling to 5 %", "s", 1.0, 3, "last time outside 5 % of the height"
            ),
        ),
    ),
    Group(
        "Vehicle and cable",
        (
            Key("psi_R_max", "Ψ_R, maximum", "", 1.0, 4, "greatest vehicle attitude error function, 0 ... 2"),
            Key("psi_q_max", "Ψ_q, maximum", "", 1.0, 4, "greatest load attitude error function, 0 ... 2"),
            Key(
                "tilt_max_deg",
                "Vehicle tilt, maximum",
                "°",
                1.0,
                1,
                "greatest true angle of thrust from vertical",
            ),
            Key(
                "swing_max_deg",
                "Cable swing, maximum",
                "°",
                1.0,
                1,
                "greatest true angle of cable from vertical",
            ),
            Key("tension_min_n", "Tension, minimum", "N", 1.0, 3, "least true cable tension"),
            Key("tension_max_n", "Tension, maximum", "N", 1.0, 3, "greatest true cable tension"),
            Key("slack_events", "Slack events", "", 1.0, None, "times the cable went slack while carried"),
            Key("snaps", "Snaps", "", 1.0, None, "times the slack cable came taut, take-off to touchdown"),
            Key(
                "snap_speed_max_m_s",
                "Snap, closing speed",
                "m/s",
                1.0,
                3,
                "greatest speed at which the distance grew to the cable's length",
            ),
            Key(
                "snap_impulse_max_n_s",
                "Snap, impulse",
                "N s",
                1.0,
                4,
                "greatest impulse the cable exchanged as it came taut",
            ),
            Key(
                "snap_tension_max_n",
                "Snap, tension after it",
                "N",
                1.0,
                3,
                "greatest true tension in the half second after a snap, without the impulse itself",
            ),
        ),
    ),
    Group(
        "Gust pulses",
        (
            Key("gusts", "Gusts", "", 1.0, None, "gust pulses within the time in which the load was carried"),
            Key(
                "gust_error_max_m",
                "Load error, maximum",
                "mm",
                1e3,
                1,
                "greatest load position error from the begin of a gust on",
            ),
            Key(
                "gust_recovery_50mm_s",
                "Back within 50 mm",
                "s",
                1.0,
                2,
                "longest time from the end of a gust to the last error above 50 mm",
            ),
        ),
    ),
    Group(
        "Rotors",
        (
            Key(
                "saturated_fraction",
                "Saturated",
                "%",
                100.0,
                1,
                "share of rotor commands of which a limit cut one",
            ),
            Key("rotor_force_min_n", "Force, minimum", "N", 1.0, 3, "least true force of a rotor"),
            Key("rotor_force_max_n", "Force, maximum", "N", 1.0, 3, "greatest true force of a rotor"),
        ),
    ),
    Group(
        "Estimator, clock and capture",
        (
            Key(
                "estimator_error_max_m",
                "Load estimate, maximum error",
                "mm",
                1e3,
                1,
                "estimated minus true position",
            ),
            Key(
                "estimator_error_rms_m",
                "Load estimate, RMS error",
                "mm",
                1e3,
                1,
                "root mean square of the same",
            ),
            Key("rate_hz", "Rate", "Hz", 1.0, 1, "median tick rate of the simulator; null in lockstep"),
            Key(
                "late_p50_us",
                "Tick lateness, median",
                "µs",
                1.0,
                None,
                "worst one-second median; null in lockstep",
            ),
            Key(
                "late_p99_us",
                "Tick lateness, 99 %",
                "µs",
                1.0,
                None,
                "worst one-second 99 %; null in lockstep",
            ),
            Key("late_max_us", "Tick lateness, maximum", "µs", 1.0, None, "greatest; null in lockstep"),
            Key("missed_ticks", "Missed ticks", "", 1.0, None, "ticks whose actuator command came too late"),
            Key("samples", "Samples", "", 1.0, None, "samples of the true load state in the mission window"),
            Key("gap_max_s", "Longest gap", "ms", 1e3, 1, "longest time between two of them"),
            Key(
                "matched_fraction",
                "With a setpoint",
                "%",
                100.0,
                1,
                "share of them with a known desired position",
            ),
        ),
    ),
)
KEYS: tuple[Key, ...] = tuple(key for group in GROUPS for key in group.keys)
KEY: dict[str, Key] = {key.name: key for key in KEYS}


def flight_record(telemetry: Telemetry, meta: FlightMeta, samples: Samples | None = None) -> Record:
    """Every key of KEYS, in that order, then report_dir (None here); None for what cannot be known."""
    samples = samples_of(telemetry) if samples is None else samples
    found: Record = {
        "mission": meta.mission,
        "law": meta.law,
        "sensors": meta.sensors,
        "vehicle": meta.vehicle,
        "seed": meta.seed,
        "outcome": meta.outcome or metrics.outcome_of(telemetry, samples),
        **metrics.time_numbers(telemetry, meta.wall_s),
        **metrics.tracking_numbers(samples),
        **metrics.step_numbers(samples),
        **metrics.cascade_numbers(telemetry),
        **metrics.cable_numbers(telemetry, samples),
        **metrics.snap_numbers(telemetry),
        **metrics.gust_numbers(telemetry, samples),
        **metrics.rotor_numbers(telemetry),
        **metrics.estimator_numbers(samples),
        **metrics.clock_numbers(telemetry),
        **metrics.coverage_numbers(samples),
    }
    return jsonable({**{key.name: found[key.name] for key in KEYS}, "report_dir": None})


def jsonable(values: Record) -> Record:
    """The same with only what JSON knows: None for numbers that are not finite; floats lose their noise."""
    return {name: _plain(value) for name, value in values.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return jsonable(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    return value


def shown(key: Key, record: Record) -> str:
    """The value of a key as people read it, with its unit; an en dash where it is not known."""
    value = record.get(key.name)
    if value is None:
        return "–"
    if key.unit == "mm" and abs(value) >= 1.0:
        return f"{value:.2f} m"
    text = f"{value * key.scale:.{key.decimals}f}" if key.decimals is not None else str(value)
    return f"{text} {key.unit}".rstrip() if key.unit != "°" else f"{text}{key.unit}"
