"""The scene in the picture of an environment, and the shapes of its parts as points in the world."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.linear import Vec3
from autopilot.geometry.so3 import rotation_from_quat
from autopilot.vehicle.layout import Layout
from gcs.errors import GcsError
from plumbline.learning.batch import Episodes
from sitl.plant.records import PlantState, Truth
from sitl.world import Floats

Frame = NDArray[np.uint8]  # (height, width, 3), a picture of a scene

_AHEAD_S, _AHEAD_POINTS = 3.0, 30  # of the path that is drawn ahead of the desired position
_PATH_POINTS = 400  # of the whole path
_MIN_ROTOR = 0.3  # least radius of a rotor as drawn, in units of the arm
_BEND = 0.45  # of a slack cable: a little less than that of two straight halves

_TURN = np.linspace(0.0, 2.0 * np.pi, 25)
CIRCLE = np.stack((np.cos(_TURN), np.sin(_TURN), np.zeros_like(_TURN)), axis=1)  # (points, 3) of radius 1
GAP = np.full((1, 3), np.nan)  # between two points that no line joins
_ALONG = np.linspace(0.0, 1.0, 17)[:, None]  # the cable


class Scene(NamedTuple):
    """What is drawn. World ENU, SI."""

    time_s: float  # since the beginning of the episode
    plant: PlantState
    truth: Truth
    layout: Layout
    shares: Floats  # (rotors,) force of each rotor relative to its maximum; 0 if it has none
    desired: Vec3  # position of the load
    ahead: Floats  # (n, 3) its next desired positions
    path: Floats  # (m, 3) all desired positions


class VehicleShape(NamedTuple):
    """The vehicle as points in the world."""

    middle: Floats  # (3,) of the rotor plane
    upward: Floats  # (3,) its normal
    hubs: Floats  # (rotors, 3)
    rims: Floats  # (rotors, points, 3)
    hull: Floats  # (points, 3)
    nose: Floats  # (2, 3) the line that points forward


def scene_of(episodes: Episodes, i: int) -> Scene:
    """The present scene of an episode. `Error` (plumbline.Error) before its first reset."""
    plant, truth, scenario = episodes.plant(i), episodes.truth(i), episodes.scenario
    if not any(plant.quat_wxyz):
        raise GcsError("reset comes before render")
    layout = scenario.cell.layout
    limits = truth.rotor_max * np.array([rotor.strength for rotor in layout])
    path = scenario.reference[:, :3]
    row = min(episodes.row(i), len(path) - 1)
    last = row + round(_AHEAD_S * 1e6 / scenario.tick_us)
    return Scene(
        time_s=episodes.elapsed_s(i),
        plant=plant,
        truth=truth,
        layout=layout,
        shares=np.asarray(episodes.rotor_forces(i)[: len(layout)] / limits),
        desired=episodes.jet(i)[0],
        ahead=_thinned(path[row : last + 1], _AHEAD_POINTS),
        path=_thinned(path, _PATH_POINTS),
    )


def _thinned(points: Floats, count: int) -> Floats:
    """At most `count` of the points (n, 3), with the first and the last one."""
    chosen = np.linspace(0, len(points) - 1, min(len(points), count)).round().astype(np.intp)
    return np.asarray(points[chosen])


def vehicle_shape(scene: Scene) -> VehicleShape:
    """The vehicle in its true position and attitude."""
    truth, plant = scene.truth, scene.plant
    rotation = np.array(rotation_from_quat(plant.quat_wxyz))
    middle = np.array(plant.x_quad) + truth.rotor_height * rotation[:, 2]
    places = np.array([(rotor.x, rotor.y, 0.0) for rotor in scene.layout])
    radius = truth.rotor_reach / truth.arm - np.linalg.norm(places, axis=1).max()  # in units of the arm
    rims = places[:, None] + max(radius, _MIN_ROTOR) * CIRCLE
    hull = np.array([(0.5, 0.0), (0.25, 0.22), (-0.4, 0.22), (-0.4, -0.22), (0.25, -0.22)])
    nose = np.array([(0.1, 0.0, 0.0), (0.7, 0.0, 0.0)])

    def world(body: Floats) -> Floats:
        return np.asarray(middle + truth.arm * body @ rotation.T)

    flat = np.concatenate((hull, np.zeros((len(hull), 1))), axis=1)
    return VehicleShape(middle, rotation[:, 2], world(places), world(rims), world(flat), world(nose))


def cable_shape(scene: Scene) -> Floats:
    """(points, 3) of the cable from vehicle to load. A slack one bends, by as much as it is longer than the
    distance of its ends."""
    plant, truth = scene.plant, scene.truth
    top = np.array(plant.x_quad) + np.array(rotation_from_quat(plant.quat_wxyz)) @ np.array(truth.attachment)
    chord = np.array(plant.x_load) - top
    straight = np.asarray(top + _ALONG * chord)
    spare = truth.cable_length**2 - float(chord @ chord)
    if plant.taut != 0.0 or spare <= 0.0:
        return straight
    # down if the ends are beside each other, aside if one is above the other
    down, aside = np.array([0.0, 0.0, -1.0]), np.array([0.3, 0.0, 0.0])
    across = down + aside
    if chord.any():
        across -= (across @ chord) / (chord @ chord) * chord
    across /= np.linalg.norm(across)
    return np.asarray(straight + _BEND * np.sqrt(spare) * np.sin(np.pi * _ALONG) * across)


def ring_and_cross(centre: Floats, radius: float) -> Floats:
    """(points, 3) of a line that marks a position: a level ring, and a cross in three directions."""
    arms = [np.stack((-axis, axis)) for axis in 0.5 * np.eye(3)]
    return centre + radius * np.concatenate((CIRCLE, GAP, arms[0], GAP, arms[1], GAP, arms[2]))


def on_ground(points: Floats) -> Floats:
    """The points vertically below, on the ground."""
    return points * (1.0, 1.0, 0.0)
