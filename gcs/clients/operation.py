"""The common parts of all exchanges with the vehicle: messages and `now_us` in, messages out, one result.

An operation asks, waits, asks again and ends in a `Result`. It knows neither frames nor links: its owner
passes it each message of the vehicle and sends the messages that `poll` returns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple, Protocol

# in the words of vehicles
_REFUSAL_WORDS = ("denied", "refused", "rejected", "mission item", "fence item", "rally point")

_STEM_LENGTH = (
    3  # letters: a vehicle's text that begins with the same letters as the subject names the subject
)


class Target(NamedTuple):
    """The addressee of a message."""

    system: int
    component: int


class Status(Enum):
    """How an operation ended."""

    DONE = "done"
    REFUSED = "refused"  # the vehicle refused
    UNANSWERED = "unanswered"  # the vehicle did not answer any of the tries


@dataclass(frozen=True)
class Result:
    """How an operation ended; `text` is for display.

    `subject`: what was requested; the vehicle's own text of a refusal begins with it.
    `guess`: a possible reason why no answer came, used if no better one is known.
    """

    status: Status
    text: str
    subject: str = ""
    guess: str = ""

    @property
    def done(self) -> bool:
        return self.status is Status.DONE

    def refusal_text(self, texts: Sequence[str]) -> str:
        """The text of a refusal: first those of the vehicle's texts `texts` that refuse, then the others. If
        none of them refuses, `text` comes first."""
        refusals = [one for one in texts if self.subject and self._refuses(one)]
        if not refusals:
            return "; ".join([self.text, *texts])
        joined = "; ".join([*refusals, *(one for one in texts if one not in refusals)])
        names_subject = joined.lower().startswith(
            self.subject[:_STEM_LENGTH].lower()
        )  # arm: Arming denied ...
        return joined if names_subject else f"{self.subject}: {joined}"

    def _refuses(self, text: str) -> bool:
        return text.startswith(self.subject) or any(one in text.lower() for one in _REFUSAL_WORDS)

    def silence_text(self, link_problem: str) -> str:
        """The text if no answer came, with a reason: the known `link_problem`, or else the guess."""
        return "; ".join(filter(None, (self.text, link_problem or self.guess)))


class Operation(Protocol):
    """One exchange with the vehicle."""

    result: Result | None

    def receive(self, message: Any, now_us: int) -> None:
        """Process a message of the vehicle."""

    def poll(self, now_us: int) -> list[Any]:
        """The messages to send now."""

    @property
    def progress(self) -> tuple[int, int]:
        """(done, total); (0, 0) while that is not known."""


class Retry:
    """When to ask again: every `interval_us`, `sends` times in all."""

    def __init__(self, interval_us: int, sends: int) -> None:
        self.interval_us = interval_us
        self.sends = sends
        self.sent = 0
        self._next_us: int | None = None

    def due(self, now_us: int) -> bool:
        """True if it is time to ask again or, if `exhausted`, to give up."""
        return self._next_us is None or now_us >= self._next_us

    @property
    def exhausted(self) -> bool:
        """True if no tries are left; if also `due`, the last try was not answered."""
        return self.sent >= self.sends

    def record_sent(self, now_us: int) -> None:
        """Record that the question was sent."""
        self.sent += 1
        self._next_us = now_us + self.interval_us

    def wait(self, now_us: int, interval_us: int) -> None:
        """The vehicle is working on it: do not ask again before `interval_us` has passed."""
        self._next_us = now_us + interval_us

    def restart(self) -> None:
        """An answer came: the next question is due immediately and has all its tries."""
        self.sent = 0
        self._next_us = None


def is_addressed_to(message: Any, ground: Target) -> bool:
    """True if `message` is addressed to `ground` or to all systems (0 means all)."""
    system = getattr(message, "target_system", 0)
    component = getattr(message, "target_component", 0)
    return system in (0, ground.system) and component in (0, ground.component)


GROUND = Target(255, 190)
