"""gcs view"""

from __future__ import annotations

import click

from gcs.commands.options import AddressType, page_options
from gcs.shell.link import API_PORT, Address


@click.command("view")
@click.option(
    "--connect",
    "addresses",
    type=AddressType(),
    multiple=True,
    help="Where vehicles are met, as in the other commands; may be given again.  "
    f"[default: {API_PORT}, which leaves 14550 to other ground stations]",
)
@page_options
@click.option(
    "--open/--no-open", "opens", default=True, help="Open the page in a browser, where there is a screen."
)
@click.option(
    "--truth/--no-truth",
    default=True,
    help="Listen to the simulator too: errors of the estimator, true places. Another program may want to.",
)
@click.option("--feed", type=int, hidden=True)
def view_command(
    addresses: tuple[Address, ...], port: int | None, bind: str, opens: bool, truth: bool, feed: int | None
) -> None:
    """Show running vehicles live in a browser.

    A page on this machine shows vehicle, cable and load in 3-D with what is known of them, and commands
    them. Its address is printed; whoever knows it may use the page. Several vehicles are told apart by their
    system ids.

    \b
    gcs view
    gcs view --connect 14550
    gcs view --connect udpout:127.0.0.1:14555 --port 8095
    """
    from gcs.workflows.view import ViewOptions, serve_feed, view

    options = ViewOptions(
        connect=addresses or (Address("127.0.0.1", API_PORT),), host=bind, port=port, opens=opens, truth=truth
    )
    if feed is not None:
        serve_feed(feed, options)
    else:
        view(options)
