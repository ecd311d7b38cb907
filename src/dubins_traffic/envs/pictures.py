"""Pictures of environments: arrays of pixels, or a page in the browser."""

from __future__ import annotations

from time import monotonic, sleep
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dubins_traffic.animation.live import LiveView
from dubins_traffic.animation.raster import NO_MARKS, Raster
from dubins_traffic.animation.raster_kernel import MARKS, Image
from dubins_traffic.cars.state import EGO
from dubins_traffic.errors import InputError
from dubins_traffic.rules.referee import accused

if TYPE_CHECKING:
    from dubins_traffic.engine.group import Group
    from dubins_traffic.envs.fleet import Fleet
    from dubins_traffic.kernels.arrays import Floats
    from dubins_traffic.learning.outlook import OutlookTables
    from dubins_traffic.problem.instance import Problem

MODES: Final = ("rgb_array", "human")
"""Ways to see an environment: as an array (H, W, 3) uint8, or in the browser, in real time."""
SIDE: Final = 400
"""Default number of pixels of a side."""


class Renderer:
    """Draws trials of environments as arrays, or on a page in the browser.

    Parameters
    ----------
    mode : str, optional
        One of `MODES`; without one nothing is shown.
    """

    def __init__(self, mode: str | None, width: int = SIDE, height: int = SIDE) -> None:
        if mode is not None and mode not in MODES:
            raise InputError("no such mode", field="render_mode", value=mode, expected=" or ".join(MODES))
        self._mode = mode
        self._size = width, height
        self._rasters: dict[int, tuple[Problem, Raster]] = {}
        self._view: LiveView | None = None
        self._due = 0.0

    def render(self, group: Group, b: int, outlook: OutlookTables, row: int, env: int = 0) -> Image | None:
        """Return or show the present frame of trial b of a group; None if it is shown, or nothing is.

        The row of `outlook` is the one that tells what its ego has visited; `env` is the number of the environment.
        """
        if self._mode is None:
            return None
        instance = group.instances[b]
        raster = self._raster(instance.problem, env)
        cars = slice(0, len(instance.starts))
        state: Any = group.state
        columns: list[Floats] = [array[b, cars] for array in state[:4]]
        x, y, c, s = columns
        picture = raster.frame(x, y, c, s, lit=_visited(outlook, row), marks=_marks(group, b))
        if self._mode == "rgb_array":
            return picture
        self._show(picture, 1.0 / instance.problem.rate)
        return None

    def _raster(self, problem: Problem, env: int) -> Raster:
        """Return the canvas for the problem of an environment's last or present trial."""
        kept = self._rasters.get(env)
        if kept is None or kept[0] is not problem:
            width, height = self._size
            kept = self._rasters[env] = problem, Raster(problem, width=width, height=height)
        return kept[1]

    def _show(self, picture: Image, pause: float) -> None:
        if self._view is None:
            self._view = LiveView()
        wait = self._due - monotonic()
        if wait > 0.0:
            sleep(min(wait, pause))
        self._view.show(picture)
        self._due = max(self._due + pause, monotonic())

    def render_all(self, fleet: Fleet) -> tuple[Image | None, ...]:
        """Return or show the present frames of the trials of all environments."""
        images: list[Image | None] = []
        for env in range(len(fleet)):
            bank, row = fleet.seat(env)
            images.append(self.render(bank.group, row, bank.outlook, row, env))
        return tuple(images)

    def close(self) -> None:
        """Close the page, if there is one."""
        if self._view is not None:
            self._view.close()
            self._view = None


def _visited(outlook: OutlookTables, row: int) -> list[int]:
    """Return the intersections of the goals that the ego of a trial, by its row, has visited in this round."""
    car = outlook.trial[row]
    rows = range(car.first_goal, car.last_goal)
    return [outlook.goal[k].vertex for k in rows if outlook.done[k]]


def _marks(group: Group, b: int) -> Floats:
    """Return the contacts and breaches of trial b so far, as marks of a picture."""
    contacts, breaches = group.contacts[b], group.breaches[b]
    if not contacts and not breaches:
        return NO_MARKS
    rate, now = group.instances[b].problem.rate, int(group.ticks[b])
    marks = [(one.x, one.y, MARKS.CONTACT, (now - one.tick) / rate) for one in contacts]
    marks += [
        (one.x, one.y, MARKS.OWN if one.car == EGO else MARKS.OTHERS, (now - one.tick) / rate)
        for one in (*breaches, *accused(contacts))
    ]
    return np.array(marks, dtype=np.float64)
