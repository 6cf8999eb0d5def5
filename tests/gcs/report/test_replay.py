"""The data of a flight in its page: numbers after unpacking, peaks of long flights, steps in words."""

from __future__ import annotations

import base64
import json
import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem, encode_mission, encode_steps
from gcs.analysis.axes import Floats
from gcs.analysis.record import FlightMeta, flight_record
from gcs.analysis.release import attached
from gcs.analysis.samples import samples_of
from gcs.report.packing import Column, pack
from gcs.report.replay import replay_of, steps_of
from gcs.report.settings import changed_settings
from gcs.report.steps import step_texts
from gcs.web.page import embedded
from missions.fileformat import load_mission
from missions.model import Land, Takeoff, Waypoint
from tests.doubles import recorded_flights as flights


def unpacked(packed: dict[str, Any]) -> dict[str, Floats]:
    """The columns as `gcs/web/flight_data.js` reads them."""
    n = packed["count"]
    raw = np.frombuffer(zlib.decompress(base64.b64decode(packed["data"]), wbits=-15), np.uint8)
    found = {}
    for i, column in enumerate(packed["columns"]):
        planes = raw[4 * n * i : 4 * n * (i + 1)].reshape(4, n)
        twice = np.ascontiguousarray(planes.T).view("<i4").ravel()
        values = np.cumsum(np.cumsum(twice, dtype=np.int32), dtype=np.int32) * float(column["step"])
        for first, end in column["gaps"]:
            values[first:end] = np.nan
        found[column["name"]] = values
    return found


def test_numbers_come_back_to_their_step() -> None:
    rng = np.random.default_rng(1)
    smooth = np.cumsum(rng.normal(0.0, 0.01, 1000))
    holed = np.where((np.arange(1000) > 300) & (np.arange(1000) < 310), np.nan, smooth)
    holed[[0, 999]] = np.nan
    far = np.linspace(-9e5, 9e5, 1000)
    lost = np.where(np.arange(1000) == 7, 1e30, smooth)
    columns = {"smooth": smooth, "holed": holed, "far": far, "nothing": np.full(1000, np.nan), "lost": lost}
    packed = pack([Column(name, values, 1e-6) for name, values in columns.items()], 1000)
    found = unpacked(packed)
    assert "nothing" not in found
    steps = {column["name"]: column["step"] for column in packed["columns"]}
    assert steps["smooth"] == 1e-6
    for name in ("smooth", "holed", "far"):
        np.testing.assert_allclose(found[name], columns[name], rtol=0.0, atol=0.51 * steps[name])
    assert np.flatnonzero(np.isnan(found["lost"])).tolist() == [7]  # an impossible number becomes NaN


def test_the_page_has_every_sample_and_the_greatest_error_of_the_record() -> None:
    telemetry = flights.case_b(duration_s=6.0).telemetry()
    samples = samples_of(telemetry)
    replay = replay_of(telemetry, samples, FlightMeta())
    columns = unpacked(replay["samples"])
    np.testing.assert_allclose(columns["time"], samples.time_s, atol=1e-6)
    for i, axis in enumerate("xyz"):
        np.testing.assert_allclose(columns[f"load_{axis}"], samples.actual_m[:, i], atol=1e-6)
    record = flight_record(telemetry, FlightMeta(), samples)
    assert replay["worst"]["error_m"] == pytest.approx(record["load_error_max_m"], rel=1e-6)
    at = int(np.argmin(np.abs(samples.time_s - replay["worst"]["time"])))
    assert np.linalg.norm(samples.error_m[at]) == pytest.approx(replay["worst"]["error_m"])


def test_a_long_flight_is_thinned_and_keeps_its_peaks(monkeypatch: pytest.MonkeyPatch) -> None:
    flight = flights.case_b(duration_s=20.0)
    spike = np.flatnonzero(flight.mission)[333]
    flight.tension[spike] = 9.0
    flight.drop = lambda i, kind: 12.0 < flight.time_s[i] < 13.0
    telemetry = flight.telemetry()
    samples = samples_of(telemetry)
    monkeypatch.setattr("gcs.report.replay.MAX_ROWS", 200)
    replay = replay_of(telemetry, samples, FlightMeta())
    columns = unpacked(replay["samples"])
    assert 200 <= replay["samples"]["count"] < 900
    assert np.nanmax(columns["tension"]) == pytest.approx(9.0)
    assert np.abs(columns["time"] - replay["worst"]["time"]).min() < 1e-6
    assert np.isnan(columns["load_x"]).sum() == 1  # the gap


def test_the_load_is_off_the_cable_from_the_moment_it_is_let_go() -> None:
    flight = flights.delivery()
    telemetry = flight.telemetry()
    (released,) = [time for time, _, text in flight.texts if text == "Load released"]
    on = attached(telemetry.load_truth, flights.CABLE_M)
    np.testing.assert_array_equal(on, flight.time_s < released - 1e-9)
    numbers = flight_record(telemetry, FlightMeta(), samples_of(telemetry))
    assert numbers["swing_max_deg"] == pytest.approx(0.0, abs=1e-3)
    assert numbers["tension_min_n"] == pytest.approx(flights.LOAD_KG * flights.GRAVITY)
    assert numbers["matched_fraction"] == 1.0
    believed = unpacked(replay_of(telemetry, samples_of(telemetry), FlightMeta())["samples"])["believed_z"]
    np.testing.assert_array_equal(np.isnan(believed), ~on)


