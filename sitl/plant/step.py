"""One fixed step of the plant, with the switch between taut and slack located in time.

`advance` cuts its step into segments of fourth-order Runge-Kutta. A segment ends at the end of the step, at a
sub-step near the ground, or where the cable changes its mode: taut to slack when the tension passes zero,
slack to taut when the distance reaches the cable length. The instant is found by a bracketed secant search
(Illinois) over the length of the Runge-Kutta step itself, so that no interpolant is used. Coming taut is
perfectly inelastic along the cable: the velocities along it become equal, linear momentum is conserved.
"""

from __future__ import annotations

from math import ceil

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import ZERO, Vec3, add, axpy, dot, norm, scale, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.s2 import tangent
from autopilot.geometry.so3 import IDENTITY_QUAT, rotation_from_quat
from sitl.plant.attachment import attachment_offset, attachment_velocity, cable_and_rate, is_off_centre
from sitl.plant.contact import quad_reach
from sitl.plant.impact import at_cable_length
from sitl.plant.records import Motion, PlantState, Truth
from sitl.plant.rotors import BEFORE, END, FORCE, RotorRows, copy_row, set_targets
from sitl.plant.runge_kutta import StepEnd, runge_kutta_step

# Longest steps, from benchmarks/plant_convergence.py: docs/plant.md has the table.
MAX_STEP = 4e-3  # s, in the air
CONTACT_STEP = 5e-4  # s, where a contact is possible
# a contact is possible within this height plus the distance moved in one step, m
_CONTACT_MARGIN = 0.02

# Excess length and pushing count only beyond these: a thousand times the rounding of the two quantities.
_LENGTH_TOLERANCE = 1e-12  # m
_TENSION_TOLERANCE = 1e-12  # N
_TIME_TOLERANCE = 1e-13  # s
_MAX_IMPACTS = 4  # in one step; a remaining distance is corrected at the start of the next
_MAX_SEARCH = 60  # trials of the search; bisection alone would need 35

# Outside these the model is not valid and the step no longer resolves the motion.
_MAX_RATE = 200.0  # rad/s
_MAX_SPEED = 200.0  # m/s
_MAX_DISTANCE = 1e5  # m
_MIN_DISTANCE = 1e-6  # m
_MIN_SPEED = 1e-60  # m/s, rad/s: anything slower counts as at rest


@kernel
def segment_length(motion: Motion, truth: Truth, remaining: float) -> float:
    """Longest step that resolves what may happen next; divides `remaining` evenly."""
    v_quad_z = motion.v_load[2] - motion.separation_dot[2]
    quad_clearance = motion.x_load[2] - motion.separation[2] - quad_reach(truth)
    load_clearance = motion.x_load[2] - truth.load_radius
    longest = MAX_STEP
    if (
        quad_clearance + MAX_STEP * v_quad_z < _CONTACT_MARGIN
        or load_clearance + MAX_STEP * motion.v_load[2] < _CONTACT_MARGIN
    ):
        longest = CONTACT_STEP
    # a remainder that only rounding puts above the limit is still one step
    if not remaining > longest * (1.0 + 1e-9):
        return remaining
    return remaining / ceil(remaining / longest - 1e-9)


@kernel
def _mode_excess(motion: Motion, tension: float, taut: float, truth: Truth) -> float:
    """Positive when the mode must change: while taut, the force (N) with which the cable would push; while
    slack, the distance (m) by which its ends are further apart than its length."""
    if taut > 0.0:
        return -tension - _TENSION_TOLERANCE
    return norm(cable_and_rate(motion, truth)[0]) - motion.length - _LENGTH_TOLERANCE


@kernel
def _closing_speed(motion: Motion, truth: Truth) -> float:
    """Speed in m/s at which the ends separate, minus the rate at which the cable is let out."""
    cable, cable_dot = cable_and_rate(motion, truth)
    return dot(cable, cable_dot) / norm(cable) - motion.length_dot


