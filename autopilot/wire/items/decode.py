"""Mission items to steps, by the table of commands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.trajectory.timeline import ANYWHERE, state_after, timeline
from autopilot.wire.command_names import command_name, numbered_name
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items.command import Command, Handling, ItemContext
from autopilot.wire.items.fields import choice
from autopilot.wire.items.limits import (
    MAX_FACTORS,
    MAX_FLOWN_ITEMS,
    MAX_JUMPS,
    MAX_POINTS,
    MAX_TERMS,
    SHORTEST_POINT_S,
)
from autopilot.wire.items.records import END, LocatedStep, MissionItemError, Visit, WireItem
from autopilot.wire.items.table import COMMAND, handling_of
from missions.model import (
    ORIGIN,
    AttitudeRun,
    Delay,
    HeadingCommand,
    Land,
    LoadPath,
    ReturnHome,
    Signals,
    Step,
    Takeoff,
    Term,
    Trajectory,
    TrajectoryPoint,
    Winch,
)

_TERM, _FACTOR, _RUN, _POINT = (
    mavlink.PLUMBLINE_LOAD_SIGNAL_TERM,
    mavlink.PLUMBLINE_LOAD_SIGNAL_FACTOR,
    mavlink.PLUMBLINE_LOAD_SIGNAL_RUN,
    mavlink.PLUMBLINE_LOAD_TRAJECTORY_POINT,
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
JUMPS = (mavlink.MAV_CMD_DO_JUMP, mavlink.MAV_CMD_DO_JUMP_TAG)
_ROUNDING_S = 1e-9  # of times that are whole milliseconds
_MIN_LAP_S = 0.5  # that an endless jump must take from one time to the next


def decode_items(items: Sequence[WireItem], home: Home) -> tuple[Step, ...]:
    """The steps that the items describe, or MissionItemError for the first item that cannot be flown."""
    return tuple(located.step for located in located_steps(items, home))


def located_steps(items: Sequence[WireItem], home: Home, return_to: Vec3 = ZERO) -> tuple[LocatedStep, ...]:
    """Like `decode_items`, each step with the items that MISSION_CURRENT and MISSION_ITEM_REACHED name.

    Places are relative to `home`; a return leads to `return_to` (m, ENU), which DO_SET_HOME moves.
    """
    return read_items(items, home, return_to)[0]


def read_items(
    items: Sequence[WireItem], home: Home, return_to: Vec3 = ZERO
) -> tuple[tuple[LocatedStep, ...], tuple[Visit, ...]]:
    """`located_steps`, and the visits to the items in their order.

    What a jump without end repeats is read until it comes to an item with the counts of all jumps as at an
    earlier visit: from there on it is the same again. Then come the steps of the items behind the jump, with
    which the mission continues if the loop is left.
    """
    reader = _Reader(home, return_to)
    tags = _tagged_items(items)
    taken: dict[int, int] = {}  # by the item of a jump: how often it was taken
    laps: dict[tuple[tuple[int, int], ...], int] = {}
    visits: list[Visit] = []
    visited: dict[tuple[int, int], int] = {}  # index of the visit to an item in a lap
    behind: list[tuple[int, dict[int, int]]] = []  # items behind endless jumps, and the jumps taken by then
    flown_count = seq = last = jump = 0  # `last` item that was read, `jump` without end that was taken

    def state(item: int, counts: dict[int, int]) -> tuple[int, int]:
        return item, laps.setdefault(tuple(counts.items()), len(laps))

    while True:
        here = state(seq, taken)
        if here in visited or seq == len(items):  # the end of a stretch of steps
            then: int | None = None
            if here in visited:
                then = visits[visited[here]].step
                reader.check_loop(jump, then)
                if visits[-1].item == jump:
                    visits[-1] = visits[-1]._replace(step=then)
            behind = [one for one in behind if state(*one) not in visited]
            if seq == len(items):
                last, then = seq - 1, END if behind else None
            reader.end_stretch(last, then)
            if then is not None:
                visits = [v if v.step < len(reader.steps) else v._replace(step=then) for v in visits]
            if not behind:
                return tuple(reader.steps), tuple(visits)
            seq, taken = behind.pop()
            continue
        item = items[seq]
        if item.command != _POINT or item.x == 0:  # a point at time 0 begins another trajectory
            reader.end_trajectory()  # of points in a row
        visited[here] = len(visits)
        visits.append(Visit(seq, len(reader.steps), here[1]))
        flown_count += 1
        if item.command in JUMPS:
            reader.end_step(seq - 1)
            target = _jump_target(seq, items, tags)
            allowed = f"0 ... {MAX_JUMPS}, or -1: without end"
            times = choice(seq, 2, "repetitions", item.param2, range(ENDLESS, MAX_JUMPS + 1), allowed)
            if times == ENDLESS:
                if not any(step.last >= target for step in reader.steps):
                    raise _loop_error(seq)
                behind.append((seq + 1, dict(taken)))
                jump, seq = seq, target
            elif taken.get(seq, 0) < times:
                taken[seq] = taken.get(seq, 0) + 1
                seq = target
            else:
                seq += 1
        else:
            reader.read(seq, item)
            last, seq = seq, seq + 1
        if flown_count > MAX_FLOWN_ITEMS:
            text = f"with its jumps the mission has more than {MAX_FLOWN_ITEMS} items"
            raise MissionItemError(min(seq, len(items) - 1), text, mavlink.MAV_MISSION_NO_SPACE)


def _tagged_items(items: Sequence[WireItem]) -> dict[float, int]:
    """The items that are tagged, by their tags; MissionItemError if two have the same."""
    tags: dict[float, int] = {}
    for seq, item in enumerate(items):
        if item.command == mavlink.MAV_CMD_JUMP_TAG and tags.setdefault(item.param1, seq) != seq:
            text = f"tag {item.param1:g} is already that of item {tags[item.param1]}"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID_PARAM1)
    return tags


def _jump_target(seq: int, items: Sequence[WireItem], tags: Mapping[float, int]) -> int:
    """The item to which a jump leads: of a number, or with a tag."""
    item, end = items[seq], len(items) - 1
    if item.command == mavlink.MAV_CMD_DO_JUMP:
        return choice(seq, 1, "item to jump to", item.param1, range(end + 1), f"0 ... {end}")
    if item.param1 not in tags:
        text = f"no item has the tag {item.param1:g}, which JUMP_TAG (600) gives"
        raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID_PARAM1)
    return tags[item.param1]


def endless_loops(steps: Sequence[LocatedStep]) -> dict[int, int]:
    """Of the last step of each loop without end: the step to which it leads, or END."""
    return {index: one.then for index, one in enumerate(steps) if one.then is not None}


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
        self._points: list[TrajectoryPoint] = []
        self._first = self._last = 0  # items of the terms or points so far
        self._aims: dict[int, HeadingCommand] = {}  # of the next step, by their items
        self._state = ANYWHERE  # after the steps so far
        self._stretch_begin = 0  # number of steps before those that follow one another now

    def read(self, seq: int, item: WireItem) -> None:
        handling = handling_of(item.command)
        if handling is Handling.REFUSED:
            raise MissionItemError(seq, _refusal_text(item.command), mavlink.MAV_MISSION_UNSUPPORTED)
        if handling is Handling.KEPT:
            return
        row = COMMAND[item.command]
        context = ItemContext(seq, item, self._home, self._state, row)
        if row.heading_command is not None:
            self._aims[seq] = row.heading_command(context)
            return
        if item.command not in (_TERM, _FACTOR, _RUN):
            self._expect_no_terms(seq - 1)
        context.expect_frame()
        if item.command == _TERM:
            self._term(context)
        elif item.command == _FACTOR:
            self._factor(context)
        elif item.command == _RUN:
            self._run(context)
        elif item.command == _POINT:
            self._point(context)
        else:
            for step in _steps(context, row):
                self._add(LocatedStep(seq, seq, step))

    def end_step(self, seq: int) -> None:
        """End the step of the terms or points up to item `seq`."""
        self.end_trajectory()
        self._expect_no_terms(seq)

    def _expect_no_terms(self, seq: int) -> None:
        """MissionItemError if there are terms without a run, which would be lost silently."""
        if self._terms:
            text = f"the load signal begun at item {self._first} has no run (31012) behind it"
            raise MissionItemError(seq, text, mavlink.MAV_MISSION_INVALID)

    def end_stretch(self, seq: int, then: int | None) -> None:
        """End the steps that follow one another with item `seq`, behind which the mission continues with step
        `then`; None: it ends."""
        self.end_step(seq)
        lands = Land if then not in (None, END) else Land | ReturnHome
        # a hold in which the nose turns if no step follows, unless the mission lands anyway
        if self._aims and self.steps and not isinstance(self.steps[-1].step, lands):
            self._add(LocatedStep(seq, seq, Delay(0.0)))
        self._aims = {}
        if then is not None and len(self.steps) > self._stretch_begin:
            self.steps[-1] = self.steps[-1]._replace(then=then)
            self._state = self._state.behind_loop()
        self._stretch_begin = len(self.steps)

    def check_loop(self, jump: int, then: int) -> None:
        """MissionItemError if what a `jump` without end flies from step `then` on takes no time until it
        comes back, or needs the load, which was released."""
        if then >= len(self.steps):
            raise _loop_error(jump)
        lap, following = [then], self._following(then)
        while lap[-1] != len(self.steps) - 1 and following != END and len(lap) < len(self.steps):
            lap.append(following)
            following = self._following(following)
        entries = tuple(timeline((self.steps[i].step for i in lap), self._state, self._return_to))
        for i, entry in zip(lap, entries, strict=True):
            if entry.before.released and isinstance(entry.step, LoadPath | AttitudeRun | Winch):
                text = (
                    f"needs the load, which is released before the jump without end (item {jump}) repeats it"
                )
                raise MissionItemError(self.steps[i].first, text, mavlink.MAV_MISSION_INVALID)
        if lap[-1] != len(self.steps) - 1:
            return  # it does not come back, but to another loop
        # in the air a take-off only moves the load
        lap_s = sum(one.transfer_s if isinstance(one.step, Takeoff) else one.duration_s for one in entries)
        if lap_s < _MIN_LAP_S:
            text = f"what a jump without end repeats must take at least {_MIN_LAP_S:g} s"
            raise MissionItemError(jump, text, mavlink.MAV_MISSION_INVALID)

    def _following(self, step: int) -> int:
        """The step that is flown after one of the steps so far, or END."""
        then = self.steps[step].then
        return step + 1 if then is None else then

    def _add(self, located: LocatedStep) -> None:
        if self._aims and not isinstance(located.step, Takeoff):  # on the ground no nose turns
            located = located._replace(aims=tuple(self._aims.items()))
            self._aims = {}
        self.steps.append(located)
        self._state = state_after(located.step, self._state, self._return_to)

    def _term(self, context: ItemContext) -> None:
        if len(self._terms) == MAX_TERMS:
            raise context.refusal(f"more than {MAX_TERMS} terms", mavlink.MAV_MISSION_NO_SPACE)
        term = context.record()
        if not self._terms:
            self._first = context.seq
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
        self._add(LocatedStep(self._first, context.seq, signals))
        self._terms = []

    def _point(self, context: ItemContext) -> None:
        context.expect_load()
        point = context.record()
        if not self._points:
            self._first = context.seq
            if point != ORIGIN:
                raise context.refusal("the first point of a trajectory (31014) must be at 0 s and 0, 0, 0 m")
        elif point.t_s - self._points[-1].t_s < SHORTEST_POINT_S - _ROUNDING_S:
            text = f"time = {point.t_s:g} s; must be {SHORTEST_POINT_S:g} s at least after the point before"
            raise context.refusal(text, mavlink.MAV_MISSION_INVALID_PARAM5_X)
        if len(self._points) == MAX_POINTS:
            raise context.refusal(f"more than {MAX_POINTS} points", mavlink.MAV_MISSION_NO_SPACE)
        self._points.append(point)
        self._last = context.seq

    def end_trajectory(self) -> None:
        """End the trajectory of the points so far, if there are any."""
        if len(self._points) == 1:
            text = "a trajectory (31014) needs two points at least"
            raise MissionItemError(self._first, text, mavlink.MAV_MISSION_INVALID)
        if self._points:
            trajectory = Trajectory(tuple(self._points))
            self._points = []
            self._add(LocatedStep(self._first, self._last, trajectory))


def _loop_error(jump: int) -> MissionItemError:
    text = "a jump without end must lead back to something that is flown"
    return MissionItemError(jump, text, mavlink.MAV_MISSION_INVALID)


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
