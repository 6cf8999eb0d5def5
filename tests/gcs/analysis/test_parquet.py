"""The columns of flight.parquet that are computed from several messages, in a flight of the simulator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from autopilot.onboard.onboard import Onboard
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.tlog import TlogWriter
from gcs.analysis.parquet import flight_columns
from gcs.analysis.samples import samples_of
from gcs.analysis.telemetry import load_telemetry
from gcs.closed_loop import Conditions, fly
from missions.fileformat import load_mission
from sitl.hil import HilSimulator
from tests.doubles import recorded_flights as flights


def test_velocity_estimates_command_and_wind_belong_to_the_true_motion(tmp_path: Path) -> None:
    log = tmp_path / "flight.tlog"
    wind = {"SIM_WIND_E": 1.5, "SIM_WIND_N": -0.5}
    with log.open("wb") as file:
        assert fly(load_mission("case-b"), Conditions(settings=wind), TlogWriter(file)).name == "completed"
    telemetry = load_telemetry(log)
    table = flight_columns(telemetry, samples_of(telemetry))
    inside = table["in_mission"]

    def column(name: str) -> np.ndarray:
        return np.asarray(table[name][inside])

    for axis, blown in zip("xyz", (1.5, -0.5, 0.0), strict=True):
        moved = np.gradient(column(f"vehicle_true_{axis}_m"), column("time_s"))[1:-1]
        assert column(f"vehicle_velocity_true_{axis}_m_s")[1:-1] == pytest.approx(moved, abs=1e-3)
        assert column(f"vehicle_estimated_{axis}_m") == pytest.approx(
            column(f"vehicle_true_{axis}_m"), abs=5e-3
        )
        for known in ("estimated", "commanded"):
            assert column(f"cable_{known}_{axis}") == pytest.approx(column(f"cable_true_{axis}"), abs=0.05), (
                known
            )
        assert (column(f"wind_{axis}_m_s") == blown).all()
    for angle in ("roll", "pitch", "yaw"):
        estimated = column(f"vehicle_angle_estimated_{angle}_rad")
        assert estimated == pytest.approx(column(f"vehicle_angle_{angle}_rad"), abs=5e-3)


def test_the_vehicle_velocity_is_the_simulators_also_at_impacts(tmp_path: Path) -> None:
    log = tmp_path / "flight.tlog"
    velocities: dict[float, tuple[float, ...]] = {}
    was_slack = []

    def watch(_: Onboard, simulator: HilSimulator) -> bool:
        velocities[simulator.now_us] = simulator.core.state.v_quad
        was_slack.append(not simulator.core.state.taut)
        return True

    with log.open("wb") as file:
        mission = load_mission("hover")
        assert fly(mission, Conditions(), TlogWriter(file), watch).name == "completed"
    telemetry = load_telemetry(log)
    table = flight_columns(telemetry, samples_of(telemetry))
    true = np.array([velocities[us] for us in np.round(table["time_s"] * 1e6).astype(int).tolist()])
    assert np.diff(was_slack).sum() >= 2, "it came taut and went slack"
    for i, axis in enumerate("xyz"):
        # half a step of HIL_STATE_QUATERNION, in single precision
        assert table[f"vehicle_velocity_true_{axis}_m_s"] == pytest.approx(true[:, i], abs=5.001e-3), axis


@pytest.mark.parametrize(
    "mode",
    [mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE, mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE],
)
def test_an_attitude_run_has_no_desired_path(mode: int) -> None:
    flight = flights.flight(4.0, flights.half_sine_step(0.25, 0.5))
    run = flight.mission & (flight.time_s > flights.BEFORE_S + 1.0) & (flight.time_s < flights.BEFORE_S + 2.0)
    flight.control_mode[run] = mode
    telemetry = flight.telemetry()
    table = flight_columns(telemetry, samples_of(telemetry))
    assert (table["control_mode"] == mode).sum() == run.sum() > 100
    columns = ("load_desired_{}_m", "load_asked_{}_m", "load_error_{}_m")
    columns += ("load_velocity_desired_{}_m_s", "load_acceleration_desired_{}_m_s2")
    for column in columns:
        for axis in "xyz":
            missing = np.isnan(table[column.format(axis)])
            assert (missing[flight.mission] == run[flight.mission]).all(), column
    assert np.isfinite(table["load_true_x_m"]).all()
