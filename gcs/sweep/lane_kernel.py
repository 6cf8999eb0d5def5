"""Ticks of eight flights at once in one call of machine code: the ticks of `gcs.sweep.kernel`, in lanes."""

from __future__ import annotations

from typing import Any

from autopilot.core.tick import FLOWN, TO_DECIDE, CoreRows, fly_tick
from autopilot.estimation.records import History
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lane_numbers import LANES
from autopilot.geometry.lanes import as_lane_array, diverged_lanes
from autopilot.geometry.packed import Row, unpack, with_field
from gcs.sweep.kernel import add_to_figures
from gcs.sweep.wire import Wire, deliver_readings, put_forces
from sitl.plant.rotors import REQUESTED
from sitl.world import World, WorldModel, WorldRows, world_tick


@kernel
def world_in_lanes(rows: WorldRows) -> WorldRows:
    """The rows of the world, in lanes where each flight has its own; the others are shared."""
    return WorldRows(
        as_lane_array(rows.world),
        rows.model,
        as_lane_array(rows.seed),
        rows.clock,
        rows.delivery,
        as_lane_array(rows.errors),
        as_lane_array(rows.queue),
        as_lane_array(rows.commands),
        rows.command_ring,
        as_lane_array(rows.rotors),
        rows.rotor_table,
    )


@kernel
def core_in_lanes(rows: CoreRows) -> CoreRows:
    """The same for the rows of the autopilot."""
    h = rows.history
    history = History(
        as_lane_array(h.ring),
        as_lane_array(h.covariance),
        as_lane_array(h.error),
        h.columns,
        as_lane_array(h.jacobian),
        as_lane_array(h.gain),
        as_lane_array(h.scalars),
        as_lane_array(h.consistency),
    )
    return CoreRows(
        as_lane_array(rows.estimator),
        as_lane_array(rows.control),
        as_lane_array(rows.summary),
        as_lane_array(rows.commands),
        history,
        as_lane_array(rows.inbox),
        rows.constants,
        rows.winch,
        as_lane_array(rows.stretch),
        rows.targets,
        rows.references,
        as_lane_array(rows.rotors),
        rows.table,
    )


@kernel
def fly_lanes(
    world_rows: WorldRows,
    core_rows: CoreRows,
    own_law_rows: Any,
    wire: Row,
    figure_rows: Row,
    requested_path: Any,
    ticks: int,
) -> tuple[int, int]:
    """Fly `ticks` ticks; return how many of them all lanes flew alike, and one bit for each lane that took
    another branch than lane 0 in the tick after these.

    The memory of the lanes with a bit is then invalid; that of the others is the state after that tick. If
    the supervisor must decide for lane 0, all bits are set.
    """
    world, core = world_in_lanes(world_rows), core_in_lanes(core_rows)
    law_rows = with_field(own_law_rows, "memory", as_lane_array(own_law_rows.memory))
    figures = as_lane_array(figure_rows)
    link = unpack(Wire, wire, 0)
    tick_us = unpack(WorldModel, world.model, 0).tick_us
    diverged_lanes()
    for done in range(ticks):
        put_forces(core.rotors, core.table, world)
        world_tick(world, world.rotors[REQUESTED], False, 0.0)
        now = unpack(World, world.world, 0)
        readings = deliver_readings(world, now.now_us, link, core.inbox)
        outcome = fly_tick(core, law_rows, readings, now.now_us, now.tick, tick_us * 1e-6, False)
        if outcome == FLOWN and requested_path[0].shape[0] > 0:
            add_to_figures(figures, world, core, requested_path)
        diverged = diverged_lanes()
        if outcome == TO_DECIDE:
            return done, (1 << LANES) - 1
        if diverged != 0:
            return done, diverged
    return ticks, 0
