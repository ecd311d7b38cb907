"""A rule added to a copy of the package as docs/extending/rule.md says; as a program: what the copy says of it.

The rule is ``4.change``: the ego keeps its lane state for ``change_time``.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import dubins_traffic
from dubins_traffic.rules.breach_log import RULE, RULES
from tests.environments import SHORT, single, vector

NAME = "4.change"
CONFIG = {
    **SHORT,
    "e-agents": [],
    "obstacles": [{"disc": {"x": x, "y": y, "radius": 0.14}} for x, y in ((3, 6), (9, 6), (6, 3), (6, 9))],
    "duration": 10.0,
    "end_on_collision": False,
}
PARAMETER = '''    change_time: float = 60.0
    """So long a lane state is kept."""
'''
LOOK = '''@jit_inline
def judge_change(car: JudgedCar, lane: int, tick: int, terms: RefereeParameters, log: BreachLog) -> None:
    """Judge rule 4: a lane state is kept for `change_time`; `lane` is the car's in this frame."""
    if lane != car.lane:
        if 0 <= lasted(tick, car.lane_since) < terms.change_ticks:
            add(log, car, RULE.CHANGE, tick, car.lane_since, -1, lane)
        car.lane_since = tick


'''
SEED = 2
"""Here the ego leaves its lane and the road, and hits an obstacle, if it weaves as below."""


def copy_with_rule(folder: Path, number: int) -> None:
    """Copy the package to a folder, with the rule under a number, from 0 to the number of rules."""
    package = Path(dubins_traffic.__file__).parent
    own = folder / package.name
    shutil.copytree(package, own, ignore=shutil.ignore_patterns("__pycache__"))
    fields, names = list(RULE._fields), list(RULES)
    fields.insert(number, "CHANGE")
    names.insert(number, NAME)
    numbers = "".join(f"    {field}: int = {k}\n" for k, field in enumerate(fields))
    log = own / "rules" / "breach_log.py"
    _edit(log, r"    COLLISION: int = 0\n(    \w+: int = \d+\n)+", numbers)
    _edit(log, r"(?<=^RULES: Final\[tuple\[str, \.\.\.\]\] = )\([^)]*\)", repr(tuple(names)))
    last = '    approach_since: int = -1\n    """Run of approaching a crossing, as of the frame before."""\n'
    since = '    lane_since: int = -1\n    """Tick in which the lane state changed."""\n'
    _edit(log, re.escape(last), last + since)
    _edit(log, r"^    return_ticks: int\n", r"    change_ticks: int\n\g<0>")
    _edit(
        log,
        r"^        row\.return_ticks = .*\n",
        r"        row.change_ticks = ticks(given.change_time, rate)\n\g<0>",
    )
    _edit(own / "rules" / "parameters.py", r"^    crossing_degree: int = 3\n", f"{PARAMETER}\\g<0>")
    _edit(own / "rules" / "breaches.py", r"^@jit_inline\ndef judge_road\(", f"{LOOK}\\g<0>")
    kernel = own / "rules" / "referee_kernel.py"
    _edit(kernel, r"(?<=import judge_)entry(?=, )", "change, judge_entry")
    call = "    judge_change(car, lane, tick, tables.terms[b], log)\n"
    _edit(kernel, r"^    judge_turn\(car, bits, lane, tick, log\)\n", rf"\g<0>{call}")
    words = f'    "{NAME}": Words("changes its lane", "The ego keeps its lane for a minute."),\n'
    _edit(own / "rules" / "explained.py", r"^RULE_WORDS: .* = \{\n", rf"\g<0>{words}")


def changed(folder: Path) -> set[str]:
    """Return the files of the copy in a folder that are not as in the package, from there."""
    package = Path(dubins_traffic.__file__).parent
    own = folder / package.name
    files = {path.relative_to(own) for path in own.rglob("*.py")}
    return {path.as_posix() for path in files if (own / path).read_bytes() != (package / path).read_bytes()}


def _edit(file: Path, pattern: str, text: str) -> None:
    changed, count = re.subn(pattern, text, file.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert count == 1, (file, pattern)
    file.write_text(changed, encoding="utf-8")


def counted() -> dict[str, Any]:
    """Return what each kind of environment has charged for in an episode, and the breaches that its verdict names.

    Also what a search would tell of the last of these breaches, and whether it knows what to expect on these roads.
    """
    from dubins_traffic.envs.parallel import TrafficParallelEnv
    from dubins_traffic.falsification.case import sentence_of
    from dubins_traffic.falsification.coverage import possible

    one, many = single(CONFIG), vector(2, CONFIG, autoreset_mode="Disabled")
    agents = TrafficParallelEnv(CONFIG)
    one.reset(seed=SEED)
    many.reset(seed=[SEED, SEED])
    agents.reset(seed=SEED)
    ticks = range(int(CONFIG["duration"] * CONFIG["rate"]))
    actions = [np.array([0.9, 0.4 * np.sin(0.035 * k)], dtype=np.float32) for k in ticks]
    told = [one.step(action)[4] for action in actions]
    rows = [many.step(np.stack([action, action]))[4]["costs"][1] for action in actions]
    names = rows[0].dtype.names
    score = told[-1]["outcome"].score
    of_it = [own for own in score.verdict.violations if own.rule == NAME]
    record: Any = None  # only what is told of the package's own rules looks into it
    return {
        "sentences": [sentence_of(record, score, own) for own in of_it[-1:]],
        "expected": [cell.rule for cell in possible([told[-1]["trial"]])],
        "single": _sum(own["costs"] for own in told),
        "vector": _sum(dict(zip(names, row.tolist(), strict=True)) for row in rows),
        "agents": _sum(agents.step({"ego_0": action})[4]["ego_0"]["costs"] for action in actions),
        "verdict": Counter(own.rule for own in score.verdict.violations if own.tick > 0),
    }


def _sum(costs: Iterable[Mapping[str, float]]) -> dict[str, float]:
    total: Counter[str] = Counter()
    for own in costs:
        total.update(own)
    return dict(total)


if __name__ == "__main__":
    json.dump(counted(), sys.stdout)
