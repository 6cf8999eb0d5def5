"""Mission files: what is read, and what each kind of bad input gets."""

from __future__ import annotations

import ast
from math import pi, radians
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

import missions.fileformat
from missions.fileformat import MissionFileError, load_mission, parse_mission, shipped
from missions.model import (
    AttitudeRun,
    Delay,
    Land,
    Mission,
    ReturnHome,
    Signals,
    Sine,
    Speed,
    Takeoff,
    Term,
    Waypoint,
)

FRAME = 'title = "T"\n[[items]]\ntype = "takeoff"\naltitude_m = 2\n{}\n[[items]]\ntype = "land"\n'
WAYPOINT = '[[items]]\ntype = "waypoint"\neast_m = 1.0\nnorth_m = -2.0\naltitude_m = 3.0\n'
SIGNALS = '[[items]]\ntype = "signals"\nduration_s = 9.0\n'
TERM = '[[items.terms]]\naxis = "z"\namplitude_m = 0.2\nrise_s = 2.0\n'
KINDS = (
    "takeoff, waypoint, speed, fence, delay, signals, trajectory, attitude, return, release, place, winch, "
    "land"
)
FACTOR = "[[items.terms.factors]]\nperiod_s = 1.5\n"


def parsed(middle: str) -> Mission:
    return parse_mission(FRAME.format(middle), "m", "m.toml")


def complaint(middle: str) -> str:
    with pytest.raises(MissionFileError) as caught:
        parsed(middle)
    return str(caught.value)


def test_every_kind_of_item_becomes_its_step() -> None:
    full_term = (
        TERM + "start_s = 1.0\nhold_s = 3\nfall_s = 2.5\n" + FACTOR + "phase_deg = 90\nstart_s = 0.5\n"
    )
    mission = parsed(
        WAYPOINT
        + "hold_s = 1\n"
        + '[[items]]\ntype = "speed"\nspeed_m_s = 1.5\n'
        + '[[items]]\ntype = "delay"\nduration_s = 4.0\n'
        + SIGNALS
        + TERM
        + full_term
        + '[[items]]\ntype = "attitude"\ncontrolled = "load"\ntilt_north_deg = 10.0\nduration_s = 1.5\n'
        + '[[items]]\ntype = "return"\n'
    )
    assert mission == Mission(
        name="m",
        title="T",
        description="",
        assumptions=(),
        steps=(
            Takeoff(2.0),
            Waypoint(1.0, -2.0, 3.0, 1.0),
            Speed(1.5),
            Delay(4.0),
            Signals(
                9.0,
                (
                    Term("z", 0.2, 0.0, 2.0, None, 0.0),
                    Term("z", 0.2, 1.0, 2.0, 3.0, 2.5, (Sine(1.5, pi / 2.0, 0.5),)),
                ),
            ),
            AttitudeRun("load", radians(10.0), 0.0, 1.5),
            ReturnHome(),
            Land(),
        ),
    )
    numbers = [mission.steps[0].altitude_m, mission.steps[1].hold_s, mission.steps[4].terms[1].hold_s]
    assert all(type(number) is float for number in numbers), "an integer would make the kernels compile anew"


