"""What a mission is: a list of steps for the load, in world ENU (x east, y north, z up), SI units, from home.

Plain data without behaviour: the file format (`missions.fileformat`), the mission items on the wire, the
autopilot and the feasibility check all use these records. A step begins when the one before is done.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from missions.named_arguments import names_its_arguments
from missions.path_rows import path_rows

Axis = Literal["x", "y", "z"]
Controlled = Literal["vehicle", "load"]


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Takeoff:
    """Pull the cable taut above the load and lift it straight up, to `altitude_m` above home."""

    altitude_m: float


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Waypoint:
    """Carry the load to a point, from rest to rest, and hold it there for `hold_s` seconds."""

    east_m: float
    north_m: float
    altitude_m: float
    hold_s: float = 0.0


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Speed:
    """Peak speed of the load on the transfers that follow; None: that for which the vehicle is configured."""

    speed_m_s: float | None = None


@names_its_arguments
@dataclass(frozen=True, slots=True)
class SwitchFence:
    """Put the vehicle's fence in force or out of force, also beyond the mission."""

    on: bool


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Delay:
    """Hold the load where it hangs."""

    duration_s: float


@dataclass(frozen=True, slots=True)
class ReturnHome:
    """Carry the load to the point above its home, at its present height."""


@dataclass(frozen=True, slots=True)
class Land:
    """Lower the load to the ground and land the vehicle beside it."""


@dataclass(frozen=True, slots=True)
class Release:
    """Release the load. Items after it that command the load then command the vehicle, which flies alone."""


@dataclass(frozen=True, slots=True)
class PlaceLoad(Release):
    """Lower the load to the ground below it and release it there."""


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Winch:
    """Make the cable longer by `length_m` (negative: shorter): the vehicle stays, the load sinks or rises.

    `speed_m_s` is the peak rate of the winch; None: the rate for which it is configured.
    """

    length_m: float
    speed_m_s: float | None = None


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Sine:
    """sin(2 pi (t - start_s) / period_s + phase_rad), t in seconds since the signals began."""

    period_s: float
    phase_rad: float = 0.0
    start_s: float = 0.0


def _no_rise() -> float:
    """Raise TypeError: a field after one with a default needs a default too, but must be given here."""
    raise TypeError("Term() misses the argument 'rise_s'")


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Term:
    """amplitude_m * envelope(t) * product of factors, added to one axis of the load's path.

    The envelope is 0 before `start_s`, rises to 1 along half a cosine in `rise_s`, stays for `hold_s` (None:
    for ever), and falls back to 0 along half a cosine in `fall_s`. A rise or fall of 0 s is a jump. `rise_s`
    must be given.

    `rise_90_by_s` (None: no such requirement) is the time after `start_s` by which nine tenths of the rise
    must be completed, also on a path that is shaped for the vehicle. Only without factors.
    """

    axis: Axis
    amplitude_m: float
    start_s: float = 0.0
    rise_s: float = field(default_factory=_no_rise)
    hold_s: float | None = None
    fall_s: float = 0.0
    factors: tuple[Sine, ...] = ()
    rise_90_by_s: float | None = None


@names_its_arguments
@dataclass(frozen=True, slots=True)
class Signals:
    """Fly the sum of the terms for `duration_s`, from where the load's setpoint is when the step begins."""

    duration_s: float
    terms: tuple[Term, ...]


class TrajectoryPoint(NamedTuple):
    """Where the load is `t_s` after its trajectory began, relative to where it began."""

    t_s: float
    east_m: float
    north_m: float
    up_m: float


ORIGIN = TrajectoryPoint(0.0, 0.0, 0.0, 0.0)
TOLERANCE_M = 1e-3  # within which a trajectory passes rows
# Derivatives of a trajectory that are zero at both ends: the load rests there, and of all such paths through
# the points it has the smallest integral of the squared fifth derivative.
ZERO_AT_ENDS = (1, 5, 6, 7)


