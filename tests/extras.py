"""Environments of one extra each: the distributions that it requires, linked to from here, and no others."""

from __future__ import annotations

import venv
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
OURS = "dubins-traffic"


def required(extra: str) -> dict[str, Distribution]:
    """The distributions that an installation with an extra brings, by their names; "" is the plain one."""
    found: dict[str, Distribution] = {}
    wanted = [(OURS, frozenset({extra}))]
    seen: set[tuple[str, frozenset[str]]] = set()
    while wanted:
        own = wanted.pop()
        if own in seen:
            continue
        seen.add(own)
        name, extras = own
        try:
            found[name] = distribution(name)
        except PackageNotFoundError:  # of another platform or Python
            continue
        for text in found[name].requires or ():
            need = Requirement(text)
            if need.marker is None or any(need.marker.evaluate({"extra": one}) for one in (extras or {""})):
                wanted.append((canonicalize_name(need.name), frozenset(need.extras) or frozenset({""})))
    return found


def extras() -> list[str]:
    """The extras for users, with "" for none of them."""
    named = distribution(OURS).metadata.get_all("Provides-Extra") or []
    return ["", *(name for name in named if name not in ("all", "dev", "docs"))]


def _top(own: Distribution) -> Iterator[Path]:
    """The files and folders of a distribution that stand in the folder of packages."""
    tops = {Path(file).parts[0] for file in own.files or () if Path(file).parts[0] not in ("..", "__pycache__")}
    for name in sorted(tops):
        yield Path(str(own.locate_file(name)))


def installed(folder: Path, extra: str) -> Path:
    """Make an environment with the plain package and one extra; return its Python."""
    venv.create(folder, symlinks=True)
    (packages,) = folder.glob("lib/python*/site-packages")
    for own in required(extra).values():
        for path in _top(own):
            if path.exists() and path.suffix != ".pth" and not (packages / path.name).exists():
                (packages / path.name).symlink_to(path)
    (packages / "sources.pth").write_text(f"{ROOT / 'src'}\n")
    return folder / "bin" / "python"
