"""How much of what an ego breaks among other learners is forgiven, since one of them has broken something before?

    python -m experiments excuses
    python -m experiments.excuses [EPISODES]

All cars of `town` do as beginners do: each action is drawn at random, rather forward than backward. The same episodes
are charged three times: with `excuses` for the rest of an episode, in the window, and not at all.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from benchmarks.table import Row, show

from dubins_traffic.envs.blame import EXCUSED_FOR, WINDOW
from dubins_traffic.envs.parallel import parallel_env

EPISODES = 40
FORWARD = (0.5, 0.0)


def costs(excuses: Any, episodes: int) -> float:
    """Return what the ego is charged with in all."""
    env, total = parallel_env("town", excuses=excuses, frame_skip=15), 0.0
    for episode in range(episodes):
        chance = np.random.default_rng(episode)
        env.reset(seed=episode)
        while env.agents:
            asked = {name: chance.uniform(-1.0, 1.0, 2) + FORWARD for name in env.agents}
            infos = env.step({name: np.clip(own, -1.0, 1.0) for name, own in asked.items()})[4]
            total += infos["ego_0"]["cost"]
    return total


def measure(episodes: int = EPISODES) -> list[Row]:
    """Return the rows of this experiment."""
    every = costs(False, episodes)
    kinds = (
        (True, "excuses: the first breach excuses for the rest"),
        (WINDOW, f"window: a breach excuses for {EXCUSED_FOR:g} s"),
    )
    rows: list[Row] = []
    for excuses, words in kinds:
        share = 1.0 - costs(excuses, episodes) / every
        rows.append(Row(f"{words}; of {every:.0f} breaches of the ego's are forgiven", f"{share:.0%}", "", True))
    return rows


if __name__ == "__main__":
    sys.exit(0 if show("excuses", measure(*map(int, sys.argv[1:]))) else 1)
