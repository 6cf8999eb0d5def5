"""The ticks that pass without the supervisor: at each of them it would have changed nothing.

The tests advance flights at every tick and check whether the supervisor was needed there: in a `Sky` that
does as it is told, with each view disturbed in every way to which the supervisor reacts, and in the
simulated world, where the core itself determines when to call the supervisor.
"""

from __future__ import annotations

import math
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import replace

import pytest

from autopilot.control.records import State
from autopilot.core.flight_core import with_cable_now
from autopilot.geometry.linear import IDENTITY, ZERO, Vec3
from autopilot.guidance.setpoint_follower import UNSPECIFIED
from autopilot.services import identity
from autopilot.services.records import Verdict
from autopilot.services.requests import (
    Arm,
    FollowAttitude,
    FollowSetpoint,
    FollowStick,
    Land,
    LookAt,
    Orbit,
    Pause,
    Release,
    Reposition,
    ReturnHome,
    SetMode,
    StartMission,
    Terminate,
    TurnHeading,
)
from autopilot.services.requests import Takeoff as TakeoffRequest
from autopilot.services.requests import Winch as WinchRequest
from autopilot.supervisor.advance import advance
from autopilot.supervisor.quiescence import UNCONTROLLED, Stretch, may_need_decision, next_stretch
from autopilot.supervisor.state import Flight, Phase, Report, View, setpoint
from autopilot.trajectory.timeline import min_move_duration
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import Disc, Fence
from missions import model
from missions.fileformat import load_mission, shipped
from missions.model import AttitudeRun, Delay, Signals, Speed, Step, Takeoff, Term, Waypoint, Winch
from tests.doubles.craft import Craft, at_phase
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, HeadWind, Sky

WEIGHT = SETTINGS.load_weight_n
EVERY = 9  # all disturbances are tried once in this many ticks
OFFBOARD, POSCTL = SetMode(identity.OFFBOARD, 0), SetMode(identity.POSCTL, 0)


def asks(flight: Flight, stretch: Stretch, seen: View) -> bool:
    """Whether the supervisor is called at a tick of the stretch."""
    jet = None if stretch.mode == UNCONTROLLED else setpoint(flight, seen.now_us)
    state = State(seen.x_load, seen.v_load, (0.0, 0.0, -1.0), ZERO, seen.x_quad, seen.v_quad, IDENTITY, ZERO)
    target = ZERO if jet is None else jet[0]
    known = not seen.estimate_problems
    return seen.rotors_lost != stretch.rotors_lost or may_need_decision(
        stretch,
        seen.now_us,
        state,
        known,
        seen.taut,
        seen.load_tracked,
        seen.tilt_rad,
        seen.pull_n,
        target,
    )


# ---- in a sky that does as it is told


def moved(x: Vec3, *by: float) -> Vec3:
    return (x[0] + by[0], x[1] + by[1], x[2] + by[2])


