"""A link to a running vehicle, for one exchange after the other, on the wall clock."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Any

from autopilot.wire.dialect import plumbline as mavlink
from autopilot.wire.signing import Signing, timestamp_of
from gcs.clients import command
from gcs.clients.connection import LINK_TIMEOUT_US, Connection
from gcs.clients.datagrams import messages
from gcs.clients.operation import Operation, Result, Status, Target
from gcs.clients.vehicle_view import VehicleView
from gcs.errors import GcsError, NoVehicleError, RefusedError
from gcs.shell.display import StepDisplay, notify
from gcs.shell.link import Address, monotonic_us, unix_us, wait
from gcs.shell.stopping import StopRequest
from gcs.shell.truth import TruthLink
from gcs.shell.vehicle_socket import VehicleSocket

FIND_S = 5.0
TRUTH_S = 2.0  # the truth states five times a second of its clock to which run it belongs
REASON_S = 0.3  # a refusal is explained by a STATUSTEXT that may arrive a little later
_TICK_S = 0.02
_OTHERS_S = 0.1  # in which an autopilot sends messages
_STALLED = "it or its simulator is stopped (SIGSTOP, a debugger), or the link loses messages: try again"

OnDatagram = Callable[[bytes, int], None]  # called with a datagram and its time


class Session:
    """One vehicle; `view` is what it has reported.

    `note` gets a line about each other vehicle at this address. Unless `quiet`, what takes long is shown on
    stderr.
    """

    def __init__(
        self,
        address: Address,
        find_s: float | None = None,
        link_timeout_us: int = LINK_TIMEOUT_US,
        note: Callable[[str], None] = notify,
        quiet: bool = False,
    ) -> None:
        self.view = VehicleView()
        self.address = address
        self.on_received: OnDatagram | None = None
        self.on_sent: OnDatagram | None = None
        self.on_truth: OnDatagram | None = None
        self.unanswered_reason = ""  # why the vehicle has not answered, if that is because its key is missing
        self._truth: TruthLink | None = None
        self._find_s = FIND_S if find_s is None else find_s
        self._connection = Connection(link_timeout_us)
        self._connection.accept_only(address.system)
        if address.signing_key is not None:
            self._connection.sign_with(Signing(address.signing_key, timestamp_of(unix_us())))
        self._socket = VehicleSocket(address, note)
        self._quiet = quiet

    @property
    def target(self) -> Target:
        """The vehicle; `find` must have been called."""
        if self._connection.target is None:
            raise NoVehicleError("no vehicle was looked for")
        return self._connection.target

    @property
    def lost(self) -> bool:
        """True if the vehicle was connected and has been silent for too long. A datagram that has arrived but
        was not read yet counts as received: on a busy machine this process may be late."""
        return self._connection.lost(monotonic_us()) and not self._socket.has_datagram

    def find_with_truth(self, truth: TruthLink, stop: StopRequest | None = None) -> Target:
        """As `find`; from then on the truth of the vehicle's world is received too, and is awaited briefly.

        The caller keeps `truth` and closes it.
        """
        target = self.find(stop)
        try:
            truth.set_vehicle_run(int(self.request(mavlink.MAVLINK_MSG_ID_SIM_BOOT).boot_id))
        except RefusedError:  # another firmware, or a vehicle without a simulator
            truth.set_vehicle_run(None)
        except GcsError:
            truth.set_vehicle_run(None, silence_reason=self.unanswered_reason or _STALLED)
        self._truth = truth
        if not self.unanswered_reason:
            self.watch(lambda: truth.received, TRUTH_S)
        return target

    def find(self, stop: StopRequest | None = None) -> Target:
        """Wait for the vehicle's heartbeat: for a few seconds, or with `stop` as long as it takes, which is
        said. KeyboardInterrupt if the stop is requested before."""
        signatures, label = self._connection.signatures, "waiting for the vehicle"

        def is_found() -> bool:
            return self.view.armed is not None and signatures.are_valid

        self.watch(lambda: is_found() or bool(stop), self._find_s, label)
        if stop is not None and not (is_found() or stop or signatures.problem):
            notify(f"{self._silence_text()}; waiting for it, Ctrl-C ends this")
            self.watch(lambda: is_found() or bool(stop) or bool(signatures.problem), None, label)
        if stop:
            raise KeyboardInterrupt
        if self._connection.target is None or not is_found():
            raise NoVehicleError(self._silence_text())
        return self._connection.target

    def _silence_text(self) -> str:
        """Why there is no vehicle, as far as is known."""
        link = self.address.link
        if self._connection.signatures.problem:
            return f"no vehicle with a valid signature on {link}: {self._connection.signatures.problem}"
        if self.address.system is not None and self._socket.other_systems:
            heard = ", ".join(map(str, self._socket.other_systems))
            return (
                f"no vehicle with system id {self.address.system} heard on {link} within "
                f"{self._find_s:g} s; heard there: {heard} (MAV_SYS_ID of the autopilot)"
            )
        other = 14540 if self.address.port != 14540 else 14550
        return (
            f"no vehicle heard on {link} within {self._find_s:g} s; is autopilot running, "
            f"with its simulator, and sending there? (other addresses: --connect {other} or "
            "--connect HOST:PORT)"
        )

    def find_to_command(self) -> Target:
        """As `find`, for what moves or changes the vehicle: GcsError if another one has its system id."""
        target = self.find()
        self.watch(lambda: bool(self._socket.twin_problem), _OTHERS_S)
        self.require_no_twin()
        return target

    def require_no_twin(self) -> None:
        """GcsError if another vehicle with the same system id sends here too."""
        if self._socket.twin_problem:
            raise GcsError(self._socket.twin_problem)

    def watch(
        self,
        done: Callable[[], bool],
        seconds: float | None,
        label: str = "",
        operation: Operation | None = None,
    ) -> bool:
        """Listen until `done` or until the time has passed (None: no limit); True if done."""
        until_us = None if seconds is None else monotonic_us() + round(seconds * 1e6)
        with StepDisplay(label, self._quiet) as display:
            while not done():
                now_us = monotonic_us()
                if until_us is not None and now_us >= until_us:
                    return False
                for datagram in self._connection.poll(now_us):
                    self._send(datagram, now_us)
                if operation is not None:
                    for message in operation.poll(now_us):
                        self._send(self._connection.frame(message), now_us)
                if label:
                    display.update(*(operation.progress if operation else (0, 0)))
                if not done():
                    wait([self._socket], _TICK_S)
                    self._receive(monotonic_us(), operation)
        return True

    def run(self, operation: Operation, label: str = "") -> Result:
        """Carry out one operation; NoVehicleError if the vehicle is silent, RefusedError if it refuses."""
        texts_before = len(self.view.texts)
        self.watch(
            lambda: operation.result is not None or self.lost,
            None,
            label,
            operation,
        )
        result = operation.result
        if result is None:
            raise NoVehicleError(f"{label or 'the exchange'}: the vehicle fell silent")
        if result.status is Status.UNANSWERED:
            self.unanswered_reason = self.signing_problem
            raise NoVehicleError(result.silence_text(self.signing_problem))
        if result.status is Status.REFUSED:
            self.watch(lambda: False, REASON_S)
            raise RefusedError(result.refusal_text(self.view.problems_since(texts_before)))
        return result

    @property
    def signing_problem(self) -> str:
        """Why no request is answered, if that is because the key that signs messages is missing."""
        return self._connection.signatures.problem

    def request(self, message_id: int) -> Any:
        """The newest message of that id, requested if the vehicle has not sent one by itself."""
        name = mavlink.mavlink_map[message_id].msgname
        if name not in self.view.latest:
            self.run(command.request_message(self.target, message_id))
            if not self.watch(lambda: name in self.view.latest, REASON_S):
                raise GcsError(f"the vehicle accepted the request of {name} but did not send it")
        return self.view.latest[name]

    def _send(self, datagram: bytes, now_us: int) -> None:
        self._socket.send(datagram)
        if self.on_sent is not None:
            self.on_sent(datagram, now_us)

    def _receive(self, now_us: int, operation: Operation | None) -> None:
        for datagram in self._truth.drain() if self._truth else ():
            if self.on_truth is not None:
                self.on_truth(datagram, now_us)
            for one in messages(datagram)[0]:
                self.view.truth.put(one)
        was_known = self._connection.target is not None
        for datagram in self._socket.drain():
            if self.on_received is not None:
                self.on_received(datagram, now_us)
            for one in self._connection.receive(datagram, now_us):
                is_heartbeat = one.id == mavlink.MAVLINK_MSG_ID_HEARTBEAT
                if is_heartbeat and one.component != self.target.component:
                    continue
                self.view.update(one, now_us)
                if operation is not None:
                    operation.receive(one.message, now_us)
        if not was_known and self._connection.target is not None:
            # heartbeats before had no address; a single command is over before the next one
            self._connection.send_heartbeat_at_once()

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> Session:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
