"""The magnetic field of the motors' currents at the magnetometer.

| symbol | code | frame, unit | |
|---|---|---|---|
| F_i | rows[FORCE, i] | N | thrust of rotor i; F_h at hover |
| u_i | | body FLU | unit vector from the centre to rotor i |
| B | strength | gauss | the field at hover |

The power of a rotor is its thrust times the induced speed, so at a given voltage the current is proportional
to F^(3/2). The wires are fixed in the body, and so are the directions of their fields. The battery leads run
along the body and cause a field to its left, in which the currents of all rotors add up; the wire along an
arm causes a field across the arm:

    b = B / n sum_i (F_i / F_h)^(3/2) (e_left + u_i x e_up)

In a level hover the arms' fields cancel and B remains; they appear when the forces of opposite rotors differ.
"""

from __future__ import annotations

from math import sqrt

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3
from sitl.plant.records import Truth
from sitl.plant.rotors import FORCE, PITCH, ROLL, RotorRows
from sitl.sensors.vibration import hover_force


@kernel
def motor_field(rotors: RotorRows, truth: Truth, strength: float) -> Vec3:
    """The field of the currents, body FLU, gauss; `strength` is that at hover."""
    table = rotors.table
    count = table.shape[0]
    hover = hover_force(truth, count)
    forward = left = 0.0
    for i in range(count):
        share = abs(rotors.rows[FORCE, i]) / hover
        current = share * sqrt(share)
        x, y = -table[i, PITCH], table[i, ROLL]
        radius = sqrt(x * x + y * y)
        left += current
        if radius > 0.0:
            forward += current * y / radius
            left -= current * x / radius
    return (strength / count * forward, strength / count * left, 0.0)
