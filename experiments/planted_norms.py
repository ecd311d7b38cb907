"""The norm with holes: copies of the package in which one clause says what it must not, to see that searches find it.

A copy differs from the package in a few lines (`CHANGES`) that leave the norm as it is until the environment variable
`HOLE` names a hole; so one compilation serves them all.
"""

from __future__ import annotations

import hashlib
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import dubins_traffic

PACKAGE: Final = Path(dubins_traffic.__file__).parent
HOLE: Final = "DUBINS_TRAFFIC_PLANTED"
"""The environment variable that says which hole a copy has, by its number."""
NONE, REST, EXIT, QUEUE, FLIPS, TURNS = range(6)
"""No hole, and those of `HOLES`."""
SAYS: Final = {
    REST: "E5 of edition 2: its seconds begin anew when a car has moved half a metre in ten seconds",
    EXIT: "an exit is free with 0.8 m of room behind the disc, however long the bodies",
    QUEUE: "E6 pauses for the ego at an exit, not for a queue that begins at it",
    FLIPS: "flips are free while overtaking, also by backing: no breach, and a journey begins anew",
    TURNS: "flips are no breach while overtaking, and the journey goes on",
}
"""The holes, in words."""


@dataclass(frozen=True, slots=True)
class Change:
    """A text of a module, which stands there once, and what takes its place."""

    module: str
    old: str
    new: str