def test_a_slack_cable_is_a_cable() -> None:
    flight = flights.case_b(duration_s=4.0)
    slack = np.flatnonzero(flight.mission)[100:120]
    flight.taut[slack] = 0
    flight.distance[slack] -= 0.1
    assert attached(flight.telemetry().load_truth, flights.CABLE_M).all()


def test_a_load_that_was_let_go_before_the_log_gives_no_figures() -> None:
    flight = flights.delivery()
    flight.taut[:] = 0
    flight.tension[:] = 0.0
    told = replace(flight.telemetry(), parameters={"VEH_CABLE_LEN": flights.CABLE_M})
    numbers = flight_record(told, FlightMeta(), samples_of(told))
    load_figures = (
        *("swing_max_deg", "tension_min_n", "tension_max_n", "slack_events"),
        *("load_speed_max_m_s", "estimator_error_max_m"),
    )
    assert {name: numbers[name] for name in load_figures} == dict.fromkeys(load_figures)
    true_length = replace(told, parameters={"VEH_CABLE_LEN": flights.CABLE_M, "SIM_CABLE_LEN": 10.0})
    assert samples_of(true_length).attached.all(), "of the two lengths the true one counts"
    unknown = replace(told, parameters={})
    assert samples_of(unknown).attached.all()


@pytest.mark.parametrize(
    ("mission", "first", "behind_release"),
    [
        ("delivery", "Take off, lift the load to 1.5 m", "Fly to 3 m east, 1 m north, 2 m up"),
        ("case-b", "Take off, lift the load to 2 m", None),
    ],
)
def test_steps_in_words(mission: str, first: str, behind_release: str | None) -> None:
    found = [step.text for step in step_texts(encode_mission(load_mission(mission), Home()), Home())]
    assert found[0] == first
    assert found[-1] in ("Land", "Set the load down and land")
    if behind_release:
        assert found[found.index("Release the load") + 1] == behind_release
    else:
        assert any(text.startswith("Fly signals for 50 s: 1 m along y") for text in found)


def test_the_nose_is_in_the_words_of_the_step_with_which_it_turns() -> None:
    def item(command: int, *parameters: float) -> WireItem:
        p1, p2, p3, p4 = parameters
        return WireItem(mavlink.MAV_FRAME_MISSION, command, 0, 1, p1, p2, p3, p4, 0, 0, 0.0)

    takeoff, first, second, land = encode_steps(
        (Takeoff(1.0), Waypoint(3.0, 0.0, 1.0), Waypoint(3.0, 2.0, 1.0), Land()), Home()
    )
    to_east = item(mavlink.MAV_CMD_CONDITION_YAW, 90.0, 0.0, 0.0, 0.0)
    left = item(mavlink.MAV_CMD_CONDITION_YAW, 30.0, 0.0, -1.0, 1.0)
    found = step_texts((takeoff, to_east, first, left, second, land), Home())
    assert [step.text.partition("; ")[2] for step in found] == [
        "",
        "nose to 90°",
        "nose turned by 30° to the left",
        "",
    ]


def test_what_a_jump_repeats_has_the_time_of_each_pass() -> None:
    """Also where the user has changed the order, each step has some time at which its item was flown."""
    items = encode_steps((Takeoff(1.0), Waypoint(3.0, 0.0, 1.0), Waypoint(3.0, 2.0, 1.0), Land()), Home())
    jump = items[3]._replace(command=mavlink.MAV_CMD_DO_JUMP, frame=mavlink.MAV_FRAME_MISSION)
    jump = jump._replace(param1=1.0, param2=1.0, x=0, y=0, z=0.0)
    flight = flights.flight(10.0, flights.still).telemetry()
    phase = np.full(6, mavlink.PLUMBLINE_PHASE_MISSION)
    order = [0, 1, 2, 1, 2, 4]
    setpoint = replace(flight.setpoint, phase=phase, item=np.array(order), time_s=np.arange(6.0))
    told = replace(flight, setpoint=setpoint, mission=(*items[:3], jump, items[3]))
    assert [step["time"] for step in steps_of(told)] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    back = replace(setpoint, item=np.array([2, 2, 1, 1, 2, 4]))
    assert [step["time"] for step in steps_of(replace(told, setpoint=back))] == [
        None,
        2.0,
        4.0,
        2.0,
        4.0,
        5.0,
    ]


def test_items_that_cannot_be_flown_have_their_names() -> None:
    item = encode_mission(load_mission("delivery"), Home())[1]._replace(frame=77)
    assert [step.text for step in step_texts([item], Home())] == ["NAV_WAYPOINT"]


def test_settings_stand_beside_their_defaults() -> None:
    telemetry = flights.flight(1.0, flights.still).telemetry()
    telemetry.parameters.update({"MIS_TAUT_SPEED": 0.1, "CTL_LAW": 2.0, "NOT_KNOWN": 3.0})
    meta = FlightMeta(vehicle="bebop", settings={"SIM_WIND_E": 2.0})
    found = {one.name: one for one in changed_settings(telemetry, meta)}
    assert found["SIM_WIND_E"] == ("SIM_WIND_E", "2", "0")
    assert "NOT_KNOWN" not in found
    assert all(one.value != one.default for one in found.values())


def test_data_within_a_page_cannot_end_its_element() -> None:
    text = embedded({"a": "</script><!--\u2028&"})
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text) == {"a": "</script><!--\u2028&"}
