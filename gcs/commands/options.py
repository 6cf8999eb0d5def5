"""Options that several commands share."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import click
from click.shell_completion import CompletionItem

from autopilot.shell.options import NonEmptyPath, WholeNumber
from gcs.commands.parameter_completion import complete_settings
from gcs.errors import InputError
from gcs.folders import check_writable
from gcs.shell.display import reserve_stdout_for_results, results_to_stdout, write_to_stdout
from gcs.shell.link import DEFAULT_PORT, LOOPBACK, PAGE_PORT, SITL_TRUTH, Address, AddressError, parse_address
from missions.units import split_unit

F = TypeVar("F", bound=Callable[..., Any])

_SYSTEM = "gcs.sysid"  # where --sysid is kept until the address is read

Completer = Callable[[click.Context, click.Parameter, str], list[CompletionItem]]


def names_or_files(names: Callable[[], Iterable[str]]) -> Completer:
    """Shell completion of a word that is one of these names, or the path of a file."""

    def complete(_: click.Context, __: click.Parameter, incomplete: str) -> list[CompletionItem]:
        found = [CompletionItem(name) for name in names() if name.startswith(incomplete)]
        return [*found, CompletionItem(incomplete, type="file")]

    return complete


def mission_argument(function: F) -> F:
    """MISSION of every command that takes a shipped mission or a mission file."""

    def shipped() -> Iterable[str]:
        from missions.fileformat import shipped

        return shipped()

    return click.argument("mission", shell_complete=names_or_files(shipped))(function)


class AddressType(click.ParamType):  # type: ignore[type-arg]
    """The address of a connection to a vehicle."""

    name = "ADDRESS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Address:
        if isinstance(value, Address):
            return value
        try:
            key = ctx.find_root().params.get("signing_key") if ctx else None
            system = ctx.meta.get(_SYSTEM) if ctx else None
            return replace(parse_address(value), signing_key=key, system=system)
        except AddressError as error:
            self.fail(str(error), param, ctx)


class TruthType(click.ParamType):  # type: ignore[type-arg]
    """The address to which a simulator sends the true state."""

    name = "ADDRESS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Address:
        try:
            address = parse_address(str(value))
        except AddressError as error:
            self.fail(str(error), param, ctx)
        if not address.listen:
            self.fail(f"{value!r}; a simulator is only listened to: PORT or HOST:PORT", param, ctx)
        return address


class OutputPath(NonEmptyPath):
    """The path that a command writes to; refused before anything is done if it cannot be written."""

    def __init__(self, is_folder: bool) -> None:
        super().__init__(file_okay=not is_folder, dir_okay=is_folder, path_type=Path)
        self._is_folder = is_folder

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        path = Path(str(super().convert(value, param, ctx)))
        named = param.opts[0] if isinstance(param, click.Option) else ""
        check_writable(path, self._is_folder, f"{named} {path}".lstrip())
        return path


OUTPUT_FOLDER, OUTPUT_FILE = OutputPath(is_folder=True), OutputPath(is_folder=False)


class OptionalArgument(click.Argument):
    """An optional argument; errors name it without the brackets of the usage line."""

    def get_error_hint(self, ctx: click.Context | None) -> str:
        return f"'{self.human_readable_name}'"


class FiniteType(click.ParamType):  # type: ignore[type-arg]
    """A finite number."""

    name = "NUMBER"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            self.fail(f"{value!r}; must be a finite number", param, ctx)
        return number


class PositiveType(click.ParamType):  # type: ignore[type-arg]
    """A finite number > 0, and at most `max_value` if there is a bound."""

    name = "NUMBER"

    def __init__(self, max_value: float = math.inf) -> None:
        self._max_value = max_value

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not (0.0 < number <= self._max_value and math.isfinite(number)):
            bound = f" and <= {self._max_value:g}" if math.isfinite(self._max_value) else ""
            self.fail(f"{value!r}; must be a number > 0{bound}", param, ctx)
        return number


class SettingType(click.ParamType):  # type: ignore[type-arg]
    """NAME=VALUE with a finite number."""

    name = "NAME=VALUE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        name, equals, number = str(value).partition("=")
        if not equals or not name.strip():
            self.fail(f"{value!r}; must be NAME=VALUE, e.g. SIM_WIND_E=3", param, ctx)
        try:
            parsed = float(number)
        except ValueError:
            self.fail(f"{value!r}; the value must be a number", param, ctx)
        if not math.isfinite(parsed):
            self.fail(f"{value!r}; the value must be a finite number", param, ctx)
        return f"{name.strip().upper()}={number.strip()}"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        return complete_settings(ctx, param, incomplete)


def sysid_option(function: F, otherwise: str = "the first one heard") -> F:
    """--sysid of every command that communicates with running vehicles, `otherwise` with which ones; it
    becomes part of the address."""

    def keep(ctx: click.Context, _: click.Parameter, system: int | None) -> None:
        ctx.meta[_SYSTEM] = system

    return click.option(
        "--sysid",
        type=WholeNumber(1, 255),
        is_eager=True,  # before the address
        expose_value=False,
        callback=keep,
        help=f"MAVLink system id of the vehicle, if several send to one port.  [default: {otherwise}]",
    )(function)


def connect_option(function: F) -> F:
    """--connect and --sysid of every command that communicates with a running vehicle."""
    return click.option(
        "--connect",
        "address",
        type=AddressType(),
        default=str(DEFAULT_PORT),
        show_default=True,
        help="Connection to the vehicle: PORT or HOST:PORT to listen there, udpout:HOST:PORT to send first, "
        "tcp:HOST:PORT to connect by TCP.",
    )(sysid_option(function))


def truth_option(function: F) -> F:
    """--truth of every command that listens to the simulator of a running vehicle."""
    return click.option(
        "--truth",
        "truth_at",
        type=TruthType(),
        help="Where the simulator sends the true state: PORT or HOST:PORT (sitl --truth).  "
        f"[default: {SITL_TRUTH.port}]",
    )(function)


def pictures_option(function: F) -> F:
    """--pictures, --pictures-pdf and --pictures-svg of every command that writes a report: the argument
    `pictures` has the formats of all that are given."""

    def add_format(ctx: click.Context, param: click.Parameter, picture_format: str | None) -> None:
        ctx.params.setdefault("pictures", ())
        if picture_format is not None:
            ctx.params["pictures"] += (picture_format,)

    for picture_format, option, help_text in (
        ("svg", "--pictures-svg", "Draw all pictures as SVG too."),
        ("pdf", "--pictures-pdf", "Draw all pictures as PDF too, for papers."),
        (
            "png",
            "--pictures",
            "Draw track.png, position.png, error.png and the other pictures too (docs/report.md).",
        ),
    ):
        function = click.option(
            option,
            f"pictures_{picture_format}",
            flag_value=picture_format,
            expose_value=False,
            callback=add_format,
            help=help_text,
        )(function)
    return function


def page_options(function: F) -> F:
    """--port and --bind of every command that serves a page."""
    port = click.option(
        "--port",
        type=WholeNumber(1, 65535),
        help=f"TCP port of the live page.  [default: {PAGE_PORT}, or a free one]",
    )
    bind = click.option(
        "--bind",
        default=LOOPBACK,
        show_default=True,
        help="Address at which the page is served; other machines reach it unless it is a loopback one.",
    )
    return port(bind(function))


def vehicle_option(what: str = "What flies, in truth and by belief") -> Callable[[F], F]:
    """--vehicle of every command that reads a vehicle file; its help lists the shipped ones."""
    from autopilot.vehicle.shipped import VEHICLES

    return click.option(
        "--vehicle",
        default="bebop",
        show_default=True,
        shell_complete=names_or_files(VEHICLES.names),
        help=f"{what}: {VEHICLES.choice()}.",
    )


class LawType(click.ParamType):  # type: ignore[type-arg]
    """The name of a shipped control law, or a reference to a custom one."""

    name = "NAME|FILE:CLASS"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from autopilot.own.law import load_law
        from autopilot.own.source import OwnError
        from autopilot.vehicle.parameters import LAWS

        law = str(value)
        if law not in LAWS:
            try:
                load_law(law)
            except OwnError as error:
                raise _own_code_error(error, param) from None
        return law

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        from autopilot.vehicle.parameters import LAWS

        return names_or_files(lambda: LAWS)(ctx, param, incomplete)


def law_help() -> str:
    """The help text of --law."""
    from autopilot.vehicle.parameters import LAWS

    return f"Control law to fly with: {', '.join(LAWS)}, or your own (docs/laws.md)."


def law_option(function: F) -> F:
    """--law of every command that starts an autopilot, or compiles one."""
    from autopilot.vehicle.parameters import DEFAULT_LAW

    return click.option("--law", type=LawType(), default=DEFAULT_LAW, show_default=True, help=law_help())(
        function
    )


def _own_code_error(error: Exception, param: click.Parameter | None) -> InputError:
    """The error for an unusable custom class; no usage error, as the command's help does not explain it."""
    return InputError(f"{param.opts[0]} {error}" if param else str(error))


