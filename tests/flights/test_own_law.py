"""Custom control laws: they fly each mode, and the flight with its load survives a law that
fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autopilot.geometry.linear import IDENTITY
from autopilot.geometry.magnitude import MAX_MAGNITUDE
from autopilot.own.own_code import OwnCode
from autopilot.supervisor.state import Phase
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from gcs.closed_loop import Conditions, build_onboard
from missions.fileformat import load_mission
from missions.model import Delay, Land, Takeoff
from plumbline.examples.load_pid import LoadPid
from plumbline.laws import Asked, Now, Parameter, attitude, force, rates, wrench
from tests.doubles.craft import ACCEPTED, Craft, at_phase

HELD = 0.008  # m, error of a held load: measured 4 mm with the PID, 2 mm with the geometric controller
SWING = 0.05  # m, greatest motion of the load when the built-in law takes over
EXAMPLES = ("plumbline.examples.load_pid:LoadPid", "plumbline.examples.geometric:Geometric")
PARAMETERS = {"OWN_LIFT": Parameter(0.0, -1.0, 1.0, "m", "How much higher the load is held")}


def vector(values: Any) -> Any:
    return np.array(values, float)


class AllModes(LoadPid):
    """The PID, with all modes."""

    def quad_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        x_d, v_d, a_d = map(np.array, now.reference.jet[:3])
        a = a_d - 4.0 * (vector(now.state.x_quad) - x_d) - 3.0 * (vector(now.state.v_quad) - v_d)
        return memory, force(now.believed.quad_mass * (a + vector((0.0, 0.0, now.believed.gravity))))

    def quad_attitude(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        return memory, attitude(now.held.R_d, now.held.thrust)

    def load_attitude(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        state, believed = now.state, now.believed
        swing = 60.0 * (vector(state.q_cable) - now.held.q_d) + 12.0 * vector(state.q_cable_dot)
        F = -now.held.pull * vector(now.held.q_d) + believed.quad_mass * now.cable.length * swing
        return memory, force(F)


class AsAttitude(LoadPid):
    """The PID, which converts its force to an attitude itself."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        memory, asked = super().load_position(memory, now)
        R_d, thrust = self.turned(asked.vector, now)
        return memory, attitude(R_d, thrust)

    def turned(self, F: Any, now: Now) -> tuple[Any, float]:
        b3 = vector(F) / np.linalg.norm(F)
        b2 = np.cross(b3, now.reference.b1_d)
        b2 /= np.linalg.norm(b2)
        R_d = np.column_stack([np.cross(b2, b3), b2, b3])
        return R_d, float(vector(F) @ vector(now.state.R)[:, 2])


class AsRates(AsAttitude):
    """The same, but commands body rates."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        memory, asked = LoadPid.load_position(self, memory, now)
        R_d, thrust = self.turned(asked.vector, now)
        return memory, rates(thrust, -10.0 * self.error(R_d, now))

    def error(self, R_d: Any, now: Now) -> Any:
        E = R_d.T @ vector(now.state.R)
        return 0.5 * vector((E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]))


class AsWrench(AsRates):
    """The same, but commands moments."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        memory, asked = LoadPid.load_position(self, memory, now)
        R_d, thrust = self.turned(asked.vector, now)
        inertia = vector(now.believed.inertia)
        moment = -inertia * (400.0 * self.error(R_d, now) + 40.0 * vector(now.state.omega_body))
        return memory, wrench(thrust, moment)


class FailsInHold(LoadPid):
    """Fails two seconds after lift-off."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        if now.time_s > 10.0:
            raise RuntimeError("no idea")
        return super().load_position(memory, now)


class CommandsTooMuch(LoadPid):
    """Commands an unearthly force two seconds after lift-off."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        if now.time_s > 10.0:
            return memory, force((1e160, 0.0, 0.0))
        return super().load_position(memory, now)


class AtTheLimits(LoadPid):
    """Commands as much as a law may, of each kind at one tick after the other."""

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        if now.time_s < 10.0:
            return super().load_position(memory, now)
        most = MAX_MAGNITUDE
        commands = (
            force((most, -most, most)),
            attitude(IDENTITY, most),
            rates(most, (-most, most, most)),
            wrench(most, (most, most, -most)),
        )
        return memory, commands[round(now.time_s / now.period_s) % len(commands)]


class FailsAtTouchdown(LoadPid):
    """Fails when the vehicle lands beside the load."""

    begun = 0

    def quad_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        FailsAtTouchdown.begun += now.begins
        if FailsAtTouchdown.begun == 2:
            raise RuntimeError("no idea")
        return AllModes.quad_position(self, memory, now)  # type: ignore[arg-type]


class Lifted(LoadPid):
    """Holds the load higher by a parameter, but accepts only some of the values in its range."""

    parameters = {**LoadPid.parameters, **PARAMETERS}  # noqa: RUF012

    def __init__(self, parameters: Any) -> None:
        super().__init__(parameters)
        self.lift = parameters["OWN_LIFT"]
        if self.lift < 0.0:
            raise ValueError("it cannot be lower")

    def load_position(self, memory: Any, now: Now) -> tuple[Any, Asked]:
        x = now.state.x_load
        lower = now.state._replace(x_load=(x[0], x[1], x[2] - self.lift))
        return super().load_position(memory, now._replace(state=lower))


