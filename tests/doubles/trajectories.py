"""Any trajectories, for tests with random missions."""

from __future__ import annotations

from itertools import accumulate

from hypothesis import strategies as st

from missions.model import ORIGIN, Trajectory


def trajectories(farthest_m: float) -> st.SearchStrategy[Trajectory]:
    """Trajectories of two to six points within this distance along each axis."""
    metres = st.floats(-farthest_m, farthest_m, allow_subnormal=False).map(lambda m: m + 0.0)  # no -0.0
    rows = st.lists(st.tuples(st.integers(100, 9000), metres, metres, metres), min_size=1, max_size=5)
    return rows.map(_through)


def _through(rows: list[tuple[int, float, float, float]]) -> Trajectory:
    """The trajectory of rows that begin with the milliseconds since the row before."""
    times_s = [ms / 1e3 for ms in accumulate(row[0] for row in rows)]
    return Trajectory([ORIGIN, *((t, *row[1:]) for t, row in zip(times_s, rows, strict=True))])
