"""The `autopilot` program: sockets, storage and signals around `autopilot.onboard.onboard`."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path

from platformdirs import user_state_path

from autopilot.onboard.onboard import SIMULATOR_SYSTEM, Onboard
from autopilot.onboard.snapshot import Options
from autopilot.own.law import law_number, own_law_reference
from autopilot.own.own_code import OwnCode, parameters_for, require_delivered
from autopilot.own.source import OwnError
from autopilot.own.trial import try_all
from autopilot.services.identity import AUTOPILOT_COMPONENT, identity_of
from autopilot.services.mission_store import StoredMission
from autopilot.services.records import (
    AreasChanged,
    Event,
    MissionChanged,
    ParameterChanged,
    ParametersSaved,
    ServiceFailed,
    SigningChanged,
    SimulatorParametersSaved,
)
from autopilot.shell.background_worker import BackgroundWorker
from autopilot.shell.compiling import ANY_OWN_LAW, Compilation, autopilot_parts
from autopilot.shell.ground import AutopilotError, GroundStations, LockstepGroundStation, listen, open_socket
from autopilot.shell.options import (
    EXIT_ERROR,
    EXIT_USAGE,
    MAX_DATAGRAM_BYTES,
    Address,
    Stop,
    StopRequest,
    address_text,
    os_error_text,
    print_errors,
    reduce_latency,
    send,
    set_timeout,
    stop_text,
)
from autopilot.shell.setting_names import check_names
from autopilot.shell.steady_clock import SteadyClock
from autopilot.shell.storage import Storage, StorageError
from autopilot.shell.storage_worker import StorageWorker
from autopilot.shell.tick_cost import TickCost
from autopilot.shell.tick_loop import NO_BATCH, BatchEnd, TickLoop, warm_up
from autopilot.shell.watched_calls import watched_calls
from autopilot.supervisor.state import Phase
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import DEFAULT_LAW, LAWS, apply_settings
from autopilot.vehicle.shipped import VehicleFileError
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_table import ParameterError

LOCKSTEP_BOOT_UNIX_US = 1_767_225_600_000_000  # 2026-01-01: logs of equal flights are equal
_GREETING_PERIOD_S = 0.2  # between heartbeats to a simulator that does not answer yet
_HEARTBEAT_PERIOD_S = 1.0  # between two heartbeats while the clock stands
_SLOW_SHARE = 0.8  # share of the wall clock's rate below which the vehicle's clock is slow
_PAUSED_STEP_US = 4000  # steps in which answers continue meanwhile; so many between two greetings:
_PAUSED_STEPS = round(1e6 * _GREETING_PERIOD_S / _PAUSED_STEP_US)
_SILENCE_S = 3.0  # silence of the simulator after which it is reported
_LOG_BYTES = 32_768  # of the flight log that are stored at once


SIMULATOR_RESTARTED = "Simulator restarted, vehicle on the ground: disarmed"


def refusal_text(datagram: bytes) -> str:
    """The text of a simulator to an autopilot that it does not serve, and what to do; else empty."""
    texts = [one.message.text for one in decode(datagram)[0] if one.id == mavlink.MAVLINK_MSG_ID_STATUSTEXT]
    return f"{texts[-1]}; end that one, or start another sitl (--listen, --sim)" if texts else ""


class Program:
    """The running autopilot: an `Onboard`, which is built anew whenever the simulator restarts."""

    def __init__(
        self,
        build: Callable[[StoredMission | None], Onboard],
        mission: StoredMission | None,
        storage: Storage,
        storage_worker: StorageWorker,
        simulator: Address,
        ground: GroundStations | LockstepGroundStation,
        worker: BackgroundWorker,
        notify: Callable[[str], None],
    ) -> None:
        self._build = build
        self._storage = storage
        self._storage_worker = storage_worker
        self._clock = SteadyClock()
        self._simulator = simulator
        self._ground = ground
        self._notify = notify
        self._socket = open_socket(simulator, "simulator")
        self._connect()
        self._greeting_s = 0.0  # time of the last greeting, monotonic clock
        self._heartbeat_s, self._heartbeat_us = (
            0.0,
            0,
        )  # the wall clock and the vehicle's clock at the last check
        greeting = mavlink.MAVLink_heartbeat_message(
            type=mavlink.MAV_TYPE_QUADROTOR,
            autopilot=mavlink.MAV_AUTOPILOT_PX4,
            base_mode=mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED,
            custom_mode=0,
            system_status=mavlink.MAV_STATE_BOOT,
            mavlink_version=3,
        )
        self._worker = worker
        self.cost = TickCost()
        self._greeting = FrameWriter(SIMULATOR_SYSTEM, AUTOPILOT_COMPONENT).frame(greeting)
        self.onboard = build(mission)
        if isinstance(ground, GroundStations):  # our clock does not wait for paths
            self._worker.start(self.onboard.warmup_work)
        self._ground.join(self.onboard)

    def restore_areas(self, areas: Mapping[int, tuple[WireItem, ...]]) -> None:
        """Take over stored fence and rally points, and report what of the storage is lost."""
        for kind, items in areas.items():
            self.onboard.set_areas(kind, items)
        self.onboard.set_storage_losses(self._storage.lost)

    def report_problems(self, problems: list[str]) -> None:
        """Report problems of the storage on the terminal and to the operators."""
        for problem in problems:
            print(f"autopilot: {problem}", file=sys.stderr)
            self.onboard.endpoint.send_text(mavlink.MAV_SEVERITY_CRITICAL, f"Storage: {problem}")

    def run(self, stop: StopRequest) -> None:
        """Fly ticks until a signal stops the program."""
        set_timeout(self._socket, _GREETING_PERIOD_S)
        received_s = time.monotonic()
        silent, lost, heartbeat_s, last_refusal = True, False, 0.0, ""
        self._notify(f"looking for the simulator at {address_text(self._simulator)}")
        self._greet()
        receive_from_simulator = self._socket.recv
        ground = self._ground
        batch_loop = (
            (TickLoop(self._socket, *ground.socket_and_address), ground)
            if isinstance(ground, LockstepGroundStation)
            else None
        )
        while True:
            stop.check()
            self._worker.update(self.onboard)
            self._storage_worker.report_results()
            end = NO_BATCH if batch_loop is None or silent or lost else self._run_batch(*batch_loop)
            if end.flew_ticks:
                received_s = time.monotonic()
            if end.can_continue:
                continue
            if end.tick_to_decide is not None:
                self._answer(self.onboard.complete(end.tick_to_decide), stop, True)
                continue
            stop.check()
            try:
                datagram = end.datagram or receive_from_simulator(MAX_DATAGRAM_BYTES)
            except OSError:  # nothing arrived within the timeout, or nobody listens at the address
                now = time.monotonic()
                if not silent and now - received_s > _SILENCE_S:
                    silent = True
                    self._notify(f"no message from the simulator for {_SILENCE_S:g} s; looking for it")
                    self.onboard.endpoint.send_text(
                        mavlink.MAV_SEVERITY_ERROR, "Simulator silent: time stands still"
                    )
                    self.onboard.set_simulator_silent(True)
                    lost = True
                if silent or now - received_s > 1.0:
                    self._greet()
                # the clock stands, but requests are answered
                self.cost.pause()
                if isinstance(self._ground, GroundStations):
                    self._ground.exchange(self.onboard, self._store_events, stop)
                    for _ in range(_PAUSED_STEPS):
                        self.onboard.endpoint.add_paused_time(_PAUSED_STEP_US)
                        self._ground.send(self.onboard)
                    if lost and now - heartbeat_s >= _HEARTBEAT_PERIOD_S:
                        heartbeat_s = now
                        self._ground.send_heartbeats(self.onboard)
                continue
            onboard = self.onboard
            self.cost.tick(onboard.tick_us)
            tick_before = onboard.tick
            answer = onboard.receive_sensors(datagram)
            if answer is not None:
                self._answer(answer, stop, onboard.tick != tick_before)
                if silent:
                    silent = False
                    self._notify(f"flying with the simulator at {address_text(self._simulator)}")
                    if lost:
                        lost = False
                        self.onboard.set_simulator_silent(False)
                        self.onboard.endpoint.send_text(
                            mavlink.MAV_SEVERITY_NOTICE, "Simulator answers again"
                        )
                received_s = time.monotonic()
            elif onboard.restarted:
                self._notify("the simulator has started again: so do I")
                previous = self.onboard
                areas = previous.endpoint.areas
                self._end_log()
                self.onboard = self._build(previous.endpoint.mission)
                self.onboard.endpoint.inherit_texts(previous.endpoint)
                self.restore_areas(areas)
                self._ground.join(self.onboard)
                was_flying = previous.phase != Phase.DISARMED
                severity = mavlink.MAV_SEVERITY_CRITICAL if was_flying else mavlink.MAV_SEVERITY_NOTICE
                self.onboard.endpoint.send_text(severity, SIMULATOR_RESTARTED)
            elif silent and (why := refusal_text(datagram)) not in ("", last_refusal):
                last_refusal = why
                self._notify(
                    f"the simulator at {address_text(self._simulator)} does not serve this one: {why}"
                )

    def _run_batch(self, ticks: TickLoop, ground: LockstepGroundStation) -> BatchEnd:
        """Fly ticks without Python, if the next ones allow it."""
        end = ticks.run(self.onboard, ground.timesync_requests)
        if end.flew_ticks:
            self.cost.pause()
            ground.set_unsent(self.onboard.unsent_windows)
            if self.onboard.has_log_data:
                self._store_log(_LOG_BYTES)
        return end

    def _answer(self, answer: bytes, stop: StopRequest, new: bool) -> None:
        """Exchange with the ground before the answer if the ground shares our clock, else after it."""
        if isinstance(self._ground, LockstepGroundStation):
            if new:
                self._ground.exchange(self.onboard, self._store_events, stop)
            send(self._socket, answer)
        else:
            send(self._socket, answer)
            self.onboard.set_wall_clock(self._clock.unix_us())
            self._send_wall_clock_heartbeat()
            self._ground.exchange(self.onboard, self._store_events, stop)
        onboard = self.onboard
        events = onboard.endpoint.take_events()
        if events:
            self._store_events(events)
        if onboard.has_log_data:
            self._store_log(_LOG_BYTES)
        if new and onboard.fault and onboard.tick == 1:
            raise AutopilotError(onboard.fault)

    def _send_wall_clock_heartbeat(self) -> None:
        """A heartbeat each second of the wall clock, by which clients wait, if the vehicle's is slower."""
        now, now_us = time.monotonic(), self.onboard.now_us
        if now - self._heartbeat_s >= _HEARTBEAT_PERIOD_S:
            if now_us - self._heartbeat_us < _SLOW_SHARE * _HEARTBEAT_PERIOD_S * 1e6:
                self.onboard.endpoint.state_changed()
            self._heartbeat_s, self._heartbeat_us = now, now_us

    def _connect(self) -> None:
        """Connect the socket: receive only from the simulator, and send to it."""
        try:
            self._socket.connect(self._simulator)
        except OSError as error:
            raise AutopilotError(
                f"simulator {address_text(self._simulator)}: {os_error_text(error)}"
            ) from None

    def _greet(self) -> None:
        """Send a heartbeat to the simulator, at most one per `_GREETING_PERIOD_S`: if nobody listens there, a
        receive fails without waiting."""
        now = time.monotonic()
        if now - self._greeting_s >= _GREETING_PERIOD_S:
            self._greeting_s = now
            send(self._socket, self._greeting)

    def _store_events(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, ServiceFailed):
                text = f"autopilot: internal error in {event.what}:\n{event.trace}"
                print(text, file=sys.stderr, flush=True)
            elif (store := _store_function(self._storage, event)) is not None:
                self._storage_worker.request(store, self._on_store_failed, self._on_stored)

    def _on_stored(self) -> None:
        """Something was stored, which may replace what was lost."""
        self.onboard.set_storage_losses(self._storage.lost)

    def _on_store_failed(self, error: OSError) -> None:
        self.onboard.endpoint.send_text(mavlink.MAV_SEVERITY_WARNING, f"Not stored: {error.strerror}")
        self._notify(f"cannot store: {error}")

    def _store_log(self, min_bytes: int) -> None:
        chunk = self.onboard.take_log(min_bytes)
        if chunk is None:
            return
        try:
            self._storage.store_log(chunk, self.onboard.parameters["LOG_MAX_MB"])
        except OSError as error:
            self.onboard.abandon_log(error.strerror or str(error))
            self._notify(f"cannot store the flight log: {error}")

    def _end_log(self) -> None:
        self.onboard.end_log()
        self._store_log(1)

    def close(self) -> None:
        """Store what is left of the flight log, close all sockets."""
        self._end_log()
        self._storage_worker.close()
        self._socket.close()
        self._ground.close()


