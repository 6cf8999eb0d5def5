"""A flight by a third-party autopilot in Plumbline's simulator: both are started, and stopped afterwards."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import closing, contextmanager
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from autopilot.trajectory.timeline import expected_duration_s
from autopilot.vehicle.file import load_vehicle
from autopilot.wire.convert.geodesy import Home
from gcs.clients.capture import Capture, FrameLog
from gcs.clients.connection import LINK_TIMEOUT_US
from gcs.clients.firmware_flight import FIRMWARES, Firmware, FirmwareFlight
from gcs.clients.firmware_mission import FirmwareMissionError, firmware_items
from gcs.errors import GcsError, InputError
from gcs.shell.display import FlightDisplay
from gcs.shell.link import DEFAULT_PORT, LOOPBACK, UdpSocket, free_port, unix_us
from gcs.shell.processes import Processes
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_inputs import split_settings
from gcs.workflows.flight_loops import run_wall_clock
from gcs.workflows.flight_options import FirmwareProgram, FlightOptions, parse_setting
from gcs.workflows.stopwatch import Stopwatch
from gcs.workflows.vehicle_processes import FIRMWARE_LOG, SIMULATOR_LOG, VehicleProcesses
from missions.model import Mission
from missions.nearest import nearest

if TYPE_CHECKING:
    from gcs.workflows.flight_page import FlightPage

FIRMWARE_FOLDER = "firmware"  # in the directory of the flight: the firmware's own files
_PX4_PHYSICS = 4560  # TCP; PX4's startup script supports no other


def firmware_program(text: str) -> FirmwareProgram:
    """The program of KIND=PATH; InputError says what is wrong with the text."""
    kind, _, path = text.partition("=")
    program = Path(path).expanduser()
    if kind not in FIRMWARES or not path:
        known = " or ".join(f"{name}=PATH" for name in FIRMWARES)
        similar = nearest(kind, FIRMWARES)
        hint = f"; did you mean {similar}?" if similar != kind and similar else ""
        raise InputError(f"--autopilot {text}: must be {known}{hint}")
    if not (program.is_file() and os.access(program, os.X_OK)):
        raise InputError(f"--autopilot {text}: no program there; see docs/autopilots.md on where to get one")
    return FirmwareProgram(kind, program.resolve())


def firmware_client(
    mission: Mission, options: FlightOptions, firmware: Firmware, home: Home
) -> FirmwareFlight:
    """The ground station's side of the flight; GcsError if the firmware cannot fly the mission."""
    vehicle = load_vehicle(options.vehicle)
    try:
        items = firmware_items(
            mission.steps,
            home,
            vehicle.cable_length_m,
            vehicle.gear_height_m,
            firmware.item_0_is_home,
            firmware.accepts_low_takeoff,
        )
    except FirmwareMissionError as error:
        raise GcsError(f"{options.mission}: {error}") from None
    time_stretch = 1.0 if options.speed is None else max(1.0, 1.0 / options.speed)
    expected_s = expected_duration_s(mission)
    return FirmwareFlight(firmware, items, expected_s, options.limit_s, round(LINK_TIMEOUT_US * time_stretch))


@contextmanager
def start_firmware(program: FirmwareProgram, options: FlightOptions, out: Path) -> Iterator[VehicleProcesses]:
    """Start simulator and firmware, and end them afterwards. The files of the firmware stay in `out`."""
    simulator_settings, firmware_settings = split_settings(
        options.vehicle, options.sensors, map(parse_setting, options.settings)
    )
    folder = (out / FIRMWARE_FOLDER).resolve()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    command_of = _COMMANDS[program.kind]
    port = DEFAULT_PORT if program.kind == "px4" else 0  # to which the firmware sends for the ground station
    with (
        Processes() as processes,
        closing(UdpSocket(LOOPBACK, port)) as vehicle,
        closing(UdpSocket()) as truth,
    ):
        physics = _PX4_PHYSICS if program.kind == "px4" else free_port()
        _start_simulator(processes, program.kind, options, simulator_settings, out, physics, truth.address)
        command, environment = command_of(
            program.path, folder, _parameters(program.kind, firmware_settings), physics, vehicle
        )
        title = FIRMWARES[program.kind].title
        processes.start_program(title, command, out / FIRMWARE_LOG, folder, environment)
        yield VehicleProcesses(processes, vehicle, truth)


