"""gcs arm, disarm, start, pause, resume, takeoff, goto, land, winch, release, grab, mode: each sends one
command to the vehicle."""

from __future__ import annotations

from collections.abc import Callable
from math import isnan

import click

from gcs.clients import command
from gcs.clients.modes import ALIASES, MODES, change_mode
from gcs.clients.operation import Operation
from gcs.commands.options import FiniteType, OptionalArgument, PositiveType, connect_option
from gcs.errors import RefusedError
from gcs.shell.link import Address
from gcs.shell.session import Session

MISSION_STATE_S = 1.5  # in which a vehicle reports whether it flies a mission, once a second


def _send(address: Address, make: Callable[[Session], Operation], needs_arming: bool = False) -> None:
    """Send one command and print the answer. `needs_arming`: a disarmed vehicle executes it when armed."""
    with Session(address) as session:
        session.find_to_command()
        text = session.run(make(session)).text
        click.echo(text + (_arming_hint(session) if needs_arming else ""))


def _arming_hint(session: Session) -> str:
    """What a disarmed vehicle waits for."""
    return "" if session.view.armed else "; it begins when the vehicle is armed: gcs arm"


@click.command("arm")
@click.option("--force", is_flag=True, help="Skip the pre-arm checks of the vehicle.")
@connect_option
def arm_command(force: bool, address: Address) -> None:
    """Start the rotors.

    If the vehicle is not ready, the command waits up to ten seconds; then the vehicle refuses and says why.
    """
    from gcs.workflows.readiness import wait_until_ready

    def make(session: Session) -> Operation:
        if not force:
            wait_until_ready(session)
        return command.arm(session.target, force)

    _send(address, make)


@click.command("disarm")
@click.option("--force", is_flag=True, help="Stop them even in the air: the vehicle falls.")
@connect_option
def disarm_command(force: bool, address: Address) -> None:
    """Stop the rotors.

    The vehicle refuses this in the air.
    """
    try:
        _send(address, lambda session: command.disarm(session.target, force))
    except RefusedError as error:
        raise error if force else RefusedError(f"{error}; --force stops the rotors even in the air") from None


@click.command("start")
@connect_option
def start_command(address: Address) -> None:
    """Fly the mission on the vehicle from its first item.

    A disarmed vehicle accepts the command and starts when it is armed. A mission under way begins again.
    """
    with Session(address) as session:
        session.find_to_command()
        if session.view.armed:
            session.watch(lambda: session.view.mission_state is not None, MISSION_STATE_S)
        is_under_way = session.view.mission_state == "active"
        text = session.run(command.start_mission(session.target)).text
        restart_hint = (
            "; it was under way, and begins again (gcs resume continues a paused mission)"
            if is_under_way
            else ""
        )
        click.echo(text + restart_hint + _arming_hint(session))


@click.command("pause")
@connect_option
def pause_command(address: Address) -> None:
    """Hold the load where it is.

    gcs resume continues the mission.
    """
    _send(address, lambda session: command.pause(session.target))


@click.command("resume")
@connect_option
def resume_command(address: Address) -> None:
    """Continue a paused mission.

    A disarmed vehicle accepts the command and starts its mission when it is armed.
    """
    _send(address, lambda session: command.resume(session.target), needs_arming=True)


@click.command("takeoff", context_settings={"ignore_unknown_options": True})  # -1 is a number here
@click.argument("height", type=PositiveType(), required=False, cls=OptionalArgument)
@click.option("--altitude", type=PositiveType(), help="The same as HEIGHT.")
@connect_option
def takeoff_command(height: float | None, altitude: float | None, address: Address) -> None:
    """Lift the load and hold it.

    HEIGHT is the height of the load above home in m; the default is the parameter MIS_TAKEOFF_ALT. The
    vehicle must be armed, or armed next.
    """
    from gcs.workflows.running_flight import vehicle_home

    if height is not None and altitude is not None:
        raise click.UsageError("HEIGHT and --altitude are the same; give one")
    altitude_m = height if altitude is None else altitude

    def make(session: Session) -> Operation:
        if altitude_m is None:
            return command.takeoff(session.target)
        return command.takeoff(session.target, vehicle_home(session).altitude_m + altitude_m)

    _send(address, make, needs_arming=True)


@click.command("goto", context_settings={"ignore_unknown_options": True})  # -1 is a number here
@click.argument("east", type=FiniteType())
@click.argument("north", type=FiniteType())
@click.argument("up", type=FiniteType(), required=False, cls=OptionalArgument)
@click.option(
    "--frame",
    type=click.Choice(["home", "load"]),
    default="home",
    show_default=True,
    help="Origin of EAST, NORTH and UP: home, or the present position of the load.",
)
@click.option(
    "--speed", type=PositiveType(), help="Speed on the way in m/s, instead of the default of the vehicle."
)
@connect_option
def goto_command(
    east: float, north: float, up: float | None, frame: str, speed: float | None, address: Address
) -> None:
    """Move the load to a position and hold it there.

    EAST, NORTH and UP are the position of the load in m; without UP it keeps its height. The vehicle must be
    flying. The distance to go is printed; the vehicle refuses a position that is more than 100 km away, or
    beyond its fence.
    """
    from gcs.workflows.reposition import reposition

    with Session(address) as session:
        session.find_to_command()
        move = reposition(session, (east, north, up), frame == "load", speed)
        distance_text = "" if isnan(move.distance_m) else f"; {move.distance_m:.1f} m to go"
        click.echo(session.run(move.operation).text + distance_text)


@click.command("land")
@connect_option
def land_command(address: Address) -> None:
    """Set the load down, and the vehicle beside it."""
    _send(address, lambda session: command.land(session.target))


@click.command("winch", context_settings={"ignore_unknown_options": True})  # -1 is a number here
@click.argument("length", type=FiniteType())
@click.option("--speed", type=PositiveType(), help="Speed of the cable in m/s, instead of WNC_SPEED.")
@connect_option
def winch_command(length: float, speed: float | None, address: Address) -> None:
    """Make the cable longer or shorter.

    LENGTH is the change in m; a negative one shortens the cable. The vehicle stays in place, and the load
    sinks or rises. The vehicle must hold the load in the air.
    """
    _send(address, lambda session: command.winch(session.target, length, speed))


@click.command("release")
@connect_option
def release_command(address: Address) -> None:
    """Let the load go.

    In the air the load falls, and the vehicle holds its position. gcs land then sets the vehicle down alone.
    """
    _send(address, lambda session: command.release(session.target))


@click.command("grab")
@connect_option
def grab_command(address: Address) -> None:
    """Take the load again.

    The vehicle must be on the ground, with the load within 0.75 cable lengths.
    """
    _send(address, lambda session: command.grab(session.target))


@click.command("mode")
@click.argument("name", metavar="MODE", type=click.Choice((*MODES, *ALIASES), case_sensitive=False))
@connect_option
def mode_command(name: str, address: Address) -> None:
    """Change the flight mode.

    MODE is a mode of the vehicle: hold, land, mission, offboard, position, return or takeoff; guided, loiter
    (both mean hold), auto (mission), poshold (position) and rtl (return) are understood too. With ArduPilot's
    identity (MAV_IDENTITY 1) there are no modes offboard and takeoff.
    """
    _send(
        address,
        lambda session: change_mode(session.target, name, session.view.latest["HEARTBEAT"]),
        needs_arming=ALIASES.get(name, name) in ("mission", "takeoff"),
    )