BAD = {
    WAYPOINT.replace("3.0", "-2.0"): (
        "items[1].altitude_m = -2.0; must be >= 0.01 and <= 10000 (height of the load above home)"
    ),
    WAYPOINT.replace("3.0", "nan"): (
        "items[1].altitude_m = nan; must be a finite number (height of the load above home)"
    ),
    WAYPOINT.replace("1.0", "inf"): "items[1].east_m = inf; must be a finite number (east of home)",
    WAYPOINT.replace("1.0", "2e4"): (
        "items[1].east_m = 20000.0; must be >= -10000 and <= 10000 (east of home)"
    ),
    WAYPOINT.replace("altitude_m", "altitude_ft"): (
        "items[1].altitude_ft: unknown key; write altitude_m (in metres)"
    ),
    WAYPOINT.replace(
        "altitude_m", "altitude"
    ): "items[1].altitude: unknown key; write altitude_m (in metres)",
    WAYPOINT.replace("north_m", "nroth_m"): "items[1].nroth_m: unknown key; write north_m (in metres)",
    WAYPOINT + "colour = 1": ("items[1].colour: unknown key; allowed: east_m, north_m, altitude_m, hold_s"),
    # a key that the item already has is not proposed for an unknown one
    '[[items]]\ntype = "winch"\nlength_m = 0.2\nnorth_m = 1.0': (
        "items[1].north_m: unknown key; allowed: length_m, speed_m_s"
    ),
    WAYPOINT.replace("north_m = -2.0\n", ""): "items[1].north_m is missing (north of home)",
    WAYPOINT.replace("-2.0", '"-2.0"'): 'items[1].north_m = "-2.0"; must be a number (north of home)',
    WAYPOINT.replace("-2.0", "true"): "items[1].north_m = true; must be a number (north of home)",
    '[[items]]\ntype = "speed"\nspeed_km_h = 5.0': (
        "items[1].speed_km_h: unknown key; write speed_m_s (in metres per second)"
    ),
    '[[items]]\ntype = "return"\nspeed = 5.0': "items[1].speed: unknown key; this item takes no keys",
    '[[items]]\ntype = "waypiont"': (
        f'items[1].type = "waypiont"; must be one of {KINDS} (did you mean waypoint?)'
    ),
    "[[items]]\nduration_s = 1.0": (f"items[1].type is missing; must be one of {KINDS}"),
    '[[items]]\ntpe = "waypoint"': "items[1].tpe: unknown key; write type",
    "[[items]]\ntype = 3": (f"items[1].type = 3; must be one of {KINDS}"),
    SIGNALS: "items[1].terms is missing",
    SIGNALS + "terms = []": "items[1].terms = []; must be a list of at least 1",
    SIGNALS + "terms = [3]": "items[1].terms[0] = 3; must be a table",
    SIGNALS + TERM.replace('"z"', '"up"'): (
        'items[1].terms[0].axis = "up"; must be "x", "y" or "z" (x east, y north, z up)'
    ),
    SIGNALS + TERM.replace("2.0", "0.0"): (
        "items[1].terms[0].rise_s = 0.0; must be >= 0.1 and <= 3600 (duration of the half-cosine rise)"
    ),
    SIGNALS + TERM + "hold_s = 1.0": (
        "items[1].terms[0] needs hold_s and fall_s, both or neither (neither: it stays at the top)"
    ),
    SIGNALS + TERM + FACTOR * 4: "items[1].terms[0].factors has 4 entries; must be a list of at most 3",
    SIGNALS + TERM + FACTOR.replace("period_s", "period_ms"): (
        "items[1].terms[0].factors[0].period_ms: unknown key; write period_s (in seconds)"
    ),
    SIGNALS + TERM + FACTOR + "phase_rad = 1.0": (
        "items[1].terms[0].factors[0].phase_rad: unknown key; write phase_deg (in degrees)"
    ),
    '[[items]]\ntype = "attitude"\ncontrolled = "kite"\nduration_s = 1.0': (
        'items[1].controlled = "kite"; must be "vehicle" or "load" (whose attitude is tracked)'
    ),
    '[[items]]\ntype = "takeoff"\naltitude_m = 1.0': (
        'items[1].type = "takeoff"; only the first item may be a take-off'
    ),
    '[[items]]\ntype = "land"': 'items[1].type = "land"; only the last item may be a landing',
}


@pytest.mark.parametrize("middle", BAD, ids=lambda middle: BAD[middle][:50])
def test_a_bad_item_gets_one_line_that_says_where_what_and_what_is_allowed(middle: str) -> None:
    found = complaint(middle)
    assert found.startswith("m.toml:5: " + BAD[middle])
    assert "\n" not in found


