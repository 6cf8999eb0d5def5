"""What the parameters say of the vehicle, its rotors and the air: the records that laws and observer take."""

from __future__ import annotations

from autopilot.control.actuators.disturbance_observer import ObserverConstants, observer_constants
from autopilot.control.actuators.rotor_model import ActuationConstants, actuation_constants
from autopilot.control.design import Design, Timing, Wanted, design
from autopilot.control.load_motion import Drag
from autopilot.control.records import Vehicle
from autopilot.wire.parameter_table import ParameterTable

GREATEST_PUSH = 0.3  # of the weight: more wind than that is not believed


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
