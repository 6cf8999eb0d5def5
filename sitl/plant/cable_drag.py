"""Drag of a straight cable across its length, in wind and wake.

Only the flow across the cable causes drag: -1/2 rho C_D D |u_n| u_n per metre, with u_n the component normal
to the cable of its velocity through the air (the cross-flow principle; Hoerner, Fluid-Dynamic Drag, 1965, 3-2
and 3-11: C_D = 1.2 for a round cylinder at Reynolds numbers of 300 to 3e5). A taut, massless cable passes the
force to its ends as a lever does: of the force at the share s of its length from the vehicle, the share s
acts on the load and 1 - s on the vehicle. The force is integrated by Gauss quadrature with three points. A
slack cable has no defined shape and no drag.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, axpy, dot, norm, scale, sub
from sitl.plant.records import Motion, Truth
from sitl.plant.rotors import RotorRows
from sitl.plant.wake import Wake, wake_at

DRAG_COEFFICIENT = 1.2
_NODES = (0.1127016653792583, 0.5, 0.8872983346207417)
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


class Ends(NamedTuple):
    """Force (N, world) on the two ends of the cable."""

    vehicle: Vec3
    load: Vec3


NO_DRAG = Ends(ZERO, ZERO)


@kernel
def drag_of_cable(
    motion: Motion,
    cable: Vec3,
    cable_dot: Vec3,
    wind: Vec3,
    wake: Wake,
    rotors: RotorRows,
    stage: int,
    truth: Truth,
) -> Ends:
    """Drag on the ends of the cable. `cable` is x_L - x_A, `cable_dot` its rate; the forces of the rotors,
    which cause the wake, are in row `stage`."""
    length = norm(cable)
    q = scale(1.0 / length, cable)
    factor = 0.5 * truth.air.density * DRAG_COEFFICIENT * truth.air.cable_diameter * length
    vehicle_force, load_force = ZERO, ZERO
    for k in range(3):
        share = _NODES[k]
        air = wind
        if truth.air.downwash > 0.0:
            air = add(wind, wake_at(axpy(share - 1.0, cable, motion.x_load), wake, rotors, stage, truth))
        u = sub(axpy(share - 1.0, cable_dot, motion.v_load), air)
        across = axpy(-dot(u, q), q, u)
        force = scale(-_WEIGHTS[k] * factor * norm(across), across)
        vehicle_force, load_force = axpy(1.0 - share, force, vehicle_force), axpy(share, force, load_force)
    return Ends(vehicle_force, load_force)
