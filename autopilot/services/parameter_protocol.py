"""The parameter protocol: list, read and set of a `ParameterTable`. Every value is a float32; with the
corresponding identity, whole numbers are an INT32.

Lists are sent at a steady pace on each link; a client that misses an index requests it again. A set is
answered with the value that is actually stored, to every link if the value has changed, so that no ground
station shows an old value. The set of a simulator's parameter is answered when the simulator has reported the
value in force, since only the simulator knows the range; its refusal is handed on to the client.

If values are transferred by their bits, as by PX4, a list begins with PX4's `_HASH_CHECK`: a ground station
that has stored parameters with this hash sends it back, and the list ends there.
"""

from __future__ import annotations

import struct
from typing import Any

from autopilot.services.file_tree import checksum
from autopilot.services.identity import ALL_REAL, ParameterEncoding
from autopilot.services.records import (
    Decide,
    Link,
    Output,
    ParameterChanged,
    Peer,
    Send,
    SendText,
    SimulatorParameterRequested,
    SimulatorParametersSaved,
)
from autopilot.services.requests import ChangeVehicle
from autopilot.services.streams import NEVER_US
from autopilot.wire.codec import Layout
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.parameter_encoding import decode_parameter_value, encode_parameter_value
from autopilot.wire.parameter_table import ParameterError, ParameterTable, float32

_BY_NAME = -1  # PARAM_REQUEST_READ.param_index: the name counts
LIST_INTERVAL_US = 2000  # between two values of a list: 500 a second
LIST_BURST = 8  # values at once, if ticks are longer than that

# MAV_PARAM_ERROR; the last is newer than the dialect's copy of the enum
DOES_NOT_EXIST = mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
OUT_OF_RANGE = mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
COMPONENT_NOT_FOUND = mavlink.MAV_PARAM_ERROR_COMPONENT_NOT_FOUND
READ_ONLY = mavlink.MAV_PARAM_ERROR_READ_ONLY
TYPE_MISMATCH = 7
HASH_NAME = "_HASH_CHECK"
_HASH_INDEX = -1  # in a list, before the first value
_NO_INDEX = 0xFFFF  # PARAM_VALUE.param_index
_FLOAT32, _INT32 = struct.Struct("<f"), struct.Struct("<i")
_TYPE_NAMES = {mavlink.MAV_PARAM_TYPE_REAL32: "REAL32", mavlink.MAV_PARAM_TYPE_INT32: "INT32"}


class _HashValue(mavlink.MAVLink_param_value_message):
    """PARAM_VALUE with a UINT32 in the field of the float; as a float, some values would lose their bits."""

    unpacker = struct.Struct("<IHH16sB")


_HASH_VALUE = Layout(_HashValue)


