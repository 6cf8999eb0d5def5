"""What the control tests share: an independent NumPy model of the vehicle with its load, and plain-Python
copies of the laws that may be altered before they are run.

The model is written from (2-30)-(2-35) with arrays, and shares no function with the laws or the geometry
leaf.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

import autopilot
from autopilot.control.records import State, Vehicle

INF = float("inf")
ROOM = Path(autopilot.__file__).parent
# in the order in which they import each other
LAW_FILES = (
    "control/command_filter.py",
    "control/quad_attitude.py",
    "control/load_attitude.py",
    "control/load_position.py",
    "control/height.py",
    "control/thesis.py",
    "control/quad_position.py",
    "mixer.py",
)
JIT_IMPORT = "from autopilot.geometry.kernel import kernel"


def vec(a: Any) -> tuple[float, float, float]:
    return (float(a[0]), float(a[1]), float(a[2]))


def mat(A: Any) -> tuple[tuple[float, float, float], ...]:
    return (vec(A[0]), vec(A[1]), vec(A[2]))


def hat(v: Any) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rodrigues(v: Any) -> np.ndarray:
    """exp(hat(v)) for any v."""
    angle = float(np.linalg.norm(v))
    if angle == 0.0:
        return np.eye(3)
    K = hat(np.asarray(v) / angle)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def unit(v: Any) -> np.ndarray:
    return np.asarray(v) / np.linalg.norm(v)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Uniform on SO(3): QR of a Gaussian matrix with the signs of the diagonal taken out."""
    Q, T = np.linalg.qr(rng.normal(size=(3, 3)))
    Q = Q * np.sign(np.diag(T))
    return Q if np.linalg.det(Q) > 0 else -Q


def rates(y: np.ndarray, f: float, M: Any, vehicle: Vehicle) -> np.ndarray:
    """dy/dt by (2-30)-(2-35); y = x_L, v_L, q, omega, R row by row, Omega (24 numbers)."""
    q, w, R, W = y[6:9], y[9:12], y[12:21].reshape(3, 3), y[21:24]
    m_Q, L, J = vehicle.quad_mass, vehicle.cable_length, np.array(vehicle.inertia)
    force = f * R[:, 2]
    q_dot = np.cross(w, q)
    total = m_Q + vehicle.load_mass
    a = (q @ force - m_Q * L * (q_dot @ q_dot)) * q / total - np.array([0.0, 0.0, vehicle.gravity])
    w_dot = -np.cross(q, force) / (m_Q * L)
    W_dot = (np.asarray(M) - np.cross(W, J * W)) / J
    return np.concatenate([y[3:6], a, q_dot, w_dot, (R @ hat(W)).ravel(), W_dot])


def rk4(y: np.ndarray, f: float, M: Any, vehicle: Vehicle, dt: float) -> np.ndarray:
    """One step with the inputs held, q and R pulled back to their manifolds."""
    k1 = rates(y, f, M, vehicle)
    k2 = rates(y + 0.5 * dt * k1, f, M, vehicle)
    k3 = rates(y + 0.5 * dt * k2, f, M, vehicle)
    k4 = rates(y + dt * k3, f, M, vehicle)
    y = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    y[6:9] = unit(y[6:9])
    U, _, Vt = np.linalg.svd(y[12:21].reshape(3, 3))
    y[12:21] = (U @ Vt).ravel()
    return y


def pack(x: Any, v: Any, q: Any, w: Any, R: Any, W: Any) -> np.ndarray:
    return np.concatenate([np.asarray(p, dtype=float).ravel() for p in (x, v, q, w, R, W)])


def state_of(y: np.ndarray, vehicle: Vehicle) -> State:
    """The record that the laws take."""
    q_dot = np.cross(y[9:12], y[6:9])
    L = vehicle.cable_length
    return State(
        vec(y[0:3]),
        vec(y[3:6]),
        vec(y[6:9]),
        vec(q_dot),
        vec(y[0:3] - L * y[6:9]),
        vec(y[3:6] - L * q_dot),
        mat(y[12:21].reshape(3, 3)),
        vec(y[21:24]),
    )


def sources() -> dict[str, str]:
    """Source text of the laws, by file."""
    return {name: (ROOM / name).read_text() for name in LAW_FILES}


def plain_laws(texts: dict[str, str]) -> SimpleNamespace:
    """The laws of these source texts as plain Python, compiled by nobody; all their names in one
    namespace, and the modules by file as `modules`."""
    namespace = SimpleNamespace()
    kept, modules = {}, {}
    try:
        for name, text in texts.items():
            module_name = "autopilot." + name[:-3].replace("/", ".")
            assert JIT_IMPORT in text
            module = modules[name] = ModuleType(module_name)
            kept[module_name] = sys.modules.get(module_name)
            sys.modules[module_name] = module
            plain = text.replace(JIT_IMPORT, "kernel = lambda function: function")
            exec(compile(plain, name, "exec"), module.__dict__)
            vars(namespace).update(vars(module))
    finally:
        for module_name, module_kept in kept.items():
            if module_kept is None:
                del sys.modules[module_name]
            else:
                sys.modules[module_name] = module_kept
    namespace.modules = modules
    return namespace