DISTURBANCES: dict[str, Callable[[View], View]] = {
    "slack": lambda v: v._replace(taut=False),
    "slack, not felt": lambda v: v._replace(taut=False, pull_n=math.nan),
    "taut, not felt": lambda v: v._replace(taut=True, pull_n=math.nan),
    "taut and pulling": lambda v: v._replace(taut=True, pull_n=WEIGHT),
    "taut without a pull": lambda v: v._replace(taut=True, pull_n=-0.2 * WEIGHT),
    "shortened": lambda v: v._replace(x_quad=moved(v.x_quad, 0.0, 0.0, -0.02), pull_n=0.0),
    "pulling hard": lambda v: v._replace(pull_n=5.0 * WEIGHT),
    "tilted": lambda v: v._replace(tilt_rad=math.radians(130.0)),
    "tilted a little": lambda v: v._replace(tilt_rad=math.radians(50.0)),
    "tilt is no number": lambda v: v._replace(tilt_rad=math.nan),
    "vehicle is nowhere": lambda v: v._replace(x_quad=(0.0, math.nan, 0.0)),
    "load is nowhere": lambda v: v._replace(x_load=(math.inf, 0.0, 0.0)),
    "vehicle without speed": lambda v: v._replace(v_quad=(0.0, 0.0, math.nan)),
    "load without speed": lambda v: v._replace(v_load=(math.nan, 0.0, 0.0)),
    "not known": lambda v: v._replace(estimate_problems=("no load position from a tracker",)),
    "both far off": lambda v: v._replace(
        x_quad=moved(v.x_quad, 5.1, 0.0, 0.0), x_load=moved(v.x_load, 5.1, 0.0, 0.0)
    ),
    "both a little off": lambda v: v._replace(
        x_quad=moved(v.x_quad, 0.0, 0.3, 0.0), x_load=moved(v.x_load, 0.0, 0.3, 0.0)
    ),
    "carried off": lambda v: v._replace(
        x_quad=moved(v.x_quad, 6.0, 0.0, 0.0), v_quad=(1.0, 0.0, 0.0), x_load=moved(v.x_load, 6.0, 0.0, 0.0)
    ),
    "load dragged away": lambda v: v._replace(x_load=moved(v.x_load, 6.0, 0.0, 0.0), v_load=(1.0, 0.0, 0.0)),
    "load beside": lambda v: v._replace(x_load=moved(v.x_load, 0.1, 0.0, 0.0)),
    "load does not sink": lambda v: v._replace(x_load=moved(v.x_load, 0.0, 0.0, 0.2)),
    "load sinks": lambda v: v._replace(x_load=moved(v.x_load, 0.0, 0.0, -0.2)),
    "vehicle does not sink": lambda v: v._replace(x_quad=moved(v.x_quad, 0.0, 0.0, 0.2), v_quad=ZERO),
    "vehicle bobs": lambda v: v._replace(x_quad=moved(v.x_quad, 0.0, 0.0, 0.2), v_quad=(0.0, 0.0, 0.3)),
    "vehicle sinks": lambda v: v._replace(x_quad=moved(v.x_quad, 0.0, 0.0, -0.3)),
    "height unsure": lambda v: v._replace(height_std=0.5),
}


class Watched(Sky):
    """A sky that is advanced at every tick, and counts the ticks at which the supervisor was not needed."""

    def __init__(self, *steps: Step, rough: int | None = None, tied: bool = True) -> None:
        super().__init__(*steps)
        self._tied = tied
        self.stretch: Stretch | None = None
        self.passed: Counter[Phase] = Counter()
        self.decided: Counter[Phase] = Counter()
        self.heeded: Counter[str] = Counter()  # disturbances to which the supervisor reacts
        self._rough = None if rough is None else random.Random(rough)

    def ask(self, request: object) -> Verdict:
        self.stretch = None
        return super().ask(request)

    def obey(self) -> View:
        seen = super().obey()
        taut = seen.taut and self._tied
        seen = seen._replace(taut=taut, pull_n=WEIGHT if taut else 0.0)
        if self._rough is None or not self.flight.legs:
            return seen
        chance = self._rough
        return seen._replace(
            x_quad=moved(seen.x_quad, *(chance.gauss(0.0, 0.003) for _ in range(3))),
            x_load=moved(seen.x_load, *(chance.gauss(0.0, 0.003) for _ in range(3))),
            taut=seen.taut and chance.random() > 0.02,
            pull_n=seen.pull_n + WEIGHT * chance.gauss(0.0, 0.5),
        )

    def tick(self) -> None:
        self._reel()
        before, told = self.flight, (len(self.texts), len(self.reached))
        super().tick()
        if self.stretch is not None and not asks(before, self.stretch, self.view):
            assert self.flight == before, (self.view, self.stretch)
            assert (len(self.texts), len(self.reached)) == told
            self.passed[before.phase] += 1
            if sum(self.passed.values()) % EVERY == 0:
                self._disturb(self.stretch)
            return
        self.decided[before.phase] += 1
        self.stretch = next_stretch(self.flight, self.settings, self.now_us, STEP_US, 0.0)

    def _reel(self) -> None:
        """Set the cable to the length that the winch gives it at the next tick."""
        self.flight = with_cable_now(self.flight, self.now_us + STEP_US)
        if self.stretch is not None:
            self.stretch = self.stretch._replace(taut_length=self.flight.cable.taut_length_m)
        length = self.flight.cable.length_m
        if length is not None and length != self.settings.cable_length_m:
            least_s = min_move_duration(length, self.settings.gravity_m_s2)
            self.settings = replace(self.settings, cable_length_m=length, min_move_s=least_s)

    def _disturb(self, stretch: Stretch) -> None:
        """Whatever the view: where the supervisor is not called, it would have changed nothing."""
        for name, disturbed in DISTURBANCES.items():
            seen = disturbed(self.view)
            same = advance(self.flight, seen, self.settings) == (self.flight, Report())
            self.heeded[name] += not same
            assert same or asks(self.flight, stretch, seen), (name, self.flight.phase, seen, stretch)


