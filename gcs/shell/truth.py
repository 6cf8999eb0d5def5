"""The socket on which simulators that were started separately send the truth."""

from __future__ import annotations

from types import TracebackType

from gcs.clients.truth import TruthFilter
from gcs.errors import GcsError
from gcs.shell.link import SITL_TRUTH, Address, UdpSocket


class TruthLink:
    """The truth of the world in which one vehicle flies; there is none if another program uses the port."""

    def __init__(self, address: Address | None) -> None:
        """`address`: where the truth is sent; None: where `sitl` sends it by default.

        GcsError if the given port is in use.
        """
        used_address = address or SITL_TRUTH
        self._address = str(used_address)
        self._truth = TruthFilter(self._address, port_is_given=address is not None)
        self._socket: UdpSocket | None = None
        try:
            self._socket = UdpSocket(used_address.host, used_address.port)
        except GcsError:
            if address is not None:
                problem = "is in use by another program, or not of this machine"
                raise GcsError(f"--truth: UDP {used_address} {problem}") from None

    def set_vehicle_run(self, run: int | None, silence_reason: str = "") -> None:
        """Set the run of the world in which the vehicle reports to fly; None: it does not report one, or has
        not answered, and `silence_reason` states why."""
        self._truth.set_vehicle_run(run, silence_reason)

    def drain(self) -> list[bytes]:
        """All datagrams of the vehicle's own world that have arrived."""
        return [] if self._socket is None else self._truth.select(self._socket.drain_with_senders())

    @property
    def missing(self) -> str:
        """Why there is no truth so far, and what to do; empty if there is truth."""
        if self._socket is None:
            return f"UDP {self._address} is in use by another program; --truth PORT names another port"
        return self._truth.missing

    @property
    def received(self) -> bool:
        """Whether the truth of the vehicle's own world has arrived."""
        return self._truth.received

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def __enter__(self) -> TruthLink:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
