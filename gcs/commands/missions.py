"""gcs missions, check: mission files, without a vehicle."""

from __future__ import annotations

from dataclasses import asdict

import click

from gcs.commands.options import json_option, print_json, print_table, vehicle_option
from gcs.errors import EXIT_DONE, EXIT_ERROR


@click.command("missions")
@json_option
def missions_command(as_json: bool) -> None:
    """List the shipped missions."""
    from gcs.workflows.check_mission import load
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
@click.argument("mission")
@vehicle_option("The vehicle that is to fly it")
@click.option("--as-asked", is_flag=True, help="Judge the paths as asked, not shaped.")
@json_option
def check_command(mission: str, vehicle: str, as_asked: bool, as_json: bool) -> int:
    """Check whether a vehicle can fly a mission.

    MISSION is a shipped name or the path of a mission file. Every limit that it breaks is named, with by how
    much and when; the exit code is 1 if there is any. Of what can be flown it is told how long it takes, how
    far from the asked path it is, and what it takes of rotors, cable and tilt. With --as-asked the paths are
    judged as the laws thesis and lqr fly them, not shaped to what can be flown.
    """
    from gcs.workflows.check_mission import load, path_reports, violations

    loaded = load(mission)
    found = violations(loaded, vehicle, not as_asked)
    reports = [] if found or as_asked else path_reports(loaded, vehicle)
    if as_json:
        print_json(
            {
                "mission": loaded.name,
                "vehicle": vehicle,
                "violations": [asdict(v) for v in found],
                "paths": [asdict(r) for r in reports],
            }
        )
    elif found:
        for violation in found:
            click.echo(str(violation))
    else:
        click.echo(f"{loaded.name}: vehicle {vehicle} can fly it")
        for report in reports:
            click.echo(str(report))
    return EXIT_ERROR if found else EXIT_DONE
