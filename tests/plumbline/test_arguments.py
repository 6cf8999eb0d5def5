"""For any argument that it cannot take, a public function raises an Error of one line, and no other
exception."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import plumbline
from plumbline import Land, Mission, Sensors, Takeoff, Term, Vehicle
from plumbline.arguments import setting_arguments
from plumbline.flights import Picture
from plumbline.learning.options import options_of
from plumbline.learning.vector import LoadVectorEnv

STEPS = (Takeoff(1.0), Land())
NEITHER_TEXT_NOR_NUMBER: tuple[Any, ...] = (object(), [object()], {1: 2})
NO_TEXT: tuple[Any, ...] = (3, 2.5, b"x", *NEITHER_TEXT_NOR_NUMBER)
NO_NUMBER: tuple[Any, ...] = ("x", "5", b"5", float("nan"), 2**5000, *NEITHER_TEXT_NOR_NUMBER)
NO_TRUTH_VALUE: tuple[Any, ...] = (None, 0, 1.0, "no", b"x", *NEITHER_TEXT_NOR_NUMBER)
TRUTH_VALUES: tuple[Any, ...] = (True, np.False_)
NO_MAPPING: tuple[Any, ...] = (3, "x", b"x", [1], [("SIM_WIND_E", 3)], object(), {3: 1}, {"A=1": 2})
TWICE = {"SIM_WIND_E": 1, "sim_wind_e": 2}
NO_PATH: tuple[Any, ...] = (3, "", b"x", *NEITHER_TEXT_NOR_NUMBER)
NO_LIST: tuple[Any, ...] = (3, "x", b"x", object(), {1: 2})

# calls with one value, and the values that each cannot take
CALLS: dict[str, tuple[Callable[[Any], Any], tuple[Any, ...]]] = {
    "fly mission": (plumbline.fly, (None, *NO_TEXT)),
    "fly law": (lambda v: plumbline.fly("hover", law=v), NO_TEXT),
    "fly estimator": (lambda v: plumbline.fly("hover", estimator=v), NO_TEXT),
    "fly planner": (lambda v: plumbline.fly("hover", planner=v), NO_TEXT),
    "fly sensors": (lambda v: plumbline.fly("hover", sensors=v), (None, Mission("a", STEPS), *NO_TEXT)),
    "fly vehicle": (lambda v: plumbline.fly("hover", vehicle=v), (None, Mission("a", STEPS), *NO_TEXT)),
    "fly seed": (lambda v: plumbline.fly("hover", seed=v), (2**70, -1, 1.5, True, "3", None, [1])),
    "fly settings": (lambda v: plumbline.fly("hover", settings=v), (TWICE, *NO_MAPPING)),
    "fly setting": (
        lambda v: plumbline.fly("hover", settings={"SIM_WIND_E": v}),
        (None, *TRUTH_VALUES, *NO_NUMBER),
    ),
    "fly timeout": (lambda v: plumbline.fly("hover", timeout_s=v), NO_NUMBER),
    "fly force": (lambda v: plumbline.fly("hover", force=v), NO_TRUTH_VALUE),
    "fly quiet": (lambda v: plumbline.fly("hover", quiet=v), NO_TRUTH_VALUE),
    "flight load": (plumbline.Flight.load, (None, *NO_PATH)),
    "sweep mission": (plumbline.sweep, (None, *NO_TEXT)),
    "sweep vary": (
        lambda v: plumbline.sweep("hover", vary=v),
        ({k: [v] for k, v in TWICE.items()}, *NO_MAPPING),
    ),
    "sweep varied": (
        lambda v: plumbline.sweep("hover", vary={"SIM_WIND_E": v}),
        (None, 3, "", b"12", {1: 2}, np.array(3), [True]),
    ),
    "sweep settings": (lambda v: plumbline.sweep("hover", settings=v), NO_MAPPING),
    "sweep timeout": (lambda v: plumbline.sweep("hover", timeout_s=v), (0, -1, *NO_NUMBER)),
    "sweep fresh": (lambda v: plumbline.sweep("hover", fresh=v), NO_TRUTH_VALUE),
    "sweep seeds": (
        lambda v: plumbline.sweep("hover", seeds=v),
        (0, 1.5, "x", None, [], [-1], [True], {1: 2}, [2**63]),
    ),
    "sweep sample": (lambda v: plumbline.sweep("hover", sample=v), (0, 1.5, "x")),
    "sweep laws": (lambda v: plumbline.sweep("hover", laws=v), (None, [], [3], *NO_LIST)),
    "sweep jobs": (lambda v: plumbline.sweep("hover", jobs=v), (0, 1.5, "x")),
    "sweep scheduler": (lambda v: plumbline.sweep("hover", scheduler=v), ("", *NO_TEXT)),
    "sweep out": (lambda v: plumbline.sweep("hover", out=v), NO_PATH),
    "connect": (plumbline.connect, (None, 0, 2**16, True, "", "x", 2.5, b"x", *NEITHER_TEXT_NOR_NUMBER)),
    "connect timeout": (lambda v: plumbline.connect("15999", timeout_s=v), (None, 0, *NO_NUMBER)),
    "connect sysid": (lambda v: plumbline.connect("15999", sysid=v), (0, 256, 1.5, "x")),
    "connect key": (lambda v: plumbline.connect("15999", signing_key=v), (3, "x", b"x", [1])),
    "mission name": (lambda v: Mission(v, STEPS), (None, "", " ", "x\ny", "x\n", *NO_TEXT)),
    "mission steps": (lambda v: Mission("a", v), (None, [], [3], *NO_LIST)),
    "mission title": (lambda v: Mission("a", STEPS, v), NO_TEXT),
    "mission assumptions": (lambda v: Mission("a", STEPS, assumptions=v), (None, [3], *NO_LIST)),
    "mission load": (Mission.load, (None, "", *NO_TEXT)),
    "mission save": (Mission("a", STEPS).save, (None, "/proc/x.toml", *NO_PATH)),
    "step": (lambda v: Mission("a", (Takeoff(v), Land())), (None, *TRUTH_VALUES, *NO_NUMBER)),
    "waypoint": (
        lambda v: Mission("a", (STEPS[0], plumbline.Waypoint(v, 0.0, 1.0), STEPS[1])),
        (None, *TRUTH_VALUES, *NO_NUMBER),
    ),
    "attitude": (
        lambda v: Mission("a", (STEPS[0], plumbline.AttitudeRun("load", v, 0.0, 2.0), STEPS[1])),
        (None, *TRUTH_VALUES, *NO_NUMBER),
    ),
    "term": (lambda v: Mission("a", (STEPS[0], plumbline.Signals(3.0, (v,)), Land())), (None, 3, "x")),
    "terms": (
        lambda v: Mission("a", (STEPS[0], plumbline.Signals(3.0, (Term(v, v, v, v, v, v),)), Land())),
        (None, "x", object()),
    ),
    "vehicle load": (Vehicle.load, (None, "", *NO_TEXT)),
    "vehicle save": (Vehicle.load("bebop").save, (None, *NO_PATH)),
    "vehicle key": (lambda v: Vehicle.load("bebop").replace(load_mass_kg=v), ("x", 50e9, [1])),
    "sensors load": (Sensors.load, (None, "", *NO_TEXT)),
    "sensors save": (Sensors.load("lab").save, (None, *NO_PATH)),
    "picture": (Picture(lambda _: b"").save, (None, "/proc/x.png", "x.jpg", "x.eps", *NO_PATH)),
    "env settings": (lambda v: options_of({"settings": v}), (TWICE, *NO_MAPPING)),
    "env reward": (
        lambda v: options_of({"reward": v}),
        ({"crashh": 1}, {"crash": "x"}, {"width": 0}, {"width": -0.1}, {"alive": True}, *NO_MAPPING),
    ),
    "env randomise": (
        lambda v: options_of({"settings": {"SIM_WIND_N": 1}, "randomise": v}),
        (
            {"SIM_WIND_E": 3},
            {"SIM_WIND_E": (True, 3)},
            {"SIM_WIND_E": "12"},
            {"sim_wind_n": (0, 3)},
            {k: (0, v) for k, v in TWICE.items()},
            *NO_MAPPING,
        ),
    ),
    "env rate": (lambda v: options_of({"rate_hz": v}), (None, 0, *NO_NUMBER)),
    "env start": (lambda v: options_of({"start_m": v}), (None, -1, 3.0, *NO_NUMBER)),
    "env limits": (lambda v: options_of({"max_rate_rad_s": v}), (None, 3, (1, 2), (1, 2, 0), "abc")),
    "env history": (lambda v: options_of({"history": v}), (None, -1, 1.5, "x")),
    "env action": (lambda v: options_of({"action": v}), (None, 3, "x", [])),
    "envs": (LoadVectorEnv, (None, 0, 1.5, "x")),
    "envs threads": (lambda v: LoadVectorEnv(1, threads=v), (0, -1, "x")),
    "envs mode": (lambda v: LoadVectorEnv(1, autoreset_mode=v), ("x", 3)),
}


@pytest.mark.parametrize(("call", "values"), CALLS.values(), ids=CALLS)
def test_what_cannot_be_taken_is_an_error_of_one_line(
    call: Callable[[Any], Any], values: tuple[Any, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for value in values:
        with pytest.raises(plumbline.Error) as told:
            call(value)
        assert "\n" not in str(told.value), value
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: plumbline.fly("hover", force="no"), "force = 'no'; must be True or False"),  # type: ignore[arg-type]
        (
            lambda: Mission("a", (STEPS[0], plumbline.AttitudeRun("load", "x", 0.0, 2.0), STEPS[1])),  # type: ignore[arg-type]
            'items[1].tilt_north_deg = "x"; must be a number',
        ),
        (lambda: plumbline.fly("hover", seed=2**70), "seed = 1180591620717411303424; must be a whole number"),
        (
            lambda: plumbline.fly("hover", settings=[1]),
            "settings = [1]; must be a dict, as {'SIM_WIND_E': 3}",
        ),  # type: ignore[arg-type]
        (lambda: plumbline.sweep("hover", vary=[1]), "vary = [1]; must be a dict, as {'SIM_WIND_E': [0, 3]}"),  # type: ignore[arg-type]
        (lambda: plumbline.connect(15999.5), "address = 15999.5; must be a text, as 'udpin:127.0.0.1:14550'"),  # type: ignore[arg-type]
        (lambda: Mission("a", None), "steps = None; must be a list of steps, as [Takeoff(1.0), Land()]"),  # type: ignore[arg-type]
        (
            lambda: Picture(lambda _: b"").save("x.jpg"),
            "x.jpg: a picture is written as PNG, PDF or SVG; name it x.pdf",
        ),
        (lambda: Picture(lambda _: b"").save("/proc/x.png"), "/proc/x.png: cannot be written: No such file"),
        (
            lambda: plumbline.fly("hover", vehicle=Mission("a", STEPS)),  # type: ignore[arg-type]
            "; must be a name, the path of a file, or a plumbline.Vehicle",
        ),
        (
            lambda: plumbline.fly("hover", vehicle=Vehicle.load("bebop").replace(name="x", believed="bebp")),
            "x.toml: believed = \"bebp\"; unknown vehicle 'bebp'; did you mean bebop?",
        ),
        (
            lambda: plumbline.fly("hover", vehicle=Vehicle.load("bebop").replace(load_mass_kg=50.0)),
            "it cannot hover; lower load_mass_kg, or raise rotor_max_n",
        ),
    ],
)
def test_the_error_says_what_was_found_and_what_could_be(call: Callable[[], Any], says: str) -> None:
    with pytest.raises(plumbline.Error) as told:
        call()
    assert says in str(told.value)


def test_a_vehicle_made_in_python_is_called_by_its_name() -> None:
    """Not by the file in the cache that the programs read."""
    vehicle = Vehicle.load("bebop").replace(name="ju", gravity_m_s2=14.0)
    with pytest.raises(plumbline.Error, match=r"^hover cannot be flown by vehicle ju; force=True tries:"):
        plumbline.fly("hover", vehicle=vehicle)


def test_names_of_parameters_may_be_in_small_letters() -> None:
    """As on the command line."""
    assert setting_arguments({"sim_wind_e": 3, "MIS_SPEED": 2}) == ("SIM_WIND_E=3.0", "MIS_SPEED=2.0")
    options = options_of({"settings": {"sim_wind_e": 3}, "randomise": {"sim_wind_n": (0, 1)}})
    assert (options.settings, options.randomise) == ({"SIM_WIND_E": 3}, {"SIM_WIND_N": (0, 1)})


def test_a_law_that_is_an_empty_name_is_told_what_could_be() -> None:
    example = r"no planner of that name; must be a file as my_planner\.py:MyPlanner"
    with pytest.raises(plumbline.Error, match=example):
        plumbline.fly("hover", planner="")
