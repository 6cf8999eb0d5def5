"""The supervisor: which phase the flight is in, as a table, and what is watched in each.

`TRANSITIONS` says where each event leads; an event that is not in the table for a phase does not happen
there, and a request for it is refused. Entering a phase lays out its legs (`phase_legs`). Everything is a
function of the flight, the view and the settings.
"""

from __future__ import annotations

from dataclasses import replace
from math import degrees, isfinite

from autopilot.geometry.linear import axpy, norm, sub
from autopilot.guidance.legs import (
    LOAD_POSITION,
    QUAD_POSITION,
    Calm,
    Catch,
    Creep,
    Hold,
    Leg,
    Pass,
    Swing,
    top_of,
    transfer_leg,
)
from autopilot.guidance.setpoint_follower import SILENT, AttitudeSetpoint, Follow, PositionSetpoint, Posture
from autopilot.supervisor.phase_legs import (
    CLEARANCE,
    ENTRY,
    HEIGHT_SIGMAS,
    LEAST_HEIGHT,
    SLACK_ACCEL,
    SLACK_SPEED,
    TOUCH_HEIGHT,
    TOUCH_SPEED,
    as_flown,
    asked_motion,
    asked_of,
    borrowed,
    calm,
    following_legs,
    length_at,
    made,
    position_mode,
    step_legs,
    stop,
    swings,
)
from autopilot.supervisor.settings import Settings
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    ON_GROUND,
    Event,
    Flight,
    Guide,
    Phase,
    Report,
    Selected,
    View,
    below,
    forbidden,
    leg_time_s,
    off_mission,
    pace_of,
    setpoint,
)
from autopilot.trajectory.waypoint_path import Passage
from autopilot.wire.dialect import plumbline as mavlink
from missions.model import (
    AttitudeRun,
    Land,
    Release,
    ReturnHome,
    Speed,
    Takeoff,
    Waypoint,
    Winch,
)

P, E = Phase, Event
TRANSITIONS: dict[tuple[Phase, Event], Phase] = {
    (P.DISARMED, E.ARM): P.ARMED,
    (P.ARMED, E.DISARM): P.DISARMED,
    (P.ARMED, E.TAKEOFF): P.TAUTEN,
    (P.ARMED, E.FAIL): P.DISARMED,
    (P.TAUTEN, E.TAUT): P.LIFT,
    (P.TAUTEN, E.LAND): P.SET_DOWN,
    (P.LIFT, E.DONE): P.HOLD,
    (P.LIFT, E.HOLD): P.HOLD,
    (P.LIFT, E.GUIDE): P.GUIDED,
    (P.LIFT, E.LAND): P.LOWER,
    (P.HOLD, E.HOLD): P.HOLD,
    (P.HOLD, E.MISSION): P.MISSION,
    (P.HOLD, E.GUIDE): P.GUIDED,
    (P.HOLD, E.RETURN): P.RETURN,
    (P.HOLD, E.LAND): P.LOWER,
    (P.MISSION, E.DONE): P.HOLD,
    (P.MISSION, E.HOLD): P.HOLD,
    (P.MISSION, E.MISSION): P.MISSION,
    (P.MISSION, E.RETURN): P.RETURN,
    (P.MISSION, E.GUIDE): P.GUIDED,
    (P.MISSION, E.LAND): P.LOWER,
    (P.RETURN, E.DONE): P.LOWER,
    (P.RETURN, E.HOLD): P.HOLD,
    (P.RETURN, E.MISSION): P.MISSION,
    (P.RETURN, E.LAND): P.LOWER,
    (P.RETURN, E.GUIDE): P.GUIDED,
    (P.GUIDED, E.GUIDE): P.GUIDED,
    (P.GUIDED, E.HOLD): P.HOLD,
    (P.GUIDED, E.MISSION): P.MISSION,
    (P.GUIDED, E.RETURN): P.RETURN,
    (P.GUIDED, E.LAND): P.LOWER,
    (P.GUIDED, E.LOAD_DOWN): P.SET_DOWN,
    (P.LOWER, E.LOAD_DOWN): P.SET_DOWN,
    (P.LOWER, E.VEHICLE_DOWN): P.DISARMED,  # without a load
    (P.LIFT, E.LOAD_DOWN): P.SET_DOWN,
    (P.HOLD, E.LOAD_DOWN): P.SET_DOWN,
    (P.MISSION, E.LOAD_DOWN): P.SET_DOWN,
    (P.RETURN, E.LOAD_DOWN): P.SET_DOWN,
    (P.LOWER, E.HOLD): P.HOLD,
    (P.LOWER, E.MISSION): P.MISSION,
    (P.LOWER, E.RETURN): P.RETURN,
    (P.LOWER, E.GUIDE): P.GUIDED,
    (P.SET_DOWN, E.VEHICLE_DOWN): P.DISARMED,
    (P.FAILSAFE, E.DISARM): P.DISARMED,
    **{(phase, E.FAIL): P.FAILSAFE for phase in IN_AIR},
    **{(phase, E.DISARM): P.DISARMED for phase in IN_AIR},  # forced disarming only
}

