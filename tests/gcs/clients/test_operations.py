"""The client machines against a scripted vehicle on fake time: answers, refusals, silence, bad links."""

from __future__ import annotations

import math

import pytest

from autopilot.wire.codec import FrameWriter, decode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients import command
from gcs.clients.connection import Connection
from gcs.clients.missions import MissionClear, MissionDownload, MissionUpload
from gcs.clients.operation import GROUND, Status, Target
from gcs.clients.parameter_transfer import ParameterGet, ParameterList, ParameterSet

TARGET = Target(1, 1)


@pytest.fixture
def run(world):
    """Run an operation to its end; return its result."""

    def run(operation, seconds=60.0):
        connection = Connection()

        def receive(datagram, now_us):
            for one in connection.receive(datagram, now_us):
                operation.receive(one.message, now_us)

        def poll(now_us):
            frames = [connection.frame(message) for message in operation.poll(now_us)]
            return connection.poll(now_us) + frames

        for _ in world.ticks(receive, poll, seconds):
            if operation.result is not None:
                break
        assert operation.result is not None, "no end"
        # what is still to be sent, e.g. the last acknowledgement
        for datagram in poll(world.now_us):
            world.vehicle.receive(datagram)
        return operation.result

    return run


def heard(message):
    """The message as it comes from the vehicle."""
    return decode(FrameWriter(1, 1).frame(message))[0][0].message


def same(left, right):
    return all(a == b or (math.isnan(a) and math.isnan(b)) for a, b in zip(left, right, strict=True))


# ---- connection


def test_the_load_and_other_ground_stations_are_not_the_vehicle(world):
    connection = Connection()
    vehicle = world.vehicle
    ground = vehicle.writer.__class__(255, 1)
    gcs = ground.frame(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))
    load = vehicle.load_writer.frame(
        mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_AIRSHIP, 8, 0, 0, 0, 3)
    )
    assert connection.receive(gcs, 0) == [] == connection.receive(load, 0)
    assert connection.target is None
    for datagram in vehicle.tick(1):
        connection.receive(datagram, 1)
    assert connection.target == TARGET


def test_the_vehicle_that_is_chosen_is_taken_and_no_other(world):
    connection = Connection()
    connection.accept_only(TARGET.system + 1)
    for datagram in world.vehicle.tick(1):
        assert connection.receive(datagram, 1) == []
    assert connection.target is None
    other = FrameWriter(TARGET.system + 1, 1).frame(
        mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4, 0, 0, 0, 3)
    )
    assert len(connection.receive(other, 2)) == 1
    assert connection.target == (TARGET.system + 1, 1)


def test_heartbeat_once_a_second_from_255_190(world):
    connection = Connection()
    sent = [now for now in range(0, 5_000_000, 20_000) for _ in connection.poll(now)]
    assert sent == [0, 1_000_000, 2_000_000, 3_000_000, 4_000_000]
    frame = connection.poll(5_000_000)[0]
    assert tuple(frame[5:7]) == GROUND


def test_the_link_is_lost_after_its_timeout_and_not_before(world):
    connection = Connection(link_timeout_us=5_000_000)
    assert not connection.lost(10**12), "nothing is lost that was never there"
    for datagram in world.vehicle.tick(1):
        connection.receive(datagram, 1)
    assert not connection.lost(5_000_001)
    assert connection.lost(5_000_002)


def test_garbage_is_counted_and_dropped(world):
    connection = Connection()
    for datagram in world.vehicle.tick(1):
        assert connection.receive(b"\xfd\xff\x00" + datagram, 1) or connection.target
    assert connection.junk_bytes > 0
    assert connection.target == TARGET


# ---- missions that the vehicle gives up


def upload_that_is_answered(items, *acks):
    """An upload whose first item was requested, and the messages it sends after each of the acks."""
    operation = MissionUpload(TARGET, items)
    operation.poll(0)
    operation.receive(heard(mavlink.MAVLink_mission_request_int_message(255, 190, 0)), 1)
    assert [one.get_type() for one in operation.poll(2)] == ["MISSION_ITEM_INT"]
    sent = []
    for now_us, ack in enumerate(acks, start=3):
        operation.receive(heard(mavlink.MAVLink_mission_ack_message(255, 190, ack)), now_us)
        sent += [one.get_type() for one in operation.poll(now_us)]
        if operation.result is None:
            operation.receive(heard(mavlink.MAVLink_mission_request_int_message(255, 190, 0)), now_us)
            operation.poll(now_us)
    return operation, sent


@pytest.mark.parametrize("ack", [mavlink.MAV_MISSION_OPERATION_CANCELLED, mavlink.MAV_MISSION_ERROR])
def test_an_upload_that_the_vehicle_gave_up_begins_again(items, ack):
    """ERROR: the item came too late, and the message that cancelled the upload was lost."""
    operation, sent = upload_that_is_answered(items, ack)
    assert operation.result is None and sent == ["MISSION_COUNT"]


def test_one_that_fails_again_and_again_is_refused(items):
    operation, sent = upload_that_is_answered(items, *4 * [mavlink.MAV_MISSION_ERROR])
    assert sent == 3 * ["MISSION_COUNT"]
    assert operation.result.status is Status.REFUSED
    assert operation.result.text == "upload: item 0 refused: error"


# ---- commands


def test_a_command_is_acknowledged(world, run):
    assert run(command.arm(TARGET)).status is Status.DONE
    assert world.vehicle.armed


def test_a_refusal_has_its_name(world, run):
    world.vehicle.command_results[mavlink.MAV_CMD_COMPONENT_ARM_DISARM] = [mavlink.MAV_RESULT_DENIED]
    result = run(command.arm(TARGET))
    assert (result.status, result.text) == (Status.REFUSED, "arm: denied")


