"""What is reported of a vehicle whose rotors have stopped in the air: that it falls, that it has landed."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest

from autopilot.estimation.records import ImuReading
from autopilot.geometry.linear import ZERO, norm, sub
from autopilot.onboard.fall_watch import MAX_SILENCE_US, REST_US, FallWatch
from autopilot.onboard.snapshot import CoreSnapshot
from autopilot.services.snapshot import PREARM, Sortie
from autopilot.supervisor.state import Fall, Phase
from autopilot.wire.dialect import plumbline as mavlink
from sitl.plant.records import PlantState
from tests.doubles.craft import ACCEPTED, Craft, at_phase

ARM_DISARM, TERMINATE = mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_DO_FLIGHTTERMINATION
FORCE = 21196.0
ON_GROUND, IN_AIR, UNDEFINED = (
    mavlink.MAV_LANDED_STATE_ON_GROUND,
    mavlink.MAV_LANDED_STATE_IN_AIR,
    mavlink.MAV_LANDED_STATE_UNDEFINED,
)
G = 9.81
AT_REST, WEIGHTLESS = ImuReading(ZERO, (0.0, 0.1, G)), ImuReading(ZERO, (0.0, 0.1, 0.3))
TICK_US = 4000


def moment(craft: Craft) -> CoreSnapshot:
    seen = craft.onboard.log_sample().snapshot
    assert isinstance(seen, CoreSnapshot)
    return seen


def is_down(truth: PlantState) -> bool:
    return truth.vehicle_on_ground and norm(truth.v_quad) < 0.02


def holding(height_m: float, sensors: str = "lab", released: bool = False) -> Craft:
    """A craft that holds its load, or itself without a load, at this height."""
    craft = Craft(sensors=sensors)
    craft.run(lambda craft: moment(craft).ready)
    if released:
        assert craft.command(mavlink.MAV_CMD_DO_GRIPPER, 1.0, mavlink.GRIPPER_ACTION_RELEASE) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, 0, 0, height_m) == ACCEPTED
    assert craft.command(ARM_DISARM, 1.0) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    craft.wait(0.5)
    return craft


def fall(craft: Craft) -> list[tuple[int, int]]:
    """Follow a fall to its end; return the landed states and the MAV_STATEs that follow one another."""
    down_us = None
    told: list[tuple[int, int]] = []
    end_us = craft.onboard.now_us + 10_000_000
    while (seen := moment(craft)).landed_state != ON_GROUND:
        down_us = (down_us or seen.now_us) if is_down(craft.truth) else None
        assert not seen.sensors_healthy & PREARM
        if (status := (seen.landed_state, seen.system_status)) not in told:
            told.append(status)
        assert craft.onboard.now_us < end_us
        craft.tick()
    assert down_us is not None, "it says so while it still moves"
    assert moment(craft).sortie.landed_us == moment(craft).now_us
    return told


@pytest.mark.parametrize(
    ("sensors", "released", "height_m"),
    [
        ("lab", False, 5.0),
        ("lab", False, 0.4),
        ("lab", True, 3.0),
        ("lab-blind", False, 2.0),
        ("gps", False, 5.0),
    ],
)
def test_a_vehicle_that_is_disarmed_by_force_is_in_the_air_until_it_rests(
    sensors: str, released: bool, height_m: float
) -> None:
    craft = holding(height_m, sensors, released)
    assert craft.command(ARM_DISARM, 0.0, FORCE) == ACCEPTED
    assert craft.command(ARM_DISARM, 1.0) == mavlink.MAV_RESULT_DENIED
    assert "Arming denied: falling, not at rest yet" in craft.texts
    assert fall(craft) == [(IN_AIR, mavlink.MAV_STATE_FLIGHT_TERMINATION)]


@pytest.mark.parametrize("sensors", ["lab", "lab-real", "rtk", "gps"])
def test_the_estimate_survives_an_impact_beyond_the_range_of_the_accelerometer(sensors: str) -> None:
    craft = holding(5.0, sensors)
    assert craft.command(ARM_DISARM, 0.0, FORCE) == ACCEPTED
    # 4 s, in which a plain receiver's height and the barometer's may differ by a metre
    offsets, wrong_speeds = [], 0
    for _ in range(1000):
        craft.tick()
        seen = moment(craft)
        offsets.append(craft.truth.x_quad[2] - seen.x_quad[2])
        if seen.estimator_flags & mavlink.ESTIMATOR_VELOCITY_VERT:
            wrong_speeds += norm(sub(craft.truth.v_quad, seen.v_quad)) > 2.0
    assert seen.clipped_samples >= 3
    assert np.ptp(offsets) < 1.0
    assert wrong_speeds <= 1, "the impact begins before the sample that shows it"
    vibration = [m for m in craft.heard if m.get_type() == "VIBRATION"][-1]
    assert (vibration.clipping_0, vibration.clipping_1) == (seen.clipped_samples, 0)


def test_a_terminated_flight_is_on_the_ground_as_soon_as_the_vehicle_rests() -> None:
    craft = holding(0.4)
    assert craft.command(TERMINATE, 1.0) == ACCEPTED
    stopped_us = craft.onboard.now_us
    assert fall(craft) == [(IN_AIR, mavlink.MAV_STATE_FLIGHT_TERMINATION)]
    assert craft.onboard.now_us - stopped_us < 1_500_000
    assert craft.flight.phase == Phase.FAILSAFE, "it can be armed again only later"
    craft.run(at_phase(Phase.DISARMED), 3.0)
    assert moment(craft).system_status == mavlink.MAV_STATE_STANDBY


def test_the_ground_is_told_of_the_fall_and_of_its_end() -> None:
    craft = holding(2.0)
    assert craft.command(ARM_DISARM, 0.0, FORCE) == ACCEPTED
    craft.heard.clear()
    craft.run(lambda craft: moment(craft).landed_state == ON_GROUND)
    craft.wait(0.1)
    states = [m.system_status for m in craft.heard if m.get_type() == "HEARTBEAT"]
    assert (states[0], states[-1]) == (mavlink.MAV_STATE_FLIGHT_TERMINATION, mavlink.MAV_STATE_STANDBY)
    assert mavlink.MAV_STATE_CALIBRATING not in states


def test_without_the_inertial_unit_nobody_knows_whether_it_fell_or_lies() -> None:
    craft = holding(2.0)
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_SENS_FAIL", 1.0, kind))
    craft.run(at_phase(Phase.FAILSAFE), 1.0)
    assert moment(craft).landed_state == IN_AIR
    craft.wait(0.6)
    assert moment(craft).landed_state == UNDEFINED
    craft.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_SENS_FAIL", 0.0, kind))
    craft.wait(2.0)
    assert moment(craft).landed_state == ON_GROUND


@pytest.mark.parametrize("phase", [Phase.TAUTEN, Phase.SET_DOWN])
def test_a_vehicle_that_is_stopped_beside_its_load_falls_as_well(phase: Phase) -> None:
    craft = holding(0.3)
    if phase == Phase.TAUTEN:
        craft = Craft()
        craft.wait(1.0)
        assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, 0, 0, 1.0) == ACCEPTED
        assert craft.command(ARM_DISARM, 1.0) == ACCEPTED
    else:
        assert craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    craft.run(at_phase(phase))
    craft.run(lambda craft: 0.2 < craft.truth.x_quad[2] < 0.6)
    assert craft.flight.phase == phase
    assert craft.command(ARM_DISARM, 0.0, FORCE) == ACCEPTED
    assert fall(craft) == [(IN_AIR, mavlink.MAV_STATE_FLIGHT_TERMINATION)]


def test_a_vehicle_that_lands_by_itself_is_on_the_ground_at_once() -> None:
    craft = holding(0.3)
    assert craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED))
    assert moment(craft).landed_state == ON_GROUND
    assert moment(craft).system_status == mavlink.MAV_STATE_STANDBY


def test_one_that_is_armed_by_force_in_its_fall_counts_as_any_armed_one() -> None:
    craft = holding(2.0)
    assert craft.command(ARM_DISARM, 0.0, FORCE) == ACCEPTED
    craft.wait(0.1)
    assert craft.command(ARM_DISARM, 1.0, FORCE) == ACCEPTED
    craft.tick()
    assert moment(craft).landed_state == ON_GROUND
    assert moment(craft).sortie == Sortie(craft.flight.phase_start_us)


# ---- the decision alone


def followed(*states: tuple[ImuReading | None, float, int]) -> Fall:
    """What is known after each of these samples and speeds has lasted for a time (us)."""
    watch, now_us, known = FallWatch(0), 0, Fall.FALLING
    for sample, speed_m_s, lasts_us in states:
        end_us = now_us + lasts_us
        while now_us < end_us:
            now_us += TICK_US
            known = watch.advance(sample, speed_m_s, G, now_us)
    return known


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ([(AT_REST, 0.0, REST_US)], Fall.NONE),
        ([(AT_REST, 0.0, REST_US - TICK_US)], Fall.FALLING),
        ([(AT_REST, nan, REST_US)], Fall.NONE),
        ([(WEIGHTLESS, 0.0, 2 * REST_US)], Fall.FALLING),
        ([(WEIGHTLESS, 0.0, 2 * REST_US), (AT_REST, 0.0, REST_US)], Fall.NONE),
        ([(AT_REST, 19.0, 2 * REST_US)], Fall.FALLING),  # the drag equals the weight
        ([(ImuReading((0.0, 1.0, 0.0), AT_REST.accel), 0.0, 2 * REST_US)], Fall.FALLING),
        ([(ImuReading(ZERO, (0.0, -G, 0.0)), 0.0, REST_US)], Fall.NONE),  # on its side
        ([(AT_REST, 0.0, REST_US // 2), (None, 0.0, MAX_SILENCE_US)], Fall.FALLING),
        ([(None, 0.0, MAX_SILENCE_US + TICK_US)], Fall.UNKNOWN),
        ([(None, 0.0, 2 * MAX_SILENCE_US), (AT_REST, 0.0, REST_US - TICK_US)], Fall.FALLING),
        ([(None, 0.0, 2 * MAX_SILENCE_US), (AT_REST, 0.0, REST_US)], Fall.NONE),
    ],
)
def test_what_is_known_of_a_fall(states: list[tuple[ImuReading | None, float, int]], expected: Fall) -> None:
    assert followed(*states) == expected
