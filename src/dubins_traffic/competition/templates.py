"""Folders to begin from: a competition, submissions in Python and C++, and a package of nodes of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from dubins_traffic.errors import InputError
from dubins_traffic.files import write_text

_SUFFIX = ".txt"
"""What the names of shipped files end in, so that no tool takes them for a part of this package."""


def template_files(kind: str) -> dict[str, str]:
    """Return the files of a template by name; `kind` is ``competition``, ``python``, ``cpp`` or ``ros2``.

    InputError if there is none of that kind.
    """
    folder = files("dubins_traffic.competition") / "templates" / kind
    if not folder.is_dir():
        raise InputError("no such template", value=kind, expected="competition, python, cpp or ros2")
    return {name.removesuffix(_SUFFIX): text for name, text in sorted(_texts(folder))}


def built_in(name: str) -> bytes:
    """Return the file that hands in a controller of this package; InputError if it has none of that name."""
    from dubins_traffic.controllers import registry

    if name not in registry.names():
        raise InputError("no built-in controller", value=name, expected=", ".join(registry.names()))
    lines = "from dubins_traffic.controllers import registry", "", "", "def Controller():"
    return "\n".join([*lines, f'    return registry.load("{name}")', ""]).encode()


def write_template(kind: str, folder: Path) -> list[Path]:
    """Write the files of a template into a new or empty folder and return their paths.

    InputError if there is no such template, the folder holds something, or it can't be written.
    """
    texts = template_files(kind)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = sorted(path.name for path in folder.iterdir())
    except OSError as error:
        raise InputError(f"can't be made ({error.strerror})", file=str(folder), expected="a new folder") from None
    if held:
        raise InputError(f"holds {held[0]}", file=str(folder), expected="a new or empty folder")
    for name, text in texts.items():
        write_text(folder / name, text)
    return [folder / name for name in texts]


def _texts(folder: Traversable) -> Iterator[tuple[str, str]]:
    for item in folder.iterdir():
        if item.name.endswith(_SUFFIX):
            yield item.name, item.read_text(encoding="utf-8")
