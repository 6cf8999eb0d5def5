"""Only clients that know the address are served, and only sockets of our own pages are opened."""

from __future__ import annotations

import asyncio
import http.client
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from gcs.errors import GcsError
from gcs.shell.page_server import PageCallbacks, PageServer, Site


class Served:
    """A server in a separate event loop; `asked` are the records that it received."""

    def __init__(self, report: Path, bind: str = "127.0.0.1") -> None:
        self.asked: list[Any] = []
        self.site = Site({"": b"<p>page</p>", "live.js": b"1;"}, report)
        self.loop = asyncio.new_event_loop()
        pages = PageCallbacks(lambda: [{"type": "hello"}], lambda page, record: self.asked.append(record))
        self.server = PageServer(self.site, pages, bind, None)
        self.loop.run_until_complete(self.server.__aenter__())
        self.host, self.token = self.server.address.replace(bind, "127.0.0.1").split("/")[2:4]

    def close(self) -> None:
        """End the server."""
        self.loop.run_until_complete(self.server.__aexit__(None, None, None))
        self.loop.close()

    def get(self, path: str, host: str | None = None, **headers: str) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and body."""

        def fetch() -> tuple[int, dict[str, str], bytes]:
            connection = http.client.HTTPConnection(self.host, timeout=10)
            connection.request("GET", path, headers={"Host": host or self.host, **headers})
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()

        return self.loop.run_until_complete(asyncio.to_thread(fetch))

    def talk(self, path: str, origin: str | None, text: str = "{}", **headers: str) -> dict[str, Any]:
        """The first record that a web socket receives; it then sends `text`."""

        def speak() -> dict[str, Any]:
            address = f"ws://{self.host}{path}"
            with connect(address, origin=origin, additional_headers=headers, open_timeout=10) as socket:  # type: ignore[arg-type]
                first: dict[str, Any] = json.loads(socket.recv(10))
                socket.send(text)
            return first

        return self.loop.run_until_complete(asyncio.to_thread(speak))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "report.html").write_text("report")
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "out" / "link").symlink_to(tmp_path / "secret")
    found = Served(tmp_path / "out")
    yield found
    found.close()


def test_the_page_comes_with_a_policy_that_keeps_strangers_out(served: Served) -> None:
    status, headers, body = served.get(f"/{served.token}/")
    assert (status, body) == (200, b"<p>page</p>")
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert headers["Content-Type"].startswith("text/html")
    assert headers["Referrer-Policy"] == "no-referrer"
    assert served.get(f"/{served.token}/live.js")[1]["Content-Type"].startswith("text/javascript")


@pytest.mark.parametrize(
    "path", ["/", "/live.js", "/{wrong}/", "/{wrong}/live.js", "/{wrong}/report/report.html"]
)
def test_without_the_token_nothing_is_served(served: Served, path: str) -> None:
    wrong = served.token[:-1] + ("a" if served.token[-1] != "a" else "b")
    assert served.get(path.format(wrong=wrong))[0] == 403


def test_another_host_name_that_leads_here_is_refused(served: Served) -> None:
    port = served.host.rpartition(":")[2]
    for host in (f"evil.example:{port}", "127.0.0.1", "127.0.0.1:1", f"127.0.0.1.evil.example:{port}"):
        assert served.get(f"/{served.token}/", host)[0] == 421, host
    assert served.get(f"/{served.token}/", f"localhost:{port}")[0] == 200


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../secret", "..%2fsecret", "/etc/passwd", "link", "no-such", "a/b", "%00", ".hidden"],
)
def test_of_the_disk_only_the_files_of_the_report_are_served(served: Served, name: str) -> None:
    assert served.get(f"/{served.token}/report/{name}")[0] == 404


def test_bound_to_all_addresses_it_goes_by_numbers_and_by_no_strangers_name(tmp_path: Path) -> None:
    served = Served(tmp_path, "0.0.0.0")
    port = served.host.rpartition(":")[2]
    try:
        assert served.get(f"/{served.token}/", f"192.168.1.7:{port}")[0] == 200
        assert served.get(f"/{served.token}/", f"[fe80::1]:{port}")[0] == 200
        assert served.get(f"/{served.token}/", f"evil.example:{port}")[0] == 421
    finally:
        served.close()


def test_a_report_may_run_its_own_scripts_and_ask_for_nothing(served: Served) -> None:
    status, headers, body = served.get(f"/{served.token}/report/report.html")
    assert (status, body) == (200, b"report")
    assert "connect-src" not in headers["Content-Security-Policy"]
    assert "default-src 'none'" in headers["Content-Security-Policy"]


def test_the_socket_opens_for_our_own_page_alone(served: Served) -> None:
    socket = f"/{served.token}/socket"
    own = f"http://{served.host}"
    assert served.talk(socket, own, '{"action": "arm"}') == {"type": "hello"}
    for origin in (None, "null", "http://evil.example", "https://" + served.host, own + ".evil.example"):
        with pytest.raises(InvalidStatus) as refusal:
            served.talk(socket, origin)
        assert refusal.value.response.status_code == 403
    with pytest.raises(InvalidStatus) as refusal:
        served.talk("/wrong/socket", own)
    assert refusal.value.response.status_code == 403


def test_what_is_no_json_or_too_long_is_not_heard_and_ends_nothing(served: Served) -> None:
    socket, own = f"/{served.token}/socket", f"http://{served.host}"
    for text in ("", "{", "[" * 3000, "x" * 100_000):
        served.talk(socket, own, text)
    served.talk(socket, own, '{"action": "hold"}')
    served.talk(socket, own)
    assert {"action": "hold"} in served.asked


def test_a_port_that_is_taken_is_one_line_where_it_was_asked_for_and_passed_over_else(served: Served) -> None:
    port = int(served.host.rpartition(":")[2])
    pages = PageCallbacks(list, lambda page, record: None)

    async def second(asked: int | None) -> str:
        async with PageServer(served.site, pages, "127.0.0.1", asked) as other:
            return other.address

    with pytest.raises(GcsError, match=f"port {port} of 127.0.0.1 is in use .* --port"):
        served.loop.run_until_complete(second(port))
    assert served.loop.run_until_complete(second(None)) != served.server.address
