"""The requests of ground stations, in SI units and ENU from home, whatever message carried them.

The supervisor decides on those in `SupervisorRequest`; the endpoint itself answers those in
`EndpointRequest`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import nan

from autopilot.geometry.linear import Vec3
from autopilot.wire.items import LocatedStep
from missions.model import LookAt, TurnHeading

MIN_SPEED_M_S, MAX_SPEED_M_S = 0.05, 15.0  # of transfers


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
    """Switch the fence on or off, until the next such request or a restart of the vehicle."""

    on: bool


@dataclass(frozen=True, slots=True)
class InjectFailure:
    """Make parts of the simulated vehicle fail or work again: `bits` of the simulator's parameter.

    `sensor` is the bit of SYS_STATUS of a sensor, 0 of rotors.
    """

    parameter: str
    bits: int
    sensor: int
    fail: bool


@dataclass(frozen=True, slots=True)
class ReturnHome:
    """Return to home."""


@dataclass(frozen=True, slots=True)
class SetMode:
    """Enter a mode of the flavour's table."""

    main: int
    sub: int
    number: int | None = field(default=None, compare=False)  # by which it was requested
    name: str = field(default="", compare=False)  # of the flavour, for texts


@dataclass(frozen=True, slots=True)
class StartMission:
    """Fly the mission; `first`: from this item, None: from the current one."""

    first: int | None


@dataclass(frozen=True, slots=True)
class Pause:
    """Hold the load where it is now, and keep the mission."""


@dataclass(frozen=True, slots=True)
class Continue:
    """Continue the paused mission."""


@dataclass(frozen=True, slots=True)
class SetCurrent:
    """Make this item (None: the present one) the current one; `reset`: its jumps begin anew."""

    seq: int | None
    reset: bool = False


@dataclass(frozen=True, slots=True)
class ReplaceMission:
    """May the mission be replaced now (`count` items), or cleared (0)? Asked at the beginning and the end
    of an upload; at the end with the steps that would be flown."""

    count: int
    steps: tuple[LocatedStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Reposition:
    """Move the load to a position and hold it there; a component that is None is unchanged. `speed_m_s` None:
    the speed of transfers."""

    east_m: float | None
    north_m: float | None
    altitude_m: float | None
    change_mode: bool
    speed_m_s: float | None = None
    heading_rad: float | None = None  # from east to north


@dataclass(frozen=True, slots=True)
class FollowSetpoint:
    """One setpoint of a stream, ENU from home; NaN: not requested. `relative`: the position counts from the
    present commanded position of the load. `body`: axes along the heading: forward, left and up."""

    position: Vec3
    velocity: Vec3
    accel: Vec3
    relative: bool
    body: bool = False
    heading_rad: float = nan  # from east to north; in a `body` setpoint relative to the present heading
    yaw_rate_rad_s: float = nan


@dataclass(frozen=True, slots=True)
class FollowAttitude:
    """One attitude of a stream: thrust axis as a unit vector, ENU; thrust 0 ... 1, None: keep the height."""

    thrust_axis: Vec3
    thrust: float | None
    heading_rad: float = nan  # from east to north
    yaw_rate_rad_s: float = nan


@dataclass(frozen=True, slots=True)
class FollowRates:
    """One set of body rates of a stream, rad/s about the axes forward, left and up; thrust as in
    `FollowAttitude`."""

    rates: Vec3
    thrust: float | None


@dataclass(frozen=True, slots=True)
class FollowStick:
    """One position of the stick: the components of the velocity, forward, left and up, and the yaw rate,
    counter-clockwise, each as a share of its maximum."""

    velocity_share: Vec3
    yaw_rate: float = 0.0


@dataclass(frozen=True, slots=True)
class FollowTarget:
    """One report of the motion of a target, ENU from home; None: it is not reported."""

    position: Vec3
    velocity: Vec3 | None
    accel: Vec3 | None = None


@dataclass(frozen=True, slots=True)
class Orbit:
    """Fly the load round a circle. None: radius, speed and centre of the circle that is being flown; without
    one the vehicle's radius, the speed of transfers, and a centre here. A height of None is the present one.
    The direction is clockwise seen from above; a negative radius or a negative speed makes it
    counter-clockwise. The nose points to the centre (`faces_centre`), keeps its present heading (False), or
    does as before (None)."""

    radius_m: float | None
    speed_m_s: float | None
    east_m: float | None
    north_m: float | None
    altitude_m: float | None
    turns: float | None = None  # after which the load is held; None: for ever
    faces_centre: bool | None = None


@dataclass(frozen=True, slots=True)
class ChangeAltitude:
    """Move the load vertically to a height above home."""

    altitude_m: float


@dataclass(frozen=True, slots=True)
class ChangeSpeed:
    """Set the peak speed of the load on transfers; None: to MIS_SPEED."""

    speed_m_s: float | None


@dataclass(frozen=True, slots=True)
class SetHome:
    """Move home to a position in the present coordinates; None: to the position of the vehicle."""

    position: Vec3 | None


@dataclass(frozen=True, slots=True)
class Release:
    """Release the load, wherever it is."""


@dataclass(frozen=True, slots=True)
class Winch:
    """Make the cable longer by `length_m` (negative: shorter; infinite: to the end; 0: stop). `speed_m_s`
    None: at the winch's maximum speed."""

    length_m: float
    speed_m_s: float | None = None


@dataclass(frozen=True, slots=True)
class Grab:
    """Grip the cable of a load that lies within reach; no effect if the load was never released."""


# requests that move the vehicle or its load as soon as time continues
MOTION_REQUESTS = (
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
    | TurnHeading
    | LookAt
    | Release
    | Winch
    | Grab
)


@dataclass(frozen=True, slots=True)
class Terminate:
    """Stop the rotors immediately, wherever the vehicle is."""


@dataclass(frozen=True, slots=True)
class RunPrearmChecks:
    """Report what would prevent arming."""


@dataclass(frozen=True, slots=True)
class Reboot:
    """Restart the autopilot."""


@dataclass(frozen=True, slots=True)
class StoreParameters:
    """Save the parameters (`save`) or load them. The autopilot's own are stored with each change; those of
    the simulator are saved by this request only."""

    save: bool


@dataclass(frozen=True, slots=True)
class ResetParameters:
    """Reset every parameter to its default."""


@dataclass(frozen=True, slots=True)
class RequestMessage:
    """Send one message now; `argument` is param2 of the command."""

    message_id: int
    argument: float


@dataclass(frozen=True, slots=True)
class SetMessageInterval:
    """Send a message every `interval_us` on the requesting link; 0: the default rate, -1: never."""

    message_id: int
    interval_us: int


@dataclass(frozen=True, slots=True)
class GetMessageInterval:
    """Report the interval of a message on the requesting link."""

    message_id: int


@dataclass(frozen=True, slots=True)
class RequestCapabilities:
    """Send AUTOPILOT_VERSION."""


@dataclass(frozen=True, slots=True)
class ChangeVehicle:
    """Change a parameter that describes a part of the vehicle which does not change in flight."""

    parameter: str


@dataclass(frozen=True, slots=True)
class ChangeSigningKey:
    """Change or remove the key for signed messages; only the signing service knows the new key."""


SupervisorRequest = (
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
    | FollowTarget
    | TurnHeading
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
    | ChangeVehicle
    | ChangeSigningKey
)
EndpointRequest = (
    InjectFailure
    | StoreParameters
    | RequestMessage
    | SetMessageInterval
    | GetMessageInterval
    | RequestCapabilities
)
Request = SupervisorRequest | EndpointRequest
