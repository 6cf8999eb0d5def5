"""What a mission leaves of the charge of the battery, if the simulated vehicle has one.

From arming to the end the rotors are taken to give what the vehicle needs to hover, with its load until this
is released. What they give to accelerate, and less on the ground, changes this by a hundredth or two.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np

from autopilot.vehicle.file import load_truth_and_belief
from autopilot.vehicle.low_battery import REACTIONS
from autopilot.vehicle.parameters import AutopilotParameters
from sitl.plant.drive import EXHAUSTED_SHARE, FULL, discharged, share_left
from sitl.vehicles.truth import truth_of

_STEP_S = 1.0


class Charge(NamedTuple):
    """The charge during a flight."""

    left: float  # share that is left at the end
    lasts_s: float | None  # time in the air after which it carries nothing any more; None: it does in the end


def charge_after(vehicle: str, carrying_s: float, alone_s: float) -> Charge | None:
    """The charge of a vehicle that flies with its load for so long, and then without it; None if the
    simulated vehicle has no battery that limits it."""
    found, _ = load_truth_and_belief(vehicle)
    truth, rotors, supply, flown_s = truth_of(found), len(found.layout), FULL, 0.0
    if not truth.drive.battery:
        return None
    for mass, lasts_s in ((truth.quad_mass + truth.load_mass, carrying_s), (truth.quad_mass, alone_s)):
        steps = ceil(lasts_s / _STEP_S)
        forces = np.full(rotors, mass * truth.gravity / rotors)
        for _ in range(steps):
            supply = discharged(supply, forces, rotors, truth, lasts_s / steps)
            flown_s += lasts_s / steps
            if share_left(supply, truth.drive) <= EXHAUSTED_SHARE:
                return Charge(0.0, flown_s)
    return Charge(share_left(supply, truth.drive), None)


def charge_warning(left: float, table: AutopilotParameters) -> str | None:
    """A line if the vehicle will warn of its battery during the flight, or act, when this share is left."""
    low, critical = table["BAT_LOW_THR"], table["BAT_CRIT_THR"]
    if left >= low:
        return None
    reaction = REACTIONS.get(int(table["COM_LOW_BAT_ACT"]))
    if reaction is not None and left < critical:
        then = f"the vehicle {reaction.critical}s at {100.0 * critical:.0f} % (BAT_CRIT_THR, COM_LOW_BAT_ACT)"
    else:
        then = f"the vehicle warns from {100.0 * low:.0f} % on (BAT_LOW_THR)"
    return f"warning: battery: {then}"
