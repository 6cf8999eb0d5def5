"""A policy trained with PPO in `plumbline/Hover-v0` by benchmarks/learn_to_hover.py, as a law.

It hovers the load. It was not trained to follow a path, and lags behind one.
"""

from __future__ import annotations

from pathlib import Path

from plumbline.learning.law import PolicyLaw


class HoverPolicy(PolicyLaw):
    """Flies with the weights in hover_policy.npz."""

    file = Path(__file__).with_name("hover_policy.npz")
