"""The law `thesis`: the cascade of the thesis with its command filters (3-27) ... (3-44), in its three
modes."""

from __future__ import annotations

from typing import NamedTuple

from autopilot.control import quad_position as position_law
from autopilot.control import thesis_cascade as cascade
from autopilot.control.actuators.disturbance_observer import DisturbanceEstimate
from autopilot.control.actuators.rotor_model import Actuation
from autopilot.control.laws.interface import Kernels, Law
from autopilot.control.records import Cable, Command, Reference, State, Vehicle, with_cable_length
from autopilot.control.thesis_cascade import ThesisMemory
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import ZERO, Mat3, Vec3, axpy
from autopilot.geometry.packed import Row, with_field
from autopilot.wire.parameter_table import ParameterTable


class ThesisLaw(NamedTuple):
    """Gains and filters, for one length of the cable."""

    gains: cascade.ThesisGains
    filters: cascade.ThesisFilters
    position_gains: position_law.QuadPositionGains
    vehicle: Vehicle


class ThesisRows(NamedTuple):
    """The law, packed."""

    constants: Row
    memory: Row


def _diagonal(value: float) -> Vec3:
    return (value, value, value)


def build(table: ParameterTable, vehicle: Vehicle) -> ThesisLaw:
    """Gains and filters from the NGC_ and QP_ parameters."""
    gains = cascade.ThesisGains(
        k_R=_diagonal(table["NGC_KR"]),
        k_Omega=_diagonal(table["NGC_KOMEGA"]),
        k_q=table["NGC_KQ"],
        k_omega=table["NGC_KW"],
        k_x=_diagonal(table["NGC_KX"]),
        k_v=_diagonal(table["NGC_KV"]),
        epsilon=table["NGC_EPSILON"],
    )
    filters = cascade.thesis_filters(
        1.0 / table["CTL_RATE_HZ"],
        table["NGC_WN_R"],
        table["NGC_WN_Q"],
        table["NGC_WN_X"],
        table["NGC_ZETA"],
    )
    k_x, k_v, k_z, k_w = (table[name] for name in ("QP_KX", "QP_KV", "QP_KZ", "QP_KVZ"))
    position_gains = position_law.QuadPositionGains(k_x=(k_x, k_x, k_z), k_v=(k_v, k_v, k_w))
    return ThesisLaw(gains, filters, position_gains, vehicle)


@kernel
def with_cable(law: ThesisLaw, cable: Cable) -> ThesisLaw:
    """The law for the present cable; gains scaled so that the cable's loop keeps its bandwidth."""
    length_ratio = cable.length / law.vehicle.cable_length
    gains = with_field(law.gains, "k_q", length_ratio * law.gains.k_q)
    gains = with_field(gains, "k_omega", length_ratio * law.gains.k_omega)
    return ThesisLaw(gains, law.filters, law.position_gains, with_cable_length(law.vehicle, cable.length))


@kernel
def start(law: ThesisLaw, state: State, x_d: Vec3, v_d: Vec3) -> ThesisMemory:
    """Memory of a law that begins now: the reference filter starts on its steady motion, which lags behind a
    moving reference; otherwise x_d'' would begin with -2 zeta omega_n v_d."""
    lag = law.filters.reference.ramp_lag
    return cascade.start(state, axpy(-lag, v_d, x_d), v_d)


@kernel
def load_position(
    law: ThesisLaw,
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """The load follows a reference; only its position is used."""
    adapted = with_cable(law, cable)
    return cascade.load_position(memory, state, reference, adapted.gains, adapted.filters, adapted.vehicle)


@kernel
def quad_position(
    law: ThesisLaw,
    memory: ThesisMemory,
    state: State,
    reference: Reference,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """The vehicle follows a reference, without a load."""
    adapted = with_cable(law, cable)
    return position_law.quad_position(
        memory,
        state,
        reference,
        0.0,
        ZERO,
        adapted.position_gains,
        adapted.gains,
        adapted.filters,
        adapted.vehicle,
    )


@kernel
def load_attitude(
    law: ThesisLaw,
    memory: ThesisMemory,
    state: State,
    q_d: Vec3,
    b1_d: Vec3,
    pull: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """The cable's direction follows q_d under a given pull (N)."""
    adapted = with_cable(law, cable)
    return cascade.load_attitude(
        memory, state, q_d, b1_d, pull, adapted.gains, adapted.filters, adapted.vehicle
    )


@kernel
def quad_attitude(
    law: ThesisLaw,
    memory: ThesisMemory,
    state: State,
    R_d: Mat3,
    thrust: float,
    actuation: Actuation,
    observed: DisturbanceEstimate,
    cable: Cable,
) -> tuple[ThesisMemory, Command]:
    """The vehicle's attitude follows R_d under a given thrust (N)."""
    adapted = with_cable(law, cable)
    return cascade.quad_attitude(memory, state, R_d, thrust, adapted.gains, adapted.filters, adapted.vehicle)


LAW = Law(
    name="thesis",
    number=0,
    constants=ThesisLaw,
    memory=ThesisMemory,
    rows=ThesisRows,
    build=build,
    kernels=Kernels(start, load_position, quad_position, load_attitude, quad_attitude),
    ramp_lag_s=lambda law: law.filters.reference.ramp_lag,
)
