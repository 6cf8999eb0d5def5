"""The command line: the list of commands, and the handling of their errors.

A command's module is loaded only when the command is called, so that `gcs --help` needs nothing but click.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any

import click

from gcs.errors import EXIT_DONE, EXIT_ERROR, EXIT_INTERRUPTED, EXIT_USAGE, GcsError, disk_problem
from gcs.shell.display import notify, restore_stdout
from missions.nearest import nearest

_COMPLETE_VARIABLE = "_GCS_COMPLETE"  # set by a shell that completes a word, or reads how to do it

# name: (module in gcs.commands, summary)
COMMANDS = {
    "fly": ("fly", "Fly a mission from start to report."),
    "new": ("new", "Write a commented template that flies as it is, for you to edit."),
    "missions": ("missions", "List the shipped missions."),
    "check": ("missions", "Check whether a vehicle can fly a mission."),
    "report": ("report", "Write the report of a captured flight again."),
    "compare": ("compare", "Compare flights: figures, settings, tracks and errors."),
    "identify": ("recorded", "Find cable, load and drag from a recorded flight."),
    "replay": ("recorded", "Estimate the load of a recorded flight, and score it."),
    "experiments": (
        "experiments",
        "Repeat published experiments beside their printed results.",
    ),
    "sweep": ("sweep", "Fly a mission thousands of times under varied conditions."),
    "view": ("view", "Show running vehicles live in a browser."),
    "warmup": ("warmup", "Compile the flight software before the first flight."),
    "status": ("status", "Show the vehicle's status."),
    "texts": ("status", "List the messages (STATUSTEXT) of the vehicle."),
    "capture": ("capture", "Capture telemetry until Ctrl-C."),
    "upload": ("transfer", "Upload a mission to the vehicle."),
    "download": ("transfer", "Download the mission from the vehicle."),
    "clear": ("transfer", "Delete the mission on the vehicle."),
    "arm": ("control", "Start the rotors."),
    "disarm": ("control", "Stop the rotors."),
    "start": ("control", "Fly the mission on the vehicle from its first item."),
    "pause": ("control", "Hold the load where it is."),
    "resume": ("control", "Continue a paused mission."),
    "takeoff": ("control", "Lift the load and hold it."),
    "goto": ("control", "Move the load to a position and hold it there."),
    "land": ("control", "Set the load down, and the vehicle beside it."),
    "winch": ("control", "Make the cable longer or shorter."),
    "release": ("control", "Let the load go."),
    "grab": ("control", "Take the load again."),
    "mode": ("control", "Change the flight mode."),
    "param": ("param", "Read and write parameters."),
}


class Gcs(click.Group):
    """Loads commands when they are called; reports a known error in one line on stderr and by exit code."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"gcs.commands.{COMMANDS[cmd_name][0]}")
        command: click.Command = getattr(module, f"{cmd_name}_command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        word = args[0]
        similar = "" if word in COMMANDS else nearest(word, COMMANDS)
        if similar:
            ctx.fail(f"No such command {word!r}; did you mean {similar}?")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, summary) for name, (_, summary) in COMMANDS.items()])

    def main(self, args: Sequence[str] | None = None, *_: Any, **extra: Any) -> Any:
        extra.pop("standalone_mode", None)
        if None in (sys.stdin, sys.stdout, sys.stderr):
            from autopilot.shell.options import open_closed_streams

            open_closed_streams()
        # a terminal in Latin-1 has no Greek letters, nor has one in the locale C, which escapes surrogates
        if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors in ("strict", "surrogateescape"):
            sys.stdout.reconfigure(errors="replace")
        if sys.stdout.isatty() or sys.stderr.isatty():
            from autopilot.shell.options import tolerate_closed_terminal

            tolerate_closed_terminal()
        if _COMPLETE_VARIABLE in os.environ:
            from gcs.commands.parameter_completion import register_bash

            register_bash()
        try:
            code = super().main(args, standalone_mode=False, **extra)
        except GcsError as error:
            for line in error.lines:
                notify(line)
            code = error.exit_code
        except click.UsageError as error:
            if isinstance(error, click.exceptions.NoArgsIsHelpError):
                click.echo(error.format_message(), err=True)
            else:
                notify(_usage(error))
            code = EXIT_USAGE
        except click.ClickException as error:
            notify(error.format_message())
            code = error.exit_code
        except (click.Abort, KeyboardInterrupt):
            notify("stopped")
            code = EXIT_INTERRUPTED
        except BrokenPipeError:  # `gcs ... | head`
            sys.stderr.close()
            code = EXIT_DONE
        except OSError as error:
            if not disk_problem(error):
                raise
            notify(f"{disk_problem(error)}; nothing more can be written")
            code = EXIT_ERROR
        finally:
            restore_stdout()
        if code == EXIT_INTERRUPTED:
            from gcs.shell.stopping import stop_exit_code

            code = stop_exit_code()
        sys.exit(code if isinstance(code, int) else EXIT_DONE)


def _usage(error: click.UsageError) -> str:
    from autopilot.shell.options import usage_text

    return usage_text(error)


def _signing_key(text: str) -> bytes:
    from autopilot.shell.options import signing_key_option

    return signing_key_option(text)


@click.group(cls=Gcs, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.option(
    "--signing-key",
    metavar="FILE",
    type=_signing_key,
    is_eager=True,
    envvar="PLUMBLINE_SIGNING_KEY",
    help="Sign all messages to a running vehicle; FILE holds 64 hexadecimal digits or a pass phrase.",
)
@click.version_option(package_name="plumbline", prog_name="gcs")
def gcs(signing_key: bytes | None) -> None:
    """Plumbline's ground station: fly missions that command the load on the cable.

    gcs fly case-b starts a simulator and an autopilot, flies a shipped mission and writes a report.
    gcs upload, arm, start, status, param and similar commands are for a vehicle that is already running (sitl
    and autopilot, or gcs fly --speed 1).

    Results are on stdout, everything else on stderr. Exit codes: 0 done, 1 a known error, 2 wrong input,
    3 flown, but the mission was not completed, 4 flown, but a --require condition failed; stopped: 130 by
    Ctrl-C, 143 by SIGTERM, 129 by SIGHUP (the terminal was closed); gcs view ends so with 0.
    """
