"""The requested load path of an autopilot that knows of no load and reports no setpoint, from its mission.

A third-party autopilot flies the vehicle along lines between its waypoints; the load should be one cable
length below. The requested load position at a time is the nearest point of the line that is being flown: the
error is the load's distance from the path, whatever the timing. The phases are Plumbline's, derived from
the truth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from autopilot.wire.convert.geodesy import Home, enu_from_geodetic
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.records import WireItem
from gcs.analysis.align import as_of
from gcs.analysis.axes import Floats
from gcs.analysis.tracks import Ints, ItemTrack, LoadTrack, RotorTrack, SetpointTrack

_POSITION_COMMANDS = (
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_LAND,
)
_LIFTED_M = 0.01  # height above its initial position from which the load counts as lifted
_TURNING_SHARE = 0.002  # share of the greatest force above which rotors count as turning
_ANY_AGE_S = np.inf  # greatest age of a value: it holds until the next is received


def observed_setpoint(
    load: LoadTrack, rotors: RotorTrack, current: ItemTrack, items: Sequence[WireItem], home: Home
) -> SetpointTrack:
    """The setpoints at the time stamps of the true load; `home` is the origin of the world."""
    time_s, position = load.time_s, load.position_m
    item = as_of(current.time_s, current.item.astype(np.float64), time_s, _ANY_AGE_S)
    seq = np.clip(np.nan_to_num(item), 0, len(items) - 1).astype(np.int64)
    command = np.array([one.command for one in items])
    ground_m = position[0, 2]
    lifted = position[:, 2] > ground_m + _LIFTED_M
    turning = _turning(rotors, time_s)
    phase = np.full(len(time_s), mavlink.PLUMBLINE_PHASE_MISSION)
    phase[command[seq] == mavlink.MAV_CMD_NAV_LAND] = mavlink.PLUMBLINE_PHASE_LOWER
    positions = _item_positions(items, load, home)
    phase[seq <= _last_lift_item(command, positions, ground_m)] = mavlink.PLUMBLINE_PHASE_LIFT
    was_lifted = np.cumsum(lifted & turning) > 0
    phase[~lifted & ~was_lifted] = mavlink.PLUMBLINE_PHASE_TAUTEN
    phase[~lifted & was_lifted] = mavlink.PLUMBLINE_PHASE_SET_DOWN
    phase[~turning] = mavlink.PLUMBLINE_PHASE_DISARMED
    carried = lifted & turning
    line = _nearest_on_segments(position, positions[np.maximum(seq - 1, 0)], positions[seq])
    requested = np.where(carried[:, None], line, position)
    zeros, unknown = np.zeros_like(requested), np.full(len(time_s), np.nan)
    mode = np.where(carried, mavlink.PLUMBLINE_CONTROL_LOAD_POSITION, mavlink.PLUMBLINE_CONTROL_NONE).astype(
        np.int64
    )
    return SetpointTrack(
        time_s=time_s,
        position_m=requested,
        velocity_m_s=zeros,
        acceleration_m_s2=zeros,
        requested_m=requested,
        requested_m_s=zeros,
        q_cable_c=np.full_like(requested, np.nan),
        elapsed_s=unknown,
        duration_s=unknown,
        item=seq,
        phase=phase.astype(np.int64),
        control_mode=mode,
    )


def _turning(rotors: RotorTrack, at_s: Floats) -> NDArray[np.bool_]:
    """(n,) whether the rotors turn; True if no rotor forces were received."""
    if len(rotors.time_s) == 0:
        return np.ones(len(at_s), dtype=np.bool_)
    shares = rotors.force_n.max(axis=1) / rotors.force_max_n
    return np.asarray(np.nan_to_num(as_of(rotors.time_s, shares, at_s, _ANY_AGE_S)) > _TURNING_SHARE)


def _last_lift_item(command: Ints, positions: Floats, ground_m: float) -> int:
    """Index of the last item that lifts the load: the first item that ends above the ground or, if that is
    the take-off and a waypoint at the same place follows, that waypoint, in which the load comes to rest."""
    raised = np.flatnonzero(positions[:, 2] > ground_m + _LIFTED_M)
    if not len(raised):
        return 0
    last = int(raised[0])
    stop_follows = (
        command[last] == mavlink.MAV_CMD_NAV_TAKEOFF
        and command[last + 1 : last + 2] == mavlink.MAV_CMD_NAV_WAYPOINT
        and np.array_equal(positions[last + 1], positions[last])
    )
    return last + 1 if stop_follows else last


def _item_positions(items: Sequence[WireItem], load: LoadTrack, home: Home) -> Floats:
    """(items, 3) position of the hanging load at the end of each item, ENU."""
    taut = load.distance_m[load.taut > 0]
    cable_m = float(np.median(taut if len(taut) else load.distance_m))
    vehicle_ground_m = float(load.vehicle_m[0, 2])
    ground_m = load.position_m[0, 2]
    found, last = [], load.position_m[0]
    for item in items:
        if item.command in _POSITION_COMMANDS:
            x, y, _ = enu_from_geodetic(item.x, item.y, 0, home)
            lands = item.command == mavlink.MAV_CMD_NAV_LAND
            height = ground_m if lands else max(item.z + vehicle_ground_m - cable_m, ground_m)
            last = np.array([x, y, height])
        found.append(last)
    return np.array(found)


def _nearest_on_segments(points: Floats, begin: Floats, end: Floats) -> Floats:
    """(n, 3) the points on the line segments from `begin` to `end` that are nearest to `points`."""
    along = end - begin
    length = np.sum(along * along, axis=1)
    share = np.sum((points - begin) * along, axis=1) / np.where(length > 0.0, length, 1.0)
    return np.asarray(begin + np.clip(share, 0.0, 1.0)[:, None] * along)
