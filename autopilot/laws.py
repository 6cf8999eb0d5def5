"""The control laws by name, each filled from the parameter table: one interface for all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from autopilot.control import lqr, plumbline, quad_position, thesis
from autopilot.control.command_filter import FilterConstants, filter_constants
from autopilot.control.load_motion import Drag
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.linear import ZERO, Mat3, Vec3, axpy
from autopilot.rotor_lag import LagConstants, Rotating, hasten, lag_constants
from autopilot.vehicle.parameters import LAWS
from autopilot.wire.parameters import ParameterTable

Memory = Any  # each law's own record; opaque to everyone else


class Law(Protocol):
    """A cascade in its flight modes (3-2) and the vehicle position law of the slack phases."""

    @property
    def ramp_lag_s(self) -> float:
        """How far the load keeps behind a reference that rises or sinks steadily, in time."""

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        """Memory of a law that begins now, without a jump of its command."""

    def quad_attitude(self, memory: Memory, state: State, R_d: Mat3, thrust: float) -> tuple[Memory, Command]:
        """The vehicle's attitude follows R_d under a given thrust (N)."""

    def load_attitude(
        self, memory: Memory, state: State, q_d: Vec3, b1_d: Vec3, pull: float
    ) -> tuple[Memory, Command]:
        """The cable's direction follows q_d under a given pull (N)."""

    def load_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        """The load follows a reference."""

    def quad_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        """The vehicle follows a reference, nothing hanging on it."""


def believed_vehicle(table: ParameterTable) -> Vehicle:
    """The vehicle as the parameters describe it."""
    return Vehicle(
        quad_mass=table["VEH_QUAD_MASS"],
        load_mass=table["VEH_LOAD_MASS"],
        cable_length=table["VEH_CABLE_LEN"],
        inertia=(table["VEH_J_XX"], table["VEH_J_YY"], table["VEH_J_ZZ"]),
        gravity=table["VEH_GRAVITY"],
        arm=table["VEH_ARM_LEN"],
        torque_ratio=table["VEH_TORQUE"],
        rotor_min=table["VEH_ROTOR_MIN"],
        rotor_max=table["VEH_ROTOR_MAX"],
    )


def _diagonal(value: float) -> Vec3:
    return (value, value, value)


class ThesisLaw(NamedTuple):
    """The cascade of the thesis with its command filters."""

    gains: thesis.ThesisGains
    filters: thesis.ThesisFilters
    position_gains: quad_position.QuadPositionGains
    vehicle: Vehicle

    @classmethod
    def build(cls, table: ParameterTable, vehicle: Vehicle) -> ThesisLaw:
        """Gains and filters from the NGC_ and QP_ parameters."""
        gains = thesis.ThesisGains(
            k_R=_diagonal(table["NGC_KR"]),
            k_Omega=_diagonal(table["NGC_KOMEGA"]),
            k_q=table["NGC_KQ"],
            k_omega=table["NGC_KW"],
            k_x=_diagonal(table["NGC_KX"]),
            k_v=_diagonal(table["NGC_KV"]),
            epsilon=table["NGC_EPSILON"],
        )
        filters = thesis.thesis_filters(
            1.0 / table["CTL_RATE_HZ"],
            table["NGC_WN_R"],
            table["NGC_WN_Q"],
            table["NGC_WN_X"],
            table["NGC_ZETA"],
        )
        k_x, k_v, k_z, k_w = (table[name] for name in ("QP_KX", "QP_KV", "QP_KZ", "QP_KVZ"))
        position_gains = quad_position.QuadPositionGains(k_x=(k_x, k_x, k_z), k_v=(k_v, k_v, k_w))
        return cls(gains, filters, position_gains, vehicle)

    @property
    def ramp_lag_s(self) -> float:
        return self.filters.reference.ramp_lag

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        # on the steady motion of the reference filter, which lags behind what moves; else x_d'' would begin
        # with -2 zeta omega_n v_d
        lag = self.filters.reference.ramp_lag
        return thesis.start(state, axpy(-lag, v_d, x_d), v_d)

    def quad_attitude(self, memory: Memory, state: State, R_d: Mat3, thrust: float) -> tuple[Memory, Command]:
        return thesis.quad_attitude(memory, state, R_d, thrust, self.gains, self.filters, self.vehicle)

    def load_attitude(
        self, memory: Memory, state: State, q_d: Vec3, b1_d: Vec3, pull: float
    ) -> tuple[Memory, Command]:
        return thesis.load_attitude(memory, state, q_d, b1_d, pull, self.gains, self.filters, self.vehicle)

    def load_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        return thesis.load_position(memory, state, reference, self.gains, self.filters, self.vehicle)

    def quad_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        return quad_position.quad_position(
            memory, state, reference, 0.0, self.position_gains, self.gains, self.filters, self.vehicle
        )


