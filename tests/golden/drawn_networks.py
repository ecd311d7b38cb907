"""Road networks drawn for some hundred seeds, as short hashes: what a seed has given once it gives for ever.

python -m tests.golden.drawn_networks         compare what is drawn with tests/golden/data/drawn_networks.json
python -m tests.golden.drawn_networks --write write that file anew
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from math import pi
from pathlib import Path
from typing import Any

from dubins_traffic.errors import InputError
from dubins_traffic.roads.generate import generate, most_segments

FILE = Path(__file__).parent / "data" / "drawn_networks.json"
FAMILIES: dict[str, dict[str, Any]] = {
    "as usual": {},
    "right angles": {"minimum_angle": pi / 2},
    "wide angles": {"minimum_angle": 2.0},
    "narrow": {"w": 0.2, "reach": 0.1},
    "large discs": {"radius": 2.5, "reach": 0.5, "slack": 3.0},
    "long bodies": {"radius": 0.9, "reach": 2.0},
    "moved": {"rigid_motion": True},
    "bent": {"bent": 0.6, "rigid_motion": True},
}
SEEDS = 60


def requests(seed: int) -> tuple[int, int]:
    """Return how many intersections and segments are asked for with a seed: from a tree to the most there may be."""
    count = 2 + (7 * seed) % 29
    low, high = count - 1, most_segments(count)
    return count, low + (seed * (high - low + 1)) // SEEDS


def drawn() -> Iterator[tuple[str, str]]:
    """Yield what is drawn, under a name each: the hash of a network, or the reason why there is none."""
    for family, given in FAMILIES.items():
        for seed in range(SEEDS):
            yield f"{family} {seed}", _hash(*requests(seed), seed, **given)
    yield "towns 1", _hash(150, 200, 1)
    yield "towns 2", _hash(150, 270, 2)


def _hash(count: int, segments: int, seed: int, **given: Any) -> str:
    try:
        network = generate(count, segments, seed, trial=seed % 5, **given)
    except InputError as error:
        return str(error)
    return hashlib.sha256(network.to_json().encode()).hexdigest()[:12]


def main() -> int:
    """Compare, or write."""
    found = dict(drawn())
    if "--write" in sys.argv[1:]:
        FILE.write_text(json.dumps(found, indent=0) + "\n", encoding="utf-8")
        return 0
    known = json.loads(FILE.read_text(encoding="utf-8"))
    others = sorted(name for name in known.keys() | found.keys() if known.get(name) != found.get(name))
    print("\n".join(others))
    return 1 if others else 0


if __name__ == "__main__":
    raise SystemExit(main())
