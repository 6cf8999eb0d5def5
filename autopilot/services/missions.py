"""The mission protocol: upload as a state machine, download without any state, clear, and refusals.

Upload, seen from the vehicle (one at a time; the old mission stays in force until all items have arrived and
are checked):

    idle       COUNT n > 0          ask for item 0                        -> receiving
               an item              fly there (`current` 2, 3), else ACK ERROR -> idle
    receiving  requested item       ask for the next one                  -> receiving
               the last item        check all; ACK; mission replaced      -> idle
               an item before it    nothing (a duplicate)                 -> receiving
               an item after it     ask again for the missing one         -> receiving
               COUNT, same peer     begin again                           -> receiving
               COUNT or clear, other peer: DENIED, or if this one was silent for TAKEOVER_US: ACK
                                    OPERATION_CANCELLED to it             -> idle, and served there
               an item, other peer  nothing                               -> receiving
               ACK from the peer    the peer has given up                 -> idle
               silence              ask again; after MAX_REQUESTS: ACK OPERATION_CANCELLED -> idle

The ACK that ends an upload is sent once if no message was lost. If an item had to be requested again, the ACK
is repeated until the peer sends another mission message: some clients never ask for a lost ACK.

Fence and rally points are transferred in the same way, one transfer at a time of any kind.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any

from autopilot.geometry.linear import ZERO, Vec3
from autopilot.services.mission_store import StoredMission, plan_id
from autopilot.services.records import (
    Announce,
    AreasChanged,
    Decide,
    MissionChanged,
    Output,
    Peer,
    RefusalCleared,
    Send,
    SendText,
)
from autopilot.services.requests import ChangeAltitude, ReplaceMission, Reposition
from autopilot.services.streams import NEVER_US
from autopilot.wire.command_names import numbered_name
from autopilot.wire.convert.geodesy import Home, enu_from_geodetic, geodetic_from_enu
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.fence import AREA_READERS
from autopilot.wire.items import LocatedStep, MissionItemError, WireItem, home_item, is_home, located_steps
from autopilot.wire.items.limits import MAX_ITEMS

RETRY_US = 250_000  # after this silence a requested item is requested again, as PX4 does
MAX_REQUESTS = 20  # requests for one item: a link that loses a third each way fails 1 in 10^6 items
# Requests for one item after which the silence before the next one doubles each time: a client on a busy
# machine answers late, and later still by the clock of a simulation that is faster than the wall clock
QUICK_REQUESTS, MAX_RETRY_US = 10, 4_000_000
TAKEOVER_US = 5_000_000  # a client that was silent for this time gives way to another one
# Requests for the first item as MISSION_ITEM_INT, after which the client is assumed to know only MISSION_ITEM
# (DroneKit). Never in the other order: MAVSDK cancels on a MISSION_REQUEST.
INT_REQUESTS = 6
ACK_REPETITIONS = 3  # repetitions of the last ACK on a link that loses messages
ACK_INTERVAL_US = 600_000  # between two repetitions
LATE_ITEM_US = 5_000_000  # a last item repeated within this time after the end means that our ACK was lost

_MISSION = mavlink.MAV_MISSION_TYPE_MISSION
_ALL = mavlink.MAV_MISSION_TYPE_ALL
_AREAS = (mavlink.MAV_MISSION_TYPE_FENCE, mavlink.MAV_MISSION_TYPE_RALLY)
_NOUNS = {
    _MISSION: "Mission item",
    mavlink.MAV_MISSION_TYPE_FENCE: "Fence item",
    mavlink.MAV_MISSION_TYPE_RALLY: "Rally point",
}
_ACCEPTED = mavlink.MAV_MISSION_ACCEPTED

_NO_COORDINATE = 2**31 - 1
# ArduPilot's values of MISSION_ITEM.current outside an upload: fly there now, and change only the height now
_GUIDED_ITEM, _HEIGHT_ITEM = 2, 3
_ABOVE_HOME_FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
_GLOBAL_FRAMES = (*_ABOVE_HOME_FRAMES, mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT)
_LOCAL_FRAMES = (
    mavlink.MAV_FRAME_LOCAL_NED,
    mavlink.MAV_FRAME_LOCAL_ENU,
    mavlink.MAV_FRAME_LOCAL_OFFSET_NED,
)
_DEGREE_SCALE, _METRE_SCALE = 1e7, 1e4


@dataclass(slots=True)
class _Upload:
    """A transfer under way."""

    peer: Peer
    count: int
    heard_us: int  # when its client last sent the count or an item
    retry_us: int
    kind: int = _MISSION
    requests: int = 1  # how often the next item was requested
    lossy: bool = False  # an item had to be requested again
    as_float: bool = False  # the client uses MISSION_ITEM
    items: list[WireItem] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _EndedUpload:
    """The transfer that ended last, kept to answer its last item again."""

    peer: Peer
    count: int
    result: int
    at_us: int
    kind: int
    acks_left: int = 0  # how often its ACK is still to be sent
    next_ack_us: int = NEVER_US


def _moved(item: WireItem, place: Vec3, origin: Home) -> WireItem:
    """The item at another place (m, ENU from the origin)."""
    x, y, _ = geodetic_from_enu(place, origin)
    return item._replace(x=x, y=y)


class MissionService:
    """Holds the mission and serves it to any number of links.

    `home_is_item`: if there is no mission, home is served as its only item, and a waypoint uploaded as item 0
    is replaced by home. Clients of ArduPilot wait for ever for a mission without items. They begin an upload
    with the item 0 that was served to them, or with the home in the file that they read, which may differ.
    """

    def __init__(self, home: Home, mission: StoredMission, home_is_item: bool = False) -> None:
        self.home = home
        self._home_is_item = home_is_item
        self._home_place: Vec3 = ZERO  # m, ENU from `home`, the origin
        self.mission = mission
        self.areas: dict[int, tuple[WireItem, ...]] = dict.fromkeys(_AREAS, ())
        self._upload: _Upload | None = None
        self._ended: _EndedUpload | None = None
        # items that `_plan_ids` identify
        self._identified_items: tuple[tuple[WireItem, ...], ...] = ((), (), ())
        self._plan_ids = (0, 0, 0)

    def move_home(self, place: Vec3) -> None:
        """Home is at `place` from now on (m, ENU from the origin)."""
        self._home_place = place

    @property
    def plan_ids(self) -> tuple[int, int, int]:
        """Numbers of the versions of mission, fence and rally points in force; 0: there is none."""
        fence, rally = _AREAS
        mission, fence_items, rally_items = self.mission.items, self.areas[fence], self.areas[rally]
        identified = self._identified_items
        if (
            mission is not identified[0]
            or fence_items is not identified[1]
            or rally_items is not identified[2]
        ):
            self._identified_items = (mission, fence_items, rally_items)
            self._plan_ids = (plan_id(mission), plan_id(fence_items), plan_id(rally_items))
        return self._plan_ids

    def _plan_id(self, kind: int) -> int:
        return self.plan_ids[(_MISSION, *_AREAS).index(kind)]

    # ---- upload

    def receive_count(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_COUNT: a client wants to upload."""
        self._stop_ack_repetition(peer)
        kind, count = message.mission_type, message.count
        if kind != _MISSION and kind not in _AREAS:
            return [_ack(peer, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        may_upload, ended = self._priority(peer, kind, now_us)
        if not may_upload:
            return ended
        self._upload = None
        return [*ended, *self._begin_upload(kind, count, peer, now_us, decide)]

    def _begin_upload(self, kind: int, count: int, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        if count > MAX_ITEMS:
            why = f"Mission of {count} items; at most {MAX_ITEMS} are kept"
            return [
                SendText(mavlink.MAV_SEVERITY_WARNING, why),
                _ack(peer, mavlink.MAV_MISSION_NO_SPACE, kind),
            ]
        refused = [] if kind in _AREAS else self._refusal((), count, peer, decide)
        if refused:
            return refused
        if count == 0:
            done = self._replace_area(kind, ()) if kind in _AREAS else self._replace_mission(StoredMission())
            return [*done, self._accepting_ack(peer, kind)]
        self._upload = _Upload(peer, count, now_us, now_us + RETRY_US, kind)
        return [self._item_request()]

    def receive_item_int(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_ITEM_INT."""
        return self._receive_item(message, _item_of_int(message), False, peer, now_us, decide)

    def receive_item(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_ITEM, the older form with coordinates as floats."""
        return self._receive_item(message, _item_of_float(message), True, peer, now_us, decide)

    def receive_ack(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_ACK: the end of a download, or the client gives up its upload."""
        if self._upload and self._upload.peer == peer and message.mission_type == self._upload.kind:
            self._upload = None
        return []

    def next_timer(self) -> int:
        """Time at which `poll` has something to do, in us."""
        if self._upload:
            return self._upload.retry_us
        return self._ended.next_ack_us if self._ended else NEVER_US

    def poll(self, now_us: int) -> list[Output]:
        """Request a missing item again, or give up the upload; repeat the ACK of an ended upload."""
        upload, ended = self._upload, self._ended
        if upload is None and ended and now_us >= ended.next_ack_us:
            left = ended.acks_left - 1
            self._ended = replace(
                ended, acks_left=left, next_ack_us=now_us + ACK_INTERVAL_US if left else NEVER_US
            )
            return [self._repeated_ack(ended)]
        if upload is None or now_us < upload.retry_us:
            return []
        if upload.requests == MAX_REQUESTS:
            return self._cancel_upload(upload, now_us)
        if not upload.items and upload.requests >= INT_REQUESTS:
            upload.as_float = True
        upload.requests += 1
        upload.lossy = True
        upload.retry_us = now_us + _retry_interval_us(upload.requests)
        return [self._item_request()]

    def _cancel_upload(self, upload: _Upload, now_us: int) -> list[Output]:
        self._end_upload(mavlink.MAV_MISSION_OPERATION_CANCELLED, now_us)
        why = f"Mission upload given up: item {len(upload.items)} of {upload.count} did not come"
        cancelled = _ack(upload.peer, mavlink.MAV_MISSION_OPERATION_CANCELLED, upload.kind)
        return [SendText(mavlink.MAV_SEVERITY_WARNING, why), cancelled]

    def _priority(self, peer: Peer, kind: int, now_us: int) -> tuple[bool, list[Output]]:
        """Whether the peer may upload or clear now, and what is sent because of an upload of another client:
        one whose client was silent for long is cancelled, any other goes first."""
        upload = self._upload
        if upload is None or upload.peer == peer:
            return True, []
        if now_us - upload.heard_us >= TAKEOVER_US:
            return True, self._cancel_upload(upload, now_us)
        text = f"Upload denied: {upload.peer.name} uploads; try again"
        refusal = SendText(mavlink.MAV_SEVERITY_WARNING, text, _upload_of(kind), peer.link)
        return False, [refusal, _ack(peer, mavlink.MAV_MISSION_DENIED, kind)]

    def _receive_item(
        self,
        message: Any,
        item: WireItem | None,
        as_float: bool,
        peer: Peer,
        now_us: int,
        decide: Decide,
    ) -> list[Output]:
        upload = self._upload
        if upload is None or upload.peer != peer:
            if message.mission_type == _MISSION and message.current in (_GUIDED_ITEM, _HEIGHT_ITEM):
                return self._fly_to_item(message, item, peer, decide)
            return self._answer_item_without_upload(message, peer, now_us)
        if message.mission_type != upload.kind:
            return []
        upload.heard_us = now_us
        expected = len(upload.items)
        if message.seq < expected:
            return []
        if message.seq > expected:
            return [self._item_request()]
        if item is None:
            self._end_upload(mavlink.MAV_MISSION_INVALID_PARAM5_X, now_us)
            why = f"{_NOUNS[upload.kind]} {expected}: x or y is no coordinate"
            return [
                SendText(mavlink.MAV_SEVERITY_WARNING, why),
                _ack(peer, mavlink.MAV_MISSION_INVALID_PARAM5_X, upload.kind),
            ]
        upload.items.append(item)
        upload.requests, upload.retry_us, upload.as_float = 1, now_us + RETRY_US, as_float
        if len(upload.items) < upload.count:
            return [self._item_request()]
        return self._complete_upload(upload, now_us, decide)

    def _fly_to_item(self, message: Any, item: WireItem | None, peer: Peer, decide: Decide) -> list[Output]:
        """A single waypoint outside any upload, which is ArduPilot's "go there", or its change of height."""
        if message.command != mavlink.MAV_CMD_NAV_WAYPOINT or message.frame not in _GLOBAL_FRAMES:
            frames = ", ".join(map(str, sorted(_GLOBAL_FRAMES)))
            text = f"{numbered_name(message.command)} in frame {message.frame} refused outside an upload"
            text += f"; must be {numbered_name(mavlink.MAV_CMD_NAV_WAYPOINT)} in one of {frames}"
            return _refused_item(peer, text, mavlink.MAV_MISSION_UNSUPPORTED)
        up = message.z if message.frame in _ABOVE_HOME_FRAMES else message.z - self.home.altitude_m
        if message.current == _HEIGHT_ITEM:  # its place does not count: MAVProxy sends 0, 0
            verdict = decide(ChangeAltitude(up))
        elif item is None:
            text = "Waypoint refused: x or y is no coordinate"
            return _refused_item(peer, text, mavlink.MAV_MISSION_INVALID_PARAM5_X)
        else:
            east, north, _ = enu_from_geodetic(item.x, item.y, 0, self.home)
            verdict = decide(Reposition(east, north, up, True))
        if verdict.result == mavlink.MAV_RESULT_ACCEPTED:
            return [_ack(peer, _ACCEPTED)]
        return _refused_item(peer, verdict.text, mavlink.MAV_MISSION_DENIED)

    def _complete_upload(self, upload: _Upload, now_us: int, decide: Decide) -> list[Output]:
        """All items have arrived: check them as a whole, and only then replace the mission."""
        items, kind = tuple(upload.items), upload.kind
        if kind == _MISSION:
            items = self._with_home_at_origin(items)
        try:
            if kind in _AREAS:
                AREA_READERS[kind](items, self.home)
                self._end_upload(_ACCEPTED, now_us)
                cleared = RefusalCleared(_upload_of(kind))
                return [cleared, *self._replace_area(kind, items), self._accepting_ack(upload.peer, kind)]
            steps = located_steps(items, self.home)
        except MissionItemError as error:
            self._end_upload(error.result, now_us)
            text = SendText(mavlink.MAV_SEVERITY_WARNING, str(error), _upload_of(kind), upload.peer.link)
            return [text, _ack(upload.peer, error.result, kind)]
        refused = self._refusal(steps, upload.count, upload.peer, decide)
        if refused:
            self._end_upload(mavlink.MAV_MISSION_DENIED, now_us)
            return refused
        self._end_upload(_ACCEPTED, now_us)
        replaced = self._replace_mission(StoredMission(items))
        return [RefusalCleared(_upload_of(kind)), *replaced, self._accepting_ack(upload.peer, kind)]

    def _with_home_at_origin(self, items: tuple[WireItem, ...]) -> tuple[WireItem, ...]:
        """Uploaded items as they are stored: an item 0 that is home lies at the origin, wherever home is."""
        first, *others = items
        if first.command != mavlink.MAV_CMD_NAV_WAYPOINT:
            return items
        if self._home_is_item:
            return (home_item(self.home), *others)
        if not is_home(first, self.home, self._home_place):
            return items
        return (_moved(first, ZERO, self.home), *others) if self._home_place != ZERO else items

    def _with_home_in_place(self, items: tuple[WireItem, ...]) -> tuple[WireItem, ...]:
        """Stored items as they are served: an item 0 that is home lies where home is now."""
        if self._home_place == ZERO or not items or items[0].command != mavlink.MAV_CMD_NAV_WAYPOINT:
            return items
        if not is_home(items[0], self.home, ZERO):
            return items
        return (_moved(items[0], self._home_place, self.home), *items[1:])

    def _accepting_ack(self, peer: Peer, kind: int) -> Output:
        """The acknowledgement of a plan that is now in force."""
        return _ack(peer, _ACCEPTED, kind, self._plan_id(kind))

    def _answer_item_without_upload(self, message: Any, peer: Peer, now_us: int) -> list[Output]:
        """An item of the upload that has just ended is repeated because a message was lost: the last one is
        acknowledged again. Any other is an error of the client, unless another client uploads."""
        ended, kind = self._ended, message.mission_type
        if (
            ended
            and ended.peer == peer
            and message.seq < ended.count
            and kind == ended.kind
            and now_us - ended.at_us <= LATE_ITEM_US
        ):
            return [self._repeated_ack(ended)] if message.seq == ended.count - 1 else []
        if self._upload:
            return []
        if kind not in _NOUNS:
            return [_ack(peer, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        text = f"{_NOUNS[kind]} {message.seq} refused: no upload is under way; MISSION_COUNT begins one"
        return _refused_item(peer, text, mavlink.MAV_MISSION_ERROR, kind)

    def _repeated_ack(self, ended: _EndedUpload) -> Output:
        if ended.result == _ACCEPTED:
            return self._accepting_ack(ended.peer, ended.kind)
        return _ack(ended.peer, ended.result, ended.kind)

    def _end_upload(self, result: int, now_us: int) -> None:
        upload, self._upload = self._upload, None
        if upload is None:
            return
        self._ended = _EndedUpload(upload.peer, upload.count, result, now_us, upload.kind)
        if upload.lossy and result != mavlink.MAV_MISSION_OPERATION_CANCELLED:
            self._ended = replace(
                self._ended, acks_left=ACK_REPETITIONS, next_ack_us=now_us + ACK_INTERVAL_US
            )

    def _stop_ack_repetition(self, peer: Peer) -> None:
        """The peer has sent another mission message: stop repeating the ACK of its upload."""
        if self._ended and self._ended.peer == peer:
            self._ended = replace(self._ended, acks_left=0, next_ack_us=NEVER_US)

    def _item_request(self) -> Output:
        upload = self._upload
        assert upload is not None
        request = (
            mavlink.MAVLink_mission_request_message
            if upload.as_float
            else mavlink.MAVLink_mission_request_int_message
        )
        peer = upload.peer
        return Send(peer.link, request(peer.system, peer.component, len(upload.items), upload.kind))

    # ---- replace and clear

    def receive_clear_all(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_CLEAR_ALL."""
        self._stop_ack_repetition(peer)
        kind = message.mission_type
        if kind not in (_MISSION, _ALL, *_AREAS):
            return [_ack(peer, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        may_clear, ended = self._priority(peer, kind, now_us)
        if not may_clear:
            return ended
        refused = [] if kind in _AREAS else self._refusal((), 0, peer, decide, kind)
        if refused:
            return [*ended, *refused]
        if self._upload and kind in (self._upload.kind, _ALL):
            self._upload = None
        done = ended
        for area in _AREAS:
            if kind in (area, _ALL):
                done += self._replace_area(area, ())
        if kind not in _AREAS:
            done += self._replace_mission(StoredMission())
        return [*done, _ack(peer, _ACCEPTED, kind)]

    def _refusal(
        self,
        steps: tuple[LocatedStep, ...],
        count: int,
        peer: Peer,
        decide: Decide,
        kind: int = _MISSION,
    ) -> list[Output]:
        """Why the mission may not be replaced now; empty if it may."""
        verdict = decide(ReplaceMission(count, steps))
        if verdict.result == mavlink.MAV_RESULT_ACCEPTED:
            return []
        warning, what = mavlink.MAV_SEVERITY_WARNING, _upload_of(kind)
        texts: list[Output] = [SendText(warning, verdict.text, what, peer.link)] if verdict.text else []
        return [*texts, _ack(peer, mavlink.MAV_MISSION_DENIED, kind)]

    def _replace_area(self, kind: int, items: tuple[WireItem, ...]) -> list[Output]:
        if self.areas[kind] == items:
            return []
        self.areas[kind] = items
        return [AreasChanged(kind, items), Announce(None, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,))]

    def _replace_mission(self, mission: StoredMission) -> list[Output]:
        self.mission = mission
        return [MissionChanged(mission), Announce(None, (mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,))]

    # ---- download

    def receive_request_list(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_REQUEST_LIST: send the number of items to the requesting client only."""
        self._stop_ack_repetition(peer)
        kind = message.mission_type
        if kind != _MISSION and kind not in _AREAS:
            return [_ack(peer, mavlink.MAV_MISSION_UNSUPPORTED, kind)]
        count = len(self._items_of(kind))
        answer = mavlink.MAVLink_mission_count_message(
            peer.system, peer.component, count, kind, opaque_id=self._plan_id(kind)
        )
        return [Send(peer.link, answer)]

    def _items_of(self, kind: int) -> tuple[WireItem, ...]:
        """All items of a kind; empty for an unknown kind."""
        if kind == _MISSION:
            home_items = (home_item(self.home),) if self._home_is_item else ()
            return self._with_home_in_place(self.mission.items or home_items)
        return self.areas.get(kind, ())

    def receive_request_int(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_REQUEST_INT: any item in any order, as often as requested."""
        return self._download(message, peer, mavlink.MAVLink_mission_item_int_message, _coordinates_as_int)

    def receive_request(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_REQUEST, answered by MISSION_ITEM, the older form."""
        return self._download(message, peer, mavlink.MAVLink_mission_item_message, _coordinates_as_float)

    def _download(self, message: Any, peer: Peer, answer: Any, coordinates: Any) -> list[Output]:
        self._stop_ack_repetition(peer)
        kind, seq = message.mission_type, message.seq
        items = self._items_of(kind)
        if seq >= len(items):
            return [_ack(peer, mavlink.MAV_MISSION_INVALID_SEQUENCE, kind)]
        item = items[seq]
        x, y = coordinates(item)
        return [
            Send(
                peer.link,
                answer(
                    target_system=peer.system,
                    target_component=peer.component,
                    seq=seq,
                    frame=item.frame,
                    command=item.command,
                    current=item.current,
                    autocontinue=item.autocontinue,
                    param1=item.param1,
                    param2=item.param2,
                    param3=item.param3,
                    param4=item.param4,
                    x=x,
                    y=y,
                    z=item.z,
                    mission_type=kind,
                ),
            )
        ]

    def receive_partial(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """MISSION_WRITE_PARTIAL_LIST and MISSION_REQUEST_PARTIAL_LIST: not served."""
        return [_ack(peer, mavlink.MAV_MISSION_UNSUPPORTED, message.mission_type)]


def _upload_of(kind: int) -> tuple[str, int]:
    """The `subject` of a refusal of items of this kind."""
    return "upload", kind


def _ack(peer: Peer, result: int, kind: int = _MISSION, number: int = 0) -> Output:
    answer = mavlink.MAVLink_mission_ack_message(peer.system, peer.component, result, kind, opaque_id=number)
    return Send(peer.link, answer)


def _refused_item(peer: Peer, text: str | None, result: int, kind: int = _MISSION) -> list[Output]:
    """The answer to an item outside an upload that is not flown."""
    texts: list[Output] = [SendText(mavlink.MAV_SEVERITY_WARNING, text)] if text else []
    return [*texts, _ack(peer, result, kind)]


def _retry_interval_us(requests: int) -> int:
    """The silence after so many requests for an item, after which it is requested again."""
    return min(RETRY_US << max(requests - QUICK_REQUESTS, 0), MAX_RETRY_US)


def _item_of_int(m: Any) -> WireItem:
    return WireItem(
        frame=m.frame,
        command=m.command,
        current=m.current,
        autocontinue=m.autocontinue,
        param1=m.param1,
        param2=m.param2,
        param3=m.param3,
        param4=m.param4,
        x=m.x,
        y=m.y,
        z=m.z,
    )


def _scale(frame: int) -> float:
    """Factor by which a float coordinate becomes the integer of MISSION_ITEM_INT."""
    if frame == mavlink.MAV_FRAME_MISSION:
        return 1.0
    return _METRE_SCALE if frame in _LOCAL_FRAMES else _DEGREE_SCALE


def _int_coordinate(value: float, scale: float) -> int | None:
    if math.isnan(value):
        return _NO_COORDINATE
    scaled = value * scale
    return round(scaled) if abs(scaled) < _NO_COORDINATE else None


def _item_of_float(m: Any) -> WireItem | None:
    """The item with integer coordinates; None if they are out of range."""
    scale = _scale(m.frame)
    x, y = _int_coordinate(m.x, scale), _int_coordinate(m.y, scale)
    if x is None or y is None:
        return None
    return _item_of_int(m)._replace(x=x, y=y)


def _coordinates_as_int(item: WireItem) -> tuple[int, int]:
    return item.x, item.y


def _coordinates_as_float(item: WireItem) -> tuple[float, float]:
    scale = _scale(item.frame)
    x, y = (math.nan if value == _NO_COORDINATE else value / scale for value in (item.x, item.y))
    return x, y
