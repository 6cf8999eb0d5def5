"""Tracks from frames."""

import io
import struct
from dataclasses import astuple, replace

import numpy as np
import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.statustext import CHUNK, GAP, TextWriter
from autopilot.wire.tlog import read_tlog
from gcs.analysis.telemetry import load_telemetry, telemetry_of
from gcs.analysis.tracks import StatusText
from tests.doubles import recorded_flights as flights
from tests.gcs import tolerances

BOOT_US = 1_767_225_600_000_000


@pytest.fixture(scope="module")
def made():
    def path(t):
        return np.stack((0.1 * t, -0.2 * t, 0.3 * np.sin(t)), axis=1)

    flight = flights.flight(4.0, path, lambda t: np.full((len(t), 3), (0.01, 0.02, 0.03)))
    flight.quat[:] = (np.cos(0.1), np.sin(0.1), 0.0, 0.0)  # rolled by 0.2 rad
    flight.psi_r[:] = np.linspace(0.0, 1.0, len(flight.psi_r))
    flight.texts += [(1.0, 6, "short"), (2.0, 4, "long " * 25)]
    return flight


@pytest.fixture(scope="module")
def telemetry(made, tmp_path_factory):
    return load_telemetry(made.write(tmp_path_factory.mktemp("log") / "flight.tlog"))


def test_what_was_sent_comes_back_in_enu_and_flu(made, telemetry):
    t = made.time_s
    for track in (telemetry.load_truth, telemetry.load_estimated, telemetry.setpoint, telemetry.cascade):
        assert np.abs(track.time_s - t).max() <= tolerances.STAMP_S
    close = {"rtol": 0.0, "atol": tolerances.WIRE_M}
    np.testing.assert_allclose(telemetry.load_truth.position_m, made.actual, **close)
    np.testing.assert_allclose(telemetry.load_truth.velocity_m_s, made.actual_v, **close)
    np.testing.assert_allclose(telemetry.load_truth.q_cable, made.q_cable, **close)
    np.testing.assert_allclose(telemetry.setpoint.position_m, made.desired, **close)
    np.testing.assert_allclose(telemetry.cascade.e_x, made.actual - made.desired, **close)
    # at the first instant it is 0: there is none
    assert np.isnan(telemetry.cascade.psi_R[0])
    np.testing.assert_allclose(telemetry.cascade.psi_R[1:], made.psi_r[1:], **close)
    assert np.isnan(telemetry.cascade.psi_q).all(), "the law commands no direction of the cable"
    assert np.isnan(telemetry.cascade.e_q).all() and np.isnan(telemetry.setpoint.q_cable_c).all()
    np.testing.assert_allclose(telemetry.attitude_truth.quat_wxyz, made.quat, **close)
    np.testing.assert_allclose(telemetry.rotors_truth.force_n, made.force, **close)
    assert (telemetry.setpoint.phase == made.phase).all()


def test_other_systems_are_left_out(telemetry):
    # the load, a separate system, reports a rate of 9 rad/s, and the ground station sends heartbeats too
    assert np.abs(telemetry.attitude_estimated.omega_body).max() == 0.0
    assert (telemetry.heartbeat.custom_mode == 0).all()
    assert (telemetry.heartbeat.base_mode == 128).all()


_TRACKS = (
    "load_truth",
    "load_estimated",
    "setpoint",
    "cascade",
    "rotors_truth",
    "heartbeat",
    "mission_current",
)


def test_a_vehicle_and_its_simulator_are_found_whatever_the_system_id_of_the_vehicle(made, telemetry):
    found = replace(made, system=3).telemetry()
    for name in _TRACKS:
        for column, expected in zip(
            astuple(getattr(found, name)), astuple(getattr(telemetry, name)), strict=True
        ):
            np.testing.assert_array_equal(column, expected, err_msg=name)
    assert found.texts == telemetry.texts