@kernel
def is_valid(motion: Motion) -> bool:
    """Whether the motion is finite and within the domain of the model; a comparison with nan is false."""
    v_quad = sub(motion.v_load, motion.separation_dot)
    return (
        norm(motion.omega) < _MAX_RATE
        and norm(motion.v_load) < _MAX_SPEED
        and norm(v_quad) < _MAX_SPEED
        and norm(motion.x_load) < _MAX_DISTANCE
        and norm(motion.separation) < _MAX_DISTANCE
        and abs(motion.quat[0]) <= 1.0 + 1e-9
    )


@kernel
def frozen_state(state: PlantState) -> PlantState:
    """`state`, marked as the last one before the motion left the domain of the model."""
    return PlantState(
        state.x_load,
        state.v_load,
        state.q_cable,
        state.q_cable_dot,
        state.x_quad,
        state.v_quad,
        state.quat_wxyz,
        state.omega_body,
        state.taut,
        state.slack_events,
        state.vehicle_on_ground,
        state.load_on_ground,
        state.accel_quad,
        state.tension,
        1.0,
        0.0,
        state.omega_dot_body,
    )


@kernel
def _zero_if_tiny(speed: float) -> float:
    """A component of a velocity, or 0 once it has decayed.

    On the ground, speeds decay but never reach zero, and a processor takes a hundred times as long to add
    numbers below 1e-308 as others.
    """
    return if_above(abs(speed), _MIN_SPEED, speed, 0.0)


@kernel
def zero_tiny_components(v: Vec3) -> Vec3:
    return (_zero_if_tiny(v[0]), _zero_if_tiny(v[1]), _zero_if_tiny(v[2]))


@kernel
def state_of(
    end: StepEnd, q_before: Vec3, taut: float, slack_events: float, snap_speed: float, truth: Truth
) -> PlantState:
    """The state at the end of a step."""
    motion = end.motion
    v_load, separation_dot = zero_tiny_components(motion.v_load), zero_tiny_components(motion.separation_dot)
    q_cable, q_cable_dot = q_before, ZERO
    cable, cable_dot = cable_and_rate(with_field(motion, "separation_dot", separation_dot), truth)
    distance = norm(cable)
    # where the load passes through the vehicle the direction is undefined: keep the last one
    if distance > _MIN_DISTANCE:
        q_cable = scale(1.0 / distance, cable)
        q_cable_dot = scale(1.0 / distance, tangent(q_cable, cable_dot))
    return PlantState(
        motion.x_load,
        v_load,
        q_cable,
        q_cable_dot,
        sub(motion.x_load, motion.separation),
        sub(v_load, separation_dot),
        motion.quat,
        zero_tiny_components(motion.omega),
        taut,
        slack_events,
        1.0 if end.quad_normal > 0.0 else 0.0,
        1.0 if end.load_normal > 0.0 else 0.0,
        end.accel_quad,
        end.tension,
        0.0,
        snap_speed,
        end.omega_dot,
    )


