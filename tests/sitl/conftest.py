"""What the simulator's tests share: a core in free flight, an autopilot of constant forces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from autopilot.geometry.packed import unpack
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.simulator import padded_forces
from sitl.hil import HilSimulator
from sitl.plant.step import initial_state
from sitl.sensors.files import load_profile, parse_profile
from sitl.settings import settings_of
from sitl.sim_core import SimCore
from sitl.vehicles.sim_parameters import apply, sim_parameters
from sitl.vehicles.truth import load_truth
from sitl.world import FITTED, READING, READINGS, SENSORS, STAMP_US, pop_arrived
from tests.doubles.messages import hil_actuator_controls_message

Forces = tuple[float, float, float, float]


class Measurement(NamedTuple):
    """A reading and the instant it shows."""

    time_us: int
    reading: Any


class Readings(NamedTuple):
    """The readings that leave the sensors at one tick, in the order of the world's rows; an empty tuple where
    none does."""

    imu: tuple[Measurement, ...]
    mocap: tuple[Measurement, ...]
    load_tracker: tuple[Measurement, ...]
    cable_sensor: tuple[Measurement, ...]
    gnss: tuple[Measurement, ...]
    barometer: tuple[Measurement, ...]
    magnetometer: tuple[Measurement, ...]


class ReadCore(SimCore):
    """A core whose readings are taken out at every tick, as records."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._take_out()

    def tick(self, command: Forces, gripper_open: bool = False, reel_rate: float = 0.0) -> Readings:
        super().tick(command, gripper_open, reel_rate)
        return self._take_out()

    def _take_out(self) -> Readings:
        return Readings(*(self._arrivals(sensor) for sensor in range(SENSORS)))

    def _arrivals(self, sensor: int) -> tuple[Measurement, ...]:
        if not self.rows.clock[sensor, FITTED]:
            return ()
        found = []
        while (at := pop_arrived(sensor, self.now_us, self.rows)) >= 0:
            row = self.rows.queue[sensor, at]
            found.append(Measurement(int(row[STAMP_US]), unpack(READINGS[sensor], row, READING)))
        return tuple(found)


def build_core(profile: str = "ideal", seed: int = 1, vehicle: str = "thesis", **settings: float) -> ReadCore:
    """A core; `profile` is a shipped name or the text of a TOML file."""
    truth = load_truth(vehicle)
    table = sim_parameters(truth)
    for name, value in settings.items():
        table.set(name, value)
    fitted = parse_profile(profile, "test.toml") if "\n" in profile else load_profile(profile)
    return ReadCore(apply(truth, table), fitted, settings_of(table), seed)


def lift(core: SimCore) -> SimCore:
    """Put vehicle and load at rest high up in the air, 0.3 m apart, so that nothing touches anything."""
    high = initial_state(core.truth)
    core.state = high._replace(
        x_quad=(1.0, 2.0, 50.0),
        x_load=(1.0, 2.0, 49.7),
        q_cable=(0.0, 0.0, -1.0),
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )
    return core


@pytest.fixture
def core() -> Callable[..., SimCore]:
    return build_core


@pytest.fixture
def core_in_the_air() -> Callable[..., SimCore]:
    return lambda *args, **kwargs: lift(build_core(*args, **kwargs))


class Answerer:
    """The autopilot's end of the link, which always commands the same forces."""

    def __init__(self, forces: Forces = (1.0, 1.0, 1.0, 1.0), system: int = 1) -> None:
        self.forces = forces
        self.writer = FrameWriter(system, 1)

    def answer(self, time_us: int, forces: Forces | None = None, armed: bool = True) -> bytes:
        message = hil_actuator_controls_message(time_us, padded_forces(forces or self.forces), armed, True)
        return self.writer.frame(message)

    def fly(self, simulator: HilSimulator, ticks: int) -> list[bytes]:
        """All datagrams of this number of ticks, truth before sensors."""
        sent = []
        for _ in range(ticks):
            truth = simulator.truth_datagram()
            if truth is not None:
                sent.append(truth)
            sent.append(simulator.sensor_datagram())
            assert simulator.receive(self.answer(simulator.now_us))
            simulator.advance()
        return sent


@pytest.fixture
def answerer() -> type[Answerer]:
    return Answerer


@pytest.fixture
def messages() -> Callable[[bytes], list[Any]]:
    """The messages of a datagram that holds only whole frames."""

    def read(datagram: bytes) -> list[Any]:
        received, junk = decode(datagram)
        assert junk == 0
        assert all(one.system == 1 and one.component in (26, 27) for one in received)
        return [one.message for one in received]

    return read
