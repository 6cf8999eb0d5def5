"""Functions that the shells of `sitl` and `autopilot` share: stopping, waiting, and reading options."""

from __future__ import annotations

import ctypes
import errno
import gc
import json
import os
import signal
import socket
import struct
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TextIO, TypeVar, cast

import click

from autopilot.wire.convert.geodesy import Home, home_from_text

Address = tuple[str, int]
F = TypeVar("F", bound=Callable[..., Any])

MAX_DATAGRAM_BYTES = 65535
MAX_SEED = 2**63 - 1
EXIT_ERROR, EXIT_USAGE = 1, 2  # usage: an error of the command line, or of a file that it names
MAX_SPEED = 1000.0  # times the wall clock
ARGUMENTS_ON_STDIN = "--arguments-follow"  # on stdin
_LOCALHOST = "127.0.0.1"
_PR_SET_TIMERSLACK = 29


class ProgramCommand(click.Command):
    """A program that reports wrong usage in one line and exits with 2.

    It can be loaded before its arguments are known: with `ARGUMENTS_ON_STDIN` as the only argument it waits
    for them on stdin.
    """

    def main(self, args: Sequence[str] | None = None, *_: Any, **extra: Any) -> Any:
        extra["standalone_mode"] = False
        open_closed_streams()
        tolerate_closed_terminal()
        if args is None and sys.argv[1:] == [ARGUMENTS_ON_STDIN]:
            args = _arguments_from_stdin()
        try:
            code = super().main(args, **extra)
        except click.UsageError as error:
            print(f"{self.name}: {usage_text(error)}", file=sys.stderr)
            sys.exit(error.exit_code)
        sys.exit(code if isinstance(code, int) else 0)


def _arguments_from_stdin() -> list[str]:
    """The arguments in a line of JSON on stdin, whose first entry is the file for stdout and stderr; exits if
    no line arrives."""
    line = sys.stdin.buffer.readline()
    if not line:
        sys.exit(0)
    log, *arguments = cast("list[str]", json.loads(line))
    _redirect(os.devnull, os.O_RDONLY, 0)
    _redirect(log, os.O_WRONLY | os.O_APPEND, 1, 2)
    return arguments


def _redirect(path: str, flags: int, *numbers: int) -> None:
    """Redirect these file descriptors to a file."""
    descriptor = os.open(path, flags)
    for number in numbers:
        os.dup2(descriptor, number)
    if descriptor not in numbers:
        os.close(descriptor)


def print_errors(program: str, exit_code: int, *lines: str) -> int:
    """Print why a program ends, a line for each problem; return the exit code."""
    for line in lines:
        print(f"{program}: {line}", file=sys.stderr)
    return exit_code


def usage_text(error: click.UsageError) -> str:
    """What is wrong with the arguments of a command, in one line, with a reference to its --help."""
    text = " ".join(error.format_message().split()).rstrip(".")
    link = " " if text.endswith("?") else "; "
    return f"{text}{link}see {error.ctx.command_path} --help" if error.ctx else text


class WholeNumber(click.IntRange):
    """A whole number within limits."""

    name = "whole number"


class NonEmptyPath(click.Path):
    """A path that is not empty: an empty one would mean whatever folder is the current one."""

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        if not os.fspath(value):
            self.fail("'' is no path; . is the folder in which you are", param, ctx)
        return super().convert(value, param, ctx)


def stop_signals() -> tuple[signal.Signals, ...]:
    """The signals that end a program; a closed terminal too, unless the program is to outlive it (nohup)."""
    survives_hangup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return (
        (signal.SIGINT, signal.SIGTERM) if survives_hangup else (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    )


class CloseSafeStream:
    """A terminal that accepts text even after it is closed; from then on the text is lost."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        with self._ignoring_closed_terminal():
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        with self._ignoring_closed_terminal():
            self._stream.flush()

    @contextmanager
    def _ignoring_closed_terminal(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            # the rest of its buffer is written there, too
            _redirect(os.devnull, os.O_WRONLY, self._stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def open_closed_streams() -> None:
    """Redirect stdin, stdout and stderr to the null device if the program was started without them (`>&-`):
    else the next files that are opened would take their places."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        try:
            os.fstat(number)
        except OSError:
            _redirect(os.devnull, os.O_RDWR, number)
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def tolerate_closed_terminal() -> None:
    """Make text to a closed terminal be lost without an error."""
    if sys.stdout.isatty():
        sys.stdout = cast(TextIO, CloseSafeStream(sys.stdout))
    if sys.stderr.isatty():
        sys.stderr = cast(TextIO, CloseSafeStream(sys.stderr))


class Stop(BaseException):
    """SIGTERM, SIGINT or SIGHUP; its text is the name."""


class StopRequest:
    """Notes a signal; the loops check it at points where nothing is half done.

    An exception raised by the handler itself could occur within a kernel's call, whose machine code cannot
    handle it.
    """

    requested = False
    _name = ""
    _signals: tuple[signal.Signals, ...] = ()

    def __enter__(self) -> StopRequest:
        self._signals = stop_signals()
        for number in self._signals:
            signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number in self._signals:
            signal.signal(number, signal.SIG_IGN)  # once is enough

    def _note(self, number: int, _frame: object) -> None:
        self.requested, self._name = True, signal.Signals(number).name

    def check(self) -> None:
        """Raise Stop if a signal came."""
        if self.requested:
            raise Stop(self._name)


def stop_text(at_us: int, stopped_by: str, summary: str) -> str:
    """When and by which signal a program was stopped, and the summary of its work."""
    return "; ".join(filter(None, (f"stopped at t = {at_us / 1e6:.3f} s by {stopped_by}", summary)))


def set_timeout(sock: socket.socket, seconds: float) -> None:
    """Set how long a receive waits; 0: for ever. Uses SO_RCVTIMEO, which costs nothing per datagram."""
    whole = int(seconds)
    value = struct.pack("ll", whole, round((seconds - whole) * 1e6))
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, value)


