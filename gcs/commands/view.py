"""gcs view"""

from __future__ import annotations

from functools import partial

import click

from gcs.commands.options import AddressType, page_options, sysid_option, truth_option
from gcs.shell.link import API_PORT, SITL_TRUTH, Address


@click.command("view")
@click.option(
    "--connect",
    "addresses",
    type=AddressType(),
    multiple=True,
    default=(str(API_PORT),),
    help="Connection to vehicles, as in the other commands; repeatable.  "
    f"[default: {API_PORT}, which leaves 14550 to other ground stations]",
)
@partial(sysid_option, otherwise="all that are heard")
@page_options
@click.option("--no-open", is_flag=True, help="Do not open the page in a browser.")
@click.option(
    "--no-truth",
    is_flag=True,
    help="Do not listen to the simulator (estimator errors, true positions), because another program does.",
)
@truth_option
@click.option("--feed", type=int, hidden=True, help="The descriptor at which gcs fly tells what it hears.")
def view_command(
    addresses: tuple[Address, ...],
    port: int | None,
    bind: str,
    no_open: bool,
    no_truth: bool,
    truth_at: Address | None,
    feed: int | None,
) -> None:
    """Show running vehicles live in a browser.

    A page on this machine shows vehicle, cable and load in 3-D with their figures, and sends commands.
    Its address is printed; everyone who knows the address can use the page. Several vehicles are
    distinguished by their system ids.

    \b
    gcs view
    gcs view --connect 14550 --sysid 2
    gcs view --connect udpout:127.0.0.1:14555 --port 8095
    """
    from gcs.workflows.view import ViewOptions, serve_feed, view

    options = ViewOptions(
        connect=addresses,
        host=bind,
        port=port,
        opens_browser=not no_open,
        truth=None if no_truth else truth_at or SITL_TRUTH,
    )
    if feed is not None:
        serve_feed(feed, options)
    else:
        view(options)
