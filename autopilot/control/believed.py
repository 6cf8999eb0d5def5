"""The assumed vehicle, rotors and air, from the parameters: the records that laws and observer take."""

from __future__ import annotations

from autopilot.control.actuators.disturbance_observer import (
    ObserverConstants,
    averaging_share,
    observer_constants,
)
from autopilot.control.actuators.mixer import LOST_COUNT
from autopilot.control.actuators.rotor_model import ActuationConstants, actuation_constants
from autopilot.control.design import Design, Requirements, Timing, design
from autopilot.control.drag import Drag
from autopilot.control.records import Vehicle
from autopilot.vehicle.parameters import AutopilotParameters
from autopilot.vehicle.rotors import mixer_table, thrust_and_moment_per_force
from autopilot.wire.convert.simulator import SPEED_REPORT_US
from autopilot.wire.parameter_table import ParameterTable

# A rotor that is commanded its full force shows nothing of it until delay and lag have passed, and is judged
# by LOST_COUNT reported speeds. In this time t, the force expected of it may rise by less than a tenth of the
# full force, from which on it is judged (`autopilot.core.tick.rotors_lost`): 1 - exp(-t / T) < 0.1 for
# T = 10 t.
ROTOR_WATCH_RATIO = 10.0
SPEED_REPORTS_S = LOST_COUNT * SPEED_REPORT_US * 1e-6
MAX_PUSH_SHARE = 0.7  # of the weight: bound of the estimated wind force


def believed_vehicle(table: AutopilotParameters) -> Vehicle:
    """The vehicle as the parameters describe it."""
    thrust_per_force, moment_per_force = thrust_and_moment_per_force(mixer_table(table.layout))
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
        thrust_per_force=thrust_per_force,
        moment_per_force=moment_per_force,
        attachment=table.vector("VEH_ATT_"),
    )


def believed_drag(table: ParameterTable) -> Drag:
    """Drag of the vehicle as the parameters describe it."""
    return Drag(table["PLB_DRAG"], table["PLB_DRAG_2"])


def believed_actuation(table: ParameterTable) -> ActuationConstants:
    """Delay and lag of the rotors as the parameters describe them."""
    period = 1.0 / table["CTL_RATE_HZ"]
    return actuation_constants(believed_delay(table), 1e-3 * table["VEH_ROTOR_TAU"], period)


def believed_delay(table: ParameterTable) -> float:
    """Time from the instant that an estimate applies to until its command takes effect, s."""
    return 1e-3 * (table["VEH_ACT_DELAY"] + table["VEH_IMU_DELAY"])


def believed_rotor_watch(table: ParameterTable) -> float:
    """Share of a period in the time for which a rotor must have been commanded a force to be judged by it."""
    period = 1.0 / table["CTL_RATE_HZ"]
    response_s = believed_delay(table) + 1e-3 * table["VEH_ROTOR_TAU"] + SPEED_REPORTS_S
    return period / (ROTOR_WATCH_RATIO * response_s + period)


def believed_factor_share(table: ParameterTable) -> float:
    """Share of a period in the time constant with which the rotor speeds change the thrust factor."""
    return averaging_share(1.0 / table["CTL_RATE_HZ"], table["CTL_T_THRUST"])


def believed_design(table: ParameterTable, vehicle: Vehicle) -> Design:
    """The gains of `plumbline` for the vehicle that the parameters describe."""
    lag, target_lag = 1e-3 * table["VEH_ROTOR_TAU"], 1e-3 * table["PLB_LAG_TO_MS"]
    return design(
        Requirements(
            tolerance=1e-3 * table["PLB_DELAY_TOL"],
            integral_ratio=table["PLB_RATIO_I"],
            cable_ratio=table["PLB_RATIO_Q"],
            attitude_ratio=table["PLB_RATIO_R"],
            zeta=table["PLB_ZETA"],
            noise=table["PLB_NOISE"],
        ),
        Timing(
            believed_delay(table),
            lag,
            min(lag, target_lag),
            1.0 / table["CTL_RATE_HZ"],
            table["PLB_T_TORQUE"],
        ),
        vehicle,
    )


def believed_observer(table: ParameterTable, vehicle: Vehicle) -> ObserverConstants:
    """Constants of the observer: how fast disturbances are learned, and bounds."""
    weight = (vehicle.quad_mass + vehicle.load_mass) * vehicle.gravity
    return observer_constants(
        table["PLB_T_MASS"],
        table["PLB_T_PUSH"],
        table["PLB_T_DRAG"],
        table["PLB_T_TORQUE"],
        MAX_PUSH_SHARE * weight,
        1.0 / table["CTL_RATE_HZ"],
        believed_delay(table),
        believed_drag(table),
        vehicle,
    )
