"""The `autopilot` program: sockets, storage and signals around `autopilot.onboard.onboard`."""

from __future__ import annotations

import gc
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import click
from platformdirs import user_state_path

from autopilot.onboard.onboard import SIMULATOR_SYSTEM, Onboard
from autopilot.onboard.snapshot import Options
from autopilot.own.chosen import Own, parameters_for
from autopilot.own.law import law_number, own_law
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
    WorldSaved,
)
from autopilot.shell.compiling import ONCE, OWN, autopilot_parts, ready
from autopilot.shell.ground import AutopilotError, GroundInStep, GroundStations, listen, open_socket
from autopilot.shell.options import (
    EXIT_ERROR,
    EXIT_USAGE,
    LARGEST_DATAGRAM,
    Address,
    NamedPath,
    ProgramCommand,
    Stop,
    StopRequest,
    address_option,
    be_punctual,
    complain,
    home_option,
    reason,
    send,
    set_timeout,
    setting_option,
    shown,
    signing_key_option,
)
from autopilot.shell.path_worker import Aside
from autopilot.shell.setting_names import check_names
from autopilot.shell.steady_clock import SteadyClock
from autopilot.shell.storage import Storage, StorageError
from autopilot.shell.storing import Storing
from autopilot.shell.tick_cost import TickCost
from autopilot.shell.tick_loop import NOTHING, Met, TickLoop, rehearse
from autopilot.shell.watched_calls import watched_calls
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import DEFAULT_LAW, LAWS, apply_settings
from autopilot.vehicle.shipped import VEHICLES, VehicleFileError
from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_table import ParameterError

LOCKSTEP_BOOT_UNIX_US = 1_767_225_600_000_000  # 2026-01-01: logs of equal flights are equal
_GREETING_S = 0.2  # between heartbeats to a simulator that does not answer yet
_BEAT_S = 1.0  # between two heartbeats while the clock stands
_SLOW_SHARE = 0.8  # share of the wall clock's rate below which the vehicle's clock is slow
_STANDING_STEP_US = 4000  # steps in which answers continue meanwhile; so many between two greetings:
_STANDING_STEPS = round(1e6 * _GREETING_S / _STANDING_STEP_US)
_SILENCE_S = 3.0  # silence of the simulator after which it is reported
_LOG_BYTES = 32_768  # of the flight log that are stored at once


SIMULATOR_RESTARTED = "Simulator restarted, vehicle on the ground: disarmed"


def turned_away(datagram: bytes) -> str:
    """The text of a simulator to an autopilot that it does not serve, and what to do; else empty."""
    said = [one.message.text for one in decode(datagram)[0] if one.id == mavlink.MAVLINK_MSG_ID_STATUSTEXT]
    return f"{said[-1]}; end that one, or start another sitl (--listen, --sim)" if said else ""


