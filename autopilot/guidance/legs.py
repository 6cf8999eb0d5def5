"""Legs: the motion requested of load or vehicle for a part of the flight, each a function of the time in it.

A leg is data. The supervisor strings legs together; the flight core gets its setpoint from the present one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

from autopilot.control.records import Jet
from autopilot.geometry.linear import E3, ZERO, Vec3, add, axpy, dot, norm, scale, sub
from autopilot.guidance.setpoint_follower import TrackAttitude, TrackPosition
from autopilot.trajectory.ramp import PEAK_RAMP_ACCEL
from autopilot.trajectory.reeling import reel, straight_way
from autopilot.trajectory.shaping import ShapedSignals
from autopilot.trajectory.slack_cable import slack_pace
from autopilot.trajectory.splines import evaluate_path
from autopilot.trajectory.swing import swing_direction
from autopilot.trajectory.transfer import (
    PEAK_SPEED,
    STEP_TERMS,
    Pace,
    lift_pace,
    pace,
    reachable_speed,
    transfer,
)
from autopilot.trajectory.waypoint_path import PathSegment
from autopilot.wire.dialect import plumbline as mavlink

QUAD_ATTITUDE = mavlink.PLUMBLINE_CONTROL_QUAD_ATTITUDE
LOAD_ATTITUDE = mavlink.PLUMBLINE_CONTROL_LOAD_ATTITUDE
LOAD_POSITION = mavlink.PLUMBLINE_CONTROL_LOAD_POSITION
QUAD_POSITION = mavlink.PLUMBLINE_CONTROL_QUAD_POSITION

CATCH_S = 0.15  # in which the slack of a cable is taken up in the air
DAMPING_SHARE = 0.6  # of the least duration of a move: how long calming a swing takes
MIN_RAMP_S = 0.3  # in which the winch comes to its rate
MAX_LEAN_SINE = 0.7  # sine of the greatest lean of the cable that is requested of a swinging load


def _rest(position: Vec3) -> Jet:
    return (position, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO)


def _moved(anchor: Vec3, jet: Jet) -> Jet:
    x, v, a, j, s, c, p = jet
    return (add(anchor, x), v, a, j, s, c, p)


def _at_pace(path: Jet, rates: tuple[float, ...]) -> Jet:
    """The jet of y(sigma(t)) from that of y and the derivatives 1 ... 6 of sigma; Faa di Bruno's formula."""
    a, b, c, d, e, f = rates
    x, *y = path
    weights: tuple[tuple[float, ...], ...] = (
        (a,),
        (b, a * a),
        (c, 3.0 * a * b, a**3),
        (d, 3.0 * b * b + 4.0 * a * c, 6.0 * a * a * b, a**4),
        (
            e,
            10.0 * b * c + 5.0 * a * d,
            15.0 * a * b * b + 10.0 * a * a * c,
            10.0 * a**3 * b,
            a**5,
        ),
        (
            f,
            10.0 * c * c + 15.0 * b * d + 6.0 * a * e,
            15.0 * b**3 + 60.0 * a * b * c + 15.0 * a * a * d,
            45.0 * a * a * b * b + 20.0 * a**3 * c,
            15.0 * a**4 * b,
            a**6,
        ),
    )
    later = []
    for row in weights:
        east = north = up = 0.0
        for weight, (along_east, along_north, along_up) in zip(row, y, strict=False):
            east += weight * along_east
            north += weight * along_north
            up += weight * along_up
        later.append((east, north, up))
    return (x, later[0], later[1], later[2], later[3], later[4], later[5])


@dataclass(frozen=True, slots=True)
class Hold:
    """Stay at a point for `duration_s` (infinite: until another leg replaces this one)."""

    position: Vec3
    duration_s: float = inf
    control_mode: int = LOAD_POSITION

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return _rest(self.position)


@dataclass(frozen=True, slots=True)
class LiftWait(Hold):
    """The load should hang at the end of its lift, but still lies at this height: the law pulls harder."""

    start_height_m: float = 0.0


@dataclass(frozen=True, slots=True)
class LagWait(Hold):
    """Load or vehicle is far from its path, which waits here until it comes near."""


@dataclass(frozen=True, slots=True)
class Transfer:
    """From rest to rest along a straight line."""

    begin: Vec3
    end: Vec3
    pace: Pace
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """From rest to rest."""
        return self.pace.duration_s

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return straight_way(self.begin, self.end, self.pace.duration_s, self.pace.ramp_s, t)