@dataclass(frozen=True, slots=True, init=False)
class Trajectory:
    """Fly the load through timed points, from where the load's setpoint is when the step begins.

    `points`: rows of t (s), east, north and up (m), as a list, an array (n, 4) or a data frame, 0.1 s apart
    or more. Their times and places count from the first. The path is the spline of degree 9 that passes each
    point at its time, and whose speed is zero at both ends. `Error` if a row has not four values.
    """

    points: tuple[TrajectoryPoint, ...]
    # east, north and altitude of the first row of the source, for a note if the load hangs elsewhere
    first_m: tuple[float, float, float] | None = field(default=None, compare=False, repr=False)

    def __init__(
        self, points: Iterable[Sequence[float]], first_m: tuple[float, float, float] | None = None
    ) -> None:
        rows = path_rows(points, TrajectoryPoint._fields, "points")
        object.__setattr__(self, "points", tuple(TrajectoryPoint(*row) for row in rows))
        object.__setattr__(self, "first_m", first_m)

    @classmethod
    def through(cls, rows: Iterable[Sequence[float]], tolerance_m: float = TOLERANCE_M) -> Trajectory:
        """The smoothest trajectory that passes rows (t, east, north, up) within `tolerance_m`, however close
        they are: those of a computed or recorded path. `Error` if there is none from rest to rest."""
        from missions.trajectory import through_rows  # loads much

        return through_rows(rows, tolerance_m)

    @property
    def duration_s(self) -> float:
        """Time of the last point."""
        return self.points[-1].t_s


@names_its_arguments
@dataclass(frozen=True, slots=True)
class AttitudeRun:
    """Swing an attitude out and back: angle(t) = tilt * sin^2(pi t / duration_s), t from 0 to `duration_s`.

    `controlled` is the vehicle (its thrust axis leans) or the load (the line from load to vehicle leans). A
    positive tilt leans towards north or east, and so pulls the load in that direction; both together lean by
    the root of the sum of their squares. `autopilot.trajectory.swing` has the direction and its derivatives.
    """

    controlled: Controlled
    tilt_north_rad: float
    tilt_east_rad: float
    duration_s: float


@names_its_arguments
@dataclass(frozen=True, slots=True)
class TurnHeading:
    """Turn to a heading, from east to north, or by an angle (`relative`). `sense`: 1 counter-clockwise seen
    from above, -1 clockwise, 0 whichever is shorter; `rate_rad_s` None: as fast as MPC_YAWRAUTO_MAX."""

    angle_rad: float
    relative: bool = False
    sense: int = 0
    rate_rad_s: float | None = None


@names_its_arguments
@dataclass(frozen=True, slots=True)
class LookAt:
    """Keep the heading towards a place, ENU from home; None: stop doing so."""

    east_m: float | None
    north_m: float | None


HeadingCommand = TurnHeading | LookAt  # items between steps, which take effect as the next step begins
LoadPath = Signals | Trajectory  # steps that give the load's place as a function of time
MotionStep = Takeoff | Waypoint | Speed | SwitchFence | Delay | ReturnHome | Land
PayloadStep = Release | PlaceLoad | Winch
Step = MotionStep | PayloadStep | LoadPath | AttitudeRun
KINDS: dict[type[Step], str] = {  # their names in files
    Takeoff: "takeoff",
    Waypoint: "waypoint",
    Speed: "speed",
    SwitchFence: "fence",
    Delay: "delay",
    Signals: "signals",
    Trajectory: "trajectory",
    AttitudeRun: "attitude",
    ReturnHome: "return",
    Release: "release",
    PlaceLoad: "place",
    Winch: "winch",
    Land: "land",
}


@dataclass(frozen=True, slots=True)
class Mission:
    """A named list of steps. `assumptions` states each value that was chosen and not found in the source;
    `locations` is `FILE:LINE` of each step in a mission file, empty if there is none. Behind each step of
    `loop_ends` the mission returns to an earlier one, without end; a ground station can leave this loop for
    the steps behind it."""

    name: str
    title: str
    description: str
    assumptions: tuple[str, ...]
    steps: tuple[Step, ...]
    locations: tuple[str, ...] = field(default=(), kw_only=True, compare=False, repr=False)
    loop_ends: tuple[int, ...] = field(default=(), kw_only=True)