def receive(
    sock: socket.socket, flags: int = 0, max_bytes: int = MAX_DATAGRAM_BYTES
) -> tuple[bytes, Address] | None:
    """The next datagram, at most `max_bytes` of it, and its sender; None after the timeout, or if one of
    ours found no listener."""
    try:
        return sock.recvfrom(max_bytes, flags)
    except OSError:
        return None


def send(sock: socket.socket, datagram: bytes, address: Address | None = None) -> bool:
    """Send a datagram, by a connected socket if there is no address; False if it is lost: nobody listens
    there yet, or the network is full."""
    try:
        if address is None:
            sock.send(datagram)
        else:
            sock.sendto(datagram, address)
    except OSError:
        return False
    return True


def datagram_socket(address: Address) -> socket.socket:
    """A UDP socket of the family of `address`."""
    family = socket.getaddrinfo(*address, type=socket.SOCK_DGRAM)[0][0]
    return socket.socket(family, socket.SOCK_DGRAM)


def os_error_text(error: OSError) -> str:
    """The system's text of an error, without what Python adds about the call (its `strerror`)."""
    is_of_system = not isinstance(error, socket.gaierror)
    if error.errno is not None and error.errno in errno.errorcode and is_of_system:
        return os.strerror(error.errno).lower()
    return error.strerror.lower() if error.strerror else str(error)


def address_text(address: Address | None) -> str:
    """An address as readable text."""
    return f"{address[0]}:{address[1]}" if address else "nowhere"


def can_fork() -> bool:
    """Whether a forked process can use what is loaded here: no other thread holds a lock to inherit."""
    return sys.platform.startswith("linux") and threading.active_count() == 1


def reduce_latency(real_time: bool) -> None:
    """Request short delays from the system and the interpreter; the program also works without them.

    A program that keeps to the wall clock also requests priority over all others, but not for the processes
    that it starts.
    """
    if real_time:
        with suppress(OSError, AttributeError):
            os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    if real_time:
        gc.collect()
    gc.freeze()  # the present objects stay, and are not scanned again
    gc.enable()


def address_option(text: str) -> Address:
    """PORT of this machine, or HOST:PORT."""
    host, colon, port = text.rpartition(":")
    if not (bool(host) == bool(colon) and port.isdecimal() and 0 < int(port) < 65536):
        raise click.BadParameter(f"{text!r}; must be PORT or HOST:PORT, with a port of 1 ... 65535")
    return host.strip("[]") or _LOCALHOST, int(port)


def home_option(text: str) -> Home:
    """LAT,LON,ALT."""
    try:
        return home_from_text(text)
    except ValueError as error:
        raise click.BadParameter(str(error)) from None


def signing_key_option(text: str) -> bytes:
    """FILE with a signing key that no other user may read."""
    from autopilot.wire.signing import NoKeyError, key_of_text  # only if needed

    path = Path(text)
    try:
        if path.stat().st_mode & 0o077:
            raise click.BadParameter(f"{text!r} can be read by others; chmod 600 {text}")
        return key_of_text(path.read_text(encoding="utf-8-sig"))
    except NoKeyError as error:
        raise click.BadParameter(f"{text!r} {error}") from None
    except (OSError, UnicodeDecodeError) as error:
        why = os_error_text(error) if isinstance(error, OSError) else "not a text file"
        raise click.BadParameter(f"{text!r}: {why}") from None


def setting_option(text: str) -> tuple[str, float]:
    """NAME=VALUE."""
    name, _, value = text.partition("=")
    try:
        return name.strip().upper(), float(value)
    except ValueError:
        raise click.BadParameter(f"{text!r}; must be NAME=VALUE with a number") from None


def ignore_option(verb: str) -> Callable[[F], F]:
    """--ignore of every command that starts an autopilot, or foresees what it does; the help begins with
    `verb`."""

    def in_capitals(_: click.Context, __: click.Parameter, names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name.strip().upper() for name in names)

    return click.option(
        "--ignore",
        metavar="NAME",
        multiple=True,
        callback=in_capitals,
        help=f"{verb} without a parameter in the vehicle's file, for example that of another law; "
        "repeatable.",
    )


def vehicle_option(help_text: str) -> Callable[[F], F]:
    """--vehicle of `sitl` and of `autopilot`, to each of which it means another side of the vehicle."""
    return click.option("--vehicle", default="bebop", show_default=True, metavar="NAME|FILE", help=help_text)


def origin_option(function: F) -> F:
    """--home of `sitl` and of `autopilot`."""
    help_text = "Origin of the world: degrees, metres."
    return click.option("--home", type=home_option, metavar="LAT,LON,ALT", help=help_text)(function)


def last_options(program: str) -> Callable[[F], F]:
    """--quiet and --version of `sitl` and of `autopilot`."""

    def add(function: F) -> F:
        version = click.version_option(package_name="plumbline", message=f"{program} (Plumbline) %(version)s")
        return click.option("--quiet", is_flag=True, help="Print errors only.")(version(function))

    return add


def settings_option(help_text: str) -> Callable[[F], F]:
    """--set of `sitl` and of `autopilot`, each of which has parameters of its own."""
    return click.option(
        "--set", "settings", type=setting_option, metavar="NAME=VALUE", multiple=True, help=help_text
    )
