"""Mission items to steps, by the table of commands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.timeline import ANYWHERE, state_after
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Asked, Command, Fate
from autopilot.wire.items.fields import choice
from autopilot.wire.items.limits import MOST_FACTORS, MOST_FLOWN, MOST_JUMPS, MOST_TERMS
from autopilot.wire.items.records import LocatedStep, MissionItemError, WireItem
from autopilot.wire.items.table import COMMAND, COMMANDS, FLOWN_COMMANDS, fate
from missions.model import Delay, Land, NoseAim, ReturnHome, Signals, Step, Takeoff, Term

_TERM, _FACTOR, _RUN = (
    mavlink.PLUMBLINE_LOAD_SIGNAL_TERM,
    mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR,
    mavlink.PLUMBLINE_LOAD_SIGNAL_RUN,
)


ENDLESS = -1  # repetitions of a jump


def decode_items(items: Sequence[WireItem], home: Home) -> tuple[Step, ...]:
    """The steps that the items describe, or MissionItemError for the first item that cannot be flown."""
    return tuple(located.step for located in located_steps(items, home))


def located_steps(items: Sequence[WireItem], home: Home, return_to: Vec3 = ZERO) -> tuple[LocatedStep, ...]:
    """Like `decode_items`, each step with the items that MISSION_CURRENT and MISSION_ITEM_REACHED name.

    Places are relative to `home`; a return leads to `return_to` (m, ENU), which DO_SET_HOME moves.
    """
    reader = _Reader(home, return_to)
    jumps: dict[int, int] = {}
    flown = seq = 0
    while seq < len(items):
        item = items[seq]
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            reader.expect_no_terms(seq - 1)
            last = len(items) - 1
            target = choice(seq, 1, "item to jump to", item.param1, range(last + 1), f"0 ... {last}")
            allowed = f"0 ... {MOST_JUMPS}, or -1: without end"
            times = choice(seq, 2, "repetitions", item.param2, range(ENDLESS, MOST_JUMPS + 1), allowed)
            if times == ENDLESS:
                if not any(step.last >= target for step in reader.steps):
                    text = "a jump without end must lead back to something that is flown"
                    raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
                reader.aim_at_the_end(seq - 1)
                return tuple(reader.steps)
            jumps[seq] = jumps.get(seq, 0) + 1
            seq = target if jumps[seq] <= times else seq + 1
        else:
            reader.read(seq, item)
            seq += 1
        flown += 1
        if flown > MOST_FLOWN:
            text = f"with its jumps the mission has more than {MOST_FLOWN} items"
            raise MissionItemError(min(seq, len(items) - 1), text, mavlink.MAV_MISSION_NO_SPACE)
    reader.expect_no_terms(len(items) - 1)
    reader.aim_at_the_end(len(items) - 1)
    return tuple(reader.steps)


def endless_from(items: Sequence[WireItem], steps: Sequence[LocatedStep]) -> int | None:
    """Index of the step that follows the last one if an endless jump leads back to it; None without one."""
    for item in items:
        if item.command == mavlink.MAV_CMD_DO_JUMP and item.param2 == ENDLESS:
            return next(i for i, step in enumerate(steps) if step.last >= item.param1)
    return None


def unflown(items: Sequence[WireItem]) -> tuple[int, ...]:
    """Numbers of the items that are kept and not flown."""
    return tuple(seq for seq, item in enumerate(items) if fate(item.command) is not Fate.FLOWN)


class _Reader:
    """Reads the items in order: it collects terms until their run, and tracks the state of the load."""

    def __init__(self, home: Home, return_to: Vec3) -> None:
        self.steps: list[LocatedStep] = []
        self._home = home
        self._return_to = return_to
        self._terms: list[Term] = []
        self._first_term = 0
        self._aims: list[NoseAim] = []  # of the next step
        self._state = ANYWHERE  # after the steps so far

    def read(self, seq: int, item: WireItem) -> None:
        becomes = fate(item.command)
        if becomes is Fate.REFUSED:
            raise MissionItemError(seq, _why_refused(item.command), mavlink.MAV_MISSION_UNSUPPORTED)
        if becomes is Fate.KEPT:
            return
        row = COMMAND[item.command]
        asked = Asked(seq, item, self._home, self._state, row)
        if row.aims is not None:
            self._aims.append(row.aims(asked))
            return
        if item.command not in (_TERM, _FACTOR, _RUN):
            self.expect_no_terms(seq - 1)
        asked.expect_frame()
        if item.command == _TERM:
            self._term(asked)
        elif item.command == _FACTOR:
            self._factor(asked)
        elif item.command == _RUN:
            self._run(asked)
        else:
            for step in _steps(asked, row):
                self._add(LocatedStep(seq, seq, step))

    def expect_no_terms(self, seq: int) -> None:
        """MissionItemError if there are terms without a run, which would be lost silently."""
        if self._terms:
            text = f"the load signal begun at item {self._first_term} has no run (31012) behind it"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)

    def aim_at_the_end(self, seq: int) -> None:
        """Add a hold in which the nose turns if no step follows, unless the mission lands anyway."""
        if self._aims and self.steps and not isinstance(self.steps[-1].step, Land | ReturnHome):
            self._add(LocatedStep(seq, seq, Delay(0.0)))

    def _add(self, located: LocatedStep) -> None:
        if self._aims and not isinstance(located.step, Takeoff):  # the nose does not turn on the ground
            located, self._aims = located._replace(aims=tuple(self._aims)), []
        self.steps.append(located)
        self._state = state_after(located.step, self._state, self._return_to)

    def _term(self, asked: Asked) -> None:
        if len(self._terms) == MOST_TERMS:
            raise asked.refused(f"more than {MOST_TERMS} terms", mavlink.MAV_MISSION_NO_SPACE)
        term = asked.record()
        if not self._terms:
            self._first_term = asked.seq
        self._terms.append(term)

    def _factor(self, asked: Asked) -> None:
        if not self._terms:
            raise asked.refused("a factor (31011) must follow a term (31010)")
        term = self._terms[-1]
        if term.rise_90_by_s is not None:
            raise asked.refused("a term with a time to rise by takes no factors")
        if len(term.factors) == MOST_FACTORS:
            text = f"more than {MOST_FACTORS} factors of one term"
            raise asked.refused(text, mavlink.MAV_MISSION_NO_SPACE)
        self._terms[-1] = replace(term, factors=(*term.factors, asked.record()))

    def _run(self, asked: Asked) -> None:
        if not self._terms:
            raise asked.refused("a run (31012) must follow a term (31010)")
        asked.expect_load()
        signals = Signals(asked["duration_s"], tuple(self._terms))
        self._add(LocatedStep(self._first_term, asked.seq, signals))
        self._terms = []


def _steps(asked: Asked, row: Command) -> Iterable[Step]:
    """The steps of one item."""
    if row.needs_load:
        asked.expect_load()
    return (asked.record(),) if row.reads is None else row.reads(asked)


def _why_refused(command: int) -> str:
    if command in COMMAND:
        return f"command {command} cannot be done by this vehicle"
    own = sorted(row.number for row in COMMANDS if row.mission_frame)
    flown = ", ".join(map(str, sorted(FLOWN_COMMANDS.difference(own))))
    return f"command {command}; must be one of {flown} or {own[0]} ... {own[-1]}"