def test_a_misspelt_key_is_one_problem_not_two() -> None:
    with pytest.raises(MissionFileError) as caught:
        parsed(WAYPOINT.replace("altitude_m", "altitude_ft"))
    assert len(caught.value.problems) == 1


def test_several_problems_are_all_told() -> None:
    with pytest.raises(MissionFileError) as caught:
        parsed(WAYPOINT.replace("3.0", "-2.0") + WAYPOINT.replace("1.0", "nan"))
    assert [problem.split(" = ")[0] for problem in caught.value.problems] == [
        "m.toml:5: items[1].altitude_m",
        "m.toml:10: items[2].east_m",
    ]
    assert str(caught.value) == "; ".join(caught.value.problems)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('title = "T', "x.toml:1:11: not TOML: "),
        ("title = 1\nspeed 3\n", "x.toml:2:7: not TOML: "),
        ("", "x.toml: title is missing (one line for lists and reports); x.toml: items is missing"),
        ('title = "T"\nitems = 3', "x.toml: items = 3; must be a list (the [[items]] in order)"),
        ('title = "T"\nitems = [3]', "x.toml: items[0] = 3; must be a table"),
        ('title = ""\nitems = []', 'x.toml: title = ""; must be a text that is not empty'),
        (
            'title = "T\\nU"\n[[items]]\ntype = "land"',
            "x.toml: title must be one line of printable characters",
        ),
        ('title = "T"\n[items]\ntype = "takeoff"', "x.toml: items is a single table; write [[items]]"),
        ('title = "T"\n[[terms]]\naxis = "x"', "x.toml: terms: not a key of the file; write [[items.terms]]"),
        (
            'title = "T"\naltitude_m = 2.0 m # up',
            "x.toml:2:18: not TOML: Expected newline or end of document after a statement; "
            "a number is written without its unit, which the key names: altitude_m = 2.0",
        ),
        (
            'title = "T"\naltitude_m = -1,5 # up',
            "x.toml:2:16: not TOML: Expected newline or end of document after a statement; "
            "a decimal point is needed: altitude_m = -1.5",
        ),
        (
            "title = My mission # here",
            'x.toml:1:9: not TOML: Invalid value; text is written in quotes: title = "My mission"',
        ),
        ("law = steady", 'x.toml:1:7: not TOML: Invalid value; text is written in quotes: law = "steady"'),
        (
            "relative = True",
            "x.toml:1:12: not TOML: Invalid value; true and false are written in lower case",
        ),
        ("x = nan\nx = nan", "x.toml:2:8: not TOML: x is given twice in this table"),
        (
            'title = "T"\n[[item]]\ntype = "takeoff"\n[[items]]\ntype = "land"',
            "x.toml: item: not a table of the file; write [[items]], in two brackets, before each item",
        ),
        ("[waypoint]\neast_m = 1.0", "x.toml: waypoint: not a table of the file; write [[items]], in two"),
        (
            'title = "T"\nitems = [{type = "land"}]',
            'x.toml: items[0].type = "land"; must be "takeoff": a mission begins on the ground',
        ),
        (
            'title = "T"\ndescription = """\n[[items]]\n"""\n[[items]]\ntype = "land"',
            'x.toml: items[0].type = "land"; must be "takeoff": a mission begins on the ground',
        ),
        (
            'title = "T"\nitems = [' + "{}, " * 1007 + "]",
            "x.toml: items has 1007 entries; must be a list of at most 1000 (the [[items]] in order)",
        ),
        ('title = "T"\n title= "U"', "x.toml:2:12: not TOML: title is given twice in this table"),
        (
            'title = "T"\n[items]\n[items]',
            "x.toml:3:7: not TOML: [items] stands there twice; keep one, or write [[items]] for each "
            "table of a list",
        ),
        ('titel = "T"\n[[items]]\ntype = "land"', "x.toml: titel: unknown key; write title"),
        (
            'title = "T"\n[[items]]\ntype = "land"',
            'x.toml:2: items[0].type = "land"; must be "takeoff": a mission begins on the ground',
        ),
        (
            'title = "T"\n[[items]]\ntype = "takeoff"\naltitude_m = 1.0',
            'x.toml:2: items[0].type = "takeoff"; must be "land": a mission ends on the ground',
        ),
    ],
)
def test_a_bad_file_gets_one_line(text: str, expected: str) -> None:
    with pytest.raises(MissionFileError) as caught:
        parse_mission(text, "x", "x.toml")
    assert str(caught.value).startswith(expected)


