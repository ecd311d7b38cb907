"""Plays commands to a batch of trials through `act_batch`, of this tree or of an earlier one.

usage: act_batch_peer.py CONFIGURATION COMMANDS bare|learning

COMMANDS is an array (ticks, trials, 2) of the commands of trials 0, 1, ... of seed 1. If it is learning it also works
out, in NumPy, what a learner is to be shown and rewarded for, as far as it is told enough. The best of some rounds is
printed as a line of JSON: steps of trials, and the seconds of processor time that they took.
"""

from __future__ import annotations

import json
import sys
from time import process_time
from typing import Any

import numpy as np

import dubins_traffic as dt

SHOWN, ROUNDS = 5, 3
FLAGS = np.arange(18, dtype=np.uint32)
LEFT, OVERTAKING, ON_ROAD = 8, 16, 1
LEARNS = sys.argv[3] == "learning"


class Player:
    """Plays the commands."""

    commands = np.load(sys.argv[2])

    def start(self, problem: Any) -> None:
        """Nothing of the problem matters."""

    def act(self, observation: Any) -> None:
        """Give up: only batches are driven."""

    def start_batch(self, _trials: Any, problems: Any) -> None:
        """Note lanes and goals."""
        network = problems[0].network
        ends = np.stack([network.ends, network.ends[:, ::-1]], axis=1).reshape(-1, 2)
        self.first, self.last = network.points[ends[:, 0]], network.points[ends[:, 1]]
        self.length = np.repeat(network.lengths, 2)
        self.along = (self.last - self.first) / self.length[:, None]
        self.goals = np.array([problem.goal_vertices for problem in problems])
        self.points = network.points
        self.to_do = np.ones(self.goals.shape, dtype=bool)
        self.away = np.zeros(len(problems))
        self.left = np.zeros(len(problems), dtype=bool)

    def act_batch(self, view: Any) -> Any:
        """Return what is to be played."""
        if LEARNS:
            ego = in_frame(view, *(view.state.x[:, 0], view.state.y[:, 0]))
            np.concatenate([self.way(view, ego), cars(view)], axis=1).astype(np.float32)
        return self.commands[view.tick, view.trial]

    def way(self, view: Any, ego: Any) -> Any:
        """Return where the egos are on their lanes, the next crossing and the nearest goal to do; and the reward."""
        lane = np.where(view.labels.lane[:, 0] >= 0, view.labels.lane[:, 0], 2 * view.labels.segment[:, 0])
        centre = np.stack([view.state.x[:, 0], view.state.y[:, 0]], axis=1)
        away, (tx, ty) = centre - self.first[lane], self.along[lane].T
        c, s = view.state.c[:, 0], view.state.s[:, 0]
        progress, offset = away[:, 0] * tx + away[:, 1] * ty, tx * away[:, 1] - ty * away[:, 0]
        crossing = ego(*self.last[lane].T)
        far = np.hypot(*(self.points[self.goals] - centre[:, None]).transpose(2, 0, 1))
        visited = (self.goals == view.labels.at[:, :1]) & self.to_do
        self.to_do &= ~visited
        self.to_do[~self.to_do.any(axis=1)] = True
        best = np.where(self.to_do, far, np.inf).argmin(axis=1)
        rows = np.arange(len(lane))
        goal = ego(*self.points[self.goals[rows, best]].T)
        bits = view.labels.bits[:, 0]
        left = (bits & (LEFT | OVERTAKING)) == LEFT
        breaches = (left & ~self.left).astype(float) + ((bits & ON_ROAD) == 0)
        reward = visited.sum(axis=1) + 0.1 * (self.away - far[rows, best]) - breaches
        self.left, self.away = left, far[rows, best]
        own = [
            progress / self.length[lane],
            offset,
            tx * c + ty * s,
            tx * s - ty * c,
            far[rows, best],
            reward,
        ]
        return np.stack([*own, *crossing, *goal, self.to_do.mean(axis=1)], axis=1)


def in_frame(view: Any, x: Any, y: Any) -> Any:
    """Return what takes points, one or several a trial, into the egos' frames."""
    c, s = view.state.c[:, 0], view.state.s[:, 0]

    def taken(px: Any, py: Any) -> tuple[Any, Any]:
        dx, dy = px - x, py - y
        return c * dx + s * dy, c * dy - s * dx

    return taken


def cars(view: Any) -> Any:
    """Return speeds and propositions of the egos, and of the nearest cars, which are seen from the egos."""
    state, bits = view.state, view.labels.bits
    x, y, c, s = state.x, state.y, state.c, state.s
    dx, dy = x[:, 1:] - x[:, :1], y[:, 1:] - y[:, :1]
    apart = np.where(view.seen[:, 1:], dx * dx + dy * dy, np.inf)
    order = np.argsort(apart, axis=1, kind="stable")[:, :SHOWN]
    columns = (
        c[:, :1] * dx + s[:, :1] * dy,
        c[:, :1] * dy - s[:, :1] * dx,
        c[:, :1] * c[:, 1:] + s[:, :1] * s[:, 1:],
        c[:, :1] * s[:, 1:] - s[:, :1] * c[:, 1:],
        state.speed[:, 1:],
        state.yaw_rate[:, 1:],
        view.labels.lane[:, 1:] == view.labels.lane[:, :1],
        view.labels.crosses[:, 1:] == view.labels.crosses[:, :1],
    )
    near = np.stack([np.take_along_axis(column, order, axis=1) for column in columns], axis=-1)
    flags = (bits[..., None] >> FLAGS) & 1
    theirs = np.take_along_axis(flags[:, 1:], order[..., None], axis=1)
    seen = np.take_along_axis(view.seen[:, 1:], order, axis=1)[..., None]
    others = np.where(seen, np.concatenate([near, theirs], axis=-1), 0.0)
    own = np.concatenate([state.speed[:, :1], state.yaw_rate[:, :1], flags[:, 0]], axis=1)
    return np.concatenate([own, others.reshape(len(others), -1)], axis=1)


def main() -> None:
    """Measure, and print."""
    config = dt.load_config(sys.argv[1])
    ticks, trials = Player.commands.shape[:2]
    spent: list[float] = []
    for _ in range(1 + ROUNDS):
        began = process_time()
        done = dt.run_batch(config, Player, trials=trials, seed=1, batch=trials)
        spent.append(process_time() - began)
        if any(str(own.ending.end) != "duration" for own in done.outcomes):
            raise RuntimeError("trials were not run to their ends")
    print(json.dumps({"steps": ticks * trials, "seconds": min(spent[1:])}))


if __name__ == "__main__":
    main()
