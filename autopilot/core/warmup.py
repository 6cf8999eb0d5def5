"""Every kernel of a flight called once on the ground, so that none has to be compiled in the air."""

from __future__ import annotations

from autopilot.control.actuators.disturbance_observer import nominal
from autopilot.control.actuators.mixer import mix
from autopilot.core.tick import Setup, initial_state, step, track
from autopilot.estimation.filter import Readings, control_state
from autopilot.estimation.records import ImuReading, LoadReading, PoseReading, new_history
from autopilot.estimation.release import parted
from autopilot.geometry.linear import E3, ZERO
from autopilot.geometry.s2 import tangent
from autopilot.geometry.so3 import IDENTITY_QUAT
from autopilot.guidance.legs import (
    LOAD_ATTITUDE,
    LOAD_POSITION,
    QUAD_ATTITUDE,
    QUAD_POSITION,
    Creep,
    Hold,
    Leg,
    Run,
    Swing,
    transfer_leg,
)
from autopilot.trajectory.shaping import shape
from missions.model import Signals, Sine, Term


def rehearse(setup: Setup) -> None:
    """Run estimator, guidance, every mode of the law and the mixer for an instant."""
    length = setup.vehicle.cable_length
    over = (0.0, 0.0, 1.0 + length)
    load = (0.0, 0.0, 1.0)
    readings = Readings(
        ImuReading(ZERO, (0.0, 0.0, setup.vehicle.gravity)),
        (PoseReading(0.0, over, IDENTITY_QUAT, ZERO, 0.001, 0.001, 0.001),),
        (LoadReading(0.0, load, ZERO, 0.001, 0.001),),
    )
    state, history = initial_state(), new_history()
    for tick in range(3):
        state, _ = step(state, history, readings, setup, tick * 4000, tick, 0.004)
    motion = control_state(state.estimator)
    hanging = state.estimator._replace(load=state.estimator.load._replace(taut=1.0))
    parted(hanging, history, setup.tuning)
    wave = Signals(
        1.0, (Term("x", 0.01, 0.0, 1.0, None, 0.0, (Sine(1.0),)), Term("x", 0.1, 0.0, 1.0, None, 0.0))
    )
    legs: tuple[Leg, ...] = (
        Hold(load),
        transfer_leg(load, over, 1.0, 1.0, LOAD_POSITION),
        Creep(over, ZERO, QUAD_POSITION),
        Run(load, shape(wave, setup.settings.limits.body, setup.settings.limits.bounds)),
        Swing(load, 0.1, 0.1, 1.0, LOAD_ATTITUDE),
        Swing(load, 0.1, 0.1, 1.0, QUAD_ATTITUDE),
    )
    tangent(E3, ZERO)  # for the supervisor, when a swing is calmed
    for leg in legs:
        jet = leg.jet(0.5)
        memory = setup.law.start(motion, jet[0], jet[1])
        _, command = track(setup, memory, motion, leg, jet, 0.5, state.actuation, nominal(setup.vehicle))
        mix(command.thrust, command.moment, setup.vehicle, setup.limited)
