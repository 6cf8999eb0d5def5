"""The records of a cable of links, and the flat memory that holds it and the rotating load.

Point 0 is where the cable is attached to the vehicle, point n where it is attached to the load; the points
between are separate masses. World ENU, m and m/s; load body FLU with its origin at the centre of mass.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Vec3, add, apply, axpy, cross, sub
from autopilot.geometry.packed import Row, packed, unpack, with_field
from autopilot.geometry.so3 import IDENTITY_QUAT, Quat, quat_normalise, rotation_from_quat
from sitl.plant.attachment import attachment_position, attachment_velocity
from sitl.plant.records import ChainModel, PlantState, Truth

Floats = NDArray[np.float64]

# columns of `ChainRows.link`, one row per link: after its direction, its tension (N), whether it pulls, and
# the stretch (m) at which a stage begins; diagonal, next element and right-hand side of the equations for the
# tensions; diagonal and right-hand side after the elimination
TENSION, PULLS, STRETCH_BASE, DIAGONAL, OFF_DIAGONAL, RHS, PIVOT, REDUCED_RHS = range(3, 11)
_COLUMNS = 11
_MIN_LENGTH = 0.02  # m, least length of a cable that a winch reels in


class LoadBody(NamedTuple):
    """Attitude and rotation of the load."""

    quat: Quat  # body to world
    omega: Vec3  # rad/s, body


class ChainRows(NamedTuple):
    """The memory of the cable and of the load's rotation, written in place."""

    body: Row  # LoadBody
    held: Row  # (2,) 1.0 while the vehicle holds the cable; the length (m) of the cable itself
    x: Floats  # (n + 1, 3) points
    v: Floats  # (n + 1, 3)
    x_begin: Floats  # at the beginning of a step
    v_begin: Floats
    x_base: Floats  # at which an implicit stage begins
    v_base: Floats
    free: Floats  # (n + 1, 3) m/s^2, without the tensions
    link: Floats  # (n, 11)


@kernel
def vector(points: Floats, i: int) -> Vec3:
    """The first three numbers of a row."""
    return (points[i, 0], points[i, 1], points[i, 2])


@kernel
def put(points: Floats, i: int, value: Vec3) -> None:
    """Write the first three numbers of a row."""
    points[i, 0], points[i, 1], points[i, 2] = value


@kernel
def copy(source: Floats, target: Floats) -> None:
    """Copy all points."""
    for i in range(source.shape[0]):
        put(target, i, vector(source, i))


@kernel
def hook_of(model: ChainModel) -> Vec3:
    """Attachment point of the cable at the load, load body."""
    return (0.0, 0.0, model.hook if model.gyration > 0.0 else 0.0)


@kernel
def length_of(truth: Truth) -> float:
    """Length of the cable itself, m; `cable_length` is the length from the vehicle to the load's centre."""
    return max(truth.cable_length - hook_of(truth.chain)[2], _MIN_LENGTH)


@kernel
def with_gripping_reach(truth: Truth) -> Truth:
    """The truth with `cable_length` short enough that no attitude of the load would stretch the cable."""
    shorter = 2.0 * hook_of(truth.chain)[2]
    return with_field(truth, "cable_length", truth.cable_length - shorter)


@kernel
def end_at_load(x_load: Vec3, v_load: Vec3, body: LoadBody, hook: Vec3) -> tuple[Vec3, Vec3]:
    """Position and velocity of the cable's end at the load."""
    R = rotation_from_quat(quat_normalise(body.quat))
    return add(x_load, apply(R, hook)), add(v_load, apply(R, cross(body.omega, hook)))


@kernel
def lay_straight(rows: ChainRows, truth: Truth, state: PlantState) -> None:
    """Lay the cable straight from vehicle to load; its velocity is interpolated between its ends."""
    body = unpack(LoadBody, rows.body, 0)
    x_end, v_end = end_at_load(state.x_load, state.v_load, body, hook_of(truth.chain))
    R = rotation_from_quat(state.quat_wxyz)
    x_begin = attachment_position(state.x_quad, R, truth)
    v_begin = add(state.v_quad, attachment_velocity(R, state.omega_body, truth))
    n = rows.link.shape[0]
    for i in range(n + 1):
        put(rows.x, i, axpy(i / n, sub(x_end, x_begin), x_begin))
        put(rows.v, i, axpy(i / n, sub(v_end, v_begin), v_begin))
    rows.link[:, TENSION] = 0.0
    rows.link[:, PULLS] = 0.0
    rows.held[0] = 1.0


def new_chain(truth: Truth, state: PlantState) -> ChainRows | None:
    """The cable laid straight, the load upright and at rest; None if there is no cable of links."""
    n = truth.chain.links
    if n == 0:
        return None
    body = packed(LoadBody(IDENTITY_QUAT, ZERO))
    x, v, x_begin, v_begin, x_base, v_base, free = np.zeros((7, n + 1, 3))
    points = (x, v, x_begin, v_begin, x_base, v_base, free)
    rows = ChainRows(body, np.zeros(2), *points, np.zeros((n, _COLUMNS)))
    rows.held[1] = length_of(truth)
    lay_straight(rows, truth, state)
    return rows
