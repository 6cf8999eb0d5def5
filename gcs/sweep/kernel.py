"""A stretch of flight in one call of machine code: the tick of the world and the tick of the autopilot, in
turn.

Both are the functions that fly in the processes (`sitl.world.world_tick`, `autopilot.core.tick.fly_tick`);
what is added is the rounding of the wire between them, and the figures of the flight.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from autopilot.core.tick import FLOWN, TO_DECIDE, CoreRows, Pilot, fly_tick, row_at, vector_at
from autopilot.estimation.records import EstimatorState
from autopilot.geometry.kernel import kernel
from autopilot.geometry.linear import Vec3, norm, sub
from autopilot.geometry.packed import Row, pack, unpack
from autopilot.supervisor.quiescence import Stretch
from gcs.sweep.wire import Wire, deliver, wire_forces
from sitl.world import Floats, World, WorldModel, WorldRows, world_tick


class Figures(NamedTuple):
    """Of the mission, tick by tick, from the true state."""

    error_max: float  # m, from where the mission asks the load to be
    error_square: float  # m^2, summed
    samples: float
    tracking_max: float  # m, from the path that is flown
    psi_R_max: float
    psi_q_max: float
    saturated: float  # ticks
    ticks: float
    tension_min: float  # N
    tension_max: float
    estimator_error_max: float  # m
    rotor_min: float  # N
    rotor_max: float


NO_FIGURES = Figures(
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float("inf"), 0.0, 0.0, float("inf"), -float("inf")
)


@kernel
def count(figures: Row, world: WorldRows, core: CoreRows, target: Vec3, asked: Vec3) -> None:
    """The figures with those of this tick; `asked` is where the mission asks the load to be, `target` where
    the autopilot does."""
    f = unpack(Figures, figures, 0)
    plant, pilot = unpack(World, world.world, 0).plant, unpack(Pilot, core.pilot, 0)
    estimator = unpack(EstimatorState, core.estimator, 0)
    error = norm(sub(plant.x_load, asked))
    force = plant.rotor_force
    after = Figures(
        max(f.error_max, error),
        f.error_square + error * error,
        f.samples + 1.0,
        max(f.tracking_max, norm(sub(plant.x_load, target))),
        max(f.psi_R_max, pilot.command.psi_R),
        max(f.psi_q_max, pilot.command.psi_q),
        f.saturated + (1.0 if pilot.mixed.saturated != 0 else 0.0),
        f.ticks + 1.0,
        min(f.tension_min, plant.tension),
        max(f.tension_max, plant.tension),
        max(f.estimator_error_max, norm(sub(plant.x_load, estimator.load.x_load))),
        min(f.rotor_min, force[0], force[1], force[2], force[3]),
        max(f.rotor_max, force[0], force[1], force[2], force[3]),
    )
    pack(after, figures, 0)


@kernel
def _trace(trace: Floats, world: World) -> None:
    if world.tick < trace.shape[0]:
        row, plant = trace[world.tick], world.plant
        for i in range(3):
            row[i] = plant.x_load[i]
            row[3 + i] = plant.x_quad[i]
        for i in range(4):
            row[6 + i] = plant.quat_wxyz[i]
            row[10 + i] = plant.rotor_force[i]


@kernel
def fly_stretch(
    world: WorldRows,
    core: CoreRows,
    law_rows: Any,
    wire: Row,
    figures: Row,
    asked: Floats,
    trace: Floats,
    begun: bool,
    decided: bool,
    gripper_open: bool,
    reel_rate: float,
    stop_tick: int,
) -> bool:
    """Fly until the supervisor is to be asked (True) or the tick `stop_tick` is over (False).

    `begun`: the present tick is over; `decided`: but for the law's part, as the supervisor was to be asked.
    `asked` (ticks, 21) is where the mission asks the load to be, from the
    first tick of the core's stretch on; without rows no figures are taken. `trace` (ticks, 14) receives the
    true state, as long as it lasts.
    """
    link = unpack(Wire, wire, 0)
    tick_us = unpack(WorldModel, world.model, 0).tick_us
    while True:
        if begun and not decided:
            forces = unpack(Pilot, core.pilot, 0).mixed.forces
            world_tick(world, wire_forces(forces), gripper_open, reel_rate)
        begun = True
        now = unpack(World, world.world, 0)
        _trace(trace, now)
        readings = 0 if decided else deliver(world, now.now_us, link, core.inbox)
        dt = 0.0 if now.tick == 0 else tick_us * 1e-6
        came = fly_tick(core, law_rows, readings, now.now_us, now.tick, dt, decided)
        decided = False
        if came == TO_DECIDE:
            return True
        if came == FLOWN and asked.shape[0] > 0:
            at = row_at(unpack(Stretch, core.stretch, 0), now.now_us)
            count(figures, world, core, vector_at(core.targets, at, 0), vector_at(asked, at, 0))
        if now.tick >= stop_tick:
            return False
