"""The autopilot's parameters: what it believes of its vehicle, and how it is tuned. One table."""

from __future__ import annotations

from collections.abc import Iterable

from autopilot.vehicle.belief import Belief
from autopilot.wire.parameters import Parameter, ParameterTable

SHAPE_NEVER, SHAPE_WITH_PLUMBLINE, SHAPE_ALWAYS = 0, 1, 2  # MIS_SHAPE
LAWS = ("thesis", "lqr", "plumbline")  # CTL_LAW is an index into this


# what a builder measures on the bench: the autopilot is told of it where the world is
MEASURED = {"SIM_ACT_DELAY_MS": "VEH_ACT_DELAY", "SIM_ROTOR_TAU_MS": "VEH_ROTOR_TAU"}


def apply_settings(table: ParameterTable, settings: Iterable[tuple[str, float]]) -> None:
    """Set what is the autopilot's; SIM_ parameters that it does not know belong to the simulator.

    Delay and lag of the rotors that are given to the simulator are believed as well, unless the belief is
    given, too: then the two differ, which is the experiment.
    """
    given = list(settings)
    names = {name for name, _ in given}
    for name, value in given:
        if name in table or not name.startswith("SIM_"):
            table.set(name, value)
        elif name in MEASURED and MEASURED[name] not in names:
            table.set(MEASURED[name], value)


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
            p("VEH_ACT_DELAY", 0.0, 0.0, 200.0, "ms", "Believed transport delay of actuator commands"),
            p(
                "VEH_ROTOR_TAU",
                1e3 * belief.rotor_tau_s,
                0.0,
                1000.0,
                "ms",
                "Believed first-order lag of the rotors",
            ),
            p("VEH_GRAVITY", belief.gravity_m_s2, 0.1, 30.0, "m/s^2", "Acceleration of gravity"),
            p(
                "CTL_LAW",
                float(LAWS.index("plumbline")),
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
            p("PLB_DELAY_TOL", 12.0, 0.1, 200.0, "ms", "Unknown delay, more or less, that the gains survive"),
            p("PLB_RATIO_Q", 1.5, 0.2, 20.0, "", "Bandwidth of the cable's loop over that of load position"),
            p(
                "PLB_RATIO_I",
                0.2,
                0.0,
                1.0,
                "",
                "Bandwidth of the load's steady error over that of its position",
            ),
            p("PLB_RATIO_R", 4.0, 0.5, 50.0, "", "Bandwidth of the vehicle attitude over that of the cable"),
            p("PLB_ZETA", 0.9, 0.3, 2.0, "", "Damping of the three loops"),
            p("PLB_NOISE", 1.0, 0.0, 100.0, "", "Noise that the rotors must bear, in that of motion capture"),
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
                "Lag that the rotors are made to show; no less than VEH_ROTOR_TAU leaves them as they are",
            ),
            p("PLB_T_MASS", 0.3, 0.0, 100.0, "s", "Time in which the load's mass is learned; 0: never"),
            p("PLB_T_PUSH", 0.1, 0.0, 100.0, "s", "Time in which the wind's push is learned; 0: never"),
            p("EST_GYRO_STD", 0.005, 1e-7, 1.0, "rad/s", "Believed noise of one gyro sample"),
            p("EST_ACC_STD", 0.05, 1e-7, 10.0, "m/s^2", "Believed noise of one accelerometer sample"),
            p("EST_GYRO_WALK", 1e-4, 0.0, 1.0, "rad/s", "Believed gyro bias walk in a second"),
            p("EST_ACC_WALK", 1e-3, 0.0, 1.0, "m/s^2", "Believed accelerometer bias walk in a second"),
            p("EST_GYRO_BIAS", 0.01, 1e-6, 1.0, "rad/s", "Believed gyro bias at switch-on"),
            p("EST_ACC_BIAS", 0.1, 1e-6, 10.0, "m/s^2", "Believed accelerometer bias at switch-on"),
            p("EST_LEN_STD", 0.01, 1e-6, 10.0, "m", "Believed error of VEH_CABLE_LEN"),
            p(
                "EST_RTK_NEW",
                0.8,
                0.05,
                1.0,
                "",
                "Share of an RTK fix's stated error that is new in each",
            ),
            p("EST_GPS_NEW", 0.2, 0.05, 1.0, "", "The same without RTK; the rest changes slowly"),
            p("EST_GPS_TAU", 80.0, 1.0, 10000.0, "s", "Time in which the receiver's slow error changes"),
            p(
                "EST_RTK_V_STD",
                0.03,
                0.001,
                10.0,
                "m/s",
                "Noise of an RTK receiver's level velocity",
            ),
            p(
                "EST_GPS_V_STD",
                0.1,
                0.001,
                10.0,
                "m/s",
                "Noise of a plain receiver's level velocity",
            ),
            p("EST_BARO_STD", 0.1, 0.001, 100.0, "m", "Believed noise of the barometer"),
            p("EST_BARO_WALK", 0.025, 0.0, 10.0, "m", "Believed drift of the barometer in a second"),
            p("EST_BARO_LAT", 12.0, 0.0, 300.0, "ms", "Age of a barometer reading when it comes"),
            p("EST_MAG_STD", 0.015, 0.0001, 1.0, "rad", "Believed noise of the magnetometer's heading"),
            p("EST_MAG_BIAS", 0.025, 0.0, 1.0, "rad", "Believed error of that heading by hard iron"),
            p("EST_MAG_LAT", 12.0, 0.0, 300.0, "ms", "Age of a magnetometer reading when it comes"),
            p("EST_MAG_DECL", 3.0, -180.0, 180.0, "deg", "Magnetic declination, east of north"),
            p("EST_CAM_BIAS", 0.003, 1e-6, 1.0, "rad", "Believed mounting error of the camera"),
            p("EST_GEAR_H", 0.06, 0.0, 10.0, "m", "Height of the standing vehicle's centre of mass"),
            p("EST_LOAD_H", 0.02, 0.0, 10.0, "m", "Height of the lying load's centre"),
            p(
                "EST_LAID_FWD",
                0.5,
                -1.0,
                1.0,
                "",
                "Cable lengths ahead of the vehicle at which the load is laid",
            ),
            p("EST_LAID_STD", 0.3, 0.001, 1.0, "", "How well that is kept, in cable lengths"),
            p("EST_CABLE_STD", 0.07, 1e-6, 100.0, "rad/s^2", "Believed error of the pendulum model"),
            p("EST_GATE", 7.0, 2.0, 100.0, "", "Readings further off than so many sigma are refused"),
            p("MIS_TAKEOFF_ALT", 2.0, 0.3, 100.0, "m", "Load height of a take-off that names none"),
            p("MIS_SPEED", 1.5, 0.05, 15.0, "m/s", "Greatest speed of the load between waypoints"),
            p("MIS_ACCEL", 1.5, 0.05, 15.0, "m/s^2", "Greatest acceleration of the load between waypoints"),
            p("MIS_LIFT_SPEED", 0.8, 0.05, 5.0, "m/s", "Speed at which the load is lifted and lowered"),
            p("MIS_TAUT_SPEED", 0.15, 0.02, 1.0, "m/s", "Speed at which the slack cable is pulled taut"),
            p(
                "MIS_TIME_OPT",
                0.0,
                0.0,
                1.0,
                "",
                "Waypoints in a row are passed 0 at MIS_SPEED and MIS_ACCEL, 1 as quickly as can be flown",
                integer=True,
            ),
            p(
                "MIS_SHAPE",
                SHAPE_WITH_PLUMBLINE,
                SHAPE_NEVER,
                SHAPE_ALWAYS,
                "",
                "Load signals are shaped to what can be flown: 0 never, 1 with the law plumbline, 2 always",
                integer=True,
            ),
            p("MIS_SHAPE_ERR", 0.05, 0.001, 10.0, "m", "How far a shaped path may be from the asked one"),
            p(
                "MIS_INFEASIBLE",
                2.0,
                0.0,
                2.0,
                "",
                "A path that cannot be flown is 0 flown as asked, 1 slowed down, 2 refused",
                integer=True,
            ),
            p("MIS_ROTOR_MARG", 15.0, 0.0, 45.0, "%", "Range of a rotor kept free for control at either end"),
            p("MIS_TILT_DEG", 45.0, 1.0, 80.0, "deg", "Greatest tilt of the vehicle along a shaped path"),
            p("MIS_TENSION", 30.0, 0.0, 90.0, "%", "Least tension along a shaped path, of the load's weight"),
            p(
                "MIS_SNAP_SPEED",
                0.25,
                0.02,
                5.0,
                "m/s",
                "Greatest closing speed at which a slack cable is made taut",
            ),
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