INFO, WARNING, CRITICAL = (
    mavlink.MAV_SEVERITY_INFO,
    mavlink.MAV_SEVERITY_WARNING,
    mavlink.MAV_SEVERITY_CRITICAL,
)

ASTRAY = 0.08  # m beside the load at which the vehicle that pulls the cable taut is moved over it
LOAD_SUNK, VEHICLE_SUNK = 0.05, 0.15  # m by which the setpoint must be below what stopped
LIFT_OFF_US = 1_000_000  # after which a load that is being lifted is off the ground
LYING_SPEED = 0.3  # m/s, less of a fallen load is noise or creep
STILL_SPEED, STILL_US = 0.05, 200_000
IDLE_DISARM_US = 10_000_000
FAILSAFE_DISARM_US = 3_000_000
SETTLE_S = 3.0  # hold after an attitude run
RELEASED_TEXT = "Load released"
SLACK, PULLED = 0.1, 0.3  # weights of the load: less is no pull of the cable, more is one
LEAST_GAP = 0.005  # m by which a cable must be too short for its ends to be believed slack
SLACK_US, PULL_US = 20_000, 100_000  # for which it must be so
TAUT_LATEST = 1.3  # cable lengths over the load by which the cable must have come taut


NO_ACTION, TERMINATE = 0, 4  # GF_ACTION
STOP_MARGIN = 0.05  # of the way to where the load would stop: while it speeds up, that moves on
FENCE_EVENTS = {2: E.HOLD, 3: E.RETURN, 5: E.LAND}


def enter(flight: Flight, phase: Phase, view: View, settings: Settings) -> Flight:
    """The flight in `phase`, with the legs with which the phase begins."""
    legs: tuple[Leg, ...]
    if phase in CARRYING and flight.phase in CARRYING and flight.legs and swings(flight.legs[0]):
        legs = (calm(flight.legs[0], view, settings, ends_step=False),)
    else:
        legs = ENTRY[phase](flight, view, settings) if phase in ENTRY else ()
    entered = replace(
        flight,
        phase=phase,
        phase_start_us=view.now_us,
        legs=as_flown(flight, legs),
        leg_start_us=view.now_us,
        still_since_us=-1,
        following=(),
    )
    return replace(entered, following=following_legs(entered, settings))


def happen(flight: Flight, event: Event, view: View, settings: Settings) -> Flight | None:
    """The flight after an event; None where the table has no room for it."""
    phase = TRANSITIONS.get((flight.phase, event))
    if phase == P.TAUTEN and flight.cable.released:  # there is no cable to pull taut
        phase = P.LIFT
    return None if phase is None else enter(flight, phase, view, settings)


# ---- from tick to tick


