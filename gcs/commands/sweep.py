"""gcs sweep"""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from autopilot.own.own_code import OwnCode
from autopilot.shell.options import WholeNumber
from autopilot.vehicle.parameters import DEFAULT_LAW
from gcs.commands.options import (
    OUTPUT_FOLDER,
    LawType,
    SettingType,
    fresh_option,
    json_option,
    law_help,
    mission_argument,
    own_options,
    print_json,
    require_options,
    sensors_option,
    time_limit_option,
    vehicle_option,
)
from gcs.commands.parameter_completion import complete_settings
from gcs.errors import EXIT_DONE, EXIT_REQUIRED
from gcs.shell.display import notify, results_to_stdout


@click.command("sweep")
@mission_argument
@click.option(
    "--law",
    "laws",
    type=LawType(),
    multiple=True,
    help=f"{law_help()} Repeatable.  [default: {DEFAULT_LAW}]",
)
@own_options
@sensors_option
@vehicle_option()
@click.option(
    "--vary",
    "varied",
    metavar="NAME=VALUES",
    multiple=True,
    shell_complete=complete_settings,
    help="Vary a parameter: NAME=LOW:HIGH:COUNT or NAME=A,B,C, with --sample NAME=LOW:HIGH or NAME=A,B,C; "
    "NAME=NAME=... gives several the same values; repeatable.",
)
@click.option(
    "--set",
    "settings",
    type=SettingType(),
    multiple=True,
    help="Set a parameter for all flights; repeatable.",
)
@click.option(
    "--seeds",
    metavar="N|SEEDS",
    default="1",
    show_default=True,
    help="Fly each setting with the seeds 1 ... N, or with a range or list of them, as 11:20 or 3,7,20:29.",
)
@click.option(
    "--sample",
    type=WholeNumber(min=1),
    help="Draw this many different settings (Latin hypercube) instead of flying the whole grid.",
)
@time_limit_option
@click.option(
    "--jobs",
    type=WholeNumber(min=1),
    help="Number of flights in parallel, one per core.  [default: all cores]",
)
@click.option("--scheduler", metavar="ADDRESS", help="Fly on a running Dask cluster, e.g. tcp://host:8786.")
@click.option(
    "--out",
    type=OUTPUT_FOLDER,
    help="Folder for table and report.  [default: sweeps/MISSION]",
)
@click.option(
    "--reports",
    is_flag=True,
    help="Fly the notable flights again, each with a report: for each law the worst, the median and "
    "the first lost flight.",
)
@click.option("--table-only", is_flag=True, help="Write the table without the page.")
@fresh_option
@require_options
@json_option
@click.option("--quiet", is_flag=True, help="Print no progress.")
@click.pass_context
def sweep_command(
    ctx: click.Context,
    mission: str,
    laws: tuple[str, ...],
    estimator: str | None,
    planner: str | None,
    sensors: str,
    vehicle: str,
    varied: tuple[str, ...],
    settings: tuple[str, ...],
    seeds: str,
    sample: int | None,
    limit_s: float | None,
    jobs: int | None,
    scheduler: str | None,
    out: Path | None,
    reports: bool,
    table_only: bool,
    fresh: bool,
    required: tuple[str, ...],
    junit: Path | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Fly a mission thousands of times under varied conditions.

    The flights are those of gcs fly --lockstep without the UDP link, ten to twenty per second on each core.
    Every parameter of the simulator and of the autopilot can be varied. Afterwards, the folder contains
    flights.parquet (a row for each flight), report.html with plots, and plan.json. The same command continues
    a sweep that was stopped, and extends it if it has more seeds or values.

    The mission is not checked beforehand; gcs check MISSION shows whether the vehicle can fly it. A path that
    the autopilot refuses is flown as requested with --set MIS_INFEASIBLE=0, and slower with 1.

    \b
    gcs sweep case-b --vary SIM_ACT_DELAY_MS=0:60:7 --seeds 5
    gcs sweep case-b --law plumbline --law thesis --vary SIM_NOISE_SCALE=0.5:4:8 --vary SIM_SENS_LAT_MS=0,5,10
    gcs sweep case-c --vary SIM_LOAD_MASS=0.05:0.15 --vary SIM_GUST_STD=0:2 --sample 500
    gcs sweep case-b --vary SIM_CABLE_LEN=VEH_CABLE_LEN=0.5:2:4 --seeds 5
    """
    if jobs is not None and scheduler is not None:
        raise click.UsageError("--jobs is for processes of our own; a Dask cluster has its workers", ctx)

    from gcs.batch.progress import rate_text
    from gcs.sweep.results import interval_text
    from gcs.workflows.requirements import (
        ALL_FLOWN,
        COMPLETED,
        check_requirements,
        junit_on_error,
        parse_requirements,
        report_verdicts,
        uncovered_failures,
    )
    from gcs.workflows.sweep import FIGURES, SweepOptions, run_sweep

    requirements = parse_requirements(required, FIGURES, "gcs sweep --json")
    run = f"gcs sweep {mission}"
    options = SweepOptions(
        mission=mission,
        laws=laws or (DEFAULT_LAW,),
        own=OwnCode(estimator=estimator or "", planner=planner or ""),
        sensors=sensors,
        vehicle=vehicle,
        varied=varied,
        settings=settings,
        seeds=seeds,
        sample=sample,
        jobs=jobs,
        scheduler=scheduler,
        out=out,
        reports=reports,
        table_only=table_only,
        limit_s=limit_s,
        fresh=fresh,
        quiet=quiet or as_json,
        command=shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
    )
    with junit_on_error(run, junit, ALL_FLOWN):
        sweep = run_sweep(options)
    if as_json:
        print_json(sweep.record)
    else:
        counts = sweep.counts
        rate = f", {rate_text(counts.flights_per_s)}" if counts.flown else ""
        if counts.flown < counts.flights:
            rate += f"; {counts.flights - counts.flown} of them were there already"
        interval = interval_text(counts.completed, counts.flights)
        share = f" (95 % interval of the share: {interval} %)" if counts.flights else ""
        notify(
            f"{sweep.name}: {counts.flights} of {sweep.planned} flights flown, "
            f"{counts.completed} completed{share}{rate}"
        )
        with results_to_stdout():
            for one in () if quiet else sweep.flights:
                click.echo(
                    f"{one['law']}, {one['kind']} (flight {one['index']}, {one['told']}): {one['command']}"
                )
            click.echo(f"{'table' if table_only else 'report'}: {sweep.result}")
    outcome = COMPLETED if sweep.counts.is_complete else "interrupted"
    verdicts = check_requirements(requirements, sweep.record)
    all_met = report_verdicts(run, junit, outcome, sweep.counts.wall_s, verdicts, case=ALL_FLOWN)
    if sweep.counts.is_complete and (
        remark := uncovered_failures(requirements, sweep.counts.flights, sweep.counts.completed)
    ):
        notify(remark)
    return sweep.exit_code or (EXIT_DONE if all_met else EXIT_REQUIRED)
