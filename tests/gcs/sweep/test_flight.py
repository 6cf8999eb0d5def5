"""The flight without messages is the flight with them, bit for bit.

Both use the same code for world and flight software, so little is left to compare: what the sweep has in
place of messages (the rounding of readings and commands), the ticks at which the supervisor is called, the
order within a tick, and the times at which the ground station acts.
"""

from __future__ import annotations

import io
import re
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from autopilot.onboard.onboard import Onboard
from autopilot.own.own_code import OwnCode
from autopilot.wire.tlog import TlogWriter, read_tlog
from gcs.analysis.record import FlightMeta, Record, flight_record
from gcs.analysis.telemetry import telemetry_of
from gcs.closed_loop import Conditions
from gcs.closed_loop import fly as fly_with_wire
from gcs.mission_files import load
from gcs.sweep.cell import Cell, cell_of
from gcs.sweep.flight import TRACE_COLUMNS, FlightResult, fly, start_times
from missions.fileformat import load_mission
from missions.model import Mission, Takeoff
from plumbline.laws import Asked, Now, force
from sitl.hil import HilSimulator
from sitl.sensors.files import load_profile
from tests.gcs import tolerances

MOST_TICKS = 20_000
THESIS, LQR, PLUMBLINE, OWN = 0.0, 1.0, 2.0, 3.0
ROUGH = {"SIM_ACT_DELAY_MS": 9.0, "SIM_DROP_PCT": 10.0, "SIM_GUST_STD": 0.5, "SIM_LOAD_MASS": 0.12}
TELEMETRY_S = 0.008  # between two samples of the record
FENCE_M = 0.3
STOP_ROTORS, LAND = 4.0, 5.0  # GF_ACTION


class NoLog:
    def write(self, unix_us: int, *frames: bytes) -> None:
        pass


def flown(name: str, conditions: Conditions) -> tuple[FlightResult, NDArray[np.float64]]:
    """Fly both ways and compare every true state; return the sweep's result and the states."""
    mission = load(name)
    real = np.full((MOST_TICKS, TRACE_COLUMNS), np.nan)

    def watch(_: Onboard, simulator: HilSimulator) -> bool:
        core = simulator.core
        p = core.state
        real[core.tick_count] = (*p.x_load, *p.x_quad, *p.quat_wxyz, *core.rotor_force)
        return True

    outcome = fly_with_wire(mission, conditions, NoLog(), watch)
    fused = np.full((MOST_TICKS, TRACE_COLUMNS), np.nan)
    found = fly(mission, conditions, start_times(mission, conditions), fused)
    assert (found.outcome, found.reason) == (outcome.name, outcome.reason)
    # the ground station continues to listen for a moment
    ticks = int(np.isfinite(fused[:, 0]).sum())
    assert 1000 < ticks <= np.isfinite(real[:, 0]).sum()
    assert np.array_equal(fused[:ticks], real[:ticks])
    return found, fused[:ticks]


@pytest.mark.parametrize("law", [THESIS, LQR, PLUMBLINE])
def test_same_bits_with_each_law(short: str, law: float) -> None:
    flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": law}))


@pytest.mark.parametrize("law", ["load_pid:LoadPid", "geometric:Geometric"])
def test_same_bits_with_a_law_of_ones_own(short: str, law: str) -> None:
    found, _ = flown(short, Conditions(settings={"CTL_LAW": OWN}, own=OwnCode(f"plumbline.examples.{law}")))
    assert found.outcome == "completed"


@pytest.mark.parametrize("law", ["", "plumbline.examples.geometric:Geometric"])
def test_same_bits_with_an_estimator_of_ones_own(short: str, law: str) -> None:
    own = OwnCode(law, estimator="plumbline.examples.luenberger:Luenberger")
    found, _ = flown(short, Conditions(settings={"CTL_LAW": OWN if law else PLUMBLINE}, own=own))
    assert found.outcome == "completed"


