"""Metadata of the parameters as ground stations find and read them."""

from __future__ import annotations

import json
import re
from typing import Any

import pytest

from autopilot.services.file_tree import checksum
from autopilot.services.files import path_of
from autopilot.services.identity import Identity
from autopilot.services.mission_store import StoredMission
from autopilot.services.virtual_files import GENERAL, PARAMETER_METADATA, PARAMETERS, generated_files
from autopilot.vehicle.file import load_vehicle
from autopilot.vehicle.parameters import autopilot_parameters
from autopilot.wire.dialect import plumbline as m
from autopilot.wire.parameter_table import Parameter


def made(table: Any) -> Any:
    return generated_files(Identity(), table, StoredMission)


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
    table = autopilot_parameters(load_vehicle("bebop"))
    record = json.loads(made(table)[PARAMETER_METADATA]({}))
    assert record["version"] == 3
    assert [p["name"] for p in record["parameters"]] == list(table.names)
    for told in record["parameters"]:
        known = table.describe(told["name"])
        assert told["shortDesc"] == known.text
        assert (told["min"], told["max"], told["default"]) == (known.low, known.high, known.default)
        assert told["units"] == known.unit
        assert told["rebootRequired"] == known.fixed


def test_they_are_made_again_once_a_parameter_has_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    """And only then, so that many clients that read them take no time from the loop."""
    table = autopilot_parameters(load_vehicle("bebop"))
    files, described = made(table), []
    describe = table.describe
    monkeypatch.setattr(table, "describe", lambda name: described.append(name) or describe(name))

    def asked() -> int:
        described.clear()
        for path in (PARAMETERS, PARAMETER_METADATA, GENERAL, PARAMETERS):
            files[path]({})
        return len(described)

    first, again = asked(), asked()
    assert (first, again) == (2 * len(table), 0)
    before = files[PARAMETERS]({})
    table.set("MIS_SPEED", 2.0)
    assert files[PARAMETERS]({}) != before
    table.add_remote(Parameter("SIM_WIND_E", 3.0, -1e9, 1e9, "", "Of the simulator"))
    assert b"SIM_WIND_E" in files[PARAMETER_METADATA]({})
    assert files[PARAMETERS]({"start": "3"}) != files[PARAMETERS]({})


def test_the_range_of_another_process_parameter_is_not_made_up(rig: Any) -> None:
    rig.table.add_remote(Parameter("SIM_WIND_E", 3.0, -1e9, 1e9, "", "Of the simulator"))
    told = {p["name"]: p for p in json.loads(made(rig.table)[PARAMETER_METADATA]({}))["parameters"]}
    assert not {"min", "max", "default"} & told["SIM_WIND_E"].keys()


# what MAVLink's component_metadata/parameter.schema.json and general.schema.json allow: no other keys
_PARAMETER_KEYS = {
    "name": str, "type": str, "shortDesc": str, "longDesc": str, "units": str, "default": (int, float),
    "decimalPlaces": int, "min": (int, float), "max": (int, float), "increment": (int, float),
    "rebootRequired": bool, "group": str, "category": str, "volatile": bool, "values": list, "bitmask": list,
    "readOnly": bool,
}  # fmt: skip
_TYPES = {"Uint8", "Int8", "Uint16", "Int16", "Uint32", "Int32", "Float"}
_GENERAL_KEYS = {"version", "vendorName", "modelName", "firmwareVersion", "hardwareVersion", "metadataTypes"}
_METADATA_KEYS = {
    "type", "uri", "fileCrc", "uriFallback", "fileCrcFallback", "translationUri", "translationUriFallback",
}  # fmt: skip


def test_the_metadata_keep_to_mavlinks_schemas() -> None:
    table = autopilot_parameters(load_vehicle("bebop"))
    table.add_remote(Parameter("SIM_WIND_E", 3.0, -1e9, 1e9, "", "Of the simulator"))
    texts = json.loads(made(table)[PARAMETER_METADATA]({}))
    assert texts.keys() == {"version", "parameters"}
    assert isinstance(texts["version"], int) and texts["version"] >= 3
    for told in texts["parameters"]:
        assert re.fullmatch(r"[.\-a-zA-Z0-9_{}]{1,16}", told["name"])
        assert told["type"] in _TYPES
        assert told.get("decimalPlaces", 0) >= 0
        for key, value in told.items():
            assert isinstance(value, _PARAMETER_KEYS[key]), (told["name"], key)
    general = json.loads(made(table)[GENERAL]({}))
    assert general.keys() <= _GENERAL_KEYS
    assert general["version"] >= 1
    assert re.fullmatch(r"\d+\.\d+\.\d+(\.\d+)?", general["firmwareVersion"])
    for kind in general["metadataTypes"]:
        assert {"type", "uri"} <= kind.keys() <= _METADATA_KEYS
        assert isinstance(kind["type"], int) and 0 <= kind["fileCrc"] < 2**32