def ended(sky: Watched) -> Watched:
    """Fly until the rotors stop, and watch for a little longer."""
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    sky.wait(0.5)
    return sky


def flown(sky: Watched) -> Watched:
    """Fly the mission from the ground to the ground."""
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    return ended(sky)


def led(sky: Watched, request: object, seconds: float) -> None:
    for _ in range(round(seconds * 1e6 / STEP_US)):
        assert sky.ask(request).result == ACCEPTED
        sky.tick()


def after(sky: Watched, *requests: object, wait_s: float = 3.0) -> Watched:
    """Take off, then make one request after the other."""
    sky.airborne()
    for request in requests:
        verdict = sky.ask(request)
        assert verdict.result == ACCEPTED, verdict.text
        sky.wait(wait_s)
    return sky


def landed(sky: Watched) -> Watched:
    assert sky.ask(Land()).result == ACCEPTED
    return ended(sky)


SWING = Signals(4.0, (Term("x", 0.5, 0.5, 0.5, 1.0, 0.5),))
RUN = AttitudeRun("vehicle", 0.1, 0.0, 1.5)
EVERY_STEP = (
    Takeoff(2.0),
    Delay(1.0),
    Speed(0.8),
    Waypoint(1.0, 2.0, 2.5, hold_s=0.5),
    Winch(0.4),
    Delay(0.5),
    Winch(-0.4),
    SWING,
    RUN,
    AttitudeRun("load", 0.1, 0.0, 1.0),
    model.ReturnHome(),
    model.Land(),
)
TO_GROUND = {Phase.LIFT, Phase.LOWER, Phase.DISARMED}
WHOLE = TO_GROUND | {Phase.TAUTEN, Phase.MISSION, Phase.SET_DOWN}


def steps_of(name: str) -> tuple[Step, ...]:
    """The steps of a shipped mission."""
    return load_mission(name).steps


def every_step() -> Watched:
    return flown(Watched(*EVERY_STEP))


def delivery() -> Watched:
    return flown(Watched(Takeoff(1.5), Waypoint(1.0, 0.0, 1.0), model.Release(), Delay(1.0), model.Land()))


def return_home() -> Watched:
    return ended(after(Watched(), Reposition(2.0, 1.0, 3.0, True), ReturnHome(), wait_s=1.5))


def released_in_hold() -> Watched:
    return landed(after(Watched(), Release(), Reposition(1.0, 0.0, 2.0, True)))


def winch_and_hold() -> Watched:
    return landed(after(Watched(), WinchRequest(0.5), Pause()))


def winch_to_its_end() -> Watched:
    return landed(after(Watched(), WinchRequest(0.5), Reposition(1.0, 0.0, 2.0, True), wait_s=9.0))


def circle_and_stick() -> Watched:
    sky = after(Watched(), Orbit(2.0, 1.0, None, None, None, 0.5), wait_s=12.0)
    led(sky, FollowStick((0.5, 0.0, 0.0)), 0.2)
    assert sky.ask(POSCTL).result == ACCEPTED
    led(sky, FollowStick((0.5, 0.0, 0.0)), 1.0)
    sky.wait(4.0)  # the stick falls silent
    return landed(sky)


