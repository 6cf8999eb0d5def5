"""The generated dialect is what its definition gives."""

from __future__ import annotations

from importlib.metadata import version

import pytest

from autopilot.wire.dialect import generate
from autopilot.wire.dialect import plumbline as mavlink


def test_the_module_is_what_the_definition_gives() -> None:
    recorded = generate.generator_version()
    assert recorded
    if recorded != version("pymavlink"):
        pytest.skip(f"plumbline.py was made with pymavlink {recorded}, installed is {version('pymavlink')}")
    assert generate.generate_module() == generate.MODULE.read_bytes()


def test_our_messages_keep_their_ids_and_contents() -> None:
    ours = [c for c in mavlink.mavlink_map.values() if 60100 <= c.id <= 60199]
    # CRC_EXTRA is a digest of names, types and order of the fields: a change breaks every older peer
    assert {c.msgname: (c.id, c.crc_extra, c.unpacker.size) for c in ours} == CONTENTS


CONTENTS = {
    "LOAD_SENSOR": (60100, 25, 58),
    "LOAD_STATE": (60101, 243, 68),
    "LOAD_SETPOINT": (60102, 67, 92),
    "CASCADE_ERRORS": (60103, 142, 105),
    "ROTOR_STATE": (60104, 95, 76),
    "SIM_STATUS": (60105, 30, 34),
    "WIND_STATE": (60106, 38, 32),
    "CABLE_SNAP": (60107, 208, 16),
    "SIM_BOOT": (60108, 252, 78),
    "FILTER_STATE": (60109, 126, 44),
}