class OwnType(click.ParamType):  # type: ignore[type-arg]
    """A reference to a custom class."""

    name = "FILE:CLASS"

    def __init__(self, load: Callable[[str], object]) -> None:
        self._load = load

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from autopilot.own.source import OwnError

        try:
            self._load(str(value))
        except OwnError as error:
            raise _own_code_error(error, param) from None
        return str(value)


def _estimator(reference: str) -> object:
    from autopilot.own.estimator import load_estimator

    return load_estimator(reference)


def _planner(reference: str) -> object:
    from autopilot.own.planner import load_planner

    return load_planner(reference)


def own_options(function: F) -> F:
    """--estimator and --planner of every command that starts an autopilot."""
    estimator = click.option(
        "--estimator",
        type=OwnType(_estimator),
        help="Your own estimator, FILE.py:CLASS (docs/estimators.md).  [default: built in]",
    )
    return estimator(planner_option(function))


def planner_option(function: F) -> F:
    """--planner of every command that plans paths."""
    return click.option(
        "--planner",
        type=OwnType(_planner),
        help="Your own path planner, FILE.py:CLASS (docs/planners.md).  [default: built in]",
    )(function)


def sensors_option(function: F) -> F:
    """--sensors of every command that starts a simulator; its help lists the shipped profiles."""
    from sitl.sensors.shipped import PROFILES

    help_text = f"Sensors of the vehicle: {PROFILES.choice()}."
    return click.option(
        "--sensors",
        default="lab",
        show_default=True,
        shell_complete=names_or_files(PROFILES.names),
        help=help_text,
    )(function)


