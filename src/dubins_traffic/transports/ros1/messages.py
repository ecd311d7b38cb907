"""The message packages of ROS 1: Debian's made importable, and those that it lacks made by its own generators.

The definitions lie beside this file. Of the system's packages nothing but ROS becomes importable.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Generator, Mapping, Sequence
from functools import cache, partial
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from platformdirs import user_cache_path

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.files import exists, make_folder, replace_file, require_output

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
    """Return a module of Debian's ROS packages; MissingRosError if it is not installed."""
    enable()
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingRosError(error.name or module) from error


DEFINITIONS = Path(__file__).parent / "definitions"
SHARE = Path("/usr/share")
"""Where Debian keeps the definitions of its own messages."""
NEEDED = ("geometry_msgs", "std_msgs")
GENCPP = Path("/usr/lib/gencpp/gen_cpp.py")

MD5: Mapping[str, str] = {
    "gazebo_msgs/ModelStates": "48c080191eb15c41858319b4d8a609c2",
    "gazebo_msgs/ModelState": "9330fd35f2fcd82d457e54bd54e10593",
    "integrator_chains_msgs/ProblemInstanceJSON": "b54d5cdbf1a54655f656ec2388ee6dbf",
    "dubins_traffic_msgs/LabelStamped": "4f776b85a85eab24a9e56d49901c91b9",
    "dubins_traffic_msgs/RoadNetworkJSON": "1883c937699fd766d0fdabe4f94ae976",
    "dubins_traffic_msgs/MMode": "99642e43b6218c95c7eccdcbb2800824",
}
"""Sums by which ROS tells whether two programs mean the same message; those of 2016."""


def packages() -> list[str]:
    """Return the names of the packages that are made here."""
    return sorted(folder.name for folder in DEFINITIONS.iterdir() if folder.is_dir())


def definitions() -> list[Path]:
    """Return the files of all definitions, messages before services."""
    return sorted(DEFINITIONS.glob("*/msg/*.msg")) + sorted(DEFINITIONS.glob("*/srv/*.srv"))


@cache
def load() -> Any:
    """Return the classes of all messages used here, as attributes: Twist, Odometry, ModelStates, ...

    Those that Debian lacks are made on first use, into the user's cache.

    Raises
    ------
    MissingRosError
        If Debian's generators or messages are not installed.
    DubinsTrafficError
        If a package of the same name is installed whose messages are not those of 2016.
    """
    add_generated(str(_generated()), packages())
    messages = SimpleNamespace()
    for module, names in _USED.items():
        source = ros(module)
        for name in names.split():
            setattr(messages, name, getattr(source, name))
    for kind, expected in MD5.items():
        name = kind.partition("/")[2]
        if getattr(messages, name)._md5sum != expected:
            raise DubinsTrafficError(f"the installed {kind} is not that of 2016: its md5 sum is not {expected}")
    return messages


_USED = {
    "geometry_msgs.msg": "Pose Point Quaternion PoseStamped Transform TransformStamped Twist Vector3",
    "nav_msgs.msg": "Odometry",
    "rosgraph_msgs.msg": "Clock",
    "sensor_msgs.msg": "LaserScan",
    "std_msgs.msg": "Header",
    "std_srvs.srv": "Empty EmptyResponse",
    "tf2_msgs.msg": "TFMessage",
    "gazebo_msgs.msg": "ModelStates ModelState",
    "integrator_chains_msgs.msg": "ProblemInstanceJSON",
    "dubins_traffic_msgs.msg": "LabelStamped RoadNetworkJSON",
    "dubins_traffic_msgs.srv": "MMode MModeResponse",
}


def _generated() -> Path:
    """Return the folder with the Python packages of our messages, made unless it is there."""
    genpy = ros("genpy")
    key = hashlib.sha256(str(genpy.__file__).encode() + str(getattr(genpy, "__version__", "")).encode())
    for file in definitions():
        key.update(file.name.encode() + file.read_bytes())
    folder = user_cache_path("dubins-traffic") / "ros1" / key.hexdigest()[:16]
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as made:
            write_python(Path(made) / "new")
            with contextlib.suppress(OSError):  # another process was first, with the same content
                (Path(made) / "new").rename(folder)
    return folder


@contextlib.contextmanager
def _put(folder: Path, suffix: str, *, overwrite: bool) -> Generator[Path]:
    """Let files be made in the folder given, elsewhere; then write them below `folder`, if none may not be written."""
    with tempfile.TemporaryDirectory() as made:
        yield Path(made)
        made_files = sorted(path.relative_to(made) for path in Path(made).rglob(f"*{suffix}"))
        for name in made_files:
            if exists(folder / name):
                require_output(folder / name, "messages", (suffix,), overwrite=overwrite)
        for parent in {name.parent for name in made_files}:
            make_folder(folder / parent, "messages")
        for name in made_files:
            replace_file(folder / name, partial(shutil.copyfile, Path(made) / name))


def write_python(folder: Path, *, overwrite: bool = False) -> None:
    """Write our messages as Python packages below `folder`.

    InputError if a file is there and `overwrite` is not given, or it can't be written; MissingRosError if Debian's
    generator or the definitions that ours use are not installed.
    """
    generator, write_modules = ros("genpy.generator"), ros("genpy.generate_initpy").write_modules
    search = _search_path()
    with _put(folder, ".py", overwrite=overwrite) as made:
        for package in packages():
            for kind, make in (("msg", generator.MsgGenerator), ("srv", generator.SrvGenerator)):
                files = sorted(map(str, (DEFINITIONS / package / kind).glob("*." + kind)))
                if not files:
                    continue
                target = made / package / kind
                target.mkdir(parents=True)
                if make().generate_messages(package, files, str(target), search):
                    raise DubinsTrafficError(f"genpy could not generate {package}")
                write_modules(str(target))
            (made / package / "__init__.py").touch()


def write_cpp(folder: Path, *, overwrite: bool = False) -> None:
    """Write our messages as C++ headers below `folder`, for a compiler's -I.

    InputError if a file is there and `overwrite` is not given, or it can't be written; MissingRosError if Debian's
    generator for C++ is not installed.
    """
    if not GENCPP.is_file():
        raise MissingRosError("python3-gencpp")
    include = [f"-I{name}:{path}" for name, paths in _search_path().items() for path in paths]
    with _put(folder, ".h", overwrite=overwrite) as made:
        for file in definitions():
            package = file.parent.parent.name
            target = made / package
            target.mkdir(exist_ok=True)
            command = ["/usr/bin/python3", str(GENCPP), str(file), "-p", package, "-o", str(target), *include]
            _run([*command, "-e", str(SHARE / "gencpp")])


def _run(command: Sequence[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise DubinsTrafficError(f"{Path(command[1]).name} failed: {done.stderr.strip()[-500:]}")


def _search_path() -> dict[str, list[str]]:
    folders_of = {name: [str(DEFINITIONS / name / "msg")] for name in packages()}
    for name in NEEDED:
        folder = SHARE / name / "msg"
        if not folder.is_dir():
            raise MissingRosError(f"ros-{name.replace('_', '-')}")
        folders_of[name] = [str(folder)]
    return folders_of
