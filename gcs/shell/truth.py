"""The socket on which simulators that were started separately send the truth."""

from __future__ import annotations

from types import TracebackType

from gcs.clients.truth import Truth
from gcs.errors import GcsError
from gcs.shell.link import SITL_TRUTH, Address, UdpSocket


class TruthLink:
    """The truth of the world in which one vehicle flies; there is none if another program uses the port."""

    def __init__(self, address: Address | None) -> None:
        """`address`: where the truth is sent; None: where `sitl` sends it by default.

        GcsError if the given port is in use.
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
        """Set the run of the world in which the vehicle reports to fly; None: it does not report one, or has
        not answered, and `silent` states why."""
        self._truth.of_vehicle(run, silent)

    def drain(self) -> list[bytes]:
        """All datagrams of the vehicle's own world that have arrived."""
        return [] if self._socket is None else self._truth.take(self._socket.drain_with_senders())

    @property
    def missing(self) -> str:
        """Why there is no truth so far, and what to do; empty if there is truth."""
        if self._socket is None:
            return f"UDP {self._where} is in use by another program; --truth PORT names another port"
        return self._truth.missing

    @property
    def heard(self) -> bool:
        """Whether the truth of the vehicle's own world has arrived."""
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
