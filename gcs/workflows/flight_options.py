"""What a flight is asked for on the command line, and the same words again for its record."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gcs.shell.link import Address

_REFUSED = 2.0  # MIS_INFEASIBLE


@dataclass(frozen=True)
class FlightOptions:
    """Arguments and options of `gcs fly`."""

    mission: str
    law: str
    sensors: str
    vehicle: str
    seed: int
    speed: float | None  # None: lockstep
    real_time: bool  # the simulator waits for nobody
    out: Path | None
    settings: tuple[str, ...]  # NAME=VALUE
    connect: Address | None
    quiet: bool
    force: bool
    overwrite: bool
    limit_s: float | None

    def command_line(self) -> str:
        """The command that flies it again."""
        words = ["gcs fly", self.mission]
        if self.connect is not None:
            return " ".join([*words, "--connect", str(self.connect)])
        words += ["--law", self.law, "--sensors", self.sensors, "--vehicle", self.vehicle]
        words += ["--seed", str(self.seed)]
        words += ["--lockstep"] if self.speed is None else ["--speed", f"{self.speed:g}"]
        words += ["--real-time"] if self.real_time else []
        for setting in self.settings:
            words += ["--set", setting]
        return " ".join(words)

    @property
    def tries_anyway(self) -> bool:
        """Whether the autopilot is told to fly, or to slow down, what it cannot fly as asked."""
        name = "MIS_INFEASIBLE="
        given = [float(s.removeprefix(name)) for s in self.settings if s.startswith(name)]
        return any(value < _REFUSED for value in given)


def setting_of(text: str) -> tuple[str, float]:
    """NAME=VALUE as the command line has checked it."""
    name, _, value = text.partition("=")
    return name, float(value)
