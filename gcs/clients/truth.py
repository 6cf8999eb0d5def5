"""Which truth belongs to the vehicle: of several simulators that send to one port, only its own is accepted.

A simulator identifies its run of the world by SIM_BOOT. It sends it to the autopilot, which reports it on
request, and together with the truth. Several simulators may send to one port; they are distinguished by the
address of the sender.
"""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.wire.codec import FieldReader
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.datagrams import messages

Sender = tuple[str, int]

_SIM_BOOT = mavlink.MAVLINK_MSG_ID_SIM_BOOT
_RUN = FieldReader(mavlink.MAVLink_sim_boot_message, "boot_id")
_OTHER = "--truth PORT names the port to which the vehicle's simulator sends it (sitl --truth HOST:PORT)"


class TruthSources:
    """The simulators that send their truth to one port."""

    def __init__(self) -> None:
        self._runs: dict[Sender, int | None] = {}

    def __len__(self) -> int:
        return len(self._runs)

    def run(self, datagram: bytes, sender: Sender) -> int | None:
        """The run of the world that a datagram belongs to; None: its sender has not identified it."""
        run_ids = [_RUN.read(one.frame) for one in messages(datagram)[0] if one.id == _SIM_BOOT]
        self._runs[sender] = int(run_ids[-1]) if run_ids else self._runs.get(sender)
        return self._runs[sender]


class TruthFilter:
    """Passes on the truth of the world that the vehicle flies in, and drops all other truth.

    `port_is_given`: the user has named the port to which the vehicle's simulator sends. A vehicle that cannot
    report its world is then assumed to fly in the one whose simulator sends there, if only one does.
    """

    def __init__(self, where: str, port_is_given: bool) -> None:
        self._address = where
        self._port_is_given = port_is_given
        self._sources = TruthSources()
        self._run: int | None = None  # of the vehicle
        self._silence_reason = ""  # why the vehicle did not answer
        self.received = False  # truth of the vehicle's world was received

    def set_vehicle_run(self, run: int | None, silence_reason: str = "") -> None:
        """Set the run of the world that the vehicle reports; None: it does not report one, or it has not
        answered and `silence_reason` says why."""
        self._run, self._silence_reason = run, silence_reason

    def select(self, datagrams: Iterable[tuple[bytes, Sender]]) -> list[bytes]:
        """Of datagrams with their senders, those of the vehicle's world."""
        selected = []
        for datagram, sender in datagrams:
            run = self._sources.run(datagram, sender)
            is_assumed = self._run is None and self._port_is_given and len(self._sources) == 1
            if is_assumed or (run is not None and run == self._run):
                selected.append(datagram)
        self.received = self.received or bool(selected)
        return selected

    @property
    def missing(self) -> str:
        """Why there is no truth of the vehicle's world, and what to do; empty if there is."""
        where = f"UDP {self._address}"
        if self.received:
            return ""
        if not self._sources and self._run is not None:
            return (
                f"nothing comes at {where}: the vehicle's simulator sends its truth to the gcs fly that "
                "started it, or to another port (name it by --truth PORT), or it is stopped"
            )
        if not self._sources:
            return f"no simulator sends its truth to {where}; {_OTHER}"
        if self._run is not None:
            return f"the truth at {where} is refused: it comes from another simulator; {_OTHER}"
        if self._port_is_given:
            return f"{len(self._sources)} simulators send their truth to {where}; {_OTHER}"
        if self._silence_reason:
            return (
                f"the vehicle did not answer which simulator it flies in, so the truth at {where} is not "
                f"taken; {self._silence_reason}"
            )
        return (
            f"the vehicle does not say which simulator it flies in, so the truth at {where} is refused; "
            "if it is the vehicle's, confirm it with --truth PORT"
        )
