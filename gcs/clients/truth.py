"""Which truth belongs to the vehicle: of several simulators that send to one port, only its own is accepted.

A simulator identifies its run of the world by SIM_BOOT. It sends it to the autopilot, which reports it on
request, and together with the truth. Several simulators may send to one port; they are distinguished by the
address of the sender.
"""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.wire.codec import Field
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.datagrams import messages

Sender = tuple[str, int]

_SIM_BOOT = mavlink.MAVLINK_MSG_ID_SIM_BOOT
_RUN = Field(mavlink.MAVLink_sim_boot_message, "boot_id")
_OTHER = "--truth PORT names the port to which the vehicle's simulator sends it (sitl --truth HOST:PORT)"


class Worlds:
    """The simulators that send their truth to one port."""

    def __init__(self) -> None:
        self._runs: dict[Sender, int | None] = {}

    def __len__(self) -> int:
        return len(self._runs)

    def run(self, datagram: bytes, sender: Sender) -> int | None:
        """The run of the world that a datagram belongs to; None: its sender has not identified it."""
        said = [_RUN.of(one.frame) for one in messages(datagram)[0] if one.id == _SIM_BOOT]
        self._runs[sender] = int(said[-1]) if said else self._runs.get(sender)
        return self._runs[sender]


class Truth:
    """Passes on the truth of the world that the vehicle flies in, and drops all other truth.

    `vouched`: the user has named the port to which the vehicle's simulator sends. A vehicle that cannot
    report its world is then assumed to fly in the one whose simulator sends there, if only one does.
    """

    def __init__(self, where: str, vouched: bool) -> None:
        self._where = where
        self._vouched = vouched
        self._worlds = Worlds()
        self._run: int | None = None  # of the vehicle
        self._silent = ""  # why the vehicle did not answer
        self.heard = False  # truth of the vehicle's world was received

    def of_vehicle(self, run: int | None, silent: str = "") -> None:
        """Set the run of the world that the vehicle reports; None: it does not report one, or it has not
        answered and `silent` says why."""
        self._run, self._silent = run, silent

    def take(self, datagrams: Iterable[tuple[bytes, Sender]]) -> list[bytes]:
        """Of datagrams with their senders, those of the vehicle's world."""
        own = []
        for datagram, sender in datagrams:
            run = self._worlds.run(datagram, sender)
            unsaid = self._run is None and self._vouched and len(self._worlds) == 1
            if unsaid or (run is not None and run == self._run):
                own.append(datagram)
        self.heard = self.heard or bool(own)
        return own

    @property
    def missing(self) -> str:
        """Why there is no truth of the vehicle's world, and what to do; empty if there is."""
        where = f"UDP {self._where}"
        if self.heard:
            return ""
        if not self._worlds and self._run is not None:
            return (
                f"nothing comes at {where}: the vehicle's simulator sends its truth to the gcs fly that "
                "started it, or to another port (name it by --truth PORT), or it is stopped"
            )
        if not self._worlds:
            return f"no simulator sends its truth to {where}; {_OTHER}"
        if self._run is not None:
            return f"the truth at {where} is refused: it comes from another simulator; {_OTHER}"
        if self._vouched:
            return f"{len(self._worlds)} simulators send their truth to {where}; {_OTHER}"
        if self._silent:
            return (
                f"the vehicle did not answer which simulator it flies in, so the truth at {where} is not "
                f"taken; {self._silent}"
            )
        return (
            f"the vehicle does not say which simulator it flies in, so the truth at {where} is refused; "
            "if it is the vehicle's, confirm it with --truth PORT"
        )
