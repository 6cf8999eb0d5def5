"""A mission in a file of another ground station. Imports little: `gcs fly` begins with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from autopilot.wire.convert.geodesy import Home
from missions.model import Mission

if TYPE_CHECKING:
    from autopilot.wire.items import WireItem


class FileNumbers(NamedTuple):
    """The numbers of the items in a file of another ground station, which also has items that are not sent,
    and items that are no steps to fly."""

    items: tuple[int, ...]  # of each item that is sent
    steps: tuple[int, ...]  # of each step: of its last item


@dataclass(frozen=True, slots=True)
class ForeignMission(Mission):
    """The mission in a file of another ground station: with its items as they are sent, which also say what
    steps do not (headings, commands that are kept but not done), and its fence and rally points, None if the
    file does not mention them. `home` is that for which it was planned; the steps end with the first landing.

    `left_out`: a line for each part of the file that the vehicle would refuse, and that is not among the
    items; `notes`: a line for each part that is not flown.
    """

    items: tuple[WireItem, ...]
    fence: tuple[WireItem, ...] | None
    rally: tuple[WireItem, ...] | None
    home: Home
    numbers: FileNumbers
    left_out: tuple[str, ...]
    notes: tuple[str, ...]


def home_of(mission: Mission) -> Home:
    """The home from which a mission is flown in simulation."""
    return mission.home if isinstance(mission, ForeignMission) else Home()


def home_text(home: Home) -> str:
    """The text that says from which home a mission is flown."""
    return f"flown with home at {home.latitude_deg:.7f}, {home.longitude_deg:.7f}, {home.altitude_m:g} m"
