"""Datagrams received and sent by machine code, for loops that exchange many of them without Python.

A socket is given by its file descriptor, bytes by their address, a network address in the form of the system
(`system_address`). A receive waits as long as the socket's SO_RCVTIMEO; a signal ends it, so that Python can
handle the signal. The functions `..._at` work in kernels only, and only with sockets that are `usable`.
"""

from __future__ import annotations

import socket
import struct
import sys
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

SUPPORTED = sys.platform == "linux"  # as far as tested
SYSTEM_ADDRESS_BYTES = 16  # bytes of an IPv4 address with its port
NOWHERE = bytes(SYSTEM_ADDRESS_BYTES)

_INT, _WIDE = ir.IntType(32), ir.IntType(64)
_POINTER = cgutils.voidptr_t


def usable(sock: socket.socket) -> bool:
    """Whether machine code can exchange datagrams by this socket: IPv4, on Linux."""
    return SUPPORTED and sock.family == socket.AF_INET


def system_address(address: tuple[str, int]) -> bytes | None:
    """`struct sockaddr_in` of a numeric address; None for any other."""
    try:
        host = socket.inet_pton(socket.AF_INET, address[0])
    except OSError:
        return None
    return struct.pack("=H", socket.AF_INET) + struct.pack("!H", address[1]) + host + bytes(8)


def address_of_system(address: bytes) -> tuple[str, int]:
    """The address of a `struct sockaddr_in`, the inverse of `system_address`."""
    return socket.inet_ntop(socket.AF_INET, address[4:8]), struct.unpack("!H", address[2:4])[0]


def _library_call(name: str, kinds: list[Any]) -> Any:
    """A function of the system's library; its arguments are a file descriptor, an address, a size, the flags
    0, and those of `kinds`."""

    def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_WIDE, [_INT, _POINTER, _WIDE, _INT, *kinds])
        function = cgutils.get_or_insert_function(builder.module, kind, name)
        extra_arguments = [
            builder.inttoptr(value, _POINTER) if kind is _POINTER else builder.trunc(value, _INT)
            for kind, value in zip(kinds, arguments[3:], strict=True)
        ]
        leading_arguments = (
            builder.trunc(arguments[0], _INT),
            builder.inttoptr(arguments[1], _POINTER),
            arguments[2],
        )
        return builder.call(function, [*leading_arguments, ir.Constant(_INT, 0), *extra_arguments])

    return lower


def _receive(_: Any, fd: Any, address: Any, size: Any) -> Any:
    return types.int64(types.int64, types.int64, types.int64), _library_call("recv", [])


def _send(_: Any, fd: Any, address: Any, size: Any) -> Any:
    return types.int64(types.int64, types.int64, types.int64), _library_call("send", [])


def _receive_from(_: Any, fd: Any, address: Any, size: Any, sender: Any, sender_size: Any) -> Any:
    return types.int64(*[types.int64] * 5), _library_call("recvfrom", [_POINTER, _POINTER])


def _send_to(_: Any, fd: Any, address: Any, size: Any, receiver: Any, receiver_size: Any) -> Any:
    return types.int64(*[types.int64] * 5), _library_call("sendto", [_POINTER, _INT])


# number of bytes received or sent; less than 0: none
receive_at: Any = intrinsic(_receive)  # fd, address, size
send_at: Any = intrinsic(_send)  # fd, address, size
receive_from_at: Any = intrinsic(_receive_from)  # ..., address for the sender, address of its size
send_to_at: Any = intrinsic(_send_to)  # ..., the receiver, its size
