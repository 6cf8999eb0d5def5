"""The measured pull of the cable does not contain the drag of the vehicle, whatever the wind is."""

from __future__ import annotations

import math
from typing import NamedTuple

import pytest

from autopilot.control.drag import Drag
from autopilot.estimation.cable_pull import (
    FRAME_SHARE_TIME_S,
    force_beyond_thrust,
    learned_frame_share,
    measured_pull,
    rotor_drag_growth,
    without_climb_drag,
)
from autopilot.estimation.measurements.pull import cable_force
from autopilot.estimation.records import ImuReading, LoadEstimate, VehicleEstimate, blank_state
from autopilot.geometry.linear import Vec3, add, apply_transposed, axpy, column, dot, norm, scale
from autopilot.geometry.s2 import normalise
from autopilot.geometry.so3 import quat_exp, rotation_from_quat
from tests.doubles.motion import bebop_tuning

TUNING = bebop_tuning()._replace(quad_mass=2.0, load_mass=0.5, drag=Drag(0.05, 0.04))
WEIGHT = TUNING.load_mass * TUNING.gravity
DT = 0.004


class Scene(NamedTuple):
    """What acts on a vehicle that leans into the wind, and the share of its frame in the drag across its
    axis."""

    load: LoadEstimate
    vehicle: VehicleEstimate
    imu: ImuReading
    thrust: float
    share: float


def scene(
    wind: float, tilt_deg: float, climb: float = 0.0, rotor_drag: float = 0.0, pull: float = WEIGHT
) -> Scene:
    """A vehicle at rest but for its climb (m/s), in wind from the east (m/s), leaning into it; `rotor_drag`
    is in N s/m. The load hangs 10 deg to leeward."""
    quat = quat_exp((0.0, math.radians(tilt_deg), 0.0))
    axis = column(rotation_from_quat(quat), 2)
    air: Vec3 = (wind, 0.0, climb)  # velocity relative to the air
    frame = scale(-(TUNING.drag.linear + TUNING.drag.quadratic * norm(air)), air)
    rotors = scale(-rotor_drag, axpy(-dot(air, axis), axis, air))
    q = normalise((-math.sin(math.radians(10.0)), 0.0, -math.cos(math.radians(10.0))))
    thrust = 27.0
    total = add(add(scale(thrust, axis), scale(pull, q)), add(frame, rotors))
    accel = apply_transposed(rotation_from_quat(quat), scale(1.0 / TUNING.quad_mass, total))
    frame_across = norm(axpy(-dot(frame, axis), axis, frame))
    share = frame_across / (frame_across + norm(rotors)) if frame_across > 0.0 else 0.0
    load = blank_state().load._replace(q_cable=q, tension=pull, taut=1.0)
    vehicle = blank_state().vehicle._replace(quat_wxyz=quat, v_quad=(0.0, 0.0, climb))
    return Scene(load, vehicle, ImuReading((0.0, 0.0, 0.0), accel), thrust, share)


def force_of(shown: Scene, share: float) -> Vec3:
    force = force_beyond_thrust(shown.vehicle, shown.imu, shown.thrust, TUNING)
    return without_climb_drag(force, shown.load, shown.vehicle, share, TUNING)


def pull_of(shown: Scene, share: float) -> float:
    return measured_pull(force_of(shown, share), shown.load, shown.vehicle, share)


@pytest.mark.parametrize("pull", [WEIGHT, 0.0])
@pytest.mark.parametrize("rotor_drag", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("wind", "tilt_deg"), [(0.0, 0.0), (10.0, 15.0), (15.0, -10.0), (27.0, 50.0)])
def test_the_pull_is_that_of_the_cable_in_any_wind(
    wind: float, tilt_deg: float, rotor_drag: float, pull: float
) -> None:
    shown = scene(wind, tilt_deg, rotor_drag=rotor_drag, pull=pull)
    assert pull_of(shown, shown.share) == pytest.approx(pull, abs=1e-9)


def test_along_the_axis_drag_would_be_several_times_the_weight() -> None:
    assert pull_of(scene(27.0, 50.0), 0.0) > 5.0 * WEIGHT


@pytest.mark.parametrize("climb", [-3.0, 3.0])
@pytest.mark.parametrize("wind", [0.0, 5.0, 15.0])
def test_drag_of_the_climb_is_no_pull(wind: float, climb: float) -> None:
    # not exactly, since the level part of the drag also grows with the climb; in 15 m/s of wind the drag of
    # the climb is 0.4 of the weight
    assert pull_of(scene(wind, 10.0, climb), 1.0) == pytest.approx(WEIGHT, abs=0.05 * WEIGHT)


@pytest.mark.parametrize("before", [0.0, 1.0])
@pytest.mark.parametrize("rotor_drag", [0.0, 0.3, 1.0])
def test_the_share_of_the_frame_is_learned(rotor_drag: float, before: float) -> None:
    shown, share = scene(12.0, 20.0, rotor_drag=rotor_drag), before
    for _ in range(round(8.0 * FRAME_SHARE_TIME_S / DT)):
        share = learned_frame_share(force_of(shown, share), shown.load, shown.vehicle, share, TUNING, DT)
    assert share == pytest.approx(shown.share, abs=0.01)


def test_noise_in_calm_air_teaches_nothing() -> None:
    shown, share = scene(0.0, 0.0), 0.4
    noisy = shown.imu._replace(accel=add(shown.imu.accel, (0.1, 0.0, 0.1)))
    force = force_of(shown._replace(imu=noisy), share)
    for _ in range(1000):
        share = learned_frame_share(force, shown.load, shown.vehicle, share, TUNING, DT)
    assert share == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize("rotor_drag", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("wind", "tilt_deg"), [(10.0, 15.0), (15.0, -10.0), (27.0, 50.0)])
def test_a_known_level_push_leaves_the_force_of_the_cable(
    wind: float, tilt_deg: float, rotor_drag: float
) -> None:
    """Drag of the rotors of a leaning vehicle has a vertical part, which is no pull."""
    shown = scene(wind, tilt_deg, rotor_drag=rotor_drag)
    whole = force_beyond_thrust(shown.vehicle, shown.imu, shown.thrust, TUNING)
    air_force = axpy(-WEIGHT, shown.load.q_cable, whole)
    push = (air_force[0] / TUNING.quad_mass, air_force[1] / TUNING.quad_mass)
    blank = blank_state()
    state = blank._replace(
        vehicle=shown.vehicle,
        load=shown.load,
        last_imu=shown.imu,
        air=blank.air._replace(vehicle_accel=push),
        frame_share=shown.share,
    )
    found = cable_force(state, TUNING, shown.thrust)
    assert found == pytest.approx(scale(WEIGHT, shown.load.q_cable), abs=1e-9)


@pytest.mark.parametrize(
    ("thrust", "before", "share", "growth"),
    [
        (25.0, 20.0, 0.0, 1.25),
        (25.0, 20.0, 1.0, 1.0),
        (25.0, 20.0, 0.6, 1.1),
        (0.1, 0.0, 0.0, 1.0),  # on the ground
    ],
)
def test_the_drag_of_the_rotors_grows_with_their_thrust(
    thrust: float, before: float, share: float, growth: float
) -> None:
    assert rotor_drag_growth(thrust, before, share, TUNING) == pytest.approx(growth)