def require_options(function: F) -> F:
    """--require and --junit of every command whose result can gate a build."""
    require = click.option(
        "--require",
        "required",
        metavar='"KEY SIGN VALUE"',
        multiple=True,
        help='Condition on a figure of --json, e.g. "load_error_max_m < 0.01"; if it fails, the exit code is '
        "4. Repeatable.",
    )
    junit = click.option(
        "--junit",
        type=OUTPUT_FILE,
        help="Write the outcome and the required conditions as a JUnit test report.",
    )
    return require(junit(function))


def time_limit_option(function: F) -> F:
    """--timeout of commands that fly."""
    return click.option(
        "--timeout",
        "limit_s",
        type=PositiveType(),
        help="Give up after NUMBER seconds of the vehicle's clock.  [default: 1.5 x expected + 60]",
    )(function)


def fresh_option(function: F) -> F:
    """--fresh of commands that continue where they were stopped; also --overwrite, as in other commands."""
    text = "Fly everything again and discard the results in --out."
    return click.option("--fresh", "--overwrite", "fresh", is_flag=True, help=text)(function)


def json_option(function: F) -> F:
    """--json of every command with a result."""
    return click.option(
        "--json",
        "as_json",
        is_flag=True,
        is_eager=True,  # before a custom class is loaded, which may print
        callback=_reserve_stdout,
        help="Print only the result, as JSON.",
    )(function)


def _reserve_stdout(ctx: click.Context, _: click.Parameter, as_json: bool) -> bool:
    # a sweep also flies in this process: what a custom law prints in its flights does not belong on stdout
    if (as_json or ctx.info_name == "sweep") and not ctx.resilient_parsing:  # set during completion
        reserve_stdout_for_results()
    return as_json


def print_json(record: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print `record` on stdout; numbers that JSON cannot express become null."""
    with results_to_stdout():
        click.echo(json.dumps(_json_value(record), indent=2, allow_nan=False))


def _json_value(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _json_value(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def display_name(key: str) -> str:
    """A key of a record as displayed: `cable_tension_n` is `cable tension (N)`."""
    name, unit = split_unit(key)
    return name.replace("_", " ") + (f" ({unit.sign})" if unit else "")


def print_table(rows: Sequence[Sequence[str]], header: Sequence[str] = ()) -> None:
    """Print columns of text on stdout, each as wide as its widest cell."""
    lines = [list(header), *map(list, rows)] if header else [list(row) for row in rows]
    if not lines:
        return
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    text = "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )
    write_to_stdout(lambda: click.echo(text))
