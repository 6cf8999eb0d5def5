"""What keeps the vehicle and its load up in the two attitude modes, whose laws leave the height open (3-2-1).

| symbol   | code name      | frame | unit | equation                  |
|----------|----------------|-------|------|---------------------------|
| A . e_3  | vertical_force | I     | N    | (3-43), its vertical part |

The thesis gives these modes no height law ("suitable for short periods"); Plumbline lets them lift what
(3-43) would lift, so that an attitude can be held as long as there is room to fly sideways.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3

# cosine of 60 deg: further down the tilt is no longer made up for
_LEAST_COSINE = 0.5


@kernel
def vertical_force(height_error: float, climb_error: float, k_z: float, k_v: float, weight: float) -> float:
    """Upward force in N, at least a fifth of the weight so that the cable stays taut and the attitude
    controllable.

    Errors are actual minus desired, m and m/s; gains N/m and N s/m; weight is that of all that hangs, N.
    """
    return max(0.2 * weight, weight - k_z * height_error - k_v * climb_error)


@kernel
def cable_pull(force: float, q_cable: Vec3) -> float:
    """Pull along the cable, N, whose vertical part is `force`, tilts of up to 60 deg made up for."""
    return force / max(_LEAST_COSINE, -q_cable[2])


@kernel
def tilted_thrust(force: float, R: Mat3) -> float:
    """Thrust, N, whose vertical part is `force`, tilts of up to 60 deg made up for."""
    return force / max(_LEAST_COSINE, R[2][2])
