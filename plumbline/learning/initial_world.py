"""The world at the beginning of an episode: the load hangs from the vehicle in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from autopilot.control.actuators.mixer import FORCE as MIXED
from autopilot.control.actuators.mixer import mix, new_rotors
from autopilot.geometry.linear import ZERO, Vec3
from autopilot.geometry.packed import Row, field_offset, packed, unpack
from autopilot.geometry.so3 import IDENTITY_QUAT
from autopilot.vehicle.rotors import mixer_table
from plumbline.learning.scenario import Draw, Scenario
from sitl.plant.records import PlantState, Truth
from sitl.plant.rotors import COMMAND, FORCE, REQUESTED, TARGET
from sitl.world import DUE, LENGTH, Floats, Ints, World, WorldRows

_NEVER = 2**62


def _vector_slice(field: str) -> slice:
    first = field_offset(World, "plant") + field_offset(PlantState, field)
    return slice(first, first + 3)


X_LOAD, V_LOAD, X_QUAD, V_QUAD = (_vector_slice(name) for name in ("x_load", "v_load", "x_quad", "v_quad"))


@dataclass(frozen=True)
class InitialWorld:
    """A world except for its position and velocity: the load rests at the origin."""

    world: Row
    rows: WorldRows  # model, rotors, delivery and errors of the sensors
    clock: Ints
    commands: Floats  # (waiting, 1 + rotors) given before, and still in transit
    cable_length: float  # m


def initial_world(scenario: Scenario, draw: Draw) -> InitialWorld:
    """The world of an episode. The rotors carry the weight, and have been commanded to for a long time."""
    rows, truth, settings = scenario.world(draw)
    hover = hover_forces(scenario, (truth.quad_mass + truth.load_mass) * truth.gravity)
    for row in (REQUESTED, COMMAND, TARGET, FORCE):
        rows.rotors[row] = hover
    world = unpack(World, rows.world, 0)._replace(plant=_suspended(truth))
    clock = rows.clock.copy()
    clock[:, LENGTH] = 0  # readings taken on the ground are discarded
    if not scenario.estimated:
        clock[:, DUE] = _NEVER
    in_transit = settings.actuator_delay_us // settings.tick_us
    due_us = [settings.actuator_delay_us - (in_transit - k) * settings.tick_us for k in range(in_transit)]
    commands = np.zeros((in_transit, rows.commands.shape[1]))
    commands[:, 0], commands[:, 1:] = due_us, hover[: commands.shape[1] - 1]
    return InitialWorld(packed(world), rows, clock, commands, truth.cable_length)


def worlds_differ(scenario: Scenario) -> bool:
    """Whether two episodes differ in more than position and velocity."""
    gusts = scenario.cell.settings.gust_std != 0.0
    return scenario.estimated or gusts or bool(scenario.options.randomise)


def hover_forces(scenario: Scenario, weight: float) -> Floats:
    """(MAX_ROTORS,) N: force of each rotor that carries a weight (N) with the vehicle level."""
    setup, rotors = scenario.cell.setup, new_rotors()
    mix(weight, ZERO, setup.vehicle, 0.0, mixer_table(setup.layout), rotors)
    forces: Floats = rotors[MIXED]
    return forces


def _suspended(truth: Truth) -> PlantState:
    """The load at the origin, the cable's attachment above it, the vehicle level and heading east."""
    x, y, z = truth.attachment
    above: Vec3 = (0.0 - x, 0.0 - y, truth.cable_length - z)
    return PlantState(
        x_load=ZERO,
        v_load=ZERO,
        q_cable=(0.0, 0.0, -1.0),
        q_cable_dot=ZERO,
        x_quad=above,
        v_quad=ZERO,
        quat_wxyz=IDENTITY_QUAT,
        omega_body=ZERO,
        taut=1.0,
        slack_events=0.0,
        vehicle_on_ground=0.0,
        load_on_ground=0.0,
        accel_quad=ZERO,
        tension=truth.load_mass * truth.gravity,
        diverged=0.0,
        snap_speed=0.0,
        omega_dot_body=ZERO,
    )