def attitudes() -> Watched:
    sky = Watched().airborne()
    assert isinstance(sky, Watched)
    led(sky, FollowAttitude((0.0, 0.05, 1.0), None), 0.2)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    led(sky, FollowAttitude((0.0, 0.05, 1.0), None), 1.0)
    assert sky.ask(Pause()).result == ACCEPTED
    sky.wait(6.0)
    return landed(sky)


def turns() -> Watched:
    """Ticks pass while the nose rests; while it turns, the supervisor decides at every tick."""
    sky = after(Watched(), TurnHeading(1.5), wait_s=10.0)
    passed = sky.passed[Phase.HOLD]
    assert passed > 0
    sky.wait(1.0)
    assert sky.passed[Phase.HOLD] > passed
    assert sky.ask(LookAt(3.0, 3.0)).result == ACCEPTED
    sky.tick()  # the request has ended the last stretch
    passed = sky.passed[Phase.HOLD]
    sky.wait(1.0)
    assert sky.passed[Phase.HOLD] == passed
    return landed(sky)


def offboard_rise() -> Watched:
    sky = Watched()
    low, high = (FollowSetpoint((0.0, 0.0, z), UNSPECIFIED, UNSPECIFIED, False) for z in (0.0, 1.5))
    led(sky, low, 0.2)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    led(sky, low, 0.5)
    assert sky.flight.phase == Phase.ARMED
    led(sky, high, 15.0)
    assert sky.flight.phase == Phase.GUIDED
    sky.wait(3.0)
    return landed(sky)


def fenced() -> Watched:
    sky = Watched(Takeoff(2.0), Waypoint(4.0, 0.0, 2.0))
    zones = Fence((Disc(True, (0.0, 0.0), 3.0),))
    east = FollowSetpoint(UNSPECIFIED, (1.5, 0.0, 0.0), UNSPECIFIED, False)
    sky.flight = replace(sky.flight, area=replace(sky.flight.area, fence=zones))
    sky.airborne()
    led(sky, east, 0.1)
    assert sky.ask(OFFBOARD).result == ACCEPTED
    for _ in range(400):
        sky.ask(east)
        sky.tick()
    assert sky.texts[-1] == "Fence: would stop outside the fence, holding"
    return landed(sky)


def never_taut() -> Watched:
    sky = Watched(tied=False)
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    ended(sky)
    assert any("never taut" in text for text in sky.texts)
    return sky


def long_cable() -> Watched:
    sky = Watched(Takeoff(2.0), model.Land())
    sky.settings = replace(sky.settings, cable_length_m=20.0)
    return flown(sky)


class Lagging(Watched, HeadWind):
    """A sky with a head wind that is watched."""


def lagging() -> Watched:
    sky = Lagging(
        Takeoff(3.0), Speed(5.0), Waypoint(60.0, 0.0, 3.0), model.Release(), Speed(5.0), model.ReturnHome()
    )
    flown(sky)
    assert any(text.startswith("Path waits: load") for text in sky.texts)
    assert any(text.startswith("Path waits: vehicle") for text in sky.texts)
    return sky


class Shaken(Watched):
    """A sky in which a gust throws vehicle and load about for a fifth of each second."""

    def obey(self) -> View:
        seen = super().obey()
        if self.flight.phase != Phase.HOLD or seen.now_us % 1_000_000 >= 200_000:
            return seen
        return DISTURBANCES["both far off"](seen)._replace(tilt_rad=math.radians(80.0))


def shaken() -> Watched:
    sky = after(Shaken(), wait_s=5.0)
    sky.wait(5.0)
    assert not any("given up" in text for text in sky.texts)
    return landed(sky)


class Crippled(Watched):
    """A sky in which a rotor is lost while the load is held, and the vehicle lands nevertheless."""

    def obey(self) -> View:
        lost = 0 if self.flight.phase in (Phase.DISARMED, Phase.TAUTEN, Phase.LIFT) else 1
        return super().obey()._replace(rotors_lost=lost)


def crippled() -> Watched:
    sky = Crippled(Takeoff(2.0))
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    assert sky.ask(TakeoffRequest(2.0)).result == ACCEPTED
    return ended(sky)


