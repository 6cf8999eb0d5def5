"""The published closed loop (Sreenath, Lee, Kumar) flown by the laws in continuous time.

The equations of motion are the independent model's; the laws are the compiled ones that fly. The attitude
gains make the loop stiff (its fastest mode is 17 000 rad/s), hence the implicit solver.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp

from autopilot.control import load_attitude, load_position, quad_attitude
from autopilot.control import thesis_cascade as thesis

# relative, on |e_x|; the oracle's own solvers agree to 7e-9 m, its smallest |e_x| is 4e-4 m
POSITION = 1e-6
# the other samples: the solvers' agreement, carried through gains of 400 N m
OTHERS = 2e-6
DRIFT = 1e-7  # of |q| and R^T R over 10 s, where nothing pulls them back


def compiled_laws() -> SimpleNamespace:
    names: dict[str, object] = {}
    for module in (load_attitude, load_position, quad_attitude, thesis):
        names.update(vars(module))
    return SimpleNamespace(**names)


def test_published_flight_is_reproduced(model: SimpleNamespace) -> None:
    laws, vehicle, samples = compiled_laws(), model.oracle_vehicle(), model.oracle["samples"]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        f, attitude, _ = model.oracle_command(laws, t, y)
        return model.rates(y, f, attitude.moment, vehicle)

    times = [sample["t"] for sample in samples]
    solution = solve_ivp(
        rates, (0.0, times[-1]), model.oracle_start(), "LSODA", t_eval=times, rtol=1e-12, atol=1e-13
    )
    assert solution.success, solution.message
    for sample, y in zip(samples, solution.y.T, strict=True):
        t = sample["t"]
        e_x = np.linalg.norm(y[0:3] - 3.0 * np.array([np.sin(t), np.cos(t), 1.0]))
        f, attitude, direction = model.oracle_command(laws, t, y)
        np.testing.assert_allclose(e_x, sample["ex"], rtol=POSITION, err_msg=f"t = {t}")
        np.testing.assert_allclose(y[0:3], sample["xL"], atol=OTHERS)
        np.testing.assert_allclose(y[6:9], sample["q"], atol=OTHERS)
        np.testing.assert_allclose(f, sample["f"], atol=OTHERS)
        np.testing.assert_allclose(direction.psi_q, sample["Psi_q"], atol=OTHERS)
        np.testing.assert_allclose(attitude.psi_R, sample["Psi_R"], atol=OTHERS)
        R = y[12:21].reshape(3, 3)
        np.testing.assert_allclose(R.T @ R, np.eye(3), atol=DRIFT)
