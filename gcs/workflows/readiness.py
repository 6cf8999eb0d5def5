"""Waiting until a running vehicle reports that it may be armed."""

from __future__ import annotations

from gcs.clients import command
from gcs.errors import NoVehicleError, RefusedError
from gcs.shell.display import notify
from gcs.shell.session import Session

HEALTH_S = 2.0  # in which a vehicle reports its health
READY_S = 10.0  # an estimator settles in a few seconds of the vehicle's clock, which may run slowly


def wait_until_ready(session: Session) -> bool:
    """Wait for a while if the vehicle is not ready, and print for what; True if it may be armed, or does not
    report whether it may."""
    view = session.view
    session.watch(lambda: view.ready_to_arm is not None, HEALTH_S)
    if view.armed or view.ready_to_arm is not False:
        return True
    before = len(view.texts)
    try:
        session.run(command.run_prearm_checks(session.target))
        # the reasons arrive with the answer, or a moment later
        session.watch(lambda: bool(view.problems_since(before)), READY_S)
    except (RefusedError, NoVehicleError):
        pass  # its reasons will arrive with the refusal to arm
    reasons = "; ".join(view.problems_since(before))
    notify(f"waiting: {reasons}" if reasons else "waiting for the vehicle to be ready")
    return session.watch(lambda: view.ready_to_arm is True, READY_S, "waiting for the vehicle to be ready")
