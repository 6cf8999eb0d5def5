"""One tick: the same bits interpreted, finite whatever the sensors report, continued with other
parameters."""

from __future__ import annotations

import hashlib
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.control.laws import LAWS
from autopilot.core.flight_core import FlightCore
from autopilot.core.tick import FLOWN, TO_DECIDE, fly_tick
from autopilot.estimation import inbox as box
from autopilot.estimation.records import ImuReading, LoadReading, PoseReading
from autopilot.geometry.linear import ZERO
from autopilot.geometry.packed import pack
from autopilot.geometry.so3 import IDENTITY_QUAT
from autopilot.guidance.jet_table import COLUMNS
from autopilot.guidance.legs import LOAD_ATTITUDE, LOAD_POSITION, QUAD_ATTITUDE, QUAD_POSITION
from autopilot.onboard.onboard import build_setup
from autopilot.supervisor.quiescence import FOREVER_US, UNCONTROLLED, uncontrolled_stretch
from autopilot.supervisor.state import Phase
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import ParameterError
from missions.model import Delay, Land, Takeoff
from tests.doubles.craft import Craft, at_phase
from tests.doubles.estimate_problems import estimate_problems
from tests.doubles.plain_python import in_plain_python
from tests.doubles.readings import put_reading

TICK_US = 4000
BEGIN_US = 10_000_000
MODES = {
    "resting": UNCONTROLLED,
    "load position": LOAD_POSITION,
    "vehicle position": QUAD_POSITION,
    "load attitude": LOAD_ATTITUDE,
    "vehicle attitude": QUAD_ATTITUDE,
}
HOVER_M = 1.3  # height of the load


def new_core(**values: float) -> FlightCore:
    """The flight software of `bebop` before its first tick."""
    table = autopilot_parameters(load_vehicle("bebop"))
    for name, value in values.items():
        table.set(name, value)
    return FlightCore(build_setup(table, 1))


def put_hover(core: FlightCore, now_us: int, tick: int) -> int:
    """Put readings of a load that hangs still except for a little sway; return their number."""
    sway, length = 0.01 * math.sin(0.3 * tick), core.setup.vehicle.cable_length
    over = (sway, 0.0, HOVER_M + length)
    imu = ImuReading((0.01, -0.02, 0.005), (0.1 * sway, 0.05, core.setup.vehicle.gravity))
    pose = PoseReading(0.0, over, IDENTITY_QUAT, ZERO, 0.001, 0.001, -1.0)
    load = LoadReading(0.0, (0.5 * sway, 0.0, HOVER_M), ZERO, 0.001, -1.0)
    inbox = core.rows.inbox
    put_reading(inbox, 0, box.IMU, now_us, imu)
    put_reading(inbox, 1, box.POSE, now_us - TICK_US, pose)
    put_reading(inbox, 2, box.LOAD, now_us - TICK_US, load)
    return 3


def hold(core: FlightCore, mode: int, now_us: int) -> None:
    """Let the core fly in this control mode from now on, to a target a little off its position."""
    place = np.zeros((50, COLUMNS))
    place[:, :3] = (
        0.05,
        -0.03,
        HOVER_M + (core.setup.vehicle.cable_length if mode == QUAD_POSITION else 0.0),
    )
    core.rows = core.rows._replace(targets=place, references=place)
    upward = (0.02, 0.01, math.sqrt(1.0 - 0.02**2 - 0.01**2))
    stretch = uncontrolled_stretch(FOREVER_US, now_us, True)._replace(
        mode=mode, period_us=TICK_US, load_weight=1.0, anchor_height=HOVER_M, upward=upward
    )
    pack(stretch, core.rows.stretch, 0)


def update_estimate(core: FlightCore, count: int, now_us: int, tick: int, dt: float = TICK_US * 1e-6) -> None:
    """The first half of a tick, after which the supervisor has to decide."""
    assert fly_tick(core.rows, core.law, count, now_us, tick, dt, False) == TO_DECIDE


def settled(law: int = 2, ticks: int = 8) -> FlightCore:
    """A core whose estimate has begun."""
    core = new_core(CTL_LAW=law)
    for tick in range(ticks):
        now_us = BEGIN_US + tick * TICK_US
        update_estimate(
            core, put_hover(core, now_us, tick), now_us, tick, 0.0 if tick == 0 else TICK_US * 1e-6
        )
    return core


# ---- compiled and interpreted


