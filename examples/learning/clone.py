"""Learn to drive as `rules` does, from what it would do where the learner gets to (DAgger), in NumPy alone.

    python examples/learning/clone.py [FILE]

In each round trials of `junction` are driven by turns by `rules` and by what has been learned so far, and in every
frame `rules` says what it would do, as the nearest of CHOICES; then a network is fitted to all frames of all rounds. It
takes some minutes on two cores, and writes the policy to FILE, `junction.npz` beside this file by default.

S. Ross, G. Gordon, D. Bagnell: A reduction of imitation learning and structured prediction to no-regret online
learning, AISTATS 2011, algorithm 3.1.
"""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.registry import load
from dubins_traffic.learning.flat import FlatObserver, Layout
from dubins_traffic.learning.policy import Learned, Policy
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Problem
from dubins_traffic.runs.single import run_trial

CONFIG = load_config("junction")
CARS, HIDDEN = 3, (96, 48)
SPEEDS = (0.0, 0.2, 0.45, 0.71, 0.85, 1.0)
TURNS = (-1.0, -0.77, -0.45, -0.21, -0.1, -0.03, 0.0, 0.03, 0.1, 0.21, 0.45, 0.77, 1.0)
CHOICES = np.array([(speed, turn) for speed in SPEEDS for turn in TURNS])
"""Shares of the top speed and of the top yaw rate."""
ROUNDS, FIRST, LATER, EPOCHS = 6, 60, 20, 25
"""Rounds after the first; trials of the first and of each later one; passes through all frames a round."""
RATE, BATCH = 2e-3, 512
TURN = 90
"""Ticks after which it is drawn anew who drives."""
Layers = list[tuple[np.ndarray, np.ndarray]]


class Taught:
    """Drives by turns as the expert and by a policy, and keeps what was seen and what the expert would have done."""

    def __init__(self, policy: Policy | None, expert_share: float, seed: int) -> None:
        self.expert, self.policy, self.share = load("rules"), policy, expert_share
        self.chance = np.random.default_rng(seed)
        self.seen: list[np.ndarray] = []
        self.wanted: list[int] = []

    def start(self, problem: Problem) -> None:
        self.observe, self.bounds = FlatObserver(problem, CARS), problem.car.bounds
        self.expert.start(problem)
        self.learner = Learned(self.policy) if self.policy is not None else load("rules")
        self.learner.start(problem)

    def act(self, observation: Observation) -> Command:
        expert, learner = self.expert.act(observation), self.learner.act(observation)
        self.seen.append(self.observe(observation))
        share = np.array([expert[0] / self.bounds.speed, expert[1] / self.bounds.yaw_rate])
        self.wanted.append(int(((CHOICES - share) ** 2).sum(axis=1).argmin()))
        if observation.tick % TURN == 0:
            self.leads = self.chance.uniform() < self.share
        return Command(*(expert if self.leads else learner))


def taught(task: tuple[int, Policy | None, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return what was seen in every second frame of a trial, (K, V), and which choice the expert made, (K,)."""
    seed, policy, share = task
    driver = Taught(policy, share, seed)
    run_trial(draw(CONFIG, seed, 0), driver)
    return np.array(driver.seen[::2]), np.array(driver.wanted[::2])


def beginner(chance: np.random.Generator) -> Layers:
    """Return the layers of a network that knows nothing."""
    sizes = (Layout(CARS).size, *HIDDEN, len(CHOICES))
    return [
        (
            chance.normal(0.0, before**-0.5, (after, before)).astype(np.float32),
            np.zeros(after, dtype=np.float32),
        )
        for before, after in pairwise(sizes)
    ]


def slopes(layers: Layers, seen: np.ndarray, wanted: np.ndarray) -> tuple[Layers, float]:
    """Return the slopes of the mean cross-entropy of the choices in some frames by all weights, and that entropy."""
    inputs = [seen]
    for weights, bias in layers[:-1]:
        inputs.append(np.tanh(inputs[-1] @ weights.T + bias))
    sums = inputs[-1] @ layers[-1][0].T + layers[-1][1]
    likely = np.exp(sums - sums.max(axis=1, keepdims=True))
    likely /= likely.sum(axis=1, keepdims=True)
    rows = np.arange(len(seen))
    entropy = -float(np.log(likely[rows, wanted] + 1e-9).mean())
    likely[rows, wanted] -= 1.0
    back, found = likely / len(seen), []
    for (weights, _), own in zip(reversed(layers), reversed(inputs), strict=True):
        found.append((back.T @ own, back.sum(axis=0)))
        back = (back @ weights) * (1.0 - own * own)
    return found[::-1], entropy


def fitted(layers: Layers, seen: np.ndarray, wanted: np.ndarray, epochs: int, chance: Any) -> tuple[Layers, float]:
    """Return the layers after Adam has lessened the cross-entropy, and that of the last batch."""
    flat = [array for layer in layers for array in layer]
    first, second = [np.zeros_like(one) for one in flat], [np.zeros_like(one) for one in flat]
    steps, entropy = 0, 0.0
    for epoch in range(epochs):
        rate = RATE * 0.5 * (1.0 + np.cos(np.pi * epoch / epochs))
        order = chance.permutation(len(seen))
        for start in range(0, len(seen), BATCH):
            rows = order[start : start + BATCH]
            by_layer, entropy = slopes(list(zip(flat[::2], flat[1::2], strict=True)), seen[rows], wanted[rows])
            steps += 1
            for k, slope in enumerate(array for layer in by_layer for array in layer):
                first[k] = 0.9 * first[k] + 0.1 * slope
                second[k] = 0.999 * second[k] + 0.001 * slope * slope
                step = first[k] / (1.0 - 0.9**steps) / (np.sqrt(second[k] / (1.0 - 0.999**steps)) + 1e-8)
                flat[k] = (flat[k] - rate * step).astype(np.float32)
    return list(zip(flat[::2], flat[1::2], strict=True)), entropy


def policy_of(layers: Layers) -> Policy:
    """Return the policy of a network, which is shown all of the flat observation in every tick."""
    whole = tuple((weights.astype(np.float64), bias.astype(np.float64)) for weights, bias in layers)
    return Policy(Layout(CARS).names, CARS, 1, whole, CHOICES)


def learn(rounds: int, first: int, later: int, epochs: int, jobs: int = 2) -> tuple[Policy, list[float]]:
    """Return the policy after some rounds, and the cross-entropy of each."""
    chance = np.random.default_rng(0)
    layers, entropies = beginner(chance), []
    with ProcessPoolExecutor(jobs) as pool:
        lessons = list(pool.map(taught, [(trial, None, 1.0) for trial in range(first)]))
        for number in range(rounds + 1):
            seen, wanted = (np.concatenate([lesson[k] for lesson in lessons]) for k in range(2))
            layers, entropy = fitted(layers, seen, wanted, epochs, chance)
            entropies.append(entropy)
            print(f"round {number}: {len(seen)} frames, cross-entropy {entropy:.3f}", flush=True)
            if number < rounds:
                tasks = [
                    (100_000 * (number + 1) + trial, policy_of(layers), 0.5 * 0.7**number) for trial in range(later)
                ]
                lessons += pool.map(taught, tasks)
    return policy_of(layers), entropies


if __name__ == "__main__":
    learned, _ = learn(ROUNDS, FIRST, LATER, EPOCHS)
    learned.save(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "junction.npz", overwrite=True)
