"""The gripper that holds the cable at the vehicle: the plant when it opens and closes.

A released load moves like one on a cable of infinite length, which is slack and never becomes taut.
"""

from __future__ import annotations

from math import inf

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import norm, sub
from autopilot.geometry.packed import with_field
from autopilot.geometry.so3 import rotation_from_quat
from sitl.plant.attachment import attachment_position
from sitl.plant.records import PlantState, Truth


@kernel
def without_cable(truth: Truth) -> Truth:
    """The truth of a vehicle and a load that no cable connects."""
    return with_field(truth, "cable_length", inf)


@kernel
def with_cable_released(state: PlantState) -> PlantState:
    """The state at the instant at which the cable is released: positions and velocities are unchanged.

    `accel_quad` keeps the value of the instant before, as at every instant at which the forces jump.
    """
    return with_field(with_field(state, "taut", 0.0), "tension", 0.0)


@kernel
def can_grip(state: PlantState, truth: Truth) -> bool:
    """Whether a closing gripper takes hold of the cable: the load lies on the ground within its length."""
    attachment = attachment_position(state.x_quad, rotation_from_quat(state.quat_wxyz), truth)
    return state.load_on_ground > 0.0 and norm(sub(state.x_load, attachment)) <= truth.cable_length
