"""Ports for tests that use one again and again."""

from __future__ import annotations

import socket

from gcs.shell.link import LOOPBACK, free_port

_held: list[socket.socket] = []


def ground_port() -> int:
    """A port for the datagrams of a ground station that no other test chooses before this process ends.

    Between the commands of a test no socket is bound to it. Its TCP port is held meanwhile, so that
    `free_port` of other processes passes it over.
    """
    while True:
        port = free_port()
        try:
            _held.append(socket.create_server((LOOPBACK, port)))
        except OSError:  # another process has chosen it too
            continue
        return port