@dataclass(frozen=True, slots=True)
class Brake:
    """From motion to rest: the velocity with which the motion would continue fades away.

    x' = (v_0 + a_0 t) (1 - s(t / duration)) with the s of `autopilot.trajectory.transfer`, so that position,
    velocity and acceleration continue without a jump and every derivative is zero in the end.
    """

    begin: Vec3
    velocity: Vec3
    acceleration: Vec3
    duration_s: float
    control_mode: int = LOAD_POSITION

    @property
    def end(self) -> Vec3:
        """Where the motion ends."""
        return self._position(1.0)

    def _position(self, u: float) -> Vec3:
        """x at t = u duration: x' integrated term by term."""
        along, bent = u, 0.5 * u * u
        for power, c in STEP_TERMS:
            along -= c * u ** (power + 1) / (power + 1)
            bent -= c * u ** (power + 2) / (power + 2)
        T = self.duration_s
        return axpy(bent * T * T, self.acceleration, axpy(along * T, self.velocity, self.begin))

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        if t >= self.duration_s:
            return _rest(self.end)
        t = max(t, 0.0)
        # the fading factor 1 - s with its derivatives is a transfer from 1 to 0
        w = [d[0] for d in transfer((1.0, 0.0, 0.0), ZERO, self.duration_s, t)]
        v = axpy(t, self.acceleration, self.velocity)
        # Leibniz; of v only the first derivative, a_0, is not zero
        later = [scale(w[0], v)]
        later += [axpy(n * w[n - 1], self.acceleration, scale(w[n], v)) for n in range(1, 6)]
        x = self._position(t / self.duration_s)
        return (x, later[0], later[1], later[2], later[3], later[4], later[5])


@dataclass(frozen=True, slots=True)
class PathStop:
    """A stop along the path of another leg: the time of that leg passes ever more slowly and stops.

    x(t) = y(sigma(t)), sigma' = 1 - s(t / stop) with the s of `autopilot.trajectory.transfer`: every
    derivative continues without a jump and is zero in the end, the path is that of the leg, and no part of it
    is flown faster. When this leg begins, `elapsed_s` of the stop have passed.
    """

    leg: Leg
    begin_s: float  # time in `leg` at which the stop begins
    stop_s: float
    elapsed_s: float = 0.0
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """Remaining time of the stop."""
        return self.stop_s - self.elapsed_s

    @property
    def end(self) -> Vec3:
        """Where the motion ends."""
        return self.leg.jet(self.end_s)[0]

    @property
    def end_s(self) -> float:
        """Time in `leg` at which the motion ends."""
        return self._time(self.stop_s)

    def _time(self, t: float) -> float:
        """sigma: 1 - s integrated term by term."""
        u = t / self.stop_s
        gone = u
        for power, c in STEP_TERMS:
            gone -= c * u ** (power + 1) / (power + 1)
        return self.begin_s + gone * self.stop_s

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        t = t + self.elapsed_s
        if t >= self.stop_s:
            return _rest(self.end)
        t = max(t, 0.0)
        rates = tuple(w[0] for w in transfer((1.0, 0.0, 0.0), ZERO, self.stop_s, t)[:6])
        return _at_pace(self.leg.jet(self._time(t)), rates)


