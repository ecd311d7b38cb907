"""A case: an instance in which an ego breaks a rule, with what is known of it, as one small file that `run` replays."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast, get_type_hints

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.coverage import Cell, Manoeuvre
from dubins_traffic.files import require_output, write_text
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.files import DOCUMENTS, parse_json, read_source

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

KEY: Final = "case"
"""The key of an instance's document under which a case says what it is; a run passes it over."""


@dataclass(frozen=True, slots=True)
class Story:
    """What is known of a case: `rule` is broken by the ego at `time` seconds, frame `tick`.

    `manoeuvre` and `degree` are those of its cell, `controller` drove the ego, and `sentence` tells who did what when.
    """

    rule: str
    manoeuvre: str
    degree: int
    controller: str
    time: float
    tick: int
    sentence: str

    @property
    def cell(self) -> Cell:
        """Its cell."""
        return Cell(self.rule, Manoeuvre[self.manoeuvre.upper()], self.degree)


@dataclass(frozen=True, slots=True)
class Case:
    """An instance and what is known of it."""

    instance: Instance
    story: Story

    def to_text(self) -> str:
        """Return the text of its file; equal cases give equal text."""
        extra = {key: value for key, value in self.instance.extra.items() if key != KEY}
        document = instance_to_document(replace(self.instance, extra={**extra, KEY: asdict(self.story)}))
        return (
            "{\n"
            + ",\n".join(f" {json.dumps(key)}: {json.dumps(own)}" for key, own in document.items())
            + "\n}\n"
        )

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write its file, whole or not at all; InputError as of `files.require_output`."""
        require_output(path, "a case", DOCUMENTS, overwrite=overwrite)
        write_text(Path(path), self.to_text())


def read_case(path: str | os.PathLike[str]) -> Case:
    """Return the case in a file.

    Raises
    ------
    InputError
        If there is no such file, or it holds no case.
    """
    name = os.fspath(path)
    document = parse_json(read_source(name).text, name)
    return case_of(instance_from_document(document, name), name)


def case_of(instance: Instance, name: str | None = None) -> Case:
    """Return the case that the document of an instance carries; `name` is the file that errors mention."""
    found: Any = instance.extra.get(KEY)
    expected = "an object with rule, manoeuvre, degree, controller, time, tick and sentence"
    if not isinstance(found, Mapping):
        raise InputError("not a case", file=name, field=KEY, value=found, expected=expected)
    told = cast("Mapping[str, Any]", found)
    try:
        story = Story(**told)
        _check_kinds(story, name)
        if story.manoeuvre.upper() not in Manoeuvre.__members__:
            raise InputError("no manoeuvre", file=name, field=f"{KEY}.manoeuvre", value=story.manoeuvre)
    except (TypeError, AttributeError):
        raise InputError("not a case", file=name, field=KEY, value=sorted(told), expected=expected) from None
    return Case(instance, story)


def _check_kinds(story: Story, file: str | None) -> None:
    """Refuse numbers where words are to stand, and the other way round."""
    for name, kind in get_type_hints(Story).items():
        value = getattr(story, name)
        allowed = (int, float) if kind is float else kind
        if not isinstance(value, allowed) or isinstance(value, bool):
            raise InputError(
                "of the wrong kind", file=file, field=f"{KEY}.{name}", value=value, expected=kind.__name__
            )
