"""Stability margins of the cascades in gain, phase and delay, for various rotor lags, rates and delays.

The loop is linearised numerically about hover: the vehicle from (2-30)-(2-35) with first-order rotors; the
laws from the same functions that fly, including their filters; sampled with a zero-order hold of the
commands. The margins are those of the loop opened at the roll moment (the axis of least inertia), with all
other loops closed:

* gain: the factors by which the roll command may grow and shrink before the loop becomes unstable; * phase:
at the crossover where it is least; * delay: the additional transport delay at which an eigenvalue leaves the
unit circle, with all commands delayed equally.

`delay` is the whole time between a motion and the command that responds to it, without the hold: sensor
latency, computation, transport.

The law `plumbline` assumes the true delay and lag of the rotors, unless `believed_delay` and `believed_tau`
give others. `wanted_tau` is the lag that remains after its compensation. Its gains are those of the design,
unless gains other than those of Table 4-3 are given. With a delay, "sooner" is by how much the true delay may
be less.

    python benchmarks/cascade_margin.py [--loop attitude|position|vehicle|plumbline] [--set k_R=0.45 ...]
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from autopilot.control import plumbline_cascade as plumbline
from autopilot.control import thesis_cascade as thesis
from autopilot.control.actuators.disturbance_observer import nominal_in_flight
from autopilot.control.actuators.lag_compensation import lag_gain
from autopilot.control.actuators.rotor_model import Actuation, actuation_constants, advance
from autopilot.control.command_filter import FilterState
from autopilot.control.design import Requirements, Timing, design
from autopilot.control.drag import Drag
from autopilot.control.laws.plumbline import PlumblineConstants, PlumblineLaw, PlumblineMemory, load_position
from autopilot.control.laws.thesis import ThesisLaw
from autopilot.control.linear_model import LOAD_STATES, hover_thrust, load_state_space
from autopilot.control.quad_position import QUAD_POSITION_GAINS, quad_position
from autopilot.control.records import Cable, Reference, Vehicle
from gcs.sweep.margin import sampled_plant, state_near_hover

Array = NDArray[np.float64]

# Table 4-1; torque ratio and limits have no effect in a linear model
BEBOP = Vehicle(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.0, 1.96)
ZERO = (0.0, 0.0, 0.0)
HOVER = 0.25 * hover_thrust(BEBOP)  # N, each rotor
HEADING = (1.0, 0.0, 0.0)
# central differences: truncation and rounding both below 1e-9
STEP = 1e-5
# the innermost loop, the load position cascade, the vehicle position law with the load hanging, and the load
# position of the law `plumbline`
LOOPS = ("attitude", "position", "vehicle", "plumbline")
TARGET_TAU = 0.010  # s, PLB_LAG_TO_MS
TARGETS = Requirements(
    0.012, integral_ratio=0.2, cable_ratio=1.5, attitude_ratio=4.0, zeta=0.9, noise=1.0
)  # PLB_ defaults
FILTERS = (
    "omega_attitude",
    "omega_direction",
    "omega_reference",
    "zeta",
    "believed_tau",
    "believed_delay",
    "wanted_tau",
)
MAX_DELAY = 0.2  # s; a greater margin is reported as this
MAX_GAIN = 101.0
UNSTABLE_RADIUS = 1.0 + 1e-9  # spectral radius from which on a loop is unstable

MOTION = LOAD_STATES  # x_L, v_L, q_x, q_y, their rates, rotation vector, Omega
ROTATION = slice(10, 16)
ROLL = 1  # of the inputs f, M_x, M_y, M_z
# name, coordinates, standard deviation: typical errors of an estimator with motion capture
NOISES = (
    ("load position, m", slice(0, 3), 0.0005),
    ("load velocity, m/s", slice(3, 6), 0.003),
    ("cable direction, rad", slice(6, 8), 0.0007),
    ("cable rate, rad/s", slice(8, 10), 0.008),
    ("attitude, rad", slice(10, 13), 0.002),
    ("body rate, rad/s", slice(13, 16), 0.005),
)


@dataclass(frozen=True)
class Settings:
    """What is varied. Times in seconds."""

    rotor_tau: float = 0.0
    period: float = 0.004
    delay: float = 0.0
    loop: str = "position"
    gains: thesis.ThesisGains = thesis.THESIS_GAINS
    filters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Margin:
    """Margins of one setting; factors, degrees, seconds, rad/s."""

    radius: float
    gain_up: float
    gain_down: float
    phase_deg: float
    crossover: float
    delay: float
    sooner: float  # s, by which the delay may be less

    @property
    def stable(self) -> bool:
        return self.radius < UNSTABLE_RADIUS


def _vec(a: Any) -> tuple[float, float, float]:
    return (float(a[0]), float(a[1]), float(a[2]))


def _flat(memory: thesis.ThesisMemory) -> Array:
    return np.array([number for part in memory for vector in part for number in vector])


def _memory(numbers: Array) -> thesis.ThesisMemory:
    vectors = [_vec(numbers[i : i + 3]) for i in range(0, len(numbers), 3)]
    return thesis.ThesisMemory(*(FilterState(*vectors[i : i + 3]) for i in range(0, len(vectors), 3)))


def law(settings: Settings, vehicle: Vehicle) -> Callable[[Array], Array]:
    """(memory, motion) -> (memory, f, M) of one control tick, as arrays."""
    filters = thesis.thesis_filters(settings.period, **settings.filters)
    reference = Reference((ZERO,) * 7, HEADING)
    above = (0.0, 0.0, vehicle.cable_length)
    vehicle_reference = Reference((above, ZERO, ZERO, ZERO, ZERO, ZERO, ZERO), HEADING)
    level = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    weight = hover_thrust(vehicle)

    def tick(numbers: Array) -> Array:
        memory, state = _memory(numbers[:-MOTION]), state_near_hover(numbers[-MOTION:], vehicle)
        if settings.loop == "attitude":
            after, command = thesis.quad_attitude(
                memory, state, level, weight, settings.gains, filters, vehicle
            )
        elif settings.loop == "vehicle":
            after, command = quad_position(
                memory,
                state,
                vehicle_reference,
                vehicle.load_mass,
                ZERO,
                QUAD_POSITION_GAINS,
                settings.gains,
                filters,
                vehicle,
            )
        else:
            after, command = thesis.load_position(memory, state, reference, settings.gains, filters, vehicle)
        return np.concatenate([_flat(after), [command.thrust], command.moment])

    return tick


def built_law(settings: Settings, vehicle: Vehicle) -> PlumblineLaw:
    """The law, which assumes the delay and lag of the settings, unless `filters` gives others."""
    assumed = {
        "believed_tau": settings.rotor_tau,
        "believed_delay": settings.delay,
        "wanted_tau": TARGET_TAU,
        **settings.filters,
    }
    if settings.gains == thesis.THESIS_GAINS:
        lag = min(assumed["believed_tau"], assumed["wanted_tau"])
        timing = Timing(assumed["believed_delay"], assumed["believed_tau"], lag, settings.period)
        gains = design(TARGETS, timing, vehicle).gains
    else:
        gains = plumbline.PlumblineGains(
            **{n: getattr(settings.gains, n, ZERO) for n in plumbline.PlumblineGains._fields}
        )
    constants = PlumblineConstants(
        gains,
        Drag(0.0, 0.0),
        actuation_constants(assumed["believed_delay"], assumed["believed_tau"], settings.period),
        lag_gain(assumed["believed_tau"], assumed["wanted_tau"], settings.period),
        settings.period,
        vehicle,
        vehicle.cable_length,
    )
    # the other modes have no effect in load position
    filters = thesis.thesis_filters(settings.period)
    other_modes = ThesisLaw(thesis.THESIS_GAINS, filters, QUAD_POSITION_GAINS, vehicle)
    return PlumblineLaw(constants, other_modes, assumed["believed_delay"])


LAW_MEMORY = 8  # thrust rate, rotors' thrust and moment, integral; the commands in transit follow


def plumbline_law(settings: Settings, vehicle: Vehicle) -> tuple[Callable[[Array], Array], Array]:
    """As `law`, and its memory at hover: the thrust's rate, rotors, integral, commands in transit.

    Mass and wind are not estimated here: across the cable their estimate does not depend on the rotors, and
    along it the mass is learned slowly.
    """
    law = built_law(settings, vehicle)
    reference = Reference((ZERO,) * 7, HEADING)
    observed, cable = nominal_in_flight(vehicle), Cable(vehicle.cable_length)
    others = thesis.start(state_near_hover(np.zeros(MOTION), vehicle), ZERO, ZERO)
    assumed_rotors = law.constants.actuation
    rows = assumed_rotors.whole_periods + 1
    weight = hover_thrust(vehicle)

    def tick(numbers: Array) -> Array:
        state = state_near_hover(numbers[-MOTION:], vehicle)
        queue = np.zeros((rows + 1, 4))
        queue[:rows] = numbers[LAW_MEMORY:-MOTION].reshape(rows, 4)
        actuation = Actuation(queue, float(numbers[1]), _vec(numbers[2:5]))
        position = plumbline.PlumblineMemory(float(numbers[0]), _vec(numbers[5:8]), 1.0)
        memory, command = load_position(
            law,
            PlumblineMemory(position, ZERO, 0.0, ZERO, others),
            state,
            reference,
            actuation,
            observed,
            cable,
        )
        after = advance(actuation, command.thrust, command.moment, assumed_rotors)
        return np.array(
            [
                memory.position.thrust_rate,
                after.thrust,
                *after.moment,
                *memory.position.integral,
                *after.queue[:rows].ravel(),
                command.thrust,
                *command.moment,
            ]
        )

    hover = np.zeros(LAW_MEMORY + 4 * rows)
    hover[1] = weight
    hover[LAW_MEMORY::4] = weight
    return tick, hover


def linearised_law(settings: Settings, vehicle: Vehicle) -> tuple[Array, Array, Array, Array]:
    """(A, B, C, D) of the law at hover: memory, motion in; memory, (f, M) out."""
    if settings.loop == "plumbline":
        tick, hover = plumbline_law(settings, vehicle)
    else:
        tick = law(settings, vehicle)
        hover = _flat(thesis.start(state_near_hover(np.zeros(MOTION), vehicle), ZERO, ZERO))
    n = len(hover)
    at = np.concatenate([hover, np.zeros(MOTION)])
    jacobian = np.empty((n + 4, n + MOTION))
    for j in range(n + MOTION):
        step = np.zeros(n + MOTION)
        step[j] = STEP
        jacobian[:, j] = (tick(at + step) - tick(at - step)) / (2.0 * STEP)
    return jacobian[:n, :n], jacobian[:n, n:], jacobian[n:, :n], jacobian[n:, n:]


def plant_of(settings: Settings, vehicle: Vehicle, delay: float) -> tuple[Array, Array, Array]:
    """(A, B, C) of the vehicle from one tick to the next; only of its attitude for the innermost loop."""
    A, B = load_state_space(vehicle)
    if settings.loop != "attitude":
        return sampled_plant(A, B, settings.rotor_tau, delay, settings.period)
    keep = np.r_[ROTATION]
    A_d, B_d, C_d = sampled_plant(A[np.ix_(keep, keep)], B[keep], settings.rotor_tau, delay, settings.period)
    C = np.zeros((MOTION, C_d.shape[1]))
    C[keep] = C_d
    return A_d, B_d, C


def closed_loop(plant_model: tuple[Array, ...], law_model: tuple[Array, ...], closure: Array) -> Array:
    """State matrix of plant and law together; `closure` has a factor for f and each moment: 1 closed,
    0 open."""
    A, B, C = plant_model
    Ac, Bc, Cc, Dc = law_model
    S = np.diag(closure)
    return np.block([[A + B @ S @ Dc @ C, B @ S @ Cc], [Bc @ C, Ac]])


def radius(A: Array) -> float:
    return float(np.max(np.abs(np.linalg.eigvals(A))))


def margin(settings: Settings, vehicle: Vehicle = BEBOP) -> Margin:
    """Margins of one setting."""
    law_model = linearised_law(settings, vehicle)
    plant_model = plant_of(settings, vehicle, settings.delay)
    all_closed = np.ones(4)
    spectral = radius(closed_loop(plant_model, law_model, all_closed))

    roll_open = all_closed.copy()
    roll_open[ROLL] = 0.0
    A = closed_loop(plant_model, law_model, roll_open)
    b = np.concatenate([plant_model[1][:, ROLL], np.zeros(len(law_model[0]))])
    c = np.concatenate([law_model[3][ROLL] @ plant_model[2], law_model[2][ROLL]])
    omega = np.geomspace(0.5, 0.999 * math.pi / settings.period, 1000)
    eye = np.eye(len(A))
    response = [-(c @ np.linalg.solve(np.exp(1j * w * settings.period) * eye - A, b)) for w in omega]
    _, phases, _, _, crossings, _ = control.stability_margins(
        control.FRD(np.array(response), omega), returnall=True
    )
    worst = int(np.argmin(np.abs(phases)))

    def scaled(factor: float) -> bool:
        closure = all_closed.copy()
        closure[ROLL] = factor
        return radius(closed_loop(plant_model, law_model, closure)) < UNSTABLE_RADIUS

    def delayed(extra: float) -> bool:
        delayed_plant = plant_of(settings, vehicle, settings.delay + extra)
        return radius(closed_loop(delayed_plant, law_model, all_closed)) < UNSTABLE_RADIUS

    stable = spectral < UNSTABLE_RADIUS
    return Margin(
        radius=spectral,
        gain_up=boundary(scaled, 1.0, MAX_GAIN) if stable else 1.0,
        gain_down=boundary(scaled, 1.0, 0.0) if stable else 1.0,
        phase_deg=float(phases[worst]),
        crossover=float(crossings[worst]),
        delay=boundary(delayed, 0.0, MAX_DELAY) if stable else 0.0,
        sooner=-boundary(delayed, 0.0, -settings.delay) if stable and settings.delay > 0.0 else 0.0,
    )


def boundary(is_inside: Callable[[float], bool], inside: float, outside: float) -> float:
    """The first value on the way from `inside` to `outside` at which `is_inside` is false, found in 100
    steps and then by bisection; `outside` if there is none."""
    steps = np.linspace(inside, outside, 101)[1:]
    first = next((float(x) for x in steps if not is_inside(float(x))), None)
    if first is None:
        return outside
    low, high = first - (outside - inside) / 100.0, first
    for _ in range(8):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if is_inside(middle) else (low, middle)
    return low


def rotor_noise(settings: Settings, vehicle: Vehicle = BEBOP) -> list[tuple[str, float, float]]:
    """Standard deviation of a rotor command (N; the worst of the four) for each source of white noise
    separately.

    The noise is drawn anew each tick, with the deviation given in NOISES on each coordinate: errors of an
    estimate, not of a sensor. Assumes a stable loop.
    """
    A_p, B_p, C_p = plant_of(settings, vehicle, settings.delay)
    A_c, B_c, C_c, D_c = linearised_law(settings, vehicle)
    A = closed_loop((A_p, B_p, C_p), (A_c, B_c, C_c, D_c), np.ones(4))
    arm, ratio = 2.0 * vehicle.arm, 4.0 * vehicle.torque_ratio
    mixer = np.array(
        [
            [0.25, 0.0, 1.0 / arm, -1.0 / ratio],
            [0.25, -1.0 / arm, 0.0, 1.0 / ratio],
            [0.25, 0.0, -1.0 / arm, -1.0 / ratio],
            [0.25, 1.0 / arm, 0.0, 1.0 / ratio],
        ]
    )
    B = np.vstack([B_p @ D_c, B_c])
    C = mixer @ np.hstack([D_c @ C_p, C_c])
    D = mixer @ D_c
    rows = []
    for name, coordinates, deviation in NOISES:
        W = np.zeros((MOTION, MOTION))
        W[coordinates, coordinates] = deviation**2 * np.eye(MOTION)[coordinates, coordinates]
        P = solve_discrete_lyapunov(A, B @ W @ B.T)
        variance = np.diag(C @ P @ C.T + D @ W @ D.T)
        rows.append((name, deviation, float(np.sqrt(variance.max()))))
    return rows


def row(settings: Settings) -> str:
    result = margin(settings)
    head = f"{settings.rotor_tau * 1e3:6.0f} {1.0 / settings.period:6.0f} {settings.delay * 1e3:6.1f}"
    if not result.stable:
        # the time in which the growing mode grows by a factor of e
        growth = settings.period / math.log(result.radius)
        return f"{head}   lost: grows by e every {growth * 1e3:6.0f} ms"
    return (
        f"{head} {result.gain_up:7.2f} {result.gain_down:7.2f} {result.phase_deg:7.1f}"
        f" {result.crossover:8.1f} {result.delay * 1e3:8.1f} {result.sooner * 1e3:8.1f}"
    )


def table(grid: Iterable[Settings]) -> str:
    title = (
        " tau_ms     Hz  delay gain up    down   phase crossing    delay   sooner\n"
        "                    ms  factor  factor     deg    rad/s  left ms       ms"
    )
    return "\n".join([title, *(row(settings) for settings in grid)])


def parsed_gains(pairs: Iterable[str]) -> tuple[thesis.ThesisGains, dict[str, float]]:
    """Gains and filter arguments from NAME=VALUE: fields of ThesisGains, arguments of thesis_filters."""
    gains: dict[str, Any] = {}
    filters: dict[str, float] = {}
    for pair in pairs:
        name, _, text = pair.partition("=")
        value = float(text)
        if name in thesis.ThesisGains._fields:
            is_vector = isinstance(getattr(thesis.THESIS_GAINS, name), tuple)
            gains[name] = (value,) * 3 if is_vector else value
        elif name in FILTERS:
            filters[name] = value
        else:
            raise SystemExit(
                f"--set {pair}: unknown name; allowed: {', '.join((*thesis.ThesisGains._fields, *FILTERS))}"
            )
    return thesis.THESIS_GAINS._replace(**gains), filters


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--loop", choices=LOOPS, help="default: all")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="gain or filter")
    arguments = parser.parse_args()
    gains, filters = parsed_gains(arguments.set)
    loops = LOOPS if arguments.loop is None else (arguments.loop,)
    for loop in loops:
        print(f"\n{loop} loop, {' '.join(arguments.set) or 'gains of Table 4-3, filters of 4-3'}")
        grid = [
            Settings(tau * 1e-3, 1.0 / hz, delay * 1e-3, loop, gains, filters)
            for tau, hz, delay in (
                *((tau, 250, 0) for tau in (0, 5, 10, 15, 20, 30, 40)),
                *((tau, 1000, 0) for tau in (0, 10, 20, 30)),
                *((tau, 100, 0) for tau in (0, 10, 20)),
                *((tau, 250, delay) for tau in (0, 10, 20) for delay in (4, 8, 12)),
                *(((30, 250, 12), (20, 250, 72)) if loop == "plumbline" else ()),
            )
        ]
        print(table(grid))
    for loop in loops:
        if loop in ("position", "plumbline"):
            for tau, delay in ((20, 0), (30, 12), (20, 72)) if loop == "plumbline" else ((20, 0),):
                print(f"\n{loop} loop: {NOISE_TITLE}, rotor lag {tau} ms, delay {delay} ms")
                print_noise(Settings(1e-3 * tau, 0.004, 1e-3 * delay, loop, gains, filters))


NOISE_TITLE = "rotor command, standard deviation, for noise white from tick to tick; 250 Hz"


def print_noise(settings: Settings) -> None:
    if not margin(settings).stable:
        print("  none: the loop is lost")
        return
    noises = rotor_noise(settings)
    for name, deviation, newtons in noises:
        print(f"  {name:22s} {deviation:8.4f} {newtons:8.4f} N")
    total = math.sqrt(sum(newtons**2 for _, _, newtons in noises))
    headroom = min(BEBOP.rotor_max - HOVER, HOVER - BEBOP.rotor_min)
    print(f"  {'all together':31s} {total:8.4f} N; three of them should fit into {headroom:.2f} N")


if __name__ == "__main__":
    main()
