"""From the command to the force of a rotor: thrust curve, resolution and voltage of its speed controller.

| symbol | code | unit | |
|---|---|---|---|
| F | force | N | requested, within the rotor's limits |
| F_max | greatest | N | force of the rotor at full throttle and full voltage |
| u | throttle | | 0 ... 1 |
| a | thrust_curve | | quadratic share of the force in the throttle |
| a_k | known_curve | | the same as assumed where forces are converted to throttle |
| n | esc_steps | | number of throttle values above zero |
| k | supply | | voltage, relative to that of a full battery without current |

    F / F_max = C(u; a_k),    C(u; a) = (1 - a) u + a u^2
    u' = rint(n u) / n
    F' = F_max C(u' k; a)           the speed falls with the voltage
    F' = F_max C(min(u', k); a)     the speed is controlled, as long as the voltage allows

C is the curve that flight controllers are configured with (THR_MDL_FAC of PX4, MOT_THST_EXPO of ArduPilot).
With a = a_k, n = 0 and k = 1 a rotor gives the requested force. The model applies only to rotors with a
greatest force.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.packed import Row
from autopilot.vehicle.battery import (
    Battery,
    charge_left,
    drawn_current,
    open_voltage,
    rotor_power_coefficient,
    rotor_power_term,
    source_voltage,
    terminal_voltage,
)
from sitl.plant.records import Drive, Truth

EXHAUSTED_SHARE = 0.02  # of the charge, below which the voltage of the cells falls to 0
_TINY = 1e-30  # avoids 0 / 0


@kernel
def is_driven(truth: Truth) -> bool:
    """Whether curve, resolution or battery may make the force of a rotor differ from its command."""
    drive = truth.drive
    different = drive.thrust_curve != drive.known_curve
    return truth.rotor_max < inf and (different or drive.esc_steps > 0.0 or drive.battery > 0.0)


@kernel
def thrust_share(throttle: float, curve: float) -> float:
    """C(u; a)."""
    return (1.0 - curve) * throttle + curve * throttle * throttle


@kernel
def throttle_of(share: float, curve: float) -> float:
    """The throttle u >= 0 with C(u; a) = share >= 0."""
    linear = 1.0 - curve
    return 2.0 * share / (linear + sqrt(linear * linear + 4.0 * curve * share) + _TINY)


@kernel
def driven_force(force: float, max_force: float, drive: Drive, supply: float) -> float:
    """F' of a rotor; a force below 0 is returned unchanged."""
    share = if_above(force, 0.0, force / max_force, 0.0)
    throttle = throttle_of(share, drive.known_curve)
    if drive.esc_steps > 0.0:
        throttle = np.rint(throttle * drive.esc_steps) / drive.esc_steps
    if drive.speed_controlled > 0.0:
        throttle = if_above(throttle, supply, supply, throttle)
    else:
        throttle = throttle * supply
    return if_above(force, 0.0, max_force * thrust_share(throttle, drive.thrust_curve), force)


class Supply(NamedTuple):
    """The state of the battery."""

    used_as: float  # A s
    current: float  # A
    voltage: float  # V at its terminals
    share: float  # voltage, relative to that of the full battery without current


FULL = Supply(0.0, 0.0, 0.0, 1.0)  # also used without a battery


def share_left(supply: Supply, drive: Drive) -> float:
    """Share of the charge that is left in the battery."""
    return max(0.0, drive.charge - supply.used_as / drive.capacity_as)


@kernel
def battery_of(truth: Truth, rotors: int) -> Battery:
    """The battery of a vehicle with this number of rotors."""
    drive = truth.drive
    scaled = rotor_power_coefficient(drive.hover_w, truth.quad_mass * truth.gravity, rotors)
    return Battery(drive.capacity_as, drive.cells, drive.resistance, scaled)


@kernel
def voltage_until_empty(used_as: float, battery: Battery) -> float:
    """Voltage in V without current, which falls to 0 with the last of the charge: no more can be drawn."""
    last = charge_left(used_as, battery) / EXHAUSTED_SHARE
    return source_voltage(used_as, battery) * if_above(1.0, last, last, 1.0)


@kernel
def discharged(supply: Supply, forces: Row, rotors: int, truth: Truth, h: float) -> Supply:
    """The battery h seconds later, when the rotors give these forces (N) at that instant."""
    battery = battery_of(truth, rotors)
    empty = truth.drive.capacity_as * (1.0 - truth.drive.charge)  # A s, used before the beginning
    used = supply.used_as + h * supply.current
    open_v = voltage_until_empty(empty + used, battery)
    current = drawn_current(rotor_power_term(forces, rotors), open_v, battery)
    voltage = terminal_voltage(open_v, current, battery)
    return Supply(used, current, voltage, voltage / (battery.cells * open_voltage(1.0)))
