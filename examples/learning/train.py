"""Learns to drive by an evolution strategy, in NumPy alone.

usage: python train.py district|town [FOLDER]

Each generation changes the weights of a small policy in pairs of opposite directions; the two of a pair drive the same
trials, so that they differ in what they do and in nothing else. NAME.npz and NAME.csv, the curve, are written into
FOLDER, by default here. The seed is fixed: the same curve comes again.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import gymnasium
import numpy as np

import dubins_traffic.envs  # noqa: F401  # makes its environments known
from dubins_traffic import load_config
from dubins_traffic.envs.terms import COSTS
from dubins_traffic.learning.flat import Layout
from dubins_traffic.learning.policy import Policy

HERE = Path(__file__).parent
PAIRS, SIGMA, RATE, SEED, SKIP, CARS = 48, 0.1, 0.05, 1, 5, 2
GOAL = ("bearing_cos", "bearing_sin", "distance", "route", "turn_cos", "turn_sin")
LANE = ("on_lane", "offset", "heading_cos", "heading_sin", "to_end")
CAR = ("seen", "x", "y", "heading_cos", "heading_sin", "speed")
OTHERS = tuple(f"cars[{k}].{name}" for k in range(CARS) for name in CAR)
SHOWN = (*(f"goal.{name}" for name in GOAL), *(f"lane.{name}" for name in LANE), "crossing.at")
OWN = tuple(f"own.{name}" for name in ("approach", "stopped", "clear", "first", "still", "speed"))
MORE = (*OWN, "crossing.x", "crossing.y", "own.in_crossing", "lane.progress")


@dataclass(frozen=True)
class Lesson:
    """What is learned, and for how long: weights of the reward, and what the policy is shown."""

    generations: int
    hidden: int
    shown: tuple[str, ...]
    reward: Mapping[str, float]

    @property
    def size(self) -> int:
        """How many weights a policy has."""
        return self.hidden * (len(self.shown) + 3) + 2

    def layers(self, weights: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return hidden layer, its bias, outer layer and its bias of each of some policies' weights, (K, W)."""
        sizes = [(self.hidden, len(self.shown)), (self.hidden,), (2, self.hidden), (2,)]
        cuts = np.cumsum([int(np.prod(size)) for size in sizes])[:-1]
        parts = np.split(weights, cuts, axis=1)
        return tuple(part.reshape(-1, *size) for part, size in zip(parts, sizes, strict=True))


COLLISIONS = {"progress": 0.2, "comfort": 0.0, "1.collision": -1.0, "at_fault": -2.0, "debt": 0.0}
RULES = {**dict.fromkeys(COSTS, -0.5), "progress": 0.3, "comfort": 0.0, "at_fault": -2.0, "debt": 0.0}
LESSONS = {
    "district": Lesson(300, 8, (*SHOWN, *OTHERS), COLLISIONS),
    "town": Lesson(260, 12, (*SHOWN, *MORE, *OTHERS), RULES),
}
"""`district` has no rules but not to collide; in `town` all are judged."""


def returns(env: gymnasium.vector.VectorEnv, lesson: Lesson, weights: np.ndarray, generation: int) -> np.ndarray:
    """Return what each policy is rewarded with in an episode of its own environment; two by two the same episode."""
    hidden, hidden_bias, out, out_bias = lesson.layers(weights)
    seeds = [SEED + k // 2 for k in range(len(weights))]
    seen, _ = env.reset(seed=seeds, options={"episode": generation})
    total, running = np.zeros(len(weights)), np.ones(len(weights), dtype=bool)
    places = [Layout(CARS).names.index(name) for name in lesson.shown]
    while running.any():
        inner = np.tanh(np.einsum("khv,kv->kh", hidden, seen[:, places]) + hidden_bias)
        actions = np.tanh(np.einsum("kah,kh->ka", out, inner) + out_bias)
        seen, reward, terminated, truncated, _ = env.step(actions)
        total += reward * running
        running &= ~(terminated | truncated)
    return total


def train(name: str, folder: Path, generations: int | None = None) -> None:
    """Learn a lesson, for some generations, and write what has been learned into a folder."""
    lesson = LESSONS[name]
    config = {
        **load_config(str(HERE / f"{name}.json")).to_document(),
        "duration": 30,
        "end_on_collision": True,
    }
    env = gymnasium.make_vec(
        "dubins_traffic/Traffic-v0", num_envs=2 * PAIRS, vectorization_mode="vector_entry_point",
        config=config, frame_skip=SKIP, reward=lesson.reward, cars=CARS, autoreset_mode="NextStep",
    )  # fmt: skip
    draws = np.random.default_rng(SEED)
    mean = 0.1 * draws.standard_normal(lesson.size)
    first, second = np.zeros(lesson.size), np.zeros(lesson.size)
    curve: list[float] = []
    began = time.monotonic()
    for generation in range(lesson.generations if generations is None else generations):
        noise = draws.standard_normal((PAIRS, lesson.size))
        both = np.stack([mean + SIGMA * noise, mean - SIGMA * noise], axis=1).reshape(2 * PAIRS, lesson.size)
        found = returns(env, lesson, both, generation)
        ranks = np.empty(len(found))
        ranks[found.argsort(kind="stable")] = np.linspace(-0.5, 0.5, len(found))
        slope = noise.T @ (ranks[::2] - ranks[1::2]) / (PAIRS * SIGMA)
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope * slope
        scaled = first / (1 - 0.9 ** (generation + 1)), second / (1 - 0.999 ** (generation + 1))
        mean = mean + RATE * scaled[0] / (np.sqrt(scaled[1]) + 1e-8)
        curve.append(float(found.mean()))
        if generation % 10 == 0:
            print(f"{generation:4d} {found.mean():7.3f} {time.monotonic() - began:6.1f} s", flush=True)
    hidden, hidden_bias, out, out_bias = (layer[0] for layer in lesson.layers(mean[None]))
    policy = Policy(lesson.shown, CARS, SKIP, ((hidden, hidden_bias), (out, out_bias)))
    policy.save(folder / f"{name}.npz", overwrite=True)
    lines = ["generation,mean_return", *(f"{k},{value:.6f}" for k, value in enumerate(curve))]
    (folder / f"{name}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) < 2 or sys.argv[1] not in LESSONS:
        sys.exit(__doc__)
    train(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else HERE)
