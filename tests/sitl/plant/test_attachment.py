"""A cable that is attached away from the centre of mass: what is conserved, and the impact; see also
test_second_derivation."""

from __future__ import annotations

import numpy as np
import pytest

from sitl.plant.attachment import effective_mass
from sitl.plant.by_value import advance_many
from sitl.plant.impact import at_cable_length
from sitl.plant.records import Motion

CALM = (0.0, 0.0, 0.0)
OFF = (0.0, 0.0, 0.0, 0.0)
RHO = (0.03, -0.02, -0.05)
# fourth order; invariants of rotations drift by the fifth power, the odd term of the amplitude
ORDER_LOW, ORDER_HIGH = 3.8, 5.3
STEPS = (4e-3, 2e-3, 1e-3, 5e-4)
EXACT = 1e-12  # rounding of numbers of the order of ten


@pytest.fixture
def beside(thesis):
    return thesis._replace(attachment=RHO)


@pytest.fixture
def tumble(beside, aloft):
    """Vehicle and load thrown spinning, rotors off, no drag."""
    return aloft(
        beside,
        q=(0.4, -0.3, -0.8),
        q_dot=(9.0, 14.0, -5.0),
        v_load=(1.0, 2.0, 3.0),
        omega_body=(5.0, -7.0, 4.0),
    )


def test_momenta_and_energy_stay(tumble, beside, energy, momentum, spins):
    """The pull turns the vehicle and swings the pair: only the sum of their angular momenta is conserved."""
    before, drifts = energy(tumble, beside), {"energy": [], "spin": []}
    pair, vehicle = spins(tumble, beside)
    for h in STEPS:
        end = advance_many(tumble, beside, OFF, CALM, h, round(1.0 / h))
        assert end.taut == 1.0
        pair_end, vehicle_end = spins(end, beside)
        assert np.linalg.norm(vehicle_end - vehicle) > 0.01, "the pull is meant to turn the vehicle"
        drifts["energy"].append(abs(energy(end, beside) - before))
        drifts["spin"].append(float(np.linalg.norm(pair_end + vehicle_end - pair - vehicle)))
        fall = np.array([0.0, 0.0, -beside.gravity * (beside.load_mass + beside.quad_mass)])
        assert momentum(end, beside) - momentum(tumble, beside) == pytest.approx(fall, abs=EXACT)
    for name, drift in drifts.items():
        slope = np.polyfit(np.log(STEPS), np.log(drift), 1)[0]
        assert ORDER_LOW < slope < ORDER_HIGH, name


def test_the_cable_keeps_its_length_from_where_it_is_attached(tumble, beside, rotation_of):
    state = tumble
    for _ in range(200):
        state = advance_many(state, beside, OFF, CALM, 4e-3, 1)
        held = np.array(state.x_quad) + rotation_of(state) @ np.array(RHO)
        cable = np.array(state.x_load) - held
        assert cable == pytest.approx(beside.cable_length * np.array(state.q_cable), abs=EXACT)


def test_the_impact_is_that_of_two_bodies_on_a_rigid_bar(bebop, rotation_of, tumble):
    """Compared with the linear system of impulse and constraint over all nine velocities of load and
    vehicle."""
    truth = bebop._replace(attachment=RHO)
    R, q = rotation_of(tumble), np.array(tumble.q_cable)
    v_load, v_quad, omega = np.array([1.0, -2.0, -4.0]), np.array([0.5, 0.2, 1.0]), np.array([3.0, -2.0, 1.0])
    apart = truth.cable_length * q + R @ np.array(RHO)
    motion = Motion(
        tumble.x_load,
        tuple(v_load.tolist()),
        tuple(apart.tolist()),
        tuple((v_load - v_quad).tolist()),
        tumble.quat_wxyz,
        tuple(omega.tolist()),
        truth.cable_length,
        0.3,
    )
    after = at_cable_length(motion, truth)
    mass = np.diag([*[truth.load_mass] * 3, *[truth.quad_mass] * 3, *truth.inertia])
    # q . (v_L - v_Q - R (Omega x rho)) as a row over these velocities
    row = np.concatenate((q, -q, -np.cross(RHO, R.T @ q)))
    system = np.block([[mass, -row[:, None]], [row[None, :], np.zeros((1, 1))]])
    before = np.concatenate((v_load, v_quad, omega))
    solved = np.linalg.solve(system, np.concatenate((mass @ before, [0.3])))
    assert after.v_load == pytest.approx(solved[:3], abs=EXACT)
    assert after.omega == pytest.approx(solved[6:9], abs=EXACT)
    assert after.separation_dot == pytest.approx(solved[:3] - solved[3:6], abs=EXACT)
    # the impulse, as reported in CABLE_SNAP
    impulse = effective_mass(tumble.q_cable, tuple(map(tuple, R.tolist())), truth) * (row @ before - 0.3)
    assert impulse == pytest.approx(-solved[9], abs=EXACT)


def test_a_cable_that_snaps_taut_takes_energy_and_leaves_the_momenta(bebop, aloft, energy, momentum, spins):
    truth = bebop._replace(attachment=RHO, quad_drag=0.0, quad_drag_quadratic=0.0, spin_drag=0.0)
    truth = truth._replace(load_drag_quadratic=0.0)
    start = aloft(truth, q=(0.3, 0.2, -0.9), omega_body=(1.0, -2.0, 0.5))
    up = (start.x_load[0], start.x_load[1], start.x_load[2] + 0.05)
    start = start._replace(x_load=up, taut=0.0)
    end = advance_many(start._replace(v_load=(0.0, 0.0, -3.0)), truth, OFF, CALM, 4e-3, 10)
    start = start._replace(v_load=(0.0, 0.0, -3.0))
    assert end.taut == 1.0
    fall = np.array([0.0, 0.0, -truth.gravity * 0.04 * (truth.load_mass + truth.quad_mass)])
    assert momentum(end, truth) - momentum(start, truth) == pytest.approx(fall, abs=EXACT)
    spun = np.sum(spins(end, truth), axis=0) - np.sum(spins(start, truth), axis=0)
    assert spun == pytest.approx(np.zeros(3), abs=1e-8)  # the integrator's error in ten steps
    assert energy(end, truth) < energy(start, truth) - 0.1
