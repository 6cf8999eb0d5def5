"""Missions as mission items: there and back, refusals, what other ground stations send."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.geometry.frames import ned_from_enu
from autopilot.geometry.linear import norm
from autopilot.trajectory.signals import evaluate, signal_table
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import EARTH_RADIUS_M, Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import (
    LocatedStep,
    MissionItemError,
    WireItem,
    decode_items,
    encode_mission,
    encode_steps,
    located_steps,
    read_items,
    unflown_items,
)
from autopilot.wire.items.fields import NOT_GIVEN
from autopilot.wire.items.limits import FASTEST_M_S, LONGEST_S, MAX_FACTORS, MAX_POINTS, MAX_TERMS
from missions.fileformat import load_mission, shipped
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    LookAt,
    ReturnHome,
    Signals,
    Sine,
    Speed,
    Step,
    SwitchFence,
    Takeoff,
    Term,
    Trajectory,
    TurnHeading,
    Waypoint,
    Winch,
)
from tests.doubles.trajectories import trajectories

HOME = Home(47.397742, 8.545594, 488.0)
FLOAT32 = 2.0**-24  # half a step of float32, relative
MS = 0.5e-3 + 1e-9  # half a millisecond
PLACE_M = 0.5e-7 * EARTH_RADIUS_M * math.pi / 180.0 + 1e-6  # half of 1e-7 degrees

quick = settings(max_examples=150, deadline=None, derandomize=True)


def real(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda value: value + 0.0)  # no -0.0


seconds = real(0.0, 3600.0)
edges = real(0.1, 3600.0)
sines = st.builds(Sine, real(0.1, 2000.0), real(-7.0, 7.0), seconds)
terms = st.builds(
    Term,
    st.sampled_from(["x", "y", "z"]),
    real(-1000.0, 1000.0),
    seconds,
    edges,
    st.none() | seconds,
    edges,
    st.lists(sines, max_size=MAX_FACTORS).map(tuple),
)
steps: st.SearchStrategy[Step] = st.one_of(
    st.builds(Takeoff, real(0.1, 1000.0)),
    st.builds(Waypoint, real(-1000.0, 1000.0), real(-1000.0, 1000.0), real(0.1, 1000.0), seconds),
    st.builds(Speed, real(0.01, 20.0)),
    st.builds(SwitchFence, st.booleans()),
    st.builds(Delay, seconds),
    st.just(ReturnHome()),
    st.just(Land()),
    st.builds(Signals, real(0.1, 3600.0), st.lists(terms, min_size=1, max_size=4).map(tuple)),
    trajectories(1000.0),
    st.builds(AttitudeRun, st.sampled_from(["vehicle", "load"]), real(-1.5, 1.5), real(-1.5, 1.5), edges),
)
missions = st.lists(steps, max_size=8)


def item(command: int, *params: float, frame: int = 2, x: int = 0, y: int = 0, z: float = 0.0) -> WireItem:
    p1, p2, p3, p4 = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return WireItem(frame, command, 0, 1, p1, p2, p3, p4, x, y, z)


def _jet(signals: Signals, t: float) -> Any:
    return evaluate(signal_table(signals.terms), t)


TERM = item(31010, 0.0, 1.0, 0.5, 0.5, y=-1)
FACTOR = item(31011, x=3_000_000)
RUN = item(31012, x=10_000)
UP = item(22, frame=6, z=5.0)
START = item(31014)
POINT = item(31014, 1.0, 2.0, -0.5, x=1000)


def numbers(value: Any) -> list[Any]:
    """Everything that a step is made of, in order."""
    if hasattr(value, "__dataclass_fields__"):
        inside = [getattr(value, name) for name in value.__dataclass_fields__]
        return [type(value), *(n for one in inside for n in numbers(one))]
    if isinstance(value, tuple):
        return [len(value), *(n for one in value for n in numbers(one))]
    return [value]


def assert_same_steps(got: tuple[Step, ...], sent: tuple[Step, ...]) -> None:
    for one, other in zip(got, sent, strict=True):
        place = PLACE_M if isinstance(other, Waypoint) else 0.0
        for a, b in zip(numbers(one), numbers(other), strict=True):
            assert a == pytest.approx(b, rel=FLOAT32, abs=max(MS, place)) if isinstance(b, float) else a == b


@given(missions)
@quick
def test_a_mission_comes_back(sent: list[Step]) -> None:
    items = encode_steps(sent, HOME)
    got = decode_items(items, HOME)
    assert_same_steps(got, tuple(sent))
    assert encode_steps(got, HOME) == items


@given(missions)
@quick
def test_items_survive_the_wire(sent: list[Step]) -> None:
    items = encode_steps(sent, HOME)
    writer = FrameWriter(255, 190)
    for seq, one in enumerate(items):
        message = mavlink.MAVLink_mission_item_int_message(1, 1, seq, *one)
        received = decode(writer.frame(message))[0][0].message
        assert WireItem(*(getattr(received, name) for name in WireItem._fields)) == one


@pytest.mark.parametrize("name", shipped())
def test_shipped_missions_come_back(name: str) -> None:
    mission = load_mission(name)
    assert_same_steps(decode_items(encode_mission(mission, HOME), HOME), mission.steps)


def test_decimals_come_back_as_they_were_typed() -> None:
    sent = (Signals(7.1, (Term("z", 0.3, 0.7, 0.78, None, 0.0, (Sine(2.1, 0.1, 0.123),)),)), Speed(1.1))
    assert decode_items(encode_steps(sent, HOME), HOME) == sent


def test_the_winch_comes_back_and_moves_where_the_load_hangs() -> None:
    sent = (Takeoff(2.0), Winch(0.5, 0.2), Winch(-0.3))
    items = encode_steps(sent, HOME)
    assert [(one.command, one.param2, one.param3, one.param4) for one in items[1:]] == [
        (42600, 1.0, 0.5, pytest.approx(0.2)),
        (42600, 1.0, pytest.approx(-0.3), 0.0),
    ]
    assert decode_items(items, HOME) == sent
    with pytest.raises(MissionItemError, match=r"leave the load at 0\.20 m"):
        decode_items([*items[:2], item(42600, 1.0, 1.0, 1.3)], HOME)


def test_axes_are_those_of_ned() -> None:
    for axis, unit in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)), ("z", (0.0, 0.0, 1.0))):
        term = Term(axis, 2.0, 0.0, 1.0, None, 0.0)  # type: ignore[arg-type]
        first = encode_steps([Signals(1.0, (term,))], HOME)[0]
        along = [0.0, 0.0, 0.0]
        along[int(first.param1)] = first.param2 / 2.0
        assert tuple(along) == ned_from_enu(unit)


def test_the_standard_commands_are_as_any_ground_station_has_them() -> None:
    takeoff, go, speed, delay, back, land = encode_steps(
        [Takeoff(2.0), Waypoint(10.0, 20.0, 3.0, 1.5), Speed(2.5), Delay(4.0), ReturnHome(), Land()], HOME
    )
    latitude, longitude, _ = geodetic_from_enu((10.0, 20.0, 0.0), HOME)
    assert (takeoff.command, takeoff.frame, takeoff.z) == (22, 6, 2.0)
    assert go == WireItem(6, 16, 0, 1, 1.5, 0.0, 0.0, 0.0, latitude, longitude, 3.0)
    assert (speed.command, speed.param1, speed.param2) == (178, 1.0, 2.5)
    assert (delay.command, delay.param1, delay.param2) == (93, 4.0, -1.0)
    assert (back.command, land.command) == (20, 21)


def test_each_step_knows_its_items() -> None:
    items = [item(93, 1.0), item(203), TERM, FACTOR, TERM, RUN, item(20)]
    located = located_steps(items, HOME)
    assert [(one.first, one.last) for one in located] == [(0, 0), (2, 5), (6, 6)]
    assert isinstance(located[1], LocatedStep)
    assert [len(term.factors) for term in located[1].step.terms] == [1, 0]  # type: ignore[union-attr]


THERE: Any = {"frame": 6, "x": 473977420, "y": 85455940, "z": 5.0}
REFUSALS = [
    # items, item that is refused, MAV_MISSION_RESULT, part of the text
    ([item(17, frame=2)], 0, "UNSUPPORTED_FRAME", "frame 2"),
    ([item(84, frame=6)], 0, "UNSUPPORTED", "NAV_VTOL_TAKEOFF (84) is not flown; use NAV_TAKEOFF,"),
    ([item(176)], 0, "UNSUPPORTED", "DO_SET_MODE (176): the vehicle cannot do it in a mission"),
    *(
        ([UP, item(command, 3.0, frame=6)], 1, "UNSUPPORTED", "list of the fence (mission type 1)")
        for command in range(5000, 5005)
    ),
    (
        [UP, item(5100, frame=6)],
        1,
        "UNSUPPORTED",
        "it belongs in the list of rally points",
    ),
    ([item(211, 2.0, 0.0)], 0, "INVALID_PARAM1", "gripper = 2"),
    (
        [item(94, 2.0, frame=6, x=473977420, y=85455940, z=5.0)],
        0,
        "INVALID_PARAM1",
        "2 m at most does not reach",
    ),
    (
        [item(94, -1.0, frame=6, x=473977420, y=85455940, z=5.0)],
        0,
        "INVALID_PARAM1",
        "greatest descent = -1 m",
    ),
    ([item(211, 1.0, 0.0), item(94, 0.0)], 1, "INVALID", "needs the load"),
    ([item(211, 1.0, 3.0)], 0, "INVALID_PARAM2", "gripper action = 3; must be one of 0 release, 1 grab,"),
    ([item(211, 1.0, 0.0), item(211, 1.0, 1.0)], 1, "INVALID_PARAM2", "on the ground only"),
    ([item(211, 1.0, 0.0), TERM, RUN], 2, "INVALID", "needs the load"),
    ([item(211, 1.0, 0.0), item(21, frame=6, x=473977420, y=85455940)], 1, "INVALID", "put a waypoint"),
    (
        [item(42600, 1.0, 1.0, 0.5)],
        0,
        "INVALID",
        "height is not given by any item before it; a waypoint first",
    ),
    (
        [UP, item(31013, 1.0, 0.1, x=1000), item(42600, 1.0, 1.0, 0.5)],
        2,
        "INVALID",
        "height is not known after an attitude run;",
    ),
    (
        [UP, TERM, RUN._replace(x=250), item(42600, 1.0, 1.0, 0.5)],  # cut off in the rise
        3,
        "INVALID",
        "height is not known after signals that end in motion;",
    ),
    ([UP, item(42600, 3.0, 1.0, 0.5)], 1, "INVALID_PARAM1", "winch = 3"),
    ([UP, item(42600, 1.0, 2.0, 0.5)], 1, "INVALID_PARAM2", "winch action = 2; must be one of 1 length"),
    ([UP, item(42600, 1.0, 1.0, math.nan)], 1, "INVALID_PARAM3", "length = nan m"),
    ([UP, item(42600, 1.0, 1.0, 0.5, 2.0)], 1, "INVALID_PARAM4", "rate = 2 m/s"),
    (
        [UP, item(42600, 1.0, 1.0, 4.8)],
        1,
        "INVALID_PARAM3",
        "at 0.20 m; must be at least 0.3 m",
    ),
    ([UP, item(211, 1.0, 0.0), item(42600, 1.0, 1.0, 0.5)], 2, "INVALID", "needs the load"),
    ([item(177, 3.0, 1.0)], 0, "INVALID_PARAM1", "item to jump to = 3; must be 0 ... 0"),
    (
        [item(93, 1.0), item(177, 0.0, -2.0)],
        1,
        "INVALID_PARAM2",
        "repetitions = -2; must be 0 ... 1000, or -1",
    ),
    ([item(201), item(177, 0.0, -1.0), item(93, 1.0)], 1, "INVALID", "must lead back to something"),
    ([item(93, 1.0), item(600, 5.0), item(601, 4.0, 1.0)], 2, "INVALID_PARAM1", "no item has the tag 4"),
    ([item(600, 5.0), item(93, 1.0), item(600, 5.0)], 2, "INVALID_PARAM1", "tag 5 is already that of item 0"),
    ([item(600, -1.0)], 0, "INVALID_PARAM1", "tag = -1; must be 0 ... 65535"),
    ([item(600, 5.0), item(93, 1.0), item(601, 5.0, -2.0)], 2, "INVALID_PARAM2", "repetitions = -2"),
    ([item(93, 1.0), item(114, 5.0)], 1, "UNSUPPORTED", "or change the route"),
    ([item(93, 1.0), item(31998)], 1, "UNSUPPORTED", "command 31998"),
    ([item(93, 1.0), item(60000)], 1, "UNSUPPORTED", "command 60000"),
    ([item(186, 3.0, 3.0)], 0, "INVALID", "nothing before it says"),
    ([item(18, math.nan, frame=6, z=2.0)], 0, "INVALID_PARAM1", "turns = nan"),
    ([item(16, frame=10, z=5.0)], 0, "UNSUPPORTED_FRAME", "frame 10"),
    ([item(16, frame=2, z=5.0)], 0, "UNSUPPORTED_FRAME", "frame 2"),
    ([item(22, frame=8, z=5.0)], 0, "UNSUPPORTED_FRAME", "frame 8"),
    ([item(22, frame=6, z=math.nan)], 0, "INVALID_PARAM7", "height above home = nan m"),
    ([item(22, frame=6, z=-1.0)], 0, "INVALID_PARAM7", "height above home = -1 m"),
    ([item(22, frame=0, z=488.0)], 0, "INVALID_PARAM7", "height above home = 0 m"),
    ([item(16, math.inf, frame=1, z=-5.0)], 0, "INVALID_PARAM1", "hold = inf s"),
    ([item(19, 2.0, frame=6, y=NOT_GIVEN, z=5.0)], 0, "INVALID_PARAM6_Y", "it is not given"),
    ([item(19, 2.0, z=5.0)], 0, "UNSUPPORTED_FRAME", "frame 2"),
    ([item(31, frame=6, z=5.0)], 0, "INVALID", "nothing before it says where the load hangs"),
    ([UP, item(21, frame=6, x=NOT_GIVEN)], 1, "INVALID_PARAM5_X", "it is not given"),
    ([item(16, -1.0, frame=1, z=-5.0)], 0, "INVALID_PARAM1", "hold = -1 s"),
    ([item(16, frame=1, z=5.0)], 0, "INVALID_PARAM7", "height above home = -5 m"),
    ([item(16, frame=6, x=2**31 - 1, z=5.0)], 0, "INVALID_PARAM5_X", "; it is not given"),
    ([item(16, frame=6, x=473977420, y=2**31 - 1, z=5.0)], 0, "INVALID_PARAM6_Y", "longitude"),
    ([item(16, frame=6, x=0, y=0, z=5.0)], 0, "INVALID_PARAM5_X", "north of home"),
    ([item(16, frame=6, x=0, y=0, z=5.0)], 0, "INVALID_PARAM5_X", "are 0, so the place may be missing"),
    ([item(178, 7.0, 1.0)], 0, "INVALID_PARAM1", "speed type = 7"),
    ([item(178, 1.0, math.nan)], 0, "INVALID_PARAM2", "speed = nan m/s"),
    ([item(178, 1.0, 0.0)], 0, "INVALID_PARAM2", "speed = 0 m/s"),
    ([item(93, -1.0)], 0, "INVALID_PARAM1", "delay = -1 s"),
    ([item(112, math.inf)], 0, "INVALID_PARAM1", "delay = inf s"),
    ([item(20), RUN], 1, "INVALID", "must follow a term"),
    ([FACTOR, RUN], 0, "INVALID", "must follow a term"),
    ([TERM, FACTOR], 1, "INVALID", "item 0 has no run"),
    ([TERM, item(20), RUN], 0, "INVALID", "item 0 has no run"),
    (
        [TERM._replace(frame=6), RUN],
        0,
        "UNSUPPORTED_FRAME",
        "must be 2 for LOAD_SIGNAL_TERM (31010)",
    ),
    ([TERM._replace(param1=3.0), RUN], 0, "INVALID_PARAM1", "axis = 3"),
    ([TERM._replace(param1=0.5), RUN], 0, "INVALID_PARAM1", "axis = 0.5"),
    ([TERM._replace(param1=math.nan), RUN], 0, "INVALID_PARAM1", "axis = nan"),
    ([TERM._replace(param2=math.nan), RUN], 0, "INVALID_PARAM2", "amplitude = nan m"),
    ([TERM._replace(param3=0.0), RUN], 0, "INVALID_PARAM3", "rise = 0 s"),
    ([TERM._replace(param4=0.0, y=100), RUN], 0, "INVALID_PARAM4", "fall = 0 s"),
    ([TERM._replace(x=-1), RUN], 0, "INVALID_PARAM5_X", "start = -0.001 s"),
    ([TERM._replace(y=-2), RUN], 0, "INVALID_PARAM6_Y", "hold = -0.002 s"),
    ([TERM, FACTOR._replace(x=0), RUN], 1, "INVALID_PARAM5_X", "period = 0 s"),
    ([TERM, FACTOR._replace(param1=math.nan), RUN], 1, "INVALID_PARAM1", "phase = nan rad"),
    ([TERM, RUN._replace(x=0)], 1, "INVALID_PARAM5_X", "duration = 0 s"),
    ([TERM] * (MAX_TERMS + 1) + [RUN], MAX_TERMS, "NO_SPACE", "more than"),
    ([TERM] + [FACTOR] * (MAX_FACTORS + 1) + [RUN], MAX_FACTORS + 1, "NO_SPACE", "more than"),
    ([item(31013, 3.0, 0.1, x=1000)], 0, "INVALID_PARAM1", "mode = 3"),
    ([item(31013, 1.0, 1.6, x=1000)], 0, "INVALID_PARAM2", "tilt north = 1.6 rad"),
    ([item(31013, 1.0, 0.0, math.nan, x=1000)], 0, "INVALID_PARAM3", "tilt east = nan rad"),
    ([item(31013, 1.0, 0.1, x=0)], 0, "INVALID_PARAM5_X", "duration = 0 s"),
    ([POINT], 0, "INVALID", "the first point of a trajectory (31014) must be at 0 s"),
    ([START._replace(param2=1.0), POINT], 0, "INVALID", "must be at 0 s and 0, 0, 0 m"),
    ([START], 0, "INVALID", "a trajectory (31014) needs two points at least"),
    ([START, START, POINT], 0, "INVALID", "a trajectory (31014) needs two points at least"),
    ([START, item(203), POINT], 0, "INVALID", "a trajectory (31014) needs two points at least"),
    ([START, item(115, 90.0), POINT], 0, "INVALID", "a trajectory (31014) needs two points at least"),
    ([START, POINT, POINT._replace(x=1099)], 2, "INVALID_PARAM5_X", "time = 1.099 s; must be 0.1 s"),
    ([START, POINT, POINT._replace(x=900)], 2, "INVALID_PARAM5_X", "time = 0.9 s; must be 0.1 s"),
    ([START, POINT._replace(param3=math.inf)], 1, "INVALID_PARAM3", "down = inf m"),
    ([START, POINT._replace(frame=3)], 1, "UNSUPPORTED_FRAME", "frame"),
    ([TERM, START, POINT, RUN], 0, "INVALID", "has no run (31012) behind it"),
    (
        [START] + [POINT._replace(x=100 * k) for k in range(1, MAX_POINTS + 1)],
        MAX_POINTS,
        "NO_SPACE",
        "more than 1000 points",
    ),
    ([UP, item(211, 1.0, 0.0), START, POINT], 2, "INVALID", "needs the load"),
    ([item(115, math.nan)], 0, "INVALID_PARAM1", "angle = nan deg"),
    ([item(115, 400.0)], 0, "INVALID_PARAM1", "angle = 400 deg"),
    ([item(115, 90.0, 0.0, 2.0)], 0, "INVALID_PARAM3", "sense = 2"),
    ([item(115, 90.0, 0.0, 0.0, 7.0)], 0, "INVALID_PARAM4", "from = 7"),
    ([item(195)], 0, "UNSUPPORTED_FRAME", "frame 2"),
    ([item(195, frame=6)], 0, "INVALID_PARAM5_X", "north of home"),
    ([item(201, 1.0, frame=6)], 0, "INVALID_PARAM1", "mode = 1"),
]


@pytest.mark.parametrize(("items", "seq", "result", "text"), REFUSALS)
def test_what_cannot_be_flown_is_refused(items: list[WireItem], seq: int, result: str, text: str) -> None:
    with pytest.raises(MissionItemError) as refused:
        decode_items(items, HOME)
    assert (refused.value.seq, refused.value.result) == (seq, getattr(mavlink, f"MAV_MISSION_{result}"))
    assert text in refused.value.text
    assert str(refused.value) == f"mission item {seq}: {refused.value.text}"


@pytest.mark.parametrize(
    "step",
    [
        Delay(math.nan),
        Delay(2.0 * LONGEST_S),
        Speed(2.0 * FASTEST_M_S),
        Takeoff(-1.0),
        Waypoint(math.inf, 0.0, 1.0),
        Signals(1e12, (Term("x", 1.0, 0.0, 1.0, None, 0.0),)),
        Signals(math.nan, (Term("x", 1.0, 0.0, 1.0, None, 0.0),)),
        Signals(1.0, (Term("x", 1e300, 0.0, 1.0, None, 0.0),)),
        Signals(1.0, ()),
    ],
)
def test_a_step_that_would_be_refused_is_not_sent(step: Step) -> None:
    with pytest.raises(MissionItemError):
        encode_steps([Takeoff(1.0), step], HOME)


KNOWN = [
    16,
    17,
    18,
    31,
    82,
    177,
    600,
    601,
    186,
    4501,
    19,
    20,
    21,
    22,
    93,
    112,
    178,
    203,
    31010,
    31011,
    31012,
    31013,
]
integers = st.integers(-(2**31), 2**31 - 1)
floats32 = st.floats(width=32)


@given(
    st.lists(
        st.builds(
            WireItem,
            st.integers(0, 25),
            st.sampled_from(KNOWN) | st.integers(0, 65535),
            st.integers(0, 1),
            st.integers(0, 1),
            *[floats32] * 4,
            integers,
            integers,
            floats32,
        ),
        max_size=6,
    )
)
@quick
def test_any_items_are_flown_or_refused(items: list[WireItem]) -> None:
    try:
        steps_of_them = decode_items(items, HOME)
    except MissionItemError as refused:
        assert 0 <= refused.seq < len(items)
        assert refused.result != mavlink.MAV_MISSION_ACCEPTED
    else:
        assert all(math.isfinite(n) for one in steps_of_them for n in numbers(one) if isinstance(n, float))


def test_frames_of_a_place() -> None:
    place = (12.0, -7.0, 5.0)
    latitude, longitude, above_sea_mm = geodetic_from_enu(place, HOME)
    same = [
        item(16, frame=frame, x=latitude, y=longitude, z=height)
        for frame, height in ((0, above_sea_mm / 1e3), (5, above_sea_mm / 1e3), (3, 5.0), (6, 5.0))
    ]
    same.append(item(16, frame=1, x=-70_000, y=120_000, z=-5.0))
    for step in decode_items(same, HOME):
        assert isinstance(step, Waypoint)
        assert (step.east_m, step.north_m, step.altitude_m) == pytest.approx(place, abs=PLACE_M)


def test_the_home_row_of_a_waypoint_file_is_not_flown() -> None:
    latitude, longitude, _ = geodetic_from_enu((0.0, 0.0, 0.0), HOME)
    row = WireItem(0, 16, 1, 1, 0.0, 0.0, 0.0, 0.0, latitude, longitude, HOME.altitude_m)
    for first in (row, row._replace(current=0), row._replace(frame=3, z=0.0), row._replace(frame=6, z=0.0)):
        assert decode_items([first, item(93, 1.0)], HOME) == (Delay(1.0),)
    for height in (0.3, 3.0):
        first = WireItem(6, 16, 1, 1, 0.0, 0.0, 0.0, 0.0, latitude, longitude, height)
        (step,) = decode_items([first], HOME)
        assert isinstance(step, Waypoint)


def test_a_landing_elsewhere_is_a_transfer_first() -> None:
    latitude, longitude, _ = geodetic_from_enu((30.0, 40.0, 0.0), HOME)
    there = item(21, frame=6, x=latitude, y=longitude)
    up, go, down = decode_items([item(22, frame=6, z=4.0), there], HOME)
    assert isinstance(go, Waypoint)
    assert (go.east_m, go.north_m, go.altitude_m) == pytest.approx((30.0, 40.0, 4.0), abs=PLACE_M)
    assert (up, down) == (Takeoff(4.0), Land())
    assert decode_items([item(22, frame=6, z=4.0), item(21, frame=6)], HOME) == (Takeoff(4.0), Land())


def test_places_that_other_items_lead_to_are_known() -> None:
    """Where the load will be: the end of signals, straight above where it is, the home that is set."""
    latitude, longitude, _ = geodetic_from_enu((30.0, 40.0, 0.0), HOME)
    there = {"frame": 6, "x": latitude, "y": longitude}
    up, low = item(22, frame=6, z=4.0), item(186, 2.0, 3.0)
    away = encode_steps([Takeoff(1.0), Signals(5.0, (Term("x", 2.0, 0.0, 4.0, None, 0.0),))], HOME)[1:]
    assert decode_items([up, *away, low], HOME)[-1] == Waypoint(2.0, 0.0, 2.0)
    *_, go, down = decode_items([up, *away, item(21, **there)], HOME)
    assert isinstance(go, Waypoint) and down == Land()
    assert (go.east_m, go.north_m, go.altitude_m) == pytest.approx((30.0, 40.0, 4.0), abs=PLACE_M)
    go, higher, lower = decode_items([item(16, z=4.0, **there), item(22, frame=6, z=9.0), low], HOME)
    assert isinstance(go, Waypoint) and higher == Takeoff(9.0)
    assert lower == Waypoint(go.east_m, go.north_m, 2.0)
    for home, place in (((0.0, 0.0, 0.0), (0.0, 0.0)), ((7.0, -5.0, 0.0), (7.0, -5.0))):
        located = located_steps([up, item(16, z=4.0, **there), item(20), low], HOME, home)
        assert located[-1].step == Waypoint(*place, 2.0)


@pytest.mark.parametrize("unknown", [item(31013, 1.0, 0.1, x=1500), item(211, 1.0, 0.0)])
def test_after_what_leaves_no_known_place_a_height_alone_is_refused(unknown: WireItem) -> None:
    with pytest.raises(MissionItemError, match="nothing before it says where the load hangs"):
        decode_items([item(22, frame=6, z=4.0), unknown, item(186, 2.0, 3.0)], HOME)


def test_commands_for_other_things_are_kept_and_not_flown() -> None:
    assert decode_items([item(command) for command in (1000, 203, 196, 198, 206, 189, 31005)], HOME) == ()


def test_points_in_a_row_are_one_trajectory_and_a_point_at_time_zero_begins_another() -> None:
    kept, heading = item(203), item(115, 90.0, 0.0, 1.0)
    items = [UP, kept, START, POINT, START, POINT, heading, item(93, 1.0), START, POINT, item(177, 7.0, 1.0)]
    located = located_steps(items, HOME)
    through = Trajectory([(0.0, 0.0, 0.0, 0.0), (1.0, 2.0, 1.0, 0.5)])
    assert [(one.first, one.last) for one in located] == [
        *((0, 0), (2, 3), (4, 5), (7, 7), (8, 9)),
        *((7, 7), (8, 9)),  # once more
    ]
    assert [one.step for one in located if isinstance(one.step, Trajectory)] == [through] * 4
    assert [bool(one.aims) for one in located] == [False] * 3 + [True] + [False] * 3


def test_what_is_not_flown_is_known() -> None:
    assert unflown_items([item(93, 1.0), item(203), item(177, 0.0, 1.0), item(206), TERM, RUN]) == (1, 3)


def test_a_jump_without_end_leads_back_from_the_last_step_before_it() -> None:
    items = [item(93, 1.0), item(203), item(93, 2.0), TERM, RUN, item(177, 1.0, -1.0), item(93, 9.0)]
    located = located_steps(items, HOME)
    assert [(one.last, one.then) for one in located] == [(0, None), (2, None), (4, 1), (6, None)]
    assert [one.then for one in located_steps(items[:-2], HOME)] == [None] * 3


@pytest.mark.parametrize(
    "repeated",
    [
        [item(93, 0.0)],
        [item(178, 1.0, 1.0, -1.0)],
        [item(16, frame=6, x=473977420, y=85455940, z=1.5)],
        [item(16, frame=6, x=473977420, y=85455940, z=1.5), item(115, 90.0)],
        [item(22, frame=6, z=1.5)],
        [item(20)],
    ],
)
def test_a_jump_without_end_repeats_what_takes_time(repeated: list[WireItem]) -> None:
    take_off, jump = item(22, frame=6, z=1.5), item(177, 1.0, -1.0)
    with pytest.raises(MissionItemError, match=r"without end repeats must take at least 0\.5 s") as refused:
        located_steps([take_off, *repeated, jump], HOME)
    assert refused.value.seq == 1 + len(repeated)
    waited = located_steps([take_off, *repeated, item(93, 0.5), jump], HOME)
    assert waited[-1].step == Delay(0.5)


def test_items_that_turn_the_nose_belong_to_the_step_behind_them() -> None:
    latitude, longitude, _ = geodetic_from_enu((12.0, -7.0, 0.0), HOME)
    there = item(195, frame=6, x=latitude, y=longitude)
    items = [
        *(item(115, 90.0), item(22, frame=6, z=4.0), item(93, 1.0), there, item(93, 2.0), item(197)),
        *(item(115, 30.0, 20.0, -1.0, 1.0), item(93, 3.0), item(201, 3.0, frame=6, x=latitude, y=longitude)),
        *(item(93, 4.0), item(80)),
    ]
    steps = located_steps(items, HOME)
    assert [one.last for one in steps] == [1, 2, 4, 7, 9, 10]
    assert steps[0].aims == (), "on the ground no nose turns"
    assert steps[1].aims == ((0, TurnHeading(0.0)),), "from north, clockwise: to the east"
    ((by, seen),) = steps[2].aims
    assert by == 3
    assert isinstance(seen, LookAt) and seen.east_m is not None and seen.north_m is not None
    assert (seen.east_m, seen.north_m) == pytest.approx((12.0, -7.0), abs=PLACE_M)
    turned = TurnHeading(math.radians(30.0), relative=True, rate_rad_s=math.radians(20.0))
    assert steps[3].aims == ((5, LookAt(None, None)), (6, turned))
    assert steps[4].aims == ((8, seen),)
    assert (steps[5].step, steps[5].aims) == (Delay(0.0), ((10, LookAt(None, None)),)), "held as it turns"


@pytest.mark.parametrize("last", [item(21), item(20)])
def test_behind_what_lands_the_nose_is_not_turned(last: WireItem) -> None:
    items = [item(22, frame=6, z=4.0), item(115, 90.0), last, item(197)]
    steps = located_steps(items, HOME)
    assert [one.last for one in steps] == [0, 2]
    assert steps[1].aims == ((1, TurnHeading(0.0)),)


def test_jumps_without_end_turn_the_nose_each_time() -> None:
    items = [item(22, frame=6, z=4.0), item(93, 2.0), item(115, 90.0), item(177, 1.0, -1.0)]
    steps = located_steps(items, HOME)
    assert [one.aims for one in steps] == [(), (), ((2, TurnHeading(0.0)),)]
    assert steps[2].then == 1
    assert read_items(items, HOME)[1][-1] == (3, 1, 0), "the jump does not lead to the hold before it"


def test_jumps_fly_their_items_again() -> None:
    items = [item(93, 1.0), item(93, 2.0), item(177, 0.0, 2.0), item(93, 3.0)]
    located = located_steps(items, HOME)
    assert [one.step.duration_s for one in located] == [1.0, 2.0] * 3 + [3.0]  # type: ignore[union-attr]
    assert [one.first for one in located] == [0, 1] * 3 + [3]


def test_jumps_to_a_tag_lead_to_the_item_that_has_it() -> None:
    tag = item(600, 7.0)
    items = [item(93, 1.0), tag, item(93, 2.0), item(601, 7.0, 2.0), item(93, 3.0)]
    by_number = [*items[:3], item(177, 1.0, 2.0), items[4]]
    assert read_items(items, HOME) == read_items(by_number, HOME)
    assert [one.first for one in located_steps(items, HOME)] == [0, 2, 2, 2, 4]
    ahead = [item(93, 1.0), item(601, 7.0, 1.0), item(93, 2.0), tag, item(93, 3.0)]
    assert decode_items(ahead, HOME) == (Delay(1.0), Delay(3.0))
    endless = [item(93, 1.0), tag, item(93, 2.0), item(601, 7.0, -1.0)]
    assert [one.then for one in located_steps(endless, HOME)] == [None, 1]


def test_each_visit_to_an_item_states_what_is_flown_then() -> None:
    items = [item(93, 1.0), item(93, 2.0), item(177, 1.0, 1.0), item(203), item(93, 3.0), item(203)]
    steps, visits = read_items(items, HOME)
    assert [one.last for one in steps] == [0, 1, 1, 4]
    assert visits == ((0, 0, 0), (1, 1, 0), (2, 2, 0), (1, 2, 1), (2, 3, 1), (3, 3, 1), (4, 3, 1), (5, 4, 1))
    endless = [item(93, 1.0), item(93, 2.0), item(177, 1.0, -1.0)]
    assert read_items(endless, HOME)[1] == ((0, 0, 0), (1, 1, 0), (2, 1, 0))
    jump_first = [item(177, 2.0, 1.0), item(93, 1.0), item(93, 2.0)]
    assert read_items(jump_first, HOME)[1] == ((0, 0, 0), (2, 0, 1))
    assert read_items([TERM, RUN], HOME)[1] == ((0, 0, 0), (1, 0, 0))


def test_a_speed_of_minus_two_is_the_usual_one_and_written_as_it_was_read() -> None:
    items = [item(178, 1.0, 2.0, -1.0), item(178, 1.0, -2.0, -1.0)]
    steps = decode_items(items, HOME)
    assert steps == (Speed(2.0), Speed(None))
    assert [one.param2 for one in encode_steps(steps, HOME)] == [2.0, -2.0]


def test_a_mission_of_jumps_in_jumps_is_refused_before_it_is_long() -> None:
    items = [item(93, 1.0), *(item(177, 0.0, 1000.0) for _ in range(50))]
    with pytest.raises(MissionItemError, match="more than 4000 items"):
        located_steps(items, HOME)


@pytest.mark.parametrize("coordinate", [0, NOT_GIVEN])
def test_a_loiter_without_a_place_is_flown_where_the_load_hangs(coordinate: int) -> None:
    here = {"frame": 6, "x": coordinate, "y": coordinate}
    there = item(16, frame=1, x=-70_000, y=120_000, z=-5.0)
    for command, hold_s in ((19, 8.0), (17, LONGEST_S), (31, 0.0)):
        assert decode_items([there, item(command, 8.0, **here)], HOME)[1] == Delay(hold_s)
        moved = decode_items([there, item(command, 8.0, z=9.0, **here)], HOME)[1]
        assert moved == Waypoint(12.0, -7.0, 9.0, hold_s)
    _, held, turns = decode_items([there, item(18, 2.0, 0.0, 3.0, **here)], HOME)
    assert held == Delay(0.0)
    assert isinstance(turns, Signals)


def test_what_is_not_given_is_the_default() -> None:
    items = [UP, item(21, frame=6, x=NOT_GIVEN, y=NOT_GIVEN), item(16, math.nan, frame=1, z=-5.0)]
    assert decode_items(items, HOME) == (Takeoff(5.0), Land(), Waypoint(0.0, 0.0, 5.0))


def test_loitering() -> None:
    place = (12.0, -7.0, 5.0)
    latitude, longitude, _ = geodetic_from_enu(place, HOME)
    there = {"frame": 6, "x": latitude, "y": longitude, "z": 5.0}
    for command, p1, hold in ((17, 0.0, 86400.0), (19, 8.0, 8.0), (31, 0.0, 0.0), (82, 2.0, 2.0)):
        (step,) = decode_items([item(command, p1, **there)], HOME)
        assert isinstance(step, Waypoint)
        assert step.hold_s == hold
        assert (step.east_m, step.north_m, step.altitude_m) == pytest.approx(place, abs=PLACE_M)
    up, higher = decode_items([item(22, frame=6, z=3.0), item(186, 6.0, 3.0)], HOME)
    assert (up, higher) == (Takeoff(3.0), Waypoint(0.0, 0.0, 6.0))


def test_a_gate_is_flown_to() -> None:
    latitude, longitude, _ = geodetic_from_enu((12.0, -7.0, 0.0), HOME)
    there = {"frame": 3, "x": latitude, "y": longitude}
    up = item(22, frame=6, z=3.0)
    for own, z, height in ((1.0, 5.0, 5.0), (0.0, 0.0, 3.0)):
        step = decode_items([up, item(4501, 0.0, own, z=z, **there)], HOME)[1]
        assert isinstance(step, Waypoint)
        assert (step.east_m, step.north_m, step.altitude_m) == pytest.approx(
            (12.0, -7.0, height), abs=PLACE_M
        )
    with pytest.raises(MissionItemError, match="a gate without a height"):
        decode_items([item(4501, 0.0, 0.0, **there)], HOME)


@pytest.mark.parametrize("radius", [2.0, -2.0])
def test_turns_are_flown_round_their_centre(radius: float) -> None:
    latitude, longitude, _ = geodetic_from_enu((12.0, -7.0, 0.0), HOME)
    turns = WireItem(6, 18, 0, 1, 2.0, 0.0, radius, 0.0, latitude, longitude, 5.0)
    centre, circle = decode_items([item(178, 1.0, 1.0), turns], HOME)[1:]
    assert isinstance(centre, Waypoint)
    assert isinstance(circle, Signals)
    period = 2.0 * math.pi * 2.0 / 1.0
    for share in (1.2, 1.9, 2.7):
        jet = _jet(circle, share * period)
        assert math.hypot(jet[0][0], jet[0][1]) == pytest.approx(2.0, abs=1e-6)
        assert norm(jet[1]) == pytest.approx(1.0, abs=1e-6)
        turning = jet[0][0] * jet[1][1] - jet[0][1] * jet[1][0]
        assert (turning < 0.0) == (radius > 0.0)  # positive: clockwise seen from above
    assert norm(_jet(circle, circle.duration_s)[0]) < 1e-9


def test_speeds_that_change_nothing_here() -> None:
    items = [item(178, 1.0, -1.0), item(178, 2.0, 5.0), item(178, 0.0, 2.0)]
    assert decode_items(items, HOME) == (Speed(2.0),)


def test_float32_rounding_of_an_item_is_done_before_it_is_sent() -> None:
    (delay,) = encode_steps([Delay(0.1)], HOME)
    assert delay.param1 == struct.unpack("<f", struct.pack("<f", 0.1))[0]
