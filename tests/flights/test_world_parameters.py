"""The simulator's parameters, seen and set by a ground station through the autopilot, while it runs."""

from __future__ import annotations

from typing import Any

import pytest

from autopilot.onboard.onboard import Onboard
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.operation import GROUND
from gcs.closed_loop import Conditions, build_onboard, build_simulator
from sitl.hil import HilSimulator

LINK = "ground"


class World:
    """Simulator and autopilot in lockstep, and what the ground hears."""

    def __init__(self, **settings: float) -> None:
        conditions = Conditions(sensors="ideal", settings=settings)
        self.onboard: Onboard = build_onboard(conditions, Home())
        self.onboard.add_link(LINK)
        self.simulator: HilSimulator = build_simulator(conditions, Home())
        self.heard: list[Any] = []
        self._writer = FrameWriter(*GROUND)

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            answer = self.onboard.receive_sensors(self.simulator.sensor_datagram())
            assert answer is not None
            for _, datagram in self.onboard.ground_datagrams():
                self.heard += [received.message for received in decode(datagram)[0]]
            assert self.simulator.receive(answer)
            self.simulator.advance()

    def set(self, name: str, value: float) -> list[Any]:
        """Send PARAM_SET from the ground; return the events for the shell."""
        message = mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32)
        return self.onboard.receive_ground(self._writer.frame(message), LINK)

    def told(self, name: str) -> float:
        """The last PARAM_VALUE of that name."""
        values = [m for m in self.heard if m.get_type() == "PARAM_VALUE" and m.param_id == name]
        return float(values[-1].param_value)


@pytest.fixture
def world() -> World:
    made = World(SIM_WIND_N=2.0)
    made.run(40)  # after these, the simulator has reported all its parameters
    return made


def test_the_autopilot_learns_what_the_simulator_has(world: World) -> None:
    names = world.onboard.parameters.names
    assert list(names) == sorted(names)
    assert {"SIM_WIND_E", "SIM_NOISE_SCALE", "SIM_ACT_DELAY_MS", "SIM_LOSS_PCT", "NGC_KX"} <= set(names)
    assert world.onboard.parameters["SIM_WIND_N"] == 2.0


def test_a_change_reaches_the_world_and_is_not_stored(world: World) -> None:
    events = world.set("SIM_WIND_E", 5.0)
    assert events == []
    world.run(3)
    assert world.simulator.core.wind == (5.0, 2.0, 0.0)
    assert world.told("SIM_WIND_E") == 5.0


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("SIM_CABLE_LEN", 1.0, mavlink.MAV_PARAM_ERROR_READ_ONLY),
        ("SIM_WIND_E", 900.0, mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE),
    ],
)
def test_what_the_simulator_refuses_is_taken_back_with_a_reason(
    world: World, name: str, value: float, error: int
) -> None:
    world.onboard.add_link("other")
    before = world.onboard.parameters[name]
    world.set(name, value)
    world.run(4)
    assert world.onboard.parameters[name] == before
    assert world.told(name) == pytest.approx(before)
    texts = [m.text for m in world.heard if m.get_type() == "STATUSTEXT"]
    assert any(name in text for text in texts), texts
    errors = [m for m in world.heard if m.get_type() == "PARAM_ERROR"]
    index = world.onboard.parameters.index(name)
    assert [(m.target_system, m.target_component, m.param_id, m.param_index, m.error) for m in errors] == [
        (*GROUND, name, index, error)
    ], "once, to the client alone"
    world.heard.clear()
    world.set("SIM_WIND_N", 1.0)
    world.run(4)
    assert not [m for m in world.heard if m.get_type() == "PARAM_ERROR"]


def test_a_load_can_grow_heavier_in_flight(world: World) -> None:
    world.set("SIM_LOAD_MASS", 0.2)
    world.set("SIM_ACT_DELAY_MS", 10.0)
    world.set("SIM_NOISE_SCALE", 2.0)
    world.run(5)
    core = world.simulator.core
    assert core.truth.load_mass == 0.2
    assert core.settings.actuator_delay_us == 10_000
    assert core.settings.noise_scale == 2.0


def test_parameters_of_the_autopilot_are_stored_as_before(world: World) -> None:
    (event,) = world.set("NGC_KX", 7.0)
    assert (event.name, event.value) == ("NGC_KX", 7.0)