def given_up() -> Watched:
    sky = after(Watched(), Terminate(), wait_s=4.0)
    assert sky.flight.phase == Phase.DISARMED
    return sky


def left_armed() -> Watched:
    sky = Watched()
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.wait(11.0)
    assert sky.flight.phase == Phase.DISARMED
    return sky


# the flights, and the phases in which each passes ticks without the supervisor
SKIES: dict[Callable[[], Watched], set[Phase]] = {
    every_step: WHOLE,
    delivery: WHOLE - {Phase.SET_DOWN},
    return_home: TO_GROUND | {Phase.HOLD, Phase.RETURN, Phase.TAUTEN, Phase.SET_DOWN},
    released_in_hold: TO_GROUND | {Phase.HOLD},
    winch_and_hold: TO_GROUND | {Phase.HOLD},
    winch_to_its_end: TO_GROUND | {Phase.HOLD},
    circle_and_stick: TO_GROUND | {Phase.HOLD},
    attitudes: TO_GROUND | {Phase.HOLD},
    turns: {Phase.DISARMED, Phase.HOLD, Phase.LIFT},
    offboard_rise: {Phase.DISARMED, Phase.HOLD, Phase.LOWER, Phase.SET_DOWN},
    fenced: {Phase.DISARMED, Phase.TAUTEN, Phase.SET_DOWN},
    never_taut: {Phase.TAUTEN, Phase.SET_DOWN, Phase.DISARMED},
    lagging: TO_GROUND | {Phase.TAUTEN, Phase.MISSION},
    long_cable: TO_GROUND | {Phase.TAUTEN, Phase.SET_DOWN},
    shaken: TO_GROUND | {Phase.HOLD},
    crippled: {Phase.LIFT, Phase.TAUTEN, Phase.DISARMED},
    given_up: {Phase.FAILSAFE, Phase.HOLD, Phase.DISARMED},
    left_armed: {Phase.ARMED, Phase.DISARMED},
}


def test_the_flights_pass_ticks_in_every_phase() -> None:
    """Except in GUIDED, where each tick follows a setpoint."""
    assert set().union(*SKIES.values()) == set(Phase) - {Phase.GUIDED}
    assert set().union(*WORLDS.values()) == set(Phase) - {Phase.GUIDED}


def name_of(flight: object) -> str:
    return getattr(flight, "__name__", "")


@pytest.mark.parametrize("fly", SKIES, ids=name_of)
def test_what_passes_would_not_have_been_decided(fly: Callable[[], Watched]) -> None:
    sky = fly()
    assert {phase for phase in SKIES[fly] if not sky.passed[phase]} == set()


def test_a_tick_between_those_that_are_laid_out_is_decided_upon() -> None:
    """No setpoint is laid out for it."""
    sky = Watched().airborne()
    stretch = next_stretch(sky.flight, sky.settings, sky.now_us, STEP_US, 0.0)
    for late_us, asked in (
        (STEP_US, False),
        (STEP_US + 1, True),
        (2 * STEP_US - 1, True),
        (2 * STEP_US, False),
    ):
        seen = sky.view._replace(now_us=sky.now_us + late_us)
        assert asks(sky.flight, stretch, seen) == asked, late_us


def test_every_disturbance_is_one_that_the_supervisor_heeds() -> None:
    sky = flown(Watched(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0, hold_s=1.0), model.Land()))
    unheeded = {name for name in DISTURBANCES if not sky.heeded[name]}
    assert unheeded == {"pulling hard", "tilted a little", "height unsure"}


@pytest.mark.parametrize("name", shipped())
def test_of_a_shipped_mission_nearly_every_tick_passes(name: str) -> None:
    """Except while an attitude is flown: then the supervisor decides at every tick."""
    steps = steps_of(name)
    sky = flown(Watched(*steps))
    least = 0.8 if any(isinstance(step, AttitudeRun) for step in steps) else 0.95
    assert sky.passed.total() > least * (sky.passed + sky.decided).total()


