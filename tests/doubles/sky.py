"""The supervisor in a world that does as it is told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

from autopilot.control.laws import build_law, chosen_law
from autopilot.geometry.linear import ZERO, Vec3, add, norm, scale, sub
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION
from autopilot.services.records import Verdict
from autopilot.services.requests import Arm, Takeoff
from autopilot.supervisor.advance import advance
from autopilot.supervisor.machine import start_phase_legs
from autopilot.supervisor.mission import with_plan
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.requests.verdicts import ACCEPTED as ACCEPTANCE
from autopilot.supervisor.settings import Settings, settings_from
from autopilot.supervisor.state import CARRYING, IN_AIR, Flight, MissionPlan, Phase, View
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.items import encode_steps, located_steps
from missions.model import Step

ACCEPTED = ACCEPTANCE.result
TABLE = autopilot_parameters(load_vehicle("bebop"))
LAW = chosen_law(TABLE)
SETTINGS = settings_from(TABLE, LAW.ramp_lag_s(build_law(TABLE)), LAW.supports_reeling, LAW.follows_shaped)
STEP_US = 20_000
LOAD_RADIUS, GEAR = 0.02, 0.06


def view(now_us: int = 0, **changes: Any) -> View:
    """A vehicle that stands beside its load, all well."""
    seen = View(now_us, (0.1, 0.0, GEAR), ZERO, (0.0, 0.0, LOAD_RADIUS), ZERO, False, 0.0, ())
    return seen._replace(**changes)


def hanging(now_us: int = 0, x: Vec3 = (0.0, 0.0, 2.0), v: Vec3 = ZERO, **changes: Any) -> View:
    """A load that hangs still under its vehicle, or moves along with it."""
    over = (x[0], x[1], x[2] + SETTINGS.cable_length_m)
    return View(now_us, over, v, x, v, True, 0.0, ())._replace(**changes)


def entered(flight: Flight, phase: Phase, seen: View, settings: Settings) -> Flight:
    """The flight as it begins a phase, whether or not the table leads there."""
    begun = replace(flight, phase=phase, phase_start_us=seen.now_us, condition_since_us=-1, following=())
    return start_phase_legs(begun, seen, settings) if phase in IN_AIR else replace(begun, legs=())


class Sky:
    """Load and vehicle are where the present leg commands them to be, as far as ground and cable allow."""

    def __init__(self, *steps: Step, settings: Settings = SETTINGS) -> None:
        items = encode_steps(steps, Home()) if steps else ()
        located = located_steps(items, Home())
        plan = MissionPlan(tuple(s.step for s in located), tuple(s.last for s in located), len(items))
        self.steps = steps
        self.flight = with_plan(Flight(), plan)
        self.settings = settings
        self.now_us = 0
        self.view = view()
        self.texts: list[str] = []
        self.reached: list[int] = []
        self.phases: list[Phase] = []
        self.setpoints: list[tuple[float, int, Any]] = []  # time, control mode, jet

    def ask(self, request: Any) -> Verdict:
        self.flight, verdict = decide(self.flight, request, self.view, self.settings)
        return verdict

    def tick(self) -> None:
        self.now_us += STEP_US
        self.view = self.obey()
        self.flight, report = advance(self.flight, self.view, self.settings)
        self.texts += [text for _, text in report.texts]
        self.reached += report.reached
        if not self.phases or self.phases[-1] != self.flight.phase:
            self.phases.append(self.flight.phase)
        if self.flight.legs:
            leg = self.flight.legs[0]
            jet = leg.jet((self.now_us - self.flight.leg_start_us) * 1e-6)
            self.setpoints.append((self.now_us * 1e-6, leg.control_mode, jet))

    def run(self, until: Callable[[Sky], bool], limit_s: float = 300.0) -> None:
        end = self.now_us + round(limit_s * 1e6)
        while not until(self):
            assert self.now_us < end, (self.flight.phase, self.flight.mission.step, self.texts)
            self.tick()

    def wait(self, seconds: float) -> None:
        end = self.now_us + round(seconds * 1e6)
        self.run(lambda sky: sky.now_us >= end)

    def airborne(self) -> Sky:
        """Take off by command to 2 m, and hold; from the beginning, this is computed once for all tests."""
        if type(self) is Sky and vars(self) == vars(Sky(*self.steps, settings=self.settings)):
            risen = vars(_risen(self.steps, self.settings))
            vars(self).update({k: list(v) if isinstance(v, list) else v for k, v in risen.items()})
            return self
        return self.take_off()

    def take_off(self) -> Sky:
        """The same from any state."""
        assert self.ask(Arm(True, False)).result == ACCEPTED
        assert self.ask(Takeoff(2.0)).result == ACCEPTED
        self.run(lambda sky: sky.flight.phase == Phase.HOLD)
        self.wait(2.0)
        return self

    def obey(self) -> View:
        """The view after a tick in which everything moved as the present leg commands."""
        last, flight = self.view, self.flight
        if not flight.legs:
            return last._replace(now_us=self.now_us, v_quad=ZERO, v_load=ZERO)
        leg = flight.legs[0]
        jet = leg.jet((self.now_us - flight.leg_start_us) * 1e-6)
        if leg.control_mode == LOAD_POSITION:
            x, v = jet[0], jet[1]
            if x[2] < LOAD_RADIUS:
                x, v = (x[0], x[1], LOAD_RADIUS), ZERO
            # the cable leans as the load's acceleration requires
            a, L = jet[2], self.settings.cable_length_m
            pull = (a[0], a[1], a[2] + self.settings.gravity_m_s2)
            n = norm(pull)
            over = (x[0] + L * pull[0] / n, x[1] + L * pull[1] / n, x[2] + L * pull[2] / n)
            return View(self.now_us, over, v, x, v, True, 0.0, ())
        if leg.control_mode == QUAD_POSITION:
            x, v = jet[0], jet[1]
            if x[2] < GEAR:
                x, v = (x[0], x[1], GEAR), ZERO
            taut = norm(sub(x, last.x_load)) >= self.settings.cable_length_m
            return View(self.now_us, x, v, last.x_load, ZERO, taut, 0.0, ())
        # an attitude is commanded: vehicle and load drift north at constant speed
        drift = (0.0, 0.3 * STEP_US * 1e-6, 0.0)
        return last._replace(
            now_us=self.now_us,
            x_quad=add(last.x_quad, drift),
            x_load=add(last.x_load, drift),
            v_load=(0.0, 0.3, 0.0),
            v_quad=(0.0, 0.3, 0.0),
        )


class HeadWind(Sky):
    """A sky in which load and vehicle come no faster than at `most_m_s` to where they should be."""

    most_m_s = 2.0

    def obey(self) -> View:
        last, there = self.view, super().obey()
        if self.flight.phase not in CARRYING:
            return there
        released = self.flight.cable.released
        was, should = (last.x_quad, there.x_quad) if released else (last.x_load, there.x_load)
        way = sub(should, was)
        reach = self.most_m_s * STEP_US * 1e-6
        if norm(way) <= reach:
            return there
        v = scale(self.most_m_s / norm(way), way)
        x = add(was, scale(STEP_US * 1e-6, v))
        if released:
            return there._replace(x_quad=x, v_quad=v)
        return hanging(self.now_us, x, v)


@cache
def _risen(steps: tuple[Step, ...], settings: Settings) -> Sky:
    """A sky in which the load was lifted by command; it must not be changed."""
    return Sky(*steps, settings=settings).take_off()