@contextmanager
def with_function(laws: SimpleNamespace, file: str, function: ast.FunctionDef) -> Iterator[None]:
    """Plain laws with this in place of their function of that name, in all that use it."""
    original = vars(laws.modules[file])[function.name]
    made: dict[str, Any] = {}
    source = ast.Module([function], [])
    exec(compile(source, file, "exec"), vars(laws.modules[file]), made)
    users = [scope for scope in (laws, *laws.modules.values()) if vars(scope).get(function.name) is original]
    try:
        for scope in users:
            setattr(scope, function.name, made[function.name])
        yield
    finally:
        for scope in users:
            setattr(scope, function.name, original)


ORACLE = json.loads((Path(__file__).parent / "gcdf_circle.json").read_text())


def oracle_vehicle() -> Vehicle:
    p = ORACLE["params"]
    J = np.diag(np.array(p["J"]))
    return Vehicle(p["mQ"], p["mL"], p["l"], vec(J), p["g"], 0.1, 0.01, -INF, INF)


def oracle_start() -> np.ndarray:
    y0 = ORACLE["y0"]
    R = np.array(y0["R_colmajor"]).reshape(3, 3).T
    return pack(y0["xL"], y0["vL"], y0["q"], y0["omega"], R, y0["Omega"])


def oracle_command(laws: Any, t: float, y: np.ndarray) -> tuple[float, Any, Any]:
    """Thrust, attitude result and direction result of the published cascade: the laws without filters, and
    the derivatives of q_c and R_c taken from the path (its flatness), as there.

    On x_d = 3 [sin t, cos t, 1] the tension per mass has constant length n = sqrt(9 + g^2), so that q and the
    nominal force are a few sines.
    """
    gains, vehicle = ORACLE["gains"], oracle_vehicle()
    g, m_Q, m_L, L = vehicle.gravity, vehicle.quad_mass, vehicle.load_mass, vehicle.cable_length
    # derivatives of the path, 0 to 6
    d = [
        3.0 * np.array([np.sin(t + k * np.pi / 2), np.cos(t + k * np.pi / 2), 1.0 if k == 0 else 0.0])
        for k in range(7)
    ]
    n = np.sqrt(9.0 + g * g)
    up = np.array([0.0, 0.0, g])
    q_dot, q_ddot = -d[3] / n, -d[4] / n
    # F = m_Q (a - L q'' + g e3) + m_L (a + g e3), with a = x_d'' and q'' = -x_d^(4)/n
    F = [(m_Q + m_L) * (d[2 + k] + (up if k == 0 else 0.0)) + m_Q * L / n * d[4 + k] for k in range(3)]
    e1, zero = (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    nominal = laws.attitude_from_axes(*(vec(F_k) for F_k in F), e1, zero, zero)

    s = state_of(y, vehicle)
    position = laws.load_position_force(
        s.x_load,
        s.v_load,
        s.q_cable,
        s.q_cable_dot,
        *(vec(d[k]) for k in range(3)),
        vec(np.diag(np.array(gains["k1"]))),
        vec(np.diag(np.array(gains["k2"]))),
        m_Q,
        m_L,
        L,
        g,
    )
    direction = laws.load_attitude_force(
        s.q_cable,
        s.q_cable_dot,
        laws.DirectionCommand(laws.computed_direction(position.A), vec(q_dot), vec(q_ddot)),
        laws.normal_force_tracking(s.q_cable, position.A),
        -gains["kq"],  # printed there with the opposite sign
        -gains["kom"],
        m_Q,
        L,
    )
    R_c = laws.attitude_towards(direction.F, e1, s.R)
    result = laws.attitude_moment(
        s.R,
        s.omega_body,
        laws.AttitudeCommand(R_c, nominal.Omega_c, nominal.Omega_c_dot),
        vec(np.diag(np.array(gains["kR"]))),
        vec(np.diag(np.array(gains["kO"]))),
        1.0,
        vehicle.inertia,
    )
    return laws.thrust_along(direction.F, s.R), result, direction


def load_proofs() -> tuple[Callable[..., None], ...]:
    spec = importlib.util.spec_from_file_location("control_proofs", Path(__file__).parent / "proofs.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return tuple(module.PROOFS)


PROOFS = load_proofs()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "proof" in metafunc.fixturenames:
        metafunc.parametrize("proof", PROOFS, ids=[proof.__name__ for proof in PROOFS])


@pytest.fixture(scope="session")
def proofs() -> tuple[Callable[..., None], ...]:
    return PROOFS


@pytest.fixture(scope="session")
def bebop() -> Vehicle:
    """Table 4-1."""
    return Vehicle(0.4, 0.1, 0.7, (2.23e-3, 2.99e-3, 4.8e-3), 9.81, 0.126, 0.016, 0.0, 1.96)


@pytest.fixture(scope="session")
def model() -> SimpleNamespace:
    """The independent model and its helpers."""
    functions: tuple[Callable[..., Any], ...] = (
        vec,
        mat,
        hat,
        rodrigues,
        unit,
        random_rotation,
        rates,
        rk4,
        pack,
        state_of,
        sources,
        plain_laws,
        with_function,
        oracle_vehicle,
        oracle_start,
        oracle_command,
    )
    return SimpleNamespace(oracle=ORACLE, **{function.__name__: function for function in functions})


@pytest.fixture(scope="session")
def laws(model: SimpleNamespace) -> SimpleNamespace:
    """The unaltered laws as plain Python."""
    return model.plain_laws(model.sources())