def advance(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The flight at `view.now_us`: legs that are over, events that the world brings, and what they mean."""
    if flight.phase in IN_AIR:
        trouble = _trouble(flight, view, settings)
        if trouble:
            return _given_up(flight, trouble, view, settings)
    if flight.phase == P.ARMED and view.now_us - flight.phase_start_us > IDLE_DISARM_US:
        return _to(flight, E.DISARM, view, settings, (INFO, "Disarmed: nothing was asked of the vehicle"))
    if flight.phase == P.FAILSAFE and view.now_us - flight.phase_start_us > FAILSAFE_DISARM_US:
        return _to(flight, E.DISARM, view, settings, (WARNING, "Disarmed after failsafe"))
    had_load = not flight.cable.released
    if flight.phase in CARRYING and had_load:
        flight = _note_slack(flight, view, settings)
        caught = _watch_slack(flight, view, settings)
        if caught is not None:
            return caught
    if flight.phase in CARRYING:
        stopped = _watch_fence(flight, view, settings)
        if isinstance(stopped, tuple):
            return stopped
        flight = stopped
    if flight.phase == P.TAUTEN and len(flight.legs) == 1:
        flight = _note_pull(flight, view, settings)
        if flight.still_since_us >= 0 and view.now_us - flight.still_since_us >= PULL_US:
            flight = replace(
                flight, cable=replace(flight.cable, taut_length_m=norm(sub(view.x_quad, view.x_load)))
            )
            return _to(flight, E.TAUT, view, settings, (INFO, "Cable taut, lifting the load"))
        flight = _over_load(flight, view)
        creeps = len(flight.legs) == 1 and flight.still_since_us < 0
        if creeps and flight.legs[0].jet(leg_time_s(flight, view.now_us))[0][2] > _taut_by(
            flight, view, settings
        ):
            text = "Cable never taut, landing; check VEH_CABLE_LEN"
            return _to(off_mission(flight), E.LAND, view, settings, (CRITICAL, text))
    if flight.phase in (P.LOWER, P.SET_DOWN):
        flight = _watch_touchdown(flight, view, settings)
        if flight.still_since_us >= 0 and view.now_us - flight.still_since_us >= STILL_US:
            if flight.phase == P.LOWER and had_load:
                return _to(flight, E.LOAD_DOWN, view, settings, (INFO, "Load on the ground"))
            return _landed(flight, view, settings)
    reached: tuple[int, ...] = ()
    texts: tuple[tuple[int, str], ...] = ()
    if flight.phase == P.ARMED and flight.selected == Selected.OFFBOARD:
        flight = _rise(flight, view, settings)
    if flight.phase == P.GUIDED:
        flight, told = _guide(flight, view, settings)
        texts += told.texts
    # a step may take no time at all: go on until one does
    while flight.phase in IN_AIR and (
        not flight.legs or leg_time_s(flight, view.now_us) >= flight.legs[0].duration_s
    ):
        if len(flight.legs) > 1:
            ended = flight.leg_start_us + round(flight.legs[0].duration_s * 1e6)
            flight = _reeled(flight)
            flight = replace(flight, legs=flight.legs[1:], leg_start_us=ended)
            continue
        flight, more = _legs_done(_reeled(flight), view, settings)
        reached += more.reached
        texts += more.texts
    if flight.cable.released and had_load:
        texts += ((INFO, RELEASED_TEXT),)
    return flight, Report(texts, reached)


def _reeled(flight: Flight) -> Flight:
    """The flight at the end of its present leg, with the cable that this leg leaves."""
    leg = flight.legs[0] if flight.legs else None
    top = None if leg is None else top_of(leg)
    if leg is None or top is None:
        return flight
    length = top - leg.jet(leg.duration_s)[0][2]
    return replace(flight, cable=replace(flight.cable, length_m=length, reel_rate=0.0, reel_accel=0.0))


def _to(
    flight: Flight, event: Event, view: View, settings: Settings, text: tuple[int, str]
) -> tuple[Flight, Report]:
    after = happen(flight, event, view, settings)
    assert after is not None, (flight.phase, event)
    if after.phase == P.DISARMED:
        after = disarmed(after)
    return after, Report((text,))


def disarmed(flight: Flight) -> Flight:
    """The flight with its rotors stopped: nothing selected, the mission rewound."""
    return replace(
        flight,
        selected=Selected.NOTHING,
        mission=replace(flight.mission, active=False, step=0, step_anchor=None),
        cable=replace(flight.cable, reel_to_m=None),
        legs=(),
    )


def _landed(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    reached: tuple[int, ...] = ()
    if flight.mission.active:
        reached = (flight.mission.plan.sequence[flight.mission.step],)
        flight = replace(
            flight,
            mission=replace(flight.mission, done=flight.mission.step + 1 >= len(flight.mission.plan.steps)),
        )
    after, report = _to(flight, E.VEHICLE_DOWN, view, settings, (INFO, "Landed, disarmed"))
    return after, Report(report.texts, reached)


def lost(flight: Flight, now_us: int, settings: Settings) -> bool:
    """Whether nothing is heard any more from the flight's guide."""
    if flight.setpoints.guide == Guide.OFFBOARD:
        if settings.setpoints.guided_mode:
            stays = (
                isinstance(flight.setpoints.offboard.asked, PositionSetpoint)
                and flight.setpoints.offboard.asked.is_place
            )
            return not stays and not flight.setpoints.offboard.alive(
                now_us, settings.setpoints.guided_loss_us
            )
        return not flight.setpoints.offboard.alive(now_us, settings.setpoints.offboard_loss_us)
    return flight.setpoints.guide == Guide.MANUAL and not flight.setpoints.manual.alive(
        now_us, settings.setpoints.manual_loss_us
    )


def _guide(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The load led on towards what is asked at this moment; held if nobody asks any more."""
    if lost(flight, view.now_us, settings):
        text = f"Nothing heard from {flight.setpoints.guide.value} any more: holding"
        return _to(flight, E.HOLD, view, settings, (WARNING, text))
    if (
        flight.setpoints.guide == Guide.ORBIT
        and flight.setpoints.circle is not None
        and view.now_us >= flight.setpoints.circle.ends_us
    ):
        return _to(flight, E.HOLD, view, settings, (INFO, "Circle flown: holding"))
    asked, leg = asked_of(flight), flight.legs[0]
    if isinstance(leg, Posture) and isinstance(asked, AttitudeSetpoint):
        return replace(flight, legs=(replace(leg, lean=asked),)), Report()
    if isinstance(leg, Follow) and isinstance(asked, AttitudeSetpoint):
        return enter(flight, P.GUIDED, view, settings), Report()
    if isinstance(leg, Posture):
        return enter(flight, P.GUIDED, view, settings), Report()
    if isinstance(leg, Follow) and asked is not None and not isinstance(asked, AttitudeSetpoint):
        t = leg_time_s(flight, view.now_us)
        led = leg.onward(t, asked, pace_of(flight, settings), view.now_us)
        return replace(flight, legs=as_flown(flight, (led,)), leg_start_us=view.now_us), Report()
    return flight, Report()


def _rise(flight: Flight, view: View, settings: Settings) -> Flight:
    """From the ground a setpoint above it takes the load up."""
    asked = flight.setpoints.offboard.asked
    if not isinstance(asked, PositionSetpoint) or lost(flight, view.now_us, settings):
        return flight
    height = asked.position[2]
    if not height >= LEAST_HEIGHT:
        if not asked.velocity[2] > 0.0:
            return flight
        height = LEAST_HEIGHT
    up = replace(
        flight,
        mission=replace(
            flight.mission, speed_m_s=settings.motion.speed_m_s, takeoff_altitude_m=height, active=False
        ),
    )
    after = happen(up, E.TAKEOFF, view, settings)
    assert after is not None
    return after


def _legs_done(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The last leg of the present phase is over."""
    calm = flight.legs[0] if flight.legs else None
    if isinstance(calm, Calm) and not calm.ends_step:  # now the phase can begin
        legs = as_flown(flight, ENTRY[flight.phase](flight, view, settings))
        return replace(flight, legs=legs, leg_start_us=view.now_us), Report()
    if flight.mission.active and flight.phase in (P.LIFT, P.MISSION):
        return _step_done(flight, view, settings)
    if flight.phase == P.LIFT and flight.selected == Selected.OFFBOARD:
        offboard = replace(flight, setpoints=replace(flight.setpoints, guide=Guide.OFFBOARD))
        if not lost(offboard, view.now_us, settings):
            return enter(offboard, P.GUIDED, view, settings), Report()
    after = happen(flight, E.DONE, view, settings)
    if after is None:  # a phase whose last leg has no end
        legs, here = stop(flight, view, settings)
        legs = as_flown(flight, (*legs, Hold(here)))
        return replace(flight, legs=legs, leg_start_us=view.now_us), Report()
    return after, Report()


def _step_done(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report]:
    """The present mission step is over: the next one, or the end of the mission."""
    plan = flight.mission.plan
    step = plan.steps[flight.mission.step]
    if flight.phase == P.LIFT and not isinstance(step, Takeoff):  # lifted unasked
        return begin_step(flight, view, settings), Report()
    following = plan.steps[flight.mission.step + 1] if flight.mission.step + 1 < len(plan.steps) else None
    swung = flight.legs[0] if flight.legs else None
    if isinstance(swung, Swing) and not isinstance(following, AttitudeRun):
        calmed = calm(swung, view, settings, ends_step=True)
        return replace(flight, legs=(calmed,), leg_start_us=view.now_us), Report()
    if isinstance(swung, Calm):
        legs, here = stop(flight, view, settings)
        return replace(flight, legs=(*legs, Hold(here, SETTLE_S)), leg_start_us=view.now_us), Report()
    done = Report((), (plan.sequence[flight.mission.step],))
    flight = replace(
        flight,
        mission=replace(flight.mission, step=flight.mission.step + 1, step_anchor=None),
        cable=replace(flight.cable, reel_to_m=None),
    )
    if following is None:
        rewound = replace(flight, mission=replace(flight.mission, active=False, done=True, step=0))
        if isinstance(
            step, ReturnHome
        ):  # a return that nothing follows ends on the ground, as ordered by mode
            down = enter(rewound, P.LOWER, view, settings)
            return down, Report(((INFO, "Mission complete, landing"),), done.reached)
        return enter(rewound, P.HOLD, view, settings), Report(
            ((INFO, "Mission complete, holding"),), done.reached
        )
    ahead = made(flight, flight.mission.step)
    if isinstance(swung, Pass) and isinstance(ahead, Passage) and ahead.table is swung.path.table:
        # past the waypoint without a stop; the clock goes on from where the stretch ended
        assert isinstance(following, Waypoint)
        legs = (replace(swung, path=ahead),)
        if following.hold_s > 0.0:
            there = (following.east_m, following.north_m, following.altitude_m)
            legs += (Hold(there, max(following.hold_s - borrowed(flight), 0.0)),)
        passed = flight.leg_start_us + round(swung.duration_s * 1e6)
        gone = replace(flight, legs=as_flown(flight, legs), leg_start_us=passed)
        return replace(gone, following=following_legs(gone, settings)), done
    if isinstance(swung, Swing):
        # the next run takes the motion over as it is; only the height is still that of the first
        here = (view.x_load[0], view.x_load[1], swung.anchor[2])
        legs = step_legs(following, here, flight, settings)
        return replace(
            flight, legs=legs, leg_start_us=view.now_us, mission=replace(flight.mission, step_anchor=here)
        ), done
    return begin_step(flight, view, settings), done


def begin_step(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight on its present mission step, begun anew or taken up again."""
    step = flight.mission.plan.steps[flight.mission.step]
    if isinstance(step, Speed):
        flight = replace(flight, mission=replace(flight.mission, speed_m_s=step.speed_m_s))
    if isinstance(step, Land):
        return enter(flight, P.LOWER, view, settings)
    if isinstance(step, Winch) and flight.cable.reel_to_m is None:
        here = stop(flight, view, settings)[1]
        flight = replace(
            flight, cable=replace(flight.cable, reel_to_m=length_at(flight, here, settings) + step.length_m)
        )
    if isinstance(step, Release) and not flight.cable.released:
        flight = replace(flight, cable=replace(flight.cable, released=True, slack_since_us=-1), legs=())
    if flight.mission.step_anchor is None and not (flight.legs and swings(flight.legs[0])):
        flight = replace(flight, mission=replace(flight.mission, step_anchor=stop(flight, view, settings)[1]))
    return enter(flight, P.MISSION, view, settings)


def release(flight: Flight, view: View, settings: Settings) -> Flight:
    """The flight whose load was let go by command: the vehicle goes on alone, a mission is held."""
    if flight.cable.released:
        return flight
    alone = replace(flight, cable=replace(flight.cable, released=True, slack_since_us=-1), still_since_us=-1)
    if flight.phase in ON_GROUND or flight.phase in (P.SET_DOWN, P.FAILSAFE):
        return alone
    alone = off_mission(alone)
    if flight.phase == P.TAUTEN:
        return enter(alone, P.LIFT, view, settings)
    alone = replace(alone, legs=())
    if flight.phase == P.GUIDED and isinstance(asked_of(flight), AttitudeSetpoint):
        return enter(
            replace(alone, setpoints=replace(alone.setpoints, offboard=SILENT)), P.HOLD, view, settings
        )
    held = flight.mission.active or flight.phase == P.MISSION
    return enter(alone, P.HOLD if held else flight.phase, view, settings)


def _watch_touchdown(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the thing that is set down no longer follows its sinking setpoint.

    A load that still sinks keeps behind the setpoint by what it sinks in the lag of the law.
    The vehicle must stand still as well: a gust may hold it up. The load's velocity says nothing once the
    cable is slack.
    """
    leg = flight.legs[0]
    if isinstance(leg, Creep):
        target = leg.jet(leg_time_s(flight, view.now_us))[0][2]
        if leg.control_mode == LOAD_POSITION:
            down = view.x_load[2] - target > LOAD_SUNK + settings.ramp_lag_s * TOUCH_SPEED
        else:
            down = view.x_quad[2] - target > VEHICLE_SUNK and abs(view.v_quad[2]) < STILL_SPEED
        if down:
            return flight if flight.still_since_us >= 0 else replace(flight, still_since_us=view.now_us)
    return flight if flight.still_since_us < 0 else replace(flight, still_since_us=-1)


def _over_load(flight: Flight, view: View) -> Flight:
    """The rising vehicle, moved over a load that was not seen well from the ground."""
    creep = flight.legs[0]
    assert isinstance(creep, Creep)
    at = creep.jet(leg_time_s(flight, view.now_us))[0]
    over = (view.x_load[0], view.x_load[1], at[2])
    if norm(sub(over, at)) <= ASTRAY:
        return flight
    legs = (
        transfer_leg(at, over, SLACK_SPEED, SLACK_ACCEL, QUAD_POSITION),
        replace(creep, begin=over),
    )
    return replace(flight, legs=legs, leg_start_us=view.now_us)


def _share_pulled(view: View, settings: Settings) -> float:
    """Pull of the cable in weights of the load; by its length alone where no accelerometer tells."""
    if isfinite(view.pull_n):
        return view.pull_n / settings.load_weight_n
    return 1.0 if view.taut else 0.0


def _note_pull(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the cable that is being tautened pulls.

    It counts as taut a little before it is: if lifting began then, it would come taut in the middle of it.
    """
    pulls = _share_pulled(view, settings) > PULLED and view.taut
    if pulls == (flight.still_since_us >= 0):
        return flight
    return replace(flight, still_since_us=view.now_us if pulls else -1)


def _note_slack(flight: Flight, view: View, settings: Settings) -> Flight:
    """Note since when the cable is slack although the load should hang on it; while it is caught: taut.

    A gust can hide or feign a pull, a tracker's noise a few millimetres: both must tell of a small gap.
    """
    if isinstance(flight.legs[0], Catch):
        noted = view.taut
    else:
        gap = flight.cable.taut_length_m - norm(sub(view.x_quad, view.x_load))
        loose = not view.taut or (gap > LEAST_GAP and _share_pulled(view, settings) < SLACK)
        lifting = flight.phase == P.LIFT and view.now_us - flight.phase_start_us < LIFT_OFF_US
        on_ground = lifting or (flight.phase == P.LOWER and isinstance(flight.legs[0], Creep))
        noted = loose and not on_ground
    if noted == (flight.cable.slack_since_us >= 0):
        return flight
    return replace(flight, cable=replace(flight.cable, slack_since_us=view.now_us if noted else -1))


def _watch_slack(flight: Flight, view: View, settings: Settings) -> tuple[Flight, Report] | None:
    """Catch a load that falls freely; take the phase up again when it hangs on the cable."""
    fallen = view.x_load[2] < TOUCH_HEIGHT and norm(view.v_load) < LYING_SPEED
    if isinstance(flight.legs[0], Catch) and fallen:
        flight = replace(
            flight,
            mission=replace(flight.mission, active=False),
            cable=replace(flight.cable, slack_since_us=-1),
        )
        return _to(flight, E.LOAD_DOWN, view, settings, (CRITICAL, "The load fell to the ground: landing"))
    if flight.cable.slack_since_us < 0:
        return None
    lasted_us = view.now_us - flight.cable.slack_since_us
    if not isinstance(flight.legs[0], Catch):
        if lasted_us < SLACK_US:
            return None
        catch = Catch(view.x_quad, flight.cable.taut_length_m, settings.motion.snap_speed_m_s)
        caught = replace(
            flight, legs=(catch,), leg_start_us=view.now_us, cable=replace(flight.cable, slack_since_us=-1)
        )
        return caught, Report(((WARNING, "Cable slack: falling with the load to catch it"),))
    if lasted_us < PULL_US and not (lasted_us >= SLACK_US and _share_pulled(view, settings) > SLACK):
        return None
    again = flight.mission.active and flight.cable.slack_step == flight.mission.step
    flight = replace(
        flight,
        legs=(),
        cable=replace(
            flight.cable, slack_since_us=-1, slack_step=flight.mission.step if flight.mission.active else -1
        ),
    )
    if again:  # the step itself asks for it
        held = enter(off_mission(flight), P.HOLD, view, settings)
        return held, Report(((CRITICAL, "Cable slack again in this mission item: holding"),))
    return enter(flight, flight.phase, view, settings), Report(((INFO, "Load caught"),))


def _watch_fence(flight: Flight, view: View, settings: Settings) -> Flight | tuple[Flight, Report]:
    """What GF_ACTION says where load or vehicle is over the fence, or the load could not stop before it."""
    limited = flight.area.fence.zones or settings.fence.radius_m > 0.0 or settings.fence.height_m > 0.0
    if settings.fence.action == NO_ACTION or not limited or isinstance(flight.legs[0], Catch):
        return flight
    over = below(view.x_quad, settings)
    places = [over] if flight.cable.released else [view.x_load, over]
    if not swings(flight.legs[0]):
        here, end = asked_motion(flight, view, settings)[0], stop(flight, view, settings)[1]
        ahead = [here, axpy(STOP_MARGIN, sub(end, here), end)]
        places += [below(place, settings) for place in ahead] if flight.cable.released else ahead
    why = next(filter(None, (forbidden(flight.area.fence, place, settings) for place in places)), "")
    if bool(why) == bool(flight.area.breach):
        return flight
    if not why:
        return replace(flight, area=replace(flight.area, breach=""))
    noted = replace(
        flight,
        area=replace(flight.area, breach=why, breaches=flight.area.breaches + 1, breach_us=view.now_us),
    )
    event = FENCE_EVENTS.get(settings.fence.action)
    text = (WARNING, f"Fence: {why}")
    if settings.fence.action == TERMINATE:
        return _given_up(noted, f"fence: {why}", view, settings)
    landing = flight.phase == P.LOWER and event == E.LAND
    if event is None or landing or (flight.phase, event) not in TRANSITIONS:
        return noted, Report((text,))
    return _to(off_mission(noted), event, view, settings, text)


def _taut_by(flight: Flight, view: View, settings: Settings) -> float:
    """Height over home that the vehicle need not climb beyond to pull the cable taut."""
    creep = flight.legs[0]
    assert isinstance(creep, Creep)
    unsure = HEIGHT_SIGMAS * view.height_std
    return creep.begin[2] + (TAUT_LATEST - CLEARANCE) * settings.cable_length_m + unsure


def _trouble(flight: Flight, view: View, settings: Settings) -> str:
    """Why the flight cannot go on, or an empty string."""
    if view.complaints:
        return view.complaints[0]
    if not all(map(isfinite, (view.tilt_rad, *view.x_quad, *view.v_quad, *view.x_load, *view.v_load))):
        return "the estimate is no number"
    if view.tilt_rad > settings.failsafe.tilt_limit_rad:
        limit = degrees(settings.failsafe.tilt_limit_rad)
        return f"tilt {degrees(view.tilt_rad):.0f} deg exceeds FS_TILT_DEG {limit:.0f}"
    if flight.phase in CARRYING and flight.legs and flight.legs[0].control_mode == position_mode(flight):
        jet = setpoint(flight, view.now_us)
        what, place = ("vehicle", view.x_quad) if flight.cable.released else ("load", view.x_load)
        error = norm(sub(place, jet[0])) if jet is not None else 0.0
        if not error <= settings.failsafe.load_error_limit_m:
            return (
                f"{what} error {error:.1f} m exceeds FS_LOAD_ERR {settings.failsafe.load_error_limit_m:.1f} m"
            )
    return ""


def _given_up(flight: Flight, why: str, view: View, settings: Settings) -> tuple[Flight, Report]:
    after = happen(off_mission(flight), E.FAIL, view, settings)
    assert after is not None, flight.phase
    return after, Report(((mavlink.MAV_SEVERITY_EMERGENCY, f"Flight given up: {why}"),))
