"""What every exchange with the vehicle has in common: messages and `now_us` in, messages out, one result.

An operation asks, waits, asks again and ends in a `Result`. It knows neither frames nor links: the owner
hands it each message of the vehicle and sends what `poll` returns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

_REFUSING = ("denied", "refused", "rejected", "mission item")  # in the words of vehicles

_STEM = 3  # letters, by which the vehicle's word for a thing is known as ours


class Target(NamedTuple):
    """Whom a message is for."""

    system: int
    component: int


class Status(Enum):
    """How an operation ended."""

    DONE = "done"
    REFUSED = "refused"  # the vehicle said no
    UNANSWERED = "unanswered"  # it said nothing, however often it was asked


@dataclass(frozen=True)
class Result:
    """How an operation ended; `text` is for a person.

    `subject`: what was asked of the vehicle, with which its own words of a refusal begin.
    `guess`: why no answer came, perhaps, where nothing better is known.
    """

    status: Status
    text: str
    subject: str = ""
    guess: str = ""

    @property
    def done(self) -> bool:
        return self.status is Status.DONE

    def refusal(self, words: Sequence[str]) -> str:
        """A refusal in the vehicle's own words, if it has given some; what else it has said follows."""
        own = [one for one in words if self.subject and self._refuses(one)]
        if not own:
            return "; ".join([self.text, *words])
        told = "; ".join([*own, *(one for one in words if one not in own)])
        says_what = told.lower().startswith(self.subject[:_STEM].lower())  # arm: Arming denied ...
        return told if says_what else f"{self.subject}: {told}"

    def _refuses(self, words: str) -> bool:
        return words.startswith(self.subject) or any(one in words.lower() for one in _REFUSING)

    def silence(self, trouble: str) -> str:
        """That no answer came, and why: `trouble` that is known of the link, or else a guess."""
        return "; ".join(filter(None, (self.text, trouble or self.guess)))


class Operation(Protocol):
    """One exchange with the vehicle."""

    result: Result | None

    def receive(self, message: Any, now_us: int) -> None:
        """Take a message of the vehicle in."""

    def poll(self, now_us: int) -> list[Any]:
        """The messages to send now."""

    @property
    def progress(self) -> tuple[int, int]:
        """(done, of how many); (0, 0) while that is not known."""


class Retry:
    """When to ask again: every `interval_us`, `sends` times in all."""

    def __init__(self, interval_us: int, sends: int) -> None:
        self.interval_us = interval_us
        self.sends = sends
        self.sent = 0
        self._next_us: int | None = None

    def due(self, now_us: int) -> bool:
        """True if it is time to ask, or to find that asking is of no use (see `exhausted`)."""
        return self._next_us is None or now_us >= self._next_us

    @property
    def exhausted(self) -> bool:
        """Asked as often as may be; if `due` too, the last answer did not come."""
        return self.sent >= self.sends

    def asked(self, now_us: int) -> None:
        """Note that the question went out."""
        self.sent += 1
        self._next_us = now_us + self.interval_us

    def wait(self, now_us: int, interval_us: int) -> None:
        """The vehicle is at work: ask no sooner than in `interval_us`."""
        self._next_us = now_us + interval_us

    def restart(self) -> None:
        """An answer came: the next question is due at once, and may be asked as often again."""
        self.sent = 0
        self._next_us = None


def addressed(message: Any, ground: Target) -> bool:
    """True if `message` is for everybody or for us (0 means everybody)."""
    system = getattr(message, "target_system", 0)
    component = getattr(message, "target_component", 0)
    return system in (0, ground.system) and component in (0, ground.component)


GROUND = Target(255, 190)
