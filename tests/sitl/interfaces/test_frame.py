"""Motors of the firmwares on our vehicles: positions and spins, mounting, throttle."""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import pytest

from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.model import Vehicle
from sitl.interfaces.frame import Frame, FrameError, frame_of

# motors 1 to 4 as ArduPilot and PX4 document their quadrotor X: forward, left, counterclockwise
DOCUMENTED = ((1, -1, True), (-1, 1, True), (1, 1, False), (-1, -1, False))
# rounding of the rotations of axes
EPS = 1e-12


def framed(vehicle: Vehicle) -> Frame:
    return frame_of(vehicle.layout, vehicle.rotor_min_n, vehicle.rotor_max_n)


@pytest.mark.parametrize("name", ["iris", "bebop", "heavy"])
def test_each_motor_is_where_the_firmware_has_it(name: str) -> None:
    vehicle = load_vehicle(name)
    frame = framed(vehicle)
    for motor, (forward, left, counterclockwise) in enumerate(DOCUMENTED):
        throttles = [0.0] * 4
        throttles[motor] = 1.0
        forces = frame.forces(throttles)
        driven = [rotor for rotor, force in zip(vehicle.layout, forces, strict=True) if force > 0.0]
        assert len(driven) == 1
        x, y, _ = frame.to_controller_axes((driven[0].x, driven[0].y, 0.0))
        assert x * forward == pytest.approx(sqrt(0.5)) and y * left == pytest.approx(sqrt(0.5))
        assert (driven[0].yaw < 0.0) == counterclockwise
        assert max(forces) == pytest.approx(vehicle.rotor_max_n)


@pytest.mark.parametrize("name", ["iris", "bebop"])
def test_axes_and_attitude_of_the_flight_controller_agree(name: str) -> None:
    frame = framed(load_vehicle(name))
    heading = 0.3
    quat = (cos(0.5 * heading), 0.0, 0.0, sin(0.5 * heading))
    R, R_mounted = rotation_from_quat(quat), rotation_from_quat(frame.attitude(quat))
    v = (0.2, -0.7, 1.1)
    felt = frame.to_controller_axes(v)
    for row, mounted in zip(R, R_mounted, strict=True):
        ours = sum(a * b for a, b in zip(row, v, strict=True))
        theirs = sum(a * b for a, b in zip(mounted, felt, strict=True))
        assert theirs == pytest.approx(ours, abs=EPS)


def test_a_plus_is_an_x_turned_by_half_a_right_angle() -> None:
    assert framed(load_vehicle("iris")).mounting_yaw == 0.0
    assert framed(load_vehicle("bebop")).mounting_yaw == pytest.approx(0.25 * pi)


def test_throttle_gives_what_the_firmwares_thrust_curve_undoes() -> None:
    """Their inverse of (1 - e) u + e u^2 (MOT_THST_EXPO, THR_MDL_FAC) with e = 0.65 makes thrust linear."""
    vehicle = load_vehicle("iris")
    frame, e = framed(vehicle), 0.65
    for share in (0.0, 0.1, 0.5, 0.9, 1.0):
        u = (e - 1.0 + sqrt((1.0 - e) ** 2 + 4.0 * e * share)) / (2.0 * e)
        assert frame.forces((u,) * 4) == pytest.approx((share * vehicle.rotor_max_n,) * 4)


def test_throttles_beyond_their_range_are_cut() -> None:
    frame = framed(load_vehicle("iris"))
    assert frame.forces((-1.0, 2.0, 0.0, 1.0)) == frame.forces((0.0, 1.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("name", "changes", "told"),
    [
        ("thesis", {}, "finite force"),
        ("hexarotor", {}, "four rotors with alternating spin"),
        ("iris", {"spin": "+-+-"}, "four rotors with alternating spin"),
    ],
)
def test_a_vehicle_that_no_firmware_flies_is_refused(name: str, changes: dict[str, str], told: str) -> None:
    with pytest.raises(FrameError, match=told):
        framed(load_vehicle(name).model_copy(update=changes))