class Failing:
    """A law that fails in flight."""

    def load_position(self, memory: None, now: Now) -> tuple[None, Asked]:
        b = now.believed
        up = 1.0 - now.state.x_load[2] - now.state.v_load[2] if now.time_s < 5.0 else 1.0 / 0.0
        return None, force((0.0, 0.0, (b.quad_mass + b.load_mass) * (b.gravity + up)))


def test_same_bits_with_a_law_that_fails(short: str) -> None:
    found, _ = flown(short, Conditions(settings={"CTL_LAW": OWN}, own=OwnCode(f"{__file__}:Failing")))
    assert found.outcome == "diverged"
    assert found.reason.startswith("Law Failing failed: ZeroDivisionError: float division by zero")


def test_same_bits_under_rough_conditions(short: str) -> None:
    flown(short, Conditions(sensors="lab", seed=2, settings={"CTL_LAW": PLUMBLINE, **ROUGH}))


def test_same_bits_with_late_sensors(short: str) -> None:
    settings = {"CTL_LAW": PLUMBLINE, "SIM_SENS_LAT_MS": 26.0, "SIM_ACT_DELAY_MS": 9.0}
    flown(short, Conditions(sensors="lab", seed=1, settings=settings))


def test_same_bits_with_two_ticks_for_each_command(short: str) -> None:
    settings = {"CTL_LAW": PLUMBLINE, "SIM_RATE_HZ": 500.0}
    flown(short, Conditions(sensors="ideal", seed=1, settings=settings))


def test_same_end_of_a_flight_that_is_lost(short: str) -> None:
    flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": THESIS, "SIM_ACT_DELAY_MS": 60.0}))


def test_same_end_of_a_flight_that_a_gust_throws_to_the_ground(short: str) -> None:
    gust = {"SIM_GUST_U": -45.0, "SIM_GUST_AT_S": 10.0, "SIM_GUST_FOR_S": 2.0}
    found, _ = flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": PLUMBLINE, **gust}))
    assert found.outcome == "diverged"
    slack, failure, *_ = found.reason.split("; ")
    assert slack == "Cable slack: falling with the load to catch it"
    assert failure == "Failsafe: vehicle position not settled after an impact, landing"
    # the figures end with the failure, and the flight is followed for two seconds more
    assert found.lost_phase in ("lift", "mission")


def test_same_end_of_a_flight_that_empties_its_battery(short: str) -> None:
    """30 mAh: the voltage falls to nothing, and the rotors stop."""
    settings = {"CTL_LAW": PLUMBLINE, "SIM_BATTERY": 1.0, "SIM_BAT_CAP": 30.0}
    found, states = flown(short, Conditions(sensors="lab", seed=1, settings=settings))
    assert (found.outcome, found.reason) == (
        "diverged",
        "Failsafe: rotors 1, 2, 3, 4 lost, the others cannot fly it (battery nearly empty)",
    )
    assert states[-1, 10:].max() < 0.1


def test_same_bits_where_a_low_battery_ends_the_mission(short: str) -> None:
    settings = {"SIM_BATTERY": 1.0, "SIM_BAT_CAP": 60.0, "COM_LOW_BAT_ACT": 3.0, "BAT_CRIT_THR": 0.7}
    found, _ = flown(short, Conditions(sensors="lab", seed=1, settings={"CTL_LAW": PLUMBLINE, **settings}))
    assert found.outcome == "interrupted"
    assert "Failsafe: battery nearly empty, 70 % left, returning" in found.texts


def test_same_bits_with_receiver_and_camera(short: str) -> None:
    gust = {"SIM_GUST_E": 2.0, "SIM_GUST_AT_S": 12.0, "SIM_GUST_FOR_S": 1.0}
    flown(short, Conditions(sensors="rtk", seed=1, settings={"CTL_LAW": PLUMBLINE, **gust}))


