"""The flight core's state as the services' snapshot."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan, sqrt

from autopilot.core.health import BatteryConstants, Condition, remaining, sensors, vibration, voltage
from autopilot.core.tick import FlightState, Setup, view_of
from autopilot.core.winch import as_reeled
from autopilot.estimation.filter import control_state
from autopilot.estimation.records import TRACKER
from autopilot.geometry.linear import ZERO, Vec3, norm, scale, sub
from autopilot.geometry.so3 import quat_from_rotation
from autopilot.guidance.legs import LOAD_POSITION, QUAD_POSITION, asked_jet
from autopilot.services import identity, snapshot
from autopilot.services.mission_store import StoredMission
from autopilot.services.snapshot import GpsFix, Snapshot
from autopilot.supervisor.requests import arming_complaints
from autopilot.supervisor.state import (
    CARRYING,
    IN_AIR,
    ON_GROUND,
    Flight,
    Guide,
    Phase,
    Selected,
    carries,
    leg_time_s,
)
from autopilot.wire.convert import HilGps, Home
from autopilot.wire.dialect import plumbline as mavlink

FRESH_S = 0.5  # a tracker is healthy while its last reading is no older
_NO_COUNT = 255  # satellites of a fix that no receiver gave

_PHASE_MODES = {
    Phase.TAUTEN: identity.AUTO_TAKEOFF,
    Phase.LIFT: identity.AUTO_TAKEOFF,
    Phase.HOLD: identity.AUTO_LOITER,
    Phase.MISSION: identity.AUTO_MISSION,
    Phase.RETURN: identity.AUTO_RTL,
    Phase.LOWER: identity.AUTO_LAND,
    Phase.SET_DOWN: identity.AUTO_LAND,
    Phase.FAILSAFE: identity.AUTO_LAND,
    Phase.GUIDED: identity.AUTO_LOITER,
}
_SELECTED_MODES = {
    Selected.NOTHING: identity.AUTO_LOITER,
    Selected.TAKEOFF: identity.AUTO_TAKEOFF,
    Selected.MISSION: identity.AUTO_MISSION,
    Selected.OFFBOARD: identity.AUTO_LOITER,
}
_GUIDE_MODES = {Guide.OFFBOARD: identity.OFFBOARD, Guide.MANUAL: identity.POSCTL}
_LANDED_STATES = {
    Phase.DISARMED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Phase.ARMED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Phase.TAUTEN: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LIFT: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Phase.LOWER: mavlink.MAV_LANDED_STATE_LANDING,
    Phase.SET_DOWN: mavlink.MAV_LANDED_STATE_LANDING,
}
_ALWAYS = snapshot.MOTORS | snapshot.AHRS | snapshot.BATTERY
_BY_TRACKER = snapshot.GPS | snapshot.MAG | snapshot.BARO
_ESTIMATING = (
    mavlink.ESTIMATOR_ATTITUDE
    | mavlink.ESTIMATOR_VELOCITY_HORIZ
    | mavlink.ESTIMATOR_VELOCITY_VERT
    | mavlink.ESTIMATOR_POS_HORIZ_REL
    | mavlink.ESTIMATOR_POS_HORIZ_ABS
    | mavlink.ESTIMATOR_POS_VERT_ABS
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
    | mavlink.ESTIMATOR_PRED_POS_HORIZ_ABS
)


@dataclass(frozen=True)
class Options:
    """What the command line decides for the whole run."""

    home: Home
    boot_unix_us: int
    lockstep: bool = True
    clock_waits: bool = True  # for the autopilot, however long it works
    log: bool = False  # flights are logged, and the shell stores what `Onboard.take_log` gives


def sub_mode(flight: Flight) -> int:
    """Sub-mode of AUTO: what was asked for, of which the phase is a part."""
    if flight.mission.active:
        return identity.AUTO_MISSION
    if flight.phase in ON_GROUND:
        return _SELECTED_MODES[flight.selected]
    return _PHASE_MODES[flight.phase]


def mode_of(flight: Flight) -> tuple[int, int]:
    """PX4's pair of what was asked for."""
    rising = flight.phase in ON_GROUND or flight.phase in (Phase.TAUTEN, Phase.LIFT)
    if flight.selected == Selected.OFFBOARD and rising:
        return identity.OFFBOARD, 0
    if flight.phase == Phase.GUIDED and flight.setpoints.guide in _GUIDE_MODES:
        return _GUIDE_MODES[flight.setpoints.guide], 0
    return identity.AUTO, sub_mode(flight)


