"""Changes of axes: the array forms against the scalar ones, the angles against their definitions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from autopilot.geometry import frames
from gcs.analysis import axes
from tests.gcs import tolerances

numbers = st.floats(-10.0, 10.0)
# the first call compiles a kernel, and a busy machine must not fail the test
patient = settings(deadline=None)

vectors = st.tuples(numbers, numbers, numbers)
quaternions = st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: sum(x * x for x in q) > 0.1)


@patient
@given(vectors)
def test_vectors_change_axes_as_frames_does(v):
    assert tuple(axes.enu_from_ned(np.array(v))) == frames.enu_from_ned(v)
    assert tuple(axes.flu_from_frd(np.array(v))) == frames.flu_from_frd(v)


@patient
@given(quaternions)
def test_attitudes_change_axes_as_frames_does(q):
    q = tuple(np.array(q) / np.linalg.norm(q))
    ours = axes.quat_enu_flu_from_ned_frd(np.array([q, q]))
    theirs = frames.quat_enu_flu_from_ned_frd(q)
    # the sign of a half turn (w = 0) is arbitrary
    distance = min(np.abs(ours[0] - theirs).max(), np.abs(ours[0] + theirs).max())
    assert distance <= tolerances.ROUNDING
    assert ours.shape == (2, 4)


@patient
@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_roll_pitch_yaw_are_those_of_scipy(roll, pitch, yaw):
    x, y, z, w = Rotation.from_euler("ZYX", (yaw, pitch, roll)).as_quat()
    found = axes.roll_pitch_yaw(np.array((w, x, y, z)))
    assert found == pytest.approx((roll, pitch, yaw), abs=tolerances.ANGLE)


@patient
@given(quaternions)
def test_tilt_and_body_axes_are_those_of_the_rotation(q):
    q = np.array(q) / np.linalg.norm(q)
    R = Rotation.from_quat((*q[1:], q[0])).as_matrix()
    forward, left = axes.body_axes(q)
    assert np.allclose(forward, R[:, 0], rtol=0.0, atol=tolerances.ANGLE)
    assert np.allclose(left, R[:, 1], rtol=0.0, atol=tolerances.ANGLE)
    assert np.cos(axes.tilt(q)) == pytest.approx(R[2, 2], abs=tolerances.ANGLE)


@patient
@given(st.floats(-1.4, 1.4), st.floats(-3.0, 3.0))
def test_cable_angles_turn_the_hanging_cable_into_q(phi, theta):
    q = Rotation.from_euler("YX", (theta, phi)).apply((0.0, 0.0, -1.0))
    assert axes.cable_angles(q) == pytest.approx((phi, theta), abs=tolerances.ANGLE)
    assert np.cos(axes.swing(q)) == pytest.approx(-q[2], abs=tolerances.ANGLE)


def test_signs_of_the_cable_angles():
    phi, theta = axes.cable_angles(np.array((0.0, 0.1, -1.0)))
    assert phi > 0.0
    assert theta == 0.0
    phi, theta = axes.cable_angles(np.array((0.1, 0.0, -1.0)))
    assert phi == 0.0
    assert theta < 0.0
