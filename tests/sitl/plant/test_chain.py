"""The cable of links in the plant, against theory, a second engine and conserved quantities."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.cable_convergence import (
    LINKS,
    TICK,
    ChainPlant,
    chain_model,
    frequency_errors,
    hover,
    massless_difference,
    mujoco_difference,
    simulated_frequencies,
    step_errors,
    suspended,
    swinging_plant,
    without_drag,
)
from sitl.plant.chain.records import lay_straight
from sitl.plant.gripper import without_cable
from sitl.plant.records import Truth
from sitl.plant.step import initial_state

NO_LOAD = 1e-9  # kg
CORD, LOAD = 2.4e-3, 0.1  # kg/m, kg
CLOSING = 0.5  # m/s
ROUNDING = 1e-11  # of places 30 m away, over 2000 steps


@pytest.mark.parametrize(("mass", "load"), [(0.01, NO_LOAD), (CORD, LOAD)], ids=["bare", "loaded"])
def test_hanging_chain_has_the_frequencies_of_bessel(mass: float, load: float) -> None:
    errors = {n: frequency_errors(n, mass, load) for n in LINKS}
    assert abs(errors[64][0]) < 1e-4
    # of second order in n: two of them give the limit, up to the step's own error in the fastest mode, 126
    # rad/s
    extrapolated = (4.0 * errors[64] - errors[32]) / 3.0
    assert np.abs(extrapolated[:2]).max() < 1e-4
    assert abs(extrapolated[2]) < 2e-4
    assert 3.5 < errors[16][1] / errors[32][1] < 4.2


def test_a_mode_that_the_step_resolves_is_not_damped() -> None:
    slowest = simulated_frequencies(8, CORD, LOAD)[0]
    assert abs(slowest.real) < 1e-6 * slowest.imag


def test_the_step_is_of_second_order() -> None:
    errors = step_errors()
    assert errors[0] < 1e-6
    for longer, shorter in pairwise(errors):
        assert 3.5 < longer / shorter < 4.7


def test_a_massless_stiff_link_is_the_taut_plant() -> None:
    """The difference is the stretch, so it goes with 1/EA until the step's own error is left."""
    place = [massless_difference(stiffness)[0] for stiffness in (1e4, 1e5, 1e6)]
    assert place[0] / place[1] == pytest.approx(10.0, rel=0.5)
    assert place[1] / place[2] == pytest.approx(10.0, rel=0.5)
    rigid, tension = massless_difference(1e9)
    assert rigid < 2e-7
    assert tension < 1e-4
    # this error goes with h^2; a tick that is no multiple of the longest step is divided
    assert 3.5 < rigid / massless_difference(1e9, 2.5e-4)[0] < 4.5


def test_an_attachment_beside_the_centre_of_mass_is_that_of_the_taut_plant() -> None:
    place = [massless_difference(stiffness, attachment=(0.02, -0.01, -0.03))[0] for stiffness in (1e6, 1e9)]
    assert place[0] < 1e-5
    assert place[1] < 1e-6


