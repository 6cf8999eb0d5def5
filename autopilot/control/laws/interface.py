"""The control laws by name, each filled from the parameter table: one interface for all."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from autopilot.control import quad_position
from autopilot.control.actuators.disturbance_observer import Observed, ObserverConstants, observer_constants
from autopilot.control.actuators.lag_compensation import lag_gain
from autopilot.control.actuators.rotor_model import Actuation, ActuationConstants, actuation_constants
from autopilot.control.design import Design, Timing, Wanted, design
from autopilot.control.laws import lqr, plumbline, thesis
from autopilot.control.laws.plumbline_tick import (
    PlumblineConstants,
    SlackConstants,
    ahead_of,
    hastened,
    load_position_tick,
    quad_position_tick,
)
from autopilot.control.load_motion import Drag
from autopilot.control.records import Command, Reference, State, Vehicle
from autopilot.geometry.linear import ZERO, Mat3, Vec3, axpy
from autopilot.vehicle.parameters import LAWS
from autopilot.wire.parameter_table import ParameterTable

GREATEST_PUSH = 0.3  # of the weight: more wind than that is not believed
Memory = Any  # each law's own record; opaque to everyone else


class Law(Protocol):
    """A cascade in its flight modes (3-2) and the vehicle position law of the slack phases.

    `actuation` and `observed` are what is believed of rotors and disturbances at this tick.
    """

    @property
    def preview_s(self) -> float:
        """How much later than now the law wants to know its reference."""

    @property
    def ramp_lag_s(self) -> float:
        """How far the load keeps behind a reference that rises or sinks steadily, in time."""

    def with_cable(self, length: float) -> Law:
        """The law for another length (m) of the cable: the loops about it as fast as they were."""

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        """Memory of a law that begins now, without a jump of its command."""

    def quad_attitude(
        self, memory: Memory, state: State, R_d: Mat3, thrust: float, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        """The vehicle's attitude follows R_d under a given thrust (N)."""

    def load_attitude(
        self,
        memory: Memory,
        state: State,
        q_d: Vec3,
        b1_d: Vec3,
        pull: float,
        actuation: Actuation,
        observed: Observed,
    ) -> tuple[Memory, Command]:
        """The cable's direction follows q_d under a given pull (N)."""

    def load_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        """The load follows a reference."""

    def quad_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
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


def believed_drag(table: ParameterTable) -> Drag:
    """Drag of the vehicle as the parameters describe it."""
    return Drag(table["PLB_DRAG"], table["PLB_DRAG_2"])


def believed_actuation(table: ParameterTable) -> ActuationConstants:
    """Delay and lag of the rotors as the parameters describe them."""
    period = 1.0 / table["CTL_RATE_HZ"]
    return actuation_constants(believed_delay(table), 1e-3 * table["VEH_ROTOR_TAU"], period)


def believed_delay(table: ParameterTable) -> float:
    """From the instant that an estimate is of to the one at which the command for it is in force, s."""
    return 1e-3 * (table["VEH_ACT_DELAY"] + table["VEH_IMU_DELAY"])


def believed_design(table: ParameterTable, vehicle: Vehicle) -> Design:
    """The gains of `plumbline` for the vehicle that the parameters describe."""
    lag, shown = 1e-3 * table["VEH_ROTOR_TAU"], 1e-3 * table["PLB_LAG_TO_MS"]
    return design(
        Wanted(
            tolerance=1e-3 * table["PLB_DELAY_TOL"],
            integral_ratio=table["PLB_RATIO_I"],
            cable_ratio=table["PLB_RATIO_Q"],
            attitude_ratio=table["PLB_RATIO_R"],
            zeta=table["PLB_ZETA"],
            noise=table["PLB_NOISE"],
        ),
        Timing(believed_delay(table), lag, min(lag, shown), 1.0 / table["CTL_RATE_HZ"]),
        vehicle,
    )


