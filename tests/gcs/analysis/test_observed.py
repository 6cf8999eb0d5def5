"""The requested path of a third-party autopilot, read from its mission and from the truth."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from gcs.analysis.observed import observed_setpoint
from gcs.analysis.tracks import ItemTrack, LoadTrack, RotorTrack, SetpointTrack
from gcs.clients.firmware_mission import firmware_items
from missions.model import Land, Takeoff, Waypoint

CABLE_M, STANDS_M, RESTS_M = 1.0, 0.13, 0.04
ITEMS = firmware_items((Takeoff(2.0), Waypoint(4.0, 0.0, 2.0), Land()), Home(), CABLE_M, STANDS_M, True)
# time, current item, place of the load; home 0, take-off 1, over the load 2, lift 3, waypoint 4, land 5
FLOWN = (
    (0.0, 0, (0.0, 0.0, RESTS_M)),
    (1.0, 2, (0.0, 0.0, RESTS_M)),
    (2.0, 3, (0.1, 0.0, 1.0)),
    (3.0, 4, (1.0, 0.3, 2.1)),
    (4.0, 4, (4.4, 0.0, 2.0)),
    (5.0, 5, (4.0, 0.2, 1.0)),
    (6.0, 5, (4.0, 0.0, RESTS_M)),
    (7.0, 1, (4.0, 0.0, RESTS_M)),
)
P = mavlink
PHASES = [
    P.PLUMBLINE_PHASE_DISARMED,
    P.PLUMBLINE_PHASE_TAUTEN,
    P.PLUMBLINE_PHASE_LIFT,
    P.PLUMBLINE_PHASE_MISSION,
    P.PLUMBLINE_PHASE_MISSION,
    P.PLUMBLINE_PHASE_LOWER,
    P.PLUMBLINE_PHASE_SET_DOWN,
    P.PLUMBLINE_PHASE_DISARMED,
]
LATTICE_M = 0.012  # resolution of the positions on the wire


def observed(items: tuple[WireItem, ...], flown: tuple = FLOWN) -> SetpointTrack:
    time_s = np.array([row[0] for row in flown])
    n = len(time_s)
    place = np.array([row[2] for row in flown])
    down = np.tile((0.0, 0.0, -1.0), (n, 1))
    distance, taut = np.full(n, CABLE_M), (place[:, 2] > RESTS_M).astype(np.int64)
    distance[0] = STANDS_M - RESTS_M  # it stands beside the load; in these data above it
    load = LoadTrack(time_s, place, 0 * place, down, 0 * place, distance, 3.0 * taut, 0 * taut, taut)
    force = np.zeros((n, 4))
    force[1:-1] = 4.0
    rotors = RotorTrack(time_s, force, np.zeros(n), np.full(n, 8.5), np.zeros(n, dtype=np.int64))
    current = ItemTrack(time_s, np.array([row[1] for row in flown]))
    return observed_setpoint(load, rotors, current, items, Home())


@pytest.fixture
def setpoint() -> SetpointTrack:
    return observed(ITEMS)


def test_a_lift_from_beside_lasts_until_the_load_hangs_at_rest() -> None:
    """The items of a firmware that does not take off low: take-off 0, rest 1, waypoint 2, land 3."""
    steps = (Takeoff(2.0), Waypoint(4.0, 0.0, 2.0), Land())
    items = firmware_items(steps, Home(), CABLE_M, STANDS_M, False, accepts_low_takeoff=False)
    flown = tuple((t, max(item - 2, 0), place) for t, item, place in FLOWN)
    assert observed(items, flown).phase.tolist() == PHASES


def test_the_phases_are_seen_in_the_truth(setpoint: SetpointTrack) -> None:
    assert setpoint.phase.tolist() == PHASES
    tracked = [P.PLUMBLINE_CONTROL_LOAD_POSITION if 2 <= i <= 5 else 0 for i in range(8)]
    assert setpoint.control_mode.tolist() == tracked


def test_what_is_asked_is_the_nearest_point_of_the_line_that_is_flown(setpoint: SetpointTrack) -> None:
    asked = setpoint.requested_m
    assert asked[2] == pytest.approx((0.0, 0.0, 1.0), abs=LATTICE_M)  # straight up
    assert asked[3] == pytest.approx((1.0, 0.0, 2.0), abs=LATTICE_M)  # along the line
    assert asked[4] == pytest.approx((4.0, 0.0, 2.0), abs=LATTICE_M)  # not beyond its end
    assert asked[5] == pytest.approx((4.0, 0.0, 1.0), abs=LATTICE_M)  # straight down
