"""What an action commands: numbers between -1 and 1 become thrust and moment of the rotors.

| action | numbers | what 0 and +-1 mean |
|---|---|---|
| rotors | force of each rotor | 0 hovers, 1 is the greatest force, -1 the least; linear in between |
| ctbr | thrust, body rates about x, y, z | thrust as above; rates in units of the greatest |
| acceleration | acceleration of the load, ENU | in units of the greatest; 0 keeps the load's velocity |

Rates are tracked by M = J k (Omega_d - Omega) + Omega x J Omega, an acceleration by the load attitude mode
of the law `thesis`: q_d = -A/|A| with A = a + g e3, with a pull of (m_Q + m_L) |A . q|.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.control.actuators.mixer import FORCE, MixerResult, mix, thrust_and_moment
from autopilot.control.records import State
from autopilot.control.thesis_cascade import ThesisMemory, load_attitude
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import E1, Vec3, add, cross, dot, norm, scale, sub, times
from autopilot.vehicle.rotors import STRENGTH
from plumbline.learning.records import ACCELERATION, RATES, ROTORS, ActionModel
from sitl.world import Floats

_MIN_PULL = 0.2  # of the weight, so that the cable stays taut
_MIN_ACCEL = 1e-3  # m/s^2; a shorter A has no direction


class Mixing(NamedTuple):
    """The mixer and the rotors that carry out an action."""

    table: Floats  # (rotors + 1, 8) of the mixer
    rotors: Floats  # memory of the mixer; forces (N) are in the row FORCE
    hover: Floats  # (MAX_ROTORS,) N: force of each rotor that holds vehicle and load


def action_size(kind: int, rotors: int) -> int:
    """How many numbers an action has."""
    return {ROTORS: rotors, RATES: 4, ACCELERATION: 3}[kind]


@kernel
def clipped(number: float) -> float:
    """A number of an action, clipped to -1 ... 1; NaN becomes -1."""
    return if_above(number, -1.0, min(number, 1.0), -1.0)


@kernel
def scaled(number: float, low: float, middle: float, high: float) -> float:
    """The value that -1 ... 1 commands: `low`, `middle` at 0, `high`, linear in between."""
    if number > 0.0:
        return middle + number * (high - middle)
    return middle + number * (middle - low)


@kernel
def unscaled(value: float, low: float, middle: float, high: float) -> float:
    """The number, -1 ... 1, that commands a value: the inverse of `scaled`."""
    if value > middle:
        return min((value - middle) / (high - middle), 1.0)
    return max((value - middle) / (middle - low), -1.0)


@kernel
def rate_moment(rates: Vec3, state: State, model: ActionModel) -> Vec3:
    """Moment (N m, body) that tracks body rates (rad/s)."""
    J, Omega = model.vehicle.inertia, state.omega_body
    turning = times(J, times(model.rate_gain, sub(rates, Omega)))
    return add(turning, cross(Omega, times(J, Omega)))


@kernel
def apply_action(
    action: Any, state: State, memory: ThesisMemory, model: ActionModel, mixing: Mixing
) -> tuple[ThesisMemory, MixerResult]:
    """Write the rotor forces for an action at this tick into `mixing.rotors`; the memory is that of the law
    that tracks an acceleration."""
    vehicle, table, rotors = model.vehicle, mixing.table, mixing.rotors
    if model.kind == ROTORS:
        for i in range(table.shape[0] - 1):
            low, high = table[i, STRENGTH] * model.min_force, table[i, STRENGTH] * model.max_force
            rotors[FORCE, i] = scaled(action[i], low, mixing.hover[i], high)
        thrust, moment = thrust_and_moment(rotors, vehicle, table)
        return memory, MixerResult(0, thrust, moment)
    if model.kind == RATES:
        low, high = model.strength * model.min_force, model.strength * model.max_force
        thrust = scaled(action[0], low, model.weight, high)
        moment = rate_moment(times(model.rates, (action[1], action[2], action[3])), state, model)
        return memory, mix(thrust, moment, vehicle, model.limited, table, rotors)
    A = times(model.accel, (action[0], action[1], action[2]))
    A = (A[0], A[1], A[2] + vehicle.gravity)
    size = norm(A)
    q_d = scale(-1.0 / size, A) if size > _MIN_ACCEL else state.q_cable
    mass = vehicle.quad_mass + vehicle.load_mass
    pull = mass * max(-dot(A, state.q_cable), _MIN_PULL * vehicle.gravity)
    memory, command = load_attitude(memory, state, q_d, E1, pull, model.gains, model.filters, vehicle)
    return memory, mix(command.thrust, command.moment, vehicle, model.limited, table, rotors)


@kernel
def write_equivalent_action(
    mixed: MixerResult, state: State, model: ActionModel, mixing: Mixing, out: Any
) -> None:
    """Write the action that is equivalent to the command of a law at this tick: rotor forces, or thrust and
    body rates."""
    if model.kind == ROTORS:
        table = mixing.table
        for i in range(table.shape[0] - 1):
            low, high = table[i, STRENGTH] * model.min_force, table[i, STRENGTH] * model.max_force
            out[i] = unscaled(mixing.rotors[FORCE, i], low, mixing.hover[i], high)
        return
    J, Omega = model.vehicle.inertia, state.omega_body
    turning = sub(mixed.achieved_moment, cross(Omega, times(J, Omega)))
    low, high = model.strength * model.min_force, model.strength * model.max_force
    out[0] = unscaled(mixed.achieved_thrust, low, model.weight, high)
    for i in range(3):
        commanded = Omega[i] + turning[i] / (J[i] * model.rate_gain[i])
        out[1 + i] = clipped(commanded / model.rates[i])