def _ardupilot(
    program: Path, folder: Path, parameters: str, physics: int, vehicle: UdpSocket
) -> tuple[list[str], dict[str, str]]:
    """ArduPilot's command line, and its environment variables: it sends to us, and listens on no port."""
    file = folder / "plumbline.parm"
    file.write_text(parameters, encoding="ascii")
    home = Home()
    command = [
        *(str(program), "--model", f"JSON:{LOOPBACK}", "--sim-port-out", str(physics)),
        *("--defaults", str(file), "--wipe"),
        *("--home", f"{home.latitude_deg},{home.longitude_deg},{home.altitude_m},0"),
        *("--serial0", f"udpclient:{vehicle.address}", "--serial1", "none", "--serial2", "none"),
    ]
    return command, {}


def _px4(
    program: Path, folder: Path, parameters: str, physics: int, vehicle: UdpSocket
) -> tuple[list[str], dict[str, str]]:
    """The same for PX4, whose startup searches PATH for px4-rc.params; `etc` is a folder of its build."""
    etc = program.parent.parent / "etc"
    if not etc.is_dir():
        raise InputError(f"--autopilot px4={program}: no folder {etc}; name bin/px4 of a build of px4_sitl")
    lines = [line.split() for line in parameters.splitlines() if line and not line.startswith("#")]
    text = "".join(f"param set-default {name} {value}\n" for name, value in lines)
    (folder / "px4-rc.params").write_text(text, encoding="ascii")
    command = [str(program), "-d", str(etc), "-s", "etc/init.d-posix/rcS", "-w", str(folder)]
    return command, {"PATH": f"{folder}:{os.environ.get('PATH', '')}", "PX4_SIM_MODEL": "none_iris"}


_COMMANDS = {"ardupilot": _ardupilot, "px4": _px4}
_SINGLE_THREADED = ("ardupilot",)  # these fly in one thread, which waits while the simulator works


def fly_firmware(
    mission: Mission,
    options: FlightOptions,
    program: FirmwareProgram,
    log: FrameLog,
    started: VehicleProcesses,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None = None,
) -> FirmwareFlight:
    """Fly with the simulator and the firmware that were started for it."""
    client = firmware_client(mission, options, FIRMWARES[program.kind], Home())

    def on_first_message() -> None:
        watch.start()
        if options.speed is None and program.kind in _SINGLE_THREADED:
            started.processes.share_one_core()

    with FlightDisplay(mission.name, options.quiet) as display:
        capture = Capture(log, unix_us())
        run_wall_clock(
            *(
                client,
                capture,
                started.vehicle,
                started.truth,
                started.processes.end_reason,
                display,
                stop,
                on_first_message,
                page,
            )
        )
        client.explain_silence(started.processes.stopped_children())
        watch.stop()
    return client


def _start_simulator(
    processes: Processes,
    kind: str,
    options: FlightOptions,
    settings: list[tuple[str, float]],
    out: Path,
    physics: int,
    truth: str,
) -> None:
    pace = ["--lockstep"] if options.speed is None else ["--speed", f"{options.speed:g}"]
    world = ["--vehicle", options.vehicle, "--sensors", options.sensors, "--seed", str(options.seed)]
    links = ["--for", kind, "--listen", f"{LOOPBACK}:{physics}", "--truth", truth]
    changed = [word for name, value in settings for word in ("--set", f"{name}={value!r}")]
    processes.start("sitl", [*links, *world, *pace, *changed], out / SIMULATOR_LOG)


def _parameters(kind: str, settings: list[tuple[str, float]]) -> str:
    """The firmware's parameters: the shipped ones, then those that the user sets."""
    shipped = (files("sitl.interfaces") / f"{kind}.parm").read_text(encoding="ascii")
    return shipped + "".join(f"{name} {value:.9g}\n" for name, value in settings)
