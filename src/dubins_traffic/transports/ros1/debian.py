"""Makes Debian's ROS packages importable from a virtual environment, and nothing else of the system's."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from dubins_traffic.errors import DubinsTrafficError

DIST_PACKAGES = "/usr/lib/python3/dist-packages"
"""Where Debian keeps the Python packages of its own interpreter."""
_ROS = ("genmsg", "genpy", "roscpp", "rosgraph", "roslib", "rosmaster", "rospkg", "rospy")
_MESSAGES = ("actionlib", "geometry", "nav", "rosgraph", "sensor", "std", "tf2")
_NEEDED = ("catkin", "catkin_pkg", "defusedxml", "distro", "em", "netifaces", "pyparsing", "yaml", "_yaml")
PACKAGES = frozenset([*_ROS, *(f"{name}_msgs" for name in _MESSAGES), "std_srvs", *_NEEDED])
"""The ROS packages and what they need; a virtual environment's own packages of these names come first."""


class MissingRosError(DubinsTrafficError):
    """Debian's ROS packages are not installed."""

    def __init__(self, lacking: str) -> None:
        super().__init__(
            f"ROS 1 needs {lacking}: run scripts/system-packages.sh, or apt-get install python3-rospy "
            "python3-rosmaster python3-genpy python3-nav-msgs python3-sensor-msgs python3-std-srvs python3-tf2-msgs "
            "ros-geometry-msgs ros-std-msgs"
        )


class _Finder:
    """Finds modules of PACKAGES, and below `generated` the message packages that were made here."""

    def __init__(self) -> None:
        self.generated: list[str] = []
        self.names: set[str] = set()

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Look in the system's packages for those that are named, and nowhere else."""
        if path is not None:
            return None
        if name in self.names:
            return PathFinder.find_spec(name, self.generated, target)
        return PathFinder.find_spec(name, [DIST_PACKAGES], target) if name in PACKAGES else None


_finder = _Finder()


def enable() -> None:
    """Let Debian's ROS packages be imported from here on, after whatever the environment itself has."""
    if _finder not in sys.meta_path:
        sys.meta_path.append(_finder)


def add_generated(folder: str, names: Sequence[str]) -> None:
    """Let the message packages `names` below `folder` be imported, unless there are others of these names."""
    enable()
    _finder.generated = [folder]
    _finder.names = set(names)
    importlib.invalidate_caches()


def ros(module: str) -> Any:
    """Return a module of Debian's ROS packages.

    Raises
    ------
    MissingRosError
        If it is not installed.
    """
    enable()
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingRosError(error.name or module) from error