def _store_function(storage: Storage, event: Event) -> Callable[[], None] | None:
    """The function that stores an event; None if nothing is to be stored."""
    match event:
        case MissionChanged(mission):
            return partial(storage.store_mission, mission)
        case AreasChanged(kind, items):
            return partial(storage.store_areas, kind, items)
        case ParameterChanged(name, value):
            return partial(storage.store_parameter, name, value)
        case ParametersSaved():
            return storage.store_parameters
        case SimulatorParametersSaved(values):
            return partial(storage.store_simulator_parameters, values)
        case SigningChanged(key, timestamp):
            return partial(storage.store_signing, key, timestamp)
    return None


def _store_signing_key(store: Storage, key: bytes) -> None:
    """Store the key, with the time of its last use if it was stored already."""
    known = store.load_signing()
    try:
        store.store_signing(key, known.timestamp if known and known.key == key else 0)
    except OSError as error:
        raise AutopilotError(f"the signing key cannot be stored: {os_error_text(error)}") from None


def links_text(stations: Sequence[Address], programs: Sequence[Address], tcp: Address | None) -> str:
    """Where ground stations and programs can connect, for the terminal."""
    kinds = (("ground stations at UDP", stations), ("API clients at UDP", programs))
    told = [f"{kind} {', '.join(map(address_text, addresses))}" for kind, addresses in kinds if addresses]
    sends = [f"sends to {' and '.join(told)}"] if told else []
    listens = [f"listens on TCP {address_text(tcp)}"] if tcp else []
    return ", ".join(sends + listens) or "no link to a ground station"


