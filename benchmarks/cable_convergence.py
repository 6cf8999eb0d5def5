"""The cable of links compared with theory: hanging-chain frequencies, error of the step, massless limit.

    python benchmarks/cable_convergence.py              # all tables
    python benchmarks/cable_convergence.py --mujoco     # also compare with MuJoCo (pip install mujoco)
    python benchmarks/cable_convergence.py --json

Frequencies are those of the simulation step itself: its Jacobian about a cable at rest is computed by
differences, and the eigenvalues exp(lambda h) of the Jacobian give frequency and damping as simulated.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import j0, j1, jn_zeros, y0, y1

from autopilot.geometry.linear import ZERO, Vec3
from sitl.plant.by_value import advance as advance_taut
from sitl.plant.by_value import initial_state as initial_taut
from sitl.plant.by_value import rotors_of
from sitl.plant.chain.records import ChainRows, lay_straight, new_chain
from sitl.plant.chain.step import advance_chain_many
from sitl.plant.records import ChainModel, PlantState, Truth
from sitl.plant.rotors import RotorRows
from sitl.plant.step import initial_state
from sitl.vehicles.truth import load_truth

Array = NDArray[np.float64]

TICK = 4e-3  # s
LINKS = (4, 8, 16, 32, 64)
MODES = 3
STEPS = (4e-4, 2e-4, 1e-4, 5e-5)  # s
STIFFNESSES = (1e4, 1e5, 1e6, 1e7)  # N
_SHORT_STEP = 5e-4  # s, shorter than half a period of every mode
_LOAD_HEIGHT = 3.0  # m, of the load
_FIXED_MASS = 1e9  # kg, of a vehicle that nothing can move
_NO_LOAD_MASS = 1e-9  # kg, instead of no load


def chain_model(links: int, **values: float) -> ChainModel:
    """A cord of 2.4 g/m without drag and with little damping, except for `values`."""
    known = ChainModel(links, 2.4e-3, 0.0, 1e5, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return known._replace(**values)


def without_drag(truth: Truth) -> Truth:
    """The same vehicle without drag."""
    return truth._replace(
        quad_drag=0.0, quad_drag_quadratic=0.0, spin_drag=0.0, load_drag=0.0, load_drag_quadratic=0.0
    )


@dataclass
class ChainPlant:
    """The plant with a cable of links, laid straight between the bodies of `state`, and rotors at `force`."""

    truth: Truth
    state: PlantState
    force: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    wind: Vec3 = ZERO
    rows: ChainRows = field(init=False)
    rotors: RotorRows = field(init=False)

    def __post_init__(self) -> None:
        rows = new_chain(self.truth, self.state)
        if rows is None:
            raise ValueError("truth.chain.links = 0; must be 1 or more")
        self.rows, self.rotors = rows, rotors_of(self.force, self.force)

    def fly(self, seconds: float, h: float = TICK) -> PlantState:
        """Simulate for a time; returns the state at its end."""
        steps = round(seconds / h)
        self.state = advance_chain_many(self.state, self.truth, self.rotors, self.wind, h, self.rows, steps)
        return self.state

    def energy(self) -> float:
        """Kinetic, potential and elastic energy, J."""
        truth, state, rows, model = self.truth, self.state, self.rows, self.truth.chain
        n = len(rows.link)
        rest = float(rows.held[1]) / n
        half = 0.5 * model.mass * rest
        masses = np.full(n + 1, 2.0 * half)
        masses[[0, n]] = truth.quad_mass + half, truth.load_mass + half
        x, v = rows.x.copy(), rows.v.copy()
        x[[0, n]], v[[0, n]] = (state.x_quad, state.x_load), (state.v_quad, state.v_load)
        moments = truth.load_mass * np.array([model.gyration, model.gyration, model.gyration_upright]) ** 2
        spins = np.array([state.omega_body, rows.body[4:7]]) ** 2
        rotation = 0.5 * (spins[0] @ np.array(truth.inertia) + spins[1] @ moments)
        stretch = np.linalg.norm(np.diff(rows.x, axis=0), axis=1) - rest
        elastic = 0.5 * model.stiffness / rest * (np.maximum(stretch, 0.0) ** 2).sum()
        translation = 0.5 * masses @ (v**2).sum(axis=1) + truth.gravity * (masses @ x[:, 2])
        return float(translation + rotation + elastic)


def suspended(truth: Truth, q: tuple[float, float, float] = (0.0, 0.0, -1.0), **fields: Any) -> PlantState:
    """Taut and aloft, the load at rest at `_LOAD_HEIGHT`, q from vehicle to load."""
    direction = np.array(q) / np.linalg.norm(q)
    x_load = np.array([0.0, 0.0, _LOAD_HEIGHT])
    x_quad = x_load - truth.cable_length * direction - np.array(truth.attachment)
    state = initial_state(truth)._replace(
        x_load=tuple(x_load.tolist()),
        x_quad=tuple(x_quad.tolist()),
        q_cable=tuple(direction.tolist()),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )
    return state._replace(**fields)


def hover(truth: Truth) -> tuple[float, ...]:
    """The rotor forces that carry vehicle, cable and load."""
    weight = truth.quad_mass + truth.load_mass + truth.chain.mass * truth.cable_length
    return (0.25 * weight * truth.gravity,) * 4


# ---- frequencies of a hanging cable


def bessel_frequencies(length: float, mass: float, load: float, gravity: float) -> Array:
    """The lowest frequencies (rad/s) of a chain of `mass` kg/m, fixed at its top, that carries `load` kg.

    With s = load/mass + z, where z is the height above the load, the tension is mass g s, and the shape is
    y = a J0(w) + b Y0(w) with w = 2 omega sqrt(s/g). It is 0 at the top; at the load, where s = s_0 =
    load/mass, g dy/ds = -omega^2 y. Without a load the frequencies are the zeros of J0(2 omega sqrt(L/g)).
    """
    if load <= _NO_LOAD_MASS:
        return np.asarray(jn_zeros(0, MODES) / 2.0 * np.sqrt(gravity / length))
    below, above = load / mass, load / mass + length

    def boundary(omega: float) -> float:
        a, b = 2.0 * omega * np.sqrt(below / gravity), 2.0 * omega * np.sqrt(above / gravity)
        # at the load: g dy/ds = -omega^2 y, so that Z1(a) = omega sqrt(s_0/g) Z0(a) = a/2 Z0(a)
        first = -j1(a) + 0.5 * a * j0(a)
        second = -y1(a) + 0.5 * a * y0(a)
        return float(first * y0(b) - second * j0(b))

    grid = np.linspace(0.3, 60.0, 6000) * np.sqrt(gravity / length)
    signs = np.array([boundary(omega) for omega in grid])
    found = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)[:MODES]
    return np.array([brentq(boundary, grid[i], grid[i + 1], xtol=1e-14) for i in found])


def simulated_frequencies(
    links: int, mass: float, load: float, length: float = 1.0
) -> NDArray[np.complex128]:
    """The slowest transverse modes of a hanging cable, as simulated: damping (negative), frequency, rad/s."""
    # stiff enough that its weight hardly stretches it, soft enough for a difference quotient; soon at rest
    model = chain_model(links, mass=mass, stiffness=1e5, damping=30.0)
    truth = without_drag(load_truth("bebop"))._replace(
        chain=model,
        load_mass=load,
        quad_mass=_FIXED_MASS,
        cable_length=length,
        rotor_max=np.inf,
        rotor_tau=0.0,
        load_radius=1e-3,
    )
    plant = ChainPlant(truth, suspended(truth), hover(truth))
    plant.fly(0.6)
    rest, rows = plant.state, [array.copy() for array in plant.rows]
    inner, load_at = slice(1, links), links - 1
    eps = 1e-7

    def state_after(shift: Array) -> Array:
        for array, original in zip(plant.rows, rows, strict=True):
            array[...] = original
        plant.rows.x[inner, 0] += shift[:load_at]
        plant.rows.v[inner, 0] += shift[links:-1]
        (x, *x_rest), (v, *v_rest) = rest.x_load, rest.v_load
        plant.state = rest._replace(
            x_load=(x + float(shift[load_at]), *x_rest), v_load=(v + float(shift[-1]), *v_rest)
        )
        end = plant.fly(_SHORT_STEP, _SHORT_STEP)
        x_end, v_end = plant.rows.x[inner, 0], plant.rows.v[inner, 0]
        return np.concatenate([x_end, end.x_load[:1], v_end, end.v_load[:1]])

    columns = [(state_after(eps * e) - state_after(-eps * e)) / (2.0 * eps) for e in np.eye(2 * links)]
    found = np.log(np.linalg.eigvals(np.array(columns).T).astype(complex)) / _SHORT_STEP
    found = found[found.imag > 0.0]
    return np.asarray(found[np.argsort(found.imag)][:MODES])


def frequency_errors(links: int, mass: float, load: float) -> Array:
    """Relative errors of the lowest frequencies of a cable of 1 m."""
    exact = bessel_frequencies(1.0, mass, load, load_truth("bebop").gravity)
    return simulated_frequencies(links, mass, load).imag / exact - 1.0


# ---- motion


def swinging_plant(model: ChainModel, attachment: Vec3 = ZERO) -> ChainPlant:
    """A vehicle that carries its load in the air, without drag; the cable is inclined and rotating."""
    truth = without_drag(load_truth("bebop"))._replace(chain=model, attachment=attachment)
    direction = np.array([0.3, 0.0, -0.95]) / np.hypot(0.3, 0.95)
    rate = (0.0, 1.5, 0.0)
    start = suspended(truth, tuple(direction.tolist()), q_cable_dot=rate)
    start = start._replace(v_quad=(0.0, -1.5 * truth.cable_length, 0.0))
    return ChainPlant(truth, start, hover(truth))


def step_errors(links: int = 4) -> list[float]:
    """For each step the greatest error (m) of the load within 1 s, relative to a quarter of the shortest."""
    model = chain_model(links, stiffness=2e3, damping=2.0)

    def trajectory(h: float) -> Array:
        plant = swinging_plant(model)
        return np.array([plant.fly(0.02, h).x_load for _ in range(50)])

    reference = trajectory(STEPS[-1] / 4.0)
    return [float(np.abs(trajectory(h) - reference).max()) for h in STEPS]


def massless_difference(stiffness: float, h: float = TICK, attachment: Vec3 = ZERO) -> tuple[float, float]:
    """Differences of one link from the taut plant: greatest of load position in 1 s, m; final tension, N."""
    plant = swinging_plant(
        chain_model(1, mass=0.0, stiffness=stiffness, damping=1e-4 * stiffness), attachment
    )
    taut: Any = initial_taut(plant.truth)._replace(**plant.state._asdict(), rotor_force=plant.force)
    largest = 0.0
    for _ in range(round(1.0 / h)):
        state = plant.fly(h, h)
        taut = advance_taut(taut, plant.truth, plant.force, ZERO, h)
        largest = max(largest, float(np.abs(np.subtract(state.x_load, taut.x_load)).max()))
    return largest, abs(state.tension - taut.tension)


# ---- compared with MuJoCo


def mujoco_xml(truth: Truth, timestep: float) -> str:
    """The same bodies, with the links as rods connected by ball joints."""
    model, n = truth.chain, truth.chain.links
    link = (truth.cable_length - model.hook) / n
    half = 0.5 * model.mass * link
    across = truth.load_mass * model.gyration**2
    upright = truth.load_mass * model.gyration_upright**2

    def body(name: str, place: float, joint: str, centre: float, mass: float, moments: str) -> str:
        return (
            f'<body name="{name}" pos="0 0 {-place}">{joint}'
            f'<inertial pos="0 0 {-centre}" mass="{mass}" diaginertia="{moments}"/>'
        )

    ball, none = '<joint type="ball"/>', "1e-11 1e-11 1e-11"
    moments = " ".join(map(str, truth.inertia))
    parts = [body("quad", 0.0, "<freejoint/>", 0.0, truth.quad_mass + half, moments)]
    parts.append('<site name="thrust"/>')
    for i in range(1, n + 1):
        mass = 2.0 * half if i < n else 1e-11
        parts.append(body(f"point{i}", 0.0 if i == 1 else link, ball, link, mass, none))
    moments = f"{across} {across} {upright}"
    parts.append(body("load", link, ball, model.hook, truth.load_mass + half, moments))
    return (
        f'<mujoco><option gravity="0 0 {-truth.gravity}" timestep="{timestep}" integrator="RK4"/>'
        f"<worldbody>{''.join(parts)}{'</body>' * (n + 2)}</worldbody>"
        '<actuator><motor site="thrust" gear="0 0 1 0 0 0"/></actuator></mujoco>'
    )


def mujoco_difference(links: int, stiffness: float, seconds: float = 1.0) -> tuple[float, float, float]:
    """Greatest differences to MuJoCo: load and points (m), vehicle (m), orientation of the load (rad).

    A tilted vehicle flies off with constant thrust; the cable is inclined and rotates, and so does the load.
    """
    import mujoco

    model = chain_model(
        links,
        mass=0.02,
        stiffness=stiffness,
        damping=1e-5 * stiffness,
        hook=0.05,
        gyration=0.03,
        gyration_upright=0.03,
    )
    truth = without_drag(load_truth("bebop"))._replace(chain=model, rotor_tau=0.0)
    timestep = TICK / 16
    scene = mujoco.MjModel.from_xml_string(mujoco_xml(truth, timestep))
    data = mujoco.MjData(scene)
    data.qpos[:7] = 0.0, 0.0, _LOAD_HEIGHT, np.cos(0.1), 0.0, np.sin(0.1), 0.0
    data.qpos[7:11] = np.cos(0.15), 0.0, np.sin(0.15), 0.0
    data.qvel[0] = 0.5
    data.qvel[6:9] = 1.0, 0.5, 0.0
    data.ctrl[0] = sum(hover(truth))
    mujoco.mj_forward(scene, data)
    load = scene.body("load").id
    points = [scene.body(f"point{i}").id for i in range(1, links)]

    def velocity(body: int) -> tuple[Array, Array]:
        along, about = np.zeros((3, scene.nv)), np.zeros((3, scene.nv))
        mujoco.mj_jacBodyCom(scene, data, along, about, body)
        return along @ data.qvel, about @ data.qvel

    v_load, spin = velocity(load)
    start = suspended(
        truth,
        x_quad=tuple(data.qpos[:3].tolist()),
        v_quad=tuple(data.qvel[:3].tolist()),
        quat_wxyz=tuple(data.qpos[3:7].tolist()),
        x_load=tuple(data.xipos[load].tolist()),
        v_load=tuple(v_load.tolist()),
    )
    plant = ChainPlant(truth, start, hover(truth))
    plant.rows.body[:4] = data.xquat[load]
    plant.rows.body[4:] = data.xmat[load].reshape(3, 3).T @ spin
    lay_straight(plant.rows, truth, start)
    for i, body in enumerate(points, 1):
        plant.rows.x[i], plant.rows.v[i] = data.xipos[body], velocity(body)[0]
    differences = []
    for _ in range(round(seconds / TICK)):
        state = plant.fly(TICK)
        for _ in range(16):
            mujoco.mj_step(scene, data)
        mujoco.mj_kinematics(scene, data)
        mujoco.mj_comPos(scene, data)
        ours = np.array([state.x_load, *plant.rows.x[1:links]])
        theirs = data.xipos[[load, *points]]
        alignment = np.abs(plant.rows.body[:4] @ data.xquat[load])  # 1 - angle^2 / 8
        differences.append(
            (
                np.abs(ours - theirs).max(),
                np.abs(np.subtract(state.x_quad, data.qpos[:3])).max(),
                np.sqrt(max(0.0, 8.0 * (1.0 - alignment))),
            )
        )
    found = np.array(differences).max(axis=0).tolist()
    return found[0], found[1], found[2]


# ---- tables


def _tables(with_mujoco: bool) -> dict[str, Any]:
    tables: dict[str, Any] = {
        "a chain without load: relative error of frequencies 1, 2, 3": {
            str(n): frequency_errors(n, 0.01, _NO_LOAD_MASS).tolist() for n in LINKS
        },
        "a cord of 2.4 g/m with a load of 100 g: the same": {
            str(n): frequency_errors(n, 2.4e-3, 0.1).tolist() for n in LINKS
        },
        "error of the step, m, within 1 s (4 links, EA 2 kN)": {
            f"{1e3 * h:g} ms": [error] for h, error in zip(STEPS, step_errors(), strict=True)
        },
        "one massless link beside the taut plant within 1 s: place, m; tension, N": {
            f"EA {ea:g} N": list(massless_difference(ea)) for ea in STIFFNESSES
        },
    }
    if with_mujoco:
        tables["beside MuJoCo within 1 s: cable and load, m; vehicle, m; posture of the load, rad"] = {
            f"{n} links, EA {ea:g} N": list(mujoco_difference(n, ea))
            for n in (1, 3, 6)
            for ea in STIFFNESSES[:3]
        }
    return tables


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--mujoco", action="store_true", help="compare with MuJoCo too")
    parser.add_argument("--json", action="store_true", help="print the tables as JSON")
    args = parser.parse_args()
    tables = _tables(args.mujoco)
    if args.json:
        json.dump(tables, sys.stdout, indent=1)
        return 0
    for title, rows in tables.items():
        print(title)
        for name, numbers in rows.items():
            print(f"  {name:<22}" + "".join(f"{number:>12.2e}" for number in numbers))
    return 0


if __name__ == "__main__":
    sys.exit(main())