class Program:
    """The running autopilot: an `Onboard`, which is built anew whenever the simulator restarts."""

    def __init__(
        self,
        build: Callable[[StoredMission | None], Onboard],
        mission: StoredMission | None,
        storage: Storage,
        storing: Storing,
        simulator: Address,
        ground: GroundStations | GroundInStep,
        aside: Aside,
        say: Callable[[str], None],
    ) -> None:
        self._build = build
        self._storage = storage
        self._storing = storing
        self._clock = SteadyClock()
        self._simulator = simulator
        self._ground = ground
        self._say = say
        self._socket = open_socket(simulator, "simulator")
        self._connect()
        self._greeted = 0.0  # time of the last greeting, monotonic clock
        self._beaten, self._beaten_us = (
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
        self._aside = aside
        self.cost = TickCost()
        self._greeting = FrameWriter(SIMULATOR_SYSTEM, AUTOPILOT_COMPONENT).frame(greeting)
        self.onboard = build(mission)
        if isinstance(ground, GroundStations):  # our clock does not wait for paths
            self._aside.start(self.onboard.rehearsal)
        self._ground.join(self.onboard)

    def take_areas(self, areas: Mapping[int, tuple[WireItem, ...]]) -> None:
        """Take over stored fence and rally points, and report what of the storage is lost."""
        for kind, items in areas.items():
            self.onboard.take_areas(kind, items)
        self.onboard.take_losses(self._storage.lost)

    def tell(self, troubles: list[str]) -> None:
        """Report problems of the storage on the terminal and to the operators."""
        for trouble in troubles:
            print(f"autopilot: {trouble}", file=sys.stderr)
            self.onboard.endpoint.say(mavlink.MAV_SEVERITY_CRITICAL, f"Storage: {trouble}")

    def run(self, stop: StopRequest) -> None:
        """Fly ticks until a signal stops the program."""
        set_timeout(self._socket, _GREETING_S)
        heard = time.monotonic()
        silent, lost, beaten, refused = True, False, 0.0, ""
        self._say(f"looking for the simulator at {shown(self._simulator)}")
        self._greet()
        receive_from_simulator = self._socket.recv
        ground = self._ground
        alone = (TickLoop(self._socket, *ground.way), ground) if isinstance(ground, GroundInStep) else None
        while True:
            stop.check()
            self._aside.attend(self.onboard)
            self._storing.attend()
            met = NOTHING if alone is None or silent or lost else self._run_on(*alone)
            if met.ran:
                heard = time.monotonic()
            if met.more:
                continue
            if met.decide is not None:
                self._answer(self.onboard.complete(met.decide), stop, True)
                continue
            stop.check()
            try:
                datagram = met.datagram or receive_from_simulator(LARGEST_DATAGRAM)
            except OSError:  # nothing arrived within the timeout, or nobody listens at the address
                now = time.monotonic()
                if not silent and now - heard > _SILENCE_S:
                    silent = True
                    self._say(f"no message from the simulator for {_SILENCE_S:g} s; looking for it")
                    self.onboard.endpoint.say(
                        mavlink.MAV_SEVERITY_ERROR, "Simulator silent: time stands still"
                    )
                    self.onboard.take_silence(True)
                    lost = True
                if silent or now - heard > 1.0:
                    self._greet()
                # the clock stands, but requests are answered
                self.cost.pause()
                if isinstance(self._ground, GroundStations):
                    self._ground.exchange(self.onboard, self._keep, stop)
                    for _ in range(_STANDING_STEPS):
                        self.onboard.endpoint.stand(_STANDING_STEP_US)
                        self._ground.send(self.onboard)
                    if lost and now - beaten >= _BEAT_S:
                        beaten = now
                        self._ground.beat(self.onboard)
                continue
            onboard = self.onboard
            self.cost.tick(onboard.tick_us)
            tick_before = onboard.tick
            answer = onboard.receive_sensors(datagram)
            if answer is not None:
                self._answer(answer, stop, onboard.tick != tick_before)
                if silent:
                    silent = False
                    self._say(f"flying with the simulator at {shown(self._simulator)}")
                    if lost:
                        lost = False
                        self.onboard.take_silence(False)
                        self.onboard.endpoint.say(mavlink.MAV_SEVERITY_NOTICE, "Simulator answers again")
                heard = time.monotonic()
            elif onboard.restarted:
                self._say("the simulator has started again: so do I")
                before = self.onboard
                areas = before.endpoint.areas
                self._end_log()
                self.onboard = self._build(before.endpoint.mission)
                self.onboard.endpoint.inherit_texts(before.endpoint)
                self.take_areas(areas)
                self._ground.join(self.onboard)
                self.onboard.endpoint.say(mavlink.MAV_SEVERITY_CRITICAL, SIMULATOR_RESTARTED)
            elif silent and (why := turned_away(datagram)) not in ("", refused):
                refused = why
                self._say(f"the simulator at {shown(self._simulator)} does not serve this one: {why}")

    def _run_on(self, ticks: TickLoop, ground: GroundInStep) -> Met:
        """Fly ticks without Python, if the next ones allow it."""
        met = ticks.run(self.onboard, ground.questions)
        if met.ran:
            self.cost.pause()
            ground.take_back(self.onboard.said)
            if self.onboard.logged:
                self._keep_log(_LOG_BYTES)
        return met

    def _answer(self, answer: bytes, stop: StopRequest, new: bool) -> None:
        """Exchange with the ground before the answer if the ground shares our clock, else after it."""
        if isinstance(self._ground, GroundInStep):
            if new:
                self._ground.exchange(self.onboard, self._keep, stop)
            send(self._socket, answer)
        else:
            send(self._socket, answer)
            self.onboard.endpoint.tell_time(self._clock.unix_us())
            self._keep_beating()
            self._ground.exchange(self.onboard, self._keep, stop)
        onboard = self.onboard
        events = onboard.endpoint.take_events()
        if events:
            self._keep(events)
        if onboard.logged:
            self._keep_log(_LOG_BYTES)
        if new and onboard.fault and onboard.tick == 1:
            raise AutopilotError(onboard.fault)

    def _keep_beating(self) -> None:
        """A heartbeat each second of the wall clock, by which clients wait, if the vehicle's is slower."""
        now, now_us = time.monotonic(), self.onboard.now_us
        if now - self._beaten >= _BEAT_S:
            if now_us - self._beaten_us < _SLOW_SHARE * _BEAT_S * 1e6:
                self.onboard.endpoint.state_changed()
            self._beaten, self._beaten_us = now, now_us

    def _connect(self) -> None:
        """Connect the socket: receive only from the simulator, and send to it."""
        try:
            self._socket.connect(self._simulator)
        except OSError as error:
            raise AutopilotError(f"simulator {shown(self._simulator)}: {reason(error)}") from None

    def _greet(self) -> None:
        """Send a heartbeat to the simulator, at most one per `_GREETING_S`: if nobody listens there, a
        receive fails without waiting."""
        now = time.monotonic()
        if now - self._greeted >= _GREETING_S:
            self._greeted = now
            send(self._socket, self._greeting)

    def _keep(self, events: list[Event]) -> None:
        for event in events:
            if isinstance(event, ServiceFailed):
                text = f"autopilot: internal error in {event.what}:\n{event.trace}"
                print(text, file=sys.stderr, flush=True)
            elif (store := _stored_by(self._storage, event)) is not None:
                self._storing.ask(store, self._not_stored, self._stored)

    def _stored(self) -> None:
        """Something was stored, which may replace what was lost."""
        self.onboard.take_losses(self._storage.lost)

    def _not_stored(self, error: OSError) -> None:
        self.onboard.endpoint.say(mavlink.MAV_SEVERITY_WARNING, f"Not stored: {error.strerror}")
        self._say(f"cannot store: {error}")

    def _keep_log(self, least_bytes: int) -> None:
        chunk = self.onboard.take_log(least_bytes)
        if chunk is None:
            return
        try:
            self._storage.keep_log(chunk, self.onboard.parameters["LOG_MAX_MB"])
        except OSError as error:
            self.onboard.give_up_log(error.strerror or str(error))
            self._say(f"cannot store the flight log: {error}")

    def _end_log(self) -> None:
        self.onboard.end_log()
        self._keep_log(1)

    def close(self) -> None:
        """Store what is left of the flight log, close all sockets."""
        self._end_log()
        self._storing.close()
        self._socket.close()
        self._ground.close()


def _stored_by(storage: Storage, event: Event) -> Callable[[], None] | None:
    """The function that stores an event; None if nothing is to be stored."""
    match event:
        case MissionChanged(mission):
            return partial(storage.keep_mission, mission)
        case AreasChanged(kind, items):
            return partial(storage.keep_areas, kind, items)
        case ParameterChanged(name, value):
            return partial(storage.keep_parameter, name, value)
        case ParametersSaved():
            return storage.keep_parameters
        case WorldSaved(values):
            return partial(storage.keep_world, values)
        case SigningChanged(key, timestamp):
            return partial(storage.keep_signing, key, timestamp)
    return None


def _begin_signing(kept: Storage, key: bytes) -> None:
    """Store the key, with the time of its last use if it was stored already."""
    known = kept.load_signing()
    try:
        kept.keep_signing(key, known.timestamp if known and known.key == key else 0)
    except OSError as error:
        raise AutopilotError(f"the signing key cannot be stored: {reason(error)}") from None


def _address_or_none(text: str) -> Address | None:
    """PORT, HOST:PORT or `none`."""
    return None if text == "none" else address_option(text)


@click.command("autopilot", cls=ProgramCommand, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--sim",
    type=address_option,
    metavar="[HOST:]PORT",
    default="127.0.0.1:4560",
    show_default=True,
    help="Address of the simulator.",
)
@click.option(
    "--gcs",
    type=_address_or_none,
    metavar="[HOST:]PORT",
    multiple=True,
    default=("127.0.0.1:14550",),
    show_default=True,
    help="Ground station to send to; repeatable, `none` for none.",
)
@click.option(
    "--api",
    type=_address_or_none,
    metavar="[HOST:]PORT",
    multiple=True,
    default=("127.0.0.1:14540",),
    show_default=True,
    help="API client to send to; repeatable, `none` for none.",
)
@click.option(
    "--tcp",
    type=address_option,
    metavar="[HOST:]PORT",
    help="Listen for TCP connections of ground stations, e.g. at 127.0.0.1:5760.",
)
@click.option(
    "--ground-lockstep",
    type=address_option,
    metavar="[HOST:]PORT",
    help="One ground station in lockstep, instead of --gcs and --api.",
)
@click.option(
    "--vehicle",
    default="bebop",
    show_default=True,
    metavar="NAME|FILE",
    help=f"The vehicle that the autopilot assumes: {VEHICLES.choice()}.",
)
@click.option(
    "--law",
    metavar="NAME|FILE:CLASS",
    help=f"Control law: {', '.join(LAWS)}, or your own (docs/laws.md).  [default: CTL_LAW]",
)
@click.option(
    "--estimator",
    default="",
    metavar="FILE:CLASS",
    help="Your own estimator (docs/estimators.md).",
)
@click.option(
    "--planner",
    default="",
    metavar="FILE:CLASS",
    help="Your own path planner (docs/planners.md).",
)
@click.option(
    "--set",
    "settings",
    type=setting_option,
    metavar="NAME=VALUE",
    multiple=True,
    help="Set a parameter; repeatable. SIM_ parameters of the simulator are ignored.",
)
@click.option("--home", type=home_option, metavar="LAT,LON,ALT", help="Origin of the world: degrees, metres.")
@click.option(
    "--storage",
    type=NamedPath(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Folder that stores mission and parameters.  [default: the user's state directory]",
)
@click.option(
    "--signing-key",
    type=signing_key_option,
    metavar="FILE",
    help="Accept only messages signed with this key (64 hexadecimal digits or a pass phrase), and store it.",
)
@click.option(
    "--allow-setup-signing",
    is_flag=True,
    help="Accept a first signing key from any sender of SETUP_SIGNING.",
)
@click.option("--quiet", is_flag=True, help="Print errors only.")
@click.version_option(package_name="plumbline", message="autopilot (Plumbline) %(version)s")
def main(
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
    home: Home | None,
    storage: Path | None,
    signing_key: bytes | None,
    allow_setup_signing: bool,
    quiet: bool,
) -> None:
    """Fly a quadrotor with a load on a cable: sensors in, rotor commands out, MAVLink to ground stations."""

    def say(text: str) -> None:
        if not quiet:
            print(f"autopilot: {text}", flush=True)

    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until the loop runs, there is nothing to finish
    program: Program | None = None
    place = home or Home()
    in_step = ground_lockstep is not None
    aside = Aside()
    try:
        own = Own(own_law(law or DEFAULT_LAW), estimator, planner)
        table = parameters_for(load_belief(vehicle), own)
        check_names(settings, table.names)
        kept = Storage(storage or user_state_path("plumbline"))
        if not in_step:
            aside.branch_off()
        kept.lock()
        troubles = kept.load_parameters(table)
        if law:
            table.set("CTL_LAW", law_number(law))
        apply_settings(table, settings)
        table.freeze()
        if any(own):
            with watched_calls():
                try_all(own, table.values())
        parts = autopilot_parts((*LAWS, OWN)[int(table["CTL_LAW"])])
        compiled = ready(parts)
        if not compiled:
            gc.enable()  # the compiler leaves much garbage
            say(ONCE)
        mission, trouble = kept.load_mission(place)
        troubles += [trouble] if trouble else []
        if signing_key is not None:
            _begin_signing(kept, signing_key)
        boot = LOCKSTEP_BOOT_UNIX_US if in_step else SteadyClock().unix_us()
        options = Options(
            place, boot, clock_waits=in_step, log=True, own=own, setup_signing=allow_setup_signing
        )

        troubles += kept.load_world()[1]

        def build(stored: StoredMission | None) -> Onboard:
            onboard = Onboard(table, identity_of(table), options, stored, kept.card, kept.load_signing())
            onboard.restore_world(kept.load_world()[0])
            return onboard

        stations, programs = (tuple(filter(None, addresses)) for addresses in (gcs, api))
        storing = Storing(aside=not in_step)
        ground: GroundStations | GroundInStep
        if ground_lockstep:
            ground = GroundInStep(ground_lockstep)
        else:
            ground = GroundStations(stations, programs, listen(tcp) if tcp else None, storing)
        program = Program(build, mission, kept, storing, sim, ground, aside, say)
        areas, unread = kept.load_areas(place)
        program.take_areas(areas)
        program.tell(troubles + unread)
        program.onboard.rehearse()
        rehearse(program.onboard)
        if not compiled:
            for part in parts:
                part.done()
        be_punctual(real_time=not in_step)
        with StopRequest() as stop, watched_calls(not in_step) if any(own) else nullcontext():
            program.run(stop)
    except VehicleFileError as error:
        sys.exit(complain("autopilot", EXIT_USAGE, *error.problems))
    except (OwnError, ParameterError) as error:
        sys.exit(complain("autopilot", EXIT_USAGE, str(error)))
    except (AutopilotError, StorageError) as error:
        sys.exit(complain("autopilot", EXIT_ERROR, str(error)))
    except Stop:
        pass
    finally:
        if program is not None:
            program.close()
        aside.close()
    if program is not None:
        cost = "" if in_step else program.cost.summary()
        say("; ".join(filter(None, (f"stopped at t = {program.onboard.now_us / 1e6:.3f} s", cost))))


if __name__ == "__main__":
    main()
