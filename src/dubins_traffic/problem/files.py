"""Documents as files: reads them by path or from standard input, tells their kind, writes them."""

from __future__ import annotations

import json
import math
import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, cast

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.files import decoded, is_stream, packed, read_bytes, require_output, write_text

STANDARD_INPUT = "-"
MCAP_MAGIC = b"\x89MCAP0\r\n"
DOCUMENTS = packed(".json")
"""How names of the files of documents end."""
_DEEPEST = 100


class FileKind(StrEnum):
    """What a file may hold."""

    NETWORK = "network"
    CONFIGURATION = "configuration"
    INSTANCE = "instance"
    TRIAL_DATA = "trial data"
    RECORD = "record"


@dataclass(frozen=True, slots=True)
class Source:
    """A text that has been read: the name used in messages, its folder (None for standard input), the text."""

    name: str
    folder: Path | None
    text: str

    def document(self, kind: FileKind, wanted: str, keys: str) -> dict[str, Any]:
        """Return the JSON object in the text; InputError unless it is of a `kind`, `wanted` in words, with `keys`."""
        document = parse_json(self.text, self.name)
        foreign = detect(document, self.name)
        if foreign is not kind:
            problem = f"not {wanted} but a {foreign}"
            raise InputError(problem, file=self.name, value=sorted(document), expected=keys)
        return document


def read_source(path: str | os.PathLike[str]) -> Source:
    """Return the text of the file at `path`, or standard input for ``-``.

    Raises
    ------
    InputError
        If there is no such file, or it is a folder, a record, or can't be read.
    """
    name = os.fspath(path)
    if is_record(name):
        raise _refuse_record(name)
    return source_of(read_bytes(name), name)


def source_of(data: bytes, name: str) -> Source:
    """Return `data`, the bytes of the file called `name`, as a text; the exceptions are those of `read_source`."""
    if data.startswith(MCAP_MAGIC):
        raise _refuse_record(name)
    if name.endswith(".mcap"):
        raise RecordError("not a record", file=name, expected="an MCAP file, or another name")
    folder = None if name == STANDARD_INPUT or is_stream(name) else Path(name).parent
    return Source(name, folder, decoded(data, name))


def _refuse_record(name: str) -> InputError:
    return InputError("a record", file=name, value=name, expected="a document in JSON or a road network")


def is_record(path: str | os.PathLike[str]) -> bool:
    """Tell whether the file at `path` begins like a record (MCAP); nothing is read of what can be read only once."""
    if is_stream(os.fspath(path)):
        return False
    try:
        with Path(path).open("rb") as stream:
            return stream.read(len(MCAP_MAGIC)) == MCAP_MAGIC
    except (OSError, ValueError):
        return False


def parse_json(text: str, file: str | None = None) -> dict[str, Any]:
    """Return the JSON object in `text`.

    Raises
    ------
    InputError
        If it is not JSON, not an object, has a key twice, a number that is not finite, or is nested too
        deep.
    """
    try:
        document: object = json.loads(text, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        near = error.doc[error.pos : error.pos + 20]
        raise InputError(f"not JSON ({error.msg}, {where})", file=file, value=near, expected="JSON") from None
    except InputError as error:
        raise error.within(file=file) from None
    except (RecursionError, ValueError) as error:
        reason = "nested too deep" if isinstance(error, RecursionError) else "a number has too many digits"
        raise InputError(f"not a document ({reason})", file=file, expected="a smaller document") from None
    return plain(document, file=file)


def read_toml(path: str | os.PathLike[str], expected: str) -> dict[str, Any]:
    """Return the content of the TOML file at `path`.

    Raises
    ------
    InputError
        If there is no such file or it is no TOML; `expected` says what it should be.
    """
    name = os.fspath(path)
    try:
        return tomllib.loads(decoded(read_bytes(name), name))
    except RecursionError:
        raise InputError("nested too deep", file=name, expected=expected) from None
    except ValueError as error:
        raise InputError(f"not TOML ({error})", file=name, expected=expected) from None


def plain(document: object, file: str | None = None) -> dict[str, Any]:
    """Return a deep copy of a JSON object in plain dictionaries and lists.

    Raises
    ------
    InputError
        If it is not an object, holds what JSON can't, or a number that is not finite.
    """
    try:
        copy = _plain(document, "", 0)
    except InputError as error:
        raise error.within(file=file) from None
    if not isinstance(copy, dict):
        raise InputError("not an object", file=file, value=copy, expected="a JSON object")
    return cast("dict[str, Any]", copy)


def dumps(document: Mapping[str, Any]) -> str:
    """Return a JSON object as text, one line per top-level key, floats in shortest round-trip form."""
    lines = (f"  {json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in document.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"


def write_document(document: Mapping[str, Any], path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a JSON object to `path`, whole or not at all.

    Raises
    ------
    InputError
        If the path is refused (`files.require_output`), or the file can't be written.
    """
    require_output(path, "a document", DOCUMENTS, overwrite=overwrite)
    write_text(os.fspath(path), dumps(document))


def detect(document: Mapping[str, Any], file: str | None = None) -> FileKind:
    """Return the kind of a JSON document, told by its keys.

    Raises
    ------
    InputError
        If it is none of the documents.
    """
    keys = document.keys()
    if keys & {"trialconf", "instances"}:
        return FileKind.TRIAL_DATA
    if "problem_domain" in keys:
        return FileKind.CONFIGURATION
    if "starts" in keys or (keys >= {"goals", "rnd"} and not keys & _CONFIGURATION_ONLY):
        return FileKind.INSTANCE
    if keys & (_CONFIGURATION_ONLY | {"e-agents"}):
        return FileKind.CONFIGURATION
    if "goals" in keys:
        return FileKind.INSTANCE
    if keys & {"segments", "shape", "length", "transform"}:
        return FileKind.NETWORK
    raise InputError(
        "unknown kind of document",
        file=file,
        value=sorted(keys),
        expected="the keys of a road network, a trials configuration, a problem instance or a trial data file",
    )


_CONFIGURATION_ONLY = frozenset({"number_trials", "duration_bounds", "number_goals_bounds", "network"})


def _object(pairs: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in pairs:
        if key in result:
            raise InputError("key stands twice", field=key, value=value, expected="each key once")
        result[key] = value
    return result


def _checked_text(text: str, path: str) -> str:
    """Return `text` if it can be written as UTF-8; single surrogates, which JSON can escape, can't."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        bad = text[error.start : error.end]
        raise InputError("not a text", field=path or None, value=bad, expected="characters of Unicode") from None
    return text


def _plain(value: object, path: str, depth: int) -> Any:
    if depth > _DEEPEST:
        raise InputError("nested too deep", field=path[:60], expected=f"at most {_DEEPEST} levels")
    if isinstance(value, Mapping):
        result: dict[str, Any] = {}
        for key, item in cast("Mapping[object, object]", value).items():
            if not isinstance(key, str):
                raise InputError("not a key", field=path or None, value=key, expected="a text")
            _checked_text(key, path)
            result[key] = _plain(item, f"{path}.{key}" if path else key, depth + 1)
        return result
    if isinstance(value, list | tuple):
        items = cast("list[object]", value)
        return [_plain(item, f"{path}[{k}]", depth + 1) for k, item in enumerate(items)]
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError("not a finite number", field=path, value=value, expected="a finite number")
    if isinstance(value, str):
        return _checked_text(value, path)
    if value is None or isinstance(value, bool | int | float):
        return value
    raise InputError("not a JSON value", field=path, value=value, expected="what JSON can hold")
