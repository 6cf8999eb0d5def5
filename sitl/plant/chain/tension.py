"""The tensions of all links at the end of an implicit step: a tridiagonal system, solved in O(n).

| symbol | code | unit | |
|---|---|---|---|
| q_i | vector(link, i) | | unit vector of link i, from point i - 1 to point i |
| e_i | stretch | m | length of link i beyond its rest length |
| u_i | rate | m/s | rate of its length, q_i . (v_i - v_{i-1}) |
| k, c | stiffness, damping | N/m, N s/m | of one link: EA / l and D / l |
| w_i | lightness | 1/kg | acceleration of point i along a link per newton along it |
| tau | tau | s | length of the implicit step |

A link pulls with T_i = max(0, k e_i + c (u_i - l')), l' the rate of its rest length. Its rate after the step
is u_i = u_i^0 - tau sum_j A_ij T_j, where u_i^0 is the rate without tensions and

    A_ii = w_{i-1} + w_i        A_{i,i+1} = A_{i+1,i} = -w_i q_i . q_{i+1}

and, to first order in the remaining change of the iterate, e_i = e_i(x^k) + tau (u_i - u_i^k). With
g = tau (k tau + c) the links that pull obey

    (A + I / g) T = (k (e^k + tau (u^0 - u^k)) + c (u^0 - l')) / g

A is positive semidefinite, so this has a solution for every stiffness; for k to infinity it is that of links
of fixed length. Which links pull is found by trial: a link that would push is removed, and a removed link
that would pull is added again.
"""

from __future__ import annotations

from autopilot.geometry.kernel import kernel
from sitl.plant.chain.records import DIAGONAL, OFF_DIAGONAL, PIVOT, PULLS, REDUCED_RHS, RHS, TENSION, Floats

_MAX_TRIALS = 20  # of sets of links that pull


@kernel
def _solve(link: Floats) -> None:
    """Write the tensions if only the marked links pull; the others have none. Thomas' algorithm."""
    n = link.shape[0]
    for i in range(n):
        pivot, right = 1.0, 0.0
        if link[i, PULLS] > 0.0:
            pivot, right = link[i, DIAGONAL], link[i, RHS]
            if i > 0 and link[i - 1, PULLS] > 0.0:
                factor = link[i - 1, OFF_DIAGONAL] / link[i - 1, PIVOT]
                pivot -= factor * link[i - 1, OFF_DIAGONAL]
                right -= factor * link[i - 1, REDUCED_RHS]
        link[i, PIVOT], link[i, REDUCED_RHS] = pivot, right
    tension_behind = 0.0
    for k in range(n):
        i = n - 1 - k
        right = link[i, REDUCED_RHS]
        if link[i, PULLS] > 0.0:
            right -= link[i, OFF_DIAGONAL] * tension_behind
        tension_behind = right / link[i, PIVOT]
        link[i, TENSION] = tension_behind


@kernel
def _mark_pulling(link: Floats) -> int:
    """Mark again which links pull; return how many marks changed."""
    n, changed = link.shape[0], 0
    for i in range(n):
        pulls = link[i, TENSION]
        if not link[i, PULLS] > 0.0:
            pulls = link[i, RHS]
            if i > 0:
                pulls -= link[i - 1, OFF_DIAGONAL] * link[i - 1, TENSION]
            if i + 1 < n:
                pulls -= link[i, OFF_DIAGONAL] * link[i + 1, TENSION]
        mark = 1.0 if pulls > 0.0 else 0.0
        if mark != link[i, PULLS]:
            changed += 1
        link[i, PULLS] = mark
    return changed


@kernel
def find_tensions(link: Floats) -> bool:
    """Solve for the tensions of `link`; False if the links that pull are not found."""
    for _ in range(_MAX_TRIALS):
        _solve(link)
        if _mark_pulling(link) == 0:
            return True
    return False
