"""The mission commands: the parameters and the effect of each.

Encoding, decoding and the table in docs/mission-items.md follow from these rows. A command without a row is
refused if its number is at most MAV_CMD_NAV_LAST, because the user relies on being flown somewhere, and kept
if it is greater.
"""

from __future__ import annotations

import math

from autopilot.trajectory.timeline import SPEED_M_S
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.items import heading, readers
from autopilot.wire.items.command import Command, Handling
from autopilot.wire.items.fields import (
    Amplitude,
    Choice,
    Displacement,
    Fall,
    Height,
    HomePlace,
    Number,
    Place,
)
from autopilot.wire.items.limits import (
    FARTHEST_M,
    FASTEST_M_S,
    FASTEST_REEL_M_S,
    LARGEST_PHASE_RAD,
    LARGEST_TAG,
    LONGEST_CABLE_M,
    LONGEST_S,
    MAX_FLOWN_ITEMS,
    MAX_JUMPS,
    MAX_RADIUS_M,
    MAX_TURNS,
    SHORTEST_EDGE_S,
    SHORTEST_PERIOD_S,
    SHORTEST_RUN_S,
    SLOWEST_M_S,
    TURN_ACCEL_M_S2,
)
from autopilot.wire.items.records import GLOBAL_FRAMES
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    PlaceLoad,
    Release,
    ReturnHome,
    Signals,
    Sine,
    Speed,
    SwitchFence,
    Takeoff,
    Term,
    TrajectoryPoint,
    Waypoint,
    Winch,
)

_DELAY = (Number(1, "duration_s", "delay", "s", 0.0, LONGEST_S),)
_POINT = (Place(), Height())
_HELD_POINT = (Number(1, "hold_s", "hold", "s", 0.0, LONGEST_S, default=0.0), *_POINT)
_HERE_TEXT = (
    "without a place (x and y 0, or not given) at that of the load then, and if z is 0 too, at its height"
)
_SPEED_TYPE = {0: "airspeed", 1: "ground speed", 2: "climb", 3: "descent"}
_SENSE = {0: 0, 1: 1, -1: -1}  # the shorter way, clockwise, counter-clockwise
_ROI = (Choice(1, "mode", "mode", {mode: mode for mode in (m.MAV_ROI_NONE, m.MAV_ROI_LOCATION)}), Place())
_ROI_TEXT = "as DO_SET_ROI_LOCATION; p1 0 without a place as DO_SET_ROI_NONE"
_INSTANCE = {0: 0, 1: 1}  # grippers, winches: there is one
_GRIPPER_ACTION = {0: "release", 1: "grab", 2: "hold"}
_BY_LENGTH = m.WINCH_RELATIVE_LENGTH_CONTROL
_ATTITUDE_OF = {m.PLUMBLINE_CONTROL_QUAD_ATTITUDE: "vehicle", m.PLUMBLINE_CONTROL_LOAD_ATTITUDE: "load"}
_RIGHT_ANGLE = math.pi / 2.0
_MS, _US = 1e3, 1e6  # x and y: counts per second
_FENCE_TEXT = "it belongs in the list of the fence (mission type 1)"
_AREA_TEXTS = {
    m.MAV_CMD_NAV_FENCE_RETURN_POINT: _FENCE_TEXT,
    m.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION: _FENCE_TEXT,
    m.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION: _FENCE_TEXT,
    m.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION: _FENCE_TEXT,
    m.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION: _FENCE_TEXT,
    m.MAV_CMD_NAV_RALLY_POINT: "it belongs in the list of rally points (mission type 2)",
}
_NOT_SUPPORTED = "the vehicle cannot do it in a mission, and ignoring it would be unsafe or change the route"
_UNSAFE_TO_IGNORE = (
    m.MAV_CMD_DO_SET_MODE,
    m.MAV_CMD_DO_SET_STANDARD_MODE,
    m.MAV_CMD_DO_SET_HOME,
    m.MAV_CMD_DO_SET_PARAMETER,
    m.MAV_CMD_DO_FLIGHTTERMINATION,
    m.MAV_CMD_DO_PARACHUTE,
    m.MAV_CMD_DO_REPOSITION,
    m.MAV_CMD_DO_ORBIT,
    m.MAV_CMD_DO_PAUSE_CONTINUE,
    m.MAV_CMD_OVERRIDE_GOTO,
    m.MAV_CMD_DO_SET_MISSION_CURRENT,
    m.MAV_CMD_MISSION_START,
    m.MAV_CMD_CONDITION_CHANGE_ALT,
    m.MAV_CMD_CONDITION_DISTANCE,
    m.MAV_CMD_DO_RALLY_LAND,
    m.MAV_CMD_DO_GO_AROUND,
    m.MAV_CMD_DO_SET_REVERSE,
    m.MAV_CMD_DO_INVERTED_FLIGHT,
    m.MAV_CMD_NAV_SET_YAW_SPEED,
    m.MAV_CMD_DO_GUIDED_MASTER,
    m.MAV_CMD_DO_GUIDED_LIMITS,
    m.MAV_CMD_DO_ENGINE_CONTROL,
    m.MAV_CMD_DO_SET_SAFETY_SWITCH_STATE,
    m.MAV_CMD_COMPONENT_ARM_DISARM,
    m.MAV_CMD_SET_GUIDED_SUBMODE_STANDARD,
    m.MAV_CMD_SET_GUIDED_SUBMODE_CIRCLE,
    m.MAV_CMD_GUIDED_CHANGE_SPEED,
    m.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
    m.MAV_CMD_GUIDED_CHANGE_HEADING,
    m.MAV_CMD_PAYLOAD_PREPARE_DEPLOY,
    m.MAV_CMD_PAYLOAD_CONTROL_DEPLOY,
    m.MAV_CMD_WAYPOINT_USER_1,
    m.MAV_CMD_WAYPOINT_USER_2,
    m.MAV_CMD_WAYPOINT_USER_3,
    m.MAV_CMD_WAYPOINT_USER_4,
    m.MAV_CMD_WAYPOINT_USER_5,
)