def fly(
    sim: Address,
    gcs: tuple[Address | None, ...],
    api: tuple[Address | None, ...],
    tcp: Address | None,
    ground_lockstep: Address | None,
    vehicle: str,
    law: str | None,
    estimator: str,
    planner: str,
    settings: tuple[tuple[str, float], ...],
    ignore: tuple[str, ...],
    home: Home | None,
    storage: Path | None,
    signing_key: bytes | None,
    allow_setup_signing: bool,
    quiet: bool,
) -> None:
    """Run the program with these options of its command (`autopilot.shell.command`)."""

    def notify(text: str) -> None:
        if not quiet:
            print(f"autopilot: {text}", flush=True)

    program: Program | None = None
    origin = home or Home()
    lockstep = ground_lockstep is not None
    worker = BackgroundWorker()
    try:
        own = OwnCode(own_law_reference(law or DEFAULT_LAW), estimator, planner)
        belief = load_belief(vehicle)
        require_delivered(belief, ignore)
        table = parameters_for(belief, own, ignored=ignore)
        check_names(settings, table.names)
        folder = storage or user_state_path("plumbline")
        store = Storage(folder)
        if not lockstep:
            worker.fork()
        store.lock()
        problems = store.load_parameters(table)
        if law:
            table.set("CTL_LAW", law_number(law))
        apply_settings(table, settings)
        table.freeze()
        if any(own):
            with watched_calls():
                try_all(own, table.values())
        compilation = Compilation(autopilot_parts((*LAWS, ANY_OWN_LAW)[int(table["CTL_LAW"])]), notify)
        if compilation.was_needed:
            gc.enable()  # the compiler leaves much garbage
        mission, problem = store.load_mission(origin)
        problems += [problem] if problem else []
        if signing_key is not None:
            _store_signing_key(store, signing_key)
        problems += store.load_simulator_parameters()[1]

        def build(stored: StoredMission | None) -> Onboard:
            boot = LOCKSTEP_BOOT_UNIX_US if lockstep else SteadyClock().unix_us()
            options = Options(
                origin, boot, clock_waits=lockstep, log=True, own=own, setup_signing=allow_setup_signing
            )
            onboard = Onboard(table, identity_of(table), options, stored, store.card, store.load_signing())
            onboard.restore_simulator_parameters(store.load_simulator_parameters()[0])
            return onboard

        stations, programs = (tuple(filter(None, addresses)) for addresses in (gcs, api))
        storage_worker = StorageWorker(threaded=not lockstep)
        ground: GroundStations | LockstepGroundStation
        if ground_lockstep:
            stations, programs, tcp = (ground_lockstep,), (), None
            ground = LockstepGroundStation(ground_lockstep)
        else:
            ground = GroundStations(stations, programs, listen(tcp) if tcp else None, storage_worker)
        notify(f"{links_text(stations, programs, tcp)}; storage {folder}")
        program = Program(build, mission, store, storage_worker, sim, ground, worker, notify)
        areas, unreadable = store.load_areas(origin)
        program.restore_areas(areas)
        program.report_problems(problems + unreadable)
        program.onboard.warm_up()
        warm_up(program.onboard)
        compilation.done()
        reduce_latency(real_time=not lockstep)
        with StopRequest() as stop, watched_calls(not lockstep) if any(own) else nullcontext():
            program.run(stop)
    except VehicleFileError as error:
        sys.exit(print_errors("autopilot", EXIT_USAGE, *error.problems))
    except (OwnError, ParameterError) as error:
        sys.exit(print_errors("autopilot", EXIT_USAGE, str(error)))
    except (AutopilotError, StorageError) as error:
        sys.exit(print_errors("autopilot", EXIT_ERROR, str(error)))
    except Stop as stopped:
        stopped_by = str(stopped)
    finally:
        if program is not None:
            program.close()
        worker.close()
    if program is not None:
        cost = "" if lockstep else program.cost.summary()
        notify(stop_text(program.onboard.now_us, stopped_by, cost))
