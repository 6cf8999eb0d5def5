"""Recording the telemetry of a running vehicle in a file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import BinaryIO

from autopilot.wire.tlog import TlogWriter
from gcs.clients import command
from gcs.clients.capture import Capture
from gcs.clients.flight import REPORT_INTERVAL_US, REPORT_MESSAGES
from gcs.clients.operation import Target
from gcs.clients.parameter_transfer import ParameterList
from gcs.errors import InputError, NoVehicleError, RefusedError, write_error
from gcs.folders import TLOG_FILE, fresh_folder, make_folder, reserved
from gcs.shell.display import notify, stderr_is_terminal
from gcs.shell.link import Address, monotonic_us, unix_us
from gcs.shell.session import Session
from gcs.shell.stopping import StopRequest
from gcs.shell.truth import TruthLink
from gcs.workflows.flight_folder import FlightFolder


def capture_to(
    out: Path | None,
    address: Address,
    duration_s: float | None,
    truth_at: Address | None = None,
    overwrite: bool = False,
) -> tuple[Path, int]:
    """Record telemetry for `duration_s` or until the user stops; return the log and its number of messages.

    Without `out` the log goes to flights/capture-TIME/flight.tlog. Parameters come first.
    `truth_at`: where the simulator sends the truth; None: where `sitl` does by default.
    InputError if `out` is an earlier log, unless `overwrite` permits to replace it.
    """
    if out is not None and not overwrite:
        _check_no_log(out)
    with (
        TruthLink(truth_at) as world,
        Session(address) as session,
        StopRequest("stopping") as stop,
    ):
        target = session.find_with_truth(world)
        if session.unanswered_reason:
            notify(
                "only what the vehicle sends by itself is captured, without truth: "
                f"{session.unanswered_reason}"
            )
        elif world.missing:
            notify(f"the log will not contain the simulator's truth: {world.missing}")
        path = out or fresh_folder("capture") / TLOG_FILE
        with _opened(path, overwrite) as file:
            capture = Capture(TlogWriter(file), unix_us() - monotonic_us())

            def received(datagram: bytes, now_us: int) -> None:
                capture.on_vehicle(datagram)
                capture.flush(now_us)

            def sent(datagram: bytes, now_us: int) -> None:
                capture.on_sent(datagram)

            def truth(datagram: bytes, now_us: int) -> None:
                capture.on_truth(datagram)

            session.on_truth = truth
            session.on_received = received
            session.on_sent = sent
            if not session.unanswered_reason:
                _request_all(session, target)
            if not stderr_is_terminal():  # on a terminal a bar shows it
                until = "until Ctrl-C" if duration_s is None else f"for {duration_s:g} s"
                notify(f"capturing to {path} {until}")
            session.watch(lambda: bool(stop), duration_s, "capturing")
            capture.flush(monotonic_us())
        return path, capture.records


def _request_all(session: Session, target: Target) -> None:
    """Request all parameters, and the fast messages that a report needs."""
    try:
        session.run(ParameterList(target), "parameters")
    except NoVehicleError as error:
        notify(str(error))
    for message_id in REPORT_MESSAGES:
        try:
            session.run(command.message_interval(target, message_id, REPORT_INTERVAL_US))
        except RefusedError as error:
            notify(str(error))


@contextmanager
def _opened(path: Path, overwrite: bool) -> Iterator[BinaryIO]:
    """The log, open for writing and locked against other writers; so is the whole folder if it is a flight's,
    from which an earlier flight is deleted."""
    with ExitStack() as stack:
        if path.name == TLOG_FILE:
            stack.enter_context(FlightFolder(path.parent, overwrite)).keep()
        else:
            make_folder(path.parent, path)
            if path.is_file() or not path.exists():
                stack.enter_context(reserved(path, "another gcs capture is writing"))
                if not overwrite:
                    _check_no_log(path)
        try:
            file = stack.enter_context(path.open("wb"))
        except OSError as error:
            raise write_error(error, path, "file") from None
        yield file


def _check_no_log(out: Path) -> None:
    """InputError if `out` is a file with contents; a pipe or a device has none to lose."""
    if out.is_file() and out.stat().st_size:
        raise InputError(f"--out {out}: holds a log already; name another, or add --overwrite")
