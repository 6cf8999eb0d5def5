"""What a ground station can ask for, as facts in SI units and ENU from home, apart from how it was said.

The first group is decided by the supervisor, the second is answered by the endpoint itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

from autopilot.geometry.linear import Vec3
from autopilot.wire.items import LocatedStep
from missions.model import LookAt, TurnNose


@dataclass(frozen=True, slots=True)
class Arm:
    """Start the rotors (`arm`) or stop them; `force` overrides the checks."""

    arm: bool
    force: bool


@dataclass(frozen=True, slots=True)
class Takeoff:
    """Take off to a height above home; None: the height of the parameter MIS_TAKEOFF_ALT."""

    altitude_m: float | None


@dataclass(frozen=True, slots=True)
class Land:
    """Land here."""


@dataclass(frozen=True, slots=True)
class EnableFence:
    """Heed the fence, or do not, until it is said otherwise or the vehicle starts anew."""

    on: bool


@dataclass(frozen=True, slots=True)
class FailParts:
    """Let parts of the simulated vehicle fail, or work again: `bits` of the simulator's parameter."""

    parameter: str
    bits: int
    fail: bool


@dataclass(frozen=True, slots=True)
class ReturnHome:
    """Return to home."""


@dataclass(frozen=True, slots=True)
class SetMode:
    """Enter a mode of the flavour's table."""

    main: int
    sub: int
    number: int | None = field(default=None, compare=False)  # under which it was asked for


@dataclass(frozen=True, slots=True)
class StartMission:
    """Fly the mission; `first`: from this item, None: from the current one."""

    first: int | None


@dataclass(frozen=True, slots=True)
class Pause:
    """Hold where the load is now, keep the mission."""


@dataclass(frozen=True, slots=True)
class Continue:
    """Go on with the paused mission."""


@dataclass(frozen=True, slots=True)
class SetCurrent:
    """Make this item the current one."""

    seq: int


@dataclass(frozen=True, slots=True)
class ReplaceMission:
    """May the mission be replaced now (`count` items), or cleared (0)? Asked at the begin and the end; at the
    end with the steps that would be flown."""

    count: int
    steps: tuple[LocatedStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Reposition:
    """Bring the load to a place and hold it there; a component that is None is kept. `speed_m_s` None: the
    speed of transfers."""

    east_m: float | None
    north_m: float | None
    altitude_m: float | None
    change_mode: bool
    speed_m_s: float | None = None
    heading_rad: float | None = None  # from east to north


@dataclass(frozen=True, slots=True)
class FollowSetpoint:
    """One setpoint of a stream, ENU from home; NaN: not asked for. `relative`: the position is one from
    where the load is asked to be now. `body`: the axes are those of the nose, forward, left and up."""

    position: Vec3
    velocity: Vec3
    accel: Vec3
    relative: bool
    body: bool = False
    heading_rad: float = nan  # from east to north; of a `body` setpoint from the present heading on
    turning_rad_s: float = nan


@dataclass(frozen=True, slots=True)
class FollowAttitude:
    """One attitude of a stream: thrust axis, unit vector, ENU; thrust 0 ... 1, None: keep the height."""

    upward: Vec3
    thrust: float | None
    heading_rad: float = nan  # from east to north
    turning_rad_s: float = nan


@dataclass(frozen=True, slots=True)
class FollowRates:
    """One set of body rates of a stream, rad/s about the axes forward, left and up; thrust as above."""

    rates: Vec3
    thrust: float | None


@dataclass(frozen=True, slots=True)
class FollowStick:
    """One position of the stick: each component of the velocity, forward, left and up, and the yaw rate,
    counter-clockwise, as a share of its greatest."""

    share: Vec3
    turning: float = 0.0


@dataclass(frozen=True, slots=True)
class Orbit:
    """Fly the load round a circle; None: here, at this height, at the speed of transfers. Clockwise seen from
    above; a negative radius is counter-clockwise, and so is a negative speed."""

    radius_m: float
    speed_m_s: float | None
    east_m: float | None
    north_m: float | None
    altitude_m: float | None
    turns: float | None = None  # after which the load is held; None: for ever


@dataclass(frozen=True, slots=True)
class ChangeAltitude:
    """Bring the load to a height above home, where it is."""

    altitude_m: float


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Peak speed of the load on transfers."""

    speed_m_s: float


@dataclass(frozen=True, slots=True)
class SetHome:
    """Move home to a place in the present coordinates; None: to where the vehicle is."""

    position: Vec3 | None


@dataclass(frozen=True, slots=True)
class Release:
    """Let the load go, wherever it is."""


@dataclass(frozen=True, slots=True)
class Winch:
    """Make the cable longer by `length_m` (negative: shorter; infinite: as far as it goes; 0: stop).
    `speed_m_s` None: as fast as the winch may."""

    length_m: float
    speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class Grab:
    """Take hold of the cable of a load that lies within reach; nothing where it was never let go."""


# what moves the vehicle or its load, as soon as time goes on
FLOWN = (
    Takeoff
    | Land
    | ReturnHome
    | SetMode
    | StartMission
    | Pause
    | Continue
    | SetCurrent
    | Reposition
    | Orbit
    | ChangeAltitude
    | ChangeSpeed
    | Release
    | Winch
    | Grab
)


@dataclass(frozen=True, slots=True)
class Terminate:
    """Stop the rotors at once, wherever the vehicle is."""


@dataclass(frozen=True, slots=True)
class RunPrearmChecks:
    """Say what would keep the vehicle from arming."""


@dataclass(frozen=True, slots=True)
class Reboot:
    """Start the autopilot anew (`shutdown`: stop it)."""

    shutdown: bool


@dataclass(frozen=True, slots=True)
class StoreParameters:
    """Save the parameters (`save`) or load them. Our own are stored when they change; those of the simulator
    are saved by this alone."""

    save: bool


@dataclass(frozen=True, slots=True)
class ResetParameters:
    """Bring every parameter back to its default."""


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """Send one message now; `argument` is param2 of the command."""

    message_id: int
    argument: float


@dataclass(frozen=True, slots=True)
class SetMessageInterval:
    """Send a message every `interval_us` on the asker's link; 0: the default rate, -1: never."""

    message_id: int
    interval_us: int


@dataclass(frozen=True, slots=True)
class GetMessageInterval:
    """Tell the interval of a message on the asker's link."""

    message_id: int


@dataclass(frozen=True, slots=True)
class RequestCapabilities:
    """Send AUTOPILOT_VERSION."""


@dataclass(frozen=True, slots=True)
class ChangeSigningKey:
    """Another key for signed messages, or none; which, only the service knows."""


Decided = (
    Arm
    | Takeoff
    | Land
    | ReturnHome
    | SetMode
    | StartMission
    | Pause
    | Continue
    | SetCurrent
    | ReplaceMission
    | Reposition
    | FollowSetpoint
    | FollowAttitude
    | FollowRates
    | FollowStick
    | TurnNose
    | LookAt
    | Orbit
    | ChangeAltitude
    | ChangeSpeed
    | SetHome
    | EnableFence
    | Release
    | Grab
    | Winch
    | Terminate
    | RunPrearmChecks
    | Reboot
    | ResetParameters
    | ChangeSigningKey
)
Answered = (
    FailParts
    | StoreParameters
    | RequestMessage
    | SetMessageInterval
    | GetMessageInterval
    | RequestCapabilities
)
Request = Decided | Answered
