"""The wake of the rotors, in which load and cable hang.

| symbol | code | unit | |
|---|---|---|---|
| F_i, R_r, rho | | N, m, kg/m^3 | thrust and radius of a rotor, density |
| v_h | | m/s | induced velocity in hover, sqrt(sum F / (2 rho n pi R_r^2)) |
| d | along | | direction of the wake |
| s, r | | m | distances of a point: from a rotor along d, and from the axis of its wake |
| beta | | m | width of the wake |

Each rotor makes a round jet that carries its thrust as momentum at every distance (the far wake of momentum
theory at its beginning, a self-similar turbulent jet at its end):

    beta^2 = 3/2 R_r^2 + (kappa s)^2
    u_i^2  = 3 F_i / (pi rho beta^2) / (1 + r^2 / beta^2)^4

    rho integral u_i^2 2 pi r dr = F_i     for every s
    u_i(0, 0) = 2 v_h of this rotor: twice that at the disc, as far below a rotor (Leishman 2006, 2.2)
    u_i(s, 0) -> 2 B sqrt(F_i / (pi rho)) / s,   kappa = sqrt(3) / (2 B)

The profile is that of a jet of constant eddy viscosity (Schlichting; Pope 2000, 5.2.4), with the measured
decay B = 5.8 (Hussein, Capp and George 1994; Pope, table 5.1). Its half-width is then 0.096 s; the measured
values are 0.094 to 0.102. Adjacent jets add their momentum: u^2 = sum u_i^2 (Reichardt 1942).

The wake flows along -v_h b3 minus the vehicle's velocity through the air, so a flying vehicle leaves it
behind. v_h is half of the speed on the axis, about the speed at which a jet as a whole moves. Not modelled:
the time that the air takes to reach a point, swirl and turbulence of the wake, the ground below it.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.lanes import if_above
from autopilot.geometry.linear import Mat3, Vec3, add, apply, axpy, dot, norm, scale, sub
from sitl.plant.air import hub_of
from sitl.plant.records import Truth
from sitl.plant.rotors import RotorRows

DECAY = 5.8  # B
_SPREAD = sqrt(3.0) / (2.0 * DECAY)  # kappa
_STILL = 1e-12  # m/s, added to a denominator to avoid 0 / 0


class Wake(NamedTuple):
    """The wake as a whole, world frame."""

    along: Vec3  # d
    x_quad: Vec3
    R: Mat3


@kernel
def wake_of(
    rotors: RotorRows, stage: int, x_quad: Vec3, v_quad: Vec3, R: Mat3, wind: Vec3, truth: Truth
) -> Wake:
    """Direction and origin of the wake; the forces of the rotors are in row `stage`."""
    total = 0.0
    count = rotors.table.shape[0]
    for i in range(count):
        total += rotors.rows[stage, i]
    lift = if_above(total, 0.0, total, 0.0)
    radius = truth.air.rotor_radius
    induced = sqrt(lift / (2.0 * truth.air.density * count * pi * radius * radius))
    flow = axpy(-induced, (R[0][2], R[1][2], R[2][2]), sub(wind, v_quad))
    return Wake(scale(1.0 / (norm(flow) + _STILL), flow), x_quad, R)


@kernel
def wake_at(point: Vec3, wake: Wake, rotors: RotorRows, stage: int, truth: Truth) -> Vec3:
    """Velocity (world, m/s) that the wake adds to the wind at a point."""
    air = truth.air
    speed_squared = 0.0
    for i in range(rotors.table.shape[0]):
        hub = add(wake.x_quad, apply(wake.R, hub_of(rotors, i, truth)))
        offset = sub(point, hub)
        s = dot(offset, wake.along)
        radial_squared = dot(offset, offset) - s * s
        width = 1.5 * air.rotor_radius * air.rotor_radius + _SPREAD * _SPREAD * s * s
        profile = 1.0 + radial_squared / width
        profile *= profile
        thrust = rotors.rows[stage, i]
        flow = 3.0 * thrust / (pi * air.density * width * profile * profile)
        # no wake above a rotor, and none of a rotor with reversed thrust
        speed_squared += if_above(s, 0.0, if_above(flow, 0.0, flow, 0.0), 0.0)
    return scale(air.downwash * sqrt(speed_squared), wake.along)
