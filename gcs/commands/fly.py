"""gcs fly"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from autopilot.shell.options import MAX_SEED, MAX_SPEED, WholeNumber, ignore_option
from gcs.commands.options import (
    OUTPUT_FOLDER,
    AddressType,
    PositiveType,
    SettingType,
    json_option,
    law_option,
    mission_argument,
    own_options,
    page_options,
    pictures_option,
    print_json,
    require_options,
    sensors_option,
    sysid_option,
    time_limit_option,
    truth_option,
    vehicle_option,
)
from gcs.errors import EXIT_DONE, EXIT_REQUIRED
from gcs.shell.display import notify, write_to_stdout
from gcs.shell.link import DEFAULT_PORT, Address

if TYPE_CHECKING:
    from gcs.analysis.record import Record
    from gcs.clients.flight import Outcome

_STARTED_ONLY = (
    "law",
    "estimator",
    "planner",
    "sensors",
    "seed",
    "lockstep",
    "speed",
    "real_time",
    "settings",
    "ignore",
)  # options that have no effect on a vehicle that is already running


@click.command("fly")
@mission_argument
@law_option
@own_options
@sensors_option
@vehicle_option()
@click.option(
    "--autopilot",
    "firmware",
    metavar="KIND=PROGRAM",
    help="Fly with a third-party autopilot, ardupilot=PROGRAM or px4=PROGRAM; see docs/autopilots.md.",
)
@click.option(
    "--seed", type=WholeNumber(0, MAX_SEED), default=1, show_default=True, help="Seed of all noise."
)
@click.option("--lockstep", is_flag=True, help="Fly as fast as possible, reproducible to the byte (default).")
@click.option(
    "--speed",
    type=PositiveType(max_value=MAX_SPEED),
    help="Fly at NUMBER times real time; other ground stations can watch on ports 14550 and 14540.",
)
@click.option(
    "--real-time",
    is_flag=True,
    help="Like --speed 1, but the simulator does not wait: a late rotor command is missed and counted.",
)
@click.option(
    "--set",
    "settings",
    type=SettingType(),
    multiple=True,
    help="Set a parameter of the simulator (SIM_*) or of the autopilot; repeatable.",
)
@ignore_option("Fly")
@click.option(
    "--log-sensors",
    is_flag=True,
    help="Keep every reading of every sensor and the true state, as tables; see docs/sensors.md.",
)
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    help="Folder for telemetry and report.  [default: flights/MISSION-TIME]",
)
@click.option(
    "--connect",
    type=AddressType(),
    is_flag=False,
    flag_value=str(DEFAULT_PORT),
    help="Fly a vehicle that is already running, at PORT or HOST:PORT (14550 without a value).",
)
@sysid_option
@truth_option
@time_limit_option
@click.option("--force", is_flag=True, help="Fly the mission even if it exceeds the limits of the vehicle.")
@click.option("--overwrite", is_flag=True, help="Replace an earlier flight in --out.")
@click.option("--view", is_flag=True, help="Show the flight live in a browser; see gcs view.")
@page_options
@pictures_option
@require_options
@json_option
@click.option("--quiet", is_flag=True, help="Print only the outcome, no progress and no table.")
@click.pass_context
def fly_command(
    ctx: click.Context,
    mission: str,
    law: str,
    estimator: str | None,
    planner: str | None,
    sensors: str,
    vehicle: str,
    firmware: str | None,
    seed: int,
    lockstep: bool,
    speed: float | None,
    real_time: bool,
    settings: tuple[str, ...],
    ignore: tuple[str, ...],
    log_sensors: bool,
    out: Path | None,
    connect: Address | None,
    truth_at: Address | None,
    limit_s: float | None,
    force: bool,
    overwrite: bool,
    view: bool,
    port: int | None,
    bind: str,
    pictures: tuple[str, ...],
    required: tuple[str, ...],
    junit: Path | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Fly a mission from start to report.

    MISSION is the name of a shipped mission (see gcs missions), the path of a mission file, or a .plan or
    .waypoints file of another ground station. A simulator and an autopilot are started for the flight and
    stopped after it; --connect uses running ones instead. The mission is checked, uploaded and flown, all
    telemetry is captured, and a report is written.

    \b
    gcs fly case-b
    gcs fly case-a --vehicle thesis --sensors ideal
    gcs fly square --set SIM_WIND_E=3 --seed 7 --out windy
    gcs fly hover --speed 1
    gcs fly square --view --speed 1
    """
    if lockstep and (speed is not None or real_time):
        other = "--speed" if speed is not None else "--real-time"
        raise click.UsageError(f"--lockstep and {other} exclude each other", ctx)
    if real_time and speed is None:
        speed = 1.0
    if connect is not None:
        given = [
            name for name in _STARTED_ONLY if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE
        ]
        if given:
            option = "--set" if given[0] == "settings" else f"--{given[0].replace('_', '-')}"
            raise click.UsageError(
                f"{option} is for processes that fly starts; with --connect give it to sitl and autopilot",
                ctx,
            )

    elif truth_at is not None:
        raise click.UsageError("--truth is that of a running simulator: add --connect", ctx)
    elif ctx.get_parameter_source("sysid") is ParameterSource.COMMANDLINE:
        raise click.UsageError("--sysid is that of a running vehicle: add --connect", ctx)

    if log_sensors and (connect is not None or firmware is not None):
        other = "--connect" if connect is not None else "--autopilot"
        raise click.UsageError(f"--log-sensors and {other} exclude each other", ctx)
    program = None
    if firmware is not None:
        if connect is not None or real_time:
            other = "--real-time" if real_time else "--connect"
            raise click.UsageError(f"--autopilot and {other} exclude each other", ctx)
        for name in ("law", "estimator", "planner", "ignore"):
            if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise click.UsageError(f"--{name} is for our own autopilot; --autopilot brings its own", ctx)
        from gcs.workflows.firmware_processes import firmware_program

        program = firmware_program(firmware)
    page = None
    if view:
        from gcs.workflows.flight_page import PageOptions

        page = PageOptions(bind, port)
    else:
        for name in ("port", "bind"):
            if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
                raise click.UsageError(f"--{name} is that of the page: add --view", ctx)
    from gcs.shell.processes import Processes

    processes = ctx.with_resource(Processes())
    if connect is None and firmware is None:
        for name in ("autopilot", "sitl"):  # first the one that takes longer
            processes.load(name)  # while this process loads its own modules
    from gcs.workflows.flight_options import FlightOptions
    from gcs.workflows.fly import fly
    from gcs.workflows.report import print_record
    from gcs.workflows.requirements import (
        check_requirements,
        junit_on_error,
        parse_requirements,
        report_verdicts,
    )

    requirements = []
    if required:
        from gcs.analysis.definitions import METRICS

        requirements = parse_requirements(required, list(METRICS), "gcs fly --json and docs/report.md")

    output_errors: list[OSError] = []

    def report(record: Record, outcome: Outcome) -> None:
        try:
            if as_json:
                write_to_stdout(lambda: print_json(record))
            elif not quiet:
                write_to_stdout(lambda: print_record(record))
        except OSError as error:  # of stdout, for example on a full disk: the report is made nevertheless
            output_errors.append(error)
        reason = f": {outcome.reason}" if outcome.reason else ""
        notify(f"{mission}: {outcome.name}{reason}")

    options = FlightOptions(
        mission=mission,
        law=law,
        sensors=sensors,
        vehicle=vehicle,
        seed=seed,
        speed=speed,
        real_time=real_time,
        out=out,
        settings=settings,
        connect=connect,
        quiet=quiet or as_json,
        force=force,
        overwrite=overwrite,
        limit_s=limit_s,
        firmware=program,
        estimator=estimator or "",
        planner=planner or "",
        truth_at=truth_at,
        pictures=pictures,
        log_sensors=log_sensors,
        ignored=ignore,
    )
    run = f"gcs fly {mission}"
    with junit_on_error(run, junit):
        flight = fly(options, report, page, processes)
    if output_errors:
        raise output_errors[0]
    if not (as_json or quiet):
        write_to_stdout(lambda: click.echo(f"report: {flight.out / 'report.html'}"))
    wall_s = flight.record["wall_s"] or 0.0
    outcome = flight.outcome
    all_met = report_verdicts(
        run, junit, outcome.name, wall_s, check_requirements(requirements, flight.record), outcome.reason
    )
    return flight.exit_code or (EXIT_DONE if all_met else EXIT_REQUIRED)