def craft(law: str | type, *steps: Any) -> Craft:
    reference = law if isinstance(law, str) else f"{__file__}:{law.__name__}"
    return Craft(*(steps or (Takeoff(1.0), Delay(1.0), Land())), own=OwnCode(reference), watched=True)


@pytest.mark.parametrize("law", [*EXAMPLES, AllModes, AsAttitude, AsRates, AsWrench])
def test_it_lifts_holds_and_lands(law: str | type) -> None:
    flown = craft(law)
    flown.begin()
    flown.run(at_phase(Phase.LOWER))
    assert 0.0 < flown.worst_error < HELD
    flown.run(at_phase(Phase.DISARMED))
    assert flown.texts[-1] == "Landed, disarmed"


@pytest.mark.parametrize("mission", ["load-attitude", "quad-attitude"])
def test_it_flies_the_attitude_modes(mission: str) -> None:
    flown = craft(AllModes, *load_mission(mission).steps)
    flown.begin()
    flown.run(at_phase(Phase.DISARMED), 120.0)
    assert flown.texts[-1] == "Landed, disarmed"
    assert not [text for text in flown.texts if "failed" in text]


def test_one_that_fails_is_replaced_at_once_and_the_vehicle_lands() -> None:
    flown = craft(FailsInHold, Takeoff(1.0), Delay(30.0), Land())
    flown.begin()
    flown.run(lambda one: any("failed" in text for text in one.texts))
    told = "".join(flown.texts[flown.texts.index("Law FailsInHold failed: RuntimeError: no idea (tes") :][:3])
    line = f"{Path(__file__).name}:{FailsInHold.load_position.__code__.co_firstlineno + 2}"
    assert told == f"Law FailsInHold failed: RuntimeError: no idea ({line}); landing by law plumbline"
    assert flown.flight.phase == Phase.LOWER
    assert flown.worst_error < SWING
    flown.run(at_phase(Phase.DISARMED))
    assert flown.texts[-1] == "Landed, disarmed"
    assert flown.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) != ACCEPTED
    assert any(text.startswith("Arming denied: Law FailsInHold failed: RuntimeErro") for text in flown.texts)


def test_one_that_commands_more_than_any_vehicle_has_is_named_and_replaced() -> None:
    flown = craft(CommandsTooMuch, Takeoff(1.0), Delay(30.0), Land())
    flown.begin()
    flown.run(lambda one: any("failed" in text for text in one.texts))
    flown.wait(1.0)
    told = "Law CommandsTooMuch failed: asks for (1e+160, 0.0, 0.0); must be numbers up to 1e9 (tes"
    assert told in "".join(flown.texts)
    assert flown.flight.phase == Phase.LOWER
    assert flown.worst_error < SWING


def test_from_the_largest_numbers_that_a_law_may_command_follow_numbers() -> None:
    flown = craft(AtTheLimits, Takeoff(1.0), Delay(30.0), Land())
    flown.begin()
    core = flown.onboard.core
    flown.run(lambda _: core.control.command.thrust == MAX_MAGNITUDE)
    flown.wait(0.1)
    assert not any("failed" in text for text in flown.texts)
    assert np.isfinite(core.rows.control).all()


def test_one_that_fails_at_touchdown_lands() -> None:
    flown = craft(FailsAtTouchdown)
    flown.begin()
    flown.run(at_phase(Phase.DISARMED))
    assert [text for text in flown.texts if text.startswith("Law FailsAtTouchdown failed")]
    assert flown.texts[-1] == "Landed, disarmed"


def test_its_parameters_are_changed_in_flight() -> None:
    flown = craft(Lifted, Takeoff(1.0), Delay(20.0), Land())
    flown.begin()
    flown.run(at_phase(Phase.MISSION))
    flown.wait(1.0)
    before = flown.truth.x_load[2]
    flown.send(mavlink.MAVLink_param_set_message(1, 1, b"OWN_LIFT", 0.2, mavlink.MAV_PARAM_TYPE_REAL32))
    flown.wait(9.0)
    assert flown.truth.x_load[2] - before == pytest.approx(0.2, abs=HELD)
    flown.send(mavlink.MAVLink_param_set_message(1, 1, b"OWN_LIFT", -0.2, mavlink.MAV_PARAM_TYPE_REAL32))
    flown.wait(0.5)
    assert any(text.startswith("Law Lifted failed: ValueError: it cannot be lower") for text in flown.texts)
    assert flown.flight.phase == Phase.LOWER
    flown.run(at_phase(Phase.DISARMED))


def test_other_laws_can_be_chosen_where_one_was_brought() -> None:
    reference = f"{__file__}:{FailsInHold.__name__}"
    onboard = build_onboard(Conditions(settings={"CTL_LAW": 0.0}, own=OwnCode(reference)), Home())
    assert onboard.core.setup.own is None