class ParameterService:
    """Serves one table to any number of links."""

    def __init__(self, table: ParameterTable, encoding: ParameterEncoding = ALL_REAL) -> None:
        self.table = table
        self.simulator_silent = False  # the simulator is silent, so that its parameters cannot be set
        self._encoding = encoding
        self._lists: dict[Link, tuple[int, int]] = {}  # next index, and its time
        self._is_complete = True  # no more parameters will be learned
        self._hash: tuple[int, int] = (-1, 0)  # version of the table, and its hash

    def receive_request_list(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Begin the list for this link; if one is under way, begin it again without the hash."""
        self._lists[peer.link] = (0 if peer.link in self._lists else self._first_index, now_us)
        return []

    def receive_request_read(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """One value, by index or by name."""
        index, names = message.param_index, self.table.names
        if index == _BY_NAME:
            if message.param_id == HASH_NAME and self._encoding.bytewise:
                return [Send(peer.link, self._hash_message())]
            if message.param_id in self.table:
                return [Send(peer.link, self.value_message(message.param_id))]
        elif 0 <= index < len(names):
            return [Send(peer.link, self.value_message(names[index]))]
        return [no_such_parameter(message.param_id, index, peer)]

    def receive_set(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """Store a value, or report why not; in both cases the answer is the value in force."""
        name = message.param_id
        if name == HASH_NAME and self._encoding.bytewise:  # the ground station already has our parameters
            self._lists.pop(peer.link, None)
            return []
        if name not in self.table:
            return [no_such_parameter(name, _BY_NAME, peer)]
        wire_type = self._wire_value(name)[1]
        if message.param_type not in (wire_type, mavlink.MAV_PARAM_TYPE_REAL32):
            why = f"{name}: type {message.param_type} was sent; it is {_TYPE_NAMES[wire_type]} ({wire_type})"
            return self._refused(name, TYPE_MISMATCH, why, peer)
        before = self.table[name]
        value = decode_parameter_value(message.param_value, message.param_type)
        try:
            self.table.describe(name).checked(value)
        except ParameterError as error:
            why = str(error)
            if name in self.table.remote_names:
                kind = "a whole number" if self.table.describe(name).integer else "a number"
                why = f"{name} = {value:g}; must be {kind} in its range, which the simulator knows"
            return self._refused(name, OUT_OF_RANGE, why, peer)
        if name in self.table.remote_names:
            if self.simulator_silent:
                return self._refused(
                    name, COMPONENT_NOT_FOUND, f"{name} not set: the simulator is silent", peer
                )
            return [SimulatorParameterRequested(name, value, peer)]
        if self.table.describe(name).disarmed and value != before:
            verdict = decide(ChangeVehicle(name))
            if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
                return self._refused(name, READ_ONLY, verdict.text or f"{name} not set", peer)
        try:
            after = self.table.set(name, value)
        except ParameterError as error:  # in range, but fixed while running
            return self._refused(name, READ_ONLY, str(error), peer)
        if after == before:
            return [Send(peer.link, self.value_message(name))]
        return [Send(None, self.value_message(name)), ParameterChanged(name, after)]

    def reset(self) -> list[Output]:
        """Reset every parameter to its default, except those that are fixed while running."""
        outputs: list[Output] = []
        count = unchangeable = 0
        for name, value in self.table.changed().items():
            default = self.table.describe(name).default
            if name in self.table.remote_names:
                outputs.append(SimulatorParameterRequested(name, default))
                count += 1
                continue
            try:
                self.table.set(name, default)
            except ParameterError:
                unchangeable += 1
                continue
            if self.table[name] != value:
                outputs += [Send(None, self.value_message(name)), ParameterChanged(name, default)]
                count += 1
        text = f"{count} parameters are at their default again"
        if unchangeable:
            text += f"; {unchangeable} are fixed while running"
        return [*outputs, SendText(mavlink.MAV_SEVERITY_NOTICE, text)]

    def failure_problem(self, name: str) -> str:
        """Why this parameter of the simulator cannot make anything fail; empty if it can."""
        if name not in self.table.remote_names:
            return f"the simulator has told of no {name}"
        return "the simulator is silent" if self.simulator_silent else ""

    def inject_failure(self, name: str, bits: int, fail: bool) -> SimulatorParameterRequested:
        """Make the parts behind these bits of a simulator's parameter fail or work.

        The value is in our table immediately, so that commands in quick succession add up.
        """
        before = int(self.table[name])
        return SimulatorParameterRequested(
            name, self.table.set(name, before | bits if fail else before & ~bits)
        )

    def simulator_values(self) -> SimulatorParametersSaved:
        """The present values of the simulator's parameters."""
        return SimulatorParametersSaved({name: self.table[name] for name in sorted(self.table.remote_names)})

    def value_message(self, name: str) -> Any:
        """PARAM_VALUE of the value in force."""
        table = self.table
        return mavlink.MAVLink_param_value_message(
            name.encode(), *self._wire_value(name), len(table.names), table.index(name)
        )

    @property
    def _first_index(self) -> int:
        """The index with which a list begins."""
        return _HASH_INDEX if self._encoding.bytewise else 0

    def _hash_message(self) -> Any:
        """PARAM_VALUE of PX4's hash over names and values in the order of the names."""
        table = self.table
        if self._hash[0] != table.version:
            parts = []
            for name in table.names:
                is_integer = self._encoding.integers and table.describe(name).integer
                value = _INT32.pack(round(table[name])) if is_integer else _FLOAT32.pack(float32(table[name]))
                parts.append(name.encode() + value)
            self._hash = (table.version, checksum(b"".join(parts)))
        values = (self._hash[1], len(table), _NO_INDEX, HASH_NAME.encode(), mavlink.MAV_PARAM_TYPE_UINT32)
        return (_HASH_VALUE, values)

    def _wire_value(self, name: str) -> tuple[float, int]:
        is_integer = self._encoding.integers and self.table.describe(name).integer
        return encode_parameter_value(self.table[name], is_integer, self._encoding.bytewise)

    def expect_more(self) -> None:
        """More parameters will be learned soon: lists wait."""
        self._is_complete = False

    def complete(self, now_us: int) -> None:
        """The table is complete: requested lists begin."""
        self._is_complete = True
        self._lists = dict.fromkeys(self._lists, (self._first_index, now_us))

    def next_timer(self) -> int:
        """Time at which `poll` has something to send, in us."""
        if not self._is_complete:
            return NEVER_US
        return min((at_us for _, at_us in self._lists.values()), default=NEVER_US)

    def poll(self, now_us: int) -> list[Output]:
        """The values that are due of the lists under way."""
        outputs: list[Output] = []
        if not self._is_complete:
            return outputs
        names = self.table.names
        for link, (index, at_us) in list(self._lists.items()):
            if at_us > now_us:
                continue
            count = min((now_us - at_us) // LIST_INTERVAL_US + 1, LIST_BURST)
            if index == _HASH_INDEX:
                outputs.append(Send(link, self._hash_message()))
            sent = names[max(index, 0) : index + count]
            outputs += [Send(link, self.value_message(name)) for name in sent]
            self._lists[link] = (index + count, at_us + count * LIST_INTERVAL_US)
            if index + count >= len(names):
                del self._lists[link]
        return outputs

    def forget(self, link: Link) -> None:
        """Stop the list for a link that no longer exists."""
        self._lists.pop(link, None)

    def refusal_of_simulator(self, name: str, error: int, peer: Peer) -> Output:
        """PARAM_ERROR for a parameter whose value the simulator has refused; its text is the simulator's."""
        return _error(name, self.table.index(name), error, peer)

    def _refused(self, name: str, error: int, why: str, peer: Peer) -> list[Output]:
        return [
            SendText(mavlink.MAV_SEVERITY_WARNING, why),
            _error(name, self.table.index(name), error, peer),
            Send(peer.link, self.value_message(name)),
        ]


def no_such_parameter(name: str, index: int, peer: Peer) -> Output:
    """PARAM_ERROR for a parameter that the addressed component does not have."""
    return _error(name, index, DOES_NOT_EXIST, peer)


def _error(name: str, index: int, error: int, peer: Peer) -> Output:
    message = mavlink.MAVLink_param_error_message(
        peer.system, peer.component, name.encode("ascii", errors="replace"), index, error
    )
    return Send(peer.link, message, peer.addressed)
