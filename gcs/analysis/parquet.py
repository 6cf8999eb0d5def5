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
from gcs.analysis.samples import PHASE_NAMES, Samples
from gcs.analysis.tracks import Telemetry, numbers
from gcs.formats.arrow import array_of, text_array

if TYPE_CHECKING:
    import pyarrow

METADATA_KEY = b"plumbline"

_AXES = ("x", "y", "z")


def _spread(name: str, unit: str, values: Floats, parts: tuple[str, ...] = _AXES) -> dict[str, Floats]:
    """(n, k) as k columns `name_part_unit`."""
    suffix = f"_{unit}" if unit else ""
    return {f"{name}_{part}{suffix}": values[:, i] for i, part in enumerate(parts)}


def flight_columns(telemetry: Telemetry, samples: Samples) -> dict[str, Any]:
    """The columns of flight.parquet except the name of the phase; ENU and FLU, SI and rad."""
    t = samples.time_s
    truth, cascade = telemetry.load_truth, telemetry.cascade
    true_rotors, commanded = telemetry.rotors_truth, telemetry.rotors_commanded
    attitude = telemetry.attitude_truth

    def error(values: Floats) -> Floats:
        return linear(cascade.time_s, values, t)

    def held(values: Any) -> Floats:
        return as_of(commanded.time_s, values.astype(np.float64), t)

    cable = ("phi", "theta")
    return {
        "time_s": t,
        "mission_item": samples.item,
        "control_mode": samples.control_mode,
        "in_mission": samples.in_mission,
        **_spread("load_desired", "m", samples.desired_m),
        **_spread("load_asked", "m", samples.asked_m),
        **_spread("load_true", "m", samples.actual_m),
        **_spread("load_estimated", "m", samples.estimated_m),
        **_spread("load_error", "m", samples.error_m),
        **_spread("load_velocity_desired", "m_s", samples.desired_m_s),
        **_spread("load_velocity_true", "m_s", samples.actual_m_s),
        **_spread("cable_true", "", truth.q_cable),
        **_spread("cable_rate_true", "per_s", truth.q_cable_dot),
        **_spread("cable_angle", "rad", cable_angles(truth.q_cable), cable),
        "cable_distance_m": truth.distance_m,
        "cable_tension_n": truth.tension_n,
        "cable_taut": truth.taut == 1,
        "cable_slack_events": truth.slack_events,
        **_spread("vehicle_true", "m", samples.vehicle_m),
        **_spread("vehicle_quaternion", "", samples.quat_wxyz, ("w", "x", "y", "z")),
        **_spread("vehicle_angle", "rad", roll_pitch_yaw(samples.quat_wxyz), ("roll", "pitch", "yaw")),
        **_spread("vehicle_rate", "rad_s", linear(attitude.time_s, attitude.omega_body, t)),
        **_spread(
            "rotor_force", "n", as_of(true_rotors.time_s, true_rotors.force_n, t), numbers(true_rotors)
        ),
        **_spread("rotor_command", "n", held(commanded.force_n), numbers(commanded)),
        "rotor_saturated": held(commanded.saturated),
        "thrust_asked_n": error(cascade.thrust_n),
        **_spread("moment_asked", "n_m", error(cascade.moment_n_m)),
        **_spread("e_x", "m", error(cascade.e_x)),
        **_spread("e_v", "m_s", error(cascade.e_v)),
        **_spread("e_q", "", error(cascade.e_q)),
        **_spread("e_q_dot", "per_s", error(cascade.e_q_dot)),
        **_spread("e_R", "", error(cascade.e_R)),
        **_spread("e_Omega", "rad_s", error(cascade.e_Omega)),
        "psi_R": error(cascade.psi_R),
        "psi_q": error(cascade.psi_q),
    }


_WHOLE = {
    "mission_item": "int32",
    "control_mode": "int8",
    "cable_slack_events": "int32",
    "rotor_saturated": "int16",
}


def flight_table(telemetry: Telemetry, samples: Samples, about: dict[str, Any]) -> pyarrow.Table:
    """The Arrow table; `about` (JSON values) becomes its schema metadata under METADATA_KEY."""
    import pyarrow as pa

    columns = flight_columns(telemetry, samples)
    arrays: dict[str, Any] = {"time_s": array_of(columns.pop("time_s"))}
    # a dictionary array becomes a categorical in pandas
    names = [PHASE_NAMES[value] for value in range(len(PHASE_NAMES))]
    unknown = (samples.phase < 0) | (samples.phase >= len(names))
    codes = np.where(unknown, 0, samples.phase).astype(np.int8)
    arrays["phase"] = pa.DictionaryArray.from_arrays(array_of(codes, unknown), text_array(names))
    for name, values in columns.items():
        if name in _WHOLE:
            missing = np.isnan(values) if values.dtype.kind == "f" else values < 0
            arrays[name] = array_of(np.where(missing, 0, values).astype(_WHOLE[name]), missing)
        elif values.dtype.kind == "f":
            arrays[name] = array_of(values, np.isnan(values))
        else:
            arrays[name] = array_of(values)
    table = pa.Table.from_arrays(list(arrays.values()), list(arrays))
    return table.replace_schema_metadata({METADATA_KEY: json.dumps(about).encode()})


def write_flight(path: Path, telemetry: Telemetry, samples: Samples, about: dict[str, Any]) -> None:
    """Write flight.parquet."""
    from pyarrow import parquet

    parquet.write_table(flight_table(telemetry, samples, about), path, compression="zstd")
