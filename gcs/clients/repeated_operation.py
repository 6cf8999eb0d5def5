"""An exchange that is repeated while the vehicle refuses it, up to a time limit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gcs.clients.operation import Operation, Result, Status


class RepeatedOperation:
    """Runs the operation that `make` returns and, `pause_us` after a refusal, a new one, until `limit_us`."""

    def __init__(self, make: Callable[[], Operation], pause_us: int, limit_us: int) -> None:
        self.result: Result | None = None
        self._make = make
        self._pause_us = pause_us
        self._limit_us = limit_us
        self._start_us: int | None = None
        self._retry_us = 0
        self._operation = make()

    @property
    def progress(self) -> tuple[int, int]:
        return self._operation.progress

    def receive(self, message: Any, now_us: int) -> None:
        self._operation.receive(message, now_us)

    def poll(self, now_us: int) -> list[Any]:
        if self._start_us is None:
            self._start_us = now_us
        result = self._operation.result
        if self.result is not None or result is None:
            return self._operation.poll(now_us)
        refused = result.status is Status.REFUSED
        if not refused or now_us - self._start_us >= self._limit_us:
            self.result = result
            return []
        if self._retry_us == 0:
            self._retry_us = now_us + self._pause_us
        if now_us < self._retry_us:
            return []
        self._retry_us = 0
        self._operation = self._make()
        return self._operation.poll(now_us)
