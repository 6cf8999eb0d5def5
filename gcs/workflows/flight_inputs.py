"""Checks vehicle, sensors and settings of a flight before its programs are started.

The programs would refuse the same errors, each in its own log; here they are reported immediately. Only this
module and `unused_settings` know both tables of parameters.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from autopilot.own.own_code import NO_OWN_CODE, OwnCode, parameters_for, require_delivered
from autopilot.own.source import OwnError
from autopilot.vehicle.file import load_truth_and_belief, load_vehicle
from autopilot.vehicle.parameters import apply_settings, autopilot_parameters
from autopilot.vehicle.rates import RateError, control_divider
from autopilot.wire.convert.scaling import STANDARD_GRAVITY
from autopilot.wire.parameter_names import unknown_parameter_text
from autopilot.wire.parameter_table import ParameterError, ParameterTable
from gcs.errors import InputError, input_error
from gcs.workflows.flight_options import SIMULATOR_PREFIX
from gcs.workflows.slow_rotors import slow_rotor_warnings
from missions.toml_files import FileError
from sitl.sensors.files import load_profile
from sitl.settings import settings_of
from sitl.vehicles.sim_parameters import sim_parameters
from sitl.vehicles.truth import truth_of

_MAX_THRUST_RATIO = 20.0  # thrust over weight; racing multirotors without a load have up to 15
_G_N = 1e-3 * STANDARD_GRAVITY  # weight of a gram
# Least mass of a load, as a share of the vehicle's: the cable counts as taut when its pull is three tenths of
# the load's weight for a tenth of a second. Measured, the pull varies by 0.4 % of the vehicle's weight (one
# standard deviation) with the noise of the shipped inertial units, and by 3 % with vibration.
_FELT_SHARE, _FELT_IN_VIBRATION_SHARE = 0.01, 0.1
_MIN_HOVER_W_KG = 60.0  # rotors that are large for their load need 70, those of usual vehicles 100 to 250


def check_flight_inputs(
    vehicle: str,
    sensors: str,
    settings: Iterable[tuple[str, float]],
    own_parts: OwnCode = NO_OWN_CODE,
    ignored: Collection[str] = (),
) -> None:
    """GcsError if there is no such vehicle or sensor profile, if a parameter cannot have its value, if a rate
    does not divide the rate that it must divide, or if custom code cannot fly. `ignored`: parameters in the
    vehicle's file that have no effect, which it must have."""
    try:
        found, _ = load_truth_and_belief(vehicle)
        load_profile(sensors)
    except FileError as error:
        raise input_error(error) from None
    given = list(settings)
    autopilot = delivered_parameters(vehicle, own_parts, ignored)
    simulator = sim_parameters(truth_of(found))
    for name, value in given:
        if name == "CTL_LAW":
            raise InputError("--set CTL_LAW is what --law names; give --law")
        table = simulator if name.startswith(SIMULATOR_PREFIX) and name not in autopilot else autopilot
        if name not in table:
            raise InputError(f"--set {unknown_parameter_text(name, [*autopilot.names, *simulator.names])}")
        _check(table, name, value)
        table.set(name, value)
    try:
        control_divider(1e6 / settings_of(simulator).tick_us, autopilot)
    except (ParameterError, RateError) as error:
        raise InputError(f"--set {error}") from None
    if any(own_parts):
        _try_own_code(own_parts, autopilot, given)


def setting_warnings(vehicle: str, settings: Iterable[tuple[str, float]]) -> list[str]:
    """A line for each setting that can be flown but is probably unintended: a value below one of a parameter
    in milliseconds, which was probably meant in seconds, and one up to one of a parameter in percent, which
    was probably meant as a share (parameters whose default is that small are left out); and a battery that is
    turned on with a power at which no vehicle of this mass hovers, such as that of the defaults."""
    found, believed = load_truth_and_belief(vehicle)
    tables = sim_parameters(truth_of(found)), autopilot_parameters(believed)
    pairs = list(settings)  # in a sweep with several values of a parameter
    given = dict(pairs)
    own = {name: (table.describe(name).unit, table[name]) for table in tables for name in table.names}
    lines = []
    for name, value in pairs:
        unit, default = own.get(name, ("", 0.0))
        if unit == "ms" and 0.0 < abs(value) < 1.0:
            lines.append(f"{name} = {value:g} is in milliseconds; {value * 1e3:g} if {value:g} s is meant")
        elif unit == "%" and 0.0 < value <= 1.0 < default:
            meant = f"{value * 1e2:g} if a share of {value:g} is meant"
            lines.append(f"{name} = {value:g} is in percent; {meant}")
    hover_w, mass_kg = (given.get(name, tables[0][name]) for name in ("SIM_BAT_HOVER_W", "SIM_QUAD_MASS"))
    if given.get("SIM_BATTERY") and hover_w < _MIN_HOVER_W_KG * mass_kg:
        lines.append(
            f"SIM_BATTERY = 1: {_too_little_power(hover_w, mass_kg)} (SIM_BAT_HOVER_W); set it, "
            "SIM_BAT_CELLS, SIM_BAT_CAP and SIM_BAT_R to what this vehicle has"
        )
    return lines


def _too_little_power(hover_w: float, mass_kg: float) -> str:
    return f"{hover_w:g} W to hover with {mass_kg:g} kg is less than any multirotor needs"


