"""The autopilot's parameters: what it believes of its vehicle, and how it is tuned. One table."""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.vehicle.belief import Belief
from autopilot.wire.parameters import Parameter, ParameterTable

LAWS = ("thesis", "lqr", "plumbline")  # CTL_LAW is an index into this


def apply_settings(table: ParameterTable, settings: Iterable[tuple[str, float]]) -> None:
    """Set what is the autopilot's; SIM_ parameters that it does not know belong to the simulator."""
    for name, value in settings:
        if name in table or not name.startswith("SIM_"):
            table.set(name, value)


def autopilot_parameters(belief: Belief) -> ParameterTable:
    """The table, with the vehicle's numbers taken from `belief`."""
    j_xx, j_yy, j_zz = belief.inertia_kg_m2
    p = Parameter
    return ParameterTable(
        [
            p(
                "VEH_QUAD_MASS",
                belief.quad_mass_kg,
                0.01,
                100.0,
                "kg",
                "Mass of the vehicle without its load",
            ),
            p("VEH_LOAD_MASS", belief.load_mass_kg, 0.001, 100.0, "kg", "Mass of the load"),
            p("VEH_CABLE_LEN", belief.cable_length_m, 0.05, 100.0, "m", "Length of the cable"),
            p("VEH_ARM_LEN", belief.arm_m, 0.01, 5.0, "m", "From the centre of mass to a rotor"),
            p("VEH_J_XX", j_xx, 1e-6, 100.0, "kg m^2", "Moment of inertia about the forward axis"),
            p("VEH_J_YY", j_yy, 1e-6, 100.0, "kg m^2", "Moment of inertia about the left axis"),
            p("VEH_J_ZZ", j_zz, 1e-6, 100.0, "kg m^2", "Moment of inertia about the upward axis"),
            p("VEH_ROTOR_MIN", belief.rotor_min_n, -1000.0, 1000.0, "N", "Least force of one rotor"),
            p("VEH_ROTOR_MAX", belief.rotor_max_n, 0.01, 1000.0, "N", "Greatest force of one rotor"),
            p(
                "VEH_ROTOR_LIM",
                1.0 if belief.limited else 0.0,
                0.0,
                1.0,
                "",
                "1: the mixer keeps rotor forces within their limits, 0: it ignores them",
                integer=True,
            ),
            p(
                "VEH_TORQUE",
                belief.torque_ratio_m,
                1e-5,
                1.0,
                "m",
                "Drag torque for each newton of rotor force",
            ),
            p("VEH_GRAVITY", belief.gravity_m_s2, 0.1, 30.0, "m/s^2", "Acceleration of gravity"),
            p(
                "CTL_LAW",
                0.0,
                0.0,
                len(LAWS) - 1.0,
                "",
                "Control law: " + ", ".join(f"{i} {name}" for i, name in enumerate(LAWS)),
                integer=True,
                fixed=True,
            ),
            p(
                "CTL_RATE_HZ",
                250.0,
                100.0,
                1000.0,
                "Hz",
                "Rate of the control law; the rate of the sensors must be a multiple of it",
                integer=True,
                fixed=True,
            ),
            p("NGC_KR", 0.9, 0.0, 1000.0, "N m", "Gain of the vehicle attitude error, (3-20)"),
            p("NGC_KOMEGA", 0.1, 0.0, 100.0, "N m s", "Gain of the vehicle rate error, (3-20)"),
            p(
                "NGC_EPSILON",
                1.0,
                0.01,
                1.0,
                "",
                "Attitude gains are divided by it, squared and once, (3-21)",
            ),
            p("NGC_KQ", 3.9, 0.0, 1000.0, "N", "Gain of the load attitude error, (3-33)"),
            p("NGC_KW", 2.0, 0.0, 1000.0, "N s", "Gain of the load attitude rate error, (3-33)"),
            p("NGC_KX", 6.0, 0.0, 1000.0, "N/m", "Gain of the load position error, (3-43)"),
            p("NGC_KV", 2.75, 0.0, 1000.0, "N s/m", "Gain of the load velocity error, (3-43)"),
            p("NGC_WN_R", 30.0, 1.0, 1000.0, "rad/s", "Command filter of the vehicle attitude, (4-2)"),
            p("NGC_WN_Q", 25.0, 1.0, 1000.0, "rad/s", "Command filter of the load attitude, (4-2)"),
            p("NGC_WN_X", 25.0, 1.0, 1000.0, "rad/s", "Command filter of the load position, (4-2)"),
            p("NGC_ZETA", 0.98, 0.1, 2.0, "", "Damping of the command filters, (4-2)"),
            p("QP_KX", 2.5, 0.0, 1000.0, "N/m", "Vehicle position gain, level, while the cable is slack"),
            p("QP_KV", 1.8, 0.0, 1000.0, "N s/m", "Vehicle velocity gain, level, while the cable is slack"),
            p("QP_KZ", 6.4, 0.0, 1000.0, "N/m", "Vehicle height gain while the cable is slack"),
            p("QP_KVZ", 3.0, 0.0, 1000.0, "N s/m", "Vehicle climb gain while the cable is slack"),
            p("LQR_Q_POS", 50000.0, 0.001, 1e7, "", "Weight of the vehicle position error, A-2"),
            p("LQR_Q_TILT", 0.001, 1e-6, 1e7, "", "Weight of roll and pitch, A-2"),
            p("LQR_Q_YAW", 1.0, 0.001, 1e7, "", "Weight of the yaw error, A-2"),
            p("LQR_Q_SWING", 25000.0, 1e-6, 1e7, "", "Weight of the cable's angles, A-2"),
            p("LQR_Q_RATE", 0.001, 1e-6, 1e7, "", "Weight of every rate, A-2"),
            p("LQR_R_THRUST", 1000.0, 0.001, 1e7, "", "Weight of the thrust beyond hovering, A-2"),
            p("LQR_R_MOMENT", 100.0, 0.001, 1e7, "", "Weight of the moments, A-2"),
            p("PLB_KR", 0.9, 0.0, 1000.0, "N m", "Plumbline's gain of the vehicle attitude error"),
            p("PLB_KOMEGA", 0.1, 0.0, 100.0, "N m s", "Plumbline's gain of the vehicle rate error"),
            p("PLB_KQ", 3.9, 0.0, 1000.0, "N", "Plumbline's gain of the load attitude error"),
            p("PLB_KW", 2.0, 0.0, 1000.0, "N s", "Plumbline's gain of the load attitude rate error"),
            p("PLB_KX", 6.0, 0.0, 1000.0, "N/m", "Plumbline's gain of the load position error"),
            p("PLB_KV", 2.75, 0.0, 1000.0, "N s/m", "Plumbline's gain of the load velocity error"),
            p("PLB_WN_F", 25.0, 1.0, 1000.0, "rad/s", "Command filter of the force's deviation"),
            p(
                "PLB_LAG_MS",
                1e3 * belief.rotor_tau_s,
                0.0,
                500.0,
                "ms",
                "Believed first-order lag of the rotors",
            ),
            p("PLB_DRAG", belief.quad_drag_n_s_m, 0.0, 100.0, "N s/m", "Believed linear drag of the vehicle"),
            p(
                "PLB_DRAG_2",
                belief.quad_drag_quadratic_n_s2_m2,
                0.0,
                100.0,
                "N s^2/m^2",
                "Believed quadratic drag of the vehicle",
            ),
            p(
                "PLB_LAG_TO_MS",
                10.0,
                0.0,
                500.0,
                "ms",
                "Lag that the rotors are made to show; no less than PLB_LAG_MS leaves them as they are",
            ),
            p("EST_GYRO_STD", 0.005, 1e-7, 1.0, "rad/s", "Believed noise of one gyro sample"),
            p("EST_ACC_STD", 0.05, 1e-7, 10.0, "m/s^2", "Believed noise of one accelerometer sample"),
            p("EST_GYRO_WALK", 1e-4, 0.0, 1.0, "rad/s", "Believed gyro bias walk in a second"),
            p("EST_ACC_WALK", 1e-3, 0.0, 1.0, "m/s^2", "Believed accelerometer bias walk in a second"),
            p("EST_CABLE_STD", 0.1, 1e-6, 100.0, "rad/s^2", "Believed error of the pendulum model"),
            p("EST_LOAD_STD", 0.06, 1e-6, 100.0, "m/s^2", "Believed error of the load's acceleration"),
            p("EST_GATE", 7.0, 2.0, 100.0, "", "Readings further off than so many sigma are refused"),
            p("MIS_TAKEOFF_ALT", 2.0, 0.3, 100.0, "m", "Load height of a take-off that names none"),
            p("MIS_SPEED", 1.5, 0.05, 15.0, "m/s", "Greatest speed of the load between waypoints"),
            p("MIS_ACCEL", 1.5, 0.05, 15.0, "m/s^2", "Greatest acceleration of the load between waypoints"),
            p("MIS_LIFT_SPEED", 0.8, 0.05, 5.0, "m/s", "Speed at which the load is lifted and lowered"),
            p("MIS_TAUT_SPEED", 0.15, 0.02, 1.0, "m/s", "Speed at which the slack cable is pulled taut"),
            p("FS_LOAD_ERR", 5.0, 0.05, 1000.0, "m", "Load position error at which the flight is given up"),
            p("FS_TILT_DEG", 120.0, 10.0, 180.0, "deg", "Tilt at which the flight is given up"),
            p(
                "FS_SENSOR_S",
                0.5,
                0.02,
                60.0,
                "s",
                "Age of the last pose or load reading at which it is given up",
            ),
            p(
                "LOG_RATE_HZ",
                50.0,
                0.0,
                1000.0,
                "Hz",
                "Records of the flight log in a second, from arming to disarming; 0: no log",
                integer=True,
            ),
            p(
                "LOG_MAX_MB",
                512.0,
                1.0,
                100_000.0,
                "MB",
                "Flight logs kept; the oldest make room",
                integer=True,
            ),
            p("SIM_LOSS_PCT", 0.0, 0.0, 100.0, "%", "Datagrams lost on the ground link, each way"),
        ]
    )