COMMANDS: tuple[Command, ...] = (
    Command(
        m.MAV_CMD_NAV_TAKEOFF,
        "the cable is pulled taut and the load lifted straight up",
        (HomePlace(), Height()),
        Takeoff,
        is_default=True,
    ),
    Command(
        m.MAV_CMD_NAV_WAYPOINT,
        "the load is carried there; home as item 0 is not flown. The yaw p4 is ignored (use CONDITION_YAW to "
        "turn the nose), and so is `autocontinue` of every item",
        _HELD_POINT,
        Waypoint,
        is_default=True,
        read_steps=readers.waypoint,
    ),
    Command(
        m.MAV_CMD_NAV_SPLINE_WAYPOINT, "as NAV_WAYPOINT", _HELD_POINT, Waypoint, read_steps=readers.waypoint
    ),
    Command(
        m.MAV_CMD_NAV_LOITER_TIME, f"as NAV_WAYPOINT; {_HERE_TEXT}", _HELD_POINT, read_steps=readers.loiter
    ),
    Command(
        m.MAV_CMD_NAV_LOITER_TO_ALT,
        "as NAV_LOITER_TIME, without a hold",
        _POINT,
        read_steps=readers.loiter_to_altitude,
    ),
    Command(
        m.MAV_CMD_NAV_LOITER_UNLIM,
        "as NAV_LOITER_TIME, for a day",
        _POINT,
        read_steps=readers.loiter_unlimited,
    ),
    Command(
        m.MAV_CMD_NAV_LOITER_TURNS,
        "the load is carried to the centre (as to the place of NAV_LOITER_TIME), moves out along a spiral of "
        "one turn, flies the turns (clockwise for a positive radius), and comes back along another spiral. "
        f"Its speed is the last one that was set ({SPEED_M_S:g} m/s if none was), with at most "
        f"{TURN_ACCEL_M_S2:g} m/s^2 towards the centre",
        (
            Number(1, "turns", "turns", "", 0.0, MAX_TURNS),
            Number(3, "radius_m", "radius", "m", -MAX_RADIUS_M, MAX_RADIUS_M),
            *_POINT,
        ),
        read_steps=readers.loiter_turns,
    ),
    Command(
        m.MAV_CMD_CONDITION_GATE,
        "as NAV_WAYPOINT; if p2 is 0, at the height of the waypoint before it",
        _POINT,
        read_steps=readers.gate,
    ),
    Command(
        m.MAV_CMD_DO_CHANGE_ALTITUDE,
        "the load is carried straight up or down to the height p1 (m); refused if no item before it gives "
        "its position",
        (Choice(2, "frame", "frame", {frame: frame for frame in GLOBAL_FRAMES}),),
        read_steps=readers.change_altitude,
    ),
    Command(
        m.MAV_CMD_DO_CHANGE_SPEED,
        "sets the peak speed of the transfers that follow; for climb and descent, and with -1, it changes "
        "nothing",
        (
            Choice(1, "kind", "speed type", _SPEED_TYPE),
            Number(
                2, "speed_m_s", "speed", "m/s", SLOWEST_M_S, FASTEST_M_S, none=-2.0, none_means="`MIS_SPEED`"
            ),
        ),
        Speed,
        is_default=True,
        constants={"param1": 1.0, "param3": -1.0},
        read_steps=readers.change_speed,
    ),
    Command(
        m.MAV_CMD_DO_FENCE_ENABLE,
        "the fence is in force or not from the end of the item before it on (before the take-off: when the "
        "load is lifted), also beyond the mission. The items behind it are checked accordingly before the "
        "flight",
        (Choice(1, "on", "fence", {0: False, 1: True}),),
        SwitchFence,
        is_default=True,
    ),
    Command(
        m.MAV_CMD_CONDITION_YAW,
        "the nose turns to p1, clockwise from north (p4 1: from its present heading), at p2 deg/s (0: "
        "`MPC_YAWRAUTO_MAX`); p3 1 clockwise, -1 counter-clockwise, 0 the shorter way. The turn begins "
        "together with the next item, which does not wait for it",
        (
            Number(1, "angle_deg", "angle", "deg", -360.0, 360.0),
            Choice(3, "sense", "sense", _SENSE),
            Choice(4, "relative", "from", {0: False, 1: True}),
        ),
        heading_command=heading.condition_yaw,
    ),
    Command(
        m.MAV_CMD_DO_SET_ROI_LOCATION,
        "from the next item on the nose points at this place, until another command changes it",
        (Place(),),
        heading_command=heading.set_roi_location,
    ),
    Command(
        m.MAV_CMD_DO_SET_ROI_NONE, "the nose keeps its present heading", heading_command=heading.set_roi_none
    ),
    Command(m.MAV_CMD_DO_SET_ROI, _ROI_TEXT, _ROI, heading_command=heading.set_roi),
    Command(m.MAV_CMD_NAV_ROI, _ROI_TEXT, _ROI, heading_command=heading.set_roi),
    Command(
        m.MAV_CMD_NAV_DELAY,
        "the load is held for this time",
        _DELAY,
        Delay,
        is_default=True,
        constants={"param2": -1.0, "param3": -1.0, "param4": -1.0},
    ),
    Command(m.MAV_CMD_CONDITION_DELAY, "as NAV_DELAY", _DELAY, Delay),
    Command(
        m.MAV_CMD_DO_JUMP,
        f"the mission continues with item p1, p2 times (0 ... {MAX_JUMPS}) or without end (-1). The items "
        "behind a jump without end are flown once one of them becomes the present item "
        "(MISSION_SET_CURRENT), and the repeated ones must take at least 0.5 s and, if they release the "
        "load, do without it. All passes are checked before the flight, as far as they differ. Another jump "
        "around it does not reset the count of a jump. A mission of more than "
        f"{MAX_FLOWN_ITEMS} items, counted with all repetitions, is refused. If a jump becomes the present "
        "item, it is executed",
    ),
    Command(
        m.MAV_CMD_DO_JUMP_TAG,
        "as DO_JUMP, to the JUMP_TAG with the tag p1",
    ),
    Command(
        m.MAV_CMD_JUMP_TAG,
        "gives the items that follow it a tag, to which DO_JUMP_TAG leads; no other item may have the same",
        (Number(1, "tag", "tag", "", 0.0, LARGEST_TAG),),
        read_steps=readers.jump_tag,
    ),
    Command(
        m.MAV_CMD_DO_GRIPPER,
        "release: the load is released. After that, a landing at another place needs a waypoint before it, "
        "and grab is refused. Before a release, grab and hold change nothing",
        (
            Choice(1, "gripper", "gripper", _INSTANCE),
            Choice(2, "action", "gripper action", _GRIPPER_ACTION),
        ),
        Release,
        is_default=True,
        constants={"param1": 1.0, "param2": float(m.GRIPPER_ACTION_RELEASE)},
        read_steps=readers.gripper,
    ),
    Command(
        m.MAV_CMD_DO_WINCH,
        "the cable becomes longer by this length, or shorter if it is negative, while the vehicle stays in "
        "place. Refused if the height of the load is not known, as behind a jump without end, after an "
        "attitude run or signals that end in motion: add a waypoint before it",
        (
            Choice(1, "winch", "winch", _INSTANCE),
            Choice(2, "action", "winch action", {_BY_LENGTH: "length"}),
            Number(3, "length_m", "length", "m", -LONGEST_CABLE_M, LONGEST_CABLE_M),
            Number(
                4,
                "speed_m_s",
                "rate",
                "m/s",
                0.0,
                FASTEST_REEL_M_S,
                none=0.0,
                none_means="`WNC_SPEED`",
                magnitude=True,
            ),
        ),
        Winch,
        is_default=True,
        constants={"param1": 1.0, "param2": float(_BY_LENGTH)},
        read_steps=readers.winch,
        needs_load=True,
    ),
    Command(
        m.MAV_CMD_NAV_RETURN_TO_LAUNCH,
        "the load is carried over home (not over a rally point) at its present height; if it is the last "
        "item, it is also set down",
        (),
        ReturnHome,
        is_default=True,
    ),
    Command(
        m.MAV_CMD_NAV_LAND,
        "the load is set down and the vehicle lands beside it; if a place is given, the load is first "
        "carried there",
        (Place(),),
        Land,
        is_default=True,
        read_steps=readers.land,
    ),
    Command(
        m.MAV_CMD_NAV_PAYLOAD_PLACE,
        "the load is carried there, lowered until it lies on the ground, and released; the vehicle "
        "continues without it. Without a place (x and y 0, or not given) the load is placed where it hangs. "
        "A descent other than 0 that does not reach the ground at the height of home is refused",
        (Number(1, "descent_m", "greatest descent", "m", 0.0, FARTHEST_M), *_POINT),
        PlaceLoad,
        is_default=True,
        read_steps=readers.payload_place,
    ),
    Command(
        m.PLUMBLINE_LOAD_SIGNAL_TERM,
        "begins a term of signals",
        (
            Amplitude(),
            Number(5, "start_s", "start", "s", 0.0, LONGEST_S, _MS),
            Number(3, "rise_s", "rise", "s", SHORTEST_EDGE_S, LONGEST_S),
            Number(6, "hold_s", "hold", "s", 0.0, LONGEST_S, _MS, none=-1.0, none_means="for ever"),
            Fall(4, "fall_s", "fall", "s", SHORTEST_EDGE_S, LONGEST_S),
            Number(7, "rise_90_by_s", "rise by", "s", SHORTEST_EDGE_S, LONGEST_S, none=0.0),
        ),
        Term,
        is_default=True,
        mission_frame=True,
    ),
    Command(
        m.PLUMBLINE_LOAD_SIGNAL_FACTOR,
        "multiplies the last term by a sine",
        (
            Number(5, "period_s", "period", "s", SHORTEST_PERIOD_S, LONGEST_S, _US),
            Number(1, "phase_rad", "phase", "rad", -LARGEST_PHASE_RAD, LARGEST_PHASE_RAD),
            Number(6, "start_s", "start", "s", -LONGEST_S, LONGEST_S, _MS),
        ),
        Sine,
        is_default=True,
        mission_frame=True,
    ),
    Command(
        m.PLUMBLINE_LOAD_SIGNAL_RUN,
        "flies the terms before it",
        (Number(5, "duration_s", "duration", "s", SHORTEST_RUN_S, LONGEST_S, _MS),),
        Signals,
        is_default=True,
        mission_frame=True,
        needs_load=True,
    ),
    Command(
        m.PLUMBLINE_ATTITUDE_RUN,
        "leans the thrust axis (vehicle) or the line from load to vehicle (load) out and back",
        (
            Choice(1, "controlled", "mode", _ATTITUDE_OF),
            Number(2, "tilt_north_rad", "tilt north", "rad", -_RIGHT_ANGLE, _RIGHT_ANGLE),
            Number(3, "tilt_east_rad", "tilt east", "rad", -_RIGHT_ANGLE, _RIGHT_ANGLE),
            Number(5, "duration_s", "duration", "s", SHORTEST_EDGE_S, LONGEST_S, _MS),
        ),
        AttitudeRun,
        is_default=True,
        mission_frame=True,
        needs_load=True,
    ),
    Command(
        m.PLUMBLINE_LOAD_TRAJECTORY_POINT,
        "the load passes the points in a row at their times",
        (Number(5, "t_s", "time", "s", 0.0, LONGEST_S, _MS), Displacement()),
        TrajectoryPoint,
        is_default=True,
        mission_frame=True,
        needs_load=True,
    ),
    *(Command(number, text, handling=Handling.REFUSED) for number, text in _AREA_TEXTS.items()),
    *(Command(number, _NOT_SUPPORTED, handling=Handling.REFUSED) for number in _UNSAFE_TO_IGNORE),
)
COMMAND: dict[int, Command] = {row.number: row for row in COMMANDS}
AREA_COMMANDS = frozenset(_AREA_TEXTS)  # of fence and rally points, which are lists beside the mission


def handling_of(command: int) -> Handling:
    """What becomes of an item with this command if its parameters are valid."""
    if command in COMMAND:
        return COMMAND[command].handling
    known = command in m.enums["MAV_CMD"] and command != m.MAV_CMD_ENUM_END
    return Handling.KEPT if known and command > m.MAV_CMD_NAV_LAST else Handling.REFUSED
