"""Records that the services exchange with each other and with the shell; they have no behaviour.

A service takes a message, the peer that sent it and `now_us`; it returns outputs. `Send` and `SendText` are
sent on the wire, `Announce` requests messages that are built from the next snapshot, `RefusalCleared` is for
the kept texts, and the rest are events for the shell, named as facts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from autopilot.services.mission_store import StoredMission
from autopilot.wire.items import WireItem

Link = Hashable  # opaque name of a connection to a client, chosen by the shell


Source = tuple[int, int]  # system and component that send


class Peer(NamedTuple):
    """The sender of a message, its link, and the part of the vehicle to which it was addressed (None: the
    autopilot), which answers it."""

    link: Link
    system: int
    component: int
    addressed: Source | None = None

    @property
    def name(self) -> str:
        """The sender, as texts name it."""
        return f"system {self.system}, component {self.component}"


@dataclass(frozen=True, slots=True)
class Send:
    """A message for one link, or for all links (None), from a part of the vehicle (None: the autopilot)."""

    link: Link | None
    message: Any
    source: Source | None = None


@dataclass(frozen=True, slots=True)
class SendText:
    """A text for the operators of all links; MAV_SEVERITY 0 (emergency) ... 7 (debug).

    A refusal states its `subject`, a command or an upload: it is a warning until that is accepted
    (`RefusalCleared`). It also states the link of the `asker`: a refusal that recurs is sent less often than
    the other texts.
    """

    severity: int
    text: str
    subject: Hashable = None
    asker: Link | None = None


@dataclass(frozen=True, slots=True)
class RefusalCleared:
    """A command or upload that was refused before is now accepted: its refusals are no longer warnings."""

    subject: Hashable


@dataclass(frozen=True, slots=True)
class Announce:
    """Send these streamed messages once, out of turn, to one link or to all links (None)."""

    link: Link | None
    message_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ParameterChanged:
    """A ground station set a parameter; the table already holds `value`."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class SimulatorParameterRequested:
    """A parameter of the simulator is to be set to `value`; the value that the simulator then reports is in
    force and is sent to the ground stations. A refusal is sent to `client`, if there is one."""

    name: str
    value: float
    client: Peer | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True)
class MissionChanged:
    """A whole mission was accepted in place of the previous one, or the mission was cleared (no items)."""

    mission: StoredMission


@dataclass(frozen=True, slots=True)
class AreasChanged:
    """The fence or the rally points (`kind`: MAV_MISSION_TYPE) were replaced, or cleared (no items)."""

    kind: int
    items: tuple[WireItem, ...]


@dataclass(frozen=True, slots=True)
class TimesyncAnswered:
    """A peer answered our TIMESYNC: both time stamps of its message, ns."""

    link: Link
    tc1: int
    ts1: int


@dataclass(frozen=True, slots=True)
class SigningChanged:
    """The signing key (None: signing is off) and a time stamp later than any in use, to be stored before more
    is sent."""

    key: bytes | None = field(repr=False)
    timestamp: int


@dataclass(frozen=True, slots=True)
class ParametersSaved:
    """The parameters are to be stored as they are now, whatever was stored before."""


@dataclass(frozen=True, slots=True)
class SimulatorParametersSaved:
    """Values of the simulator's parameters that are to be restored after a restart (empty: none are)."""

    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ServiceFailed:
    """An error of the autopilot itself while it served a message: where, and the trace for a developer."""

    what: str
    trace: str


Event = (
    ParameterChanged
    | SimulatorParameterRequested
    | MissionChanged
    | AreasChanged
    | TimesyncAnswered
    | SigningChanged
    | ParametersSaved
    | SimulatorParametersSaved
    | ServiceFailed
)
Output = Send | SendText | RefusalCleared | Announce | Event


class Verdict(NamedTuple):
    """The decision on a request: a MAV_RESULT, and the reason in one line if there is something to say."""

    result: int
    text: str | None = None
    warns: bool = False  # the text is a warning although the request is accepted


# A request is one of the dataclasses of `requests`; the supervisor decides.
Decide = Callable[[Any], Verdict]
# How a service handles a message: (message, peer, now_us, decide) -> outputs
Handler = Callable[[Any, Peer, int, Decide], list[Output]]