@dataclass(frozen=True, slots=True)
class CatchLoad:
    """The cable is slack in the air: the vehicle falls with its load and moves away from it until it is taut.

    The thrust can only separate them faster, never slow the separation: they separate at `separation_m_s`, or
    faster if the slack would otherwise not be taken up in CATCH_S, since meanwhile both fall. The requested
    motion depends on the state and not on time: `falling_motion`. `anchor` is where the vehicle was.
    """

    anchor: Vec3
    length_m: float  # of the cable
    separation_m_s: float
    duration_s: float = inf
    control_mode: int = QUAD_POSITION

    def jet(self, t: float) -> Jet:
        """The anchor at rest."""
        return _rest(self.anchor)

    def falling_motion(self, x_quad: Vec3, v_quad: Vec3, x_load: Vec3, v_load: Vec3, gravity: float) -> Jet:
        """Motion requested of the vehicle. Only the climb is requested: there is hardly any thrust, and
        turning would need more of it than falling allows."""
        cable = sub(x_load, x_quad)
        distance = norm(cable)
        q = scale(1.0 / max(distance, 1e-6), cable)
        separation_speed = max(self.separation_m_s, (self.length_m - distance) / CATCH_S)
        climb = v_quad[2] + (dot(q, sub(v_load, v_quad)) - separation_speed) * q[2]
        return (x_quad, (v_quad[0], v_quad[1], climb), (0.0, 0.0, -gravity), ZERO, ZERO, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class Creep:
    """Along a straight line at constant speed, without end: until something is touched or pulled taut."""

    begin: Vec3
    velocity: Vec3
    control_mode: int
    duration_s: float = inf

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return (add(self.begin, scale(t, self.velocity)), self.velocity, ZERO, ZERO, ZERO, ZERO, ZERO)


@dataclass(frozen=True, slots=True)
class Reel:
    """The winch lowers the load (raises it: `speed` negative) while the vehicle is held at height `top_m`.

    The length of the cable is the depth of the load below that height. The rate rises to `speed` along a
    ramp of `ramp_s`, stays for `cruise_s`, and falls as it rose.
    """

    begin: Vec3
    top_m: float
    speed: float
    ramp_s: float
    cruise_s: float
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """From rest to rest."""
        return 2.0 * self.ramp_s + self.cruise_s

    @property
    def end(self) -> Vec3:
        """Where the load comes to rest."""
        x = self.begin
        return (x[0], x[1], x[2] - self.speed * (self.ramp_s + self.cruise_s))

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return reel(self.begin, self.speed, self.ramp_s, self.cruise_s, t)


@dataclass(frozen=True, slots=True)
class SignalRun:
    """The signals of a mission as they are flown, from where the load hung when they began."""

    anchor: Vec3
    path: ShapedSignals
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """From getting ready for the signals to coming to rest after them."""
        return self.path.lead_s + self.path.duration_s + self.path.tail_s

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return _moved(self.anchor, self.path.jet(t - self.path.lead_s))

    def requested(self, t: float) -> Jet:
        """The same for the requested path."""
        return _moved(self.anchor, self.path.requested(t - self.path.lead_s))


@dataclass(frozen=True, slots=True)
class PathResume:
    """The rest of a run after a stop along it: the time of the run passes ever faster, and then as it should.

    x(t) = y(sigma(t)), sigma' = s(t / start) with the s of `autopilot.trajectory.transfer`: every derivative
    continues from rest without a jump, and no part of the path is flown faster than in the run.
    """

    run: SignalRun
    begin_s: float  # time in `run` at which the load rests
    start_s: float
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """Time to the end of the run: of the start, half is lost."""
        return self.run.duration_s - self.begin_s + 0.5 * self.start_s

    def run_time(self, t: float) -> float:
        """sigma: the time in the run, `t` seconds into the leg."""
        if t >= self.start_s:
            return self.begin_s + t - 0.5 * self.start_s
        u = max(t, 0.0) / self.start_s
        gone = 0.0
        for power, c in STEP_TERMS:
            gone += c * u ** (power + 1) / (power + 1)
        return self.begin_s + gone * self.start_s

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        return self._started(self.run.jet(self.run_time(t)), t)

    def requested(self, t: float) -> Jet:
        """The same for the requested path."""
        return self._started(self.run.requested(self.run_time(t)), t)

    def _started(self, path: Jet, t: float) -> Jet:
        if t >= self.start_s:
            return path
        return _at_pace(path, tuple(w[0] for w in transfer(ZERO, (1.0, 0.0, 0.0), self.start_s, t)[:6]))


@dataclass(frozen=True, slots=True)
class PathStretch:
    """A stretch of a path through waypoints; the path continues beyond the end of the stretch.

    `offset` is the displacement of the load from the beginning of the path when it began; it fades away in
    `fade_s`.
    """

    path: PathSegment
    offset: Vec3
    fade_s: float
    control_mode: int = LOAD_POSITION

    @property
    def duration_s(self) -> float:
        """From one waypoint to the next."""
        return self.path.end_s - self.path.begin_s

    def jet(self, t: float) -> Jet:
        """Position and derivatives 1 ... 6, ENU, `t` seconds into the leg."""
        at = self.path.begin_s + t
        x, v, a, j, s, c, p = evaluate_path(self.path.table, at)
        y = transfer(self.offset, ZERO, self.fade_s, at)
        return (
            add(x, y[0]),
            add(v, y[1]),
            add(a, y[2]),
            add(j, y[3]),
            add(s, y[4]),
            add(c, y[5]),
            add(p, y[6]),
        )


@dataclass(frozen=True, slots=True)
class Swing:
    """An attitude of vehicle or load swung out and back. Only the height of `anchor` is held meanwhile."""

    anchor: Vec3
    tilt_north_rad: float
    tilt_east_rad: float
    duration_s: float
    control_mode: int

    def jet(self, t: float) -> Jet:
        """The anchor at rest: only its height is tracked."""
        return _rest(self.anchor)

    def upward(self, t: float) -> Vec3:
        """Unit vector, ENU: the requested thrust axis, or the direction from load to vehicle."""
        return swing_direction(self.tilt_north_rad, self.tilt_east_rad, self.duration_s, t)[0]


@dataclass(frozen=True, slots=True)
class SwingDamping:
    """Take the swing out of the load: the cable's lean continues as it was and fades away.

    p = (p_0 + p_0' t) (1 - s(t / duration)), where p is the horizontal part of the unit vector from load to
    vehicle and s that of `autopilot.trajectory.transfer`. As in a swing, only the height of `anchor` is held
    meanwhile. `ends_step`: with this leg ends the mission step that left the load swinging.
    """

    anchor: Vec3
    lean: Vec3
    lean_rate: Vec3
    ends_step: bool
    duration_s: float
    control_mode: int = LOAD_ATTITUDE

    def jet(self, t: float) -> Jet:
        """The anchor at rest: only its height is tracked."""
        return _rest(self.anchor)

    def upward(self, t: float) -> Vec3:
        """Unit vector, ENU: the direction from load to vehicle."""
        fade = transfer((1.0, 0.0, 0.0), ZERO, self.duration_s, t)[0][0]
        x, y, _ = scale(fade, axpy(t, self.lean_rate, self.lean))
        shrink = min(1.0, MAX_LEAN_SINE / max(sqrt(x * x + y * y), 1e-9))
        x, y = shrink * x, shrink * y
        return (x, y, sqrt(1.0 - x * x - y * y))


@dataclass(frozen=True, slots=True)
class LevelHold:
    """The vehicle is kept level by its gyroscope, with a thrust (N), while nothing else is known."""

    thrust_n: float
    duration_s: float = inf
    control_mode: int = QUAD_ATTITUDE

    def jet(self, t: float) -> Jet:
        """Home at rest: no position is controlled."""
        return _rest(ZERO)

    def upward(self, t: float) -> Vec3:
        """Unit vector, ENU: the requested thrust axis."""
        return E3


Leg = (
    Hold
    | Transfer
    | Brake
    | PathStop
    | CatchLoad
    | Creep
    | Reel
    | SignalRun
    | PathResume
    | PathStretch
    | Swing
    | SwingDamping
    | TrackPosition
    | TrackAttitude
    | LevelHold
)


def requested_jet(leg: Leg, t: float) -> Jet:
    """The requested motion where the leg flies a shaped one; otherwise the motion that it flies."""
    return leg.requested(t) if isinstance(leg, SignalRun | PathResume) else leg.jet(t)


def brake_leg(
    begin: Vec3, velocity: Vec3, acceleration: Vec3, accel_limit: float, min_duration_s: float
) -> Brake:
    """A stop that takes the velocity away with no more than about `accel_limit` (m/s^2)."""
    duration = max(min_duration_s, PEAK_SPEED * norm(velocity) / accel_limit)
    return Brake(begin, velocity, acceleration, duration)


def path_stop_leg(leg: Leg, t: float, accel_limit: float, min_duration_s: float) -> PathStop:
    """A stop on the path of `leg`, `t` seconds into it, that slows down with no more than about `accel_limit`
    (m/s^2). If `leg` is itself a stop: the rest of it."""
    if isinstance(leg, PathStop):
        return replace(leg, elapsed_s=min(leg.elapsed_s + t, leg.stop_s))
    return PathStop(leg, t, max(min_duration_s, PEAK_SPEED * norm(leg.jet(t)[1]) / accel_limit))


def slack_leg(begin: Vec3, end: Vec3) -> Transfer:
    """A vehicle whose cable is slack moves from rest to rest."""
    return Transfer(begin, end, slack_pace(norm(sub(end, begin))), QUAD_POSITION)


def reel_leg(begin: Vec3, length: float, target_length: float, speed: float, accel: float) -> Reel:
    """The winch makes a cable of `length` m `target_length` m long within the speed and acceleration given;
    the load hangs at `begin`, the vehicle stays."""
    length_change = abs(target_length - length)
    rate = reachable_speed(length_change, speed, accel)
    ramp = max(PEAK_RAMP_ACCEL * rate / accel, MIN_RAMP_S)
    rate = min(rate, length_change / ramp)
    sign = 1.0 if target_length > length else -1.0
    return Reel(begin, begin[2] + length, sign * rate, ramp, length_change / rate - ramp)


def winch_hold_height(leg: Leg) -> float | None:
    """Height at which the vehicle is held while the winch works; None where it rests."""
    if isinstance(leg, PathStop):
        return winch_hold_height(leg.leg)
    return leg.top_m if isinstance(leg, Reel) else None


def carry_leg(
    begin: Vec3, end: Vec3, speed: float, accel: float, min_move_s: float, min_duration_s: float = 0.0
) -> Transfer:
    """A transfer of the load within the limits given, and no quicker than `min_duration_s` unless the
    distance is zero; see `autopilot.trajectory.transfer.pace`."""
    distance = norm(sub(end, begin))
    return Transfer(begin, end, pace(distance, speed, accel, min_move_s).stretched(min_duration_s))


def lift_leg(begin: Vec3, end: Vec3, speed: float, accel: float, min_move_s: float) -> Transfer:
    """A transfer straight up or down, from or to near the ground, within the limits given; see
    `autopilot.trajectory.transfer.lift_pace`."""
    return Transfer(begin, end, lift_pace(norm(sub(end, begin)), speed, accel, min_move_s))
