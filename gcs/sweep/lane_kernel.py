"""Ticks of eight flights at once in one call of machine code: the ticks of `gcs.sweep.kernel`, in lanes."""

from __future__ import annotations

from typing import Any

from autopilot.core.tick import FLOWN, TO_DECIDE, CoreRows, fly_tick, row_at, vector_at
from autopilot.estimation.records import History
from autopilot.geometry.kernel import kernel
from autopilot.geometry.lane_numbers import LANES
from autopilot.geometry.lanes import in_lanes, parted
from autopilot.geometry.packed import Row, unpack, with_field
from autopilot.supervisor.quiescence import Stretch
from gcs.sweep.kernel import add_to_figures
from gcs.sweep.wire import Wire, deliver_readings, put_forces
from sitl.plant.rotors import REQUESTED
from sitl.world import World, WorldModel, WorldRows, world_tick


@kernel
def world_in_lanes(rows: WorldRows) -> WorldRows:
    """The rows of the world, in lanes where each flight has its own; the others are shared."""
    return WorldRows(
        in_lanes(rows.world),
        rows.model,
        in_lanes(rows.seed),
        rows.clock,
        rows.delivery,
        in_lanes(rows.errors),
        in_lanes(rows.queue),
        in_lanes(rows.commands),
        rows.command_ring,
        in_lanes(rows.rotors),
        rows.rotor_table,
    )


@kernel
def core_in_lanes(rows: CoreRows) -> CoreRows:
    """The same for the rows of the autopilot."""
    h = rows.history
    history = History(
        in_lanes(h.ring),
        in_lanes(h.covariance),
        in_lanes(h.error),
        h.columns,
        in_lanes(h.shares),
        in_lanes(h.gain),
        in_lanes(h.scalars),
        in_lanes(h.consistency),
    )
    return CoreRows(
        in_lanes(rows.estimator),
        in_lanes(rows.control),
        in_lanes(rows.summary),
        in_lanes(rows.commands),
        history,
        in_lanes(rows.inbox),
        rows.constants,
        rows.winch,
        in_lanes(rows.stretch),
        rows.targets,
        rows.references,
        in_lanes(rows.rotors),
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
    law_rows = with_field(own_law_rows, "memory", in_lanes(own_law_rows.memory))
    figures = in_lanes(figure_rows)
    link = unpack(Wire, wire, 0)
    tick_us = unpack(WorldModel, world.model, 0).tick_us
    parted()
    for done in range(ticks):
        put_forces(core.rotors, core.table, world)
        world_tick(world, world.rotors[REQUESTED], False, 0.0)
        now = unpack(World, world.world, 0)
        readings = deliver_readings(world, now.now_us, link, core.inbox)
        outcome = fly_tick(core, law_rows, readings, now.now_us, now.tick, tick_us * 1e-6, False)
        if outcome == FLOWN and requested_path[0].shape[0] > 0:
            row = row_at(unpack(Stretch, core.stretch, 0), now.now_us)
            add_to_figures(
                figures, world, core, vector_at(core.targets, row, 0), vector_at(requested_path, row, 0)
            )
        diverged = parted()
        if outcome == TO_DECIDE:
            return done, (1 << LANES) - 1
        if diverged != 0:
            return done, diverged
    return ticks, 0
