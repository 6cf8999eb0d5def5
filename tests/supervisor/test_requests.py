"""What the supervisor answers: a verdict to every request in every phase; a refusal changes nothing."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any, get_args

import pytest

from autopilot.guidance.legs import Creep, Hold, Transfer
from autopilot.services import identity, requests
from autopilot.services.records import Verdict
from autopilot.supervisor.advance import advance
from autopilot.supervisor.requests.arming import arming_problems
from autopilot.supervisor.requests.decide import decide
from autopilot.supervisor.requests.verdicts import ACCEPTED as YES
from autopilot.supervisor.settings import Settings, settings_from
from autopilot.supervisor.state import (
    IN_AIR,
    LANDING,
    ON_GROUND,
    ActionWhenArmed,
    Flight,
    MissionPlan,
    MissionProgress,
    Phase,
    is_landing,
)
from autopilot.trajectory.prepare import PENDING
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as mavlink
from missions import model
from tests.doubles.sky import ACCEPTED, SETTINGS, STEP_US, Sky, entered, hanging, view

DENIED = mavlink.MAV_RESULT_DENIED
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
R = requests

PLAN = MissionPlan(
    (
        model.Takeoff(2.0),
        model.Speed(1.0),
        model.Waypoint(1.0, 0.0, 2.0),
        model.AttitudeRun("vehicle", 0.1, 0.0, 1.0),
        model.Land(),
    ),
    (0, 1, 2, 3, 4),
    5,
)
REQUESTS: list[Any] = [
    R.Arm(True, False),
    R.Arm(True, True),
    R.Arm(False, False),
    R.Arm(False, True),
    R.EnableFence(False),
    R.InjectFailure("SIM_ENGINE_FAIL", 1, 0, True),
    R.Takeoff(None),
    R.Takeoff(3.0),
    R.Takeoff(0.1),
    R.Takeoff(math.nan),
    R.Land(),
    R.ReturnHome(),
    *(R.SetMode(main, sub) for main, sub in product((identity.AUTO, 1, 99), range(8))),
    *(R.StartMission(first) for first in (None, 0, 2, 4, 5, -1)),
    R.Pause(),
    R.Continue(),
    *(R.SetCurrent(seq) for seq in (-1, 0, 1, 2, 3, 4, 5)),
    R.ReplaceMission(0),
    R.ReplaceMission(7),
    R.Reposition(1.0, 2.0, 3.0, True),
    R.Reposition(None, None, 3.0, True),
    R.Reposition(None, None, None, True),
    R.Reposition(1.0, 2.0, 3.0, False),
    R.Reposition(math.nan, 0.0, 2.0, True),
    R.Reposition(0.0, 0.0, -2.0, True),
    *(R.SetMode(main, 0) for main in (identity.OFFBOARD, identity.POSCTL)),
    R.FollowSetpoint((1.0, 2.0, 3.0), (math.nan,) * 3, (math.nan,) * 3, False),
    R.FollowSetpoint((math.nan,) * 3, (1.0, 0.0, 0.0), (math.nan,) * 3, True),
    R.FollowSetpoint((1e9, 0.0, 0.0), (math.nan,) * 3, (math.nan,) * 3, False),
    R.FollowAttitude((0.0, 0.0, 1.0), 0.5),
    R.FollowAttitude((0.0, 0.0, 1.0), None),
    R.FollowAttitude((1.0, 0.0, 0.0), 0.5, 1.0, 0.1),
    R.FollowRates((0.1, 0.2, 0.3), 0.5),
    R.FollowSetpoint((math.nan,) * 3, (1.0, math.nan, 0.0), (math.nan,) * 3, True, True, 1.0, 0.2),
    R.TurnHeading(1.0),
    R.TurnHeading(1.0, True, -1, 0.1),
    R.LookAt(1.0, 2.0),
    R.LookAt(math.inf, 2.0),
    R.LookAt(None, None),
    R.SetMode(identity.OFFBOARD, 0),
    R.FollowStick((0.0, 0.0, 0.0)),
    R.SetMode(identity.POSCTL, 0),
    R.FollowTarget((5.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    R.SetMode(identity.AUTO, identity.AUTO_FOLLOW),
    R.FollowTarget((6.0, 0.0, 0.0), None),
    R.FollowTarget((math.nan, 0.0, 0.0), None),
    R.Orbit(2.0, 1.0, 0.0, 0.0, 3.0),
    R.Orbit(-2.0, None, None, None, None),
    R.Orbit(0.0, 1.0, None, None, None),
    R.ChangeAltitude(3.0),
    R.ChangeAltitude(math.nan),
    R.SetHome((0.0, 0.0, 50.0)),
    R.ChangeSpeed(2.0),
    R.ChangeSpeed(math.nan),
    R.ChangeSpeed(-1.0),
    R.SetHome(None),
    R.SetHome((0.0, 0.0, 0.0)),
    R.Winch(0.5),
    R.Winch(-math.inf, 0.1),
    R.Winch(math.nan),
    R.Winch(0.0),
    R.Release(),
    R.Grab(),
    R.Terminate(),
    R.RunPrearmChecks(),
    R.Reboot(),
    R.ChangeVehicle("VEH_CABLE_LEN"),
    R.ChangeSigningKey(),
    R.StoreParameters(True),
    R.ResetParameters(),
    R.RequestMessage(1, 0.0),
    R.SetMessageInterval(1, 1),
    R.GetMessageInterval(1),
    R.RequestCapabilities(),
]


def flight_in(phase: Phase, on_mission: bool, plan: MissionPlan) -> Flight:
    """A flight in the first leg of a phase; on the mission's waypoint if it is on a mission."""
    step = 2 if plan.steps else 0
    action_when_armed = ActionWhenArmed.MISSION if on_mission else ActionWhenArmed.NOTHING
    held = Flight(
        Phase.HOLD,
        mission=MissionProgress(plan=plan, step=step, takeoff_altitude_m=4.0, speed_m_s=1.0),
        action_when_armed=action_when_armed,
    )
    if phase in ON_GROUND or phase == Phase.FAILSAFE:
        return replace(held, phase=phase)
    if phase == Phase.MISSION and not plan.steps:
        return replace(held, phase=phase, legs=(Hold((0.5, 0.0, 2.0)),))
    begun = entered(held, phase, hanging(x=(0.5, 0.0, 2.0)), SETTINGS)
    return replace(begun, mission=replace(begun.mission, active=on_mission))


