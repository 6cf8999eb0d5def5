"""The vehicle as any number of ground stations see it: datagrams in, events out; snapshots in, datagrams out.

The shell owns sockets, clock and files. It calls `receive` for each datagram, then `poll` once per tick:

    for event in endpoint.receive(datagram, link, now_us, decide): ...
    for link, datagram in endpoint.poll(make_snapshot, now_us): ...

`decide` returns the supervisor's decision on a request; `make_snapshot` is called only if something is due.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from autopilot.geometry.linear import Vec3
from autopilot.services.commands import CommandService
from autopilot.services.components import ComponentService
from autopilot.services.faults import FaultReporter
from autopilot.services.file_tree import FileTree
from autopilot.services.files import Card, MemoryCard
from autopilot.services.ftp import FtpService
from autopilot.services.guided import GuidedService
from autopilot.services.identity import (
    AUTOPILOT_COMPONENT,
    DIALECT_COMPONENT,
    LOAD_COMPONENT,
    WINCH_COMPONENT,
    Identity,
    available_modes_messages,
)
from autopilot.services.kept_texts import KeptTexts
from autopilot.services.links import LinkState, Outgoing
from autopilot.services.logs import LogService
from autopilot.services.mission_store import StoredMission
from autopilot.services.missions import MissionService
from autopilot.services.parameter_protocol import ParameterService
from autopilot.services.records import (
    Announce,
    Decide,
    Event,
    Handler,
    Link,
    Output,
    ParametersSaved,
    Peer,
    RefusalCleared,
    Send,
    SendText,
    SimulatorParametersSaved,
    Source,
    Verdict,
)
from autopilot.services.requests import (
    FollowAttitude,
    FollowRates,
    FollowSetpoint,
    FollowStick,
    FollowTarget,
    GetMessageInterval,
    InjectFailure,
    Reposition,
    RequestCapabilities,
    RequestMessage,
    ResetParameters,
    SetMessageInterval,
    SetMode,
    StoreParameters,
)
from autopilot.services.signing import SigningService
from autopilot.services.snapshot import Snapshot
from autopilot.services.stream_frames import BITS, StreamFrames, stream_groups
from autopilot.services.streams import DEFAULT, NEVER_US, OFF
from autopilot.services.telemetry import (
    COMPONENT_STREAMS,
    DATA_STREAM_GROUPS,
    LOAD_STREAMS,
    LOAD_SYSTEM_BIT,
    MESSAGE_ID_MASK,
    PROGRAM_INTERVALS_US,
    STREAMS,
    WATCHED,
    WINCH_HEARTBEAT,
    Stream,
)
from autopilot.services.text_limiter import WARNING_INTERVAL_US, TextLimiter
from autopilot.services.timesync import answer_ping, answer_timesync
from autopilot.services.virtual_files import generated_files, information_message, metadata_message
from autopilot.wire.codec import FrameWriter, Received, decode
from autopilot.wire.convert.geodesy import Home
from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.items import WireItem
from autopilot.wire.parameter_table import ParameterTable
from autopilot.wire.signing import Signing
from autopilot.wire.statustext import TextWriter

LINK_SILENCE_US = 30_000_000  # after this silence a link that was not configured is forgotten
REACHED_REPETITIONS = 10  # repetitions of the end of a mission, as in PX4
REACHED_INTERVAL_US = 1_000_000  # between two repetitions
REASON_INTERVAL_US = 1_000_000  # between two equal refusals to the client that asks
MAX_GARBAGE_BYTES = 64  # bytes of a datagram that may belong to no message before the rest of it is skipped
MAX_LINKS = 16  # links that were not configured; a new one replaces the one silent longest
LINK_REPLACEMENT_US = 20_000  # least time between two replacements: a new link costs as much as ten messages
_SECOND_US = 1_000_000
_INT32 = 2**31 - 1
_UINT16 = 2**16 - 1

_ACCEPTED = Verdict(mavlink.MAV_RESULT_ACCEPTED)
_UNSUPPORTED = Verdict(mavlink.MAV_RESULT_UNSUPPORTED)
_HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
_NO_INSTANT = np.zeros(0)

# they change no mode
_SETPOINT_REQUESTS = FollowSetpoint | FollowAttitude | FollowRates | FollowStick | FollowTarget
_METADATA = {
    mavlink.MAVLINK_MSG_ID_COMPONENT_METADATA: metadata_message,
    mavlink.MAVLINK_MSG_ID_COMPONENT_INFORMATION: information_message,
}

SnapshotFactory = Callable[[], Snapshot]


class CompiledStreams(NamedTuple):
    """Streams of a link that machine code writes."""

    link: Link
    until_us: int  # when something else is due
    due: NDArray[np.int64]  # from `Streams.compiled_groups`
    frames: StreamFrames
    request_writer: FrameWriter  # of a component that sends requests besides


# streams that machine code writes, or that are empty: FILTER_STATE is sent only with a custom estimator
_COMPILED_BITS = BITS | {mavlink.MAVLINK_MSG_ID_FILTER_STATE: 0}


class VehicleEndpoint:
    """All services of one vehicle, on all its links."""

    def __init__(
        self,
        identity: Identity,
        home: Home,
        parameters: ParameterTable,
        mission: StoredMission | None = None,
        card: Card | None = None,
        signing: Signing | None = None,
        boot_unix_us: int = 0,
        setup_signing: bool = False,
    ) -> None:
        """`setup_signing`: a first signing key is accepted from any sender."""
        self.identity = identity
        self._home = home
        self._signing = SigningService(signing, boot_unix_us, setup_signing)
        self._missions = MissionService(home, mission or StoredMission(), identity.flavour.home_is_item)
        self._reached, self._reached_left = 0, 0  # last item of a completed mission, to be reported again
        self._reached_us: int | None = None
        self._parameters = ParameterService(parameters, identity.parameter_encoding)
        self._commands = CommandService(home, identity)
        self._components = ComponentService(self._commands)
        self._guided = GuidedService(home, identity.system)
        generated = generated_files(identity, parameters, lambda: self._missions.mission)
        self.files = FileTree(MemoryCard() if card is None else card, generated)
        self._ftp = FtpService(self.files)
        self._logs = LogService(self.files)
        self._texts = TextWriter()
        self._refusals = TextLimiter()
        self.kept_texts = KeptTexts(self._texts)
        self._now_us = 0  # of the last call; texts are dated by it
        self._paused_us = 0  # time for which the vehicle's clock was paused while that of the services ran
        self._timed_services = (
            self._signing,
            self._missions,
            self._parameters,
            self._ftp,
            self._logs,
            self.kept_texts,
        )
        self._faults = FaultReporter()
        self._links: dict[Link, LinkState] = {}
        self._next_replacement_us = 0  # when the next link may replace another
        self._unconfigured: dict[Link, LinkState] = {}  # of `_links`, those that were not configured
        load: dict[int, Stream] = LOAD_STREAMS if identity.load_system else {}
        table = STREAMS | COMPONENT_STREAMS | load
        intervals_us = {key: stream.interval_us for key, stream in table.items()}
        self._defaults = (
            intervals_us,
            intervals_us | PROGRAM_INTERVALS_US,
        )  # of ground stations, of programs
        self._builders = {
            key: (
                (identity.load_system if key & LOAD_SYSTEM_BIT else identity.system, row.component),
                row.build,
            )
            for key, row in table.items()
        }
        self._own_source: Source = (identity.system, AUTOPILOT_COMPONENT)
        # streams by message id that each part of the vehicle serves on request; the autopilot nearly all
        self._streams_by_source: dict[Source, dict[int, int]] = {}
        for key, (source, _) in self._builders.items():
            self._streams_by_source.setdefault(source, {})[key & MESSAGE_ID_MASK] = key
        self._streams_by_source[self._own_source] = {key: key for key in STREAMS}
        self._watched: dict[int, Any] = {}
        # `change_token` and `plan_ids` of the last snapshot
        self._last_version: tuple[object, Any] = (None, ())
        self._requested_mode: int | None = None
        self._consequences: list[Output] = []  # of a decision
        self._has_queued = False  # something waits in a queue
        self._timers_changed = False  # timers may have changed since these times were noted:
        self._timer_us = self._next_us = 0  # when a service has something to do, and when anything is due
        self._events: list[Event] = []  # of `poll`, until they are taken
        self.gcs_heartbeat_us = NEVER_US  # when the last HEARTBEAT of a ground station arrived
        self.on_text: Callable[[int, str], None] | None = None  # called with each text for the operators
        self.simulator_boot: Any = None  # SIM_BOOT of the present simulator, once received
        self.handlers = self._handler_table()  # by message id

    @property
    def mission(self) -> StoredMission:
        """The mission in force."""
        return self._missions.mission

    @property
    def areas(self) -> dict[int, tuple[WireItem, ...]]:
        """The items of fence and rally points by MAV_MISSION_TYPE."""
        return dict(self._missions.areas)

    def set_areas(self, kind: int, items: tuple[WireItem, ...]) -> None:
        """Set fence or rally points as they were stored."""
        self._missions.areas[kind] = items

    def move_home(self, place: Vec3) -> None:
        """Home is at `place` from now on (m, ENU from the origin)."""
        self._missions.move_home(place)

    @property
    def links(self) -> tuple[Link, ...]:
        """The links that receive telemetry now."""
        return tuple(self._links)

    # ---- what the shell calls

    def add_link(self, link: Link, now_us: int = 0, program: bool = False) -> None:
        """Add a link that always receives telemetry, even if no message arrives on it; `program`: with the
        streams for programs instead of those for ground stations."""
        self._links[link] = self._new_link(now_us, program)
        self._unconfigured.pop(link, None)
        self._has_queued = True

    def remove_link(self, link: Link) -> None:
        """Forget a link that no longer exists."""
        if link in self._links:
            self._forget(link)

    def receive(
        self, datagram: bytes, link: Link, now_us: int, decide: Decide, program: bool = False
    ) -> list[Event]:
        """Handle a datagram of `link`; answers are sent with the next `poll`. Malformed input never raises.

        `program`: the kind of the link if it is new (see `add_link`).
        """
        events: list[Event] = []
        self._timers_changed, self._now_us = True, now_us
        for received in decode(datagram, MAX_GARBAGE_BYTES)[0]:
            message_id = received.id
            if self._is_own(received) or not self._signing.accepts(received, message_id):
                continue
            state = self._receiving_link(link, now_us, program)
            if state is None:
                break
            if message_id == _HEARTBEAT and received.message.type == mavlink.MAV_TYPE_GCS:
                self.gcs_heartbeat_us = now_us
            handler = self.handlers.get(message_id)
            addressed = self._addressed_part(message_id, received.message) if handler else None
            if handler and addressed:
                others = addressed != self._own_source
                peer = Peer(link, received.system, received.component, addressed if others else None)
                if others:
                    handler = self._components.receive
                if addressed[1] == WINCH_COMPONENT and state.streams.interval(WINCH_HEARTBEAT) == OFF:
                    state.streams.set_interval(WINCH_HEARTBEAT, DEFAULT, now_us)
                wrapped = self._decider(state, peer, now_us, decide)
                service_us = now_us + self._paused_us
                try:
                    outputs = handler(received.message, peer, service_us, wrapped)
                except Exception:  # an error in a service must not crash the vehicle
                    outputs = self._faults.report_and_refuse(received.message, peer, service_us)
                self._handle_outputs(outputs, events)
                self._handle_consequences(events)
        return events

    def _handle_consequences(self, events: list[Event]) -> None:
        """Carry out the consequences of a decision besides its answer."""
        consequences, self._consequences = self._consequences, []
        self._handle_outputs(consequences, events)

    def set_wall_clock(self, unix_us: int) -> None:
        """Set the time of the wall clock, with which messages are signed if the vehicle's clock differs."""
        self._signing.set_wall_clock(unix_us)

    def take_events(self) -> list[Event]:
        """Events that arose without a message, to be handled like those of `receive`."""
        events, self._events = self._events, []
        return events

    def add_paused_time(self, paused_us: int) -> None:
        """Note time that has passed while the vehicle's clock was paused.

        Answers that are sent at their own pace continue meanwhile; streams wait for the vehicle.
        """
        self._paused_us += paused_us
        self._timers_changed = True

    def send_text(self, severity: int, text: str, subject: Hashable = None) -> None:
        """Send a text to the operators of all links; for a refusal, `subject` states what was refused."""
        self._handle_outputs([SendText(severity, text, subject)], [])

    def inherit_texts(self, previous: VehicleEndpoint) -> None:
        """Take over the kept texts of the previous run."""
        self.kept_texts.inherit(previous.kept_texts.texts, previous._now_us + previous._paused_us)

    def item_reached(self, seq: int, last: bool = False) -> None:
        """Report that the mission has completed an item.

        For the last item this is repeated for ten seconds: MAVSDK learns only from this message that a
        mission has ended, and forgets it if it receives no heartbeat for three seconds.
        """
        self._handle_outputs([Send(None, mavlink.MAVLink_mission_item_reached_message(seq))], [])
        self._reached, self._reached_us = seq, None
        self._reached_left = REACHED_REPETITIONS if last else 0

    def state_changed(self) -> None:
        """Mode or arming changed: send a HEARTBEAT to all links with the next `poll`."""
        self._handle_outputs([Announce(None, (_HEARTBEAT,))], [])

    def expect_parameters(self) -> None:
        """More parameters will be learned soon: parameter lists wait until `parameters_complete`."""
        self._parameters.expect_more()

    def set_simulator_silent(self, silent: bool) -> None:
        """State whether the simulator is silent: then none of its parameters can be set."""
        self._parameters.simulator_silent = silent

    def parameters_complete(self, now_us: int) -> None:
        """The parameter table is complete."""
        self._parameters.complete(now_us)
        self._timers_changed = True

    def parameter_changed(self, name: str) -> None:
        """The vehicle itself changed a parameter: send it to all links."""
        self._handle_outputs([Send(None, self._parameters.value_message(name))], [])

    def refuse_simulator_parameter(self, name: str, error: int, client: Peer) -> None:
        """The simulator refused a value that this client had sent."""
        self._handle_outputs([self._parameters.refusal_of_simulator(name, error, client)], [])

    def datagram(self, link: Link, message: Any, component: int = AUTOPILOT_COMPONENT) -> bytes:
        """One message of a component for a link as a datagram, with the link's next sequence number."""
        return self._links[link].frame((self.identity.system, component), message)

    def is_due(self, now_us: int) -> bool:
        """Whether `poll` has anything to do."""
        return self._has_queued or now_us >= min(self._next_timer(), self._next_stream())

    def _next_timer(self) -> int:
        """When a service, or the end of a mission, next has something to do, by the vehicle's clock."""
        timers = [service.next_timer() - self._paused_us for service in self._timed_services]
        if self._reached_left:
            timers.append(self._reached_us or 0)
        return min(timers)

    def _next_stream(self) -> int:
        return min((state.streams.next_us for state in self._links.values()), default=NEVER_US)

    def poll(self, make_snapshot: SnapshotFactory, now_us: int) -> list[tuple[Link, bytes]]:
        """All that is due now: answers first, then streams, packed into datagrams by link."""
        self._now_us = now_us
        if self._timers_changed:
            self._update_next_times()
        if now_us < self._next_us and not self._has_queued:
            return []
        if self._unconfigured:
            self._forget_silent(now_us)
        if self._has_queued or now_us >= self._timer_us or self._signing.signing is not None:
            service_us = now_us + self._paused_us
            for service in self._timed_services:
                try:
                    outputs = service.poll(service_us)
                except Exception:  # as in `receive`
                    outputs = self._faults.report(type(service).__name__, service_us)
                self._handle_outputs(outputs, self._events)
            self._handle_consequences(self._events)
            self._repeat_item_reached(make_snapshot, now_us)
            self._has_queued, self._timers_changed = False, True
        due: list[tuple[Link, LinkState, tuple[int, ...]]] = []
        streams, next_us = False, self._timer_us
        for link, state in self._links.items():
            keys = state.streams.take_due(now_us)
            due.append((link, state, keys))
            streams = streams or bool(keys or state.announced)
            next_us = min(next_us, state.streams.next_us)
        self._next_us = next_us
        snapshot = self._take_snapshot(make_snapshot) if streams else None
        return self._datagrams(due, snapshot)

    def compiled_streams(
        self, change_token: object, now_us: int, request_component: int
    ) -> CompiledStreams | None:
        """The streams that machine code can write at the next ticks in place of `poll`, on the only link,
        while the snapshot's `change_token` is this object and the built-in estimator flies; None: there may
        be more to send. The component `request_component` sends its requests besides."""
        if (
            self._has_queued
            or self._unconfigured
            or self._signing.signing is not None
            or len(self._links) != 1
        ):
            return None
        if self._timers_changed:
            self._update_next_times()
        (link, state), version = next(iter(self._links.items())), self._last_version
        # changes are announced, which only `poll` does
        changed = change_token is not version[0] or version[1] != self._missions.plan_ids
        if changed or state.queue or state.announced or self._next_us <= now_us:
            return None
        due, others_us = state.streams.compiled_groups(_COMPILED_BITS)
        writer = state.writer((self.identity.system, request_component))
        return CompiledStreams(link, min(self._timer_us, others_us), due, state.frames, writer)

    def streams_written(self, written: CompiledStreams, now_us: int) -> None:
        """Note that machine code has written all streams that were due until now."""
        streams = self._links[written.link].streams
        streams.take_due(now_us)
        self._now_us, self._next_us = now_us, min(self._timer_us, streams.next_us)

    def _take_snapshot(self, make_snapshot: SnapshotFactory) -> Snapshot:
        """The snapshot for the streams that are due; announces what has changed."""
        snapshot = make_snapshot()
        snapshot.requested_mode, snapshot.plan_ids = self._requested_mode, self._missions.plan_ids
        self._announce_changes(snapshot)
        return snapshot

    def _datagrams(
        self, due: list[tuple[Link, LinkState, tuple[int, ...]]], snapshot: Snapshot | None
    ) -> list[tuple[Link, bytes]]:
        """Datagrams of the messages that wait on each link, and of the streams that are due there."""
        built: dict[int, list[Outgoing]] = {}
        instant = _NO_INSTANT if snapshot is None or snapshot.instant is None else snapshot.instant
        datagrams: list[tuple[Link, bytes]] = []
        for link, state, keys in due:
            outgoing: list[Outgoing | int] = [*state.queue]
            state.queue.clear()
            if snapshot is not None:
                outgoing += self._streams(state, keys, snapshot, built)
            if outgoing:
                datagrams += [(link, datagram) for datagram in state.datagrams(outgoing, instant)]
        return datagrams

    def _streams(
        self, state: LinkState, keys: tuple[int, ...], snapshot: Snapshot, built: dict[int, list[Outgoing]]
    ) -> list[Outgoing | int]:
        """The streams that are due on a link; `built` holds the messages built for other links."""
        if state.announced:
            # announced messages, including those of this poll, precede the streams
            keys = tuple(dict.fromkeys((*state.announced, *keys)))
            state.announced.clear()
        # signed messages are written frame by frame
        written = snapshot.instant is not None and self._signing.signing is None
        outgoing: list[Outgoing | int] = []
        for part in stream_groups(keys) if written else (keys,):
            if isinstance(part, int):
                outgoing.append(part)
                continue
            for key in part:
                stream_messages = built.get(key)
                if stream_messages is None:
                    source, build = self._builders[key]
                    messages = build(snapshot, self.identity)
                    stream_messages = built[key] = [(source, message) for message in messages]
                outgoing += stream_messages
        return outgoing

    def _update_next_times(self) -> None:
        """Note when there is something to do next if nothing arrives before."""
        self._timers_changed = False
        self._timer_us = self._next_timer()
        self._next_us = min(self._timer_us, self._next_stream())

    def _repeat_item_reached(self, make_snapshot: SnapshotFactory, now_us: int) -> None:
        if not self._reached_left:
            return
        if self._reached_us is None:
            self._reached_us = now_us + REACHED_INTERVAL_US
        elif now_us >= self._reached_us:
            if self._take_snapshot(make_snapshot).mission_state != mavlink.MISSION_STATE_COMPLETE:
                self._reached_left = 0  # the mission was begun again or replaced
                return
            self._handle_outputs(
                [Send(None, mavlink.MAVLink_mission_item_reached_message(self._reached))], []
            )
            self._reached_left, self._reached_us = self._reached_left - 1, now_us + REACHED_INTERVAL_US

    # ---- sending

    def _announce_changes(self, snapshot: Snapshot) -> None:
        """Announce what has changed since the last snapshot."""
        version = (snapshot.change_token, snapshot.plan_ids)
        if (
            version[0] is not None
            and version[0] is self._last_version[0]
            and version[1] == self._last_version[1]
        ):
            return
        self._last_version = version
        for key, pick in WATCHED.items():
            picked = pick(snapshot)
            if self._watched.get(key) != picked:
                self._watched[key] = picked
                self._announce(None, key)

    def _announce(self, link: Link | None, key: int) -> None:
        for state in self._states(link):
            state.announced[key] = None

    def _states(self, link: Link | None) -> list[LinkState]:
        if link is None:
            return list(self._links.values())
        state = self._links.get(link)
        return [state] if state else []

    def _handle_outputs(self, outputs: list[Output], events: list[Event]) -> None:
        """Carry out what a service returned; events are added to `events`."""
        for output in outputs:
            match output:
                case Send(link, message, source):
                    for state in self._states(link):
                        state.queue.append((source or self._own_source, message))
                case RefusalCleared(subject):
                    self.kept_texts.clear_refusals(subject)
                case SendText():
                    self._send_text(output)
                case Announce(link, keys):
                    for key in keys:
                        self._announce(link, key)
                case _:
                    events.append(output)
                    continue
            self._has_queued = True

    def _send_text(self, text: SendText) -> None:
        """Send a text to all links, a refusal only to those that have not just had it."""
        now_us = self._now_us + self._paused_us
        is_logged = self._is_news(text, None, now_us)
        states = [state for link, state in self._links.items() if self._is_news(text, link, now_us)]
        if is_logged or states or self.kept_texts.holds(text.text):
            self.kept_texts.keep(text.severity, text.text, now_us, text.subject)
        if is_logged and self.on_text is not None:
            self.on_text(text.severity, text.text)
        if not states:
            return
        for message in self._texts.messages(text.severity, text.text):
            for state in states:
                state.queue.append((self._own_source, message))

    def _is_news(self, text: SendText, link: Link | None, now_us: int) -> bool:
        """Whether a text is sent to a link (None: to the log). A client that asks again expects the reason
        and gets it sooner than the others."""
        if text.asker is None:
            return True
        interval_us = REASON_INTERVAL_US if link == text.asker else WARNING_INTERVAL_US
        return self._refusals.allows(text.text, now_us, interval_us, link)

    # ---- links

    def _new_link(self, now_us: int, program: bool) -> LinkState:
        taken = {state.number for state in self._links.values()}
        number = next(number for number in range(len(taken) + 1) if number not in taken)
        signer, system = self._signing.signer, self.identity.system
        defaults = self._defaults[program]
        state = LinkState(defaults, now_us, number & 0xFF, signer, system, self._home)
        state.streams.set_interval(WINCH_HEARTBEAT, OFF, now_us)
        return state

    def _receiving_link(self, link: Link, now_us: int, program: bool) -> LinkState | None:
        """The link on which a message arrived; None: a new link for which there is no room now."""
        state = self._links.get(link)
        if state is None:
            if len(self._unconfigured) >= MAX_LINKS:
                if now_us < self._next_replacement_us:
                    return None
                self._next_replacement_us = now_us + LINK_REPLACEMENT_US
                self._forget(
                    min(self._unconfigured, key=lambda link: self._unconfigured[link].last_received_us)
                )
            state = self._links[link] = self._unconfigured[link] = self._new_link(now_us, program)
            self._has_queued = True
        state.last_received_us = now_us
        return state

    def _forget_silent(self, now_us: int) -> None:
        for link, state in list(self._unconfigured.items()):
            if now_us - state.last_received_us > LINK_SILENCE_US:
                self._forget(link)

    def _forget(self, link: Link) -> None:
        del self._links[link]
        self._unconfigured.pop(link, None)
        for service in (self._parameters, self._ftp, self._logs, self.kept_texts):
            service.forget(link)

    # ---- receiving

    def _is_own(self, received: Received) -> bool:
        """Whether the vehicle itself sent the message, which returns on a looped link."""
        own = (received.system, received.component) in self._streams_by_source
        return own or received.system == self.identity.load_system != 0

    def _addressed_part(self, message_id: int, message: Any) -> Source | None:
        """The part of the vehicle to which a message is addressed: the autopilot if the address is 0 (all) or
        missing; None: another system or component."""
        if message_id == mavlink.MAVLINK_MSG_ID_PING:
            return self._own_source  # its target states whether it is a request
        system = getattr(message, "target_system", 0) or self.identity.system
        component = getattr(message, "target_component", 0)
        if component == 0:
            component = AUTOPILOT_COMPONENT if system == self.identity.system else LOAD_COMPONENT
        return (system, component) if (system, component) in self._streams_by_source else None

    def _decider(self, state: LinkState, peer: Peer, now_us: int, decide: Decide) -> Decide:
        """`decide` for the supervisor's requests, combined with the requests that are answered here."""

        def decided(request: Any) -> Verdict:
            match request:
                case StoreParameters(save):
                    if save:
                        self._consequences.append(ParametersSaved())
                    if save and self._parameters.table.remote_names:
                        self._consequences.append(self._parameters.simulator_values())
                    return _ACCEPTED
                case InjectFailure(parameter, bits, _, fail):
                    problem = self._parameters.failure_problem(parameter)
                    if problem:
                        return Verdict(mavlink.MAV_RESULT_DENIED, f"Failure: {problem}")
                    verdict = decide(request)
                    if verdict.result != mavlink.MAV_RESULT_ACCEPTED:
                        return verdict
                    self._consequences.append(self._parameters.inject_failure(parameter, bits, fail))
                    return _ACCEPTED
                case RequestCapabilities():
                    return self._request_message(
                        state, peer, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, 0.0, now_us
                    )
                case RequestMessage(message_id, argument):
                    return self._request_message(state, peer, message_id, argument, now_us)
                case GetMessageInterval(message_id):
                    return self._request_interval(state, peer, message_id)
                case SetMessageInterval(message_id, interval_us):
                    return self._set_interval(state, peer, message_id, interval_us, now_us)
            verdict = decide(request)
            if verdict.result == mavlink.MAV_RESULT_ACCEPTED and isinstance(request, ResetParameters):
                self._consequences += [
                    *self._parameters.reset(),
                    ParametersSaved(),
                    SimulatorParametersSaved({}),
                ]
            if verdict.result == mavlink.MAV_RESULT_ACCEPTED and not isinstance(request, _SETPOINT_REQUESTS):
                if isinstance(request, SetMode):
                    self._requested_mode = request.number
                elif isinstance(request, Reposition):
                    self._requested_mode = None
                self.state_changed()
            return verdict

        return decided

    def _request_message(
        self, state: LinkState, peer: Peer, message_id: int, argument: float, now_us: int
    ) -> Verdict:
        if message_id == mavlink.MAVLINK_MSG_ID_MESSAGE_INTERVAL:
            number = int(argument) if 0.0 <= argument <= _UINT16 else -1
            return self._request_interval(state, peer, number)
        source = peer.addressed or self._own_source
        if message_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT and source == self._own_source:
            self.kept_texts.request(peer.link, now_us + self._paused_us)
            return _ACCEPTED
        build = _METADATA.get(message_id)
        if build is not None and source == self._own_source:
            state.queue.append((source, build(self.identity, self._parameters.table, now_us)))
            return _ACCEPTED
        if message_id == mavlink.MAVLINK_MSG_ID_AVAILABLE_MODES and source == self._own_source:
            modes = available_modes_messages(self.identity)
            if not 0.0 <= argument <= len(modes):
                return Verdict(mavlink.MAV_RESULT_DENIED)
            which = int(argument)  # 0: all
            state.queue += [(source, mode) for mode in (modes[which - 1 : which] if which else modes)]
            return _ACCEPTED
        if (
            message_id == mavlink.MAVLINK_MSG_ID_SIM_BOOT
            and source == self._own_source
            and self.simulator_boot
        ):
            state.queue.append(((self.identity.system, DIALECT_COMPONENT), self.simulator_boot))
            return _ACCEPTED
        key = self._streams_by_source[source].get(message_id)
        if key is None:
            return _UNSUPPORTED
        self._handle_outputs([Announce(peer.link, (key,))], [])
        return _ACCEPTED

    def _request_interval(self, state: LinkState, peer: Peer, message_id: int) -> Verdict:
        if not 0 <= message_id <= _UINT16:
            return _UNSUPPORTED
        source = peer.addressed or self._own_source
        key = self._streams_by_source[source].get(message_id)
        interval = 0 if key is None else state.streams.interval(key) or 0  # 0: not available
        message = mavlink.MAVLink_message_interval_message(message_id, min(interval, _INT32))
        state.queue.append((source, message))
        return _ACCEPTED

    def _set_interval(
        self, state: LinkState, peer: Peer, message_id: int, interval_us: int, now_us: int
    ) -> Verdict:
        key = self._streams_by_source[peer.addressed or self._own_source].get(message_id)
        if key is None:
            return _UNSUPPORTED
        slowest = STREAMS[_HEARTBEAT].interval_us
        if message_id == _HEARTBEAT and (interval_us == OFF or interval_us > slowest):
            return Verdict(
                mavlink.MAV_RESULT_DENIED, f"HEARTBEAT interval {interval_us} us; at most {slowest} us"
            )
        state.streams.set_interval(key, interval_us, now_us)
        return _ACCEPTED

    def _set_origin(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """SET_GPS_GLOBAL_ORIGIN: the origin is not moved; a text and GPS_GLOBAL_ORIGIN report it."""
        if message.target_system not in (0, self.identity.system):
            return []
        text = "Origin not moved: sitl --home and autopilot --home say where the world is"
        where = Announce(peer.link, (mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,))
        return [SendText(mavlink.MAV_SEVERITY_WARNING, text), where]

    def _request_data_stream(self, message: Any, peer: Peer, now_us: int, decide: Decide) -> list[Output]:
        """REQUEST_DATA_STREAM: set the rate of a group on the requesting link; stop: the default rates."""
        state = self._links[peer.link]
        rate_hz = message.req_message_rate if message.start_stop else 0
        interval_us = _SECOND_US // rate_hz if rate_hz else DEFAULT
        for message_id in DATA_STREAM_GROUPS.get(message.req_stream_id, ()):
            state.streams.set_interval(message_id, interval_us, self._now_us)
        return []

    def _handler_table(self) -> dict[int, Handler]:
        """The handler of each message; messages that are not listed are ignored."""
        commands, missions, parameters = self._commands, self._missions, self._parameters
        guided = self._guided
        m = mavlink
        return {
            m.MAVLINK_MSG_ID_COMMAND_LONG: commands.receive_long,
            m.MAVLINK_MSG_ID_COMMAND_INT: commands.receive_int,
            m.MAVLINK_MSG_ID_SET_MODE: commands.receive_set_mode,
            m.MAVLINK_MSG_ID_MISSION_SET_CURRENT: commands.receive_set_current,
            m.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._set_origin,
            m.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: self._request_data_stream,
            m.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: guided.receive_local,
            m.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT: guided.receive_global,
            m.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET: guided.receive_attitude,
            m.MAVLINK_MSG_ID_MANUAL_CONTROL: guided.receive_stick,
            m.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE: guided.receive_channels,
            m.MAVLINK_MSG_ID_FOLLOW_TARGET: guided.receive_target,
            m.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: parameters.receive_request_list,
            m.MAVLINK_MSG_ID_PARAM_REQUEST_READ: parameters.receive_request_read,
            m.MAVLINK_MSG_ID_PARAM_SET: parameters.receive_set,
            m.MAVLINK_MSG_ID_MISSION_COUNT: missions.receive_count,
            m.MAVLINK_MSG_ID_MISSION_ITEM_INT: missions.receive_item_int,
            m.MAVLINK_MSG_ID_MISSION_ITEM: missions.receive_item,
            m.MAVLINK_MSG_ID_MISSION_ACK: missions.receive_ack,
            m.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: missions.receive_clear_all,
            m.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: missions.receive_request_list,
            m.MAVLINK_MSG_ID_MISSION_REQUEST_INT: missions.receive_request_int,
            m.MAVLINK_MSG_ID_MISSION_REQUEST: missions.receive_request,
            m.MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST: missions.receive_partial,
            m.MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST: missions.receive_partial,
            m.MAVLINK_MSG_ID_SETUP_SIGNING: self._signing.receive_setup,
            m.MAVLINK_MSG_ID_TIMESYNC: answer_timesync,
            m.MAVLINK_MSG_ID_PING: answer_ping,
            m.MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL: self._ftp.receive,
            m.MAVLINK_MSG_ID_LOG_REQUEST_LIST: self._logs.receive_list,
            m.MAVLINK_MSG_ID_LOG_REQUEST_DATA: self._logs.receive_data,
            m.MAVLINK_MSG_ID_LOG_REQUEST_END: self._logs.receive_end,
            m.MAVLINK_MSG_ID_LOG_ERASE: self._logs.receive_erase,
        }
