"""An autopilot in a simulated world, joined in one process, with the truth at hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from autopilot.estimation.records import EstimatorState
from autopilot.geometry.linear import norm, sub
from autopilot.guidance.legs import Hold
from autopilot.onboard.onboard import GROUND_WINDOW_US, Onboard
from autopilot.onboard.snapshot import Options
from autopilot.onboard.tick_batch import MAX_WAITING_WINDOWS
from autopilot.own.own_code import NO_OWN_CODE, OwnCode
from autopilot.services.identity import identity_of
from autopilot.services.mission_store import StoredMission
from autopilot.services.streams import NEVER_US
from autopilot.supervisor.requests.verdicts import ACCEPTED as ACCEPTANCE
from autopilot.supervisor.state import Flight, Phase
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_steps
from gcs.closed_loop import Conditions, build_onboard, build_simulator
from gcs.closed_ticks import ClosedTicks
from missions.model import Step
from sitl.hil import HilSimulator
from sitl.plant.records import PlantState
from sitl.sim_core import SimCore
from sitl.vehicles.truth import load_truth

ACCEPTED = ACCEPTANCE.result
GCS = "gcs"
TRUTH = load_truth("bebop")
# that machine code flies without Python, at most: so many windows wait for the ground station
MAX_TICKS_US = MAX_WAITING_WINDOWS * GROUND_WINDOW_US + GROUND_WINDOW_US
LOAD_WEIGHT_N = TRUTH.load_mass * TRUTH.gravity


@dataclass(frozen=True)
class OfFlight:
    """A condition on the flight, which only a decision of the supervisor can bring about."""

    holds: Callable[[Flight], bool]

    def __call__(self, craft: Craft) -> bool:
        return self.holds(craft.flight)


class Craft:
    """Onboard and simulator joined tick by tick, without a ground station except for the commands given here.

    `truth` reads the simulator's state; nothing of it reaches the autopilot except by sensors. The clock
    waits for the autopilot unless `clock_waits` is False. Ticks that no test sees, those of a `wait` or
    before a condition `OfFlight`, are flown in machine code, as in `gcs fly`; if `watched`, none is.
    """

    def __init__(
        self,
        *steps: Step | WireItem,
        sensors: str = "lab",
        seed: int = 1,
        clock_waits: bool = True,
        lockstep: bool = True,
        own: OwnCode = NO_OWN_CODE,
        vehicle: str = "bebop",
        watched: bool = False,
        **settings_: float,
    ) -> None:
        conditions = Conditions(vehicle=vehicle, sensors=sensors, seed=seed, settings=settings_, own=own)
        # what an item means may depend on those before it: steps in a row are encoded together
        items: list[WireItem] = []
        for wire, run in groupby(steps, lambda one: isinstance(one, WireItem)):
            together = list(run)
            items += together if wire else encode_steps(together, Home())
        mission = StoredMission(tuple(items))
        self.onboard: Onboard = build_onboard(conditions, Home(), mission)
        if not clock_waits:
            table = self.onboard.parameters
            self.onboard = Onboard(table, identity_of(table), Options(Home(), 0, clock_waits=False), mission)
        self.simulator: HilSimulator = build_simulator(conditions, Home(), lockstep)
        self.onboard.add_link(GCS)
        self._writer = FrameWriter(255, 190)
        self._heard: list[Any] = []
        self._undecoded: list[bytes] = []  # what the ground station received since `heard` was last read
        self._watched = watched
        self._ticks: tuple[Onboard, HilSimulator, ClosedTicks] | None = None
        self._answers: list[bytes] = []
        self._worst_error = 0.0

    @property
    def answers(self) -> list[bytes]:
        """The answers to all ticks."""
        assert self._watched, "only a craft that is watched"
        return self._answers

    @property
    def worst_error(self) -> float:
        """The greatest distance of the load from the position where it is held, m."""
        assert self._watched, "only of a craft that is watched"
        return self._worst_error

    @worst_error.setter
    def worst_error(self, value: float) -> None:
        self._worst_error = value

    @property
    def truth(self) -> PlantState:
        return self.world.state

    @property
    def world(self) -> SimCore:
        return self.simulator.core

    @property
    def estimate(self) -> EstimatorState:
        return self.onboard.core.estimator

    @property
    def flight(self) -> Flight:
        return self.onboard.core.flight

    @property
    def heard(self) -> list[Any]:
        """The messages of the kinds in _HEARD that the ground station received; decoded as they are read."""
        for datagram in self._undecoded:
            self._heard += [r.message for r in decode(datagram)[0] if r.id in _HEARD]
        self._undecoded.clear()
        return self._heard

    @property
    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    def results(self, command: int) -> list[int]:
        """Results of the COMMAND_ACKs to a command."""
        return [m.result for m in self.heard if m.get_type() == "COMMAND_ACK" and m.command == command]

    def send(self, message: Any) -> None:
        self.onboard.receive_ground(self._writer.frame(message), GCS)

    def command(self, command: int, *p: float) -> int:
        """Send a COMMAND_LONG; return its result."""
        params = (*p, *([0.0] * (7 - len(p))))
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *params))
        self.tick()
        return self.results(command)[-1]

    def tick(self) -> None:
        answer = self.onboard.receive_sensors(self.simulator.sensor_datagram())
        assert answer is not None
        self._end_tick(answer)

    def _end_tick(self, answer: bytes) -> None:
        self._undecoded += [datagram for _, datagram in self.onboard.ground_datagrams()]
        self._answers.append(answer)
        if self.flight.legs and isinstance(self.flight.legs[0], Hold):
            error = norm(sub(self.truth.x_load, self.flight.legs[0].position))
            self._worst_error = max(self._worst_error, error)
        self.simulator.receive(answer)
        self.simulator.advance()

    def _tick_on(self) -> None:
        """One tick, or a third of a second at most up to the tick at which the supervisor decides."""
        onboard, simulator = self.onboard, self.simulator
        if self._ticks is None or self._ticks[0] is not onboard or self._ticks[1] is not simulator:
            self._ticks = onboard, simulator, ClosedTicks(onboard, simulator)
        simulator.truth_datagram()
        flown = self._ticks[2].run(b"", NEVER_US)
        self._undecoded += [window.vehicle_datagrams for window in flown.windows]
        if flown.decide is not None:
            self._end_tick(onboard.complete(flown.decide))
        elif not flown.world_moved:
            self.tick()

    def run(self, until: Callable[[Craft], bool], limit_s: float = 60.0) -> None:
        tick = self._tick_on if isinstance(until, OfFlight) and not self._watched else self.tick
        end = self.onboard.now_us + round(limit_s * 1e6)
        while not until(self):
            assert self.onboard.now_us < end, (self.flight.phase, self.texts)
            tick()

    def wait(self, seconds: float) -> None:
        end = self.onboard.now_us + round(seconds * 1e6)
        while not self._watched and self.onboard.now_us + MAX_TICKS_US < end:
            self._tick_on()
        while self.onboard.now_us < end:
            self.tick()

    def begin(self) -> None:
        """Settle, choose the mission, arm."""
        self.wait(1.0)
        assert self.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
        assert self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED


_HEARD = {
    mavlink.MAVLINK_MSG_ID_HEARTBEAT,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK,
    mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    mavlink.MAVLINK_MSG_ID_MISSION_ITEM_REACHED,
    mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE,
    mavlink.MAVLINK_MSG_ID_LOAD_STATE,
    mavlink.MAVLINK_MSG_ID_VIBRATION,
}


def least_tension(craft: Craft, until: Callable[[Craft], bool]) -> float:
    """Fly on; return the least tension on the way, as a share of the load's weight."""
    least = 9.9
    while not until(craft):
        craft.tick()
        assert craft.flight.phase != Phase.FAILSAFE, craft.texts
        least = min(least, craft.truth.tension / LOAD_WEIGHT_N)
    return least


def at_phase(phase: Phase) -> OfFlight:
    return OfFlight(lambda flight: flight.phase == phase)
