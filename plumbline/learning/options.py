"""The options of an environment, checked once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from gcs.errors import GcsError
from missions.model import Mission
from missions.nearest import did_you_mean
from plumbline.arguments import (
    number,
    numbers,
    parameter_mapping,
    positive,
    setting_arguments,
    shown_value,
    values_by_parameter,
    whole_number,
)
from plumbline.learning.records import ACTIONS, Reward
from plumbline.made_files import name_or_path
from plumbline.sensors import Sensors
from plumbline.vehicles import Vehicle

OBSERVATIONS = ("truth", "estimate")
STARTS = ("begin", "random")
_PIXELS = (32, 4096)  # least and greatest side of a picture


@dataclass(frozen=True)
class EnvOptions:
    """The options of both environments; docs/learning.md has them with their defaults and units."""

    action: str = "ctbr"
    observation: str = "truth"
    rate_hz: float = 50.0
    history: int = 0
    preview: int = 0
    preview_s: float = 0.1
    vehicle: str | Path | Vehicle = "bebop"
    sensors: str | Path | Sensors = "lab"
    settings: Mapping[str, float] = field(default_factory=dict)
    randomise: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reward: Mapping[str, float] = field(default_factory=dict)
    start_m: float = 0.5
    reach_m: float = 2.0
    max_rate_rad_s: tuple[float, float, float] = (6.0, 6.0, 2.0)
    max_accel_m_s2: tuple[float, float, float] = (4.0, 4.0, 4.0)
    mission: str | Path | Mission | None = None  # None: hover at a fixed position
    start: str = "begin"
    render_size: tuple[int, int] = (480, 480)

    @cached_property
    def vehicle_file(self) -> str:
        """Name or path of the vehicle."""
        return name_or_path("vehicle", self.vehicle)

    @cached_property
    def sensors_file(self) -> str:
        """Name or path of the sensor profile."""
        return name_or_path("sensors", self.sensors)

    def __post_init__(self) -> None:
        if self.reward is None:
            object.__setattr__(self, "reward", {})
        for name, example in (("settings", "{'SIM_WIND_E': 3}"), ("randomise", "{'SIM_WIND_E': (0, 3)}")):
            object.__setattr__(self, name, values_by_parameter(name, getattr(self, name), example))
        _one_of("action", self.action, tuple(ACTIONS))
        _one_of("observation", self.observation, OBSERVATIONS)
        _one_of("start", self.start, STARTS)
        if self.start == "random" and self.mission is None:
            raise GcsError("start = 'random' begins anywhere on the path of a mission; name one by mission=")
        for name in ("history", "preview"):
            whole_number(name, getattr(self, name), 0, 1000)
        for name in ("rate_hz", "preview_s", "reach_m"):
            positive(name, getattr(self, name))
        if not 0.0 <= number("start_m", self.start_m) < self.reach_m:
            raise GcsError(f"start_m = {self.start_m!r}; must be at least 0 and below reach_m")
        for name in ("max_rate_rad_s", "max_accel_m_s2"):
            _three_positive(name, getattr(self, name))
        _width_and_height("render_size", self.render_size)
        setting_arguments(self.settings)
        for name, weight in parameter_mapping("reward", self.reward, "{'crash': -10}").items():
            if name not in Reward._fields:
                hint = did_you_mean(name, Reward._fields)
                raise GcsError(f"reward: there is no {name!r}; {hint}there are {', '.join(Reward._fields)}")
            # the error of the position is divided by the width
            (positive if name == "width" else number)(f"reward[{name!r}]", weight)
        for name, limits in self.randomise.items():
            if name in self.settings:
                raise GcsError(f"{name} is both in settings and in randomise; leave one of the two out")
            if not _is_range(limits):
                raise GcsError(f"randomise {name}: {shown_value(limits)}; must be (least, greatest)")


def options_of(given: Mapping[str, Any]) -> EnvOptions:
    """The options given as keyword arguments. `Error` (plumbline.Error) names what is wrong."""
    known = [each.name for each in fields(EnvOptions)]
    unknown = sorted(set(given) - set(known))
    if unknown:
        hint = did_you_mean(unknown[0], known)
        raise GcsError(f"{unknown[0]}: there is no such option; {hint}there are {', '.join(known)}")
    return EnvOptions(**given)


def _one_of(name: str, value: object, known: tuple[str, ...]) -> None:
    if not isinstance(value, str) or value not in known:
        raise GcsError(f"{name} = {shown_value(value)}; must be one of {', '.join(known)}")


def _three_positive(name: str, values: Any) -> None:
    found = numbers(name, values)
    if len(found) != 3 or min(found) <= 0.0:
        raise GcsError(f"{name} = {shown_value(values)}; must be three numbers above 0")


def _width_and_height(name: str, values: Any) -> None:
    if not isinstance(values, Sequence) or isinstance(values, str) or len(values) != 2:
        raise GcsError(f"{name} = {shown_value(values)}; must be (width, height) in pixels")
    for value in values:
        whole_number(name, value, *_PIXELS)


def _is_range(limits: Any) -> bool:
    try:
        low, high = numbers("limits", limits)
    except (GcsError, ValueError):
        return False
    return low <= high
