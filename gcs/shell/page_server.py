"""Serves one page and its web socket to browsers on this machine, or on others if so configured.

The address is the permission to use the page: it begins with a token that cannot be guessed. A request must
name this server as its host (otherwise a foreign page could let its own host name point here), and a web
socket must be opened by our own page. Only what `Site` lists is read from disk.
"""

from __future__ import annotations

import asyncio
import errno
import hmac
import http
import ipaddress
import json
import os
import secrets
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from gcs.errors import GcsError
from gcs.shell.link import PAGE_PORT

_ADDRESS_HINT = ": open the whole address that gcs has printed, which holds a key"
SOCKET = "socket"  # path of the web socket beside the page
REPORT = "report"  # path of the folder with the report
_MAX_REQUEST_BYTES = 4096  # of one request of a page
_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".png": "image/png",
    ".svg": "image/svg+xml",
}
_PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self' {socket}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# a report contains its scripts and pictures, and may load nothing else
_REPORT_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


@dataclass
class Site:
    """What is served: texts by name ("" is the page), and the report's folder once there is one."""

    texts: dict[str, bytes]
    report: Path | None = None


@dataclass
class PageCallbacks:
    """Callbacks for open pages: `on_open` returns the records that a page receives when it opens."""

    on_open: Callable[[], Sequence[dict[str, Any]]]
    on_request: Callable[[Any, Any], None]  # a page, and the record that it sent
    on_count_changed: Callable[[int], None] = field(default=lambda count: None)


class PageServer:
    """The server; `async with` opens and closes it."""

    def __init__(self, site: Site, pages: PageCallbacks, host: str, port: int | None) -> None:
        self.site = site
        self._pages = pages
        self._host = host
        self._port = port
        self._token = secrets.token_urlsafe(18)
        self._open: set[ServerConnection] = set()
        self._server: Server | None = None

    @property
    def address(self) -> str:
        """The address of the page, including the token."""
        shown = f"[{self._host}]" if ":" in self._host else self._host
        return f"http://{shown}:{self._port}/{self._token}/"

    @property
    def readers(self) -> int:
        """How many pages are open."""
        return len(self._open)

    def send_to_all(self, record: dict[str, Any]) -> None:
        """Send a record to all pages that are open."""
        if self._open:
            broadcast(self._open, json.dumps(record, allow_nan=False, separators=(",", ":")))

    def send_to(self, page: Any, record: dict[str, Any]) -> None:
        """Send a record to one page, if it is still open."""
        if page in self._open:
            broadcast([page], json.dumps(record, allow_nan=False, separators=(",", ":")))

    async def __aenter__(self) -> PageServer:
        try:
            self._server = await self._serve(PAGE_PORT if self._port is None else self._port)
        except OSError as error:
            if self._port is not None or error.errno != errno.EADDRINUSE:
                raise GcsError(_bind_problem(self._host, self._port or PAGE_PORT, error)) from None
            self._server = await self._serve(0)  # any free port
        self._port = next(iter(self._server.sockets)).getsockname()[1]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._server is not None:
            self._server.close()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._server.wait_closed(), 1.0)

    async def _serve(self, port: int) -> Server:
        return await serve(
            self._serve_socket,
            self._host,
            port,
            process_request=self._handle_request,
            compression=None,
            max_size=_MAX_REQUEST_BYTES,
            server_header=None,
            ping_interval=None,
        )

    # ---- web socket

    async def _serve_socket(self, page: ServerConnection) -> None:
        for record in self._pages.on_open():
            await page.send(json.dumps(record, allow_nan=False, separators=(",", ":")))
        self._open.add(page)
        self._pages.on_count_changed(len(self._open))
        try:
            async for text in page:
                with suppress(ValueError, RecursionError):
                    self._pages.on_request(page, json.loads(text))
        except ConnectionClosed:
            pass
        finally:
            self._open.discard(page)
            self._pages.on_count_changed(len(self._open))

    # ---- requests

    def _handle_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """The answer to a request; None permits the web socket to open."""
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or not self._is_own_host(hosts[0]):
            return _error_response(http.HTTPStatus.MISDIRECTED_REQUEST)
        path = request.path.split("?", 1)[0]
        _, token, name = [*path.split("/", 2), "-", "-"][:3]
        if not hmac.compare_digest(token.encode("utf-8", "replace"), self._token.encode()):
            return _error_response(http.HTTPStatus.FORBIDDEN)
        if name == SOCKET:
            if request.headers.get_all("Origin") != [f"http://{hosts[0]}"]:
                return _error_response(http.HTTPStatus.FORBIDDEN)
            return None
        if name in self.site.texts:
            socket = f"ws://{hosts[0]}"
            return _ok_response(
                self.site.texts[name], Path(name or "page.html").suffix, _PAGE_POLICY.format(socket=socket)
            )
        return self._report_file(name)

    def _report_file(self, name: str) -> Response:
        folder, _, file = name.partition("/")
        path = None if self.site.report is None else self.site.report / file
        inside = file and "/" not in file and "\\" not in file and not file.startswith(".")
        if folder != REPORT or path is None or not inside or path.is_symlink() or not path.is_file():
            return _error_response(http.HTTPStatus.NOT_FOUND)
        try:
            return _ok_response(path.read_bytes(), path.suffix, _REPORT_POLICY)
        except OSError:
            return _error_response(http.HTTPStatus.NOT_FOUND)

    def _is_own_host(self, host: str) -> bool:
        """Whether a Host header names this server: the loopback interface, or the address that is served."""
        name, _, port = host.rpartition(":")
        if port != str(self._port):
            return False
        if name in ("127.0.0.1", "localhost", "[::1]", self._host):
            return True
        if self._host not in ("0.0.0.0", "::"):
            return False
        with suppress(ValueError):  # bound to all addresses: only numeric ones, which no foreign name can be
            ipaddress.ip_address(name.strip("[]"))
            return True
        return False


def _headers(policy: str) -> Headers:
    return Headers(
        {
            "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cache-Control": "no-store",
            "Connection": "close",
        }
    )


def _ok_response(body: bytes, suffix: str, policy: str) -> Response:
    headers = _headers(policy)
    headers["Content-Type"] = _TYPES.get(suffix, "application/octet-stream")
    headers["Content-Length"] = str(len(body))
    return Response(200, "OK", headers, body)


def _error_response(status: http.HTTPStatus) -> Response:
    hint = "" if status is not http.HTTPStatus.FORBIDDEN else _ADDRESS_HINT
    body = f"{status.phrase}{hint}\n".encode()
    headers = _headers("default-src 'none'")
    headers["Content-Type"] = "text/plain; charset=utf-8"
    headers["Content-Length"] = str(len(body))
    return Response(status.value, status.phrase, headers, body)


def _bind_problem(host: str, port: int, error: OSError) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is in use by another program; choose another with --port"
    reason = os.strerror(error.errno) if error.errno and error.errno > 0 else str(error)
    return f"no page can be served on {host}:{port}: {reason}; choose others with --bind and --port"
