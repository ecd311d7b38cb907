"""Twelve mutants of the controller `rules`: each breaks one clause in a corner that random trials hardly ever meet.

A mutant sees the road as `rules` does, but for one thing that it gets wrong, and then does what the law says. It drives
all trials of a batch at once (`engine.controlled.BatchController`), through the compiled law.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from dubins_traffic.agents.choices import drawn, with_choices
from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.policies.rules.room import MARGIN
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.rules.propositions import FLAG
from tests.mutated import Mask, Mutant, Seen

LINE = 0.03 + MARGIN
"""Metres by which the line is nearer, for a stop 3 cm inside the disc."""
CLOSE = 0.9
"""Metres between centres at which a mutant swerves."""


class Ticketed(Mutant):
    """A mutant with an order of arrival of its own, which follows from when it saw cars stop."""

    group = 0.1

    def see(self, view: Seen) -> None:
        stopped, known = view.has(FLAG.STOPPED), view.block.tickets[view.rows]
        known = np.where(stopped, np.where(known < 0, view.tick[:, None], known), -1)
        view.block.tickets[view.rows] = known
        ticks = (self.group * view.block.rates[view.rows])[:, None]
        there = view.at_ego()
        tied = there & (np.abs(known - known[:, :1]) <= ticks)
        before = there & ~tied & (known < known[:, :1])
        goes = stopped[:, EGO] & tied.any(axis=1) & ~before.any(axis=1) & self.wins(view, tied)
        view.set(goes, FLAG.FIRST, FLAG.AHEAD)

    def wins(self, view: Seen, tied: Mask) -> Mask:
        """Tell whether the ego goes before all with whom it is tied, (K, N)."""
        raise NotImplementedError


class TieByIndex(Ticketed):
    """Of those who arrive together it goes first, whoever is on its right."""

    def wins(self, view: Seen, tied: Mask) -> Mask:
        return tied.any(axis=1) & view.has(FLAG.STOPPED)[:, EGO]


class TieByLeft(Ticketed):
    """Of those who arrive together it lets the left go first, and goes before the right."""

    def wins(self, view: Seen, tied: Mask) -> Mask:
        _, bearing = view.bearings()
        return ~(tied & (bearing > 0.15)).any(axis=1)


class WideGroup(Ticketed):
    """It takes those for arrived together who came within 0.6 s."""

    group = 0.6

    def wins(self, view: Seen, tied: Mask) -> Mask:
        _, bearing = view.bearings()
        return ~(tied & (bearing < -0.15)).any(axis=1)


class ForgetsForfeit(Mutant):
    """Who was first at a crossing stays so, it thinks, though it has lost its place."""

    def see(self, view: Seen) -> None:
        stopped, first = view.has(FLAG.STOPPED)[:, EGO], view.has(FLAG.FIRST)[:, EGO]
        latched = stopped & (first | view.block.latched[view.rows])
        view.block.latched[view.rows] = latched
        view.set(latched, FLAG.FIRST, FLAG.AHEAD)


class StopsLate(Mutant):
    """It stops 3 cm inside the disc where others have stopped already."""

    def see(self, view: Seen) -> None:
        late = view.at_ego().any(axis=1)
        usual = view.block.vehicle["disc"]
        view.block.drivers.vehicle["disc"][:] = usual
        rows = view.rows[late]
        view.block.drivers.vehicle["disc"][rows] = usual[rows] - LINE


class BlindSector(Mutant):
    """It does not see who is in a sector of 58 degrees on its right.

    From the line nobody is farther right than 45 degrees who is still in the disc: a sector that begins behind that
    hides nothing.
    """

    low, high = -1.75, -0.74

    def see(self, view: Seen) -> None:
        _, bearing = view.bearings()
        blind = view.seen & (bearing > self.low) & (bearing < self.high)
        blind[:, EGO] = False
        within = view.labels.crosses == view.end[:, :1]
        inside = within & view.seen & (view.end[:, :1] >= 0)
        inside[:, EGO] = False
        clear = (inside & blind).any(axis=1) & ~(inside & ~blind).any(axis=1)
        view.set(clear, FLAG.CLEAR)
        view.seen[blind] = False


class ClearEarly(Mutant):
    """It takes a crossing for clear one frame before the last car leaves it."""

    def see(self, view: Seen) -> None:
        inside = (view.labels.crosses == view.end[:, :1]) & view.seen & (view.end[:, :1] >= 0)
        inside[:, EGO] = False
        block, rows = view.block, view.rows
        points = block.points[rows, np.maximum(view.end[:, EGO], 0)]
        edge = block.radius[rows] + block.reach[rows]
        far = view.state.speed / block.rates[rows, None]
        x = view.state.x + far * view.state.c - points[:, :1]
        y = view.state.y + far * view.state.s - points[:, 1:]
        leaves = np.hypot(x, y) >= edge[:, None]
        view.set(inside.any(axis=1) & ~(inside & ~leaves).any(axis=1), FLAG.CLEAR)


class LeftLong(Mutant):
    """It does not come back before it has been on the left for 12 s, where there is a car to pass."""

    def see(self, view: Seen) -> None:
        left = view.has(FLAG.LEFT)[:, EGO]
        since = view.block.since
        since[view.rows] = np.where(left, np.where(since[view.rows] < 0, view.tick, since[view.rows]), -1)
        rates = view.block.rates[view.rows]
        waits = left & (view.tick - since[view.rows] < 12.0 * rates)
        view.block.latched[view.rows] = waits

    def driven(self, view: Seen, answer: Floats) -> Floats:
        block, rows = view.block, view.rows
        waits = block.latched[rows] & (view.tick - block.since[rows] > block.rates[rows])
        return np.where(waits[:, None], 0.0, answer)


class ReturnsEarly(Mutant):
    """While it passes it does not mind whom it passes, and comes back into him."""

    def see(self, view: Seen) -> None:
        away, bearing = view.bearings()
        beside = (bearing < -0.8) & (bearing > -2.9) & (away < 1.2) & view.has(FLAG.LEFT)[:, :1]
        beside[:, EGO] = False
        view.seen[beside] = False
        view.block.drivers.car["aside"][view.rows[beside.any(axis=1)], EGO] = 0.0


class StopsShort(Mutant):
    """It thinks that it has stopped 0.2 s before it has, where others come to the crossing, too."""

    def see(self, view: Seen) -> None:
        still = view.has(FLAG.APPROACH)[:, EGO] & (np.abs(view.state.speed[:, EGO]) < 1e-3)
        since = view.block.since
        since[view.rows] = np.where(still, np.where(since[view.rows] < 0, view.tick, since[view.rows]), -1)
        rates = view.block.rates[view.rows]
        others = (view.end == view.end[:, :1]) & view.has(FLAG.APPROACH) & (view.end >= 0)
        soon = still & (view.tick - since[view.rows] >= 0.3 * rates) & (others.sum(axis=1) > 1)
        soon &= ~view.at_ego().any(axis=1)
        view.set(soon & ~view.has(FLAG.STOPPED)[:, EGO], FLAG.STOPPED | FLAG.FIRST)


class Swerves(Mutant):
    """It swerves to the left of who drives close ahead of it."""

    def driven(self, view: Seen, answer: Floats) -> Floats:
        x, y, c, s = view.state.x, view.state.y, view.state.c, view.state.s
        dx, dy = x - x[:, :1], y - y[:, :1]
        along = dx * c[:, :1] + dy * s[:, :1]
        lane = view.labels.lane
        ahead = view.seen & (lane == lane[:, :1]) & (lane >= 0) & (along > 0.1) & (np.hypot(dx, dy) < CLOSE)
        ahead &= view.labels.bits & np.uint32(FLAG.STANDS | FLAG.EXCUSED | FLAG.APPROACH) == 0
        near = np.flatnonzero(ahead.any(axis=1) & (view.labels.crosses[:, EGO] < 0))
        who = ahead[near].argmax(axis=1)
        turn = np.arcsin(np.clip(c[near, 0] * s[near, who] - s[near, 0] * c[near, who], -1.0, 1.0)) + 0.6
        answer[near, 0] = 0.35
        answer[near, 1] = np.clip(3.0 * turn, -0.9, 0.9)
        return answer


class ForgetsStanding(Mutant):
    """It takes who has not moved for ten seconds for a part of the road."""

    def see(self, view: Seen) -> None:
        standing = view.has(FLAG.STILL) & view.has(FLAG.LINGERS)
        standing[:, EGO] = False
        view.seen[standing] = False


class Planted(NamedTuple):
    """A mutant, and the rules that it breaks: the first it is made for."""

    kind: type[Mutant]
    rules: tuple[str, ...]


MUTANTS: dict[str, Planted] = {
    "tie_by_index": Planted(TieByIndex, ("3.order",)),
    "tie_by_left": Planted(TieByLeft, ("3.order",)),
    "wide_group": Planted(WideGroup, ("3.order",)),
    "forgets_forfeit": Planted(ForgetsForfeit, ("3.order",)),
    "stops_late": Planted(StopsLate, ("3.stop",)),
    "stops_short": Planted(StopsShort, ("3.stop",)),
    "blind_sector": Planted(BlindSector, ("3.clear", "1.collision")),
    "clear_early": Planted(ClearEarly, ("3.clear",)),
    "left_long": Planted(LeftLong, ("2.return",)),
    "swerves": Planted(Swerves, ("2.left",)),
    "returns_early": Planted(ReturnsEarly, ("2.return", "1.collision")),
    "forgets_standing": Planted(ForgetsStanding, ("1.collision",)),
}
"""The mutants by name."""


def case(number: int, seconds: float = 60.0) -> Instance:
    """Return the random case of a number: four e-agents that keep the rules and do what random tables choose."""
    networks: tuple[dict[str, Any], ...] = (
        {"grid": {"rows": 3, "columns": 3, "length": 4.0}},
        {"random": {"intersections": 8, "segments": 10}},
        {"grid": {"rows": 2, "columns": 3, "length": 3.0}},
    )
    drawn_from = load_config(
        {
            "version": 1, "problem_domain": "dubins_traffic", "network": networks[number % len(networks)], "rules": {},
            "e-agents": [{"type": "lawful", "name": "a", "count": 4}], "number_trials": 5,
            "number_goals_bounds": [1, 3], "duration_bounds": [60, 60],
        }
    )  # fmt: skip
    dice = np.random.default_rng(number)
    chosen = with_choices(draw(drawn_from, 7, number), {n: drawn(dice, 12, 0.4) for n in range(1, 5)})
    return replace(chosen, duration=seconds)
