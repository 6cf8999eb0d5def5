"""The options of a flight on the command line, and the command line again for its record."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from autopilot.own.law import own_law_reference
from autopilot.own.own_code import OwnCode
from autopilot.wire.convert.geodesy import Home
from gcs.shell.link import Address

SIMULATOR_PREFIX = "SIM_"  # beginning of the names of the simulator's parameters
Settings = Iterable[tuple[str, float]]  # parameters by name
_REFUSE_INFEASIBLE = 2.0  # MIS_INFEASIBLE


class FirmwareProgram(NamedTuple):
    """A third-party autopilot that is started for the flight: its kind, and its program."""

    kind: str
    path: Path


@dataclass(frozen=True)
class FlightOptions:
    """Arguments and options of `gcs fly`."""

    mission: str
    law: str
    sensors: str
    vehicle: str
    seed: int
    speed: float | None  # None: lockstep
    real_time: bool  # the simulator does not wait for the autopilot
    out: Path | None
    settings: tuple[str, ...]  # NAME=VALUE
    connect: Address | None
    quiet: bool
    force: bool
    overwrite: bool
    limit_s: float | None
    firmware: FirmwareProgram | None = None  # flies instead of Plumbline's autopilot
    estimator: str = ""  # a custom one; empty: the built-in one
    planner: str = ""
    truth_at: Address | None = None  # where the simulator of `connect` sends the truth
    pictures: tuple[str, ...] = ()  # formats of all pictures of the report; none: only that of its page
    log_sensors: bool = False  # make tables of all readings
    ignored: tuple[str, ...] = ()  # parameters in the vehicle's file that have no effect

    @property
    def own(self) -> OwnCode:
        """The custom parts (law, estimator, planner) of the flight."""
        return OwnCode(own_law_reference(self.law), self.estimator, self.planner)

    def command_line(self) -> str:
        """The command that flies it again."""
        words = ["gcs", "fly", self.mission]
        if self.connect is not None:
            words += ["--connect", str(self.connect)]
            words += ["--sysid", str(self.connect.system)] if self.connect.system is not None else []
            words += ["--truth", str(self.truth_at)] if self.truth_at else []
            return shlex.join([*words, *time_limit_option(self.limit_s)])
        if self.firmware is None:
            words += ["--law", self.law, *own_part_options(self.estimator, self.planner)]
            words += ignore_options(self.ignored)
        else:
            words += ["--autopilot", f"{self.firmware.kind}={self.firmware.path}"]
        words += ["--sensors", self.sensors, "--vehicle", self.vehicle]
        words += ["--seed", str(self.seed)]
        words += ["--lockstep"] if self.speed is None else ["--speed", f"{self.speed:g}"]
        words += ["--real-time"] if self.real_time else []
        words += ["--log-sensors"] if self.log_sensors else []
        for setting in self.settings:
            words += ["--set", setting]
        words += ["--force"] if self.force else []
        return shlex.join([*words, *time_limit_option(self.limit_s)])

    @property
    def mission_settings(self) -> tuple[tuple[str, float], ...]:
        """The settings that determine which paths the autopilot flies (MIS_), and the vehicle (VEH_) and the
        winch (WNC_) that it assumes, the last of each name."""
        named = (s for s in self.settings if s.startswith(("MIS_", "VEH_", "WNC_")))
        return tuple(dict(map(parse_setting, named)).items())

    @property
    def allows_infeasible(self) -> bool:
        """Whether the settings let the autopilot fly, or slow down, what it cannot fly as requested."""
        name = "MIS_INFEASIBLE="
        given = [float(s.removeprefix(name)) for s in self.settings if s.startswith(name)]
        return any(value < _REFUSE_INFEASIBLE for value in given)


def own_part_options(estimator: str, planner: str) -> list[str]:
    """The words of a command line for a custom estimator and planner, if there are any."""
    words = ["--estimator", estimator] if estimator else []
    return [*words, "--planner", planner] if planner else words


def ignore_options(ignored: Iterable[str]) -> list[str]:
    """The words of a command line for parameters in the vehicle's file that have no effect."""
    return [word for name in ignored for word in ("--ignore", name)]


def home_option(home: Home) -> list[str]:
    """The words of a command line of simulator or autopilot for a home that is not the default one."""
    return [] if home == Home() else ["--home", ",".join(map(repr, home))]


def time_limit_option(limit_s: float | None) -> list[str]:
    """The words of a command line for a time limit, if there is one."""
    return [] if limit_s is None else ["--timeout", f"{limit_s!r}"]


def parse_setting(text: str) -> tuple[str, float]:
    """Name and value of NAME=VALUE, which the command line has already checked."""
    name, _, value = text.partition("=")
    return name, float(value)
