"""Metadata of the parameters as ground stations find and read them."""

from __future__ import annotations

import json
from typing import Any

from autopilot.services.file_tree import checksum
from autopilot.services.files import path_of
from autopilot.services.identity import Identity
from autopilot.services.made_files import PARAMETER_TEXTS, made_files
from autopilot.services.mission_store import StoredMission
from autopilot.vehicle.belief import load_belief
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.parameters import Parameter


def made(table: Any) -> Any:
    return made_files(Identity(), table, StoredMission)


def test_a_ground_station_finds_the_texts_of_the_parameters(rig: Any) -> None:
    for message_id, uri_field, crc_field in (
        (397, "uri", "file_crc"),
        (395, "general_metadata_uri", "general_metadata_file_crc"),
    ):
        ask = m.MAVLink_command_long_message(1, 1, 512, 0, message_id, 0, 0, 0, 0, 0, 0)
        (told,) = [r for r in rig.replies(ask) if r.get_msgId() == message_id]
        uri = getattr(told, uri_field)
        assert uri == "mftp:///etc/extras/component_general.json"
        general = made(rig.table)[path_of(uri.removeprefix("mftp://").encode())]({})
        assert checksum(general) == getattr(told, crc_field)
        (kind,) = json.loads(general)["metadataTypes"]
        assert kind["type"] == 1
        texts = made(rig.table)[path_of(kind["uri"].removeprefix("mftp://").encode())]({})
        assert checksum(texts) == kind["fileCrc"]


def test_every_parameter_is_described() -> None:
    table = autopilot_parameters(load_belief("bebop"))
    record = json.loads(made(table)[PARAMETER_TEXTS]({}))
    assert record["version"] == 3
    assert [p["name"] for p in record["parameters"]] == list(table.names)
    for told in record["parameters"]:
        known = table.describe(told["name"])
        assert told["shortDesc"] == known.text
        assert (told["min"], told["max"], told["default"]) == (known.low, known.high, known.default)
        assert told["units"] == known.unit
        assert told["rebootRequired"] == known.fixed


def test_the_range_of_another_process_parameter_is_not_made_up(rig: Any) -> None:
    rig.table.learn(Parameter("SIM_WIND_E", 3.0, -1e9, 1e9, "", "Of the simulator"))
    told = {p["name"]: p for p in json.loads(made(rig.table)[PARAMETER_TEXTS]({}))["parameters"]}
    assert not {"min", "max", "default"} & told["SIM_WIND_E"].keys()