def seen_in(phase: Phase) -> Any:
    return view(STEP_US) if phase in ON_GROUND else hanging(STEP_US, (0.5, 0.0, 2.0))


def test_every_request_is_asked() -> None:
    assert {type(request) for request in REQUESTS} == set(get_args(requests.Request))


@pytest.mark.parametrize(
    "plan",
    [PLAN, replace(PLAN, prepared=PENDING), MissionPlan()],
    ids=["mission", "paths not yet prepared", "no mission"],
)
@pytest.mark.parametrize("on_mission", [False, True])
@pytest.mark.parametrize("released", [False, True])
@pytest.mark.parametrize("phase", Phase)
def test_every_request_in_every_phase_gets_a_verdict_and_a_refusal_changes_nothing(
    phase: Phase, released: bool, on_mission: bool, plan: MissionPlan
) -> None:
    for request in REQUESTS:
        before = flight_in(phase, on_mission and bool(plan.steps), plan)
        seen = seen_in(phase)
        if released:
            before, _ = decide(before, R.Release(), seen, SETTINGS)
        after, verdict = decide(before, request, seen, SETTINGS)
        if verdict.result != ACCEPTED:
            assert after == before, request
            unsupported = verdict.result == mavlink.MAV_RESULT_UNSUPPORTED
            assert unsupported or verdict.text, f"{request}: a refusal says why"
        assert (after.phase in IN_AIR) == bool(after.legs) or after.phase == Phase.MISSION, request
        for k in range(2, 30):  # after every decision the flight can continue
            after, _ = advance(after, seen._replace(now_us=k * 100_000), SETTINGS)


@pytest.mark.parametrize("phase", sorted(LANDING))
def test_while_readings_are_missing_no_request_ends_a_landing(phase: Phase) -> None:
    blind = seen_in(phase)._replace(estimate_problems=("no vehicle pose from a tracker",))
    refused = set()
    for request in REQUESTS:
        if isinstance(request, R.Release | R.Terminate | R.Arm):
            continue
        before = flight_in(phase, False, PLAN)
        after, verdict = decide(before, request, blind, SETTINGS)
        assert is_landing(after), request
        if decide(before, request, seen_in(phase), SETTINGS)[0].phase != phase:
            refused.add(type(request))
            assert verdict.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED, request
            assert verdict.text == "Landing continues: no vehicle pose from a tracker"
    assert {R.Pause, R.SetMode} <= refused or phase != Phase.LOWER
    before = flight_in(Phase.LOWER, False, PLAN)
    released, _ = decide(before, R.Release(), blind, SETTINGS)
    assert released.cable.released, "the load can still be dropped"


