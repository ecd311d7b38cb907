"""Learns to drive by an evolution strategy, in NumPy alone.

usage: python train.py [FOLDER]

Each generation changes the weights of a small policy in pairs of opposite directions; the two of a pair drive the same
trials, so that they differ in what they do and in nothing else. policy.npz and curve.csv are written into FOLDER, by
default here. The seed is fixed: the same curve comes again.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import gymnasium
import numpy as np

import dubins_traffic.envs  # noqa: F401  # makes its environments known
from dubins_traffic import load_config
from dubins_traffic.controllers.learned import Policy
from dubins_traffic.observations.flat import Layout

HERE = Path(__file__).parent
GENERATIONS, PAIRS, HIDDEN = 300, 48, 8
SIGMA, RATE, SEED, SKIP, CARS = 0.1, 0.05, 1, 5, 2
REWARD = {"visits": 1.0, "progress": 0.2, "comfort": 0.0, "1.collision": -1.0, "at_fault": -2.0}
SHOWN = (
    "goal.bearing_cos",
    "goal.bearing_sin",
    "goal.distance",
    "goal.route",
    "goal.turn_cos",
    "goal.turn_sin",
)
SHOWN += ("lane.on_lane", "lane.offset", "lane.heading_cos", "lane.heading_sin", "lane.to_end", "crossing.at")
SHOWN += tuple(
    f"cars[{k}].{name}"
    for k in range(CARS)
    for name in ("seen", "x", "y", "heading_cos", "heading_sin", "speed")
)


def layers(weights: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return hidden layer, its bias, outer layer and its bias of each of some policies' weights, (K, W)."""
    sizes = [(HIDDEN, len(SHOWN)), (HIDDEN,), (2, HIDDEN), (2,)]
    cuts = np.cumsum([int(np.prod(size)) for size in sizes])[:-1]
    parts = np.split(weights, cuts, axis=1)
    return tuple(part.reshape(-1, *size) for part, size in zip(parts, sizes, strict=True))


def returns(env: gymnasium.vector.VectorEnv, weights: np.ndarray, generation: int) -> np.ndarray:
    """Return what each policy is rewarded with in an episode of its own environment; two by two the same episode."""
    hidden, hidden_bias, out, out_bias = layers(weights)
    seeds = [SEED + k // 2 for k in range(len(weights))]
    seen, _ = env.reset(seed=seeds, options={"episode": generation})
    total, running = np.zeros(len(weights)), np.ones(len(weights), dtype=bool)
    places = [Layout(CARS).names.index(name) for name in SHOWN]
    while running.any():
        inner = np.tanh(np.einsum("khv,kv->kh", hidden, seen[:, places]) + hidden_bias)
        actions = np.tanh(np.einsum("kah,kh->ka", out, inner) + out_bias)
        seen, reward, terminated, truncated, _ = env.step(actions)
        total += reward * running
        running &= ~(terminated | truncated)
    return total


def main(folder: Path) -> None:
    """Train, and write what has been learned."""
    document = load_config(str(HERE / "district.json")).to_document()
    config = {**document, "duration": 30, "end_on_collision": True}
    env = gymnasium.make_vec(
        "dubins_traffic/Traffic-v0", num_envs=2 * PAIRS, vectorization_mode="vector_entry_point",
        config=config, frame_skip=SKIP, reward=REWARD, cars=CARS, autoreset_mode="NextStep",
    )  # fmt: skip
    draws = np.random.default_rng(SEED)
    size = sum(layer.size for layer in layers(np.zeros((1, HIDDEN * (len(SHOWN) + 3) + 2))))
    mean, first, second = 0.1 * draws.standard_normal(size), np.zeros(size), np.zeros(size)
    curve: list[tuple[int, float]] = []
    began = time.monotonic()
    for generation in range(GENERATIONS):
        noise = draws.standard_normal((PAIRS, size))
        both = np.stack([mean + SIGMA * noise, mean - SIGMA * noise], axis=1).reshape(2 * PAIRS, size)
        found = returns(env, both, generation)
        ranks = np.empty(len(found))
        ranks[found.argsort(kind="stable")] = np.linspace(-0.5, 0.5, len(found))
        slope = noise.T @ (ranks[::2] - ranks[1::2]) / (PAIRS * SIGMA)
        first, second = 0.9 * first + 0.1 * slope, 0.999 * second + 0.001 * slope * slope
        scaled = first / (1 - 0.9 ** (generation + 1)), second / (1 - 0.999 ** (generation + 1))
        mean = mean + RATE * scaled[0] / (np.sqrt(scaled[1]) + 1e-8)
        curve.append((generation, float(found.mean())))
        if generation % 10 == 0:
            print(f"{generation:4d} {found.mean():7.3f} {time.monotonic() - began:6.1f} s", flush=True)
    weights = [layer[0] for layer in layers(mean[None])]
    Policy(SHOWN, CARS, SKIP, *weights).save(folder / "policy.npz")
    lines = ["generation,mean_return", *(f"{generation},{value:.6f}" for generation, value in curve)]
    (folder / "curve.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
