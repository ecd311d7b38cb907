"""Writes road networks as worlds for Gazebo, as the program genroad did in 2016."""

from __future__ import annotations

import math
from enum import StrEnum
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Final
from xml.etree.ElementTree import Element

from dubins_traffic.files import packed, require_output, write_text
from dubins_traffic.problem.instance import Instance
from dubins_traffic.simulators.gazebo.roads import roads
from dubins_traffic.simulators.gazebo.sdf import numbers, pose, tag, text, visual
from dubins_traffic.simulators.gazebo.world import bodies, ground

if TYPE_CHECKING:
    from dubins_traffic.roads.network import RoadNetwork

GRASS: Final = (0.35, 0.45, 0.3)


class Version(StrEnum):
    """Versions of SDF: that of Gazebo 11 and older, and that of the Gazebos after it."""

    CLASSIC = "1.6"
    NEW = "1.9"


def to_sdf(what: RoadNetwork | Instance, version: Version = Version.CLASSIC) -> str:
    """Return a world with ground, light, and a road with its marker for each segment.

    Parameters
    ----------
    what : RoadNetwork or Instance
        Whose roads are made; of an instance also its obstacles, and its cars where they start.
    version : Version
        Of SDF.
    """
    if isinstance(what, Instance):
        problem = what.problem
        models = [*roads(problem.network), *bodies(what.starts, problem.car.body, problem.obstacles)]
    else:
        models = roads(what)
    world = tag("world", numbers("gravity", 0.0, 0.0, -9.81), _sun(), _grass(), *models, name="roads")
    return text(tag("sdf", world, version=version.value))


def _grass() -> Element:
    plane = tag("geometry", tag("plane", numbers("normal", 0, 0, 1), numbers("size", 1000, 1000)))
    earth = ground()
    link = earth.find("link")
    assert link is not None
    link.append(visual("grass", pose(0.0, 0.0, 0.0), plane, GRASS))
    return earth


def outlook(network: RoadNetwork) -> list[Element]:
    """Return the elements that make a trial visible: light, roads, and a camera that sees all of them."""
    low, high = network.points.min(axis=0), network.points.max(axis=0)
    x, y = (0.5 * (low + high)).tolist()
    away = 3.0 + 1.2 * float((high - low).max())
    camera = tag("camera", pose(x, y - 0.5 * away, away, 0.0, 1.1, 0.5 * math.pi), name="view")
    return [tag("gui", camera), _sun(), *roads(network)]


def write_sdf(
    what: RoadNetwork | Instance,
    path: str | PathLike[str],
    version: Version = Version.CLASSIC,
    *,
    overwrite: bool = False,
) -> None:
    """Write `to_sdf` to a file `*.sdf`, whole or not at all.

    Raises
    ------
    InputError
        If the path is refused (`files.require_output`), or the file can't be written.
    """
    require_output(path, "a world", packed(".sdf"), overwrite=overwrite)
    write_text(Path(path), to_sdf(what, version))


def _sun() -> Element:
    return tag(
        "light",
        pose(0.0, 0.0, 10.0),
        tag("cast_shadows", "false"),
        numbers("diffuse", 0.8, 0.8, 0.8, 1.0),
        numbers("specular", 0.1, 0.1, 0.1, 1.0),
        numbers("direction", -0.3, 0.2, -1.0),
        name="sun",
        type="directional",
    )
