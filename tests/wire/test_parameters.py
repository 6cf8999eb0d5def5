"""Parameters: validation, float32, parameter files."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from autopilot.wire.parameter_table import (
    Parameter,
    ParameterError,
    ParameterTable,
    decimal_from_float32,
    parse_text,
)

quick = settings(max_examples=200, deadline=None, derandomize=True)


def float32(value: float) -> float:
    rounded: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return rounded


def table() -> ParameterTable:
    return ParameterTable(
        [
            Parameter("SIM_WIND_E", 0.0, -50.0, 50.0, "m/s", "wind towards east"),
            Parameter("SIM_RATE_HZ", 250, 100, 1000, "Hz", "ticks", integer=True, fixed=True),
            Parameter("LAW_GAIN", 0.1, 0.1, 0.7, "", "a gain"),
        ]
    )


def test_names_are_sorted_and_indexed() -> None:
    parameters = table()
    assert parameters.names == ("LAW_GAIN", "SIM_RATE_HZ", "SIM_WIND_E")
    assert [parameters.index(name) for name in parameters.names] == [0, 1, 2]
    assert "SIM_WIND_E" in parameters
    assert "SIM_WIND_X" not in parameters
    assert len(parameters) == 3


def test_setting_counts_and_changes() -> None:
    parameters = table()
    assert parameters.set("SIM_WIND_E", 3) == 3.0
    assert (parameters["SIM_WIND_E"], parameters.version) == (3.0, 1)
    assert parameters.changed() == {"SIM_WIND_E": 3.0}
    assert parameters.values() == {"LAW_GAIN": 0.1, "SIM_RATE_HZ": 250.0, "SIM_WIND_E": 3.0}
    assert parameters.describe("SIM_WIND_E").unit == "m/s"


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("SIM_WIND_E", 900.0, "SIM_WIND_E = 900.0 m/s; must be -50 ... 50"),
        ("SIM_WIND_E", float("nan"), "SIM_WIND_E = nan m/s; must be -50 ... 50"),
        ("SIM_WIND_E", float("inf"), "SIM_WIND_E = inf m/s; must be -50 ... 50"),
        ("SIM_RATE_HZ", 250.5, "SIM_RATE_HZ = 250.5 Hz; must be a whole number"),
        ("LAW_GAIN", 0.0, "LAW_GAIN = 0.0; must be 0.1 ... 0.7"),
        (
            "SIM_WND_E",
            1.0,
            "SIM_WND_E: no such parameter; did you mean SIM_WIND_E? docs/parameters.md lists all",
        ),
        ("X", 1.0, "X: no such parameter; names begin with one of LAW_, SIM_"),
    ],
)
def test_a_wrong_value_is_refused_in_words(name: str, value: float, message: str) -> None:
    parameters = table()
    with pytest.raises(ParameterError) as refused:
        parameters.set(name, value)
    assert str(refused.value) == message
    assert (parameters.version, parameters.changed()) == (0, {})


def test_an_unknown_name_is_refused_everywhere() -> None:
    for ask in (table().describe, table().index, table().__getitem__):
        with pytest.raises(ParameterError):
            ask("NO_SUCH")


def test_a_limit_survives_float32() -> None:
    parameters = table()
    assert float32(0.7) != 0.7
    assert parameters.set("LAW_GAIN", float32(0.7)) in (0.7, float32(0.7))
    assert parameters.set("LAW_GAIN", float32(0.1)) in (0.1, float32(0.1))


def test_fixed_parameters_keep_their_value_once_frozen() -> None:
    parameters = table()
    parameters.set("SIM_RATE_HZ", 500)
    parameters.freeze()
    assert parameters.set("SIM_RATE_HZ", 500) == 500.0
    with pytest.raises(ParameterError, match="restart with --set SIM_RATE_HZ=1000"):
        parameters.set("SIM_RATE_HZ", 1000)
    assert parameters.set("SIM_WIND_E", 1.0) == 1.0


@pytest.mark.parametrize("name", ["", "lower", "A" * 17, "1A", "A B", "_A"])
def test_a_name_that_the_wire_cannot_carry_is_refused(name: str) -> None:
    with pytest.raises(ParameterError):
        Parameter(name, 0.0, 0.0, 1.0, "", "")


def test_definitions_are_checked() -> None:
    with pytest.raises(ParameterError):
        Parameter("A", 2.0, 0.0, 1.0, "", "")
    with pytest.raises(ParameterError):
        Parameter("A", 0.5, 0.0, 1.0, "", "", integer=True)
    with pytest.raises(ParameterError, match="defined twice: A"):
        ParameterTable([Parameter("A", 0.0, 0.0, 1.0, "", ""), Parameter("A", 0.0, 0.0, 1.0, "", "")])


@given(st.decimals(-9999999, 9999999, places=3, allow_nan=False))
@quick
def test_a_typed_decimal_comes_back_from_float32(typed: object) -> None:
    value = float(str(typed))
    assert float32(decimal_from_float32(float32(value))) == float32(value)
    if len(str(typed).replace("-", "").replace(".", "").lstrip("0")) <= 6:
        assert decimal_from_float32(float32(value)) == value


@given(st.floats(width=32))
@quick
def test_the_decimal_is_the_same_float32(value: float) -> None:
    decimal = decimal_from_float32(value)
    assert math.isnan(decimal) or float32(decimal) == value


def test_other_tools_files_are_read() -> None:
    mavproxy = "# a comment\nSIM_WIND_E      3.500000\nLAW_GAIN 0.2 # why\n\n"
    planner = "SIM_WIND_E,3.5\nLAW_GAIN,0.2\n"
    qgc = "# Vehicle-Id Component-Id Name Value Type\n1\t1\tSIM_WIND_E\t3.5\t9\n1\t1\tLAW_GAIN\t0.2\t9\n"
    for text in (mavproxy, planner, qgc):
        assert parse_text(text) == {"SIM_WIND_E": 3.5, "LAW_GAIN": 0.2}


@pytest.mark.parametrize("text", ["SIM_WIND_E", "SIM_WIND_E x", "SIM_WIND_E 1 2", "\0\xff"])
def test_a_malformed_file_names_its_line(text: str) -> None:
    with pytest.raises(ParameterError, match=r"^line 2: "):
        parse_text("LAW_GAIN 0.2\n" + text)
