"""gcs new: writes a template for a file of your own."""

from __future__ import annotations

import click

from gcs.workflows.new_file import kinds, new_file


@click.command("new")
@click.argument("kind", type=click.Choice(kinds()), metavar="KIND")
@click.argument("name")
def new_command(kind: str, name: str) -> None:
    """Write a commented template that flies as it is, for you to edit.

    KIND is one of those below; NAME is the name or path of the file, with or without its ending. Missing
    folders are created, and an existing file is never changed. The command that flies the file is printed.

    \b
    gcs new law steady
    gcs new estimator watchful
    gcs new planner straight
    gcs new mission survey
    gcs new vehicle mine
    gcs new sensors room
    """
    written = new_file(kind, name)
    click.echo(f"{written.path} is written; it flies as it is:\n\n    {written.fly}\n")
