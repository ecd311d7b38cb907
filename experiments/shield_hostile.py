"""Egos that drive as they should not, many at a time: what `experiments.shield` puts under the shield."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Labels, State
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows
from dubins_traffic.policies.rules.tables import Vehicle
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.routing.lane_graph import foot
from dubins_traffic.rules.propositions import FLAG

LAG = 15
"""By how many ticks `lags` drives late."""


class Scene(NamedTuple):
    """What the drivers of one kind are shown in a tick; K trials.

    `law` (K, 2): what the law of the road says; `fast`, `slow`, `most` (K,): largest and smallest speed and largest
    yaw rate; `wild` (K, 2): a command at random, a third out of bounds; `dice` (K,) in [0, 1). `pose` (K, 4): x, y,
    cos, sin. `lane` (K, 4): direction of the lane, lateral offset in it, half its width. `left` (K,): 1 across the
    centre line. `other` (K, 2): toward the nearest other car. `memory` (K, 3): their own.
    """

    tick: int
    law: Floats
    fast: Floats
    slow: Floats
    most: Floats
    wild: Floats
    dice: Floats
    pose: Floats
    lane: Floats
    left: Floats
    other: Floats
    memory: Floats


def hold(scene: Scene, command: Floats, ticks: Floats) -> Floats:
    """Return the command held, and take a new one for so many ticks where its time is up."""
    over = scene.tick >= scene.memory[:, 2]
    scene.memory[over, :2] = command[over]
    scene.memory[over, 2] = scene.tick + ticks[over]
    return scene.memory[:, :2].copy()


def head(scene: Scene, hx: Floats, hy: Floats) -> Floats:
    """Return commands that drive on while turning to directions (hx, hy)."""
    c, s = scene.pose[:, 2], scene.pose[:, 3]
    cross, dot = c * hy - s * hx, c * hx + s * hy
    back = dot < 0.0
    yaw = np.where(back, np.where(cross >= 0.0, scene.most, -scene.most), 8.0 * cross)
    return np.stack([np.where(back, 0.3, 1.0) * scene.fast, yaw], axis=1)


def follow(scene: Scene, middle: float, along: float = 1.0) -> Floats:
    """Return commands along a line of the lane, `middle` times half its width to the left, or against it."""
    tx, ty, left, half = along * scene.lane.T
    slant = np.clip(3.0 * (middle * np.abs(half) - left), -0.8, 0.8)
    return head(scene, tx - slant * ty, ty + slant * tx)


def jitter(scene: Scene) -> Floats:
    """Commands at random, anew in each tick."""
    return scene.wild


def held(scene: Scene) -> Floats:
    """Commands at random, each for up to 2 s."""
    return hold(scene, scene.wild, 60.0 * scene.dice)


def rams(scene: Scene) -> Floats:
    """Toward the nearest car."""
    return head(scene, *scene.other.T)


def left(scene: Scene) -> Floats:
    """Along the lane on the left."""
    return follow(scene, 1.0)


def straddles(scene: Scene) -> Floats:
    """Along the centre line."""
    return follow(scene, 0.0)


def runs(scene: Scene) -> Floats:
    """As the law says, but never slower than at full speed."""
    return np.stack([scene.fast, scene.law[:, 1]], axis=1)


def reverses(scene: Scene) -> Floats:
    """Backward."""
    return np.stack([scene.slow, 0.3 * scene.wild[:, 1]], axis=1)


def broken(scene: Scene) -> Floats:
    """As the law says, but in every fifth tick numbers that are none, or beyond all bounds."""
    asked = scene.law.copy()
    asked[scene.dice < 0.05, 0] = np.nan
    asked[(scene.dice > 0.05) & (scene.dice < 0.1), 1] = -np.inf
    asked[(scene.dice > 0.1) & (scene.dice < 0.15)] = 1e308, -1e308
    asked[(scene.dice > 0.15) & (scene.dice < 0.2)] = -1e300, np.nan
    return asked


def teases(scene: Scene) -> Floats:
    """As the law says, but for half a second now and then."""
    kick = scene.dice < 0.02
    return hold(scene, np.where(kick[:, None], scene.wild, scene.law), np.where(kick, 15.0, 1.0))


def circles(scene: Scene) -> Floats:
    """On a circle."""
    return np.stack([scene.fast, 0.15 * scene.most], axis=1)


def dithers(scene: Scene) -> Floats:
    """At the law's speed with yaw rates at random."""
    return np.stack([scene.law[:, 0], scene.wild[:, 1]], axis=1)


def wrong(scene: Scene) -> Floats:
    """Against the lane."""
    return follow(scene, 1.0, -1.0)


def blind(scene: Scene) -> Floats:
    """Along the lane at full speed, straight on through everything."""
    return follow(scene, -1.0)


def dawdles(scene: Scene) -> Floats:
    """As the law says for two seconds, then standing for eight."""
    return scene.law if scene.tick % 300 < 60 else np.zeros_like(scene.law)


def halts(scene: Scene) -> Floats:
    """As the law says until something takes its fancy: then standing for up to four seconds."""
    stop = scene.dice < 0.01
    return hold(scene, np.where(stop[:, None], 0.0, scene.law), np.where(stop, 12000.0 * scene.dice, 1.0))


