"""A mismatch of message signing is reported, with its remedy, wherever it prevents something."""

from __future__ import annotations

from functools import partial

import pytest
from click.testing import CliRunner

from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing, key_of_text, timestamp_of
from autopilot.wire.tlog import read_tlog
from gcs.cli import gcs
from gcs.clients.command import SENDS
from gcs.clients.connection import Connection
from gcs.clients.flight import FlightClient
from gcs.errors import EXIT_DONE, EXIT_ERROR
from gcs.shell import session as session_module
from gcs.shell.link import unix_us
from tests.gcs.conftest import ScriptedVehicle

KEY, OTHER = key_of_text("plumb"), key_of_text("bob")
NOW = timestamp_of(1_800_000_000_000_000)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 3, 3)
TEXT = mavlink.MAVLink_statustext_message(4, b"hello")
NO_KEY = "the vehicle signs its messages, and heeds only those that are signed with its key: "


def signs(vehicle: ScriptedVehicle, key: bytes, timestamp: int) -> None:
    """From now on the vehicle signs all its frames, as a real one does, those of its load included: the last
    frame that is heard decides what is reported."""
    sign = Signing(key, timestamp).signer(0)
    for writer in (vehicle.writer, vehicle.dialect_writer, vehicle.load_writer):
        writer.frame = partial(writer.frame, sign=sign)


@pytest.mark.parametrize(
    ("theirs", "their_time", "ours", "heard", "trouble"),
    [
        (None, NOW, None, 2, ""),
        (KEY, NOW, KEY, 2, ""),
        (KEY, NOW, None, 2, "--signing-key FILE"),
        (KEY, NOW, OTHER, 0, "another key than that of --signing-key"),
        (None, NOW, KEY, 1, "not signed, and with --signing-key only signed messages are heard"),
        (KEY, NOW - 10_000_000, KEY, 0, "set the clocks of both machines right"),
    ],
)
def test_what_does_not_match_is_known(theirs, their_time, ours, heard, trouble):
    sign = Signing(theirs, their_time).signer(0) if theirs else None
    writer, connection = FrameWriter(1, 1), Connection()
    if ours:
        connection.sign_with(Signing(ours, NOW))
    datagram = writer.frame(HEARTBEAT, sign) + writer.frame(TEXT, sign)
    assert len(connection.receive(datagram, 0)) == heard
    assert trouble in connection.signatures.problem
    assert bool(trouble) == bool(connection.signatures.problem)


def test_a_radio_that_cannot_sign_and_a_frame_said_twice_are_no_trouble():
    connection, writer = Connection(), FrameWriter(1, 1)
    connection.sign_with(Signing(KEY, NOW))
    radio = FrameWriter(51, 68).frame(mavlink.MAVLink_radio_status_message(1, 1, 100, 0, 0, 0, 0))
    connection.receive(radio, 0)
    assert connection.signatures.problem == ""
    signed = writer.frame(HEARTBEAT, Signing(KEY, NOW).signer(0))
    for _ in range(2):
        connection.receive(signed, 0)
    assert connection.signatures.problem == ""


def test_a_flight_that_is_not_answered_says_that_a_key_is_missing(world, items):
    vehicle = world.vehicle
    signs(vehicle, KEY, NOW)
    vehicle.on_command_long = lambda message: None
    client = FlightClient(items, 10.0)
    for _ in world.ticks(client.receive, client.poll, 20.0):
        if client.outcome is not None:
            break
    assert client.outcome is not None
    assert client.outcome.name == "lost"
    assert client.outcome.reason.startswith(f"interval of LOAD_SETPOINT: no answer after 10 tries; {NO_KEY}")


@pytest.mark.parametrize(
    ("theirs", "ours", "words", "told"),
    [
        (KEY, None, ["param", "get", "P001"], f"P001: no answer after 1 tries; {NO_KEY}name the file"),
        (OTHER, KEY, ["status"], "what comes is signed with another key than that of --signing-key"),
        (None, KEY, ["status"], "what comes is not signed, and with --signing-key only signed"),
    ],
)
def test_a_command_says_what_does_not_match(live, monkeypatch, tmp_path, theirs, ours, words, told):
    vehicle, port = live
    if theirs:
        signs(vehicle, theirs, timestamp_of(unix_us()))
    vehicle.on_param_request_read = lambda message: None
    monkeypatch.setattr("gcs.clients.parameter_transfer.SENDS", 1)
    monkeypatch.setattr(session_module, "FIND_S", 0.3)
    file = tmp_path / "key"
    file.write_text("plumb", encoding="utf-8")
    file.chmod(0o600)
    key = ["--signing-key", str(file)] if ours else []
    result = CliRunner().invoke(gcs, [*key, *words, "--connect", port], prog_name="gcs")
    assert (result.exit_code, result.stdout) == (EXIT_ERROR, "")
    assert told in result.stderr


def test_a_vehicle_that_answers_nothing_for_want_of_its_key_is_asked_once_and_captured(
    live, monkeypatch, tmp_path
):
    vehicle, port = live
    signs(vehicle, KEY, timestamp_of(unix_us()))
    asked = []
    vehicle.on_command_long = asked.append
    monkeypatch.setattr("gcs.clients.command.RETRY_US", 10_000)

    def run(*words: str) -> tuple[int, list[str]]:
        asked.clear()
        result = CliRunner().invoke(gcs, [*words, "--connect", port], prog_name="gcs")
        vehicle.wait_until_all_is_taken()  # the last request may be on its way
        return result.exit_code, result.stderr.splitlines()

    texts = run("texts")
    assert texts[0] == EXIT_ERROR
    assert texts[1][0].startswith(f"gcs: its texts could not be requested: {NO_KEY}name the file")
    code, told = run("status")
    assert code == EXIT_DONE and len(asked) == SENDS
    (line,) = [line for line in told if "listening" not in line]
    assert line.startswith("gcs: texts, and rate, lateness and missed ticks of the simulator are missing: ")
    assert NO_KEY in line
    log = tmp_path / "flight.tlog"
    code, told = run("capture", "--duration", "0.2", "--out", str(log))
    assert code == EXIT_DONE and len(asked) == SENDS
    assert told[0].startswith("gcs: only what the vehicle sends by itself is captured, without truth: ")
    assert NO_KEY in told[0]
    assert list(read_tlog(log))


def test_a_flight_by_a_running_vehicle_asks_for_its_key_and_not_for_another_truth_port(
    live, monkeypatch, tmp_path
):
    vehicle, port = live
    signs(vehicle, KEY, timestamp_of(unix_us()))
    vehicle.on_command_long = lambda message: None
    home = mavlink.MAVLink_home_position_message(
        473977420, 85455940, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0
    )
    beat = vehicle.heartbeat
    vehicle.heartbeat = lambda: (beat(), vehicle.send(home))  # a vehicle sends its home by itself
    monkeypatch.setattr("gcs.clients.command.RETRY_US", 10_000)
    out = tmp_path / "flight"
    words = ["fly", "square", "--connect", port, "--out", str(out)]
    result = CliRunner().invoke(gcs, words, prog_name="gcs")
    assert (result.exit_code, result.stdout) == (EXIT_ERROR, "")
    assert result.stderr.splitlines()[-1].startswith(f"gcs: square: not flown: {NO_KEY}name the file")
    assert "--truth" not in result.stderr
    assert not out.exists()