@pytest.mark.parametrize("seed", range(4))
def test_in_rough_air_too(seed: int) -> None:
    """The cable seems slack for a tick or two, and positions are noisy."""
    sky = Watched(Takeoff(2.0), Waypoint(1.0, 0.0, 2.0, hold_s=1.0), SWING, model.Land(), rough=seed)
    assert sky.ask(StartMission(None)).result == ACCEPTED
    assert sky.ask(Arm(True, False)).result == ACCEPTED
    sky.wait(40.0)
    assert "Cable slack: falling with the load to catch it" in sky.texts
    assert sky.passed[Phase.LIFT] > 50
    assert sky.passed.total() > 0.5 * (sky.passed + sky.decided).total()


# ---- in the simulated world, where the core calls the supervisor

WORLD_OFFBOARD = (1.0, 6.0)  # of DO_SET_MODE


class Witness:
    """A craft; where its core passes a tick without the supervisor, the supervisor is called to check."""

    def __init__(self, craft: Craft) -> None:
        self.craft = craft
        self.passed: Counter[Phase] = Counter()
        self.decided: Counter[Phase] = Counter()
        core = craft.onboard.core
        step, decide = core.step, core.decide
        asked = False

        def decided(now_us: int, period_us: int) -> Report:
            nonlocal asked
            asked = True
            return decide(now_us, period_us)

        def stepped(count: int, now_us: int, tick: int, dt: float) -> Report:
            nonlocal asked
            asked = False
            phase = core.flight.phase
            report = step(count, now_us, tick, dt)
            if tick % core.setup.control_every != 0:
                assert not asked
            elif asked:
                self.decided[phase] += 1
            else:
                seen = core.view(now_us, with_pull=True)
                assert advance(core.flight, seen, core.settings) == (core.flight, Report()), (phase, seen)
                assert report == Report()
                self.passed[phase] += 1
            return report

        core.step, core.decide = stepped, decided  # type: ignore[method-assign]

    @property
    def share(self) -> float:
        """Share of the ticks that passed without the supervisor."""
        return self.passed.total() / (self.passed + self.decided).total()


def witnessed(*steps: Step, **settings: float) -> Witness:
    return Witness(Craft(*steps, **settings))


def held(height: float = 2.0, **settings: float) -> Witness:
    """Take off by command, and hold."""
    witness = witnessed(**settings)
    craft = witness.craft
    craft.wait(1.0)
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    takeoff = (0.0, 0.0, 0.0, 0.0, math.nan, math.nan, height)
    assert craft.command(mavlink.MAV_CMD_NAV_TAKEOFF, *takeoff) == ACCEPTED
    craft.run(at_phase(Phase.HOLD))
    return witness


def mission(*steps: Step, **settings: float) -> Witness:
    """Fly the mission from the ground to the ground."""
    witness = witnessed(*steps, **settings)
    witness.craft.begin()
    witness.craft.run(at_phase(Phase.DISARMED), 120.0)
    return witness


def lead(craft: Craft, seconds: float, north: float, east: float, up: float) -> None:
    """Stream a velocity, ten times a second."""
    end_us = craft.onboard.now_us + round(seconds * 1e6)
    while craft.onboard.now_us < end_us:
        velocity = (north, east, -up)
        craft.send(
            mavlink.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, 1, 0xDC7, 0, 0, 0, *velocity, 0, 0, 0, 0, 0
            )
        )
        craft.wait(0.1)


def world_delivery() -> Witness:
    return mission(*steps_of("delivery"))


def world_return() -> Witness:
    witness = held(CTL_LAW=2.0)
    craft = witness.craft
    craft.wait(2.0)
    assert craft.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    craft.run(at_phase(Phase.DISARMED))
    return witness


def world_lag() -> Witness:
    """A vehicle alone that is too weak for its speed against the wind."""
    steps = (Takeoff(1.5), model.Release(), Speed(10.0), Waypoint(-100.0, 0.0, 5.0), model.Land())
    witness = mission(*steps, SIM_WIND_E=12.0)
    assert any(text.startswith("Path waits: vehicle") for text in witness.craft.texts)
    assert witness.craft.flight.mission.done
    return witness


