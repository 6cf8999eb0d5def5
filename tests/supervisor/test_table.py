"""The table of transitions: documented as it is, obeyed as documented, and bypassed by nothing."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from math import ceil
from pathlib import Path
from typing import Any

import pytest

from autopilot.guidance.legs import CatchLoad, LagWait
from autopilot.guidance.setpoint_follower import PositionSetpoint, SetpointStream
from autopilot.services import requests as R
from autopilot.supervisor import machine
from autopilot.supervisor.advance import advance
from autopilot.supervisor.machine import try_transition
from autopilot.supervisor.recovery import RestartState, resume_flight
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    CableState,
    Event,
    Flight,
    MissionPlan,
    MissionProgress,
    Phase,
    Setpoints,
    View,
    interrupt_mission,
)
from autopilot.supervisor.table import TRANSITIONS, markdown
from missions.model import Land, PlaceLoad, Step, Takeoff, Waypoint
from tests.doubles.sky import ACCEPTED, SETTINGS, entered, hanging, view

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "docs" / "architecture.md"
MACHINE = ROOT / "autopilot" / "supervisor" / "machine.py"
HERE = (1.0, 0.0, 2.0)
SECOND = 1_000_000
Entry = tuple[Phase, Event]

# ---- documented as it is


def documented() -> str:
    text = DOCUMENT.read_text()
    begin = text.index("| event |")
    return text[begin : text.index("\n\n", begin) + 1]


def table() -> dict[Entry, Phase]:
    """The table as documented."""
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in documented().splitlines()]
    phases = [Phase[name.replace(" ", "_").upper()] for name in rows[0][1:]]
    written = {}
    for event, *cells in rows[2:]:
        for phase, after in zip(phases, cells, strict=True):
            if after:
                written[(phase, Event(event))] = Phase[after.replace(" ", "_").upper()]
    return written


def test_the_document_shows_the_table() -> None:
    assert documented() == markdown()


@pytest.mark.parametrize(("phase", "event"), list(product(Phase, Event)))
def test_each_entry_of_the_table_and_each_that_is_not_there(phase: Phase, event: Event) -> None:
    expected = table().get((phase, event))
    assert TRANSITIONS.get((phase, event)) == expected
    after = try_transition(replace(on_mission(*STEPS), phase=phase), event, hanging(5 * SECOND), SETTINGS)
    if expected is None:
        assert after is None
    else:
        assert after is not None
        assert (after.phase, after.phase_start_us) == (expected, 5 * SECOND)
        assert bool(after.legs) == (expected in IN_AIR), (
            "there is something to fly in the air, and only there"
        )


def test_every_phase_can_be_left_and_reached() -> None:
    assert {phase for phase, _ in TRANSITIONS} == set(Phase)
    assert set(TRANSITIONS.values()) == set(Phase)


def test_who_disarms_selects_nothing_and_rewinds_the_mission() -> None:
    flight = entered(on_mission(*STEPS, step=1), Phase.SET_DOWN, hanging(), SETTINGS)
    after = try_transition(flight, Event.VEHICLE_DOWN, view(SECOND), SETTINGS)
    assert after is not None
    assert (after.mission.active, after.mission.step, after.legs) == (False, 0, ())
    assert after.mission.plan == flight.mission.plan


# ---- every entry happens: by requests to the vehicle, and by events in the world

STEPS = (Takeoff(2.0), Waypoint(3.0, 0.0, 2.0, hold_s=1.0), Land())


class Recording(dict[Entry, Phase]):
    """The table, which records the entries that were followed."""

    def __init__(self) -> None:
        super().__init__(TRANSITIONS)
        self.followed: list[Entry] = []

    def get(self, entry: Entry, default: Any = None) -> Any:
        if entry in self:
            self.followed.append(entry)
        return super().get(entry, default)


def on_mission(*steps: Step, step: int = 0) -> Flight:
    """A flight in HOLD on a mission of these steps; a setpoint has arrived."""
    plan = MissionPlan(steps, tuple(range(len(steps))), len(steps))
    return Flight(
        Phase.HOLD,
        mission=MissionProgress(plan, step, active=True, takeoff_altitude_m=4.0, speed_m_s=1.0),
        setpoints=Setpoints(offboard=SetpointStream(PositionSetpoint(HERE), 0)),
    )


def under_way(phase: Phase, *steps: Step, step: int = 0, active: bool = False) -> Flight:
    """A flight that has just entered a phase, over (1, 0, 2)."""
    flight = on_mission(*(steps or STEPS), step=step)
    if phase not in IN_AIR:
        return interrupt_mission(replace(flight, phase=phase))
    begun = entered(flight, phase, hanging(x=HERE), SETTINGS)
    return begun if active or phase == Phase.MISSION else interrupt_mission(begun)


def asked(flight: Flight, request: Any, seen: View | None = None) -> Flight:
    after, verdict = decide(flight, request, seen or hanging(SECOND // 10, HERE), SETTINGS)
    assert verdict.result == ACCEPTED, verdict.text
    return after


def flown(flight: Flight) -> Flight:
    """The flight after a tick at the end of its last leg, with the load where the leg ends."""
    leg = flight.legs[-1]
    flight = replace(flight, legs=(leg,), leg_start_us=0)
    return advance(flight, hanging(ceil(leg.duration_s * 1e6), leg.jet(leg.duration_s)[0]), SETTINGS)[0]


def landed(flight: Flight) -> Flight:
    """The flight after a tick in its last leg, long after the sinking load or vehicle has come to rest."""
    flight = replace(flight, legs=flight.legs[-1:], leg_start_us=0, condition_since_us=0)
    return advance(flight, view(20 * SECOND), SETTINGS)[0]


def catching(flight: Flight) -> Flight:
    """The flight while its load is caught; when it is advanced, the cable has been taut for a second."""
    catch = CatchLoad((1.0, 0.0, 2.7), 0.7, 0.3)
    return replace(flight, legs=(catch,), cable=replace(flight.cable, slack_since_us=0))


def armed(phase: Phase) -> Flight:
    return asked(under_way(phase), R.Arm(True, False), view())


def taken_off(phase: Phase) -> Flight:
    return asked(under_way(phase), R.Takeoff(2.0), view())


def taken_off_alone(phase: Phase) -> Flight:
    return asked(replace(under_way(phase), cable=CableState(released=True)), R.Takeoff(2.0), view())


def tautened(phase: Phase) -> Flight:
    flight = replace(under_way(phase), condition_since_us=0)
    return advance(replace(flight, legs=flight.legs[-1:]), hanging(SECOND, HERE), SETTINGS)[0]


def not_lifted(phase: Phase) -> Flight:
    """The cable has been slack for a moment, long after the lift began, and the load lies on the ground."""
    slack = replace(under_way(phase).cable, slack_since_us=2 * SECOND)
    return advance(replace(under_way(phase), cable=slack), view(2 * SECOND + 40_000), SETTINGS)[0]


def after_last_leg(phase: Phase) -> Flight:
    """A mission ends with its last step, another phase with its last leg."""
    return flown(under_way(phase, Waypoint(3.0, 0.0, 2.0)))


def next_step(phase: Phase) -> Flight:
    steps = (Takeoff(2.0), Waypoint(3.0, 0.0, 2.0), Waypoint(0.0, 0.0, 2.0), Land())
    if phase == Phase.LOWER:
        return asked(under_way(phase, *steps, step=3, active=True), R.SetCurrent(2))
    return flown(under_way(phase, *steps, step=0 if phase == Phase.LIFT else 1, active=True))


def landing_step(phase: Phase) -> Flight:
    if phase == Phase.LOWER:
        return asked(under_way(phase, Takeoff(2.0), Land(), step=1, active=True), R.SetCurrent(1))
    first: Step = Takeoff(2.0) if phase == Phase.LIFT else Waypoint(3.0, 0.0, 2.0)
    return flown(under_way(phase, first, Land(), active=True))


def mission_asked(phase: Phase) -> Flight:
    return asked(under_way(phase, step=1), R.StartMission(None))


def other_setpoint(phase: Phase) -> Flight:
    flight = asked(under_way(phase), R.FollowAttitude((0.0, 0.0, 1.0), None))
    return advance(flight, hanging(SECOND // 10, HERE), SETTINGS)[0]


def caught(phase: Phase) -> Flight:
    return advance(catching(under_way(phase)), hanging(SECOND, HERE), SETTINGS)[0]


def caught_up(phase: Phase) -> Flight:
    waiting = replace(under_way(phase), legs=(LagWait(HERE),))
    return advance(waiting, hanging(SECOND, HERE), SETTINGS)[0]


def load_down(phase: Phase) -> Flight:
    """The load is set down by LOWER; in other phases, where nothing lowers it, it has fallen."""
    if phase == Phase.LOWER:
        return landed(under_way(phase))
    return advance(catching(under_way(phase)), hanging(SECOND, (1.0, 0.0, 0.02)), SETTINGS)[0]


def placing() -> Flight:
    return under_way(Phase.LOWER, Takeoff(2.0), PlaceLoad(), Land(), step=1, active=True)


def landing_asked(phase: Phase) -> Flight:
    """Of a landing that has begun nothing begins again; a load that is only placed is landed with."""
    return asked(placing() if phase == Phase.LOWER else under_way(phase), R.Land())


def vehicle_down(phase: Phase) -> Flight:
    if phase == Phase.SET_DOWN:
        return landed(under_way(phase))
    alone = replace(on_mission(*STEPS), cable=CableState(released=True))
    return landed(interrupt_mission(entered(alone, phase, hanging(x=HERE), SETTINGS)))


CAUSES: dict[Event, Callable[[Phase], Flight]] = {
    Event.ARM: armed,
    Event.DISARM: lambda phase: asked(under_way(phase), R.Arm(False, True)),
    Event.TAKEOFF: taken_off,
    Event.TAKEOFF_ALONE: taken_off_alone,
    Event.TAUT: tautened,
    Event.NOT_LIFTED: not_lifted,
    Event.DONE: after_last_leg,
    Event.STEP: next_step,
    Event.LAND_STEP: landing_step,
    Event.HOLD: lambda phase: asked(under_way(phase), R.Pause()),
    Event.MISSION: mission_asked,
    Event.GUIDE: lambda phase: asked(under_way(phase), R.Orbit(2.0, 0.5, None, None, None)),
    Event.OTHER_SETPOINT: other_setpoint,
    Event.RETURN: lambda phase: asked(under_way(phase), R.ReturnHome()),
    Event.LAND: landing_asked,
    Event.CAUGHT: caught,
    Event.CAUGHT_UP: caught_up,
    Event.RELEASED: lambda phase: asked(under_way(phase), R.Release()),
    Event.LOAD_DOWN: load_down,
    Event.LOAD_PLACED: lambda phase: landed(placing()),
    Event.VEHICLE_DOWN: vehicle_down,
    Event.FOUND_IN_FLIGHT: lambda phase: resume_flight(
        under_way(phase), RestartState(5.0, 0.0, False), hanging(SECOND), SETTINGS
    ),
    Event.FAIL: lambda phase: asked(under_way(phase), R.Terminate()),
}


@pytest.mark.parametrize(("phase", "event"), sorted(TRANSITIONS, key=str))
def test_every_entry_of_the_table_happens_in_flight(
    phase: Phase, event: Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    recording = Recording()
    monkeypatch.setattr(machine, "TRANSITIONS", recording)
    after = CAUSES[event](phase)
    assert recording.followed == [(phase, event)]
    assert after.phase == TRANSITIONS[(phase, event)]


@pytest.mark.parametrize("phase", sorted(CARRYING | {Phase.TAUTEN}))
def test_a_mission_at_its_landing_is_begun_only_where_the_table_has_a_landing(phase: Phase) -> None:
    """While the cable is being tautened there is no load to lower: the vehicle is set down."""
    flight = under_way(phase, Takeoff(2.0), Land(), step=1)
    after, verdict = decide(flight, R.StartMission(None), hanging(SECOND, HERE), SETTINGS)
    expected = TRANSITIONS.get((phase, Event.LAND)) if phase != Phase.MISSION else phase
    assert (verdict.result == ACCEPTED) == (expected is not None)
    assert after.phase == (phase if expected is None else expected)


# ---- nothing enters a phase without it


def entries(tree: ast.AST) -> list[int]:
    """Lines at which a phase is entered: a record gets one, or a private function of the machine is used."""
    found = []
    told = {
        id(inner)  # a name in a decorator states what the function reads or returns
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for decorator in function.decorator_list
        for inner in ast.walk(decorator)
    }
    for node in ast.walk(tree):
        match node:
            case ast.Constant() if id(node) in told:
                continue
            case ast.Call(func=ast.Name(id="Flight"), args=[_, *_]):
                found.append(node.lineno)
            case ast.Call(keywords=keywords) if any(k.arg in ("phase", None) for k in keywords):
                if isinstance(node.func, ast.Name) and node.func.id in ("replace", "Flight"):
                    found.append(node.lineno)
            case ast.ImportFrom(module="autopilot.supervisor.machine", names=names):
                found += [node.lineno for alias in names if alias.name.startswith("_")]
            case ast.Attribute(value=ast.Name(id="machine"), attr=attr) if attr.startswith("_"):
                found.append(node.lineno)
            case ast.Constant(value="phase") if isinstance(node.value, str):
                found.append(node.lineno)  # for setattr, or as a key of a dict that is unpacked into a record
    return found


def knows_flight(tree: ast.AST) -> bool:
    """Whether a module imports anything of the supervisor."""
    imports = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return any(name.startswith("autopilot.supervisor") for name in imports)


def test_nothing_but_the_machine_enters_a_phase() -> None:
    wrong = {}
    for room in ("autopilot", "gcs/sweep"):
        for path in sorted((ROOT / room).rglob("*.py")):
            tree = ast.parse(path.read_text())
            speaks = any(
                "supervisor" in (n.module or "") for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)
            )
            lines = entries(tree) if speaks and path != MACHINE else []
            if lines:
                wrong[str(path.relative_to(ROOT))] = lines
    assert not wrong
    assert entries(ast.parse(MACHINE.read_text())), "the machine itself does"


@pytest.mark.parametrize(
    "line",
    [
        "replace(flight, phase=Phase.HOLD)",
        "Flight(Phase.HOLD)",
        "Flight(phase=Phase.HOLD)",
        "replace(flight, **{'phase': Phase.HOLD})",
        "from autopilot.supervisor.machine import _enter_phase",
        "machine._enter_phase(flight, Phase.HOLD, view, settings)",
        "object.__setattr__(flight, 'phase', Phase.HOLD)",
    ],
)
def test_a_way_around_the_machine_is_caught(line: str) -> None:
    assert entries(ast.parse(line))
