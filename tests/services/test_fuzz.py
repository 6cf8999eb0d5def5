"""Whatever arrives: no exception, and nothing changes but by a valid message."""

from __future__ import annotations

from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from autopilot.services.records import MissionChanged, ParameterChanged, Verdict
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as m

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
# those that the vehicle handles, besides a few that it does not
HANDLED = [
    11, 4, 20, 21, 23, 37, 38, 39, 40, 41, 43, 44, 45, 47, 51, 66, 73, 75, 76, 110, 111, 117, 119, 121, 122,
    256, 0, 84, 253,
    69, 82, 86,
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
    """What the events say that mission and parameters are."""
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
    rig = rig_with(items(3))
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
    rig = rig_with(items(3))
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
    rig = rig_with(items(3))
    before = state(rig)
    rig.send_bytes(datagram, link="noise")
    rig.poll()
    assert state(rig) == before
