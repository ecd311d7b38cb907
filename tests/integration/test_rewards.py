"""What drivers are paid in environments is in the order in which they are ranked."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest

import dubins_traffic.envs  # noqa: F401  # makes its environments known
from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.registry import load
from dubins_traffic.envs.terms import DEBTS, LEAST, SCORE, TERMS, WEIGHTS, worth
from dubins_traffic.problem.instance import Problem
from tests.contract_drivers import AsEgo, Stands
from tests.environments import SHORT, single

TRIALS = 6


def paid(env: Any, driver: Any, seed: int) -> tuple[float, Any, list[dict[str, float]]]:
    """Return what a driver is paid in an episode, its score, and the terms of each step."""
    seen, info = env.reset(seed=seed)
    driver.start(info["trial"].problem)
    actions, total, over, terms = env.unwrapped.settings.actions, 0.0, False, []
    while not over:
        shares = (np.array(driver.act(seen)) - actions.middle) / actions.half
        seen, reward, terminated, truncated, info = env.step(shares)
        total, over = total + reward, terminated or truncated
        terms.append(info["reward_terms"])
    return total, info["outcome"].score, terms


@pytest.mark.long
@pytest.mark.parametrize("name", ["Junction", "Town"])
def test_mean_returns_order_drivers_as_the_ranking_does(name: str) -> None:
    """Counted rounds, then rounds before the first breach; a breach never leaves less than who stands has."""
    env = gymnasium.make(f"dubins_traffic/{name}-v0", observation="object", disable_env_checker=True)
    rows: list[tuple[float, float, float]] = []
    for driver in ("stands", "simple", "lanes", "rules"):
        found = [
            paid(env, AsEgo(Stands()) if driver == "stands" else load(driver), 1000 + trial) for trial in range(TRIALS)
        ]
        scores = [score for _, score, _ in found]
        rows.append(
            (
                float(np.mean([score.counted_rounds for score in scores])),
                float(np.mean([score.rounds_before_breach for score in scores])),
                float(np.mean([total for total, _, _ in found])),
            )
        )
    assert rows == sorted(rows)
    returns = [total for _, _, total in rows]
    assert returns[0] == 0.0
    assert all(low + 0.3 < high for low, high in pairwise(returns)), returns
    assert rows[-1][0] > 0.0


@pytest.mark.parametrize("name", ["lanes", "rules"])
def test_the_reward_score_sums_to_the_rounds_before_the_first_breach(name: str) -> None:
    env = gymnasium.make("dubins_traffic/Junction-v0", observation="object", reward=SCORE, disable_env_checker=True)
    found = [paid(env, load(name), trial)[:2] for trial in range(2)]
    assert [total for total, _ in found] == pytest.approx([score.rounds_before_breach for _, score in found])
    assert max(total for total, _ in found) > 0.0


class LeavesTheRoad:
    """Turns off the road at once and goes on."""

    def start(self, problem: Problem) -> None:
        self.bounds = problem.car.bounds

    def act(self, observation: Observation) -> Command:
        return Command(self.bounds.speed, 2.0 if observation.tick < 25 else 0.0)


def test_who_stays_off_the_road_earns_ever_less() -> None:
    """A breach is an event, and each second off the road adds to the debt."""
    config = {**SHORT, "duration": 20.0, "e-agents": []}
    reward = dict.fromkeys(TERMS, 1.0)
    _, _, terms = paid(single(config, observation="object", reward=reward), LeavesTheRoad(), 3)
    _, score, free = paid(single(config, observation="object", reward={**reward, "debt": 0.0}), LeavesTheRoad(), 3)
    debt, shares = 0.0, []
    for owing, own in zip(terms, free, strict=True):
        if own["progress"]:
            shares.append(owing["progress"] / own["progress"])
            assert shares[-1] == pytest.approx(worth(debt))
        debt += sum(each * own[name] for name, each in DEBTS.items())
    assert score.driven.off_road_s > 5.0
    assert shares[0] == 1.0
    assert shares[-1] == pytest.approx(LEAST) or shares[-1] < 0.4
    assert shares == sorted(shares, reverse=True)


def test_each_term_has_a_weight_and_each_cost_a_debt() -> None:
    assert tuple(WEIGHTS) == TERMS
    assert set(DEBTS) < set(TERMS)
