"""A flight without sockets: simulator, autopilot and ground station in this process."""

from __future__ import annotations

from collections.abc import Callable

from autopilot.own.law import law_number
from autopilot.shell.watched_calls import watched_calls
from gcs.clients.capture import FrameLog
from gcs.clients.flight import Outcome
from gcs.closed_loop import Conditions, fly
from gcs.foreign_mission import home_of
from gcs.shell.display import FlightDisplay
from gcs.workflows.before_flight import (
    check_law,
    check_mission,
    check_options,
    mission_warnings,
    wind_warnings,
)
from gcs.workflows.flight_options import FlightOptions, parse_setting
from gcs.workflows.started_flight import flight_client
from gcs.workflows.warmup import in_process_parts, vehicle_parts, warm_up
from missions.model import Mission


def fly_in_process(
    mission: Mission,
    options: FlightOptions,
    log: FrameLog,
    warn: Callable[[str], None] = lambda _: None,
    log_sensors: Callable[[bytes], object] | None = None,
) -> Outcome:
    """Fly as `gcs fly` does in lockstep; the log gets the same bytes. GcsError if it cannot be flown.

    `warn` is called with a line for each option that may be unintended, if machine code cannot be kept, and
    for what the vehicle lacks in the wind, `log_sensors` with the bytes of a log of the sensors.
    """
    check_law(mission, options)
    for line in (*check_options(options), *mission_warnings(options.planner, mission)):
        warn(line)
    of_the_vehicle = vehicle_parts(options.vehicle, map(parse_setting, options.settings))
    notes: list[str] = []
    warm_up([*in_process_parts((options.law,)), *of_the_vehicle], options.quiet, warn=notes.append)
    for line in notes:
        warn(line)
    check_mission(mission, options)
    for line in wind_warnings(mission, options):
        warn(line)
    settings = {"CTL_LAW": float(law_number(options.law)), **dict(map(parse_setting, options.settings))}
    client = flight_client(mission, options, home_of(mission))
    with FlightDisplay(mission.name, options.quiet) as display, watched_calls():

        def show() -> None:
            if display.due:
                display.update(client.progress)

        conditions = Conditions(
            options.vehicle,
            options.sensors,
            options.seed,
            settings,
            options.own,
            ignored=frozenset(options.ignored),
        )
        return fly(mission, conditions, log, client=client, on_turn=show, log_sensors=log_sensors)
