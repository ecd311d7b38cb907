"""Do adversaries that have learned keep E1 and E2 under their shield, and what do they cost the ego?

    python -m experiments adversaries
    python -m experiments.adversaries [EPISODES] [JOBS]

`examples/learning/adversaries.py` trains them about `lanes` for GENERATIONS generations from a fixed seed. Then they
drive episodes of a minute that they have not seen, about `lanes`, of which the first PAIRED are driven with `lawful`
e-agents as well, and with `rules` as the ego.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.table import Row, show

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.scoring.verdict import ASSUMPTIONS

EPISODES, PAIRED, CHUNK = 10_000, 200, 50
GENERATIONS, SEED, FIRST = 14, 1, 2000
LOWER = 0.2
"""Share of the rounds of `lanes` among `lawful` e-agents that adversaries have to take."""


def measure(episodes: int = EPISODES, jobs: int = 2) -> list[Row]:
    """Return the rows of this experiment."""
    weights = _example().train("lanes", GENERATIONS, SEED)
    with ProcessPoolExecutor(jobs) as pool:
        lanes = _driven(pool, "lanes", weights, episodes)
        rules = _driven(pool, "rules", weights, min(PAIRED, episodes))
        lawful = _driven(pool, "lanes", None, min(PAIRED, episodes))
    broken = dict(zip(ASSUMPTIONS, lanes["broken"].sum(axis=0).astype(int).tolist(), strict=True))
    apart = lawful["rounds"] - lanes["rounds"][: len(lawful["rounds"])]
    half = 1.96 * apart.std(ddof=1) / np.sqrt(len(apart))
    share = apart.mean() / lawful["rounds"].mean()
    return [
        Row(
            f"{episodes:,} episodes of adversaries about lanes: breaches of E1; of E2",
            f"{broken['E1']}; {broken['E2']}",
            "0; 0",
            broken["E1"] == broken["E2"] == 0,
        ),
        Row(
            f"rounds of lanes in {len(apart)} of them, fewer than among lawful e-agents by",
            f"{apart.mean():.2f} +- {half:.2f}, {share:.0%}",
            ">= 20 %, interval above 0",
            bool(share >= LOWER and apart.mean() > half),
        ),
        Row(
            f"rules as the ego in {len(rules['clean'])}: clean in",
            f"{int(rules['clean'].sum())}",
            "all",
            bool(rules["clean"].all()),
        ),
    ]


def _driven(pool: ProcessPoolExecutor, ego: str, weights: Floats | None, episodes: int) -> dict[str, Floats]:
    """Return what came of the first episodes, in their order."""
    chunks = [range(first, min(first + CHUNK, episodes)) for first in range(0, episodes, CHUNK)]
    parts = list(_told(pool.map(partial(_drive, ego, weights), chunks), ego, len(chunks)))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _told(parts: Iterable[dict[str, Floats]], ego: str, count: int) -> Iterable[dict[str, Floats]]:
    for number, part in enumerate(parts, 1):
        print(f"{ego}: {number} of {count} chunks", file=sys.stderr, flush=True)
        yield part


def _drive(ego: str, weights: Floats | None, episodes: Sequence[int]) -> dict[str, Floats]:
    """Drive a chunk: a seed has as many trials as chunks go into."""
    policies = None if weights is None else [weights] * len(episodes)
    seed, first = SEED + episodes[0] // FIRST, FIRST + episodes[0] % FIRST
    return _example().drive(ego, policies, seed, range(first, first + len(episodes)))


def _example() -> Any:
    path = Path(__file__).parent.parent / "examples" / "learning" / "adversaries.py"
    spec = importlib.util.spec_from_file_location("adversaries", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


if __name__ == "__main__":
    given = [int(text) for text in sys.argv[1:]]
    raise SystemExit(0 if show("adversaries", measure(*given)) else 1)