def test_a_light_cable_is_the_massless_one() -> None:
    """To first order in its mass: its weight is not carried by the thrust of `swinging_plant`."""
    massless = swinging_plant(chain_model(1, mass=0.0)).fly(0.5).x_load
    off = []
    for mass in (2e-4, 1e-4):
        light = swinging_plant(chain_model(4, mass=mass))
        off.append(float(np.linalg.norm(np.subtract(light.fly(0.5).x_load, massless))))
    assert off[0] < 1e-3
    assert off[0] / off[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("links", [1, 6])
def test_it_moves_as_in_mujoco(links: int) -> None:
    pytest.importorskip("mujoco")
    soft, stiff = mujoco_difference(links, 1e5), mujoco_difference(links, 1e6)
    # MuJoCo's links are rods: what differs is the stretch
    assert stiff[0] < 3e-6 and stiff[1] < 1e-6 and stiff[2] < 1e-5
    assert soft[0] / stiff[0] > 4.0


def test_energy_stays_without_damping() -> None:
    """Vehicle and load turn about each other on a cable so soft that the step resolves its stretch; after
    settling, the damping is switched off."""
    model = chain_model(2, stiffness=50.0, damping=2.0, hook=0.05, gyration=0.02, gyration_upright=0.02)
    begun = swinging_plant(model)
    settled = ChainPlant(begun.truth._replace(gravity=1e-9), begun.state)
    settled.fly(0.3, 1.25e-4)
    lost = []
    for h in (5e-4, 2.5e-4):
        undamped = settled.truth._replace(chain=model._replace(damping=0.0))
        plant = ChainPlant(undamped, settled.state)
        for array, kept in zip(plant.rows, settled.rows, strict=True):
            array[...] = kept
        before = plant.energy()
        plant.fly(1.0, h)
        lost.append((before - plant.energy()) / before)
    assert 0.0 < lost[0] < 1e-4
    assert lost[0] / lost[1] > 3.5


def test_vehicle_cable_and_load_fall_freely(bebop: Truth) -> None:
    model = chain_model(5, mass=0.01, hook=0.05, gyration=0.02, gyration_upright=0.02)
    truth = without_drag(bebop)._replace(chain=model)
    slack = suspended(truth, x_load=(0.1, 0.0, 30.0), x_quad=(0.0, 0.0, 30.4))
    plant = ChainPlant(truth, slack)
    begin = plant.rows.x.copy()
    end = plant.fly(1.0)
    drop = (0.0, 0.0, 0.5 * truth.gravity)
    np.testing.assert_allclose(end.x_load, np.subtract(slack.x_load, drop), atol=ROUNDING)
    np.testing.assert_allclose(end.x_quad, np.subtract(slack.x_quad, drop), atol=ROUNDING)
    np.testing.assert_allclose(plant.rows.x, begin - drop, atol=ROUNDING)
    assert (end.tension, end.taut) == (0.0, 0.0)


def snapped(truth: Truth, damping: float, seconds: float) -> tuple[float, float, float]:
    """Vehicle and load move apart until the cable snaps: greatest tension, impulse, reported closing
    speed."""
    model = chain_model(1, mass=0.0, stiffness=7e3, damping=damping)
    free = without_drag(truth)._replace(chain=model, gravity=1e-9)
    share = truth.load_mass / (truth.load_mass + truth.quad_mass)
    start = suspended(free, x_load=(0.0, 0.0, 50.0), x_quad=(0.0, 0.0, 50.0 + truth.cable_length - 1e-3))
    start = start._replace(
        v_quad=(0.0, 0.0, share * CLOSING), v_load=(0.0, 0.0, (share - 1.0) * CLOSING), taut=0.0
    )
    plant, h = ChainPlant(free, start), 1e-4
    tensions, speeds = [], []
    before = start.v_load[2]
    for _ in range(round(seconds / h)):
        state = plant.fly(h, h)
        tensions.append(state.tension)
        speeds.append(state.snap_speed)
    return max(tensions), truth.load_mass * (state.v_load[2] - before), max(speeds)


def test_a_snap_has_the_peak_and_the_impulse_of_a_spring(bebop: Truth) -> None:
    """The peak is v sqrt(k mu), and the impulse 2 mu v, because the ends then approach each other as fast as
    they had moved apart."""
    mu = bebop.load_mass * bebop.quad_mass / (bebop.load_mass + bebop.quad_mass)
    stiffness = 7e3 / bebop.cable_length
    peak, impulse, told = snapped(bebop, 0.0, 0.04)
    assert peak == pytest.approx(CLOSING * np.sqrt(stiffness * mu), rel=2e-3)
    assert impulse == pytest.approx(2.0 * mu * CLOSING, rel=2e-3)
    assert told == pytest.approx(CLOSING, rel=1e-3)


def test_a_snap_of_a_damped_cable_has_the_impulse_of_an_impact(bebop: Truth) -> None:
    """Overdamped, the ends do not rebound, and the impulse is that of `sitl.plant.impact`: mu v."""
    mu = bebop.load_mass * bebop.quad_mass / (bebop.load_mass + bebop.quad_mass)
    stiffness = 7e3 / bebop.cable_length
    critical = 2.0 * np.sqrt(stiffness * mu) * bebop.cable_length
    _, impulse, _ = snapped(bebop, 4.0 * critical, 0.3)
    assert impulse == pytest.approx(mu * CLOSING, rel=0.02)


def test_a_cable_in_the_wind_is_dragged(bebop: Truth) -> None:
    """The drag of a cable across the flow is rho d L C_d v^2 / 2 in total, before it has been blown aside."""
    links, speed = 8, 8.0
    found = []
    for drag_coefficient in (0.0, 1.2):
        model = chain_model(links, drag_coefficient=drag_coefficient)
        air = bebop.air._replace(cable_diameter=0.002)
        truth = without_drag(bebop)._replace(chain=model, air=air)
        plant = ChainPlant(truth, suspended(truth), hover(truth), (0.0, speed, 0.0))
        state = plant.fly(1e-3, 1e-3)
        masses = np.full(links + 1, model.mass * truth.cable_length / links)
        masses[[0, -1]] = 0.5 * masses[1] + np.array([truth.quad_mass, truth.load_mass])
        v_y = np.array([state.v_quad[1], *plant.rows.v[1:-1, 1], state.v_load[1]])
        found.append(masses @ v_y / 1e-3)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    drag = 0.5 * bebop.air.density * 0.002 * bebop.cable_length * 1.2 * speed**2
    assert found[1] == pytest.approx(drag, rel=0.01)


def test_a_load_that_turns_swings_as_a_double_pendulum(bebop: Truth) -> None:
    """Under a fixed vehicle, phi of the cable (length l) and theta of the load (hook h, gyration k) obey
    l phi'' + h theta'' = -g phi and k^2 theta'' = -g h (theta - phi)."""
    h, k = 0.3, 0.1
    model = chain_model(1, mass=0.0, hook=h, gyration=k, gyration_upright=k, damping=50.0)
    truth = without_drag(bebop)._replace(chain=model, quad_mass=1e9, rotor_max=np.inf, rotor_tau=0.0)
    g, length = truth.gravity, truth.cable_length - h
    squares, modes = np.linalg.eig(
        np.linalg.solve([[length, h], [0.0, k * k]], np.array([[g, 0.0], [-g * h, g * h]]))
    )
    slow = int(np.argmin(squares))
    phi, theta = (0.01 * modes[:, slow] / modes[0, slow]).tolist()
    down = (0.0, length * np.sin(phi) + h * np.sin(theta), -length * np.cos(phi) - h * np.cos(theta))
    x_load = (down[0], float(down[1]), float(3.0 + down[2]))
    plant = ChainPlant(truth, suspended(truth, x_quad=(0.0, 0.0, 3.0), x_load=x_load), hover(truth))
    plant.rows.body[:2] = np.cos(0.5 * theta), np.sin(0.5 * theta)
    lay_straight(plant.rows, truth, plant.state)
    tilts = np.array([plant.rows.body[1] for _ in range(4000) if plant.fly(1e-3, 1e-3)])
    before = np.flatnonzero(tilts[:-1] * tilts[1:] < 0.0)
    zeros = 1e-3 * (before + tilts[before] / (tilts[before] - tilts[before + 1]))
    frequency = np.pi * (len(zeros) - 1) / (zeros[-1] - zeros[0])
    assert len(zeros) > 4
    assert frequency == pytest.approx(np.sqrt(squares[slow]), rel=2e-4)


def test_a_load_turns_its_drag_downwind(bebop: Truth) -> None:
    """Its drag acts forward of its centre: the wind from the left turns the nose to the right."""
    model = chain_model(2, hook=0.03, gyration=0.02, gyration_upright=0.02, pressure=0.01, spin_drag=1e-6)
    truth = bebop._replace(chain=model)
    plant = ChainPlant(truth, suspended(truth), hover(truth), (0.0, -5.0, 0.0))
    plant.fly(0.2)
    assert plant.rows.body[6] < -0.1


def test_at_rest_on_the_ground_everything_stays(bebop: Truth) -> None:
    model = chain_model(
        6, drag_coefficient=1.2, hook=0.015, gyration=0.02, gyration_upright=0.02, damping=10.0
    )
    truth = bebop._replace(chain=model)
    plant = ChainPlant(truth, initial_state(truth))
    plant.fly(1.0)
    before = plant.rows.x.copy()
    state = plant.fly(1.0)
    assert np.abs(plant.rows.x - before).max() < 1e-4
    assert state.x_load[2] == pytest.approx(truth.load_radius, abs=1e-5)
    assert (state.taut, state.slack_events, state.vehicle_on_ground, state.load_on_ground) == (0, 0, 1, 1)
    assert (plant.rows.x[1:-1, 2] > -2e-3).all()


def test_a_cable_let_go_falls_with_its_load(bebop: Truth) -> None:
    model = chain_model(6, hook=0.015, gyration=0.02, gyration_upright=0.02, damping=10.0)
    truth = without_drag(bebop)._replace(chain=model)
    plant = ChainPlant(truth, suspended(truth), hover(truth))
    plant.fly(0.5)
    held = plant.state
    plant.truth = without_cable(truth)
    state = plant.fly(0.4)
    assert state.tension == 0.0
    fallen = 0.5 * truth.gravity * 0.4**2
    assert state.x_load[2] == pytest.approx(held.x_load[2] + 0.4 * held.v_load[2] - fallen, abs=2e-3)
    # the rest of the cable holds together, and falls too
    lengths = np.linalg.norm(np.diff(plant.rows.x[1:], axis=0), axis=1)
    assert (lengths < 1.001 * (truth.cable_length - 0.015) / 6).all()
    assert plant.rows.x[1, 2] < held.x_quad[2] - 0.5 * fallen


def test_a_winch_reels_the_links_in(bebop: Truth) -> None:
    model = chain_model(6, damping=10.0)
    truth = without_drag(bebop)._replace(chain=model)
    plant = ChainPlant(truth, suspended(truth), hover(truth))
    plant.fly(0.3)
    for _ in range(125):  # 0.5 s at 0.2 m/s
        plant.truth = plant.truth._replace(reel_rate=-0.2)
        plant.fly(TICK)
        plant.truth = plant.truth._replace(cable_length=plant.truth.cable_length - 0.2 * TICK)
    apart = np.linalg.norm(np.subtract(plant.state.x_load, plant.state.x_quad))
    assert apart == pytest.approx(0.6, abs=1e-4)


def test_machine_code_and_python_agree_to_the_bit() -> None:
    program = """
import hashlib
from autopilot.geometry.packed import packed
from benchmarks.cable_convergence import chain_model, swinging_plant
plant = swinging_plant(chain_model(5, drag_coefficient=1.2, hook=0.05, gyration=0.02, gyration_upright=0.01))
plant.fly(0.02)
numbers = [packed(plant.state), plant.rows.x, plant.rows.v, plant.rows.body]
print(hashlib.sha256(b"".join(one.tobytes() for one in numbers)).hexdigest())
"""
    found = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "NUMBA_DISABLE_JIT": switch},
            capture_output=True,
            text=True,
            check=True,
            timeout=300,
        ).stdout
        for switch in ("0", "1")
    }
    assert len(found) == 1 and found != {""}