def queue_rows(core: FlightCore) -> dict[str, Any]:
    """All arrays that the tick reads and writes, by name."""
    rows: dict[str, Any] = {f"law {name}": row for name, row in core.law_rows._asdict().items()}
    for name, row in core.rows._asdict().items():
        parts = row._asdict() if hasattr(row, "_asdict") else {"": row}
        for part, array in parts.items():
            if hasattr(array, "_asdict"):
                rows |= {f"{name} {part} {key}": value for key, value in array._asdict().items()}
            else:
                rows[f"{name} {part}".strip()] = array
    return rows


def fingerprints() -> dict[str, str]:
    """Hash of every array after some ticks of each law in each mode."""
    found = {}
    for number, law in LAWS.items():
        for name, mode in MODES.items():
            core = settled(number)
            begin_us = BEGIN_US + 8 * TICK_US
            hold(core, mode, begin_us)
            for tick in range(4):
                now_us = begin_us + tick * TICK_US
                count = put_hover(core, now_us, 8 + tick)
                came = fly_tick(core.rows, core.law, count, now_us, 8 + tick, TICK_US * 1e-6, False)
                assert came == FLOWN
            for array, row in queue_rows(core).items():
                found[f"{law.name}, {name}: {array}"] = hashlib.sha256(row.tobytes()).hexdigest()[:12]
    return found


def test_every_law_in_every_mode_leaves_the_same_rows_compiled_and_interpreted() -> None:
    plain, compiled = in_plain_python(fingerprints), fingerprints()
    assert len(compiled) > 15 * len(LAWS) * len(MODES)
    assert [name for name in compiled if compiled[name] != plain[name]] == []


# ---- any readings of the sensors

HOSTILE = (math.nan, math.inf, -math.inf, 3.4e38, -3.4e38, 1e10, -1e5, 3.0, 1.0, 0.0, -0.0, -1.0, 1e-30)
INSTANTS_US = (0, -TICK_US, -299_000, -301_000, -BEGIN_US, 1, 10**9, math.nan, math.inf, -math.inf)
ROW = st.tuples(
    st.sampled_from((box.IMU, box.POSE, box.FIELD, box.FIX, box.HEIGHT, box.LOAD, box.DIRECTION, 99, -1)),
    st.sampled_from(INSTANTS_US),
    st.lists(st.sampled_from(HOSTILE), min_size=14, max_size=14),
)
SCRIPTS = st.lists(st.lists(ROW, max_size=6), min_size=1, max_size=4)
REPEATS = 70  # ticks: more than the refusals after which the estimate restarts from a tracker


def put_rows(core: FlightCore, rows: list[Any], now_us: int) -> int:
    for at, (kind, later_us, numbers) in enumerate(rows):
        core.rows.inbox[at] = [kind, now_us + later_us, *numbers]
    return len(rows)


def numbers_of(core: FlightCore) -> list[float]:
    """All numbers of the estimate except the ages, which are infinite for impacts and sensors that have never
    reported."""
    e = core.estimator
    e = e._replace(
        vehicle=e.vehicle._replace(age_s=0.0),
        load=e.load._replace(age_s=0.0),
        sensor_errors=e.sensor_errors._replace(magnetic_age=0.0, barometer_age=0.0),
        clipping=e.clipping._replace(impact_age_s=0.0),
    )
    row = np.zeros(len(core.rows.estimator))
    pack(e, row, 0)
    return [*row, *core.rows.history.covariance.ravel()]


@pytest.mark.parametrize("begun", [False, True], ids=["before the first reading", "in flight"])
@settings(max_examples=40, deadline=None)
@given(script=SCRIPTS)
def test_no_reading_makes_the_estimate_or_a_force_no_number(begun: bool, script: list[list[Any]]) -> None:
    core = settled() if begun else new_core()
    begin_us = BEGIN_US + 8 * TICK_US
    hold(core, LOAD_POSITION, begin_us)
    for tick in range(REPEATS):
        now_us = begin_us + tick * TICK_US
        count = put_rows(core, script[tick % len(script)], now_us)
        flown = (count, now_us, 8 + tick, TICK_US * 1e-6)
        came = fly_tick(core.rows, core.law, *flown, False)
        assert np.isfinite(numbers_of(core)).all()
        if came == TO_DECIDE:
            fly_tick(core.rows, core.law, *flown, True)
        assert all(0.0 <= force <= core.setup.vehicle.rotor_max for force in core.forces)