def test_of_several_vehicles_in_a_log_the_one_whose_heartbeat_comes_first_is_reported(made, telemetry):
    records = [(us, decode(frame)[0][0]) for us, frame in replace(made, system=3).records()]
    first = next(i for i, (_, one) in enumerate(records) if one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT)
    autopilot, dialect = FrameWriter(1, 1), FrameWriter(1, 25)  # of the other vehicle
    frames = (
        autopilot.frame(mavlink.MAVLink_heartbeat_message(2, 12, 0, 5, 4, 3)),
        autopilot.frame(mavlink.MAVLink_param_value_message(b"SIM_BATTERY", 1.0, 9, 1, 0)),
        dialect.frame(
            mavlink.MAVLink_cascade_errors_message(9, *[[9.0] * 3] * 6, 9.0, 9.0, 9.0, [9.0] * 3, 1)
        ),
    )
    other = [(records[first][0], decode(frame)[0][0]) for frame in frames]
    found = telemetry_of([*records[: first + 1], *other, *records[first + 1 :]])
    np.testing.assert_array_equal(found.heartbeat.custom_mode, telemetry.heartbeat.custom_mode)
    np.testing.assert_array_equal(found.cascade.time_s, telemetry.cascade.time_s)
    assert not found.parameters


def test_what_bears_no_stamp_is_put_on_the_vehicles_clock(made, telemetry):
    assert [text.text for text in telemetry.texts] == ["short", "long " * 25]
    assert [text.severity for text in telemetry.texts] == [6, 4]
    assert [text.time_s for text in telemetry.texts] == pytest.approx([1.0, 2.0], abs=tolerances.STAMP_S)
    assert telemetry.mission_current.time_s[:2] == pytest.approx([0.0, 1.0], abs=tolerances.STAMP_S)


def test_late_doubled_and_reordered_records_give_the_same_tracks(made, telemetry):
    rng = np.random.default_rng(1)
    records = [(us, decode(frame)[0][0]) for us, frame in made.records()]
    records += records[::7]
    shuffled = [records[i] for i in rng.permutation(len(records))]
    again = telemetry_of(shuffled)
    np.testing.assert_array_equal(again.load_truth.time_s, telemetry.load_truth.time_s)
    np.testing.assert_array_equal(again.setpoint.position_m, telemetry.setpoint.position_m)
    np.testing.assert_array_equal(again.rotors_commanded.force_n, telemetry.rotors_commanded.force_n)


@pytest.mark.parametrize("cut", [0, 1, 7, 8, 20, 1000, 100_003])
def test_a_log_may_end_anywhere(made, cut):
    found = telemetry_of(read_tlog(io.BytesIO(made.tlog()[:cut])))
    whole = made.time_s
    assert len(found.load_truth.time_s) <= len(whole)
    np.testing.assert_allclose(found.load_truth.time_s, whole[: len(found.load_truth.time_s)])


def test_a_log_without_plumblines_own_messages_gives_empty_tracks():
    frame = FrameWriter(1, 1).frame(mavlink.MAVLink_heartbeat_message(2, 12, 81, 0, 4, 3))
    found = telemetry_of(read_tlog(io.BytesIO(struct.pack(">Q", BOOT_US + 5) + frame)))
    assert found.span_s is None
    assert found.load_truth.position_m.shape == (0, 3)
    assert found.rotors_commanded.force_n.shape == (0, 4)
    assert found.heartbeat.time_s.tolist() == [0.0]


def test_a_log_shows_what_it_has_of_each_text_at_the_time_at_which_it_began() -> None:
    long = "".join(chr(ord("a") + i % 26) for i in range(3 * CHUNK + 7))
    messages, other = TextWriter().messages(4, long), TextWriter().messages(2, "Landed")
    sent = [messages[0], *other, messages[1], messages[3], messages[0], messages[1]]
    writer = FrameWriter(1, 1)
    records = [(1_000_000 * i, decode(writer.frame(message))[0][0]) for i, message in enumerate(sent)]
    assert telemetry_of(records).texts == (
        StatusText(0.0, 4, long[: 2 * CHUNK] + GAP + long[3 * CHUNK :]),
        StatusText(1.0, 2, "Landed"),
        StatusText(4.0, 4, long[: 2 * CHUNK]),  # its end is not in the log
    )
