"""Figures of Matplotlib and their files (optional extra ``plot``)."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Sequence
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import replace_file, require_output

SUFFIXES = (".pdf", ".png", ".svg")
STYLE: dict[str, Any] = {
    "svg.hashsalt": "dubins-traffic",
    "svg.fonttype": "path",
    "pdf.compression": 6,
    "font.family": "DejaVu Sans",
    "path.simplify": True,
    "savefig.facecolor": "white",
}
METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
    ".pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}


@cache
def figure_class() -> Any:
    """Return Matplotlib's figure as notebooks show it: without `pyplot` they would print its size only."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        def _repr_png_(self) -> bytes:
            stream = BytesIO()
            drawn: Any = self
            drawn.savefig(stream, format="png", metadata=METADATA[".png"], dpi=110)
            return stream.getvalue()

    return Picture


def write_figure(path: str | os.PathLike[str], draw: Callable[[], Any], *, overwrite: bool = False) -> None:
    """Write the figure that `draw` returns to `path`; errors as those of `animation.plot.write_plot`."""
    target = Path(path)
    require_picture(target, overwrite=overwrite)
    with matplotlib().rc_context(STYLE):
        figure = draw()
        suffix = target.suffix.lower()
        look: dict[str, Any] = {"format": suffix[1:], "metadata": METADATA[suffix], "dpi": 160}
        replace_file(target, lambda draft: figure.savefig(draft, **look))


def require_picture(
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    apart_from: Sequence[str | os.PathLike[str] | None] = (),
) -> None:
    """Refuse a path that no picture may be written to (`files.require_output`), and all without matplotlib."""
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        expected = f"a suffix of {', '.join(SUFFIXES)}"
        raise InputError("not a picture", file=str(path), value=target.suffix, expected=expected)
    require_output(target, "a picture", SUFFIXES, overwrite=overwrite, apart_from=apart_from)
    matplotlib()


def matplotlib() -> Any:
    """Return the module; MissingExtraError if it is not installed."""
    with needs("plotting", "plot"):
        return importlib.import_module("matplotlib")