def test_a_command_is_repeated_with_its_confirmation_counted_and_then_given_up(world, run):
    world.vehicle.silent_commands = {mavlink.MAV_CMD_NAV_LAND}
    result = run(command.land(TARGET))
    assert result.status is Status.UNANSWERED
    assert [message.confirmation for message in world.vehicle.commands] == list(range(command.SENDS))
    assert world.now_us <= (command.SENDS + 1) * command.RETRY_US


def test_in_progress_is_waited_for(world, run):
    operation = command.takeoff(TARGET, 3.0)
    operation.poll(0)
    in_progress = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_TAKEOFF, 5, 40, 0, 255, 190)
    operation.receive(heard(in_progress), 100_000)
    assert operation.progress == (40, 100)
    assert operation.poll(100_000 + command.IN_PROGRESS_TIMEOUT_US - 1) == []
    assert len(operation.poll(100_000 + command.IN_PROGRESS_TIMEOUT_US)) == 1


def test_an_answer_to_somebody_else_is_not_ours():
    operation = command.arm(TARGET)
    operation.poll(0)
    ack = mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 245, 190)
    operation.receive(heard(ack), 1)
    assert operation.result is None


# ---- parameters


def test_the_list_comes_with_its_gaps_filled(world, run):
    world.vehicle.lost_list_indices = {0, 5, 6, 60, 119}
    operation = ParameterList(TARGET)
    assert run(operation).status is Status.DONE
    assert operation.values == world.vehicle.parameters


def test_the_list_comes_over_a_bad_link(world, run):
    world.lossy(0.2)
    operation = ParameterList(TARGET)
    assert run(operation).status is Status.DONE
    assert operation.values == world.vehicle.parameters


def test_a_list_that_never_comes_is_given_up(world, run):
    world.vehicle.silent = True
    assert run(ParameterList(TARGET)).status is Status.UNANSWERED


def test_a_value_is_the_decimal_that_somebody_typed(world, run):
    assert run(ParameterSet(TARGET, "P007", 0.1)).text == "P007 = 0.1"
    operation = ParameterGet(TARGET, "P007")
    run(operation)
    assert operation.value == 0.1


def test_an_unknown_parameter_is_named(run):
    result = run(ParameterGet(TARGET, "NOPE"))
    assert (result.status, result.text) == (Status.REFUSED, "NOPE: no such parameter")


def test_a_value_that_is_not_stored_is_told(world, run):
    world.vehicle.fixed = {"P003"}
    result = run(ParameterSet(TARGET, "P003", 9.0))
    assert (result.status, result.text) == (Status.REFUSED, "P003 = 9: the vehicle keeps 3")


def test_setting_survives_a_bad_link(world, run):
    world.lossy(0.2)
    for index in range(20):
        assert run(ParameterSet(TARGET, f"P{index:03d}", 0.5 + index)).status is Status.DONE
        assert world.vehicle.parameters[f"P{index:03d}"] == 0.5 + index


# ---- missions


@pytest.mark.parametrize("chance", [0.0, 0.2])
def test_a_hundred_items_travel_intact_both_ways(world, run, items, chance):
    world.lossy(chance)
    upload = MissionUpload(TARGET, items)
    assert run(upload, 300.0).status is Status.DONE
    assert all(same(left, right) for left, right in zip(world.vehicle.mission, items, strict=True))
    download = MissionDownload(TARGET)
    assert run(download, 300.0).status is Status.DONE
    assert all(same(left, right) for left, right in zip(download.items, items, strict=True))
    assert upload.progress == download.progress == (100, 100)


def test_a_refused_item_is_named_and_the_old_mission_stays(world, run, items):
    world.vehicle.mission = items[:3]
    world.vehicle.refuse_item = 42
    result = run(MissionUpload(TARGET, items))
    assert (result.status, result.text) == (Status.REFUSED, "upload: item 42 refused: unsupported")
    assert world.vehicle.mission == items[:3]


def test_an_acknowledgement_of_an_older_transfer_ends_nothing(world, items):
    upload = MissionUpload(TARGET, items)
    upload.poll(0)
    ack = mavlink.MAVLink_mission_ack_message(255, 190, mavlink.MAV_MISSION_ACCEPTED, 0)
    upload.receive(heard(ack), 1)
    assert upload.result is None


def test_a_silent_vehicle_ends_every_transfer(world, run, items):
    world.vehicle.silent = True
    for operation in (MissionUpload(TARGET, items), MissionDownload(TARGET), MissionClear(TARGET)):
        assert run(operation).status is Status.UNANSWERED


def test_an_empty_mission_uploads_downloads_and_clears(world, run, items):
    world.vehicle.mission = list(items)
    assert run(MissionClear(TARGET)).status is Status.DONE
    assert world.vehicle.mission == []
    download = MissionDownload(TARGET)
    assert run(download).status is Status.DONE
    assert download.items == []
    assert run(MissionUpload(TARGET, [])).status is Status.DONE


def test_an_old_request_too_is_answered_in_whole_numbers(items):
    """ArduPilot asks by MISSION_REQUEST and accepts either; a float32 resolves degrees only to a metre."""
    upload = MissionUpload(TARGET, items)
    upload.poll(0)
    request = mavlink.MAVLink_mission_request_message(255, 190, 0, 0)
    upload.receive(heard(request), 1)
    (item,) = upload.poll(2)
    assert item.get_type() == "MISSION_ITEM_INT"
    assert (item.x, item.y) == (473977420, 85455940)
