"""A cable attached beside the centre of mass, as assumed by the autopilot."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from autopilot.control.believed import believed_vehicle
from autopilot.control.records import State
from autopilot.core.attachment import cable_moment, shift_to_attachment
from autopilot.estimation.inbox import DIRECTION, FIX, HEIGHT, POSE, READING, new_inbox
from autopilot.estimation.records import (
    DirectionReading,
    EstimatorState,
    GnssReading,
    PoseReading,
    blank_state,
)
from autopilot.geometry.packed import unpack
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from sitl.plant.by_value import advance, initial_state
from sitl.vehicles.truth import load_truth
from tests.doubles.readings import put_reading

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


def estimator_with_load(x_load: tuple[float, float, float]) -> EstimatorState:
    """An estimate of the attachment at the origin and of the load at `x_load` (m)."""
    blank = blank_state()
    return blank._replace(load=blank.load._replace(x_load=x_load))


def shifted_direction(estimator: EstimatorState, seen: tuple[float, float, float]) -> tuple[float, ...]:
    """The direction to the load that the estimator gets where the camera sees this one (body)."""
    inbox = new_inbox()
    put_reading(inbox, 0, DIRECTION, 0, DirectionReading(0.0, seen, 4e-3))
    shift_to_attachment(inbox, 1, estimator, RHO)
    shifted = unpack(DirectionReading, inbox[0], READING)
    assert shifted.direction_std == 4e-3
    return shifted.direction_body


@pytest.mark.parametrize("from_attachment", [(0.0, 0.0, -0.7), (0.2, -0.1, -0.6), (-0.3, 0.4, -0.2)])
def test_the_direction_to_the_load_is_that_from_the_attachment(from_attachment):
    """The camera sees the load from the centre of mass: 1 cm beside it are 14 mrad at 0.7 m of cable."""
    seen = np.add(from_attachment, RHO)
    unit = tuple((seen / np.linalg.norm(seen)).tolist())
    expected = np.array(from_attachment) / np.linalg.norm(from_attachment)
    estimator = estimator_with_load(from_attachment)
    assert shifted_direction(estimator, unit) == pytest.approx(expected, abs=1e-14)
    # what is not a direction is not made one
    too_long = tuple((5.0 * np.array(unit)).tolist())
    assert np.linalg.norm(shifted_direction(estimator, too_long)) == pytest.approx(5.0, abs=1e-13)


@pytest.mark.parametrize(
    ("x_load", "seen"), [((0.0, 0.0, 0.0), (0.6, 0.0, -0.8)), ((0.0, 0.0, -0.7), (0.0, 0.0, 0.0))]
)
def test_a_direction_stays_where_load_and_vehicle_are_at_one_place_and_where_it_is_none(x_load, seen):
    assert shifted_direction(estimator_with_load(x_load), seen) == seen
