"""Map formats by name: those that come with the package, those of other packages, and a user's own.

A format reads a text into the fields of RND version 0 (`roads.formats.rnd`), which are checked then; so it knows of
road networks only their segments, length and transform. Those of other programs come from the room `maps`, by a line
for each in `dubins_traffic`; a new one is a file there and such a line, or a class outside the package
(docs/extending/map-format.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain
from pathlib import Path
from typing import Any, Protocol, cast, runtime_checkable

from dubins_traffic import outside
from dubins_traffic.above import ABOVE
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.files import GZIP
from dubins_traffic.outside import Seam
from dubins_traffic.roads.formats.rnd import RndJson, RndText, may_be
from dubins_traffic.roads.formats.xml_root import is_xml, root_name

LOSSES = "losses"
"""The key under which a network keeps what was lost of the map from which it comes."""
GROUP = "dubins_traffic.map_formats"
"""Entry points of other packages."""
_SEAM = Seam("--map-format", "map format", ("sniff", "read"), "sniff(text) -> bool and read(text, file) -> mapping")


class MapFormat(Protocol):
    """Reads road networks from texts of one kind. A class without arguments."""

    @property
    def name(self) -> str:
        """Short name, such as ``rnd-json``."""
        ...

    @property
    def suffixes(self) -> tuple[str, ...]:
        """Suffixes of its files, in lower case, with the dot."""
        ...

    @property
    def description(self) -> str:
        """A line about it."""
        ...

    def sniff(self, text: str) -> bool:
        """Tell whether a text is of this format, from its beginning; must not raise."""
        ...

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the fields of RND version 0 that a text describes: version, length, segments, transform, shape.

        Raises
        ------
        InputError
            If the text is broken; names `file`. The fields are checked by the caller.
        """
        ...


@runtime_checkable
class ReducesMaps(MapFormat, Protocol):
    """A map format of another program, of which a network can't hold everything."""

    def reduced(self, text: str, file: str | None = None) -> tuple[Mapping[str, Any], object]:
        """Return the RND document of what can be held, and what was lost (`maps.losses.Losses`)."""
        ...


@runtime_checkable
class WritesMaps(MapFormat, Protocol):
    """A map format that can be written, too."""

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of an RND document."""
        ...


def names() -> Mapping[str, str]:
    """Return the formats of this and other packages: name to one line of description."""
    return {form.name: f"{form.description} ({', '.join(form.suffixes)})" for form in registered()}


def registered() -> Iterator[MapFormat]:
    """Yield the formats of this package, then those of others, which are looked for only then."""
    yield from _built_in().values()
    yield from _others()


def forget() -> None:
    """Look for the formats of other packages anew when next they are asked for."""
    _others.cache_clear()


def load(spec: str) -> MapFormat:
    """Return a map format: a registered name, ``module:Class`` or ``path/to/file.py:Class``.

    Raises
    ------
    InputError
        If there is none, or it lacks something of `MapFormat`.
    """
    for form in registered():
        if form.name == spec:
            return form
    if not outside.is_place(spec):
        known = ", ".join(form.name for form in registered())
        raise _SEAM.refuse("unknown map format", spec, f"one of {known}, module:Class or path/to/file.py:Class")
    return _made(outside.find(spec, _SEAM), spec)


def sniffs(form: MapFormat, text: str) -> bool:
    """Tell whether a text is of a format; InputError that names the format if it raises."""
    try:
        return bool(form.sniff(text))
    except Exception as error:
        raise InputError(f"the map format {form.name} raised {outside.plainly(error)} in sniff") from error


def sniffed(text: str) -> MapFormat | None:
    """Return the registered format of which a text is, None if it is of none."""
    return next((form for form in registered() if sniffs(form, text)), None)


def of_other_package(text: str) -> MapFormat | None:
    """Return the format of another package of which a text is."""
    return next((form for form in _others() if sniffs(form, text)), None)


def of_text(text: str) -> MapFormat:
    """Return the format in which a text is to be read that holds a road network; what can't be told is RND."""
    return sniffed(text) or _built_in()["rnd-json" if text.lstrip()[:1] in ("{", "[") else "rnd-text"]


def is_map(text: str) -> bool:
    """Tell whether a text is to hold a road network: it is one, or XML, and no JSON, which other documents are, too."""
    return text.lstrip()[:1] not in ("", "{", "[") and (is_xml(text) or sniffed(text) is not None or may_be(text))


def of_suffix(path: str | Path, further: MapFormat | None = None) -> WritesMaps | None:
    """Return the format that writes files called so, that with the longest suffix; None if there is none.

    What ends in ``.gz`` is a file of what stands before that, packed.
    """
    name = Path(path).name.lower().removesuffix(GZIP)
    forms = chain([] if further is None else [further], registered())
    writers = [(form, suffix) for form in forms if isinstance(form, WritesMaps) for suffix in form.suffixes]
    fitting = [(form, suffix) for form, suffix in writers if name.endswith(suffix)]
    return max(fitting, key=lambda pair: len(pair[1]))[0] if fitting else None


def suffixes(further: MapFormat | None = None) -> tuple[str, ...]:
    """Return the suffixes of all formats that can be written."""
    forms = chain([] if further is None else [further], registered())
    return tuple(suffix for form in forms if isinstance(form, WritesMaps) for suffix in form.suffixes)


def document(form: MapFormat, text: str, file: str | None) -> tuple[Mapping[str, Any], object | None]:
    """Return the RND document that `form` reads in a text, and what was lost of it, if the format tells.

    Raises
    ------
    InputError
        If it is broken; whatever else the format raises becomes one that names it.
    """
    if not text.strip():
        raise InputError("empty", file=file, expected="a road network (RND, JSON or text)")
    if form is _built_in()["rnd-text"] and is_xml(text):
        root = root_name(text)
        problem = f"XML that is no map: its root is <{root}>" if root else "XML that ends before its root"
        known = [form.name for form in registered() if isinstance(form, ReducesMaps)]
        raise InputError(problem, file=file, expected=f"a whole map: {' or '.join(known)}")
    try:
        return form.reduced(text, file) if isinstance(form, ReducesMaps) else (form.read(text, file), None)
    except DubinsTrafficError:
        raise
    except Exception as error:
        raise InputError(f"the map format {form.name} raised {outside.plainly(error)}", file=file) from error


@cache
def _built_in() -> Mapping[str, MapFormat]:
    """Return the formats of this package by name, in the order in which they are asked."""
    further = {name: find()() for name, find in ABOVE.parts("map formats").items()}
    return {"rnd-json": RndJson(), "rnd-text": RndText(), **further}


@cache
def _others() -> tuple[MapFormat, ...]:
    return tuple(_made(maker, name) for name, maker in outside.of_packages(GROUP).items())


def _made(maker: Any, spec: str) -> MapFormat:
    made = outside.make(maker, spec, _SEAM)
    for field, kind in (("name", str), ("suffixes", tuple), ("description", str)):
        if not isinstance(getattr(made, field, None), kind):
            raise _SEAM.refuse(
                f"{spec.rpartition(':')[2]} is not a map format: it lacks {field}",
                spec,
                "name, suffixes, description",
            )
    return cast(MapFormat, made)