# ---- arming

STILL = "(at most 0.3): hold it still, or wait for less wind"
COMPLAINTS: dict[str, tuple[dict[str, Any], str]] = {
    "sensors": ({"estimate_problems": ("no vehicle pose from a tracker",)}, "no vehicle pose from a tracker"),
    "tilt": ({"tilt_rad": math.radians(25.0)}, "tilted by 25 deg"),
    "tilt is no number": ({"tilt_rad": math.nan}, "tilted by nan deg"),
    "motion": ({"v_quad": (0.5, 0.0, 0.0)}, f"moving at 0.5 m/s {STILL}"),
    "motion is no number": ({"v_quad": (math.nan, 0.0, 0.0)}, f"moving at nan m/s {STILL}"),
}


@pytest.mark.parametrize("trouble", COMPLAINTS)
def test_arming_is_denied_with_the_reason_and_can_be_forced(trouble: str) -> None:
    changes, why = COMPLAINTS[trouble]
    seen = view(**changes)
    assert arming_problems(Flight(), seen, SETTINGS) == (why,)
    after, verdict = decide(Flight(), R.Arm(True, False), seen, SETTINGS)
    assert (after.phase, verdict.result, verdict.text) == (Phase.DISARMED, DENIED, f"Arming denied: {why}")
    _, told = decide(Flight(), R.RunPrearmChecks(), seen, SETTINGS)
    assert (told.result, told.text, told.warns) == (ACCEPTED, f"Not ready to arm: {why}", True)
    forced, verdict = decide(Flight(), R.Arm(True, True), seen, SETTINGS)
    assert (forced.phase, verdict) == (Phase.ARMED, YES)


def settings_with(**parameters: float) -> Settings:
    table = autopilot_parameters(load_vehicle("bebop"))
    for name, value in parameters.items():
        table.set(name, value)
    return settings_from(table, 0.0, supports_reeling=True, follows_shaped=True)


def test_a_vehicle_whose_assumed_weight_exceeds_its_thrust_is_not_armed() -> None:
    heavy = settings_with(VEH_LOAD_MASS=0.5)
    why = "cannot hover, weighs 8.83 N, rotors give 7.84 N"
    assert arming_problems(Flight(), view(), heavy) == (why,)
    released = replace(Flight(), cable=replace(Flight().cable, released=True))
    assert arming_problems(released, view(), heavy) == ()
    assert arming_problems(Flight(), view(), settings_with(VEH_LOAD_MASS=0.5, VEH_ROTOR_MAX=2.3)) == ()
    assert arming_problems(Flight(), view(), settings_with(VEH_LOAD_MASS=0.5, VEH_ROTOR_LIM=0.0)) == ()


def test_after_the_loss_of_a_rotor_the_vehicle_is_armed_by_force_only() -> None:
    sky = Sky()
    sky.flight = Flight(phase=Phase.ARMED, rotors_lost=0b101)
    assert sky.ask(R.Arm(False, False)).result == ACCEPTED
    why = "rotors 1, 3 did not follow the commands of the last flight"
    assert sky.ask(R.Arm(True, False)).text == f"Arming denied: {why}"
    assert sky.ask(R.RunPrearmChecks()).text == f"Not ready to arm: {why}"
    assert sky.ask(R.Arm(True, True)).result == ACCEPTED
    assert sky.ask(R.Arm(False, False)).result == ACCEPTED
    assert sky.ask(R.Arm(True, False)).result == ACCEPTED, "it was lost in the last flight but one"


def test_what_the_storage_lost_keeps_the_vehicle_from_being_armed() -> None:
    flight = Flight(external_arming_problems={"storage": ("the stored fence is damaged",)})
    after, verdict = decide(flight, R.Arm(True, False), view(), SETTINGS)
    assert (after.phase, verdict.text) == (Phase.DISARMED, "Arming denied: the stored fence is damaged")


def test_a_vehicle_that_stands_still_and_sees_is_ready() -> None:
    assert arming_problems(Flight(), view(), SETTINGS) == ()
    assert decide(Flight(), R.RunPrearmChecks(), view(), SETTINGS)[1] == Verdict(ACCEPTED, "Ready to arm")


