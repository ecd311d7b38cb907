"""A small competition for tests, and entries of every kind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dubins_traffic.competition.competition import Competition
from dubins_traffic.competition.judging import Judged

KEY = b"a passphrase of some length"
ROAD = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 2, "columns": 3, "length": 3.0}},
    "e-agents": [{"type": "lawful", "name": "car", "count": 1}],
    "duration": 20,
    "goals": [[0, 0], [1, 0]],
    "rules": True,
}
PRACTICE = {"seed": 1, "trials": 6, "shows": "all"}
TEST = {
    "seed": "secret",
    "trials": 6,
    "opens": "2026-01-01T00:00:00Z",
    "closes": "2026-02-01T00:00:00Z",
    "shows": "nothing",
}
VALIDATION = {**TEST, "shows": "aggregates", "least_trials": 4, "digits": 1, "log_lines": 2}


def document(**changes: Any) -> dict[str, Any]:
    return {
        "version": 0,
        "title": "Small",
        "configurations": [{"name": "road", "document": ROAD}],
        "phases": {"practice": PRACTICE, "validation": VALIDATION, "test": TEST},
        **changes,
    }


def competition(folder: Path | None = None, **changes: Any) -> Competition:
    return Competition.from_document(document(**changes), "small.toml", folder)


CONTROLLERS = {
    "rules": "from dubins_traffic.controllers.rules import Rules as Controller\n",
    "stands": "class Controller:\n def start(self, problem): pass\n def act(self, seen): return (0.0, 0.0)\n",
    "gives_up": "class Controller:\n def start(self, problem): pass\n def act(self, seen): return None\n",
    "crashes": "class Controller:\n def start(self, problem): pass\n def act(self, seen): return 1 / 0\n",
    "circles": "class Controller:\n def start(self, problem): pass\n def act(self, seen): return (0.3, 1.0)\n",
    "never_starts": "class Controller:\n def start(self, problem): raise OSError\n def act(self, seen): pass\n",
    "homes": """
class Controller:
    def start(self, problem):
        self.goals = [problem.network.points[v] for v in problem.goal_vertices]
        print(len(self.goals), "goals")

    def act(self, observation):
        x, y, c, s = observation.pose
        dx, dy = self.goals[0] - (x, y)
        if dx * dx + dy * dy < 0.25:
            self.goals.append(self.goals.pop(0))
        ahead, left = c * dx + s * dy, c * dy - s * dx
        return (0.0, 0.9) if ahead < abs(left) else (0.5, max(-0.9, min(left, 0.9)))
""",
    "speaks_lines": """#!/usr/bin/python3
import json, sys

for line in sys.stdin:
    message = json.loads(line)
    if "problem" in message:
        print(len(message["problem"]["goals"]), "goals", file=sys.stderr)
    elif "frame" in message:
        frame = message["frame"]
        turn = 0.1 * len(frame["others"]) - 0.01 * frame["pose"][0]
        print(json.dumps({"command": [0.3, turn], "tick": frame["tick"]}), flush=True)
    else:
        break
""",
}
"""The files of controllers: some that drive well or badly, one that is a program, and those that do not drive."""
IDLE = ("circles", "crashes", "gives_up", "never_starts", "stands")


def judged(number: int, **changes: Any) -> Judged:
    """Return a result without running anything; `changes` of its row, or of itself."""
    row = {
        "number": number,
        "end": "duration",
        "reason": None,
        "counted_rounds": 1,
        "rounds_before_breach": 1.0,
        "verdict": "satisfied",
        "clean": True,
        "collisions": 0,
        "icra2016": None,
        **{name: value for name, value in changes.items() if name not in ("owner", "log", "frames")},
    }
    own = {"owner": None, "log": "", "frames": None}
    own |= {name: changes[name] for name in own if name in changes}
    return Judged(number=number, row=row, end=row["end"], **own)


def results(values: Sequence[float]) -> list[Judged]:
    return [judged(k, counted_rounds=value) for k, value in enumerate(values)]