class LqrLaw(NamedTuple):
    """The linear regulator of A-2, which knows one mode: load position.

    The other modes have no linear counterpart in the thesis. Take-off and set-down with a slack cable, and
    the two attitude modes, are flown by the loops of the thesis's cascade with its parameters.
    """

    regulator: lqr.Lqr
    other_modes: ThesisLaw

    @classmethod
    def build(cls, table: ParameterTable, vehicle: Vehicle) -> LqrLaw:
        """Weights from the LQR_ parameters, the other modes from NGC_ and QP_."""
        weights = lqr.LqrWeights(
            position=table["LQR_Q_POS"],
            tilt=table["LQR_Q_TILT"],
            yaw=table["LQR_Q_YAW"],
            swing=table["LQR_Q_SWING"],
            rate=table["LQR_Q_RATE"],
            thrust=table["LQR_R_THRUST"],
            moment=table["LQR_R_MOMENT"],
        )
        return cls(lqr.lqr(vehicle, weights), ThesisLaw.build(table, vehicle))

    @property
    def ramp_lag_s(self) -> float:
        return self.regulator.ramp_lag

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        return self.other_modes.start(state, x_d, v_d)

    def quad_attitude(self, memory: Memory, state: State, R_d: Mat3, thrust: float) -> tuple[Memory, Command]:
        return self.other_modes.quad_attitude(memory, state, R_d, thrust)

    def load_attitude(
        self, memory: Memory, state: State, q_d: Vec3, b1_d: Vec3, pull: float
    ) -> tuple[Memory, Command]:
        return self.other_modes.load_attitude(memory, state, q_d, b1_d, pull)

    def load_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        return memory, lqr.load_position(state, reference, self.regulator)

    def quad_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        return self.other_modes.quad_position(memory, state, reference)


class PlumblineMemory(NamedTuple):
    """What the law remembers: of load position, of the other modes, and of the rotors."""

    position: plumbline.PlumblineMemory
    other_modes: Memory
    rotors: Rotating


class PlumblineLaw(NamedTuple):
    """Load position with exact derivatives and rotors hastened by their believed lag.

    The other modes, which are flown for moments only, are the loops of the thesis's cascade with its
    parameters.
    """

    gains: plumbline.PlumblineGains
    force_filter: FilterConstants
    drag: Drag
    lag: LagConstants
    limited: float
    vehicle: Vehicle
    other_modes: ThesisLaw

    @classmethod
    def build(cls, table: ParameterTable, vehicle: Vehicle) -> PlumblineLaw:
        """Gains, filter, drag and lag from the PLB_ parameters, the other modes from NGC_ and QP_."""
        gains = plumbline.PlumblineGains(
            k_R=_diagonal(table["PLB_KR"]),
            k_Omega=_diagonal(table["PLB_KOMEGA"]),
            k_q=table["PLB_KQ"],
            k_omega=table["PLB_KW"],
            k_x=_diagonal(table["PLB_KX"]),
            k_v=_diagonal(table["PLB_KV"]),
        )
        period = 1.0 / table["CTL_RATE_HZ"]
        force_filter = filter_constants(table["PLB_WN_F"], plumbline.ZETA, period)
        drag = Drag(table["PLB_DRAG"], table["PLB_DRAG_2"])
        lag = lag_constants(1e-3 * table["PLB_LAG_MS"], 1e-3 * table["PLB_LAG_TO_MS"], period)
        other_modes = ThesisLaw.build(table, vehicle)
        return cls(gains, force_filter, drag, lag, table["VEH_ROTOR_LIM"], vehicle, other_modes)

    @property
    def ramp_lag_s(self) -> float:
        # the reference's velocity is fed forward: nothing is left behind on a ramp
        return 0.0

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        hover = (self.vehicle.quad_mass + self.vehicle.load_mass) * self.vehicle.gravity
        return PlumblineMemory(
            plumbline.start(), self.other_modes.start(state, x_d, v_d), Rotating(hover, ZERO)
        )

    def quad_attitude(self, memory: Memory, state: State, R_d: Mat3, thrust: float) -> tuple[Memory, Command]:
        other, command = self.other_modes.quad_attitude(memory.other_modes, state, R_d, thrust)
        return memory._replace(other_modes=other), command

    def load_attitude(
        self, memory: Memory, state: State, q_d: Vec3, b1_d: Vec3, pull: float
    ) -> tuple[Memory, Command]:
        other, command = self.other_modes.load_attitude(memory.other_modes, state, q_d, b1_d, pull)
        return memory._replace(other_modes=other), command

    def load_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        position, wanted = plumbline.load_position(
            memory.position,
            state,
            reference,
            memory.rotors.thrust,
            self.gains,
            self.force_filter,
            self.drag,
            self.vehicle,
        )
        rotors, thrust, moment = hasten(
            memory.rotors, wanted.thrust, wanted.moment, self.lag, self.vehicle, self.limited
        )
        command = wanted._replace(thrust=thrust, moment=moment)
        return PlumblineMemory(position, memory.other_modes, rotors), command

    def quad_position(self, memory: Memory, state: State, reference: Reference) -> tuple[Memory, Command]:
        other, command = self.other_modes.quad_position(memory.other_modes, state, reference)
        return memory._replace(other_modes=other), command


_BUILDERS: dict[str, Callable[[ParameterTable, Vehicle], Law]] = {
    "thesis": ThesisLaw.build,
    "lqr": LqrLaw.build,
    "plumbline": PlumblineLaw.build,
}


def build_law(table: ParameterTable) -> Law:
    """The law that CTL_LAW selects."""
    return _BUILDERS[LAWS[int(table["CTL_LAW"])]](table, believed_vehicle(table))
