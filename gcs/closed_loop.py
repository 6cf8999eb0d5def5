"""A whole flight in one process: simulator, autopilot and ground station joined by byte queues.

The cores are those of the three programs and exchange data in the same order, so that a flight flown here and
one flown over UDP in lockstep give the same log, byte for byte. Only this module joins the three.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from autopilot.onboard.onboard import Onboard
from autopilot.onboard.snapshot import Options
from autopilot.own.own_code import NO_OWN_CODE, OwnCode, parameters_for
from autopilot.services.identity import identity_of
from autopilot.services.mission_store import StoredMission
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import apply_settings
from autopilot.wire.convert.geodesy import Home
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture, FrameLog
from gcs.clients.flight import FlightClient, Outcome
from gcs.clients.lockstep import LockstepTurns, ground_turn
from gcs.closed_ticks import NOTHING, ClosedTicks
from gcs.expected_flight import expected_flight_s
from gcs.foreign_mission import home_of
from gcs.mission_items import areas_of, items_of
from missions.model import Mission
from sitl.hil import HilSimulator
from sitl.sensor_log import SensorLog

_GROUND = "ground"


@dataclass(frozen=True)
class Conditions:
    """The conditions of a flight, except the mission."""

    vehicle: str = "bebop"
    sensors: str = "lab"
    seed: int = 1
    settings: Mapping[str, float] = field(default_factory=dict)  # SIM_ and autopilot parameters by name
    own: OwnCode = NO_OWN_CODE  # references to custom code; a law in it determines CTL_LAW
    limit_s: float | None = None  # longest time that the flight may last; None: by its expected duration
    ignored: frozenset[str] = frozenset()  # parameters in the vehicle's file that have no effect


def build_onboard(conditions: Conditions, home: Home, mission: StoredMission | None = None) -> Onboard:
    """An autopilot for these conditions."""
    table = parameters_for(load_belief(conditions.vehicle), conditions.own, ignored=conditions.ignored)
    apply_settings(table, conditions.settings.items())
    table.freeze()
    options = Options(home, LOCKSTEP_BOOT_UNIX_US, own=conditions.own)
    return Onboard(table, identity_of(table), options, mission)


def build_simulator(
    conditions: Conditions, home: Home, lockstep: bool = True, sensor_log: SensorLog | None = None
) -> HilSimulator:
    """A simulator for these conditions."""
    return HilSimulator.build(
        conditions.vehicle,
        conditions.sensors,
        conditions.seed,
        conditions.settings,
        home,
        lockstep,
        log=sensor_log,
    )


Watch = Callable[[Onboard, HilSimulator], bool]


def fly(
    mission: Mission,
    conditions: Conditions,
    log: FrameLog,
    watch: Watch | None = None,
    client: FlightClient | None = None,
    on_turn: Callable[[], None] = lambda: None,
    log_sensors: Callable[[bytes], object] | None = None,
) -> Outcome:
    """Fly a mission from take-off to landing; the log receives what `gcs fly --lockstep` writes.

    `watch` is called with the cores at every tick, before the world advances; if it returns False, the flight
    ends. Without `watch`, ticks at which nothing is to be decided are flown in machine code. `client`
    replaces the usual ground station client; `on_turn` is called after each of its turns. `log_sensors`
    is called with the bytes of a log (`sitl.sensor_log`), also of some ticks after the end of the flight.
    """
    home = home_of(mission)
    onboard = build_onboard(conditions, home)
    onboard.add_link(_GROUND)
    sensor_log = None if log_sensors is None else SensorLog(log_sensors)
    simulator = build_simulator(conditions, home, sensor_log=sensor_log)
    if client is None:
        expected_s = expected_flight_s(mission, onboard.parameters)
        client = FlightClient(
            items_of(mission, home), expected_s, conditions.limit_s, areas=areas_of(mission)
        )
    capture = Capture(log)
    turns = LockstepTurns()
    ticks = ClosedTicks(onboard, simulator) if watch is None else None
    truth_datagrams: list[bytes] = []  # truth of the open window
    vehicle_datagrams: list[bytes] = []  # datagrams of the vehicle in the open window
    silent_until_us = 0  # until when the ground station has promised to send nothing

    def ground_station_turn(now_us: int) -> None:
        """The ground station's turn at the end of a window; the vehicle receives what it sends."""
        nonlocal silent_until_us
        for datagram in ground_turn(client, capture, truth_datagrams, vehicle_datagrams, now_us):
            onboard.receive_ground(datagram, _GROUND)
        if now_us >= silent_until_us:  # before that, the vehicle does not wait for an answer
            onboard.receive_ground(turns.answer(now_us * 1000, client.silent_until_us), _GROUND)
            silent_until_us = client.silent_until_us
        truth_datagrams.clear()
        vehicle_datagrams.clear()
        capture.flush(now_us)
        on_turn()

    while client.outcome is None:
        truth = simulator.truth_datagram()
        if truth is not None:
            truth_datagrams.append(truth)
        flown = NOTHING if ticks is None else ticks.run(b"".join(vehicle_datagrams), silent_until_us)
        for window in flown.windows:
            truth_datagrams.append(window.truth)
            vehicle_datagrams[:] = [window.vehicle_datagrams]
            if window.ends_us and client.outcome is None:
                ground_station_turn(window.ends_us)
        if flown.world_moved or client.outcome is not None:
            continue
        if flown.decide is not None:
            answer: bytes | None = onboard.complete(flown.decide)
        else:
            answer = onboard.receive_sensors(simulator.sensor_datagram())
        vehicle_datagrams += [datagram for _, datagram in onboard.ground_datagrams()]
        question = onboard.timesync_request(_GROUND)
        if question is not None:
            vehicle_datagrams.append(question)
            ground_station_turn(onboard.now_us)
        if watch is not None and not watch(onboard, simulator):
            client.interrupt("stopped by who watched it")
        if answer is not None:
            simulator.receive(answer)
        simulator.advance()
    return client.outcome.in_mission_terms(mission)
