"""A policy that PPO has learned in `plumbline/Hover-v0`, as a law: benchmarks/learn_to_hover.py made it.

It hovers the load; it was never shown a path, and lags behind one.
"""

from __future__ import annotations

from pathlib import Path

from plumbline.learning.law import PolicyLaw


class HoverPolicy(PolicyLaw):
    """Flies with the numbers in hover_policy.npz."""

    file = Path(__file__).with_name("hover_policy.npz")