@pytest.mark.parametrize("phase", [Phase.ARMED, Phase.HOLD])
def test_an_armed_vehicle_does_not_check_whether_it_may_be_armed(phase: Phase) -> None:
    verdict = decide(Flight(phase=phase), R.RunPrearmChecks(), view(), SETTINGS)[1]
    assert (verdict.result, verdict.text) == (LATER, "Pre-arm checks denied: armed")


def test_who_disarms_a_disarmed_vehicle_withdraws_what_would_begin() -> None:
    sky = Sky()
    assert sky.ask(R.Takeoff(2.0)).result == ACCEPTED
    assert sky.ask(R.Arm(False, False)).result == ACCEPTED
    assert sky.ask(R.Arm(True, False)).result == ACCEPTED
    assert sky.flight.phase == Phase.ARMED


@pytest.mark.parametrize("phase", sorted(IN_AIR))
def test_in_the_air_rotors_stop_by_force_only(phase: Phase) -> None:
    flight = flight_in(phase, False, PLAN)
    after, verdict = decide(flight, R.Arm(False, False), seen_in(phase), SETTINGS)
    assert (after, verdict.result) == (flight, DENIED)
    after, verdict = decide(flight, R.Arm(False, True), seen_in(phase), SETTINGS)
    assert (after.phase, after.legs) == (Phase.DISARMED, ())
    assert verdict == Verdict(ACCEPTED, "Disarmed in the air by force", warns=True)


def test_after_a_termination_the_vehicle_is_armed_later_and_needs_no_disarming() -> None:
    sky = Sky().airborne()
    assert sky.ask(R.Terminate()).result == ACCEPTED
    sky.wait(1.0)
    given_up = sky.flight
    for force in (False, True):
        verdict = sky.ask(R.Arm(True, force))
        assert (sky.flight, verdict.result) == (given_up, LATER)
        assert verdict.text == "Arming denied: flight terminated, wait 2.0 s"
    assert sky.ask(R.RunPrearmChecks()).text.startswith("Not ready to arm: flight terminated, wait 2.0 s")
    assert (sky.ask(R.Arm(False, False)), sky.flight) == (YES, given_up)
    sky.run(lambda s: s.flight.phase == Phase.DISARMED, 2.1)


def test_a_return_before_the_load_is_lifted_lands_beside_it() -> None:
    sky = Sky()
    assert sky.ask(R.Arm(True, False)).result == ACCEPTED
    assert sky.ask(R.Takeoff(2.0)).result == ACCEPTED
    sky.wait(1.0)
    assert sky.flight.phase == Phase.TAUTEN
    assert sky.ask(R.ReturnHome()).result == ACCEPTED
    sky.run(lambda s: s.flight.phase == Phase.DISARMED)
    assert sky.phases == [Phase.TAUTEN, Phase.SET_DOWN, Phase.DISARMED]


# ---- what arming begins, and in which order requests may come


@pytest.mark.parametrize("ask_first", [True, False])
@pytest.mark.parametrize(
    "what", [R.Takeoff(None), R.SetMode(identity.AUTO, identity.AUTO_TAKEOFF), R.StartMission(None)]
)
def test_arming_and_choosing_what_to_fly_come_in_either_order(what: Any, ask_first: bool) -> None:
    sky = Sky(model.Takeoff(2.0), model.Land())
    for request in (what, R.Arm(True, False)) if ask_first else (R.Arm(True, False), what):
        assert sky.ask(request).result == ACCEPTED
    assert sky.flight.phase == Phase.TAUTEN
    assert sky.flight.mission.active == isinstance(what, R.StartMission)
    assert sky.flight.mission.takeoff_altitude_m == 2.0


@pytest.mark.parametrize("first", [None, 0, 3])
def test_where_no_mission_is_its_item_is_not_what_is_missing(first: int | None) -> None:
    """A start is refused in the same words as the mode, whichever item it names."""
    flight = Flight(phase=Phase.ARMED)
    start = decide(flight, R.StartMission(first), view(), SETTINGS)
    assert start == decide(flight, R.SetMode(identity.AUTO, identity.AUTO_MISSION), view(), SETTINGS)
    after, verdict = start
    assert (after, verdict.result, verdict.text) == (flight, DENIED, "Mission denied: there is none")