def test_an_unknown_name_gets_the_names_there_are() -> None:
    with pytest.raises(MissionFileError) as caught:
        load_mission("caseb")
    assert str(caught.value).startswith(
        "unknown mission 'caseb'; did you mean case-b? shipped: case-a, case-b,"
    )


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\x00\xfe")
    for path, expected in [
        (tmp_path / "absent.toml", "no such file"),
        (
            tmp_path / "case-b.toml",
            "no such file; did you mean the shipped case-b?",
        ),
        (
            tmp_path / "Hovr.toml",
            "no such file; did you mean the shipped hover?",
        ),
        (tmp_path, "is a folder; must be a file"),
        (binary, "not a text file in UTF-8 (byte 0)"),
    ]:
        with pytest.raises(MissionFileError) as caught:
            load_mission(path)
        assert str(caught.value) == f"{path}: {expected}"


def test_a_file_is_named_after_its_stem(tmp_path: Path) -> None:
    path = tmp_path / "my-flight.toml"
    path.write_text(FRAME.format(WAYPOINT), encoding="utf-8")
    assert load_mission(path).name == load_mission(str(path)).name == "my-flight"


def test_the_shipped_missions_load_and_state_their_assumptions() -> None:
    names = {"case-a", "case-b", "case-b-extended", "case-c", "hover", "square"}
    assert names | {"quad-attitude", "load-attitude", "delivery"} == set(shipped())
    for name in shipped():
        mission = load_mission(name)
        assert mission.name == name
        assert mission.assumptions


@given(text=st.text(max_size=60))
def test_no_text_raises_anything_but_a_mission_file_error(text: str) -> None:
    for document in (text, FRAME.format(f"[[items]]\ntype = 'waypoint'\n{text}")):
        try:
            parse_mission(document, "x", "x.toml")
        except MissionFileError as error:
            assert "\n" not in str(error)


@given(
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
        max_leaves=6,
    )
)
def test_no_value_breaks_the_messages(value: object) -> None:
    """Values enter as TOML would give them, without the parser."""
    for key in ("altitude_m", "terms", "axis", "speed_m_s"):
        for kind in missions.fileformat.ITEMS:
            document = {"title": "T", "items": [{"type": kind, key: value}]}
            with patch.object(missions.toml_files.tomllib, "loads", return_value=document):
                try:
                    missions.fileformat.parse_mission("", "x", "x.toml")
                except missions.fileformat.MissionFileError as error:
                    assert error.problems
                    for line in error.problems:
                        assert line.startswith("x.toml: items[0]")
                        assert "\n" not in line


def test_the_room_stands_alone() -> None:
    for path in Path(missions.fileformat.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module:
                assert node.module.split(".")[0] not in ("autopilot", "sitl", "gcs")


def test_a_list_behind_a_table_of_its_name_is_told_its_brackets() -> None:
    text = 'title = "t"\ndescription = "d"\n[items]\ntype = "takeoff"\n[[items]]\ntype = "land"\n'
    with pytest.raises(MissionFileError, match=r"m.toml:5:8: not TOML: .*write \[\[items\]\] for each table"):
        parse_mission(text, "m", "m.toml")
