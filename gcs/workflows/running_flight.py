"""A flight by a vehicle that somebody else has started, and that goes on afterwards."""

from __future__ import annotations

from typing import TYPE_CHECKING

from autopilot.wire.convert import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing, timestamp_of
from gcs.clients import command
from gcs.clients.capture import Capture, FrameLog
from gcs.clients.flight import FlightClient
from gcs.shell.display import FlightDisplay, say
from gcs.shell.link import LOOPBACK, TRUTH_PORT, Address, open_address, truth_socket, unix_us
from gcs.shell.session import Session
from gcs.shell.stopping import StopRequest
from gcs.workflows.flight_loops import run_wall_clock
from gcs.workflows.flight_options import FlightOptions
from gcs.workflows.own_flight import flight_client
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
) -> FlightClient:
    """Fly with the vehicle at `address`; if the flight is stopped early, it is told to hold."""
    with Session(address) as session:
        session.find()
        client = flight_client(mission, options, vehicle_home(session))
    if address.signing_key is not None:
        client.connection.sign_with(Signing(address.signing_key, timestamp_of(unix_us())))
    truth = truth_socket()
    if truth is None:
        say(f"UDP {LOOPBACK}:{TRUTH_PORT} is in use: the report will have no truth of the simulator")
    vehicle = open_address(address)
    try:
        with FlightDisplay(mission.name, options.quiet) as display:
            capture = Capture(log, unix_us())
            run_wall_clock(client, capture, vehicle, truth, lambda: "", display, stop, watch.start, page)
        watch.stop()
    finally:
        vehicle.close()
        if truth is not None:
            truth.close()
    if client.outcome is not None and client.outcome.name in ("interrupted", "timeout") and client.view.armed:
        with Session(address) as session:
            session.find()
            session.run(command.pause(session.target))
            say("the vehicle holds; gcs land brings it down")
    return client


def vehicle_home(session: Session) -> Home:
    """Where the vehicle says its home is."""
    message = session.request(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
    return Home(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)