@pytest.mark.parametrize(
    ("height_m", "text"),
    [(0.2, "load height 0.20 m, min 0.3 m"), (1e6, "load height 1e+06 m, max 100000 m")],
)
def test_a_take_off_to_a_height_that_cannot_be_meant_is_denied(height_m: float, text: str) -> None:
    verdict = Sky().ask(R.Takeoff(height_m))
    assert (verdict.result, verdict.text) == (DENIED, f"Take-off denied: {text}")


def test_without_a_mission_there_is_nothing_to_continue() -> None:
    sky = Sky().airborne()
    verdict = sky.ask(R.Continue())
    assert (verdict.result, verdict.text) == (DENIED, "Nothing to continue: no mission is stored")


def test_a_landing_that_is_asked_for_on_the_ground_disarms() -> None:
    sky = Sky()
    sky.ask(R.Arm(True, False))
    assert sky.ask(R.Land()).result == ACCEPTED
    assert sky.flight.phase == Phase.DISARMED


def test_a_mission_that_is_gone_is_not_begun_by_arming() -> None:
    chosen, _ = decide(Flight(mission=MissionProgress(plan=PLAN)), R.StartMission(None), view(), SETTINGS)
    gone = replace(chosen, mission=replace(chosen.mission, plan=MissionPlan()))
    after, verdict = decide(gone, R.Arm(True, False), view(), SETTINGS)
    assert (after, verdict.result, verdict.text) == (gone, DENIED, "Mission denied: there is none")


def test_a_mission_being_flown_is_not_replaced_but_a_paused_one_is() -> None:
    flying = flight_in(Phase.MISSION, True, PLAN)
    verdict = decide(flying, R.ReplaceMission(3), hanging(), SETTINGS)[1]
    assert (verdict.result, "pause it first" in (verdict.text or "")) == (DENIED, True)
    paused, _ = decide(flying, R.Pause(), hanging(), SETTINGS)
    assert decide(paused, R.ReplaceMission(3), hanging(), SETTINGS)[1] == YES


# ---- reposition


def test_a_reposition_keeps_what_is_not_given_and_holds_there() -> None:
    sky = Sky().airborne()
    assert sky.ask(R.Reposition(1.5, None, None, True)).result == ACCEPTED
    assert isinstance(sky.flight.legs[0], Transfer)
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    assert sky.view.x_load == pytest.approx((1.5, 0.0, 2.0))


@pytest.mark.parametrize("asked", [R.Pause(), R.SetMode(4, 3, None, "Hold"), R.ReturnHome()])
@pytest.mark.parametrize(("height_m", "result"), [(0.13, ACCEPTED), (0.11, LATER)])
def test_a_load_that_is_almost_on_the_ground_is_set_down_before_anything_else(
    asked: object, height_m: float, result: int
) -> None:
    """The vehicle would lay it down while it stops, and take that for a fall."""
    flight = entered(Sky().airborne().flight, Phase.LOWER, hanging(), SETTINGS)
    flight = replace(flight, legs=flight.legs[-1:])
    assert isinstance(flight.legs[0], Creep)
    _, verdict = decide(flight, asked, hanging(x=(0.0, 0.0, height_m)), SETTINGS)
    assert verdict.result == result


@pytest.mark.parametrize(
    "steps", [(model.Land(),), (model.ReturnHome(),), (model.Delay(1.0), model.Release())]
)
def test_a_mission_of_which_no_item_takes_off_leaves_the_vehicle_on_the_ground(
    steps: tuple[model.Step, ...],
) -> None:
    sky = Sky(*steps)
    for _ in range(2):  # disarmed and armed
        verdict = sky.ask(R.StartMission(None))
        assert (verdict.result, verdict.text) == (DENIED, "Mission denied: no item of it takes off")
        sky.ask(R.Arm(arm=True, force=False))


def test_a_flight_behind_a_failsafe_landing_is_none_in_failsafe() -> None:
    sky = Sky()
    sky.flight = replace(sky.flight, is_failsafe=True)
    assert sky.ask(R.Arm(arm=True, force=False)).result == ACCEPTED
    assert not sky.flight.is_failsafe


def test_a_phase_is_named_in_words() -> None:
    flight = replace(Sky().airborne().flight, phase=Phase.SET_DOWN)
    _, verdict = decide(flight, R.Reposition(1.0, None, None, True), hanging(), SETTINGS)
    assert (verdict.result, verdict.text) == (LATER, "Reposition denied while the load is set down")


