"""Only the truth of the simulator run in which the vehicle flies is recorded."""

from __future__ import annotations

from autopilot.wire.codec import FrameWriter
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.truth import TruthFilter, TruthSources

WRITER = FrameWriter(1, 27)
OURS, OTHER = ("127.0.0.1", 40_001), ("127.0.0.1", 40_002)
AT = "127.0.0.1:14560"


def run(number: int) -> bytes:
    return WRITER.frame(mavlink.MAVLink_sim_boot_message(0, number, [0.0] * 4, 0.0, 0, 0))


def status(time_us: int) -> bytes:
    return WRITER.frame(mavlink.MAVLink_sim_status_message(time_us, 0.0, 0.0, 0, 0, 0, 0, 1, 1))


def test_of_two_worlds_at_one_port_the_vehicles_own_is_heard() -> None:
    truth = TruthFilter(AT, port_is_given=False)
    truth.set_vehicle_run(7)
    assert truth.select([(status(1), OURS)]) == [], "nobody has said yet whose it is"
    told = [(run(8) + status(2), OTHER), (run(7) + status(3), OURS), (status(4), OTHER), (status(5), OURS)]
    assert truth.select(told) == [told[1][0], told[3][0]]
    assert truth.missing == ""
    assert truth.select([(run(9), OURS), (status(6), OURS)]) == [], (
        "the world began anew, the vehicle has not"
    )


def test_a_port_that_was_named_does_not_make_another_world_the_vehicles() -> None:
    truth = TruthFilter(AT, port_is_given=True)
    truth.set_vehicle_run(7)
    assert truth.select([(run(8) + status(1), OTHER), (b"\xfd garbage", OTHER)]) == []
    assert f"the truth at UDP {AT} is refused: it comes from another simulator; --truth PORT" in truth.missing


def test_a_vehicle_that_does_not_say_has_the_one_world_of_the_port_that_somebody_named() -> None:
    unnamed, named = TruthFilter(AT, port_is_given=False), TruthFilter(AT, port_is_given=True)
    for truth in (unnamed, named):
        truth.set_vehicle_run(None)
        assert truth.missing.startswith(f"no simulator sends its truth to UDP {AT}; --truth PORT")
    assert unnamed.select([(run(8), OURS)]) == []
    assert unnamed.missing.startswith("the vehicle does not say which simulator it flies in, so the truth at")
    told = run(8)
    assert named.select([(told, OURS)]) == [told]
    assert named.missing == ""
    assert named.select([(run(9), OTHER), (status(1), OURS)]) == [], "which of the two is not known"


def test_a_simulator_that_the_vehicle_has_named_and_that_is_silent_stands_still_or_tells_elsewhere() -> None:
    truth = TruthFilter(AT, port_is_given=False)
    truth.set_vehicle_run(7)
    assert truth.missing == (
        f"nothing comes at UDP {AT}: the vehicle's simulator sends its truth to the gcs fly that started it, "
        "or to another port (name it by --truth PORT), or it is stopped"
    )


def test_a_vehicle_that_did_not_answer_is_not_one_that_does_not_say() -> None:
    truth = TruthFilter(AT, port_is_given=False)
    truth.set_vehicle_run(None, silence_reason="it sleeps")
    assert truth.select([(run(7), OURS)]) == []
    assert truth.missing.startswith("the vehicle did not answer which simulator it flies in, so the truth at")
    assert truth.missing.endswith(" is not taken; it sleeps")


def test_worlds_are_told_apart_by_where_they_tell_from() -> None:
    worlds = TruthSources()
    assert worlds.run(status(1), OURS) is None
    assert worlds.run(run(2**63 - 1), OURS) == 2**63 - 1
    assert worlds.run(status(2), OURS) == 2**63 - 1
    assert worlds.run(run(3), OTHER) == 3
    assert len(worlds) == 2
