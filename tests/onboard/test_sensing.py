"""What telemetry receives of the vehicle's own sensors, and of the present flight."""

from __future__ import annotations

from math import isnan
from typing import Any

import pytest

from autopilot.onboard.snapshot import CoreSnapshot
from autopilot.services.identity import Identity
from autopilot.services.snapshot import BARO, GEOFENCE, GPS, MAG, PREARM, TRACKER, Sortie
from autopilot.services.telemetry import STREAMS
from autopilot.supervisor.state import Phase
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from missions.model import Land, Takeoff
from sitl.messages import pressure_pa
from tests.doubles.craft import Craft, at_phase

POSE_TRACKER, LOAD_TRACKER, GNSS_RECEIVER, BAROMETER = (1 << bit for bit in (1, 2, 4, 5))
ESTIMATOR_STATUS, GPS_RAW_INT = (
    mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
)


def told(craft: Craft, message_id: int) -> Any:
    """The message of a stream as a ground station receives it now."""
    (message,) = STREAMS[message_id].build(moment(craft), Identity())
    return decode(FrameWriter(1, 1).frame(message))[0][0].message


def moment(craft: Craft) -> CoreSnapshot:
    seen = craft.onboard.log_sample().snapshot
    assert isinstance(seen, CoreSnapshot)
    return seen


def kept_texts(craft: Craft) -> list[str]:
    return [kept.text for kept in craft.onboard.endpoint.kept_texts.texts]


def test_before_the_first_tick_nothing_was_sensed() -> None:
    assert moment(Craft()).readings is None


def test_the_slower_sensors_are_kept_between_their_readings() -> None:
    craft = Craft(sensors="gps")
    craft.wait(1.0)
    read_us = set()
    for _ in range(100):
        craft.tick()
        sensed = moment(craft).readings
        assert sensed is not None
        read_us.add((sensed.field_us, sensed.pressure_us))
        # a barometer of 0.3 m, at rest: 12 Pa per metre
        assert sensed.pressure_pa == pytest.approx(pressure_pa(0.0), abs=30.0)
        assert 0.2 < sum(b * b for b in sensed.field_gauss) ** 0.5 < 0.7  # the Earth's field
        assert sensed.accel[2] == pytest.approx(9.81, abs=1.0)
    assert 1 < len(read_us) < 100


def test_a_sensor_that_is_not_carried_never_read() -> None:
    craft = Craft(sensors="lab")
    craft.wait(0.5)
    sensed = moment(craft).readings
    assert sensed is not None
    assert (sensed.field_us, sensed.pressure_us) == (-1, -1)


def test_the_test_ratios_are_those_of_the_readings_that_are_used() -> None:
    nothing = moment(Craft(sensors="gps")).test_ratios
    assert all(isnan(ratio) for ratio in nothing)
    craft = Craft(sensors="gps")
    craft.wait(3.0)
    assert all(0.0 < ratio < 1.0 for ratio in moment(craft).test_ratios)
    craft = Craft(sensors="lab")
    craft.wait(1.0)
    velocity, horizontal, vertical, magnetic = moment(craft).test_ratios
    assert 0.0 < horizontal == vertical < 1.0
    assert isnan(velocity) and isnan(magnetic)


def fail_sensors(craft: Craft, failed: int) -> None:
    """Fail these sensors: bits of SIM_SENS_FAIL."""
    real32 = mavlink.MAV_PARAM_TYPE_REAL32
    craft.send(mavlink.MAVLink_param_set_message(1, 1, b"SIM_SENS_FAIL", failed, real32))


def test_a_load_that_is_not_tracked_is_no_loss_of_the_vehicle() -> None:
    craft = Craft(sensors="lab")
    craft.wait(1.0)
    healthy, flags = moment(craft).sensors_healthy, moment(craft).estimator_flags
    fail_sensors(craft, LOAD_TRACKER)
    craft.wait(2.5)
    lost = moment(craft)
    assert not lost.ready, "the load is missing"
    assert lost.sensors_healthy == healthy & ~PREARM
    assert (lost.estimator_flags, lost.gps and lost.gps.fix_type) == (flags, mavlink.GPS_FIX_TYPE_3D_FIX)
    fail_sensors(craft, POSE_TRACKER)
    craft.wait(1.0)
    lost = moment(craft)
    assert not lost.sensors_healthy & (TRACKER | GPS | MAG | BARO)
    assert (lost.estimator_flags, lost.gps) == (mavlink.ESTIMATOR_ATTITUDE, None)


def test_without_fixes_the_estimator_knows_height_and_attitude_and_without_a_barometer_the_attitude() -> None:
    craft = Craft(sensors="rtk")
    craft.run(lambda craft: moment(craft).ready, 20.0)
    fail_sensors(craft, GNSS_RECEIVER)
    craft.wait(2.5)
    height = mavlink.ESTIMATOR_POS_VERT_ABS | mavlink.ESTIMATOR_VELOCITY_VERT
    assert moment(craft).estimator_flags == mavlink.ESTIMATOR_ATTITUDE | height
    status = told(craft, ESTIMATOR_STATUS)
    assert (isnan(status.pos_horiz_accuracy), 0.0 < status.pos_vert_accuracy < 0.1) == (True, True)
    fail_sensors(craft, GNSS_RECEIVER | BAROMETER)
    craft.wait(2.5)
    assert moment(craft).estimator_flags == mavlink.ESTIMATOR_ATTITUDE
    status = told(craft, ESTIMATOR_STATUS)
    assert isnan(status.pos_horiz_accuracy) and isnan(status.pos_vert_accuracy)


