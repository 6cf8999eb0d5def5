"""Definitions of parameters in TOML: what they may contain, and what is reported of wrong ones."""

from __future__ import annotations

import tomllib

import pytest

from autopilot.wire.parameter_file import parameter_file
from autopilot.wire.parameter_table import Parameter, ParameterError

GROUPS = '[groups]\nAB = "A group"\n'


def definitions(text: str, **vehicle: float) -> list[Parameter]:
    return parameter_file(tomllib.loads(GROUPS + text), "some.toml").definitions(vehicle)


def test_a_number_with_a_range():
    text = '[AB_C]\ntext = "Some speed"\ndefault = 1\nrange = [0, 2.5]\nunit = "m/s"\nreboot = true\n'
    assert definitions(text) == [Parameter("AB_C", 1.0, 0.0, 2.5, "m/s", "Some speed", fixed=True)]


def test_a_whole_number():
    text = '[AB_C]\ntext = "Cells"\ndefault = 3\nrange = [1, 24]\nwhole = true\n'
    assert definitions(text) == [Parameter("AB_C", 3.0, 1.0, 24.0, "", "Cells", integer=True)]


def test_values_are_named_in_the_text_and_make_the_range():
    text = '[AB_C]\ntext = "Action"\ndefault = 1\nvalues = { 0 = "none", 1 = "hold", 2 = "land" }\n'
    assert definitions(text) == [
        Parameter("AB_C", 1.0, 0.0, 2.0, "", "Action: 0 none, 1 hold, 2 land", integer=True)
    ]


def test_bits_are_named_in_the_text_and_make_the_range():
    text = '[AB_C]\ntext = "Failed"\ndefault = 0\nbits = { 1 = "left", 2 = "right", 4 = "tail" }\n'
    assert definitions(text) == [
        Parameter("AB_C", 0.0, 0.0, 7.0, "", "Failed, a sum of: 1 left, 2 right, 4 tail", integer=True)
    ]


def test_defaults_of_the_vehicle():
    text = (
        '[AB_MASS]\ntext = "Mass"\nfrom_vehicle = "mass"\nrange_factor = 100.0\n'
        '[AB_GAIN]\ntext = "Gain"\ndefault = 6.0\nproportional_to = { mass = 0.5 }\nrange = [0, 100]\n'
    )
    assert definitions(text, mass=2.0) == [
        Parameter("AB_MASS", 2.0, 0.02, 200.0, "", "Mass"),
        Parameter("AB_GAIN", 24.0, 0.0, 100.0, "", "Gain"),
    ]
    with pytest.raises(
        ParameterError, match=r"AB_MASS: default of vehicle value mass; must be one of length"
    ):
        definitions(text, length=1.0)


WRONG = {
    '[AB_C]\ntext = "A"\nrange = [0, 1]\n': "AB_C has none of default, from_vehicle; must have one of them",
    '[AB_C]\ntext = "A"\ndefault = 1\nfrom_vehicle = "m"\nrange = [0, 1]\n': "has default and from_vehicle",
    '[AB_C]\ntext = "A"\ndefault = 1\n': "AB_C has none of range, range_factor, values, bits",
    '[AB_C]\ntext = "A"\ndefault = 1\nrange = [0]\n': "AB_C.range = [0]; must be a list of at least 2",
    '[AB_C]\ntext = "A"\ndefault = 1\nrange = [0, inf]\n': "AB_C.range[1] = inf; must be a finite number",
    '[AB_C]\ntext = "A"\ndefault = "1"\nrange = [0, 1]\n': 'AB_C.default = "1"; must be a number',
    "[AB_C]\ndefault = 1\nrange = [0, 1]\n": "AB_C.text is missing",
    '[AB_C]\ntext = "A"\ndefault = 1\nrange = [0, 1]\nunits = "m"\n': "AB_C.units: unknown key; write unit",
    '[AB_C]\ntext = "A"\ndefault = 1\nvalues = { 1 = "a", 2 = "b" }\n': "has values 1, 2; must count from 0",
    '[AB_C]\ntext = "A"\ndefault = 1\nbits = { 1 = "a", 3 = "b" }\n': "has bits 1, 3; must be 1, 2, 4 ...",
    '[AB_C]\ntext = "A"\nfrom_vehicle = "m"\nproportional_to = { m = 1 }\nrange = [0, 1]\n': "to without def",
    '[XY_C]\ntext = "A"\ndefault = 1\nrange = [0, 1]\n': "XY_C has no group; must begin with one of AB",
}


@pytest.mark.parametrize("text", WRONG)
def test_what_is_wrong_is_told_with_its_place(text):
    with pytest.raises(ParameterError) as caught:
        definitions(text)
    assert str(caught.value).startswith("some.toml: ")
    assert WRONG[text] in str(caught.value)


def test_a_default_outside_its_range_is_refused():
    with pytest.raises(ParameterError, match=r"AB_C = 3\.0; the default must be 0\.0 \.\.\. 2\.0"):
        definitions('[AB_C]\ntext = "A"\ndefault = 3\nrange = [0, 2]\n')