@kernel
def advance(state: PlantState, truth: Truth, rotors: RotorRows, wind: Vec3, h: float) -> PlantState:
    """The state h seconds later under constant wind (world, m/s) and the commands in `rotors`, whose forces
    are advanced in place.

    Steps longer than MAX_STEP are divided. If the state would leave the domain of the model (see the limits
    above), the state before the step is returned, marked `diverged`; all further steps return it again.

    While a winch turns, `truth` holds cable length, rate and acceleration at the beginning of the step; the
    caller updates them before the next step.
    """
    if state.diverged > 0.0:
        return state
    set_targets(rotors, truth)
    copy_row(rotors, FORCE, BEFORE)
    taut, slack_events = state.taut, state.slack_events
    if taut > 0.0:
        cable = scale(truth.cable_length, state.q_cable)
        cable_dot = scale(truth.cable_length, state.q_cable_dot)
        if truth.reel_rate != 0.0:
            cable_dot = axpy(truth.reel_rate, state.q_cable, cable_dot)
        separation, separation_dot = cable, cable_dot
        if is_off_centre(truth):
            R = rotation_from_quat(state.quat_wxyz)
            separation = add(cable, attachment_offset(R, truth))
            separation_dot = add(cable_dot, attachment_velocity(R, state.omega_body, truth))
    else:
        separation = sub(state.x_load, state.x_quad)
        separation_dot = sub(state.v_load, state.v_quad)
    motion = Motion(
        state.x_load,
        state.v_load,
        separation,
        separation_dot,
        state.quat_wxyz,
        state.omega_body,
        truth.cable_length,
        truth.reel_rate,
    )

    remaining, impacts, snap_speed = h, 0, 0.0
    while True:
        t = segment_length(motion, truth, remaining)
        low, high, low_excess, high_excess, side = 0.0, t, 0.0, 0.0, 0
        switched = False
        for trial in range(_MAX_SEARCH):
            end = runge_kutta_step(motion, rotors, truth, wind, taut, t)
            excess = _mode_excess(end.motion, end.tension, taut, truth)
            if trial == 0:
                low_excess, high_excess = _mode_excess(motion, end.tension_before, taut, truth), excess
                if taut <= 0.0 and impacts >= _MAX_IMPACTS:
                    break
                if low_excess > 0.0:
                    # the switch is overdue: the forces jumped, or the last step had used up its impacts
                    switched = taut > 0.0 or _closing_speed(motion, truth) > 0.0
                    break
                if not excess > 0.0:
                    break
                switched = True
            elif excess > 0.0:
                high, high_excess = t, excess
                low_excess *= 0.5 if side > 0 else 1.0
                side = 1
            else:
                low, low_excess = t, excess
                high_excess *= 0.5 if side < 0 else 1.0
                side = -1
            if high - low < _TIME_TOLERANCE or (trial > 0 and abs(excess) < _LENGTH_TOLERANCE):
                break
            t = (low * high_excess - high * low_excess) / (high_excess - low_excess)
        if switched and low_excess > 0.0:
            t = 0.0
        else:
            motion = end.motion
            copy_row(rotors, END, FORCE)
        remaining -= t
        if switched:
            if taut > 0.0:
                taut = 0.0
                slack_events += 1.0
            else:
                taut = 1.0
                impacts += 1
                snap_speed = max(snap_speed, _closing_speed(motion, truth))
                motion = at_cable_length(motion, truth)
        elif not remaining > 0.0:
            break
    if not is_valid(end.motion):
        copy_row(rotors, BEFORE, FORCE)
        return frozen_state(state)
    return state_of(end, state.q_cable, taut, slack_events, snap_speed, truth)


@kernel
def advance_many(
    state: PlantState, truth: Truth, rotors: RotorRows, wind: Vec3, h: float, n: int
) -> PlantState:
    """n steps of length h under the same commands and wind."""
    for _ in range(n):
        state = advance(state, truth, rotors, wind, h)
    return state


def initial_state(truth: Truth) -> PlantState:
    """Vehicle and load at rest on the ground, heading east, the load at home, the cable slack."""
    offset = 0.5 * truth.cable_length
    cable = sub((offset, 0.0, truth.load_radius - truth.gear_height), truth.attachment)
    length = norm(cable)
    return PlantState(
        x_load=(0.0, 0.0, truth.load_radius),
        v_load=ZERO,
        q_cable=scale(1.0 / length, cable),
        q_cable_dot=ZERO,
        x_quad=(-offset, 0.0, truth.gear_height),
        v_quad=ZERO,
        quat_wxyz=IDENTITY_QUAT,
        omega_body=ZERO,
        taut=0.0,
        slack_events=0.0,
        vehicle_on_ground=1.0,
        load_on_ground=1.0,
        accel_quad=ZERO,
        tension=0.0,
        diverged=0.0,
        snap_speed=0.0,
        omega_dot_body=ZERO,
    )
