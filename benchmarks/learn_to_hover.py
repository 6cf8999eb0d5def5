"""Train a policy to hover the load, with PPO of Stable-Baselines3 on the compiled environments.

    pip install -e '.[learn]'
    python benchmarks/learn_to_hover.py out/hover-policy.npz

prints the progress, and how well the policy hovers at the end; the file can be flown as a law.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

import plumbline.learning
from plumbline.learning.policy import policy_of_sb3
from plumbline.learning.stable_baselines import SB3VecEnv

ENVS = 64
OPTIONS: dict[str, Any] = {"randomise": {"SIM_LOAD_MASS": (0.08, 0.12), "SIM_ACT_DELAY_MS": (0.0, 8.0)}}


class Progress(BaseCallback):
    """Prints from time to time the results of the last hundred episodes."""

    def __init__(self) -> None:
        super().__init__()
        self.start_s = time.perf_counter()
        self.next = 0

    def _on_step(self) -> bool:
        if self.num_timesteps >= self.next and self.model.ep_info_buffer:
            self.next += 200_000
            rewards = [each["r"] for each in self.model.ep_info_buffer]
            lengths = [each["l"] for each in self.model.ep_info_buffer]
            elapsed_s = time.perf_counter() - self.start_s
            print(
                f"{elapsed_s:5.0f} s {self.num_timesteps:9d} steps: "
                f"reward {np.mean(rewards):7.1f}, {np.mean(lengths):5.0f} steps an episode",
                flush=True,
            )
        return True


def learn(steps: int, seed: int) -> PPO:
    """A policy trained for so many steps."""
    torch.set_num_threads(1)  # the networks are small: more threads would wait for each other
    envs = SB3VecEnv(gymnasium.make_vec(plumbline.learning.HOVER, ENVS, autoreset_mode="SameStep", **OPTIONS))
    model = PPO(
        "MlpPolicy",
        VecMonitor(envs),
        n_steps=128,
        batch_size=2048,
        n_epochs=5,
        gamma=0.99,
        gae_lambda=0.95,
        learning_rate=lambda left: 1e-4 + 6e-4 * left,
        ent_coef=0.0,
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.0},
        seed=seed,
        device="cpu",
    )
    return model.learn(steps, callback=Progress())


def score(model: PPO, episodes: int = 100) -> tuple[float, float]:
    """(share of episodes without a crash, mean position error in m of the load over their last second)."""
    envs = gymnasium.make_vec(plumbline.learning.HOVER, episodes, autoreset_mode="Disabled", **OPTIONS)
    observations, _ = envs.reset(seed=10_000)
    alive = np.ones(episodes, bool)
    errors = []
    for step in range(499):
        observations, _, crashed, _, _ = envs.step(model.predict(observations, deterministic=True)[0])
        alive &= ~crashed
        if crashed.any():
            observations, _ = envs.reset(options={"reset_mask": crashed})
        if step >= 449:
            errors.append(np.linalg.norm(observations[:, :3], axis=1))
    return float(alive.mean()), float(np.mean(errors))


def main() -> None:
    """Train, evaluate, and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=3_000_000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    model = learn(arguments.steps, arguments.seed)
    alive, error_m = score(model)
    print(
        f"{alive:.0%} of 100 episodes without a crash, "
        f"{1e3 * error_m:.0f} mm from the place in their last second"
    )
    policy_of_sb3(model, OPTIONS).save(arguments.out)
    print(f"{arguments.out} is written; it flies as a law: docs/learning.md")


if __name__ == "__main__":
    main()
