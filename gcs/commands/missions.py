"""gcs missions, check: mission files, without a vehicle."""

from __future__ import annotations

from dataclasses import asdict

import click

from autopilot.shell.options import ignore_option
from gcs.commands.options import (
    SettingType,
    json_option,
    mission_argument,
    planner_option,
    print_json,
    print_table,
    vehicle_option,
)
from gcs.errors import EXIT_DONE, EXIT_ERROR
from gcs.shell.display import notify_if_slow


@click.command("missions")
@json_option
def missions_command(as_json: bool) -> None:
    """List the shipped missions."""
    from gcs.mission_files import load
    from missions.fileformat import shipped

    missions = [load(name) for name in shipped()]
    if as_json:
        print_json(
            [
                {
                    "name": mission.name,
                    "title": mission.title,
                    "description": " ".join(mission.description.split()),
                    "assumptions": mission.assumptions,
                }
                for mission in missions
            ]
        )
        return
    print_table([(mission.name, mission.title) for mission in missions])


@click.command("check")
@mission_argument
@vehicle_option("The vehicle that is to fly it")
@planner_option
@ignore_option("Check")
@click.option(
    "--set",
    "settings",
    type=SettingType(),
    multiple=True,
    help="Set a parameter of the autopilot, such as MIS_ROTOR_MARG, or the wind (SIM_WIND_E, SIM_WIND_N); "
    "repeatable.",
)
@click.option("--as-asked", is_flag=True, help="Check the paths as asked, not shaped.")
@click.option(
    "--law",
    help="Check the paths as this built-in law flies them: plumbline (shaped), thesis or lqr (as asked).",
)
@json_option
@click.pass_context
def check_command(
    ctx: click.Context,
    mission: str,
    vehicle: str,
    planner: str | None,
    ignore: tuple[str, ...],
    settings: tuple[str, ...],
    as_asked: bool,
    law: str | None,
    as_json: bool,
) -> int:
    """Check whether a vehicle can fly a mission.

    MISSION is a shipped name, the path of a mission file, or a .plan or .waypoints file of another ground
    station. Every limit that it breaks is printed, with the time and the excess, or else what the vehicle
    would refuse, such as a path that leaves the fence of a .plan; the exit code is then 1. Otherwise the
    duration of each path, its distance from the requested path, and its peaks of rotor force, tension and
    tilt are printed, and the steady wind that the vehicle withstands. With --as-asked the paths are judged as
    the laws thesis and lqr fly them, without shaping, as with --law of one of these; how closely such a law
    follows them is not judged. With --planner the paths through waypoints are those of your own planner,
    whose errors are printed.
    """
    from autopilot.vehicle.parameters import DEFAULT_LAW, LAWS

    if law is not None and law not in LAWS:
        raise click.UsageError(
            f"--law {law}: must be {', '.join(LAWS)}; paths are checked and not your own law: with "
            "--as-asked unless it has follows_shaped",
            ctx,
        )
    as_asked = as_asked or law not in (None, DEFAULT_LAW)
    if planner and as_asked:
        raise click.UsageError(
            "--as-asked, and --law thesis or lqr, judge no path of a planner; leave --planner or these out",
            ctx,
        )

    from gcs.workflows.before_flight import CHECKING_TEXT
    from gcs.workflows.check_mission import check_mission, check_parameters
    from gcs.workflows.flight_options import parse_setting

    given = [parse_setting(one) for one in settings]
    delivered = check_parameters(vehicle, planner or "", ignore)
    if planner:
        from gcs.workflows.own_planner import own_planner

        with own_planner(planner, delivered.values()) as own:
            found = check_mission(mission, vehicle, as_asked, own, given, law or "")
    else:
        with notify_if_slow(CHECKING_TEXT, as_json):
            found = check_mission(mission, vehicle, as_asked, settings=given, law=law or "")
    if as_json:
        print_json(asdict(found))
    else:
        click.echo("\n".join(found.lines()))
    return EXIT_ERROR if found.problems else EXIT_DONE
