"""What the services say to each other and to the shell: plain records, no behaviour.

A service takes a message, the peer it came from and `now_us`; it returns outputs. `Send` and `Say` go out on
the wire, `Announce` asks for messages that are made from the next snapshot, and the rest are events for the
shell, named as facts.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from autopilot.services.mission_store import StoredMission
from autopilot.wire.items import WireItem

Link = Hashable  # opaque name of a way to a client, chosen by the shell


Source = tuple[int, int]  # system and component that speak


class Peer(NamedTuple):
    """Who sent a message, over which link, and to which part of the vehicle (None: the autopilot), which is
    the one to answer."""

    link: Link
    system: int
    component: int
    addressed: Source | None = None


@dataclass(frozen=True, slots=True)
class Send:
    """A message for one link, or for all of them (None), by a part of the vehicle (None: the autopilot)."""

    link: Link | None
    message: Any
    source: Source | None = None


@dataclass(frozen=True, slots=True)
class Say:
    """A text for the operators of all links; MAV_SEVERITY 0 (emergency) ... 7 (debug).

    A refusal says what it is `about`, a command or an upload: it counts until that is accepted (`Settled`).
    """

    severity: int
    text: str
    about: Hashable = None


@dataclass(frozen=True, slots=True)
class Settled:
    """What was refused before is accepted now: the refusals `about` it are no warnings any more."""

    about: Hashable


@dataclass(frozen=True, slots=True)
class Announce:
    """Send these streamed messages once, out of turn, to one link or to all of them (None)."""

    link: Link | None
    message_ids: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class ParameterChanged:
    """A ground station set a parameter; the table already holds `value`."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class WorldAsked:
    """A parameter of the simulator is to be `value`; what it then says is what holds, and is told."""

    name: str
    value: float


@dataclass(frozen=True, slots=True)
class MissionChanged:
    """A whole mission was accepted in place of the last one, or the mission was cleared (no items)."""

    mission: StoredMission


@dataclass(frozen=True, slots=True)
class AreasChanged:
    """The fence or the rally points (`kind`: MAV_MISSION_TYPE) were replaced, or cleared (no items)."""

    kind: int
    items: tuple[WireItem, ...]


@dataclass(frozen=True, slots=True)
class TimesyncAnswered:
    """A peer answered our TIMESYNC: both stamps as they stand in its message, ns."""

    link: Link
    tc1: int
    ts1: int


@dataclass(frozen=True, slots=True)
class SigningChanged:
    """To be stored before more is sent: the key (None: no more), and a time later than any in use."""

    key: bytes | None = field(repr=False)
    timestamp: int


@dataclass(frozen=True, slots=True)
class ParametersSaved:
    """The parameters are meant to be as they are now, whatever was stored before."""


@dataclass(frozen=True, slots=True)
class WorldSaved:
    """The simulator's parameters are to be as they are now after a restart as well (none: as it likes)."""

    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class ServiceFailed:
    """A fault of ours in the service of a message: where, and the trace of it for a developer."""

    what: str
    trace: str


Event = (
    ParameterChanged
    | WorldAsked
    | MissionChanged
    | AreasChanged
    | TimesyncAnswered
    | SigningChanged
    | ParametersSaved
    | WorldSaved
    | ServiceFailed
)
Output = Send | Say | Settled | Announce | Event


class Verdict(NamedTuple):
    """What becomes of a request: a MAV_RESULT, and why in one line where there is something to say."""

    result: int
    text: str | None = None
    warns: bool = False  # of what was accepted: the text is a warning all the same


# A request is one of the dataclasses of `requests`; the supervisor decides.
Decide = Callable[[Any], Verdict]
# What a service does about a message: (message, peer, now_us, decide) -> outputs
Handler = Callable[[Any, Peer, int, Decide], list[Output]]
