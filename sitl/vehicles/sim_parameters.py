"""The simulator's parameters, SIM_*: what an experiment changes without writing a truth file."""

from __future__ import annotations

from autopilot.wire.parameter_table import Parameter, ParameterTable
from sitl.plant.records import Truth


def sim_parameters(truth: Truth) -> ParameterTable:
    """The table, with the values of the truth file as defaults."""
    return ParameterTable(
        [
            Parameter("SIM_ACT_DELAY_MS", 0.0, 0.0, 200.0, "ms", "Transport delay of actuator commands"),
            Parameter(
                "SIM_ROTOR_TAU_MS", truth.rotor_tau * 1e3, 0.0, 1000.0, "ms", "Time constant of the rotor lag"
            ),
            Parameter(
                "SIM_ENGINE_FAIL",
                0.0,
                0.0,
                15.0,
                "",
                "Rotors that fail, a bit for each: 1, 2, 4, 8 for rotor 1, 2, 3, 4",
                integer=True,
            ),
            Parameter("SIM_ENGINE_MUL", 0.0, 0.0, 1.0, "", "Share of its command that a failing rotor gives"),
            Parameter("SIM_NOISE_SCALE", 1.0, 0.0, 100.0, "", "Factor on the noise and bias of every sensor"),
            Parameter(
                "SIM_SENS_LAT_MS", 0.0, 0.0, 500.0, "ms", "Latency added to that of every sensor", fixed=True
            ),
            Parameter("SIM_DROP_PCT", 0.0, 0.0, 100.0, "%", "Drop-out added to each sensor's own"),
            Parameter(
                "SIM_RATE_HZ", 250.0, 100.0, 1000.0, "Hz", "Ticks per second", integer=True, fixed=True
            ),
            _around("SIM_QUAD_MASS", truth.quad_mass, "kg", "Mass of the vehicle"),
            _around("SIM_LOAD_MASS", truth.load_mass, "kg", "Mass of the load"),
            _around("SIM_CABLE_LEN", truth.cable_length, "m", "Length of the cable", fixed=True),
            Parameter("SIM_DRAG_SCALE", 1.0, 0.0, 100.0, "", "Factor on all drag of vehicle and load"),
            Parameter("SIM_WIND_E", 0.0, -50.0, 50.0, "m/s", "Wind towards the east"),
            Parameter("SIM_WIND_N", 0.0, -50.0, 50.0, "m/s", "Wind towards the north"),
            Parameter("SIM_WIND_U", 0.0, -50.0, 50.0, "m/s", "Wind upwards"),
            Parameter("SIM_GUST_STD", 0.0, 0.0, 20.0, "m/s", "Standard deviation of gusts, each axis"),
            Parameter("SIM_GUST_TAU_S", 1.0, 0.05, 60.0, "s", "Correlation time of gusts"),
            Parameter("SIM_GUST_E", 0.0, -50.0, 50.0, "m/s", "Gust pulse on the wind, towards the east"),
            Parameter("SIM_GUST_N", 0.0, -50.0, 50.0, "m/s", "Gust pulse on the wind, towards the north"),
            Parameter("SIM_GUST_U", 0.0, -50.0, 50.0, "m/s", "Gust pulse on the wind, upwards"),
            Parameter(
                "SIM_GUST_AT_S", -1.0, -1.0, 1e6, "s", "Simulated time at which the pulse begins; -1: never"
            ),
            Parameter("SIM_GUST_FOR_S", 2.0, 0.0, 1e6, "s", "Duration of the pulse"),
            Parameter(
                "SIM_GUST_NOW", 0.0, 0.0, 1.0, "", "1: the pulse begins at the next tick", integer=True
            ),
        ]
    )


def _around(name: str, value: float, unit: str, text: str, fixed: bool = False) -> Parameter:
    """A mass or length of the truth file, free within two decades."""
    return Parameter(name, value, value / 100.0, value * 100.0, unit, text, fixed=fixed)


def apply(truth: Truth, table: ParameterTable) -> Truth:
    """`truth` with what the table says of the plant itself."""
    drag = table["SIM_DRAG_SCALE"]
    failing, left = int(table["SIM_ENGINE_FAIL"]), table["SIM_ENGINE_MUL"]
    one, two, three, four = (left if failing >> bit & 1 else 1.0 for bit in range(4))
    return truth._replace(
        quad_mass=table["SIM_QUAD_MASS"],
        load_mass=table["SIM_LOAD_MASS"],
        cable_length=table["SIM_CABLE_LEN"],
        rotor_tau=table["SIM_ROTOR_TAU_MS"] * 1e-3,
        rotor_share=(one, two, three, four),
        quad_drag=truth.quad_drag * drag,
        quad_drag_quadratic=truth.quad_drag_quadratic * drag,
        spin_drag=truth.spin_drag * drag,
        load_drag=truth.load_drag * drag,
        load_drag_quadratic=truth.load_drag_quadratic * drag,
    )