@pytest.mark.parametrize(
    ("request_", "name"), [(R.Pause(), "Hold"), (R.Orbit(2.0, 1.0, 0.0, 0.0, 3.0), "Orbit")]
)
def test_while_the_cable_is_tautened_a_refusal_says_what_is_possible(request_: object, name: str) -> None:
    flight = flight_in(Phase.TAUTEN, False, PLAN)
    text = f"{name} denied while the cable is tautened: land, or wait until the load is lifted"
    assert decide(flight, request_, hanging(), SETTINGS) == (flight, Verdict(LATER, text))
    assert decide(flight, R.Land(), hanging(), SETTINGS)[0].phase == Phase.SET_DOWN


def test_a_start_during_a_mission_says_that_it_begins_again() -> None:
    sky = Sky(model.Takeoff(2.0), model.Waypoint(1.0, 0.0, 2.0), model.Waypoint(3.0, 0.0, 2.0))
    sky.ask(R.StartMission(0))
    sky.ask(R.Arm(arm=True, force=False))
    sky.run(lambda s: s.flight.mission.step == 2)
    assert sky.ask(R.StartMission(None)) == Verdict(ACCEPTED), "it is being flown"
    assert sky.flight.mission.step == 2
    assert sky.ask(R.StartMission(0)) == Verdict(ACCEPTED, "Mission begins again at item 0")
    assert sky.flight.mission.step == 0


@pytest.mark.parametrize("place", [(2e5, 0.0, 2.0), (0.0, -2e5, 2.0), (0.0, 0.0, 2e5)])
def test_a_reposition_that_is_far_off_is_a_mistake(place: tuple[float, float, float]) -> None:
    sky = Sky().airborne()
    verdict = sky.ask(R.Reposition(*place, True))
    assert verdict.text == "Reposition denied: more than 100000 m from home"


def test_a_reposition_out_of_motion_goes_on_from_that_motion() -> None:
    sky = Sky().airborne()
    sky.ask(R.Reposition(5.0, 0.0, 2.0, True))
    sky.wait(3.5)
    speed = sky.view.v_load[0]
    assert speed > 0.5
    sky.ask(R.Reposition(0.0, 3.0, 2.0, True))
    assert sky.flight.legs[0].jet(0.0)[1][0] == pytest.approx(speed, abs=0.02)
    sky.run(lambda s: isinstance(s.flight.legs[0], Hold))
    assert sky.view.x_load == pytest.approx((0.0, 3.0, 2.0))


@pytest.mark.parametrize("phase", sorted(set(Phase) - {Phase.HOLD}))
def test_a_reposition_that_may_not_change_the_mode_needs_a_hold(phase: Phase) -> None:
    verdict = decide(flight_in(phase, False, PLAN), R.Reposition(1.0, 1.0, 2.0, False), hanging(), SETTINGS)[
        1
    ]
    assert verdict.result == LATER


@pytest.mark.parametrize(("phase", "where"), [(Phase.DISARMED, "disarmed"), (Phase.ARMED, "on the ground")])
def test_a_pause_on_the_ground_needs_something_to_pause(phase: Phase, where: str) -> None:
    idle = Flight(phase=phase)
    text = f"Pause denied while {where}: nothing is under way"
    assert decide(idle, R.Pause(), view(), SETTINGS) == (idle, Verdict(LATER, text))
    chosen = replace(idle, action_when_armed=ActionWhenArmed.MISSION)
    after, verdict = decide(chosen, R.Pause(), view(), SETTINGS)
    assert (verdict.result, after.action_when_armed) == (ACCEPTED, ActionWhenArmed.NOTHING)
    # the mode of hold may be selected at any time
    assert (
        decide(idle, R.SetMode(identity.AUTO, identity.AUTO_LOITER), view(), SETTINGS)[1].result == ACCEPTED
    )


@pytest.mark.parametrize("request_", [R.Land(), R.Pause()])
def test_a_takeoff_that_waits_for_arming_is_taken_back(request_: Any) -> None:
    sky = Sky()
    assert sky.ask(R.Takeoff(2.0)).result == ACCEPTED
    assert sky.flight.action_when_armed == ActionWhenArmed.TAKEOFF
    assert sky.ask(request_).result == ACCEPTED
    assert sky.flight.action_when_armed == ActionWhenArmed.NOTHING
    assert sky.ask(R.Arm(True, False)).result == ACCEPTED
    assert sky.flight.phase == Phase.ARMED
