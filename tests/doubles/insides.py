"""What tests see of the inside of the autopilot and of the simulator; the one place where they look there.

No client sees these and no message carries them whole: the estimator's own state, the true state, the
settings in force. Each function goes as its subject becomes public in the product.
"""

from __future__ import annotations

from autopilot.core.tick import FlightState, Setup
from autopilot.estimation.records import History
from autopilot.onboard.flight_log import Sample
from autopilot.onboard.onboard import Onboard
from sitl.hil import HilSimulator
from sitl.sim_core import SimCore


def state_of(onboard: Onboard) -> FlightState:
    """Estimate, flight and commands after the last tick."""
    return onboard._state


def history_of(onboard: Onboard) -> History:
    """The estimator's memory, which it writes into."""
    return onboard._history


def setup_of(onboard: Onboard) -> Setup:
    """What the flight core is given, by the parameters in force."""
    return onboard._setup


def log_sample_of(onboard: Onboard) -> Sample:
    """What the flight log would record now."""
    return onboard._log_sample()


def core_of(simulator: HilSimulator) -> SimCore:
    """The simulated world behind the simulator link."""
    return simulator._core


def simulator_parameter(simulator: HilSimulator, name: str) -> float:
    """A SIM_ parameter as the simulator has it."""
    return simulator._parameters.table[name]