def test_same_bits_where_a_path_waits(short: str) -> None:
    settings = {"FS_LOAD_ERR": 0.05, "SIM_GUST_E": -10.0, "SIM_GUST_AT_S": 11.0, "SIM_GUST_FOR_S": 1.0}
    waited, _ = flown(short, Conditions(sensors="lab", seed=1, settings=settings))
    settings["FS_LOAD_ERR"] = 5.0
    not_waited, _ = flown(short, Conditions(sensors="lab", seed=1, settings=settings))
    assert waited.outcome == not_waited.outcome == "completed"
    assert any(text.startswith("Path waits: load") for text in waited.texts)
    assert waited.mission_s > not_waited.mission_s + 1.0


def test_same_bits_with_readings_that_overtake_each_other_and_are_hidden(short: str) -> None:
    flown(short, Conditions(sensors="lab-real", seed=1, settings={"CTL_LAW": PLUMBLINE}))


def test_same_bits_with_fixes_that_float_and_are_lost(short: str) -> None:
    often = {"SIM_GPS_FLT": 20.0, "SIM_GPS_FLT_S": 1.0, "SIM_GPS_LOST": 10.0, "SIM_GPS_LOST_S": 0.3}
    flown(short, Conditions(sensors="field", seed=1, settings={"CTL_LAW": PLUMBLINE, **often}))


@pytest.mark.parametrize("sensors", ["lab", "rtk"])
def test_same_bits_where_the_load_is_released(delivery: str, sensors: str) -> None:
    flown(delivery, Conditions(sensors=sensors, seed=1, settings={"SIM_ACT_DELAY_MS": 5.0}))


def record_of(mission: Mission, conditions: Conditions) -> Record:
    """The record of a flight with messages."""
    log = io.BytesIO()
    fly_with_wire(mission, conditions, TlogWriter(log))
    log.seek(0)
    return flight_record(telemetry_of(read_tlog(log)), FlightMeta())


def test_figures_of_a_released_load_are_those_of_the_record(delivery: str) -> None:
    """The record samples what the sweep takes at every tick, in single precision."""
    conditions = Conditions(sensors="lab", seed=1, settings={"CTL_LAW": PLUMBLINE, "SIM_WIND_E": 3.0})
    mission = load_mission(delivery)
    record = record_of(mission, conditions)
    found = asdict(fly(mission, conditions, start_times(mission, conditions)))
    shared = {name: record[name] for name in found if isinstance(record.get(name), float)}
    assert len(shared) == 13
    sampled = {name: pytest.approx(value, rel=1e-3) for name, value in shared.items()}
    assert {name: found[name] for name in shared} == sampled


