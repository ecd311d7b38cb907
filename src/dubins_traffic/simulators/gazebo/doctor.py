"""Checks step by step whether Gazebo can be used."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from dubins_traffic.cars.body import Disc
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.simulators.gazebo import build, prefix
from dubins_traffic.simulators.gazebo.link import Kind, LostError
from dubins_traffic.simulators.gazebo.prefix import Installation
from dubins_traffic.simulators.gazebo.server import Server
from dubins_traffic.simulators.gazebo.vehicle import WHEEL_RADIUS
from dubins_traffic.simulators.gazebo.world import world

STEPS: Final = 200
SPEED: Final = 0.5
SLACK: Final = 0.01
"""Largest error of the car's position after `STEPS` steps of 5 ms at `SPEED` m/s, metres."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: whether it passed, and what was observed."""

    what: str
    well: bool
    seen: str


def examine(folder: Path) -> Iterator[Finding]:
    """Yield the checks of the installation in `folder`; after a failure those that depend on it are left out."""
    try:
        yield Finding("compiler", True, build.compiler())
    except InputError as error:
        yield Finding("compiler", False, str(error))
    try:
        installation = prefix.find(folder)
    except InputError as error:
        yield Finding("installation", False, str(error))
        return
    manifest = prefix.read_manifest(folder) or {}
    yield Finding("installation", True, str(folder))
    yield Finding("gzserver", True, f"{installation.gzserver}, version {manifest.get('gazebo')}")
    yield Finding("plugin", True, str(installation.plugin))
    try:
        drive_ahead(installation)
        yield Finding("one car drives ahead", True, f"{SPEED} m/s for 1 s")
    except InputError as error:
        yield Finding("one car drives ahead", False, str(error))


def drive_ahead(installation: Installation) -> None:
    """Start a server, let one car drive for a second, and end it.

    Raises
    ------
    InputError
        If anything of this fails, or the car is not where it should be.
    """
    text = world([Pose(0.0, 0.0, 1.0, 0.0)], Disc(), (), 1.0 / STEPS, str(installation.plugin))
    server = None
    try:
        server = Server(installation, text)
        rate = SPEED / WHEEL_RADIUS
        x, y = server.ask(Kind.STEP, np.array([STEPS, rate, rate]))[:2].tolist()
    except LostError as error:
        why = str(error) if server is None else server.explain(error)
        raise InputError(f"Gazebo does not work here ({why})", file=str(installation.gzserver)) from error
    finally:
        if server is not None:
            server.close()
    if abs(x - SPEED) > SLACK or abs(y) > SLACK:
        raise InputError(
            "Gazebo moves a car wrongly",
            file=str(installation.gzserver),
            value=(x, y),
            expected=f"({SPEED}, 0) to within {SLACK} m",
        )
