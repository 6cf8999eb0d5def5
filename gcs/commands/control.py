"""gcs arm, disarm, start, pause, resume, takeoff, land, mode: one command to a running vehicle each."""

from __future__ import annotations

from collections.abc import Callable

import click

from gcs.clients import command
from gcs.clients.operation import Operation
from gcs.clients.vehicle_view import FLOWN_MODES
from gcs.commands.options import PositiveType, connect_option
from gcs.shell.link import Address
from gcs.shell.session import Session


def _send(address: Address, make: Callable[[Session], Operation], begins: bool = False) -> None:
    """`begins`: what is asked for begins with arming if the vehicle is not armed."""
    with Session(address) as session:
        session.find()
        text = session.run(make(session)).text
        waits = "; it begins when the vehicle is armed: gcs arm" if begins and not session.view.armed else ""
        click.echo(text + waits)


@click.command("arm")
@click.option("--force", is_flag=True, help="Without the vehicle's own checks.")
@connect_option
def arm_command(force: bool, address: Address) -> None:
    """Start the rotors.

    The vehicle refuses, and says why, while it is not ready.
    """
    _send(address, lambda session: command.arm(session.target, force))


@click.command("disarm")
@click.option("--force", is_flag=True, help="Even in the air: the vehicle falls.")
@connect_option
def disarm_command(force: bool, address: Address) -> None:
    """Stop the rotors.

    In the air the vehicle refuses.
    """
    _send(address, lambda session: command.disarm(session.target, force))


@click.command("start")
@connect_option
def start_command(address: Address) -> None:
    """Fly the mission on the vehicle from its first item.

    A disarmed vehicle accepts it and begins when it is armed.
    """
    _send(address, lambda session: command.start_mission(session.target), begins=True)


@click.command("pause")
@connect_option
def pause_command(address: Address) -> None:
    """Hold the load where it is.

    gcs resume goes on with the mission.
    """
    _send(address, lambda session: command.pause(session.target))


@click.command("resume")
@connect_option
def resume_command(address: Address) -> None:
    """Go on with a paused mission."""
    _send(address, lambda session: command.resume(session.target))


@click.command("takeoff")
@click.argument("height", type=PositiveType(), required=False)
@click.option("--altitude", type=PositiveType(), help="The same as HEIGHT.")
@connect_option
def takeoff_command(height: float | None, altitude: float | None, address: Address) -> None:
    """Lift the load and hold it.

    HEIGHT is that of the load above home in m; without it the vehicle's MIS_TAKEOFF_ALT counts. The vehicle
    must be armed, or is armed next.
    """
    from gcs.workflows.running_flight import vehicle_home

    if height is not None and altitude is not None:
        raise click.UsageError("HEIGHT and --altitude are the same; give one")
    altitude_m = height if altitude is None else altitude

    def make(session: Session) -> Operation:
        if altitude_m is None:
            return command.takeoff(session.target)
        return command.takeoff(session.target, vehicle_home(session).altitude_m + altitude_m)

    _send(address, make, begins=True)


@click.command("land")
@connect_option
def land_command(address: Address) -> None:
    """Set the load down, and the vehicle beside it."""
    _send(address, lambda session: command.land(session.target))


@click.command("mode")
@click.argument("name", type=click.Choice(sorted(FLOWN_MODES)))
@connect_option
def mode_command(name: str, address: Address) -> None:
    """Change the flight mode.

    NAME is a PX4 mode that the vehicle has, in plain words.
    """
    main, sub = FLOWN_MODES[name]
    _send(
        address,
        lambda session: command.set_mode(session.target, name, main, sub, armed=bool(session.view.armed)),
    )
