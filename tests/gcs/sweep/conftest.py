"""A short mission, and the plan of a small sweep of it."""

from __future__ import annotations

import json
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import pytest

from autopilot.wire.convert.geodesy import Home, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import encode_mission
from gcs.folders import PLAN_FILE
from gcs.formats.missions import write_foreign
from gcs.sweep.plan import SweepPlan, from_json
from gcs.sweep.plan_values import VariedParameter
from missions.fileformat import parse_mission

SHORT = """
title = "Up, aside and down"
description = "A mission for tests."

[[items]]
type = "takeoff"
altitude_m = 1.0

[[items]]
type = "waypoint"
east_m = 0.4
north_m = 0.0
altitude_m = 1.0

[[items]]
type = "land"
"""


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("missions") / "short.toml"
    path.write_text(SHORT, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="session")
def stepped(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same with a second at the waypoint: a step of 0.4 m."""
    path: Path = tmp_path_factory.mktemp("missions") / "stepped.toml"
    land = '\n[[items]]\ntype = "land"\n'
    path.write_text(SHORT.replace(land, "hold_s = 1.0\n" + land), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="session")
def delivery(tmp_path_factory: pytest.TempPathFactory) -> str:
    path: Path = tmp_path_factory.mktemp("missions") / "delivery.toml"
    land = '[[items]]\ntype = "land"\n'
    path.write_text(SHORT.replace(land, '[[items]]\ntype = "release"\n\n' + land), encoding="utf-8")
    return str(path)


@pytest.fixture(scope="session")
def planned(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The same as a .plan, far from where the vehicle is by default, with a heading and a wide fence; beside
    it one with a narrow fence."""
    home, folder = Home(-33.9, 18.4, 60.0), tmp_path_factory.mktemp("plans")
    takeoff, waypoint, land = encode_mission(parse_mission(SHORT, "short", "short"), home)
    yaw = takeoff._replace(command=mavlink.MAV_CMD_CONDITION_YAW, param1=45.0, x=0, y=0, z=0.0)
    for name, radius_m in (("wide", 2.0), ("narrow", 0.3)):
        latitude, longitude, _ = geodetic_from_enu((0.0, 0.0, 0.0), home)
        circle = takeoff._replace(
            command=mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, param1=radius_m, x=latitude, y=longitude
        )
        write_foreign(folder / f"{name}.plan", (takeoff, yaw, waypoint, land), home, (circle,))
    return str(folder / "wide.plan")


WINCH = """
[[items]]
type = "winch"
length_m = 0.3

[[items]]
type = "waypoint"
east_m = 0.4
north_m = 0.2
altitude_m = 0.9

[[items]]
type = "winch"
length_m = -0.4
speed_m_s = 0.3

"""


@pytest.fixture(scope="session")
def winched(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A mission that lengthens the cable and shortens it again."""
    path: Path = tmp_path_factory.mktemp("missions") / "winched.toml"
    land = '[[items]]\ntype = "land"\n'
    path.write_text(SHORT.replace(land, WINCH.lstrip() + land), encoding="utf-8")
    return str(path)


SWING = """
[[items]]
type = "signals"
duration_s = 5.0

[[items.terms]]
axis = "y"
amplitude_m = 0.297
rise_s = 1.5
hold_s = 1.0
fall_s = 1.5

"""


@pytest.fixture(scope="session")
def swung(tmp_path_factory: pytest.TempPathFactory) -> str:
    """To the north and back, 3 mm before a fence at 0.3 m: within it for the check before the flight, but not
    for the supervisor, which extends the way to a stop."""
    path: Path = tmp_path_factory.mktemp("missions") / "swung.toml"
    waypoint = SHORT[SHORT.index('[[items]]\ntype = "waypoint"') : SHORT.index('[[items]]\ntype = "land"')]
    path.write_text(SHORT.replace(waypoint, SWING.lstrip()), encoding="utf-8")
    return str(path)


@pytest.fixture
def plan(short: str) -> SweepPlan:
    """Six flights, of which those with the long delay are lost."""
    delays = VariedParameter("SIM_ACT_DELAY_MS", (0.0, 4.0, 60.0), True)
    return SweepPlan(short, "bebop", "lab", ("thesis",), (1, 2), (delays,), ())


def stored_plan(directory: Path) -> SweepPlan:
    """The plan in the directory of a sweep."""
    stored = json.loads((directory / PLAN_FILE).read_text(encoding="utf-8"))
    return from_json(stored["origin"]["settings"]["plan"])


class AtOnce(Executor):
    """Flies immediately, in the calling thread."""

    def submit(self, function: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_running_or_notify_cancel()
        future.set_result(function(*arguments, **named))
        return future