def test_what_the_record_misses_falls_between_its_samples(
    short: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Noise moves these figures from tick to tick; in a log with every tick they are those of the sweep."""
    mission, conditions = load(short), Conditions(settings={"CTL_LAW": PLUMBLINE, **ROUGH})
    found = asdict(fly(mission, conditions, start_times(mission, conditions)))
    names = ("psi_R_max", "psi_q_max")
    sampled = record_of(mission, conditions)
    monkeypatch.setattr("gcs.clients.flight.REPORT_INTERVAL_US", 4_000)
    complete = record_of(mission, conditions)
    assert {name: found[name] for name in names} == {
        name: pytest.approx(complete[name], rel=1e-6) for name in names
    }
    assert sampled["psi_R_max"] < 0.999 * found["psi_R_max"]


def test_the_charge_left_is_that_of_the_record(short: str) -> None:
    mission = load(short)
    battery = {"SIM_BATTERY": 1.0, "SIM_BAT_CAP": 310.0, "SIM_BAT_CHARGE": 80.0}
    conditions = Conditions(settings={"CTL_LAW": PLUMBLINE, **battery})
    record = record_of(mission, conditions)
    found = fly(mission, conditions, start_times(mission, conditions))
    assert found.outcome == "completed"
    assert 50.0 < found.battery_left_pct < 75.0
    mah_pct = 100.0 / battery["SIM_BAT_CAP"]  # reported in whole mAh, up to a second before the end
    assert found.battery_left_pct == pytest.approx(record["battery_left_pct"], abs=mah_pct + 1e-9)
    assert found.battery_left_pct % 1.0 != 0.0, "in finer steps than whole percents"
    none = Conditions(settings={"CTL_LAW": PLUMBLINE})
    assert np.isnan(fly(mission, none, start_times(mission, none)).battery_left_pct)


@pytest.mark.parametrize("name", ["stepped", "case-a"])
def test_the_step_response_is_that_of_the_record(request: pytest.FixtureRequest, name: str) -> None:
    """The record has a sample every 8 ms, so it may find the start of the step that much later; in between,
    both interpolate."""
    mission = load(request.getfixturevalue(name) if name == "stepped" else name)
    conditions = Conditions(sensors="lab", seed=3, settings={"CTL_LAW": PLUMBLINE})
    record = record_of(mission, conditions)
    found = fly(mission, conditions, start_times(mission, conditions))
    for key in ("rise_time_90_s", "settling_time_5pct_s"):
        assert getattr(found, key) == pytest.approx(record[key], abs=TELEMETRY_S + tolerances.CROSSING_S), key
    assert found.overshoot_pct == pytest.approx(record["overshoot_pct"], rel=0.01)


@pytest.mark.parametrize("name", ["short", "swung", "winched"])
def test_a_path_that_is_no_step_has_no_step_response(request: pytest.FixtureRequest, name: str) -> None:
    """Without a hold, there and back, and with a second motion."""
    mission = load(request.getfixturevalue(name))
    conditions = Conditions(settings={"CTL_LAW": PLUMBLINE})
    found = fly(mission, conditions, start_times(mission, conditions))
    assert found.outcome == "completed"
    assert np.isnan((found.rise_time_90_s, found.overshoot_pct, found.settling_time_5pct_s)).all()


@pytest.mark.parametrize("rate_hz", [125.0, 625.0])  # a tick of 8 and of 1.6 ms
def test_a_flight_starts_at_any_rate_of_the_simulator(short: str, rate_hz: float) -> None:
    mission = load_mission(short)
    times = start_times(mission, Conditions(settings={"CTL_RATE_HZ": 125.0}))
    at_rate = Conditions(settings={"CTL_RATE_HZ": 125.0, "SIM_RATE_HZ": rate_hz})
    assert fly(mission, at_rate, times).outcome == "completed"


def test_same_bits_where_the_first_path_begins_where_the_receiver_places_the_load() -> None:
    """A plain receiver is off by metres: the path of the mission as stored begins elsewhere."""
    found, states = flown("delivery", Conditions(sensors="gps", seed=1))
    assert found.outcome == "completed"
    assert np.hypot(states[-1, 0] - states[0, 0], states[-1, 1] - states[0, 1]) > 1.0


@pytest.mark.parametrize(("law", "sensors"), [(PLUMBLINE, "rtk"), (THESIS, "lab")])
def test_same_bits_where_the_winch_works_both_ways(winched: str, law: float, sensors: str) -> None:
    found, states = flown(winched, Conditions(sensors=sensors, seed=1, settings={"CTL_LAW": law}))
    assert found.outcome == "completed"
    length = np.linalg.norm(states[:, 3:6] - states[:, :3], axis=1)
    longest = int(length.argmax())
    # of 0.7 m, lengthened by 0.3 m, then shortened by 0.4 m; the tolerance is for a moment of slack
    assert length[longest] == pytest.approx(1.0, abs=1e-6)
    aloft = states[longest:, 2] > 0.2
    assert length[longest:][aloft].min() == pytest.approx(0.6, abs=0.01)


def test_a_swing_to_the_fence_stays_within_it(swung: str) -> None:
    without, states = flown(swung, Conditions(sensors="lab", seed=1))
    assert without.outcome == "completed"
    assert np.hypot(states[:, 0], states[:, 1]).max() > FENCE_M - 0.01


@pytest.mark.parametrize(("action", "outcome"), [(LAND, "interrupted"), (STOP_ROTORS, "diverged")])
def test_same_end_at_the_fence(swung: str, action: float, outcome: str) -> None:
    fence = {"GF_MAX_HOR_DIST": FENCE_M, "GF_ACTION": action}
    found, states = flown(swung, Conditions(sensors="lab", seed=1, settings=fence))
    assert found.outcome == outcome
    told = "ence: would stop beyond the fence, GF_MAX_HOR_DIST 0.3 m from home"
    assert any(told in text for text in found.texts)
    if action == LAND:
        assert np.hypot(states[:, 0], states[:, 1]).max() < FENCE_M + 0.05


def test_same_bits_with_the_plan_of_another_ground_station_and_its_fence(planned: str) -> None:
    found, states = flown(planned, Conditions(sensors="lab", seed=1))
    assert found.outcome == "completed"
    assert states[:, 0].max() == pytest.approx(0.4, abs=0.02)
    with pytest.raises(ValueError, match="item 2 leads outside the fence"):
        start_times(load(planned.replace("wide", "narrow")), Conditions())


def test_a_refusal_names_the_item_of_the_mission_and_not_of_the_upload() -> None:
    mission = load_mission("case-c")
    found = fly(mission, Conditions(settings={"GF_MAX_HOR_DIST": 10.0}), start_times(mission, Conditions()))
    assert "item 7 (items[2] of the mission) leads beyond the fence" in found.reason


def test_a_mission_that_leads_over_the_fence_is_refused(short: str) -> None:
    mission = load_mission(short)
    arms = start_times(mission, Conditions())
    fenced = Conditions(settings={"GF_MAX_HOR_DIST": FENCE_M})
    found = fly(mission, fenced, arms)
    assert found.outcome == "refused"
    assert "item 1 leads beyond the fence, GF_MAX_HOR_DIST 0.3 m from home" in found.reason
    with pytest.raises(ValueError, match="does not start under the conditions of the sweep") as refusal:
        start_times(mission, fenced)
    assert "item 1 leads beyond the fence, GF_MAX_HOR_DIST" in str(refusal.value)
    assert "MIS_INFEASIBLE" not in str(refusal.value), "which says nothing of fences"
    low = replace(mission, steps=(Takeoff(0.05), *mission.steps[1:]))
    with pytest.raises(ValueError, match=r"item 0: load height 0\.05 m, min 0\.3 m$"):
        start_times(low, Conditions())
    with pytest.raises(ValueError, match="MIS_INFEASIBLE says what becomes of a path"):
        start_times(load_mission("case-c"), Conditions(settings={"CTL_LAW": PLUMBLINE, "VEH_ROTOR_MAX": 1.4}))


def test_files_that_have_changed_are_read_again(tmp_path: Path) -> None:
    """In a process that goes on, such as a notebook."""
    vehicles, profiles = files("autopilot.vehicle").joinpath("vehicles"), files("sitl.sensors")
    bebop = vehicles.joinpath("bebop.toml").read_text(encoding="utf-8")
    vehicle, sensors, hover = tmp_path / "mine.toml", tmp_path / "sensors.toml", load_mission("hover")

    def cell(true_kg: float, believed_kg: float, profile: str) -> Cell:
        for path, mass, head in (
            (vehicle, true_kg, 'believed = "believed.toml"\n'),
            (tmp_path / "believed.toml", believed_kg, ""),
        ):
            path.write_text(head + re.sub(r"quad_mass_kg = .*", f"quad_mass_kg = {mass}", bebop))
        sensors.write_text(profiles.joinpath(f"{profile}.toml").read_text(encoding="utf-8"))
        return cell_of(hover, Conditions(str(vehicle), str(sensors)))

    first = cell(0.4, 0.41, "lab")
    assert (first.truth.quad_mass, first.setup.vehicle.quad_mass) == (0.4, 0.41)
    assert cell(0.4, 0.41, "lab") is first
    assert cell(0.5, 0.41, "lab").truth.quad_mass == 0.5
    assert cell(0.4, 0.39, "lab").setup.vehicle.quad_mass == 0.39
    assert cell(0.4, 0.41, "rtk").profile == load_profile("rtk")
