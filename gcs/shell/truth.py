"""Where simulators that run by themselves tell what is true."""

from __future__ import annotations

from types import TracebackType

from gcs.clients.truth import Truth
from gcs.errors import GcsError
from gcs.shell.link import SITL_TRUTH, Address, UdpSocket


class TruthLink:
    """The truth of the world that one vehicle flies in; without any where the port is another program's."""

    def __init__(self, address: Address | None) -> None:
        """`address`: where it is told; None: where `sitl` tells it by default.

        GcsError if a port that was named is in use.
        """
        named = address or SITL_TRUTH
        self._where = str(named)
        self._truth = Truth(self._where, vouched=address is not None)
        self._socket: UdpSocket | None = None
        try:
            self._socket = UdpSocket(named.host, named.port)
        except GcsError:
            if address is not None:
                trouble = "is in use by another program, or not of this machine"
                raise GcsError(f"--truth: UDP {named} {trouble}") from None

    def of_vehicle(self, run: int | None, silent: str = "") -> None:
        """The run of the world that the vehicle says it flies in; None: it does not say, or has not answered
        and `silent` says why."""
        self._truth.of_vehicle(run, silent)

    def drain(self) -> list[bytes]:
        """All datagrams of the vehicle's own world that are there."""
        return [] if self._socket is None else self._truth.take(self._socket.drain_with_senders())

    @property
    def missing(self) -> str:
        """Why there is no truth so far, and what to do; empty where there is."""
        if self._socket is None:
            return f"UDP {self._where} is in use by another program; --truth PORT names another port"
        return self._truth.missing

    @property
    def heard(self) -> bool:
        """Whether the truth of the vehicle's own world has come."""
        return self._truth.heard

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def __enter__(self) -> TruthLink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