def believed_observer(table: ParameterTable, vehicle: Vehicle) -> ObserverConstants:
    """How fast disturbances are learned."""
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    return observer_constants(
        table["PLB_T_MASS"], table["PLB_T_PUSH"], GREATEST_PUSH * weight, 1.0 / table["CTL_RATE_HZ"]
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

    def with_cable(self, length: float) -> ThesisLaw:
        longer = length / self.vehicle.cable_length
        gains = self.gains._replace(k_q=longer * self.gains.k_q, k_omega=longer * self.gains.k_omega)
        return self._replace(gains=gains, vehicle=self.vehicle._replace(cable_length=length))

    @property
    def ramp_lag_s(self) -> float:
        return self.filters.reference.ramp_lag

    @property
    def preview_s(self) -> float:
        return 0.0

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        # on the steady motion of the reference filter, which lags behind what moves; else x_d'' would begin
        # with -2 zeta omega_n v_d
        lag = self.filters.reference.ramp_lag
        return thesis.start(state, axpy(-lag, v_d, x_d), v_d)

    def quad_attitude(
        self, memory: Memory, state: State, R_d: Mat3, thrust: float, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return thesis.quad_attitude(memory, state, R_d, thrust, self.gains, self.filters, self.vehicle)

    def load_attitude(
        self,
        memory: Memory,
        state: State,
        q_d: Vec3,
        b1_d: Vec3,
        pull: float,
        actuation: Actuation,
        observed: Observed,
    ) -> tuple[Memory, Command]:
        return thesis.load_attitude(memory, state, q_d, b1_d, pull, self.gains, self.filters, self.vehicle)

    def load_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return thesis.load_position(memory, state, reference, self.gains, self.filters, self.vehicle)

    def quad_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return quad_position.quad_position(
            memory, state, reference, 0.0, ZERO, self.position_gains, self.gains, self.filters, self.vehicle
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

    def with_cable(self, length: float) -> LqrLaw:
        # its gains are those of one length: the supervisor keeps the winch still
        return self

    @property
    def ramp_lag_s(self) -> float:
        return self.regulator.ramp_lag

    @property
    def preview_s(self) -> float:
        return 0.0

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        return self.other_modes.start(state, x_d, v_d)

    def quad_attitude(
        self, memory: Memory, state: State, R_d: Mat3, thrust: float, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return self.other_modes.quad_attitude(memory, state, R_d, thrust, actuation, observed)

    def load_attitude(
        self,
        memory: Memory,
        state: State,
        q_d: Vec3,
        b1_d: Vec3,
        pull: float,
        actuation: Actuation,
        observed: Observed,
    ) -> tuple[Memory, Command]:
        return self.other_modes.load_attitude(memory, state, q_d, b1_d, pull, actuation, observed)

    def load_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return memory, lqr.load_position(state, reference, self.regulator)

    def quad_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        return self.other_modes.quad_position(memory, state, reference, actuation, observed)


class PlumblineMemory(NamedTuple):
    """What the law remembers: of load position, and of the other modes."""

    position: plumbline.PlumblineMemory
    other_modes: Memory


class PlumblineLaw(NamedTuple):
    """Every mode at the state at which its command will find the vehicle, with rotors hastened by their lag.

    Load position is flown with exact derivatives. The other modes, which are flown for moments only, are the
    loops of the thesis's cascade with its filters and the gains of the design.
    """

    constants: PlumblineConstants
    designed: Design
    other_modes: ThesisLaw
    preview_s: float

    @classmethod
    def build(cls, table: ParameterTable, vehicle: Vehicle) -> PlumblineLaw:
        """From the PLB_ and VEH_ parameters; the other modes from NGC_ and QP_."""
        period = 1.0 / table["CTL_RATE_HZ"]
        lag, shown = 1e-3 * table["VEH_ROTOR_TAU"], 1e-3 * table["PLB_LAG_TO_MS"]
        designed = believed_design(table, vehicle)
        constants = PlumblineConstants(
            designed.gains,
            believed_drag(table),
            believed_actuation(table),
            lag_gain(lag, shown, period),
            period,
            vehicle,
        )
        gains = designed.gains
        others = ThesisLaw.build(table, vehicle)
        others = others._replace(
            gains=others.gains._replace(
                k_R=gains.k_R, k_Omega=gains.k_Omega, k_q=gains.k_q, k_omega=gains.k_omega, epsilon=1.0
            )
        )
        return cls(constants, designed, others, 1e-3 * table["VEH_ACT_DELAY"])

    def with_cable(self, length: float) -> PlumblineLaw:
        vehicle, gains = self.constants.vehicle, self.constants.gains
        longer = length / vehicle.cable_length
        constants = self.constants._replace(
            gains=gains._replace(k_q=longer * gains.k_q, k_omega=longer * gains.k_omega),
            vehicle=vehicle._replace(cable_length=length),
        )
        return self._replace(constants=constants, other_modes=self.other_modes.with_cable(length))

    @property
    def ramp_lag_s(self) -> float:
        # the reference's velocity is fed forward: nothing is left behind on a ramp
        return 0.0

    def start(self, state: State, x_d: Vec3, v_d: Vec3) -> Memory:
        return PlumblineMemory(plumbline.start(), self.other_modes.start(state, x_d, v_d))

    def quad_attitude(
        self, memory: Memory, state: State, R_d: Mat3, thrust: float, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        ahead = ahead_of(state, 1.0, actuation, observed, self.constants)
        other, wanted = self.other_modes.quad_attitude(
            memory.other_modes, ahead.state, R_d, thrust, actuation, observed
        )
        return memory._replace(other_modes=other), hastened(wanted, ahead, self.constants)

    def load_attitude(
        self,
        memory: Memory,
        state: State,
        q_d: Vec3,
        b1_d: Vec3,
        pull: float,
        actuation: Actuation,
        observed: Observed,
    ) -> tuple[Memory, Command]:
        ahead = ahead_of(state, 1.0, actuation, observed, self.constants)
        other, wanted = self.other_modes.load_attitude(
            memory.other_modes, ahead.state, q_d, b1_d, pull, actuation, observed
        )
        return memory._replace(other_modes=other), hastened(wanted, ahead, self.constants)

    def load_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        position, command = load_position_tick(
            memory.position, state, reference, actuation, observed, self.constants
        )
        return memory._replace(position=position), command

    def quad_position(
        self, memory: Memory, state: State, reference: Reference, actuation: Actuation, observed: Observed
    ) -> tuple[Memory, Command]:
        others = self.other_modes
        slack = SlackConstants(others.position_gains, others.gains, others.filters)
        other, command = quad_position_tick(
            memory.other_modes, state, reference, actuation, observed, self.constants, slack
        )
        return memory._replace(other_modes=other), command


_BUILDERS: dict[str, Callable[[ParameterTable, Vehicle], Law]] = {
    "thesis": ThesisLaw.build,
    "lqr": LqrLaw.build,
    "plumbline": PlumblineLaw.build,
}


def build_law(table: ParameterTable) -> Law:
    """The law that CTL_LAW selects."""
    return _BUILDERS[LAWS[int(table["CTL_LAW"])]](table, believed_vehicle(table))
