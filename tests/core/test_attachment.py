"""A cable attached beside the centre of mass, as assumed by the autopilot."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.control.believed import believed_vehicle
from autopilot.control.records import State
from autopilot.core.attachment import cable_moment, shift_to_attachment
from autopilot.estimation.inbox import FIX, HEIGHT, POSE, READING, new_inbox, put_reading
from autopilot.estimation.records import GnssReading, PoseReading, blank_state
from autopilot.geometry.packed import unpack
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from sitl.plant.by_value import advance, initial_state
from sitl.vehicles.truth import load_truth

RHO = (0.02, -0.01, -0.03)
TURNED = Rotation.from_euler("zyx", (0.7, 0.2, -0.1))
QUAT = tuple(np.roll(TURNED.as_quat(), 1).tolist())
OMEGA = (0.3, -0.5, 0.8)


def test_the_belief_is_in_the_parameters():
    vehicle = load_vehicle("bebop").model_copy(update={"attachment_m": RHO})
    assert believed_vehicle(autopilot_parameters(vehicle)).attachment == RHO


def test_what_the_rotors_undo_is_what_the_plant_s_cable_does():
    """In a level hover with forces that carry vehicle and load, the plant turns as the moment says."""
    truth = load_truth("thesis")._replace(attachment=RHO)
    lift = (truth.quad_mass + truth.load_mass) * truth.gravity
    hanging = initial_state(truth)._replace(
        x_load=(0.0, 0.0, 50.0),
        x_quad=tuple((np.array((0.0, 0.0, 50.0 + truth.cable_length)) - RHO).tolist()),
        q_cable=(0.0, 0.0, -1.0),
        taut=1.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
    )
    h = 1e-6
    end = advance(hanging, truth, (0.25 * lift,) * 4, (0.0, 0.0, 0.0), h)
    turned = np.array(truth.inertia) * np.array(end.omega_body) / h
    vehicle = believed_vehicle(autopilot_parameters(load_vehicle("thesis")))._replace(attachment=RHO)
    R = rotation_from_quat(hanging.quat_wxyz)
    at = State((0.0,) * 3, (0.0,) * 3, (0.0, 0.0, -1.0), (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, R, (0.0,) * 3)
    moment = cable_moment(at, lift, truth.load_mass, truth.cable_length, vehicle)
    # the turning vehicle gives way, which reduces the plant's tension: n . J^-1 n, compared with 1 / mu
    n = np.cross(RHO, (0.0, 0.0, -1.0))
    mu = truth.load_mass * truth.quad_mass / (truth.load_mass + truth.quad_mass)
    gives_way = 1.0 + mu * float(n @ (n / np.array(truth.inertia)))
    assert np.array(moment) / gives_way == pytest.approx(turned, rel=1e-5)
    assert np.linalg.norm(moment) > 0.01


def test_readings_are_told_of_where_the_cable_is_attached():
    estimator = blank_state()
    estimator = estimator._replace(
        vehicle=estimator.vehicle._replace(quat_wxyz=QUAT, omega_body=OMEGA),
    )
    inbox = new_inbox()
    pose = PoseReading(0.0, (1.0, 2.0, 3.0), QUAT, (0.1, 0.2, 0.3), 1e-3, 1e-3, 1e-2)
    fix = GnssReading(0.0, (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), 0.01, 0.02, 1.0)
    put_reading(inbox, 0, POSE, 0, pose)
    put_reading(inbox, 1, FIX, 0, fix)
    inbox[2, 0], inbox[2, READING] = HEIGHT, 3.0
    shift_to_attachment(inbox, 3, estimator, RHO)
    arm, beside = TURNED.apply(RHO), TURNED.apply(np.cross(OMEGA, RHO))
    moved, placed = unpack(PoseReading, inbox[0], READING), unpack(GnssReading, inbox[1], READING)
    for place, speed in ((moved.x_quad, moved.v_quad), (placed.position, placed.velocity)):
        assert place == pytest.approx(np.array((1.0, 2.0, 3.0)) + arm, abs=1e-14)
        assert speed == pytest.approx(np.array((0.1, 0.2, 0.3)) + beside, abs=1e-14)
    assert (moved.quat_wxyz, moved.position_std) == (QUAT, 1e-3)
    assert inbox[2, READING] == pytest.approx(3.0 + arm[2], abs=1e-14)
