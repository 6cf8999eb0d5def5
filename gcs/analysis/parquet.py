"""flight.parquet: one table, one row per sample of the true load state, units in the column names.

Everything that the autopilot sent is brought to the times of the truth (`gcs.analysis.samples`): cubics for
positions, straight lines for errors, the last value for commands and counters. A missing value is null.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gcs.analysis.align import as_of, linear
from gcs.analysis.axes import Floats, cable_angles, roll_pitch_yaw
from gcs.analysis.item_time import item_began_s
from gcs.analysis.samples import PHASE_NAMES, Samples
from gcs.analysis.tracks import Telemetry, rotor_names
from gcs.formats.arrow import array_of, path_for_arrow, text_array

if TYPE_CHECKING:
    import pyarrow

METADATA_KEY = b"plumbline"

_AXES = ("x", "y", "z")


def _component_columns(
    name: str, unit: str, values: Floats, parts: tuple[str, ...] = _AXES
) -> dict[str, Floats]:
    """(n, k) as k columns `name_part_unit`."""
    suffix = f"_{unit}" if unit else ""
    return {f"{name}_{part}{suffix}": values[:, i] for i, part in enumerate(parts)}


def flight_columns(telemetry: Telemetry, samples: Samples) -> dict[str, Any]:
    """The columns of flight.parquet except the name of the phase; ENU and FLU, SI and rad."""
    t = samples.time_s
    truth, cascade = telemetry.load_truth, telemetry.cascade
    true_rotors, commanded = telemetry.rotors_truth, telemetry.rotors_commanded
    attitude, estimated_attitude = telemetry.attitude_truth, telemetry.attitude_estimated
    estimate, setpoint, wind = telemetry.load_estimated, telemetry.setpoint, telemetry.wind
    estimated_quat = linear(estimated_attitude.time_s, estimated_attitude.quat_wxyz, t)
    acceleration = linear(setpoint.time_s, setpoint.acceleration_m_s2, t)
    acceleration[np.isnan(samples.desired_m).any(axis=1)] = np.nan  # zero is sent where there is no path
    began_s = as_of(setpoint.time_s, item_began_s(setpoint, telemetry.mission_reached), t)
    battery = telemetry.battery
    wind_m_s = as_of(wind.time_s, wind.wind_m_s + wind.gust_m_s, t, max_gap_s=np.inf)

    def interpolated(values: Floats) -> Floats:
        return linear(cascade.time_s, values, t)

    def latest(values: Any) -> Floats:
        return as_of(commanded.time_s, values.astype(np.float64), t)

    def battery_at(values: Floats) -> Floats:
        return as_of(battery.time_s, values, t, max_gap_s=battery.GAP_S)

    cable = ("phi", "theta")
    return {
        "time_s": t,
        "mission_item": samples.item,
        "item_time_s": t - began_s,
        "control_mode": samples.control_mode,
        "in_mission": samples.in_mission,
        **_component_columns("load_desired", "m", samples.desired_m),
        **_component_columns("load_asked", "m", samples.requested_m),
        **_component_columns("load_true", "m", samples.actual_m),
        **_component_columns("load_estimated", "m", samples.estimated_m),
        **_component_columns("load_error", "m", samples.error_m),
        **_component_columns("load_velocity_desired", "m_s", samples.desired_m_s),
        **_component_columns("load_velocity_true", "m_s", samples.actual_m_s),
        **_component_columns(
            "load_velocity_estimated", "m_s", linear(estimate.time_s, estimate.velocity_m_s, t)
        ),
        **_component_columns("load_acceleration_desired", "m_s2", acceleration),
        **_component_columns("cable_true", "", truth.q_cable),
        **_component_columns("cable_estimated", "", linear(estimate.time_s, estimate.q_cable, t)),
        **_component_columns("cable_commanded", "", as_of(setpoint.time_s, setpoint.q_cable_c, t)),
        **_component_columns("cable_rate_true", "per_s", truth.q_cable_dot),
        **_component_columns(
            "cable_rate_estimated", "per_s", linear(estimate.time_s, estimate.q_cable_dot, t)
        ),
        **_component_columns("cable_angle", "rad", cable_angles(truth.q_cable), cable),
        "cable_distance_m": truth.distance_m,
        "cable_tension_n": truth.tension_n,
        "cable_taut": truth.taut == 1,
        "cable_slack_events": truth.slack_events,
        **_component_columns("vehicle_true", "m", samples.vehicle_m),
        **_component_columns("vehicle_estimated", "m", linear(estimate.time_s, estimate.vehicle_m, t)),
        **_component_columns("vehicle_velocity_true", "m_s", samples.vehicle_m_s),
        **_component_columns("vehicle_quaternion", "", samples.quat_wxyz, ("w", "x", "y", "z")),
        **_component_columns(
            "vehicle_angle", "rad", roll_pitch_yaw(samples.quat_wxyz), ("roll", "pitch", "yaw")
        ),
        **_component_columns(
            "vehicle_angle_estimated", "rad", roll_pitch_yaw(estimated_quat), ("roll", "pitch", "yaw")
        ),
        **_component_columns("vehicle_rate", "rad_s", linear(attitude.time_s, attitude.omega_body, t)),
        **_component_columns("wind", "m_s", wind_m_s),
        **_component_columns(
            "rotor_force", "n", as_of(true_rotors.time_s, true_rotors.force_n, t), rotor_names(true_rotors)
        ),
        **_component_columns("rotor_command", "n", latest(commanded.force_n), rotor_names(commanded)),
        "rotor_saturated": latest(commanded.saturated),
        "thrust_asked_n": interpolated(cascade.thrust_n),
        **_component_columns("moment_asked", "n_m", interpolated(cascade.moment_n_m)),
        **_component_columns("e_x", "m", interpolated(cascade.e_x)),
        **_component_columns("e_v", "m_s", interpolated(cascade.e_v)),
        **_component_columns("e_q", "", interpolated(cascade.e_q)),
        **_component_columns("e_q_dot", "per_s", interpolated(cascade.e_q_dot)),
        **_component_columns("e_R", "", interpolated(cascade.e_R)),
        **_component_columns("e_Omega", "rad_s", interpolated(cascade.e_Omega)),
        "psi_R": interpolated(cascade.psi_R),
        "psi_q": interpolated(cascade.psi_q),
        "battery_voltage_v": battery_at(battery.voltage_v),
        "battery_current_a": battery_at(battery.current_a),
        "battery_used_mah": battery_at(battery.used_mah),
        "battery_left_pct": battery_at(battery.left_pct),
    }


_INTEGER_TYPES = {
    "mission_item": "int32",
    "control_mode": "int8",
    "cable_slack_events": "int32",
    "rotor_saturated": "int16",
}


def flight_table(telemetry: Telemetry, samples: Samples, metadata: dict[str, Any]) -> pyarrow.Table:
    """The Arrow table; `metadata` (JSON values) becomes its schema metadata under METADATA_KEY."""
    import pyarrow as pa

    columns = flight_columns(telemetry, samples)
    arrays: dict[str, Any] = {"time_s": array_of(columns.pop("time_s"))}
    # a dictionary array becomes a categorical in pandas
    names = [PHASE_NAMES[value] for value in range(len(PHASE_NAMES))]
    unknown = (samples.phase < 0) | (samples.phase >= len(names))
    codes = np.where(unknown, 0, samples.phase).astype(np.int8)
    arrays["phase"] = pa.DictionaryArray.from_arrays(array_of(codes, unknown), text_array(names))
    for name, values in columns.items():
        if name in _INTEGER_TYPES:
            missing = np.isnan(values) if values.dtype.kind == "f" else values < 0
            arrays[name] = array_of(np.where(missing, 0, values).astype(_INTEGER_TYPES[name]), missing)
        elif values.dtype.kind == "f":
            arrays[name] = array_of(values, np.isnan(values))
        else:
            arrays[name] = array_of(values)
    table = pa.Table.from_arrays(list(arrays.values()), list(arrays))
    return table.replace_schema_metadata({METADATA_KEY: json.dumps(metadata).encode()})


def write_flight(path: Path, telemetry: Telemetry, samples: Samples, metadata: dict[str, Any]) -> None:
    """Write flight.parquet."""
    from pyarrow import parquet

    table = flight_table(telemetry, samples, metadata)
    parquet.write_table(table, path_for_arrow(path), compression="zstd")
