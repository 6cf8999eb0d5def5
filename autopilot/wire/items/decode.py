"""Mission items to steps, by the table of commands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.timeline import ANYWHERE, state_after, timeline
from autopilot.wire.command_names import command_name, numbered_name
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Command, Handling, ItemContext
from autopilot.wire.items.fields import choice
from autopilot.wire.items.limits import MAX_FACTORS, MAX_FLOWN_ITEMS, MAX_JUMPS, MAX_TERMS
from autopilot.wire.items.records import LocatedStep, MissionItemError, WireItem
from autopilot.wire.items.table import COMMAND, handling_of
from missions.model import Delay, HeadingCommand, Land, ReturnHome, Signals, Step, Takeoff, Term

_TERM, _FACTOR, _RUN = (
    mavlink.PLUMBLINE_LOAD_SIGNAL_TERM,
    mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR,
    mavlink.PLUMBLINE_LOAD_SIGNAL_RUN,
)


# for an item that leads somewhere by a command that is not flown
_SUGGESTED = (
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_NAV_WAYPOINT,
    mavlink.MAV_CMD_NAV_LOITER_TIME,
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    mavlink.MAV_CMD_NAV_LAND,
)
ENDLESS = -1  # repetitions of a jump
_MIN_LAP_S = 0.5  # that an endless jump must take from one time to the next


def decode_items(items: Sequence[WireItem], home: Home) -> tuple[Step, ...]:
    """The steps that the items describe, or MissionItemError for the first item that cannot be flown."""
    return tuple(located.step for located in located_steps(items, home))


def located_steps(items: Sequence[WireItem], home: Home, return_to: Vec3 = ZERO) -> tuple[LocatedStep, ...]:
    """Like `decode_items`, each step with the items that MISSION_CURRENT and MISSION_ITEM_REACHED name.

    Places are relative to `home`; a return leads to `return_to` (m, ENU), which DO_SET_HOME moves.
    """
    reader = _Reader(home, return_to)
    jumps: dict[int, int] = {}
    flown_count = seq = 0
    while seq < len(items):
        item = items[seq]
        if item.command == mavlink.MAV_CMD_DO_JUMP:
            reader.expect_no_terms(seq - 1)
            last = len(items) - 1
            target = choice(seq, 1, "item to jump to", item.param1, range(last + 1), f"0 ... {last}")
            allowed = f"0 ... {MAX_JUMPS}, or -1: without end"
            times = choice(seq, 2, "repetitions", item.param2, range(ENDLESS, MAX_JUMPS + 1), allowed)
            if times == ENDLESS:
                if not any(step.last >= target for step in reader.steps):
                    text = "a jump without end must lead back to something that is flown"
                    raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
                if reader.lap_s(target) < _MIN_LAP_S:
                    text = f"what a jump without end repeats must take at least {_MIN_LAP_S:g} s"
                    raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)
                reader.add_hold_to_turn(seq - 1)
                return tuple(reader.steps)
            jumps[seq] = jumps.get(seq, 0) + 1
            seq = target if jumps[seq] <= times else seq + 1
        else:
            reader.read(seq, item)
            seq += 1
        flown_count += 1
        if flown_count > MAX_FLOWN_ITEMS:
            text = f"with its jumps the mission has more than {MAX_FLOWN_ITEMS} items"
            raise MissionItemError(min(seq, len(items) - 1), text, mavlink.MAV_MISSION_NO_SPACE)
    reader.expect_no_terms(len(items) - 1)
    reader.add_hold_to_turn(len(items) - 1)
    return tuple(reader.steps)


def endless_jump_target(items: Sequence[WireItem], steps: Sequence[LocatedStep]) -> int | None:
    """Index of the step that follows the last one if an endless jump leads back to it; None without one."""
    for item in items:
        if item.command == mavlink.MAV_CMD_DO_JUMP and item.param2 == ENDLESS:
            return next(i for i, step in enumerate(steps) if step.last >= item.param1)
    return None


def unflown_items(items: Sequence[WireItem]) -> tuple[int, ...]:
    """Numbers of the items that are kept and not flown."""
    return tuple(seq for seq, item in enumerate(items) if handling_of(item.command) is not Handling.FLOWN)


class _Reader:
    """Reads the items in order: it collects terms until their run, and tracks the state of the load."""

    def __init__(self, home: Home, return_to: Vec3) -> None:
        self.steps: list[LocatedStep] = []
        self._home = home
        self._return_to = return_to
        self._terms: list[Term] = []
        self._first_term = 0
        self._heading_commands: list[HeadingCommand] = []  # of the next step
        self._state = ANYWHERE  # after the steps so far

    def read(self, seq: int, item: WireItem) -> None:
        handling = handling_of(item.command)
        if handling is Handling.REFUSED:
            raise MissionItemError(seq, _refusal_text(item.command), mavlink.MAV_MISSION_UNSUPPORTED)
        if handling is Handling.KEPT:
            return
        row = COMMAND[item.command]
        context = ItemContext(seq, item, self._home, self._state, row)
        if row.heading_command is not None:
            self._heading_commands.append(row.heading_command(context))
            return
        if item.command not in (_TERM, _FACTOR, _RUN):
            self.expect_no_terms(seq - 1)
        context.expect_frame()
        if item.command == _TERM:
            self._term(context)
        elif item.command == _FACTOR:
            self._factor(context)
        elif item.command == _RUN:
            self._run(context)
        else:
            for step in _steps(context, row):
                self._add(LocatedStep(seq, seq, step))

    def expect_no_terms(self, seq: int) -> None:
        """MissionItemError if there are terms without a run, which would be lost silently."""
        if self._terms:
            text = f"the load signal begun at item {self._first_term} has no run (31012) behind it"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)

    def add_hold_to_turn(self, seq: int) -> None:
        """Add a hold in which the nose turns if no step follows, unless the mission lands anyway."""
        if self._heading_commands and self.steps and not isinstance(self.steps[-1].step, Land | ReturnHome):
            self._add(LocatedStep(seq, seq, Delay(0.0)))

    def lap_s(self, target: int) -> float:
        """Time (s) of the steps from item `target` on, if they are flown again after the last step."""
        steps = [located.step for located in self.steps if located.last >= target]
        entries = timeline(steps, self._state, self._return_to)
        # in the air a take-off only moves the load
        return sum(one.transfer_s if isinstance(one.step, Takeoff) else one.duration_s for one in entries)

    def _add(self, located: LocatedStep) -> None:
        if self._heading_commands and not isinstance(
            located.step, Takeoff
        ):  # the nose does not turn on the ground
            located, self._heading_commands = (
                located._replace(heading_commands=tuple(self._heading_commands)),
                [],
            )
        self.steps.append(located)
        self._state = state_after(located.step, self._state, self._return_to)

    def _term(self, context: ItemContext) -> None:
        if len(self._terms) == MAX_TERMS:
            raise context.refusal(f"more than {MAX_TERMS} terms", mavlink.MAV_MISSION_NO_SPACE)
        term = context.record()
        if not self._terms:
            self._first_term = context.seq
        self._terms.append(term)

    def _factor(self, context: ItemContext) -> None:
        if not self._terms:
            raise context.refusal("a factor (31011) must follow a term (31010)")
        term = self._terms[-1]
        if term.rise_90_by_s is not None:
            raise context.refusal("a term with a time to rise by takes no factors")
        if len(term.factors) == MAX_FACTORS:
            text = f"more than {MAX_FACTORS} factors of one term"
            raise context.refusal(text, mavlink.MAV_MISSION_NO_SPACE)
        self._terms[-1] = replace(term, factors=(*term.factors, context.record()))

    def _run(self, context: ItemContext) -> None:
        if not self._terms:
            raise context.refusal("a run (31012) must follow a term (31010)")
        context.expect_load()
        signals = Signals(context["duration_s"], tuple(self._terms))
        self._add(LocatedStep(self._first_term, context.seq, signals))
        self._terms = []


def _steps(context: ItemContext, row: Command) -> Iterable[Step]:
    """The steps of one item."""
    if row.needs_load:
        context.expect_load()
    return (context.record(),) if row.read_steps is None else row.read_steps(context)


def _refusal_text(command: int) -> str:
    name = numbered_name(command)
    if command in COMMAND:
        return f"{name}: {COMMAND[command].text}"
    if name == f"command {command}":
        return f"{name} is not one that MAVLink or Plumbline defines"
    return f"{name} is not flown; use {', '.join(map(command_name, _SUGGESTED))}"
