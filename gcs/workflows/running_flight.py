"""A flight by a vehicle that was started separately and continues to run afterwards."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing, timestamp_of
from gcs.clients import command
from gcs.clients.capture import Capture, FrameLog
from gcs.clients.flight import FlightClient
from gcs.errors import GcsError, NoVehicleError, RefusedError
from gcs.foreign_mission import ForeignMission
from gcs.mission_items import at_home, home_difference
from gcs.shell.display import FlightDisplay, notify
from gcs.shell.link import Address, unix_us
from gcs.shell.session import Session
from gcs.shell.stopping import StopRequest
from gcs.shell.truth import TruthLink
from gcs.shell.vehicle_socket import VehicleSocket
from gcs.workflows.flight_loops import run_wall_clock
from gcs.workflows.flight_options import FlightOptions
from gcs.workflows.started_flight import flight_client
from gcs.workflows.stopwatch import Stopwatch
from missions.model import Mission

if TYPE_CHECKING:
    from gcs.workflows.flight_page import FlightPage


def fly_running(
    mission: Mission,
    options: FlightOptions,
    address: Address,
    log: FrameLog,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None = None,
) -> tuple[FlightClient, str]:
    """Fly with the vehicle at `address`, once it sends there; if the flight is stopped early, command it to
    hold, or to land if it cannot hold yet.

    Also returns why there is no truth of the vehicle's world; empty if there is. NoVehicleError if the key is
    missing without which the vehicle heeds no message.
    """
    with TruthLink(options.truth_at) as truth:
        with Session(address) as session:
            before, stop.hint = stop.hint, "stopping"  # there is nothing to report yet
            session.find_with_truth(truth, stop)
            stop.hint = before
            session.require_no_twin()
            if session.unanswered_reason:  # it would not answer anything else either
                raise NoVehicleError(f"{mission.name}: not flown: {session.unanswered_reason}")
            home = vehicle_home(session)
            if isinstance(mission, ForeignMission) and (text := home_difference(mission.home, home)):
                notify(f"{mission.name}: {text}")
            client = flight_client(at_home(mission, home), options, home)
            same_vehicle = replace(address, system=session.target.system)
            world = session.view.latest.get("SIM_BOOT")
        if truth.missing:
            notify(f"the report will not contain the simulator's truth: {truth.missing}")
        if world is not None and world.released:
            notify(
                "the vehicle released its load before: it flies the mission without it, and the figures of "
                "the load remain empty; a restart of sitl and autopilot gives the load back"
            )
        _fly(client, mission, options, same_vehicle, truth, log, stop, watch, page)
        return client, truth.missing


def _fly(
    client: FlightClient,
    mission: Mission,
    options: FlightOptions,
    address: Address,
    truth: TruthLink,
    log: FrameLog,
    stop: StopRequest,
    watch: Stopwatch,
    page: FlightPage | None,
) -> None:
    if address.signing_key is not None:
        client.connection.sign_with(Signing(address.signing_key, timestamp_of(unix_us())))
    client.connection.accept_only(address.system)
    vehicle = VehicleSocket(address)
    try:
        with FlightDisplay(mission.name, options.quiet) as display:
            capture = Capture(log, unix_us())
            run_wall_clock(client, capture, vehicle, truth, lambda: "", display, stop, watch.start, page)
        watch.stop()
    finally:
        vehicle.close()
    if client.outcome is not None and client.outcome.name in ("interrupted", "timeout") and client.view.armed:
        notify(_hold_or_land(address))


def _hold_or_land(address: Address) -> str:
    """Command a vehicle that is still flying to hold, or to land if it cannot hold yet; return a line on it.

    A failure raises no error here: the report of what was captured must still be made.
    """
    try:
        with Session(address) as session:
            session.find()
            try:
                session.run(command.pause(session.target))
            except RefusedError as error:
                session.run(command.land(session.target))
                return f"the vehicle lands, as it would not hold ({error})"
            return "the vehicle holds; gcs land brings it down"
    except GcsError as error:
        return f"the vehicle may fly on: {error}; gcs land brings it down"


def vehicle_home(session: Session) -> Home:
    """The home position that the vehicle reports."""
    message = session.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return Home(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)