def world_catch() -> Witness:
    """A load that is struck upwards, and caught."""
    witness = witnessed(Takeoff(5.0), Delay(15.0), model.Land(), CTL_LAW=2.0)
    craft = witness.craft
    craft.begin()
    craft.run(at_phase(Phase.MISSION))
    craft.wait(2.0)
    world = craft.world
    world.state = world.state._replace(v_load=(0.0, 0.0, world.state.v_load[2] + 2.0), taut=0.0)
    craft.run(lambda c: "Load caught" in c.texts)
    craft.run(at_phase(Phase.DISARMED))
    return witness


def world_winch() -> Witness:
    witness = held()
    assert witness.craft.command(42600, 1.0, 1.0, 0.5, 0.3) == ACCEPTED  # DO_WINCH, by a length
    witness.craft.wait(6.0)
    assert witness.craft.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    witness.craft.run(at_phase(Phase.DISARMED))
    return witness


def world_fence() -> Witness:
    """OFFBOARD from the ground, up and into the fence."""
    witness = witnessed(GF_MAX_HOR_DIST=2.0)
    craft = witness.craft
    craft.wait(1.0)
    lead(craft, 0.3, 0.0, 0.0, 0.0)
    assert craft.command(mavlink.MAV_CMD_DO_SET_MODE, *WORLD_OFFBOARD) == ACCEPTED
    assert craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    lead(craft, 1.0, 0.0, 0.0, 0.0)
    assert craft.flight.phase == Phase.ARMED
    craft.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, 0xDF8, 0.0, 0.0, -1.5, 0, 0, 0, 0, 0, 0, 0, 0
        )
    )
    craft.run(lambda c: c.flight.phase not in (Phase.ARMED, Phase.TAUTEN, Phase.LIFT))
    lead(craft, 0.3, 1.0, 0.0, 0.0)
    assert craft.command(mavlink.MAV_CMD_DO_SET_MODE, *WORLD_OFFBOARD) == ACCEPTED
    lead(craft, 5.0, 1.0, 0.0, 0.0)
    assert any(text.startswith("Fence: ") for text in craft.texts)
    assert craft.flight.phase == Phase.HOLD
    return witness


def world_given_up() -> Witness:
    witness = held(1.0)
    witness.craft.wait(1.0)
    assert witness.craft.command(mavlink.MAV_CMD_DO_FLIGHTTERMINATION, 1.0) == ACCEPTED
    witness.craft.run(at_phase(Phase.DISARMED))
    witness.craft.wait(1.0)
    return witness


def world_left_armed() -> Witness:
    witness = witnessed()
    witness.craft.wait(1.0)
    assert witness.craft.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    witness.craft.wait(11.0)
    assert witness.craft.flight.phase == Phase.DISARMED
    return witness


WORLDS: dict[Callable[[], Witness], set[Phase]] = {
    world_delivery: WHOLE - {Phase.SET_DOWN},
    world_return: {Phase.HOLD, Phase.RETURN, Phase.LOWER, Phase.SET_DOWN},
    world_lag: WHOLE - {Phase.SET_DOWN},
    world_catch: WHOLE,
    world_winch: TO_GROUND | {Phase.HOLD},
    world_fence: {Phase.DISARMED, Phase.TAUTEN},
    world_given_up: {Phase.HOLD, Phase.FAILSAFE, Phase.DISARMED},
    world_left_armed: {Phase.DISARMED, Phase.ARMED},
}


@pytest.mark.parametrize("fly", WORLDS, ids=name_of)
def test_what_the_core_lets_pass_would_not_have_been_decided(fly: Callable[[], Witness]) -> None:
    witness = fly()
    assert {phase for phase in WORLDS[fly] if not witness.passed[phase]} == set()


def test_of_case_b_nearly_every_tick_passes() -> None:
    """With the default rotors and sensors; measured: the supervisor decides at 441 of 21,580 ticks."""
    witness = mission(*steps_of("case-b"))
    assert witness.craft.flight.mission.done
    assert witness.share > 0.9