def test_a_receiver_that_falls_silent_has_no_fix() -> None:
    craft = Craft(sensors="rtk")
    craft.wait(3.0)
    before = told(craft, GPS_RAW_INT)
    assert (before.fix_type, before.satellites_visible) == (mavlink.GPS_FIX_TYPE_RTK_FIXED, 20)
    fail_sensors(craft, GNSS_RECEIVER)
    craft.wait(1.8)
    bridged = told(craft, GPS_RAW_INT)
    assert bridged.fix_type == mavlink.GPS_FIX_TYPE_RTK_FIXED, "the inertial unit bridges 2 s"
    craft.wait(0.7)
    lost = told(craft, GPS_RAW_INT)
    assert (lost.fix_type, lost.satellites_visible) == (mavlink.GPS_FIX_TYPE_NO_FIX, 255)
    assert (lost.eph, lost.epv, lost.vel, lost.cog) == (65535,) * 4
    assert (lost.h_acc, lost.v_acc) == (0, 0), "unknown"
    assert (lost.time_usec, lost.lat) == (bridged.time_usec, bridged.lat), "those of the last fix"
    fail_sensors(craft, 0)
    craft.wait(0.5)
    again = told(craft, GPS_RAW_INT)
    assert again.fix_type == mavlink.GPS_FIX_TYPE_RTK_FIXED


def test_a_flight_is_dated_by_arming_take_off_and_landing() -> None:
    craft = Craft(Takeoff(1.0), Land())
    craft.wait(1.0)
    assert moment(craft).sortie == Sortie()
    craft.begin()
    craft.run(lambda craft: craft.flight.phase not in (Phase.DISARMED, Phase.ARMED))
    taken_off_us = craft.flight.phase_start_us
    assert craft.onboard.now_us - taken_off_us <= 4000
    armed_us = moment(craft).sortie.armed_us
    assert 1_000_000 < armed_us <= taken_off_us
    craft.run(at_phase(Phase.DISARMED))
    assert moment(craft).sortie == Sortie(armed_us, taken_off_us, craft.onboard.now_us)
    # the next flight begins anew
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == mavlink.MAV_RESULT_ACCEPTED
    again = moment(craft).sortie
    assert again.armed_us > taken_off_us
    assert (again.takeoff_us, again.landed_us) == (0, 0)


@pytest.mark.parametrize("limit", ["GF_MAX_HOR_DIST", "GF_MAX_VER_DIST"])
def test_a_fence_of_parameters_is_shown_as_present(limit: str) -> None:
    assert not moment(Craft()).sensors_present & GEOFENCE
    assert moment(Craft(**{limit: 20.0})).sensors_present & GEOFENCE


def test_rally_points_outside_the_fence_are_told_whichever_comes_first() -> None:
    """In any order of uploads, and not where the fence has no effect."""
    origin = (473977420, 85455940)
    rally = tuple(
        WireItem(3, 5100, 0, 1, 0.0, 0.0, 0.0, 0.0, origin[0] + x, origin[1], 0.0) for x in (0, 900)
    )
    disc = (WireItem(3, 5003, 0, 1, 5.0, 0.0, 0.0, 0.0, *origin, 0.0),)
    fence_kind, rally_kind = mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY
    first, second = ((rally_kind, rally), (fence_kind, disc))
    for order in ((first, second), (second, first)):
        craft = Craft()
        for kind, items in order:
            assert not [text for text in kept_texts(craft) if "Rally" in text]
            craft.onboard.set_areas(kind, items)
        assert "Rally point 1 is outside the fence: no return leads there" in kept_texts(craft)
    craft = Craft()
    for kind, items in (second, (rally_kind, rally + rally[1:])):
        craft.onboard.set_areas(kind, items)
    assert "Rally points 1, 2 are outside the fence: no return leads there" in kept_texts(craft)
    craft = Craft(GF_ACTION=0.0)
    for kind, items in (first, second):
        craft.onboard.set_areas(kind, items)
    assert not [text for text in kept_texts(craft) if "Rally" in text]


def test_a_fence_that_is_uploaded_is_shown_as_present_until_it_is_cleared() -> None:
    craft = Craft()
    corners = ((-300, -300), (-300, 300), (300, 300), (300, -300))
    origin = (473977420, 85455940)
    fence = tuple(
        WireItem(3, 5001, 0, 1, 4.0, 0.0, 0.0, 0.0, origin[0] + x, origin[1] + y, 0.0) for x, y in corners
    )
    for items in (fence, ()):
        craft.onboard.set_areas(mavlink.MAV_MISSION_TYPE_FENCE, items)
        assert bool(moment(craft).sensors_present & GEOFENCE) == bool(items)
