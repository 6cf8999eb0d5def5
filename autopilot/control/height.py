"""The lift of vehicle and load in the two attitude modes, whose laws do not control the height (3-2-1).

| symbol   | code name      | frame | unit | equation                  |
|----------|----------------|-------|------|---------------------------|
| A . e_3  | vertical_force | I     | N    | (3-43), its vertical part |

The thesis gives these modes no height law ("suitable for short periods"). Plumbline adds the vertical part of
(3-43), so that an attitude can be held as long as there is room to fly sideways.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3

# cosine of 60 deg: a greater tilt is not fully compensated
_MIN_COSINE = 0.5


@kernel
def vertical_force(height_error: float, climb_error: float, k_z: float, k_v: float, weight: float) -> float:
    """Upward force in N, at least a fifth of the weight so that the cable stays taut and the attitude
    controllable.

    Errors are actual minus desired, m and m/s; gains N/m and N s/m; weight is that of everything lifted, N.
    """
    return max(0.2 * weight, weight - k_z * height_error - k_v * climb_error)


@kernel
def cable_pull(force: float, q_cable: Vec3) -> float:
    """Pull along the cable, N, whose vertical part is `force` for tilts of up to 60 deg."""
    return force / max(_MIN_COSINE, -q_cable[2])


@kernel
def tilted_thrust(force: float, R: Mat3) -> float:
    """Thrust, N, whose vertical part is `force` for tilts of up to 60 deg."""
    return force / max(_MIN_COSINE, R[2][2])