def system_status(flight: Flight, ready: bool) -> int:
    """MAV_STATE of the flight."""
    if flight.phase == Phase.FAILSAFE:
        return mavlink.MAV_STATE_EMERGENCY
    if flight.phase == Phase.DISARMED:
        return mavlink.MAV_STATE_STANDBY if ready else mavlink.MAV_STATE_CALIBRATING
    return mavlink.MAV_STATE_ACTIVE


def mission_state(flight: Flight, items: int) -> int:
    """MISSION_STATE of the flight."""
    if items == 0:
        return mavlink.MISSION_STATE_NO_MISSION
    if flight.mission.active:
        return mavlink.MISSION_STATE_ACTIVE
    if flight.mission.done:
        return mavlink.MISSION_STATE_COMPLETE
    if flight.phase not in ON_GROUND and (flight.mission.step > 0 or flight.mission.step_anchor is not None):
        return mavlink.MISSION_STATE_PAUSED
    return mavlink.MISSION_STATE_NOT_STARTED


def sensor_bits(
    condition: Condition, state: FlightState, ready: bool, fake_gps: bool, now_us: int
) -> tuple[int, int]:
    """Sensors present and healthy, as bits of SYS_STATUS; a tracker stands in for what it makes needless."""
    present, healthy = (bits | _ALWAYS for bits in sensors(condition, now_us))
    estimator = state.estimator
    if estimator.vehicle.source == TRACKER:
        tracked = snapshot.TRACKER | (_BY_TRACKER & ~present if fake_gps else 0)
        present |= tracked
        if estimator.vehicle.age_s < FRESH_S and estimator.load.age_s < FRESH_S:
            healthy |= tracked
    if ready:
        healthy |= snapshot.PREARM
    return present, healthy


def wind(state: FlightState, setup: Setup) -> Vec3:
    """The wind (m/s) whose drag on a resting vehicle is the push that is felt; NaN where that is unknown."""
    if state.observed is None:
        return (nan, nan, nan)
    push, drag = state.observed.push, setup.drag
    force = norm(push)
    if force == 0.0:
        return push
    # force = (linear + quadratic speed) speed
    root = sqrt(drag.linear * drag.linear + 4.0 * drag.quadratic * force)
    slope = 0.5 * (drag.linear + root)
    return scale(1.0 / slope, push) if slope > 0.0 else (nan, nan, nan)


