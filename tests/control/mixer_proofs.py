"""Proofs of the mixer, as those of `tests.control.proofs`: by (2-13) and by linear programmes."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.optimize import linprog

from autopilot.control.records import Vehicle
from autopilot.vehicle.layout import Layout, Rotor
from autopilot.vehicle.rotors import mixer_table
from tests.control.closeness import EXACT, close
from tests.doubles.mixing import mix

SLACK = 1e-9  # what a linear programme may lose of an earlier optimum; its own feasibility is 1e-7
PROGRAMME = 2e-6  # forces found by the linear programmes

# thrust (N) and moments (N m) that four rotors of Table 4-1 cannot give
SATURATING = (
    (4.9, 0.30, 0.0, 0.0),
    (4.9, -0.30, 0.40, 0.0),
    (4.9, 0.10, -0.30, 0.01),
    (4.9, 0.20, 0.15, -0.05),
    (7.8, 0.10, 0.05, 0.0),
    (7.8, -0.02, -0.10, 0.02),
    (0.3, 0.05, -0.10, 0.01),
    (-2.0, 0.10, 0.02, -0.02),
    (20.0, -0.05, 0.15, 0.05),
    (5.0, 0.0, 0.0, 0.09),
    (3.0, 0.0, 0.0, -0.09),
    (2.0, 0.02, 0.09, 0.05),
)

# demands of less thrust than the weight, with moments for which rotors of up to 4 N would have to give more
LIFTING = ((1.0, 0.6, 0.1, 0.0), (-2.0, 0.3, -0.5, 0.02), (5.4, 0.1, -0.9, 0.05))
STRONG_MAX_N = 4.0

# rotors that differ from each other, in positions without symmetry
UNEVEN: Layout = (
    Rotor(-1.0, 0.1, -1.0, 1.0),
    Rotor(-0.3, -0.9, 1.1, 1.1),
    Rotor(0.9, -0.5, -0.8, 0.9),
    Rotor(0.7, 0.7, 0.9, 1.2),
    Rotor(-0.4, 0.9, -1.2, 0.8),
)

# a demand of which these rotors can give all but the moments about the horizontal axes
ROOM_FOR_YAW = (3.87, 0.15, -0.27, -0.007)
MOST_ROTORS = UNEVEN[:4] + UNEVEN * 2


def forces_make_the_demand(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """The mixer inverts (2-13), checked with the matrix as printed, with limits out of reach and without
    limits."""
    arm, c = vehicle.arm, vehicle.torque_ratio
    matrix = np.array([[1, 1, 1, 1], [0, -arm, 0, arm], [arm, 0, -arm, 0], [-c, c, -c, c]])
    for limited, thrust, moment in ((1.0, 4.0, (0.01, -0.02, 0.003)), (0.0, 9.0, (-0.4, 0.3, 0.05))):
        result = mix(thrust, moment, vehicle, limited, room=laws)
        close(matrix @ np.array(result.forces), (thrust, *moment), EXACT)
        close((result.achieved_thrust, *result.achieved_moment), (thrust, *moment), EXACT)
        assert result.saturated == 0


@cache
def best_forces(vehicle: Vehicle, demand: tuple[float, ...]) -> tuple[float, ...]:
    """Thrust and moment nearest to the demand, roll and pitch first, then thrust, then yaw: linear programmes
    one after the other, each with the optimum of those before it as a constraint. Forces and errors in
    newtons: the moments of roll and pitch are divided by l, that of yaw by c."""
    arm, c = vehicle.arm, vehicle.torque_ratio
    rows = np.array([[0, -1, 0, 1], [1, 0, -1, 0], [1, 1, 1, 1], [-1, 1, -1, 1]])
    wanted = np.array([demand[1] / arm, demand[2] / arm, demand[0], demand[3] / c])
    bounds = [(vehicle.rotor_min, vehicle.rotor_max)] * 4
    A_ub, b_ub = np.zeros((0, 8)), np.zeros(0)
    # |rows F - wanted| <= e, with e the variables 4 to 7
    for i in range(4):
        for sign in (1.0, -1.0):
            A_ub = np.vstack([A_ub, np.concatenate([sign * rows[i], -np.eye(4)[i]])])
            b_ub = np.append(b_ub, sign * wanted[i])
    for costs in ((4, 5), (6,), (7,)):
        cost = np.zeros(8)
        cost[list(costs)] = 1.0
        solved = linprog(cost, A_ub, b_ub, bounds=bounds + [(0.0, None)] * 4)
        assert solved.status == 0, solved.message
        A_ub, b_ub = np.vstack([A_ub, cost]), np.append(b_ub, solved.fun + SLACK)
    done = rows @ solved.x[:4]
    return (done[2], done[0] * arm, done[1] * arm, done[3] * c)


def cuts_by_priority(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """For demands beyond the limits, the mixer does what the linear programmes find, and the bits name the
    saturated rotors."""
    arm, c = vehicle.arm, vehicle.torque_ratio
    inverse = np.linalg.inv(np.array([[1, 1, 1, 1], [0, -arm, 0, arm], [arm, 0, -arm, 0], [-c, c, -c, c]]))
    for limits in ((0.0, 1.96), (0.1, 1.5)):
        limited = vehicle._replace(rotor_min=limits[0], rotor_max=limits[1])
        for demand in SATURATING:
            result = mix(demand[0], demand[1:], limited, 1.0, room=laws)
            plain = inverse @ np.array(demand)
            bits = sum(1 << i for i in range(4) if not limits[0] <= plain[i] <= limits[1])
            assert result.saturated == bits != 0
            assert all(limits[0] <= F <= limits[1] for F in result.forces)
            close((result.achieved_thrust, *result.achieved_moment), best_forces(limited, demand), PROGRAMME)


@cache
def best_efforts(vehicle: Vehicle, layout: Layout, demand: tuple[float, ...]) -> tuple[float, ...]:
    """Efforts along the columns of the mixer (computed here independently) that keep its priorities: linear
    programmes find how far each column can be followed. In N for a rotor of strength 1."""
    does = np.array([(1.0, r.y, -r.x, r.yaw) for r in layout]).T * [r.strength for r in layout]
    columns = np.linalg.pinv(does[:3])
    unseen = does[3] - does[3] @ columns @ does[:3]
    yaw_column = unseen / (does[3] @ unseen)
    lift = columns[:, 0]

    def ends(begin: Any, along: Any, beside: Any) -> tuple[float, float]:
        """Least and greatest s with begin + s along + m beside within the limits for some m."""
        A = np.column_stack([along] if beside is None else [along, beside])
        A_ub = np.vstack([A, -A])
        b_ub = np.concatenate([vehicle.rotor_max - begin, begin - vehicle.rotor_min])
        found = []
        for sign in (1.0, -1.0):
            cost = np.zeros(A.shape[1])
            cost[0] = sign
            solved = linprog(cost, A_ub, b_ub, bounds=[(None, None)] * A.shape[1])
            assert solved.status == 0, solved.message
            found.append(float(solved.x[0]))
        return found[0], found[1]

    def share(begin: Any, along: Any, beside: Any) -> float:
        return float(np.clip(ends(begin, along, beside)[1], 0.0, 1.0)) if np.any(along) else 1.0

    def possible(sideways: Any, begin: Any, beside: Any) -> Any:
        both = share(begin, sideways.sum(axis=1), beside)
        parts = both * sideways
        for i in (0, 1):
            rest = (1.0 - both) * sideways[:, i]
            parts[:, i] += share(begin + parts.sum(axis=1), rest, beside) * rest
        return parts

    sideways = columns[:, 1:] * (demand[1] / vehicle.arm, demand[2] / vehicle.arm)
    parts = possible(sideways, np.zeros(len(layout)), lift)
    ceiling = max(demand[0], (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity)
    if ends(parts.sum(axis=1), lift, yaw_column)[0] > ceiling:
        parts = possible(parts, ceiling * lift, yaw_column)
    level = parts.sum(axis=1)
    efforts = level + np.clip(demand[0], *ends(level, lift, yaw_column)) * lift
    wanted = demand[3] / vehicle.torque_ratio - does[3] @ efforts
    efforts = efforts + np.clip(wanted, *ends(efforts, yaw_column, None)) * yaw_column
    return tuple(efforts.tolist())


def any_rotors_by_priority(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """For rotors that differ from each other, the forces are those that the linear programmes find, within
    limits and beyond them; thrust and moments are the sum of (2-13); the bits name the rotors of which too
    much is demanded."""
    arm, c = vehicle.arm, vehicle.torque_ratio
    strengths = np.array([rotor.strength for rotor in UNEVEN])
    does = np.array([(1.0, arm * r.y, -arm * r.x, c * r.yaw) for r in UNEVEN]).T
    inverse = np.linalg.pinv(does * strengths)
    strong = vehicle._replace(rotor_min=0.1, rotor_max=STRONG_MAX_N)
    limits = vehicle._replace(rotor_min=0.1, rotor_max=1.5)
    demands = [(limits, demand) for demand in ((4.9, 0.01, -0.02, 0.003), ROOM_FOR_YAW, *SATURATING)]
    for limits, demand in demands + [(strong, demand) for demand in LIFTING]:
        result = mix(demand[0], demand[1:], limits, 1.0, UNEVEN, room=laws)
        plain = inverse @ np.array(demand)
        beyond = [not limits.rotor_min <= u <= limits.rotor_max for u in plain]
        assert result.saturated == sum(1 << i for i, over in enumerate(beyond) if over)
        close(result.forces, strengths * best_efforts(limits, UNEVEN, demand), PROGRAMME)
        close((result.achieved_thrust, *result.achieved_moment), does @ np.array(result.forces), EXACT)


def what_is_no_number_is_zero(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """A demand that is not a number gives no thrust and no moment, or as near to that as the limits allow,
    and sets the bit of every rotor."""
    limits = vehicle._replace(rotor_min=0.1)
    for layout in (UNEVEN, MOST_ROTORS):
        for demand in ((np.nan, 0.0, 0.0, 0.0), (1.0, 0.0, np.inf, 0.0)):
            result = mix(demand[0], demand[1:], limits, 1.0, layout, room=laws)
            assert result.saturated == 2 ** len(layout) - 1
            nothing = mix(0.0, (0.0, 0.0, 0.0), limits, 1.0, layout, room=laws)
            assert result[0] == nothing[0] and result[2:] == nothing[2:]
            assert min(result.forces) > 0.0


def the_same_of_each_that_is_left(laws: SimpleNamespace, model: SimpleNamespace, vehicle: Vehicle) -> None:
    """Idling rotors all give the same force, except those that are lost; the thrust is their sum."""
    for layout, lost in ((UNEVEN, 0b100), (MOST_ROTORS, 0)):
        rotors = laws.new_rotors()
        result = laws.equal_forces(0.05, mixer_table(layout, lost), rotors)
        expected = [0.0 if lost >> i & 1 else 0.05 for i in range(len(layout))]
        close(rotors[laws.FORCE, : len(layout)], expected, EXACT)
        close((result.achieved_thrust, *result.achieved_moment), (sum(expected), 0.0, 0.0, 0.0), EXACT)
        assert result.saturated == 0


MIXER_PROOFS: tuple[Any, ...] = (
    forces_make_the_demand,
    cuts_by_priority,
    any_rotors_by_priority,
    what_is_no_number_is_zero,
    the_same_of_each_that_is_left,
)