def quits(scene: Scene) -> Floats:
    """As the law says until the centre line is crossed; then at random for up to two seconds each, until it is not."""
    across = scene.left > 0.0
    return hold(scene, np.where(across[:, None], scene.wild, scene.law), np.where(across, 60.0 * scene.dice, 1.0))


def lingers(scene: Scene) -> Floats:
    """As the law says, but half pulled out it stands for up to eight seconds now and then."""
    stop = (scene.lane[:, 2] > -0.9 * scene.lane[:, 3]) & (scene.dice < 0.03)
    return hold(scene, np.where(stop[:, None], 0.0, scene.law), np.where(stop, 8000.0 * scene.dice, 1.0))


DRIVERS: tuple[Callable[[Scene], Floats], ...] = (
    jitter, held, rams, left, straddles, runs, reverses, broken, teases, circles, dithers, wrong, blind,
    dawdles, halts, quits, lingers,
)  # fmt: skip
KINDS = (*(driver.__name__ for driver in DRIVERS), "lags")
"""`lags` does what the law said half a second ago."""


class Hostile:
    """The drivers of some trials.

    Parameters
    ----------
    kinds
        Which of KINDS drives in each trial.
    vehicles, net
        `Drivers.vehicle`, and the number of each trial's network in `roads`.
    roads
        The roads.
    seed
        What all random numbers follow from.
    """

    def __init__(self, kinds: Sequence[str], vehicles: Rows[Vehicle], net: Ints, roads: RoadTable, seed: int) -> None:
        self._rows: dict[str, npt.NDArray[np.intp]] = {
            kind: np.array([b for b, own in enumerate(kinds) if own == kind]) for kind in dict.fromkeys(kinds)
        }
        self._vehicles, self._net, self._roads = vehicles, net, roads
        self._random = np.random.default_rng(seed)
        self._memory = np.full((len(kinds), 3), -1.0)
        self._late = np.zeros((LAG, len(kinds), 2))

    def ask(self, tick: int, state: State, labels: Labels, law: Floats) -> Floats:
        """Return what each ego is asked to do in frame `tick`, (B, 2), where the law says `law`."""
        own = self._vehicles
        bounds = np.stack([own["fastest"], own["yaw_most"]], axis=1)
        wild = 1.5 * bounds * self._random.uniform(-1.0, 1.0, law.shape)
        dice = self._random.uniform(size=len(law))
        pose = np.stack([array[:, EGO] for array in state[:4]], axis=1)
        scene = Scene(
            tick, law, own["fastest"].copy(), own["slowest"].copy(), own["yaw_most"].copy(), wild, dice, pose,
            self._lane(pose, labels), np.where(labels.bits[:, EGO] & FLAG.LEFT, 1.0, 0.0), _toward(state),
            self._memory,
        )  # fmt: skip
        asked = law.copy()
        for driver in DRIVERS:
            rows = self._rows.get(driver.__name__)
            if rows is not None:
                own = Scene(tick, *(array[rows] for array in scene[1:]))
                asked[rows] = driver(own)
                self._memory[rows] = own.memory
        late = self._late[tick % LAG].copy()
        self._late[tick % LAG] = law
        rows = self._rows.get("lags", [])
        asked[rows] = late[rows]
        return asked

    def _lane(self, pose: Floats, labels: Labels) -> Floats:
        """Return `Scene.lane`; in a disc, of the nearest segment along the heading."""
        x, y, c, s = pose.T
        segment, lane = labels.segment[:, EGO], labels.lane[:, EGO]
        row = self._roads.segment[self._roads.seg_off[self._net] + np.where(lane < 0, segment, lane >> 1)]
        forth = np.where(lane < 0, c * row["tx"] + s * row["ty"] >= 0.0, lane % 2 == 0)
        sign = np.where(forth, 1.0, -1.0)
        tx, ty = sign * row["tx"], sign * row["ty"]
        across = tx * (y - row["y"]) - ty * (x - row["x"])
        for b in np.flatnonzero(row["piece"] >= 0).tolist():
            own = 2 * int(segment[b]) if lane[b] < 0 else int(lane[b])
            _, left, ux, uy, _ = foot(self._roads, int(self._net[b]), own, float(x[b]), float(y[b]))
            away = lane[b] < 0 and ux * c[b] + uy * s[b] < 0.0
            tx[b], ty[b], across[b] = (-ux, -uy, -left) if away else (ux, uy, left)
        return np.stack([tx, ty, across, self._vehicles["middle"]], axis=1)


def _toward(state: State) -> Floats:
    """Return the unit vectors from the egos to the nearest other cars, (B, 2); ahead where there is none."""
    dx, dy = state.x - state.x[:, :1], state.y - state.y[:, :1]
    far2 = dx * dx + dy * dy
    far2[np.arange(state.x.shape[1]) >= state.count[:, None]] = np.inf
    far2[:, EGO] = np.inf
    n = far2.argmin(axis=1)
    rows = np.arange(len(n))
    far = np.sqrt(far2[rows, n])
    alone = ~np.isfinite(far)
    far = np.where(alone | (far == 0.0), 1.0, far)
    x, y = dx[rows, n] / far, dy[rows, n] / far
    return np.stack([np.where(alone, state.c[:, EGO], x), np.where(alone, state.s[:, EGO], y)], axis=1)
