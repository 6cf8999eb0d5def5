"""The cable as the winch has it: what the flight believes of it, and the setup of a vehicle with that cable.

| symbol | code name | unit | |
|---|---|---|---|
| L, L', L'' | cable_m, reel_rate, reel_accel | m, m/s, m/s^2 | of the leg that reels: from vehicle to load |
| q | q_cable | | vehicle to load |

Estimator and laws know a cable of one length at each tick. What L' and L'' add to that is put where it acts:
v_L = v_Q + L q' + L' q, and in the motion of load and cable L'' is the same as a force m_Q L'' q on the
vehicle, for T = mu (q . (F_L / m_L - F_Q / m_Q) + L |q'|^2 - L''). Left out is 2 L' / L q' in q'': with L'
up to 1 m/s it is small beside the damping of the cable's loop.
"""

from __future__ import annotations

from dataclasses import replace

from autopilot.control.actuators.disturbance_observer import Observed
from autopilot.control.records import State
from autopilot.estimation.filter import Readings
from autopilot.estimation.records import EstimatorState
from autopilot.geometry.linear import Vec3, axpy
from autopilot.guidance.legs import top_of
from autopilot.supervisor.state import Flight, leg_time_s


def cable_now(flight: Flight, now_us: int) -> Flight:
    """The flight with its cable as the winch has it at this instant."""
    top = top_of(flight.legs[0]) if flight.legs else None
    if top is None:
        resting = flight.cable.reel_rate == 0.0 and flight.cable.reel_accel == 0.0
        return (
            flight if resting else replace(flight, cable=replace(flight.cable, reel_rate=0.0, reel_accel=0.0))
        )
    jet = flight.legs[0].jet(leg_time_s(flight, now_us))
    length = top - jet[0][2]
    grown = 0.0 if flight.cable.length_m is None else length - flight.cable.length_m
    return replace(
        flight,
        cable=replace(
            flight.cable,
            length_m=length,
            reel_rate=-jet[1][2],
            reel_accel=-jet[2][2],
            taut_length_m=flight.cable.taut_length_m + grown,
        ),
    )


def commanded_rate(flight: Flight, now_us: int, period_s: float) -> float:
    """Rate in m/s that the winch is to reach by the end of a period."""
    if not flight.legs or top_of(flight.legs[0]) is None:
        return 0.0
    return -flight.legs[0].jet(leg_time_s(flight, now_us) + period_s)[1][2]


def lengthened(estimator: EstimatorState, grown: float) -> EstimatorState:
    """The estimate with a cable that has grown by so many metres; a slack one has no length to speak of."""
    load = estimator.load
    if grown == 0.0 or load.taut == 0.0:
        return estimator
    return estimator._replace(load=load._replace(length=load.length + grown))


def as_if_firm(readings: Readings, estimator: EstimatorState, rate: float) -> Readings:
    """The readings as a cable of constant length would give them: the load without the winch's speed."""
    if rate == 0.0 or estimator.load.taut == 0.0:
        return readings
    back = -rate
    loads = tuple(
        load._replace(v_load=axpy(back, estimator.load.q_cable, load.v_load)) for load in readings.loads
    )
    return readings._replace(loads=loads)


def as_reeled(state: State, estimator: EstimatorState, rate: float) -> State:
    """The state with the winch's speed."""
    if rate == 0.0 or estimator.load.taut == 0.0:
        return state
    return state._replace(v_load=axpy(rate, state.q_cable, state.v_load))


def with_reel(observed: Observed, state: State, accel: float, quad_mass: float) -> Observed:
    """What is believed to push the vehicle, with what the winch's acceleration amounts to."""
    if accel == 0.0:
        return observed
    push: Vec3 = axpy(quad_mass * accel, state.q_cable, observed.push)
    return observed._replace(push=push)