@settings(max_examples=20, deadline=None)
@given(script=SCRIPTS)
def test_behind_any_readings_honest_ones_settle_the_estimate_again(script: list[list[Any]]) -> None:
    core = settled()
    for tick in range(8, 8 + REPEATS):
        now_us = BEGIN_US + tick * TICK_US
        update_estimate(core, put_rows(core, script[tick % len(script)], now_us), now_us, tick)
    for tick in range(8 + REPEATS, 8 + REPEATS + 750):
        now_us = BEGIN_US + tick * TICK_US
        update_estimate(core, put_hover(core, now_us, tick), now_us, tick)
    assert estimate_problems(core.estimator, core.settings.failsafe.sensor_age_limit_s) == ()
    assert core.state.x_load == pytest.approx((0.0, 0.0, HOVER_M), abs=0.02)


def test_more_readings_than_the_inbox_has_room_for_are_all_heard() -> None:
    core = new_core()
    imu = ImuReading(ZERO, (0.0, 0.0, core.setup.vehicle.gravity))
    over = (0.0, 0.0, HOVER_M + core.setup.vehicle.cable_length)
    pose = PoseReading(0.0, over, IDENTITY_QUAT, ZERO, 0.001, 0.001, -1.0)
    readings = ((box.IMU, BEGIN_US, imu), *((box.POSE, BEGIN_US, pose),) * 1000)
    assert len(readings) > len(core.rows.inbox)
    larger = box.new_inbox(len(readings))
    for at, reading in enumerate(readings):
        put_reading(larger, at, *reading)
    core.use_inbox(larger)
    core.step(len(readings), BEGIN_US, 0, 0.0)
    heard = core.rows.history.consistency[0, 0]
    assert heard == 999.0, "the first one starts the estimate"
    assert core.state.x_quad == pytest.approx(over, abs=1e-9)
    assert np.isfinite(numbers_of(core)).all()


# ---- other parameters in flight


def set_parameter(craft: Craft, name: str, value: float) -> None:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))


def test_a_longer_and_a_shorter_delay_of_the_rotors_is_flown_with_from_the_next_tick_on() -> None:
    """The earlier commands to the rotors are kept: the rotors are not assumed to have stood still."""
    craft = Craft(Takeoff(1.0), Delay(60.0), Land(), watched=True, SIM_ACT_DELAY_MS=20.0)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(2.0)
    vehicle = craft.onboard.core.setup.vehicle
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    for delay_ms, rows in ((60.0, 17), (0.0, 2), (20.0, 7)):
        set_parameter(craft, "SIM_ACT_DELAY_MS", delay_ms)
        set_parameter(craft, "VEH_ACT_DELAY", delay_ms)
        for _ in range(250):
            craft.tick()
            core = craft.onboard.core
            assert core.control.thrust == pytest.approx(weight, rel=0.02), "measured 0.5 %"
        assert core.rows.commands.shape == (rows, 4)
        assert craft.simulator.parameters.table["SIM_ACT_DELAY_MS"] == delay_ms
    assert craft.flight.phase == Phase.MISSION, craft.texts
    # measured
    assert craft.worst_error < 0.02


@pytest.mark.parametrize(
    ("name", "value"), [("VEH_CABLE_LEN", 1.4), ("VEH_ATT_X", 0.1), ("VEH_QUAD_MASS", 0.6)]
)
def test_what_describes_the_vehicle_for_a_whole_flight_is_set_on_the_ground_only(
    name: str, value: float
) -> None:
    craft = Craft(Takeoff(1.0), Delay(60.0), Land())
    before = craft.onboard.parameters[name]
    set_parameter(craft, name, value)
    craft.tick()
    assert craft.onboard.parameters[name] == value
    set_parameter(craft, name, before)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    set_parameter(craft, name, value)
    craft.wait(0.5)
    assert craft.onboard.parameters[name] == before
    assert craft.texts[-1] == f"{name} not set while armed: disarm first"
    set_parameter(craft, "VEH_LOAD_MASS", 0.11)  # which may differ from one load to the next
    craft.wait(0.5)
    assert craft.onboard.parameters["VEH_LOAD_MASS"] == pytest.approx(0.11)
    assert craft.flight.phase == Phase.MISSION, craft.texts


def test_another_law_is_not_taken_in_flight() -> None:
    craft = Craft(Takeoff(1.0), Delay(60.0), Land(), watched=True)
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    law, kind = craft.onboard.core.setup.law, type(craft.onboard.core.law_rows)
    set_parameter(craft, "CTL_LAW", 0.0)
    craft.wait(0.5)
    assert craft.onboard.parameters["CTL_LAW"] == 2.0
    assert craft.onboard.core.setup.law == law
    assert type(craft.onboard.core.law_rows) is kind
    with pytest.raises(ParameterError, match="fixed while running"):
        craft.onboard.parameters.set("CTL_LAW", 0.0)
    assert craft.flight.phase == Phase.MISSION, craft.texts
    assert craft.worst_error < 0.02
