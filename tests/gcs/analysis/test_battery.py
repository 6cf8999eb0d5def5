"""A battery in the results of a flight: its figures, columns and plots, and only if it is simulated."""

from __future__ import annotations

import numpy as np
import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.convert.battery import BatteryReading, battery_status_message
from autopilot.wire.dialect import plumbline as mavlink
from gcs.analysis.parquet import flight_columns
from gcs.analysis.record import FlightMeta, flight_record
from gcs.analysis.samples import samples_of
from gcs.analysis.telemetry import telemetry_of
from gcs.analysis.tracks import Telemetry
from gcs.report.replay import replay_of
from tests.doubles import recorded_flights as flights

VOLTS = (25.2, 22.5, 23.9)
USED_MAH = (0.0, 120.0, 250.0)
LEFT = (1.0, 0.88, 0.75)


def with_battery(simulated: float | None, **parameters: float) -> Telemetry:
    """A flight in which the battery is reported after 1 s, 2 s and 3 s; `simulated`: SIM_BATTERY, if the log
    has it; `parameters`: others that it has."""
    vehicle, other = FrameWriter(1, 1), FrameWriter(9, 1)
    records = list(flights.flight(4.0, flights.still).records())
    for second, reading in enumerate(zip(VOLTS, (30.0, 31.0, 29.0), USED_MAH, LEFT, strict=True), 1):
        at_us = flights.BOOT_US + second * 1_000_000
        records.append((at_us, vehicle.frame(battery_status_message(BatteryReading(*reading)))))
        strange = BatteryReading(3.0, 0.1, 900.0, 0.01)
        records.append((at_us, other.frame(battery_status_message(strange))))
    if simulated is not None:
        parameters["SIM_BATTERY"] = simulated
    for name, value in parameters.items():
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        said = mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 0)
        records.append((flights.BOOT_US, vehicle.frame(said)))
    return telemetry_of((us, decode(frame)[0][0]) for us, frame in records)


def test_the_record_has_what_a_simulated_battery_gave() -> None:
    record = flight_record(with_battery(1.0), FlightMeta())
    assert record["battery_left_pct"] == pytest.approx(75.0)
    assert record["battery_used_mah"] == pytest.approx(250.0)
    assert record["battery_voltage_min_v"] == pytest.approx(22.5)


def test_the_charge_left_is_counted_by_the_charge_used_where_the_capacity_is_known() -> None:
    known = {"SIM_BAT_CHARGE": 100.0, "SIM_BAT_CAP": 1005.0}
    assert flight_record(with_battery(1.0, **known), FlightMeta())["battery_left_pct"] == pytest.approx(
        100.0 - 25000.0 / 1005.0
    )
    other = flight_record(with_battery(1.0, **known | {"SIM_BAT_CAP": 2000.0}), FlightMeta())
    assert other["battery_left_pct"] == pytest.approx(75.0), "another capacity than that of the battery"


@pytest.mark.parametrize("simulated", [0.0, None])
def test_without_a_simulated_battery_nothing_is_said_of_one(simulated: float | None) -> None:
    telemetry = with_battery(simulated)
    samples = samples_of(telemetry)
    record = flight_record(telemetry, FlightMeta(), samples)
    assert [v for key, v in record.items() if key.startswith("battery_")] == [None] * 3
    table = flight_columns(telemetry, samples)
    assert all(np.isnan(v).all() for name, v in table.items() if name.startswith("battery_"))
    packed = replay_of(telemetry, samples, FlightMeta())["samples"]["columns"]
    assert not {"voltage", "charge"} & {column["name"] for column in packed}


def test_the_columns_hold_the_last_report_and_are_null_before_the_first_and_long_after_the_last() -> None:
    telemetry = with_battery(1.0)
    samples = samples_of(telemetry)
    table = flight_columns(telemetry, samples)
    percent = tuple(100.0 * share for share in LEFT)
    expected = ("battery_voltage_v", VOLTS), ("battery_used_mah", USED_MAH), ("battery_left_pct", percent)
    for name, values in expected:
        column = dict(zip(np.round(samples.time_s, 3), table[name], strict=True))
        assert [column[1.0], column[2.496], column[3.0]] == pytest.approx(values), name
        assert np.isnan(column[0.992]), name
        assert np.isnan(column[6.0]), name
    packed = replay_of(telemetry, samples, FlightMeta())["samples"]["columns"]
    assert {"voltage", "charge"} <= {column["name"] for column in packed}
