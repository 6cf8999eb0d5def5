"""Missions as mission items and back.

`decode_items(encode_mission(mission, home), home)` equals `mission.steps` up to what the fields hold: float32
(heights, holds, speeds, delays, amplitudes, rises, falls, phases, tilts), milliseconds (starts, durations and
holds of signals), microseconds (periods) and 1e-7 degrees (the place of a waypoint: 5.6 mm). Items that were
made here come back unchanged: `encode(decode(items)) == items`.

Positions are positions of the load. Where a standard command leaves freedom:
* NAV_TAKEOFF lifts straight up; its latitude and longitude are ignored.
* NAV_LAND with a place that is not where the load is left (by the items before it) goes there first.
* Item 0 of a list that begins with home itself, as MAVProxy and Mission Planner write it, is not flown.
* NAV_LOITER_TURNS carries the load to the centre, spirals out in one turn, flies its turns and spirals
  back in one.
* NAV_LOITER_UNLIM holds for LONGEST_S: a day. NAV_SPLINE_WAYPOINT, NAV_LOITER_TO_ALT and CONDITION_GATE are
  waypoints; a gate without a height of its own is at the height of the waypoint before.
* DO_JUMP is flown by flying its items again; one without end is refused.
* Commands that point or trigger something (camera, gimbal, region of interest ...) and those above
  MAV_CMD_NAV_LAST that are not known are kept and not flown. Commands whose effect somebody relies on and
  that this vehicle has not (parachute, termination, change of mode or home) are refused.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from autopilot.geometry.frames import enu_from_ned
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.timeline import ANYWHERE, state_after
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_table import decimal_from_float32, float32
from missions.model import (
    AttitudeRun,
    Axis,
    Delay,
    Land,
    Mission,
    Release,
    ReturnHome,
    Signals,
    Sine,
    Speed,
    Step,
    Takeoff,
    Term,
    Waypoint,
    Winch,
)

# limits of what is flown, those of the mission file where it has them
MOST_TERMS = 32
MOST_FACTORS = 3
SHORTEST_EDGE_S = 0.1
SHORTEST_PERIOD_S = 0.1
LONGEST_S = 86400.0
FARTHEST_M = 100_000.0  # of home, as far as the earth may be taken as flat
FASTEST_M_S = 100.0
MOST_JUMPS = 1000  # repetitions of one jump
MOST_FLOWN = 4000  # items, those that jumps repeat counted again
MOST_TURNS, MOST_RADIUS_M = 1000.0, 1000.0
TURN_SPEED_M_S = 1.5  # of NAV_LOITER_TURNS where no speed was set before
TURN_ACCEL_M_S2 = 1.0  # inwards
LONGEST_CABLE_M, FASTEST_REEL_M_S = 100.0, 1.0
LEAST_REELED_M = 0.3  # height at which a winch leaves the load
_HOME_ROW_M = 1.0  # how near to home item 0 is home

_MISSION = mavlink.MAV_FRAME_MISSION
_RELATIVE = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
_ABSOLUTE_FRAMES = (mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_GLOBAL_FRAMES = (*_ABSOLUTE_FRAMES, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, _RELATIVE)
_PLACE_FRAMES = (*_GLOBAL_FRAMES, mavlink.MAV_FRAME_LOCAL_NED)

# PLUMBLINE_LOAD_SIGNAL_TERM.param1 and the sign of the amplitude; ned_from_enu of the unit vectors
_AXIS_CODE: dict[Axis, tuple[int, float]] = {"x": (1, 1.0), "y": (0, 1.0), "z": (2, -1.0)}
_AXIS_OF_CODE: dict[int, tuple[Axis, float]] = {code: (axis, s) for axis, (code, s) in _AXIS_CODE.items()}

_PARAM_RESULT = (
    mavlink.MAV_MISSION_INVALID_PARAM1,
    mavlink.MAV_MISSION_INVALID_PARAM2,
    mavlink.MAV_MISSION_INVALID_PARAM3,
    mavlink.MAV_MISSION_INVALID_PARAM4,
    mavlink.MAV_MISSION_INVALID_PARAM5_X,
    mavlink.MAV_MISSION_INVALID_PARAM6_Y,
    mavlink.MAV_MISSION_INVALID_PARAM7,
)


class WireItem(NamedTuple):
    """The fields of MISSION_ITEM_INT that belong to the item and not to its transfer."""

    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


class LocatedStep(NamedTuple):
    """A step and the items it was made of: `first` ... `last`, both included."""

    first: int
    last: int
    step: Step


class MissionItemError(ValueError):
    """An item that is refused; `result` is the MAV_MISSION_RESULT to answer with."""

    def __init__(self, seq: int, text: str, result: int) -> None:
        super().__init__(f"mission item {seq}: {text}")
        self.seq = seq
        self.text = text
        self.result = result


# ---- steps to items


def encode_mission(mission: Mission, home: Home) -> tuple[WireItem, ...]:
    """The items of a mission; MissionItemError if a number does not fit its field or could not be flown."""
    return encode_steps(mission.steps, home)


def encode_steps(steps: Sequence[Step], home: Home) -> tuple[WireItem, ...]:
    """The items of the steps."""
    items: list[WireItem] = []
    for step in steps:
        items.extend(_items(step, home, len(items)))
    located_steps(items, home)  # the vehicle would refuse what this refuses
    return tuple(items)


def _items(step: Step, home: Home, seq: int) -> Iterator[WireItem]:
    match step:
        case Takeoff(altitude_m):
            latitude, longitude, _ = geodetic_from_enu((0.0, 0.0, 0.0), home)
            command = mavlink.MAV_CMD_NAV_TAKEOFF
            yield _item(command, frame=_RELATIVE, x=latitude, y=longitude, z=altitude_m)
        case Waypoint(east_m, north_m, altitude_m, hold_s):
            _check(seq, 5, "east or north", max(abs(east_m), abs(north_m)), "m", 0.0, FARTHEST_M)
            latitude, longitude, _ = geodetic_from_enu((east_m, north_m, 0.0), home)
            command = mavlink.MAV_CMD_NAV_WAYPOINT
            yield _item(command, hold_s, frame=_RELATIVE, x=latitude, y=longitude, z=altitude_m)
        case Speed(speed_m_s):
            yield _item(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0)
        case Delay(duration_s):
            yield _item(mavlink.MAV_CMD_NAV_DELAY, duration_s, -1.0, -1.0, -1.0)
        case Release():
            yield _item(mavlink.MAV_CMD_DO_GRIPPER, 1.0, mavlink.GRIPPER_ACTION_RELEASE)
        case Winch(length_m, speed_m_s):
            action = mavlink.WINCH_RELATIVE_LENGTH_CONTROL
            yield _item(mavlink.MAV_CMD_DO_WINCH, 1.0, action, length_m, speed_m_s or 0.0)
        case ReturnHome():
            yield _item(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
        case Land():
            yield _item(mavlink.MAV_CMD_NAV_LAND)
        case Signals(duration_s, terms):
            for term in terms:
                code, sign = _AXIS_CODE[term.axis]
                start = _whole(seq, 5, "start", term.start_s, 1e3)
                hold = -1 if term.hold_s is None else _whole(seq, 6, "hold", term.hold_s, 1e3)
                amplitude = sign * term.amplitude_m
                command = mavlink.PLUMBLINE_LOAD_SIGNAL_TERM
                by = 0.0 if term.rise_90_by_s is None else term.rise_90_by_s
                yield _item(command, code, amplitude, term.rise_s, term.fall_s, x=start, y=hold, z=by)
                for sine in term.factors:
                    period = _whole(seq, 5, "period", sine.period_s, 1e6)
                    start = _whole(seq, 6, "start", sine.start_s, 1e3)
                    command = mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR
                    yield _item(command, sine.phase_rad, x=period, y=start)
            duration = _whole(seq, 5, "duration", duration_s, 1e3)
            yield _item(mavlink.PLUMBLINE_LOAD_SIGNAL_RUN, x=duration)
        case AttitudeRun(controlled, tilt_north_rad, tilt_east_rad, duration_s):
            mode = (
                mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE
                if controlled == "vehicle"
                else mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE
            )
            duration = _whole(seq, 5, "duration", duration_s, 1e3)
            yield _item(mavlink.PLUMBLINE_ATTITUDE_RUN, mode, tilt_north_rad, tilt_east_rad, x=duration)


def _item(
    command: int,
    param1: float = 0.0,
    param2: float = 0.0,
    param3: float = 0.0,
    param4: float = 0.0,
    *,
    frame: int = _MISSION,
    x: int = 0,
    y: int = 0,
    z: float = 0.0,
) -> WireItem:
    params = (float32(param1), float32(param2), float32(param3), float32(param4))
    return WireItem(frame, command, 0, 1, *params, x, y, float32(z))


def _whole(seq: int, param: int, name: str, seconds: float, per_second: float) -> int:
    """Seconds as a whole number of milli- or microseconds that fits int32."""
    longest = (2**31 - 1) / per_second
    _check(seq, param, name, seconds, "s", -longest, longest)
    return round(seconds * per_second)


# ---- items to steps


def decode_items(items: Sequence[WireItem], home: Home) -> tuple[Step, ...]:
    """The steps that the items stand for, or MissionItemError for the first item that cannot be flown."""
    return tuple(located.step for located in located_steps(items, home))


def located_steps(items: Sequence[WireItem], home: Home, return_to: Vec3 = ZERO) -> tuple[LocatedStep, ...]:
    """As `decode_items`, each step with the items that MISSION_CURRENT and MISSION_ITEM_REACHED name.

    Places are relative to `home`; a return leads to `return_to` (m, ENU), which DO_SET_HOME moves.
    """
    reader = _Reader(home, return_to)
    jumps: dict[int, int] = {}
    flown = seq = 0
    while seq < len(items):
        item = items[seq]
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            reader.expect_no_terms(seq - 1)
            last = len(items) - 1
            target = _choice(seq, 1, "item to jump to", item.param1, range(last + 1), f"0 ... {last}")
            times = _choice(seq, 2, "repetitions", item.param2, range(MOST_JUMPS + 1), f"0 ... {MOST_JUMPS}")
            jumps[seq] = jumps.get(seq, 0) + 1
            seq = target if jumps[seq] <= times else seq + 1
        else:
            reader.read(seq, item)
            seq += 1
        flown += 1
        if flown > MOST_FLOWN:
            text = f"with its jumps the mission has more than {MOST_FLOWN} items"
            raise MissionItemError(min(seq, len(items) - 1), text, mavlink.MAV_MISSION_NO_SPACE)
    reader.expect_no_terms(len(items) - 1)
    return tuple(reader.steps)


def unflown(items: Sequence[WireItem]) -> tuple[int, ...]:
    """Numbers of the items that are kept and not flown."""
    return tuple(seq for seq, item in enumerate(items) if item.command not in FLOWN_COMMANDS)


class _Reader:
    """Goes through the items in order: terms gather until their run; the state of the load is followed."""

    def __init__(self, home: Home, return_to: Vec3) -> None:
        self.steps: list[LocatedStep] = []
        self._home = home
        self._return_to = return_to
        self._terms: list[Term] = []
        self._first_term = 0
        self._speed = TURN_SPEED_M_S
        self._state = ANYWHERE  # after the steps so far

    def read(self, seq: int, item: WireItem) -> None:
        command = item.command
        if command == mavlink.PLUMBLINE_LOAD_SIGNAL_TERM:
            self._term(seq, item)
        elif command == mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR:
            self._factor(seq, item)
        elif command == mavlink.PLUMBLINE_LOAD_SIGNAL_RUN:
            self._run(seq, item)
        elif command in _STANDARD or command == mavlink.PLUMBLINE_ATTITUDE_RUN:
            self.expect_no_terms(seq - 1)
            self._step(seq, item)
        elif command in _RELIED_ON:
            text = f"command {command} cannot be done by this vehicle"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_UNSUPPORTED)
        elif command <= mavlink.MAV_CMD_NAV_LAST and command != mavlink.MAV_CMD_NAV_ROI:
            flown = ", ".join(map(str, sorted(_STANDARD)))
            text = f"command {command}; must be one of {flown} or 31010 ... 31013"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_UNSUPPORTED)

    def expect_no_terms(self, seq: int) -> None:
        """Terms without a run would be lost silently."""
        if self._terms:
            text = f"the load signal begun at item {self._first_term} has no run (31012) behind it"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)

    def _add(self, seq: int, step: Step, first: int | None = None) -> None:
        self.steps.append(LocatedStep(seq if first is None else first, seq, step))
        self._state = state_after(step, self._state, self._return_to)

    def _step(self, seq: int, item: WireItem) -> None:
        command = item.command
        if command == mavlink.MAV_CMD_NAV_TAKEOFF:
            self._add(seq, Takeoff(self._height(seq, item)))
        elif command == mavlink.MAV_CMD_NAV_LOITER_TURNS:
            self._turns(seq, item)
        elif command in _PLACES:
            if not self._is_home_row(seq, item):
                hold = 0.0
                if command == mavlink.MAV_CMD_NAV_LOITER_UNLIM:
                    hold = LONGEST_S
                elif command != mavlink.MAV_CMD_NAV_LOITER_TO_ALT:
                    hold = _check(seq, 1, "hold", item.param1, "s", 0.0, LONGEST_S)
                east, north = self._place(seq, item)
                self._add(seq, Waypoint(east, north, self._height(seq, item), hold))
        elif command == mavlink.MAV_CMD_CONDITION_GATE:
            self._gate(seq, item)
        elif command == mavlink.MAV_CMD_DO_CHANGE_SPEED:
            kind = _choice(seq, 1, "speed type", item.param1, (0, 1, 2, 3))
            if kind in (0, 1) and item.param2 != -1.0:  # -1: no change; 2, 3: climb and descent
                self._speed = _check(seq, 2, "speed", item.param2, "m/s", 0.01, FASTEST_M_S)
                self._add(seq, Speed(self._speed))
        elif command == mavlink.MAV_CMD_DO_GRIPPER:
            self._gripper(seq, item)
        elif command == mavlink.MAV_CMD_DO_WINCH:
            self._winch(seq, item)
        elif command == mavlink.MAV_CMD_DO_CHANGE_ALTITUDE:
            self._change_altitude(seq, item)
        elif command in (mavlink.MAV_CMD_NAV_DELAY, mavlink.MAV_CMD_CONDITION_DELAY):
            self._add(seq, Delay(_check(seq, 1, "delay", item.param1, "s", 0.0, LONGEST_S)))
        elif command == mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            self._add(seq, ReturnHome())
        elif command == mavlink.MAV_CMD_NAV_LAND:
            self._land(seq, item)
        else:
            self._attitude_run(seq, item)

    def _gripper(self, seq: int, item: WireItem) -> None:
        """Releasing is a step; taking hold of what is held, as some planners have it, is none."""
        _choice(seq, 1, "gripper", item.param1, (0, 1))
        action = _choice(seq, 2, "gripper action", item.param2, (0, 1, 2))
        if action == mavlink.GRIPPER_ACTION_RELEASE:
            self._add(seq, Release())
        elif action == mavlink.GRIPPER_ACTION_GRAB and self._state.released:
            text = "the load, released before, can be taken on the ground only and not by a mission"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID_PARAM2)

    def _winch(self, seq: int, item: WireItem) -> None:
        self._expect_load(seq)
        _choice(seq, 1, "winch", item.param1, (0, 1))
        _choice(seq, 2, "winch action", item.param2, (mavlink.WINCH_RELATIVE_LENGTH_CONTROL,))
        length = _check(seq, 3, "length", item.param3, "m", -LONGEST_CABLE_M, LONGEST_CABLE_M)
        rate = _check(seq, 4, "rate", abs(item.param4), "m/s", 0.0, FASTEST_REEL_M_S)
        step = Winch(length, rate or None)
        left_at = state_after(step, self._state).position
        if left_at is None:
            text = "nothing before it says how high the load hangs"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        if left_at[2] < LEAST_REELED_M:
            text = f"it would leave the load at {left_at[2]:.2f} m; least {LEAST_REELED_M} m"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID_PARAM3)
        self._add(seq, step)

    def _expect_load(self, seq: int) -> None:
        """Signals and attitude runs swing a load."""
        if self._state.released:
            text = "needs the load, which an item before it has released"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)

    def _turns(self, seq: int, item: WireItem) -> None:
        """A spiral out, turns, a spiral in: an amplitude that rises and falls, times sine and cosine."""
        turns = _check(seq, 1, "turns", item.param1, "", 0.0, MOST_TURNS)
        radius = _check(seq, 3, "radius", item.param3, "m", -MOST_RADIUS_M, MOST_RADIUS_M)
        east, north = self._place(seq, item)
        self._add(seq, Waypoint(east, north, self._height(seq, item)))
        if radius == 0.0 or turns == 0.0:
            return
        self._expect_load(seq)
        speed = min(self._speed, math.sqrt(TURN_ACCEL_M_S2 * abs(radius)))
        period = max(2.0 * math.pi * abs(radius) / speed, SHORTEST_PERIOD_S)
        quarter = 0.5 * math.pi
        # clockwise seen from above for a positive radius: east as the sine, north as the cosine
        phases: tuple[tuple[Axis, float], ...] = (("x", 0.0 if radius > 0.0 else math.pi), ("y", quarter))
        terms = tuple(
            Term(axis, abs(radius), 0.0, period, turns * period, period, (Sine(period, phase),))
            for axis, phase in phases
        )
        self._add(seq, Signals((turns + 2.0) * period, terms))

    def _gate(self, seq: int, item: WireItem) -> None:
        """Where a ground station has a survey begin and end: flown to like a waypoint."""
        left_at = self._state.position
        if item.param2 == 0.0 and left_at is None:
            text = "a gate without a height, and nothing before it has one"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        height = left_at[2] if item.param2 == 0.0 and left_at else self._height(seq, item)
        self._add(seq, Waypoint(*self._place(seq, item), height))

    def _change_altitude(self, seq: int, item: WireItem) -> None:
        frame = _choice(seq, 2, "frame", item.param2, _GLOBAL_FRAMES)
        height = item.param1 - (self._home.altitude_m if frame in _ABSOLUTE_FRAMES else 0.0)
        height = _check(seq, 1, "height above home", height, "m", 0.01, FARTHEST_M)
        left_at = self._state.position
        if left_at is None:
            text = "nothing before it says where the load hangs"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        self._add(seq, Waypoint(left_at[0], left_at[1], height))

    def _land(self, seq: int, item: WireItem) -> None:
        placed = item.frame in _PLACE_FRAMES and (item.x, item.y) != (0, 0)
        left_at = self._state.position
        if placed and self._state.released and left_at is None:
            text = "nothing between it and the release says how high the vehicle flies; put a waypoint there"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        if placed and left_at is not None:
            east, north = self._place(seq, item)
            if math.dist((east, north), left_at[:2]) > _HOME_ROW_M:
                self._add(seq, Waypoint(east, north, left_at[2]))
        self._add(seq, Land())

    def _is_home_row(self, seq: int, item: WireItem) -> bool:
        if seq != 0 or item.current != 1 or item.frame not in _ABSOLUTE_FRAMES:
            return False
        place = enu_from_geodetic(item.x, item.y, 0, self._home)
        height = item.z - self._home.altitude_m
        return math.hypot(place[0], place[1]) < _HOME_ROW_M and abs(height) < _HOME_ROW_M

    def _place(self, seq: int, item: WireItem) -> tuple[float, float]:
        """(east, north) in m of home."""
        if item.frame in _GLOBAL_FRAMES:
            _check(seq, 5, "latitude", item.x * 1e-7, "deg", -90.0, 90.0)
            _check(seq, 6, "longitude", item.y * 1e-7, "deg", -180.0, 180.0)
            east, north, _ = enu_from_geodetic(item.x, item.y, 0, self._home)
        elif item.frame == mavlink.MAV_FRAME_LOCAL_NED:
            east, north, _ = enu_from_ned((item.x / 1e4, item.y / 1e4, 0.0))
        else:
            raise _wrong_frame(seq, item, _PLACE_FRAMES)
        _check(seq, 5, "place north of home", north, "m", -FARTHEST_M, FARTHEST_M)
        _check(seq, 6, "place east of home", east, "m", -FARTHEST_M, FARTHEST_M)
        return east, north

    def _height(self, seq: int, item: WireItem) -> float:
        """Height in m above home; above the ground, for a load hangs there."""
        if item.frame not in _PLACE_FRAMES:
            raise _wrong_frame(seq, item, _PLACE_FRAMES)
        height = item.z
        if item.frame in _ABSOLUTE_FRAMES:
            height -= self._home.altitude_m
        elif item.frame == mavlink.MAV_FRAME_LOCAL_NED:
            height = enu_from_ned((0.0, 0.0, height))[2]
        return _check(seq, 7, "height above home", height, "m", 0.01, FARTHEST_M)

    def _term(self, seq: int, item: WireItem) -> None:
        _expect_mission_frame(seq, item)
        if len(self._terms) == MOST_TERMS:
            raise MissionItemError(seq, f"more than {MOST_TERMS} terms", mavlink.MAV_MISSION_NO_SPACE)
        axis, sign = _AXIS_OF_CODE[_choice(seq, 1, "axis", item.param1, tuple(_AXIS_OF_CODE))]
        for_ever = item.y == -1
        term = Term(
            axis=axis,
            amplitude_m=sign * _check(seq, 2, "amplitude", item.param2, "m", -FARTHEST_M, FARTHEST_M),
            start_s=_check(seq, 5, "start", item.x / 1e3, "s", 0.0, LONGEST_S),
            rise_s=_check(seq, 3, "rise", item.param3, "s", SHORTEST_EDGE_S, LONGEST_S),
            hold_s=None if for_ever else _check(seq, 6, "hold", item.y / 1e3, "s", 0.0, LONGEST_S),
            fall_s=_check(seq, 4, "fall", item.param4, "s", 0.0 if for_ever else SHORTEST_EDGE_S, LONGEST_S),
            rise_90_by_s=None
            if item.z == 0.0
            else _check(seq, 7, "rise by", item.z, "s", SHORTEST_EDGE_S, LONGEST_S),
        )
        if not self._terms:
            self._first_term = seq
        self._terms.append(term)

    def _factor(self, seq: int, item: WireItem) -> None:
        _expect_mission_frame(seq, item)
        if not self._terms:
            text = "a factor (31011) must follow a term (31010)"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        term = self._terms[-1]
        if term.rise_90_by_s is not None:
            text = "a term with a time to rise by takes no factors"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        if len(term.factors) == MOST_FACTORS:
            text = f"more than {MOST_FACTORS} factors of one term"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_NO_SPACE)
        sine = Sine(
            period_s=_check(seq, 5, "period", item.x / 1e6, "s", SHORTEST_PERIOD_S, LONGEST_S),
            phase_rad=_check(seq, 1, "phase", item.param1, "rad", -100.0, 100.0),
            start_s=_check(seq, 6, "start", item.y / 1e3, "s", -LONGEST_S, LONGEST_S),
        )
        self._terms[-1] = Term(
            term.axis,
            term.amplitude_m,
            term.start_s,
            term.rise_s,
            term.hold_s,
            term.fall_s,
            (*term.factors, sine),
        )

    def _run(self, seq: int, item: WireItem) -> None:
        _expect_mission_frame(seq, item)
        if not self._terms:
            text = "a run (31012) must follow a term (31010)"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
        self._expect_load(seq)
        duration = _check(seq, 5, "duration", item.x / 1e3, "s", 1e-3, LONGEST_S)
        self._add(seq, Signals(duration, tuple(self._terms)), first=self._first_term)
        self._terms = []

    def _attitude_run(self, seq: int, item: WireItem) -> None:
        _expect_mission_frame(seq, item)
        self._expect_load(seq)
        mode = _choice(
            seq,
            1,
            "mode",
            item.param1,
            (mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE, mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE),
        )
        upright = math.pi / 2.0
        run = AttitudeRun(
            "vehicle" if mode == mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE else "load",
            _check(seq, 2, "tilt north", item.param2, "rad", -upright, upright),
            _check(seq, 3, "tilt east", item.param3, "rad", -upright, upright),
            _check(seq, 5, "duration", item.x / 1e3, "s", SHORTEST_EDGE_S, LONGEST_S),
        )
        self._add(seq, run)


_STANDARD = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_DELAY,
        mavlink.MAV_CMD_CONDITION_DELAY,
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TURNS,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_DO_CHANGE_ALTITUDE,
        mavlink.MAV_CMD_CONDITION_GATE,
        mavlink.MAV_CMD_DO_GRIPPER,
        mavlink.MAV_CMD_DO_WINCH,
    }
)
_PLACES = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_SPLINE_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
    }
)
_RELIED_ON = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_DO_SET_HOME,
        mavlink.MAV_CMD_DO_FLIGHTTERMINATION,
        mavlink.MAV_CMD_DO_PARACHUTE,
        mavlink.MAV_CMD_DO_REPOSITION,
        mavlink.MAV_CMD_DO_ORBIT,
        mavlink.MAV_CMD_DO_PAUSE_CONTINUE,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    }
)
# all that is flown; other commands above MAV_CMD_NAV_LAST are kept and passed over, the rest is refused
FLOWN_COMMANDS = _STANDARD | {
    mavlink.PLUMBLINE_LOAD_SIGNAL_TERM,
    mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR,
    mavlink.PLUMBLINE_LOAD_SIGNAL_RUN,
    mavlink.PLUMBLINE_ATTITUDE_RUN,
    mavlink.MAV_CMD_DO_JUMP,
}


def _check(seq: int, param: int, name: str, value: float, unit: str, low: float, high: float) -> float:
    """`value`, a float32 as the decimal that somebody wrote, if it lies within its limits; NaN does not."""
    decimal = decimal_from_float32(value)
    if low <= decimal <= high:
        return decimal
    text = f"{name} = {value:.7g} {unit}; must be {low:.7g} ... {high:.7g}"
    raise MissionItemError(seq, text, _PARAM_RESULT[param - 1])


def _choice(
    seq: int, param: int, name: str, value: float, allowed: Sequence[int], shown: str | None = None
) -> int:
    if value in allowed:
        return int(value)
    wanted = shown or f"one of {', '.join(map(str, sorted(allowed)))}"
    text = f"{name} = {value:.7g}; must be {wanted}"
    raise MissionItemError(seq, text, _PARAM_RESULT[param - 1])


def _expect_mission_frame(seq: int, item: WireItem) -> None:
    if item.frame != _MISSION:
        raise _wrong_frame(seq, item, (_MISSION,))


def _wrong_frame(seq: int, item: WireItem, allowed: tuple[int, ...]) -> MissionItemError:
    text = f"frame {item.frame}; must be {' or '.join(map(str, sorted(allowed)))} for command {item.command}"
    return MissionItemError(seq, text, mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
