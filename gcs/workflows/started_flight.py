"""A flight by a simulator and an autopilot that were started for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from autopilot.own.own_code import parameters_for
from autopilot.vehicle.file import load_belief
from autopilot.vehicle.parameters import apply_settings
from autopilot.wire.convert.geodesy import Home
from gcs.clients.capture import LOCKSTEP_BOOT_UNIX_US, Capture, FrameLog
from gcs.clients.connection import LINK_TIMEOUT_US
from gcs.clients.flight import FlightClient
from gcs.expected_flight import expected_flight_s
from gcs.foreign_mission import home_of
from gcs.mission_items import areas_of, items_of
from gcs.shell.display import FlightDisplay
from gcs.shell.link import unix_us
from gcs.shell.processes import STOPPED_LIMIT_S
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_loops import run_lockstep, run_wall_clock
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.stopwatch import Stopwatch
from gcs.workflows.vehicle_processes import VehicleProcesses
from missions.model import Mission

if TYPE_CHECKING:
    from gcs.workflows.flight_page import FlightPage


def flight_client(
    mission: Mission, options: FlightOptions, home: Home, link_timeout_us: int = LINK_TIMEOUT_US
) -> FlightClient:
    """The ground station's side of a flight; `home` is the vehicle's, `link_timeout_us` its longest
    silence."""
    time_stretch = 1.0 if options.speed is None else max(1.0, 1.0 / options.speed)
    return FlightClient(
        items_of(mission, home),
        _expected_s(mission, options),
        options.limit_s,
        round(link_timeout_us * time_stretch),
        areas_of(mission),
    )


def _expected_s(mission: Mission, options: FlightOptions) -> float:
    """How long the flight should take with the assumed vehicle and the settings of the options."""
    table = parameters_for(load_belief(options.vehicle), options.own, ignored=options.ignored)
    apply_settings(table, map(parse_setting, options.settings))
    return expected_flight_s(mission, table)


def fly_started_vehicle(
    mission: Mission,
    options: FlightOptions,
    log: FrameLog,
    started: VehicleProcesses,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None = None,
) -> FlightClient:
    """Fly with the simulator and the autopilot that were started for it."""
    # this long, so that a program that was stopped (SIGSTOP) is reported before the vehicle counts as lost
    link_timeout_us = round(1e6 * STOPPED_LIMIT_S) + LINK_TIMEOUT_US
    client = flight_client(mission, options, home_of(mission), link_timeout_us)

    def on_first_message() -> None:
        watch.start()
        if options.speed is None:
            started.processes.share_one_core()

    with FlightDisplay(mission.name, options.quiet) as display:
        link = (
            started.vehicle,
            started.truth,
            started.processes.end_reason,
            display,
            stop,
            on_first_message,
            page,
        )
        if options.speed is None:
            capture, own_code = Capture(log, LOCKSTEP_BOOT_UNIX_US), tuple(filter(None, options.own))
            run_lockstep(client, capture, *link, started.processes.are_busy, own_code)
        else:
            run_wall_clock(client, Capture(log, unix_us()), *link)
            client.explain_silence(started.processes.stopped_children())
        watch.stop()
    return client
