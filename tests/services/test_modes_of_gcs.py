"""The modes that `gcs` requests are those that the vehicle receives, whatever its identity."""

from __future__ import annotations

import pytest

from autopilot.services.identity import (
    ARDUPILOT,
    AUTO,
    AUTO_LAND,
    AUTO_LOITER,
    AUTO_MISSION,
    AUTO_RTL,
    AUTO_TAKEOFF,
    FLAVOURS,
    OFFBOARD,
    POSCTL,
    Identity,
)
from autopilot.services.requests import SetMode
from autopilot.wire.dialect import plumbline as mavlink
from gcs.clients.modes import ALIASES, MODES, change_mode, mode_name
from gcs.clients.operation import Target
from gcs.errors import InputError

MEANT = {
    "hold": (AUTO, AUTO_LOITER),
    "land": (AUTO, AUTO_LAND),
    "mission": (AUTO, AUTO_MISSION),
    "offboard": (OFFBOARD, 0),
    "position": (POSCTL, 0),
    "return": (AUTO, AUTO_RTL),
    "takeoff": (AUTO, AUTO_TAKEOFF),
}
COPTER = {"hold": "guided", "land": "land", "mission": "auto", "position": "poshold", "return": "rtl"}


def heartbeat(flavour, number=0):
    return mavlink.MAVLink_heartbeat_message(2, flavour.autopilot, 0x81, number, 4, 3)


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
@pytest.mark.parametrize("name", MODES)
def test_a_mode_that_is_asked_for_is_heard_and_named(rig_with, flavour, name):
    rig = rig_with(identity=Identity(flavour=flavour))
    if flavour is ARDUPILOT and name not in COPTER:
        with pytest.raises(InputError, match=f"^mode {name}: ArduPilot has no such mode; must be "):
            change_mode(Target(1, 1), name, heartbeat(flavour))
        return
    change = change_mode(Target(1, 1), name, heartbeat(flavour))
    for message in change.poll(0):
        rig.send(message)
    (asked,) = rig.asked
    assert isinstance(asked, SetMode)
    assert (asked.main, asked.sub) == MEANT[name]
    mode = flavour.mode(asked.main, asked.sub)
    words = COPTER if flavour is ARDUPILOT else {name: name for name in MODES}
    assert mode_name(heartbeat(flavour, mode.custom_mode)) == words[name]


@pytest.mark.parametrize("flavour", FLAVOURS.values(), ids=lambda flavour: flavour.name)
@pytest.mark.parametrize("alias", ALIASES)
def test_a_mode_may_be_called_as_others_call_it(rig_with, flavour, alias):
    rig = rig_with(identity=Identity(flavour=flavour))
    for message in change_mode(Target(1, 1), alias, heartbeat(flavour)).poll(0):
        rig.send(message)
    (asked,) = rig.asked
    assert (asked.main, asked.sub) == MEANT[ALIASES[alias]]