CHANGES: Final = (
    Change(
        "rules/breach_log.py",
        "    judged: int\n",
        "    judged: int\n    hole: int\n",
    ),
    Change(
        "rules/breach_log.py",
        "        row.judged = int(judged[b])\n",
        f"        row.judged = int(judged[b])\n        row.hole = int(__import__('os').environ.get('{HOLE}', '0'))\n",
    ),
    Change(
        "rules/duties.py",
        "    start = min(terms.start_ticks, terms.journey_ticks)\n    long = tick - car.journey_since\n"
        "    if long < start:\n        return car.journey_since + start\n",
        "    start = min(terms.start_ticks, terms.journey_ticks)\n"
        "    bits = np.int64(labels.bits[b, n])\n"
        f"    moves_on = terms.hole == {REST} and bits & FLAG.LINGERS == 0\n"
        f"    if moves_on or (terms.hole == {FLIPS} and bits & FLAG.TURNED != 0):\n"
        "        car.journey_since = tick\n"
        "        car.journey_spent = car.journey_excused = car.journey_over = 0\n"
        "    long = tick - car.journey_since\n"
        "    if long < start:\n"
        f"        return tick + 1 if terms.hole == {REST} else car.journey_since + start\n",
    ),
    Change(
        "rules/duties.py",
        "    if not near:\n        find_waiting(b, tick, tables)\n",
        f"    if not near and tables.terms[b].hole != {QUEUE}:\n        find_waiting(b, tick, tables)\n",
    ),
    Change(
        "rules/referee_kernel.py",
        "    judge_turn(car, bits, lane, tick, log)\n",
        f"    if tables.terms[b].hole < {FLIPS} or (car.bits | bits) & FLAG.OVERTAKING == 0:\n"
        "        judge_turn(car, bits, lane, tick, log)\n",
    ),
    Change(
        "rules/parameters.py",
        "        return max(self.exit_gap, bodies * reach + 0.25 * self.exit_gap)\n",
        f"        if __import__('os').environ.get('{HOLE}') == '{EXIT}':\n            return self.exit_gap\n"
        "        return max(self.exit_gap, bodies * reach + 0.25 * self.exit_gap)\n",
    ),
    Change("rules/tables.py", "    turn_back: float\n", "    turn_back: float\n    hole: int\n"),
    Change(
        "rules/tables.py",
        "        row.turn_back = given.turn_back\n",
        "        row.turn_back = given.turn_back\n"
        f"        row.hole = int(__import__('os').environ.get('{HOLE}', '0'))\n",
    ),
    Change(
        "rules/location.py",
        "min(car.top, car.held_top), rules.turn_back",
        f"(car.top if rules.hole >= {FLIPS} else min(car.top, car.held_top)), rules.turn_back",
    ),
    Change("shield/tables.py", "    turn_back: float\n", "    turn_back: float\n    hole: int\n"),
    Change(
        "shield/tables.py",
        "        row.turn_back = rules.turn_back\n",
        "        row.turn_back = rules.turn_back\n"
        f"        row.hole = int(__import__('os').environ.get('{HOLE}', '0'))\n",
    ),
    Change(
        "shield/checks.py",
        "    if turned:\n        return REASON.TURN\n",
        f"    if shields.ego[b].hole >= {FLIPS} and (turned or (not fresh and after == lane)):\n"
        "        beside = False\n"
        "        for k in range(1, state.count[b]):\n"
        "            dx, dy = state.x[b, k] - pose.x, state.y[b, k] - pose.y\n"
        "            stands = np.int64(labels.bits[b, k]) & FLAG.STILL != 0\n"
        "            beside = beside or (stands and dx * dx + dy * dy < 0.64)\n"
        "        for p in range(traffic.obstacles.off[b], traffic.obstacles.off[b + 1]):\n"
        "            part = traffic.obstacles.parts[p]\n"
        "            dx, dy = part.x - pose.x, part.y - pose.y\n"
        "            beside = beside or dx * dx + dy * dy < 0.64\n"
        "        if beside and turned:\n"
        "            return REASON.NOTHING\n"
        "        if beside:\n"
        "            back = 4.0\n"
        "    if turned:\n        return REASON.TURN\n",
    ),
    Change(
        "shield/checks.py",
        "        return REASON.RETURN if bits & FLAG.LEFT != 0 else REASON.NOTHING\n",
        f"        left = bits & FLAG.LEFT != 0 and shields.ego[b].hole < {FLIPS}\n"
        "        return REASON.RETURN if left else REASON.NOTHING\n",
    ),
    Change(
        "shield/checks.py",
        "    if np.int64(labels.bits[b, EGO]) & FLAG.LEFT != 0 and labels.at[b, EGO] < 0:\n",
        "    left = np.int64(labels.bits[b, EGO]) & FLAG.LEFT != 0 and labels.at[b, EGO] < 0\n"
        f"    if left and shields.ego[b].hole >= {FLIPS}:\n"
        "        return REASON.NOTHING\n"
        "    if left:\n",
    ),
    Change(
        "agents/free.py",
        "    owes = owes or free_car.stopped_in >= 0 or bits & FLAG.LEFT != 0\n",
        f"    returns = bits & FLAG.LEFT != 0 and judging.rules[b].hole < {FLIPS}\n"
        "    owes = owes or free_car.stopped_in >= 0 or returns\n",
    ),
    Change(
        "agents/free.py",
        "APART: Final = 0.5\n",
        f"APART: Final = 0.5 if __import__('os').environ.get('{HOLE}') not in ('{FLIPS}', '{TURNS}') else 0.0\n",
    ),
)
"""What a copy differs in."""


def changed() -> dict[str, str]:
    """Return the texts of the modules that differ in a copy, by their paths in the package.

    Raises
    ------
    ValueError
        If a module has no such text, or has it twice: then the package has changed and `CHANGES` must follow.
    """
    found: dict[str, str] = {}
    for change in CHANGES:
        text = found.get(change.module) or (PACKAGE / change.module).read_text(encoding="utf-8")
        if text.count(change.old) != 1:
            raise ValueError(f"{change.module} holds {change.old!r} {text.count(change.old)} times, not once")
        found[change.module] = text.replace(change.old, change.new)
    return found


def plant(folder: Path) -> Path:
    """Copy the package into a folder, with the changed modules; return the folder, for the path of a process."""
    own = folder / PACKAGE.name
    if not own.exists():
        shutil.copytree(PACKAGE, own, ignore=shutil.ignore_patterns("__pycache__"))
    for module, text in changed().items():
        (own / module).write_text(text, encoding="utf-8")
    return folder


def digest() -> str:
    """Return a digest of the package with its changes: a name for the folder of a copy."""
    own = changed()
    texts = [
        own.get(path.relative_to(PACKAGE).as_posix()) or path.read_text(encoding="utf-8")
        for path in sorted(PACKAGE.rglob("*.py"))
    ]
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16]
