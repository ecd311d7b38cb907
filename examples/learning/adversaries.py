"""Adversaries that learn to spoil the ego's task within the rules: an evolution strategy in NumPy alone.

    python examples/learning/adversaries.py [--ego lanes] [--generations 20] [--trials 96] [--save adversaries.npz]

All e-agents share one small policy and drive under the shield that keeps them within E1 and E2. It is trained about one
ego, then compared with e-agents of the kind `lawful`, on trials that it has not seen: the same roads, goals and starts.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from dubins_traffic.envs.about_ego import NAMES
from dubins_traffic.envs.crew import CrewFleet, Roles
from dubins_traffic.envs.settings import Settings
from dubins_traffic.envs.terms import PAID, WEIGHTS, Pay
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.scoring.verdict import ASSUMPTIONS

CARS, SKIP = 4, 6
PAIRS, EACH, SPREAD, RATE = 6, 6, 0.15, 0.25
"""Pairs of policies a generation, trials of each, the spread of their weights, and the step that is taken."""
CONFIG = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"random": {"intersections": 7, "segments": 8}},
    "e-agents": [{"type": "lawful", "count": CARS}],
    "number_trials": 1,
    "duration": 60,
    "number_goals_bounds": [2, 3],
    "rules": True,
}
SETTINGS = Settings(CONFIG, frame_skip=SKIP)
_FLAT = SETTINGS.layout.names
SHOWN = [
    *(_FLAT.index(f"lane.{name}") for name in ("offset", "heading_cos", "heading_sin", "to_end", "on_lane")),
    *(len(_FLAT) + NAMES.index(name) for name in NAMES if name not in ("is_ego", "speed", "yaw_rate")),
]
"""The numbers of an observation that the policy is shown."""
PARTS, TASK = (
    [PAID.index(name) for name in ASSUMPTIONS],
    [PAID.index(name) for name in ("visits", "progress")],
)
PRICES = np.array([1.0, 5.0, 1.0, 1.0, 1.0, 1.0])
"""What a breach of E1 to E6 costs."""


def beginner() -> Floats:
    """Return weights, (inputs + 1, 2), of a policy that keeps to its lane at full speed."""
    weights = np.zeros((len(SHOWN) + 1, 2))
    weights[-1] = 1.5, -0.75
    weights[0, 1], weights[2, 1] = -1.5, -2.0
    return weights


def drive(ego: str, policies: Sequence[Floats] | None, seed: int, trials: Sequence[int]) -> dict[str, Floats]:
    """Drive trials of a seed, each with its own policy, or with `lawful` e-agents; return what came of each."""
    learned = list(range(1, CARS + 1)) if policies is not None else []
    roles = Roles(learned, ego, dict.fromkeys(learned, "sure"), excuses=False)
    fleet = CrewFleet(SETTINGS, len(trials), roles, Pay("adversaries"))
    for env, trial in enumerate(trials):
        fleet.seed(env, (seed, trial))
    fleet.begin(range(len(trials)))
    broken, paid = np.zeros((len(trials), len(ASSUMPTIONS))), np.zeros(len(trials))
    stacked = np.array(policies) if policies is not None else None
    while not fleet.ended.all():
        running = ~fleet.ended
        shares = np.zeros((len(trials), len(learned), 2))
        if stacked is not None:
            seen = fleet.observed[:, :, SHOWN]
            shares = np.tanh(np.einsum("bni,bij->bnj", seen, stacked[:, :-1]) + stacked[:, None, -1])
        fleet.step(np.clip(shares, [-0.2, -1.0], 1.0))
        terms = fleet.board.arrays["terms"].reshape(len(trials), CARS + 1, len(PAID))[running]
        charged = terms[:, 1:, PARTS].sum(axis=1)
        broken[running] += charged
        paid[running] -= terms[:, 0, TASK] @ [WEIGHTS[PAID[k]] for k in TASK] + charged @ PRICES / CARS
    scores = [one.score for one in fleet.outcomes(range(len(trials)))]
    return {
        "paid": paid,
        "broken": broken,
        "rounds": np.array([one.verdict.rounds if one.verdict else 0 for one in scores], dtype=np.float64),
        "visits": np.array([sum(goal.visits for goal in one.goals) for one in scores], dtype=np.float64),
        "clean": np.array([bool(one.verdict and one.verdict.clean) for one in scores], dtype=np.float64),
    }


def train(ego: str, generations: int, seed: int) -> Floats:
    """Return the weights of a policy that has learned, and print what it is paid on the way."""
    chance = np.random.default_rng(seed)
    weights = beginner()
    for generation in range(generations):
        noise = chance.normal(size=(PAIRS, *weights.shape))
        trials = [EACH * generation + k for k in range(EACH)]
        policies = [weights + SPREAD * sign * one for one in noise for sign in (1.0, -1.0) for _ in trials]
        found = drive(ego, policies, seed, trials * (2 * PAIRS))
        paid = found["paid"].reshape(PAIRS, 2, EACH).mean(axis=2)
        gain = (paid[:, 0] - paid[:, 1]) / (paid.std() + 1e-6)
        weights = weights + RATE * SPREAD * np.einsum("p,pij->ij", gain, noise) / np.sqrt(PAIRS)
        told = ", ".join(
            f"{name} {count:.2f}" for name, count in zip(ASSUMPTIONS, found["broken"].mean(axis=0), strict=True)
        )
        print(
            f"{generation:3d}: paid {paid.mean():6.2f}, visits {found['visits'].mean():.2f}; broken a trial: {told}",
            flush=True,
        )
    return weights


def compare(ego: str, weights: Floats, seed: int, trials: int) -> None:
    """Print what an ego does among the adversaries, and among `lawful` e-agents on the same roads."""
    numbers = range(2000, 2000 + trials)
    theirs = drive(ego, [weights] * trials, seed, numbers)
    lawful = drive(ego, None, seed, numbers)
    for name in ("rounds", "visits", "clean"):
        apart = theirs[name] - lawful[name]
        half = 1.96 * apart.std(ddof=1) / np.sqrt(trials)
        print(f"{ego}, {name}: {lawful[name].mean():.3f} among lawful, {theirs[name].mean():.3f} among adversaries: "
              f"{apart.mean():+.3f} +- {half:.3f} ({apart.mean() / max(lawful[name].mean(), 1e-9):+.0%})")  # fmt: skip
    broken = dict(zip(ASSUMPTIONS, theirs["broken"].sum(axis=0).astype(int).tolist(), strict=True))
    print(f"adversaries broke, in {trials} trials: {broken}")


def main() -> None:
    """Train and compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ego", default="lanes")
    parser.add_argument("--generations", type=int, default=20)
    parser.add_argument("--trials", type=int, default=96)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--save", default="")
    given = parser.parse_args()
    compare(given.ego, beginner(), given.seed, given.trials)
    weights = train(given.ego, given.generations, given.seed)
    if given.save:
        np.savez(given.save, weights=weights)
    for ego in dict.fromkeys((given.ego, "rules")):
        compare(ego, weights, given.seed, given.trials)


if __name__ == "__main__":
    main()
