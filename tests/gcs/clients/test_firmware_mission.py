"""A mission of the load as items of the vehicle: places, heights, refusals."""

from __future__ import annotations

import pytest

from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.firmware_mission import FirmwareMissionError, firmware_items
from missions import fileformat
from missions.model import Delay, Land, Release, Speed, Step, Takeoff, Waypoint, Winch

CABLE_M, STANDS_M = 1.0, 0.13
LATTICE_M = 0.012  # 1e-7 degrees


def items(*steps: Step, with_home: bool = False):
    return firmware_items(steps, Home(), CABLE_M, STANDS_M, with_home)


def test_a_place_of_the_load_is_one_of_the_vehicle_a_cable_length_above() -> None:
    (item,) = items(Waypoint(5.0, -3.0, 2.0, hold_s=1.5))
    east, north, _ = enu_from_geodetic(item.x, item.y, 0, Home())
    assert (item.command, item.param1) == (mavlink.MAV_CMD_NAV_WAYPOINT, 1.5)
    assert (east, north) == pytest.approx((5.0, -3.0), abs=LATTICE_M)
    # relative to where it stood, with its centre of mass STANDS_M above the ground
    assert item.z + STANDS_M == pytest.approx(2.0 + CABLE_M)


def test_it_goes_over_the_load_with_the_cable_slack_before_it_lifts() -> None:
    takeoff, over, up = items(Takeoff(2.0))
    assert takeoff.command == mavlink.MAV_CMD_NAV_TAKEOFF and takeoff.z == over.z
    assert 0.0 < over.z + STANDS_M < CABLE_M
    assert up.z + STANDS_M == pytest.approx(2.0 + CABLE_M)
    assert {(item.x, item.y) for item in (takeoff, over, up)} == {(takeoff.x, takeoff.y)}


def test_item_0_is_home_where_it_is_not_flown() -> None:
    home, *rest = items(Takeoff(2.0), Land(), with_home=True)
    assert home.command == mavlink.MAV_CMD_NAV_WAYPOINT and home.z == 0.0
    assert tuple(rest) == items(Takeoff(2.0), Land())


def test_after_a_release_the_places_are_the_vehicles() -> None:
    carried, release, alone = items(Waypoint(0.0, 0.0, 3.0), Release(), Waypoint(0.0, 0.0, 3.0))
    assert release.command == mavlink.MAV_CMD_DO_GRIPPER and release.param2 == mavlink.GRIPPER_ACTION_RELEASE
    assert carried.z - alone.z == pytest.approx(CABLE_M - STANDS_M)


def test_speeds_delays_and_landing() -> None:
    waypoint, speed, delay, land = items(Waypoint(1.0, 2.0, 3.0), Speed(2.0), Delay(4.0), Land())
    assert (speed.command, speed.param1, speed.param2) == (mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, 2.0)
    assert (delay.command, delay.param1) == (mavlink.MAV_CMD_NAV_LOITER_TIME, 4.0)
    assert (delay.x, delay.y, delay.z) == (waypoint.x, waypoint.y, waypoint.z)
    assert (land.command, land.x, land.y) == (mavlink.MAV_CMD_NAV_LAND, waypoint.x, waypoint.y)


def test_what_cannot_be_said_is_refused() -> None:
    with pytest.raises(FirmwareMissionError, match="it asks for the winch"):
        items(Takeoff(2.0), Winch(0.5))
    with pytest.raises(FirmwareMissionError, match="signals"):
        items(*fileformat.load_mission("case-b").steps)
