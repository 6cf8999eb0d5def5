"""Whatever arrives: no exception, and only a valid message changes anything."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from autopilot.services.records import (
    AreasChanged,
    MissionChanged,
    ParameterChanged,
    SigningChanged,
    Verdict,
)
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.fence import read_fence, read_rally
from autopilot.wire.items import MissionItemError, WireItem, encode_steps, located_steps
from autopilot.wire.parameter_table import ParameterError, decimal_from_float32
from autopilot.wire.signing import MAX_TIMESTAMP, Signing
from missions.model import Takeoff, Waypoint

from .conftest import STREAMED

FEW = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])

_INTEGER = {
    "uint8_t": (0, 2**8 - 1),
    "uint16_t": (0, 2**16 - 1),
    "uint32_t": (0, 2**32 - 1),
    "uint64_t": (0, 2**64 - 1),
    "int8_t": (-(2**7), 2**7 - 1),
    "int16_t": (-(2**15), 2**15 - 1),
    "int32_t": (-(2**31), 2**31 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "uint8_t_mavlink_version": (0, 255),
}
_ADDRESS = {"target_system": (0, 1, 2), "target_component": (0, 1, 169), "mission_type": (0, 0, 0, 1, 255)}
_NAMES = (b"LOAD_MASS", b"CTRL_RATE_HZ", b"MIS_TAKEOFF_ALT")
# messages that the vehicle handles, and a few that it does not
HANDLED = [
    11, 4, 20, 21, 23, 37, 38, 39, 40, 41, 43, 44, 45, 47, 48, 51, 66, 73, 75, 76, 110, 111, 117, 119, 121,
    122, 256, 0, 84, 253, 69, 70, 82, 86, 144,
]  # fmt: skip


def values(name: str, kind: str, count: int) -> st.SearchStrategy[Any]:
    if name in _ADDRESS:
        return st.sampled_from(_ADDRESS[name])
    if kind == "char":
        return st.sampled_from(_NAMES) | st.binary(max_size=count)
    if kind in ("float", "double"):
        one: st.SearchStrategy[Any] = st.floats(width=32) | st.integers(-2, 600).map(float)
    else:
        low, high = _INTEGER[kind]
        one = st.integers(low, high) | st.integers(0, min(high, 5))
    return st.lists(one, min_size=count, max_size=count) if count else one


def messages(message_id: int) -> st.SearchStrategy[Any]:
    kind = m.mavlink_map[message_id]
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    fields = [
        values(name, type_, lengths[name])
        for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    ]
    return st.tuples(*fields).map(lambda args: kind(*args))


ANY_MESSAGE = st.sampled_from(HANDLED).flatmap(messages)
STEP = st.tuples(st.sampled_from(["gcs", "api", "new"]), st.sampled_from([0, 4000, 600_000]), ANY_MESSAGE)


def state(rig: Any) -> Any:
    return rig.endpoint.mission, rig.table.values()


def replay(rig: Any) -> Any:
    """Mission and parameters according to the events."""
    mission, parameters = None, {}
    for event in rig.events:
        match event:
            case MissionChanged(accepted):
                mission = accepted
            case ParameterChanged(name, value):
                parameters[name] = value
    return mission, parameters


@FEW
@given(steps=st.lists(STEP, max_size=25), result=st.sampled_from([0, 1, 2, 3, 4, 5]))
def test_any_messages_in_any_order(rig_with, items, steps, result):
    rig = rig_with(items(3), setup_signing=True)
    rig.verdict = lambda request: Verdict(result, "because")
    mission, parameters = state(rig)
    for link, pause_us, message in steps:
        rig.send(message, link=link)
        rig.now_us += pause_us
        rig.poll()
    changed_mission, changed_parameters = replay(rig)
    assert rig.endpoint.mission == (changed_mission or mission)
    assert repr(rig.table.values()) == repr(parameters | changed_parameters)


@FEW
@given(
    whole=st.lists(ANY_MESSAGE, min_size=1, max_size=4),
    cuts=st.lists(st.tuples(st.integers(0, 2000), st.integers(1, 255)), min_size=1, max_size=8),
    end=st.integers(0, 2000),
)
def test_mutated_datagrams_count_only_where_they_are_still_valid(rig_with, items, whole, cuts, end):
    rig = rig_with(items(3), setup_signing=True)
    writer = FrameWriter(255, 190)
    datagram = bytearray(b"".join(writer.frame(message) for message in whole))
    for place, flip in cuts:
        datagram[place % len(datagram)] ^= flip
    mutated = bytes(datagram[: end % len(datagram) + 1])
    before = state(rig)
    rig.send_bytes(mutated)
    rig.poll()
    if not decode(mutated)[0]:
        assert state(rig) == before
        assert rig.asked == []


@FEW
@given(st.binary(max_size=600))
def test_any_bytes(rig_with, items, datagram):
    rig = rig_with(items(3), setup_signing=True)
    before = state(rig)
    rig.send_bytes(datagram, link="noise")
    rig.poll()
    assert state(rig) == before


def test_all_that_is_handled_is_tried(rig):
    assert set(rig.endpoint.handlers) <= set(HANDLED)


# ---- a model of what may change, and by what

PEERS = (("gcs", 255, 190), ("api", 245, 190), ("api", 255, 0))
HOME = Home()
READERS = {0: located_steps, 1: read_fence, 2: read_rally}
WAYPOINTS = encode_steps((Takeoff(2.0), Waypoint(1.0, 2.0, 2.0), Waypoint(0.0, 1.0, 3.0)), HOME)
CIRCLE = WireItem(
    3, m.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, 0, 1, 20.0, 0.0, 0.0, 0.0, 473977420, 85455940, 0.0
)
RALLY = CIRCLE._replace(command=m.MAV_CMD_NAV_RALLY_POINT, param1=0.0)
ODD = WireItem(77, 16, 0, 1, 0.0, 0.0, 0.0, 0.0, 0, 0, 0.0)
ITEMS = {0: (*WAYPOINTS, ODD), 1: (CIRCLE, ODD), 2: (RALLY, ODD)}
KINDS = st.sampled_from([0, 0, 1, 2])


def item_of(kind: int, seq: int, which: int) -> Any:
    item = ITEMS[kind][which % len(ITEMS[kind])]
    return m.MAVLink_mission_item_int_message(
        target_system=1, target_component=1, seq=seq, mission_type=kind, **item._asdict()
    )


# sensible messages in any order: uploads succeed, and are disturbed
SENSIBLE = (
    st.builds(m.MAVLink_mission_count_message, st.just(1), st.just(1), st.integers(0, 3), KINDS)
    | st.builds(item_of, KINDS, st.integers(0, 2), st.integers(0, 3))
    | st.builds(m.MAVLink_mission_ack_message, st.just(1), st.just(1), st.just(0), KINDS)
    | st.builds(m.MAVLink_mission_clear_all_message, st.just(1), st.just(1), st.sampled_from([0, 1, 2, 255]))
    | st.builds(
        m.MAVLink_param_set_message,
        st.just(1),
        st.sampled_from([0, 1]),
        st.sampled_from([b"LOAD_MASS", b"MIS_TAKEOFF_ALT", b"SIXTEEN_LETTERS1", b"NO_SUCH"]),
        st.sampled_from([0.5, 1.5, -1.0, 1e9, math.nan, math.inf]),
        st.sampled_from([9, 9, 9, 6]),
    )
    | st.builds(
        lambda choice: m.MAVLink_command_long_message(1, 1, 245, 0, choice, 0, 0, 0, 0, 0, 0),
        st.sampled_from([0.0, 1.0, 2.0]),
    )
)


def upload(
    owner: Any, other: Any, kind: int, whole: list[int], odd_kind: int, disturbances: list[tuple[int, Any]]
) -> list[tuple[Any, Any]]:
    """An upload of one peer; between its items, another peer sends its own item for the same place, and the
    uploading peer an item of another kind."""
    said = [(owner, m.MAVLink_mission_count_message(1, 1, len(whole), kind))]
    said += [(owner, item_of(kind, seq, which)) for seq, which in enumerate(whole)]
    for at, which in disturbances:
        seq = min(at, len(whole) - 1)
        said.insert(1 + seq, (other, item_of(kind, seq, which)))
        said.insert(1 + seq, (owner, item_of(odd_kind, seq, which)))
    return said


PEER = st.sampled_from(PEERS)
UPLOAD = st.builds(
    upload,
    PEER,
    PEER,
    KINDS,
    st.lists(st.integers(0, 3), min_size=1, max_size=3),
    KINDS,
    st.lists(st.tuples(st.integers(0, 2), st.integers(0, 3)), max_size=2),
)
TURN = UPLOAD | st.lists(st.tuples(PEER, SENSIBLE | ANY_MESSAGE), min_size=1, max_size=3)


@dataclass
class Model:
    """Mission, fence, rally points and parameters as they follow from the rules of the manual alone."""

    table: Any
    accepts: bool
    plans: dict[int, tuple[WireItem, ...]]
    values: dict[str, float]
    upload: tuple[Any, int, int] | None = None  # peer, kind, count
    items: list[WireItem] = field(default_factory=list)
    deaf: bool = False  # only signed messages are heard

    def hear(self, x: Any, peer: Any) -> None:
        if self.deaf or x.target_system not in (0, 1) or x.target_component not in (0, 1):
            return
        name = x.get_type()
        kind = getattr(x, "mission_type", 0)
        mine = self.upload is not None and self.upload[0] == peer
        if name == "MISSION_COUNT" and kind in READERS and (mine or self.upload is None):
            self.upload = None
            if x.count > 2000 or (kind == 0 and not self.accepts):
                return
            if x.count == 0:
                self.plans[kind] = ()
            else:
                self.upload, self.items = (peer, kind, x.count), []
        elif name in ("MISSION_ITEM", "MISSION_ITEM_INT") and mine and kind == self.upload[1]:
            if x.seq == len(self.items):
                self.take(x, name == "MISSION_ITEM")
        elif name == "MISSION_ACK" and mine and kind == self.upload[1]:
            self.upload = None
        elif name == "MISSION_CLEAR_ALL" and (mine or self.upload is None):
            if kind not in (0, 1, 2, 255) or (kind in (0, 255) and not self.accepts):
                return
            cleared = (0, 1, 2) if kind == 255 else (kind,)
            self.plans |= dict.fromkeys(cleared, ())
            if self.upload and self.upload[1] in cleared:
                self.upload = None
        elif name == "PARAM_SET" and x.param_type == m.MAV_PARAM_TYPE_REAL32 and x.param_id in self.values:
            try:
                known = self.table.describe(x.param_id)
                self.values[x.param_id] = known.checked(decimal_from_float32(x.param_value))
            except ParameterError:
                pass
        elif name in ("COMMAND_LONG", "COMMAND_INT") and x.command == 245 and x.param1 == 2.0:
            if self.accepts:
                self.values = {name: self.table.describe(name).default for name in self.values}
        elif name == "SETUP_SIGNING" and self.accepts:
            self.deaf = any(x.secret_key)

    def take(self, x: Any, as_float: bool) -> None:
        assert self.upload is not None
        _, kind, count = self.upload
        item = WireItem(**{name: getattr(x, name) for name in WireItem._fields})
        if as_float:
            factor = 1.0 if x.frame == 2 else 1e4 if x.frame in (1, 4, 7) else 1e7
            scaled = [2**31 - 1 if math.isnan(value) else value * factor for value in (x.x, x.y)]
            if any(abs(value) > 2**31 - 1 for value in scaled):
                self.upload = None
                return
            item = item._replace(x=round(scaled[0]), y=round(scaled[1]))
        self.items.append(item)
        if len(self.items) < count:
            return
        self.upload = None
        try:
            READERS[kind](tuple(self.items), HOME)
        except MissionItemError:
            return
        if kind != 0 or self.accepts:
            self.plans[kind] = tuple(self.items)


@settings(FEW, max_examples=250)
@given(turns=st.lists(TURN, max_size=14), result=st.sampled_from([0, 0, 0, 1, 2, 5]))
def test_what_changes_is_what_a_model_says(rig_with, items, turns, result):
    rig = rig_with(items(3), setup_signing=True)
    rig.verdict = lambda request: Verdict(result, "because")
    plans = {0: rig.endpoint.mission.items} | rig.endpoint.areas
    initial = rig.table.values()
    model = Model(rig.table, result == 0, plans | {}, rig.table.values())
    for turn in turns:
        for peer, message in turn:
            link, system, component = peer
            rig.send(message, link=link, system=system, component=component)
            (received,) = decode(rig.writers[system, component].frame(message))[0]
            if hasattr(received.message, "target_system") and hasattr(received.message, "target_component"):
                model.hear(received.message, peer)
            rig.poll()
            assert repr({0: rig.endpoint.mission.items} | rig.endpoint.areas) == repr(model.plans)
            assert repr(rig.table.values()) == repr(model.values)
    # what is stored is what is in force
    stored, values = plans | {}, {}
    for event in rig.events:
        match event:
            case MissionChanged(mission):
                stored[0] = mission.items
            case AreasChanged(kind, area):
                stored[kind] = area
            case ParameterChanged(name, value):
                values[name] = value
    assert repr(stored) == repr(model.plans)
    assert repr(initial | values) == repr(model.values)


@FEW
@given(
    steps=st.lists(st.tuples(PEER, ANY_MESSAGE | SENSIBLE), max_size=20),
    key=st.sampled_from([None, bytes(range(1, 33))]),
)
def test_with_a_key_no_service_hears_what_is_not_signed_with_it(rig_with, items, steps, key):
    """Unsigned or signed with another key: no answer, no request, no change, a link only by a HEARTBEAT."""
    rig = rig_with(items(3), setup_signing=True)
    rig.send(m.MAVLink_setup_signing_message(1, 1, bytes(range(32)), 0))
    rig.poll()
    rig.asked.clear()
    rig.events.clear()
    before = state(rig)
    sign = None if key is None else Signing(key, MAX_TIMESTAMP).signer(1)
    for (link, system, component), message in steps:
        rig.send_bytes(FrameWriter(system, component).frame(message, sign), link)
        said = [r.message.get_type() for r in rig.poll().get("gcs", [])]
        assert set(said) <= {*STREAMED, "SYSTEM_TIME", "STATUSTEXT", "EKF_STATUS_REPORT", "VIBRATION"}
    assert rig.asked == [] and state(rig) == before
    assert not [event for event in rig.events if not isinstance(event, SigningChanged)]
    assert "api" not in rig.endpoint.links or any(x.get_type() == "HEARTBEAT" for _, x in steps)
