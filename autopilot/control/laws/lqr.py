"""The law `lqr`: the linear regulator of A-2, which has one mode, load position.

The other modes have no linear counterpart in the thesis. Take-off and set-down with a slack cable, and the
two attitude modes, are flown by the law `thesis` with its parameters. The gains are valid for one cable
length.
"""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control import lqr as lqr_regulator
from autopilot.control.actuators.disturbance_observer import DisturbanceEstimate
from autopilot.control.actuators.rotor_model import Actuation
from autopilot.control.laws import thesis
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.records import Cable, Command, Reference, State, Vehicle
from autopilot.control.thesis_cascade import ThesisMemory
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Mat3, Vec3
from autopilot.geometry.packed import Row
from autopilot.wire.parameter_table import ParameterTable


class LqrLaw(NamedTuple):
    """The regulator, and the law of the other modes."""

    regulator: lqr_regulator.Lqr
    other_modes: thesis.ThesisLaw


class LqrRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def build(table: ParameterTable, vehicle: Vehicle) -> LqrLaw:
    """Weights from the LQR_ parameters; the other modes from NGC_ and QP_."""
    weights = lqr_regulator.LqrWeights(
        position=table["LQR_Q_POS"],
        tilt=table["LQR_Q_TILT"],
        yaw=table["LQR_Q_YAW"],
        swing=table["LQR_Q_SWING"],
        rate=table["LQR_Q_RATE"],
        thrust=table["LQR_R_THRUST"],
        moment=table["LQR_R_MOMENT"],
    )
    return LqrLaw(lqr_regulator.lqr(vehicle, weights), thesis.build(table, vehicle))


@kernel
def start(law: LqrLaw, state: State, x_d: Vec3, v_d: Vec3) -> ThesisMemory:
    """Memory of the other modes; the regulator has none."""
    return thesis.start(law.other_modes, state, x_d, v_d)


@kernel
def load_position(
    law: LqrLaw,
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """The vehicle is steered to a point one cable length above the load's reference."""
    return memory, lqr_regulator.load_position(state, reference, law.regulator)


@kernel
def quad_position(
    law: LqrLaw,
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """As the law `thesis`."""
    return thesis.quad_position(law.other_modes, memory, state, reference, actuation, observed, cable)


@kernel
def load_attitude(
    law: LqrLaw,
    memory: ThesisMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """As the law `thesis`."""
    return thesis.load_attitude(law.other_modes, memory, state, q_d, b1_d, pull, actuation, observed, cable)


@kernel
def quad_attitude(
    law: LqrLaw,
    memory: ThesisMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """As the law `thesis`."""
    return thesis.quad_attitude(law.other_modes, memory, state, R_d, thrust, actuation, observed, cable)


LAW = Law(
    name="lqr",
    number=1,
    constants=LqrLaw,
    memory=ThesisMemory,
    rows=LqrRows,
    build=build,
    kernels=Kernels(start, load_position, quad_position, load_attitude, quad_attitude),
    ramp_lag_s=lambda law: law.regulator.ramp_lag,
    supports_reeling=False,
)
