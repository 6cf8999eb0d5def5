"""The last texts for the operators, kept so that a ground station that connects later can request them.

A repeated text replaces its previous occurrence, so that a warning that recurs every few seconds does not
displace the reason of a failsafe. Kept texts are sent at a steady pace, only to the link that requested them,
each with its number, the count and its age: `[2/7, 12.3 s ago] Landed, disarmed`. A refusal of something that
has been accepted since is sent as a notice instead of a warning.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from typing import NamedTuple

from autopilot.services.records import Link, Output, Send
from autopilot.services.streams import NEVER_US
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import TextWriter

MAX_TEXTS = 50  # kept texts
TEXT_INTERVAL_US = 4000  # between two texts on a link
_CLEARED_SEVERITY = mavlink.MAV_SEVERITY_NOTICE
_MICRO = 1e-6


class KeptText(NamedTuple):
    """A text, and when it was last sent, by the vehicle's clock; negative: before its boot."""

    now_us: int
    severity: int
    text: str


class KeptTexts:
    """The texts, the oldest first, and the links to which they are being sent."""

    def __init__(self, writer: TextWriter) -> None:
        self._writer = writer
        self._texts: dict[tuple[int, str], int] = {}  # when each was last sent, in that order
        self._refusals: dict[tuple[int, str], Hashable] = {}  # the texts that refuse something, and what
        self._transfers: dict[Link, tuple[tuple[KeptText, ...], int, int]] = {}  # texts, next index, its time

    @property
    def texts(self) -> tuple[KeptText, ...]:
        """The kept texts, the oldest first."""
        return tuple(KeptText(now_us, *entry) for entry, now_us in self._texts.items())

    def holds(self, text: str) -> bool:
        """Whether this text is kept, with any severity."""
        return any(kept == text for _, kept in self._texts)

    def keep(self, severity: int, text: str, now_us: int, subject: Hashable = None) -> None:
        """Keep a text that is sent now, perhaps a refusal of `subject`; the oldest text may be dropped."""
        entry = severity, text
        for older in (entry, (_CLEARED_SEVERITY, text)):
            self._texts.pop(older, None)
        self._texts[entry] = now_us
        if len(self._texts) > MAX_TEXTS:
            del self._texts[next(iter(self._texts))]
        if subject is not None:
            self._refusals[entry] = subject
        if len(self._refusals) > MAX_TEXTS:
            self._refusals = {one: what for one, what in self._refusals.items() if one in self._texts}

    def clear_refusals(self, subject: Hashable) -> None:
        """A command or upload that was refused is now accepted."""
        cleared = [entry for entry, what in self._refusals.items() if what == subject]
        if not cleared:
            return
        for entry in cleared:
            del self._refusals[entry]
        updated: dict[tuple[int, str], int] = {}
        for entry, now_us in self._texts.items():
            notice = (_CLEARED_SEVERITY, entry[1]) if entry in cleared else entry
            updated.pop(notice, None)  # of equal texts the later one counts
            updated[notice] = now_us
        self._texts = updated

    def inherit(self, texts: Iterable[KeptText], ended_us: int) -> None:
        """Take over the texts of the previous run, which ended at `ended_us` of its own clock."""
        older = {(text.severity, text.text): text.now_us - ended_us for text in texts}
        entries = [(entry, at_us) for entry, at_us in older.items() if entry not in self._texts]
        entries += self._texts.items()
        self._texts = dict(entries[-MAX_TEXTS:])

    def request(self, link: Link, now_us: int) -> None:
        """Send the texts that are kept now to this link, unless a transfer to it is already under way."""
        if self._texts and link not in self._transfers:
            self._transfers[link] = (self.texts, 0, now_us)

    def next_timer(self) -> int:
        """Time at which `poll` has something to send, in us."""
        return min((at_us for _, _, at_us in self._transfers.values()), default=NEVER_US)

    def poll(self, now_us: int) -> list[Output]:
        """The texts that are due, one on each link."""
        outputs: list[Output] = []
        for link, (texts, index, at_us) in list(self._transfers.items()):
            if at_us > now_us:
                continue
            sent_us, severity, text = texts[index]
            head = f"[{index + 1}/{len(texts)}, {(now_us - sent_us) * _MICRO:.1f} s ago]"
            outputs += [Send(link, message) for message in self._writer.messages(severity, f"{head} {text}")]
            self._transfers[link] = (texts, index + 1, now_us + TEXT_INTERVAL_US)
            if index + 1 == len(texts):
                del self._transfers[link]
        return outputs

    def forget(self, link: Link) -> None:
        """Stop sending to a link that no longer exists."""
        self._transfers.pop(link, None)