def make_snapshot(
    state: FlightState,
    setup: Setup,
    options: Options,
    mission: StoredMission,
    condition: Condition,
    battery: BatteryConstants,
    gps: HilGps | None,
    fake_gps: bool,
    now_us: int,
) -> Snapshot:
    """All that telemetry tells of this instant."""
    flight, estimator, command = state.flight, state.estimator, state.command
    control = as_reeled(control_state(estimator), estimator, flight.cable.reel_rate)
    view = view_of(estimator, control, setup.settings, now_us, carrying=carries(flight))
    ready = not arming_complaints(flight, view, setup.settings)
    present, healthy = sensor_bits(condition, state, ready, fake_gps, now_us)
    tracked = estimator.vehicle.source == TRACKER and healthy & snapshot.TRACKER
    fix = _fix(gps)
    if fix is None and fake_gps and tracked:
        accuracy = (estimator.doubt.horizontal, estimator.doubt.vertical)
        fixed = mavlink.GPS_FIX_TYPE_3D_FIX
        fix = GpsFix(now_us, fixed, control.x_quad, control.v_quad, *accuracy, _NO_COUNT)

    leg = flight.legs[0] if flight.legs else None
    x_d, v_d, a_d, x_quad_d = control.x_load, ZERO, ZERO, (nan, nan, nan)
    x_asked, v_asked = x_d, v_d
    elapsed, duration = (now_us - flight.phase_start_us) * 1e-6, nan
    if leg is not None:
        elapsed = leg_time_s(flight, now_us)
        duration = leg.duration_s if leg.duration_s < inf else nan
        jet = leg.jet(elapsed)
        if leg.control_mode == LOAD_POSITION:
            x_d, v_d, a_d = jet[0], jet[1], jet[2]
            asked = asked_jet(leg, elapsed)
            x_asked, v_asked = asked[0], asked[1]
        elif leg.control_mode == QUAD_POSITION:
            x_quad_d = jet[0]
    sequence = flight.mission.plan.sequence
    seq = sequence[min(flight.mission.step, len(sequence) - 1)] if sequence else 0
    carrying = flight.phase in CARRYING
    return Snapshot(
        now_us=now_us,
        boot_unix_us=options.boot_unix_us,
        home=options.home,
        launch=flight.area.home,
        breach=flight.area.breach,
        breaches=flight.area.breaches,
        breach_us=flight.area.breach_us,
        armed=flight.phase not in (Phase.DISARMED, Phase.FAILSAFE),
        phase=int(flight.phase),
        main_mode=mode_of(flight)[0],
        sub_mode=mode_of(flight)[1],
        landed_state=_LANDED_STATES.get(flight.phase, mavlink.MAV_LANDED_STATE_IN_AIR),
        system_status=system_status(flight, ready),
        x_quad=control.x_quad,
        v_quad=control.v_quad,
        quat_wxyz=estimator.vehicle.quat_wxyz,
        omega_body=control.omega_body,
        estimator_flags=0 if view.complaints else _ESTIMATING,
        horizontal_std=estimator.doubt.horizontal,
        vertical_std=estimator.doubt.vertical,
        x_load=control.x_load,
        v_load=control.v_load,
        q_cable=control.q_cable,
        q_cable_dot=control.q_cable_dot,
        distance=norm(sub(control.x_load, control.x_quad)),
        tension=estimator.load.tension,
        taut=view.taut,
        slack_events=state.slack_events,
        control_mode=state.control_mode,
        seq=seq,
        elapsed_s=elapsed,
        duration_s=duration,
        x_load_d=x_d,
        v_load_d=v_d,
        a_load_d=a_d,
        x_load_asked=x_asked,
        v_load_asked=v_asked,
        q_cable_c=command.q_c,
        x_quad_d=x_quad_d,
        quat_c_wxyz=quat_from_rotation(command.R_c),
        e_x=command.e_x if carrying else ZERO,
        e_v=command.e_v if carrying else ZERO,
        e_q=command.e_q,
        e_q_dot=command.e_q_dot,
        e_R=command.e_R,
        e_Omega=command.e_Omega,
        psi_R=command.psi_R,
        psi_q=command.psi_q,
        thrust=command.thrust,
        moment=command.moment,
        forces=state.mixed.forces,
        rotor_min=setup.vehicle.rotor_min if setup.limited else -inf,
        rotor_max=setup.vehicle.rotor_max if setup.limited else inf,
        saturated=state.mixed.saturated,
        sensors_present=present,
        sensors_healthy=healthy,
        gps=fix,
        vibration=vibration(condition),
        wind=wind(state, setup) if flight.phase in IN_AIR else (nan, nan, nan),
        battery_voltage=voltage(condition, battery),
        battery_current=condition.current,
        battery_used_mah=condition.used_as / 3.6,
        battery_remaining=remaining(condition, battery),
        mission_current=seq,
        mission_total=len(mission.items),
        mission_state=mission_state(flight, len(mission.items)),
        reel_rate=flight.cable.reel_rate,
    )


def _fix(gps: HilGps | None) -> GpsFix | None:
    if gps is None:
        return None
    return GpsFix(
        gps.time_us,
        gps.fix_type,
        gps.position,
        gps.velocity,
        gps.horizontal_std,
        gps.vertical_std,
        gps.satellites,
    )
