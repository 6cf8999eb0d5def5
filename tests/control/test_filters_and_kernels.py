"""The command filter against SciPy, its refusals, and compiled laws against the same text in plain Python."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lsim

from autopilot.control import command_filter, quad_position
from autopilot.control import thesis_cascade as thesis
from autopilot.control.actuators import mixer
from autopilot.control.records import Reference, Vehicle
from tests.doubles.mixing import mix

SCIPY = 1e-10  # lsim's own matrix exponential, over 500 steps


@pytest.mark.parametrize(
    ("omega_n", "zeta", "dt"), [(30.0, 0.98, 0.004), (25.0, 1.0, 0.01), (25.0, 1.7, 0.002)]
)
def test_filter_agrees_with_scipy(omega_n: float, zeta: float, dt: float) -> None:
    """(4-3) driven by a command that changes linearly between samples, which lsim assumes too."""
    rng = np.random.default_rng(3)
    u = np.cumsum(rng.normal(size=500)) * 0.05
    t = np.arange(len(u)) * dt
    A = np.array([[0.0, 1.0], [-(omega_n**2), -2.0 * zeta * omega_n]])
    B = np.array([[0.0], [omega_n**2]])
    _, _, x = lsim((A, B, np.eye(2), np.zeros((2, 1))), u, t, X0=[u[0], 0.4])
    constants = command_filter.filter_constants(omega_n, zeta, dt)
    state = command_filter.filter_start((u[0], 0.0, 0.0), (0.4, 0.0, 0.0))
    for k in range(1, len(u)):
        state = command_filter.filter_step(state, (float(u[k]), 0.0, 0.0), constants)
        np.testing.assert_allclose((state.x1[0], state.x2[0]), x[k], atol=SCIPY * omega_n)


@pytest.mark.parametrize(
    ("omega_n", "zeta", "dt"), [(0.0, 1.0, 0.004), (30.0, -1.0, 0.004), (30.0, 1.0, 0.0)]
)
def test_filter_refuses_what_is_no_filter(omega_n: float, zeta: float, dt: float) -> None:
    with pytest.raises(ValueError, match=r"omega_n = .* rad/s, zeta = .*, dt = .* s; all three must be > 0"):
        command_filter.filter_constants(omega_n, zeta, dt)


def test_compiled_laws_are_the_plain_ones_to_the_bit(
    model: SimpleNamespace, laws: SimpleNamespace, bebop: Vehicle
) -> None:
    """Twenty ticks of every mode and the mixer, from a swinging state, compiled and in plain Python."""
    rng = np.random.default_rng(5)
    zero, heading = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    gains, filters = thesis.THESIS_GAINS, thesis.thesis_filters(0.004)
    position_gains = quad_position.QUAD_POSITION_GAINS
    down, level = (0.0, 0.0, -1.0), model.mat(np.eye(3))
    hover = model.state_of(model.pack(zero, zero, down, zero, np.eye(3), zero), bebop)
    memories = [thesis.start(hover, zero, zero)] * 2
    compiled = SimpleNamespace(
        load_position=thesis.load_position,
        load_attitude=thesis.load_attitude,
        quad_attitude=thesis.quad_attitude,
        quad_position=quad_position.quad_position,
        mix=mixer.mix,
        new_rotors=mixer.new_rotors,
        FORCE=mixer.FORCE,
    )
    for _ in range(20):
        x, v, w, W, x_d, bend, phi = rng.normal(size=(7, 3))
        q = model.unit(0.3 * bend - [0, 0, 1])
        state = model.state_of(model.pack(x, v, q, np.cross(q, w), model.rodrigues(0.3 * phi), W), bebop)
        reference = Reference((model.vec(x_d),) + (zero,) * 6, heading)
        results = []
        for n, room in enumerate((compiled, laws)):
            memory, first = room.load_position(memories[n], state, reference, gains, filters, bebop)
            memory, second = room.load_attitude(memory, state, down, heading, 5.0, gains, filters, bebop)
            memory, third = room.quad_attitude(memory, state, level, 5.0, gains, filters, bebop)
            memory, fourth = room.quad_position(
                memory, state, reference, 0.1, zero, position_gains, gains, filters, bebop
            )
            memories[n] = memory
            mixed = mix(first.thrust, first.moment, bebop, 1.0, room=room)
            results.append((memory, first, second, third, fourth, mixed))
        assert repr(results[0]) == repr(results[1])
