"""The common signature of all watches, and what they return."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import Event, Flight, Text, View
from autopilot.wire.dialect.plumbline import MAV_SEVERITY_ERROR


class WatchResult(NamedTuple):
    """What a watch found: the flight with its notes, and an event with texts, or nothing.

    Texts without an event are sent, and the phase continues. A watch that found something ends the tick: the
    watches after it run again at the next tick.
    """

    flight: Flight
    event: Event | None = None
    texts: tuple[Text, ...] = ()
    reached: tuple[int, ...] = ()  # mission items

    @property
    def found(self) -> bool:
        """Whether there is an event or a text."""
        return self.event is not None or bool(self.texts)

    @property
    def is_failsafe(self) -> bool:
        """Whether the event is the reaction to a failure: a text about it is an error or worse."""
        is_failure = any(severity <= MAV_SEVERITY_ERROR for severity, _ in self.texts)
        return self.event is not None and is_failure


Watch = Callable[[Flight, View, Settings], WatchResult]