def vehicle_warnings(vehicle: str) -> list[str]:
    """A line each if the file of the vehicle chooses a law (in flights of `gcs` that of `--law` flies), if
    its rotors give many times its weight, have more drag torque than any propeller or are slow, if its load
    is too light to be felt, if its cable is shorter than its arms, and if no vehicle of its mass hovers with
    the power of its battery."""
    found, believed = load_truth_and_belief(vehicle)
    warnings = []
    if "CTL_LAW" in believed.parameters:
        warnings.append(f"{vehicle}: parameters.CTL_LAW has no effect; --law names the law")
    weight_n = (found.quad_mass_kg + found.load_mass_kg) * found.gravity_m_s2
    if found.limited and found.greatest_thrust_n > _MAX_THRUST_RATIO * weight_n:
        warnings.append(
            f"{vehicle}: rotor_max_n = {found.rotor_max_n:g}: all rotors give "
            f"{found.greatest_thrust_n / weight_n:.0f} times the weight of vehicle and load; "
            f"{found.rotor_max_n * _G_N:.3g} if {found.rotor_max_n:g} g of thrust are meant"
        )
    # Torque over force is (C_Q / C_T) times the diameter: 0.05 to 0.1 of it at rest. At the radius, the drag
    # of the blades would be as great as their lift.
    if found.torque_ratio_m > found.rotor_radius_m:
        warnings.append(
            f"{vehicle}: torque_ratio_m = {found.torque_ratio_m:g} is more than the radius of a rotor, "
            f"{found.rotor_radius_m:.2g} m: usual is 0.1 to 0.2 of it, {0.1 * found.rotor_radius_m:.2g} to "
            f"{0.2 * found.rotor_radius_m:.2g}; check it, and arm_m"
        )
    warnings += [f"{vehicle}: {line}" for line in slow_rotor_warnings(autopilot_parameters(believed))]
    load_share = found.load_mass_kg / found.quad_mass_kg
    if load_share < _FELT_IN_VIBRATION_SHARE:
        least, noise = _FELT_IN_VIBRATION_SHARE, "vibration (sensors lab-real, field)"
        if load_share < _FELT_SHARE:
            least, noise = _FELT_SHARE, "the noise of the inertial unit"
        warnings.append(
            f"{vehicle}: load_mass_kg = {found.load_mass_kg:g} is {100.0 * load_share:.2g} % of "
            f"quad_mass_kg: below {100.0 * least:g} % the pull of the cable may be lost in {noise}; "
            'then the flight ends with "Cable never taut"'
        )
    if found.cable_length_m < found.arm_m:
        warnings.append(
            f"{vehicle}: cable_length_m = {found.cable_length_m:g} is less than arm_m, {found.arm_m:g}: the "
            "load lies under the vehicle, whose feet may strike the ground as it pulls the cable taut; use a "
            "longer cable"
        )
    if found.battery and found.battery_hover_w < _MIN_HOVER_W_KG * found.quad_mass_kg:
        lacking = _too_little_power(found.battery_hover_w, found.quad_mass_kg)
        warnings.append(
            f"{vehicle}: battery_hover_w = {found.battery_hover_w:g}: {lacking}: it would fly too long"
        )
    return warnings


def sensor_warnings(sensors: str) -> list[str]:
    """A line for each sensor of the profile whose readings arrive too late to be used."""
    from autopilot.estimation.inbox import MAX_READING_AGE_S  # imports all flight software

    profile = load_profile(sensors)
    # ages are counted from the instant that the inertial unit's newest sample shows
    limit_ms = 1e3 * MAX_READING_AGE_S + profile.imu.latency_ms
    return [
        f"{sensors}: {name}.latency_ms = {table.latency_ms:g}: the autopilot uses no reading that is older "
        f"than {limit_ms:g} ms, and so none of this sensor"
        for name, table in profile.timed.items()
        if table.latency_ms > limit_ms
    ]


def split_settings(
    vehicle: str, sensors: str, settings: Iterable[tuple[str, float]]
) -> tuple[list[tuple[str, float]], list[tuple[str, float]]]:
    """The settings for the simulator, and the rest for a third-party autopilot; GcsError if there is no such
    vehicle or sensor profile, or if a parameter of the simulator cannot have its value."""
    try:
        found = load_vehicle(vehicle)
        load_profile(sensors)
    except FileError as error:
        raise input_error(error) from None
    simulator = sim_parameters(truth_of(found))
    given = list(settings)
    simulator_part = [(name, value) for name, value in given if name in simulator]
    for name, value in simulator_part:
        _check(simulator, name, value)
    return simulator_part, [(name, value) for name, value in given if name not in simulator]


def delivered_parameters(vehicle: str, own: OwnCode, ignored: Collection[str]) -> ParameterTable:
    """The autopilot's parameters with which a vehicle is delivered, without the `ignored` ones. GcsError if
    there is no such vehicle, if it is not delivered with one of these, or if it is with one that neither the
    autopilot nor the custom code has."""
    try:
        _, belief = load_truth_and_belief(vehicle)
        require_delivered(belief, ignored)
        return parameters_for(belief, own, ignored=ignored)
    except OwnError as error:
        raise InputError(str(error)) from None
    except FileError as error:
        raise input_error(error) from None


def _try_own_code(own: OwnCode, table: ParameterTable, settings: list[tuple[str, float]]) -> None:
    from autopilot.own.trial import try_all  # imports all flight software
    from autopilot.shell.watched_calls import watched_calls

    apply_settings(table, settings)
    try:
        with watched_calls():
            try_all(own, table.values())
    except OwnError as error:
        raise InputError(str(error)) from None


def _check(table: ParameterTable, name: str, value: float) -> None:
    try:
        table.check(name, value)
    except ParameterError as error:
        raise InputError(f"--set {error}") from None
