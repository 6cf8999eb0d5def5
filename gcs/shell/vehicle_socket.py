"""The socket for one vehicle: other vehicles that send to it are not mistaken for this one."""

from __future__ import annotations

from collections.abc import Callable

from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.connection import is_vehicle
from gcs.clients.datagrams import messages
from gcs.shell.display import notify
from gcs.shell.link import Address, monotonic_us, open_address

REPLACEMENT_US = (
    2_000_000  # after this silence another vehicle that sends is assumed to be this one, started again
)

Sender = tuple[str, int]


class VehicleSocket:
    """Receives from the vehicle that the address names, else from the one whose heartbeat arrives first, and
    from senders that are no vehicles; sends to the vehicle."""

    def __init__(self, address: Address, note: Callable[[str], None] = notify) -> None:
        self._address = address
        self._note = note  # called with a line about each vehicle that is ignored
        self._socket = open_address(address)
        self._vehicle: Sender | None = None
        self._system: int | None = None  # id of the vehicle
        self._last_received_us = 0
        self._autopilots: dict[Sender, int] = {}  # senders before there was a vehicle, with their system ids
        self._others: dict[Sender, int] = {}  # vehicles that are ignored, with their system ids
        self._other_heard_us: dict[Sender, int] = {}  # when each of them was heard last
        self._reported: set[Sender] = set()

    def fileno(self) -> int:
        return self._socket.fileno()

    @property
    def has_datagram(self) -> bool:
        """Whether a datagram has arrived and was not read yet."""
        return self._socket.has_datagram

    @property
    def other_systems(self) -> list[int]:
        """System ids of the vehicles that are ignored, in order."""
        return sorted(set(self._others.values()))

    @property
    def twin_problem(self) -> str:
        """That another vehicle with the same system id is sending too, and what to do; empty if none is."""
        now_us = monotonic_us()
        for sender, system in self._others.items():
            is_sending = now_us - self._other_heard_us[sender] < REPLACEMENT_US
            if self._vehicle is not None and system == self._system and is_sending:
                first, second = (f"{host}:{port}" for host, port in (self._vehicle, sender))
                return (
                    f"two vehicles with system id {system} speak on {self._address.link}, from {first} and "
                    f"{second}, and only one of them would hear this: stop one, or give one another port "
                    "(autopilot --gcs) or id (MAV_SYS_ID)"
                )
        return ""

    def send(self, datagram: bytes) -> None:
        """Send to the vehicle; before there is one, to the last sender."""
        self._socket.send(datagram)

    def drain(self) -> list[bytes]:
        """All datagrams that have arrived from the accepted senders, without waiting."""
        now_us = monotonic_us()
        received = self._socket.drain_with_senders()
        return [datagram for datagram, sender in received if self._accepts(datagram, sender, now_us)]

    def _accepts(self, datagram: bytes, sender: Sender, now_us: int) -> bool:
        if sender == self._vehicle:
            self._last_received_us = now_us
            self._report_others()
            return True
        system, autopilot = _system_ids(datagram)
        if self._address.system is not None and autopilot not in (None, self._address.system):
            self._note_other(sender, autopilot, now_us)
            return False
        if self._vehicle is not None and now_us - self._last_received_us < REPLACEMENT_US:
            if autopilot is not None:
                self._note_other(sender, autopilot, now_us)
            return sender not in self._others
        if self._vehicle is None and autopilot is not None:
            self._autopilots[sender] = autopilot
            self._other_heard_us[sender] = now_us
        if system is not None:
            self._vehicle, self._system, self._last_received_us = sender, system, now_us
            self._others |= self._autopilots
            self._autopilots.clear()
            self._others.pop(sender, None)
        if system is not None or self._vehicle is None:
            self._socket.set_peer(sender)
        return True

    def _note_other(self, sender: Sender, system: int, now_us: int) -> None:
        self._others[sender] = system
        self._other_heard_us[sender] = now_us

    def _report_others(self) -> None:
        """Say once for each that it is another vehicle, now that the first one is still sending."""
        if self._address.system is not None:  # they are ignored on purpose
            return
        for sender, system in self._others.items():
            if sender not in self._reported:
                self._reported.add(sender)
                other, ours = (f"{host}:{port}" for host, port in (sender, self._vehicle or sender))
                is_twin = system == self._system
                choice = "give one another id (MAV_SYS_ID)" if is_twin else "choose with --sysid"
                self._note(
                    f"another vehicle (system {system}) speaks on {self._address.link} from {other} and is "
                    f"not heard, nor does it hear what is said to {ours}; {choice}, or give each "
                    "a port of its own: autopilot --gcs"
                )

    def close(self) -> None:
        self._socket.close()


def _system_ids(datagram: bytes) -> tuple[int | None, int | None]:
    """System ids: of the vehicle whose heartbeat the datagram contains, and of the autopilot that sent any
    message in it."""
    vehicle = autopilot = None
    for one in messages(datagram)[0]:
        if one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT and is_vehicle(one.message):
            vehicle = autopilot = one.system
        elif one.component == mavlink.MAV_COMP_ID_AUTOPILOT1 and one.id != mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            autopilot = one.system
    return vehicle, autopilot
