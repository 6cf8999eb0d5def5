"""gcs new: a file of your own to begin with."""

from __future__ import annotations

import click

from gcs.workflows.new_file import kinds, new_file


@click.command("new")
@click.argument("kind", type=click.Choice(kinds()), metavar="KIND")
@click.argument("name")
def new_command(kind: str, name: str) -> None:
    """Write a commented file of your own that flies as it is.

    KIND is one of those below, NAME is that of the file, without or with its ending; it may lead into another
    folder, which is made. A file that exists is left as it is. The command that flies it is printed.

    \b
    gcs new law steady
    gcs new estimator watchful
    gcs new planner straight
    gcs new mission survey
    gcs new vehicle mine
    gcs new sensors room
    """
    made = new_file(kind, name)
    click.echo(f"{made.path} is written; it flies as it is:\n\n    {made.fly}\n")
