"""A headless Chromium, driven over WebDriver and listened to over the DevTools protocol.

It finds no host but the loopback, so that requests of a page for anything else fail, and `requests` shows
them.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

WAIT_S = 30.0
_CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
_SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--no-first-run",
    "--disable-quic",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--enable-unsafe-swiftshader",  # WebGL without a graphics card
    "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


def missing() -> str:
    """Why there is no browser here; empty if there is one."""
    if not any(map(shutil.which, _CHROMIUM)):
        return "no chromium is installed (Debian: apt-get install chromium chromium-driver)"
    if not shutil.which("chromedriver"):
        return "no chromedriver is installed (Debian: apt-get install chromium-driver)"
    return ""


class Browser:
    """One page at a time."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver
        self.requests: list[str] = []  # addresses requested since `open`, web sockets included
        self.errors: list[str] = []  # of the console since `open`, exceptions included

    def open(self, url: str, width: int = 1280, height: int = 800, theme: str = "dark") -> None:
        """Load the page into a window of that size, for a reader who prefers that theme."""
        self.leave()
        self.listen()
        self.requests.clear()
        self.errors.clear()
        self.resize(width, height)
        self.prefer(theme)
        self.driver.get(url)
        # `get` may return while the page is still loading
        self.wait("document.readyState === 'complete' && document.URL !== 'about:blank'")

    def leave(self) -> None:
        """Leave the page, so that nothing is drawn."""
        self.driver.get("about:blank")

    def resize(self, width: int, height: int) -> None:
        """Set the size of the page in CSS pixels."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def prefer(self, theme: str) -> None:
        """Set the theme that the reader prefers, "dark" or "light"."""
        features = [{"name": "prefers-color-scheme", "value": theme}]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def run(self, script: str, *arguments: Any) -> Any:
        """The value that a function body of JavaScript returns; its arguments are `arguments[0]`, ..."""
        return self.driver.execute_script(script, *arguments)

    def wait(self, expression: str, seconds: float = WAIT_S) -> Any:
        """The value of a JavaScript expression once it is true; otherwise AssertionError with the console."""
        from selenium.common.exceptions import TimeoutException
        from selenium.webdriver.support.ui import WebDriverWait

        try:
            return WebDriverWait(self.driver, seconds, 0.05).until(lambda _: self.run(f"return {expression}"))
        except TimeoutException:
            self.listen()
            raise AssertionError(f"never true: {expression}; console: {self.errors}") from None

    def find(self, selector: str) -> Any:
        """The element of that CSS selector: `.click()`, `.text`, `.send_keys(...)`."""
        return self.driver.find_element("css selector", selector)

    def click_at(self, selector: str, x: float, y: float, clicks: int = 1) -> None:
        """Press and release the mouse at that pixel of the element, `clicks` times."""
        box = self.run(
            "const b = arguments[0].getBoundingClientRect(); return [b.x, b.y]", self.find(selector)
        )
        for count in range(1, clicks + 1):
            for kind in ("mousePressed", "mouseReleased"):
                place = {"x": box[0] + x, "y": box[1] + y, "button": "left", "clickCount": count}
                self.driver.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, **place})

    def screenshot(self, path: Path) -> None:
        """Write a screenshot as PNG."""
        self.driver.save_screenshot(str(path))

    def listen(self) -> None:
        """Bring `requests` and `errors` up to date."""
        for entry in self.driver.get_log("performance"):
            event = json.loads(entry["message"])["message"]
            self._hear(event["method"], event["params"])

    def _hear(self, method: str, params: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(params["url"])
        elif method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.errors.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
            self.errors.append(" ".join(str(one.get("value", one)) for one in params["args"]))
        elif method == "Log.entryAdded" and params["entry"]["level"] == "error":
            self.errors.append(f"{params['entry']['text']} {params['entry'].get('url', '')}".strip())


@contextmanager
def chromium(profile: Path) -> Iterator[Browser]:
    """A browser that has never been used, with its files in `profile`."""
    from selenium.webdriver import Chrome, ChromeOptions
    from selenium.webdriver.chrome.service import Service

    options = ChromeOptions()
    options.binary_location = next(path for path in map(shutil.which, _CHROMIUM) if path)
    for switch in (*_SWITCHES, f"--user-data-dir={profile}"):
        options.add_argument(switch)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL"})
    environment = {**os.environ, "HOME": str(profile)}
    with Chrome(options, Service(shutil.which("chromedriver"), env=environment)) as driver:
        for domain in ("Runtime", "Log"):
            driver.execute_cdp_cmd(f"{domain}.enable", {})
        yield Browser(driver)
