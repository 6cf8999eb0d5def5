"""What the sockets towards vehicles have in common, by UDP and by TCP."""

from __future__ import annotations

import select
import socket


class OpenSocket:
    """A socket of the operating system, to wait for and to close."""

    _socket: socket.socket

    def fileno(self) -> int:
        return self._socket.fileno()

    @property
    def has_datagram(self) -> bool:
        """Whether something has arrived and was not read yet."""
        return bool(select.select([self], [], [], 0.0)[0])

    def close(self) -> None:
        self._socket.close()
