"""RND version 0 in plain text: lines ``key: values``, the segments last, one a line."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, cast

from dubins_traffic.errors import InputError
from dubins_traffic.roads.formats.rnd import FIELDS

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_PLAIN_KEY = re.compile(r"[A-Za-z_][\w.-]*", re.ASCII)


class RndText:
    """Road network descriptions in plain text."""

    name = "rnd-text"
    suffixes = (".rnd", ".txt")
    description = "RND version 0 in plain text"

    def sniff(self, text: str) -> bool:
        """Tell whether a text begins with a field of version 0; `may_be` also lets other keys stand first."""
        return may_be(text) and _first(text).partition(":")[0].strip() in FIELDS

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the document in a text."""
        return parse_lines(text, file)

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of a document."""
        return write_lines(document)


def may_be(text: str) -> bool:
    """Tell whether a text looks like plain text of RND, whatever its first key: ``key: value`` lines."""
    bare = _first(text)
    return bare[:1] not in ("", "{", "[", '"') and ":" in bare


def _first(text: str) -> str:
    """Return the first line that says something, without its remark."""
    bare = (line.split("#", 1)[0].strip() for line in text.splitlines())
    return next((line for line in bare if line), "")


def write_lines(document: Mapping[str, Any]) -> str:
    """Return the plain text of a description, `segments` last."""
    lines: list[str] = []
    for key, value in document.items():
        if key == "segments":
            continue
        if key in FIELDS:
            row = cast("list[Any]", value) if isinstance(value, list) else [value]
            lines.append(f"{key}: {' '.join(_json(number) for number in row)}")
        else:
            name = key if _PLAIN_KEY.fullmatch(key) else _escaped(key, "#:")
            raw = isinstance(value, str) and _value(value) == value and value == " ".join(value.split())
            plain = raw and value and "#" not in value and value.isascii()
            lines.append(f"{name}: {value if plain else _escaped(value, '#')}")
    lines.append("segments:")
    lines += [" ".join(_json(number) for number in segment) for segment in document["segments"]]
    return "\n".join(lines) + "\n"


def parse_lines(text: str, file: str | None) -> dict[str, Any]:
    """Return the fields in plain text.

    Raises
    ------
    InputError
        If a line is none, or a key stands twice. The fields themselves are not looked at.
    """
    document: dict[str, Any] = {}
    segments: list[list[Any]] | None = None
    for number, full in enumerate(re.split(r"\r\n|\r|\n", text), start=1):
        line = full.split("#", 1)[0].strip()
        if not line:
            continue
        if segments is not None:
            segments.append([_number(token) for token in line.split()])
            continue
        key, value = _entry(line, number, file)
        if key in document:
            raise InputError(f"key given twice (line {number})", file=file, field=key)
        if key == "segments":
            if value:
                raise InputError(f"not a line break (line {number})", file=file, field=key, value=value)
            document[key] = segments = []
        elif key in FIELDS:
            row = [_number(token) for token in value.split()]
            document[key] = row[0] if key in {"version", "length"} and len(row) == 1 else row
        else:
            document[key] = _value(value)
    return document


def _entry(line: str, number: int, file: str | None) -> tuple[str, str]:
    key, colon, value = line.partition(":")
    key = key.strip()
    if not colon or not key:
        raise InputError(
            f"not a line of RND text (line {number})", file=file, value=line, expected="key: values"
        )
    if key.startswith('"'):
        decoded = _value(key)
        key = decoded if isinstance(decoded, str) else key
    return key, value.strip()


def _number(token: str) -> Any:
    if not _NUMBER.fullmatch(token) or len(token) > 400:
        return token
    return float(token) if any(mark in token for mark in ".eE") else int(token)


def _value(text: str) -> Any:
    """Return the value of an unknown key in plain text: JSON if it is that, else the text itself."""
    try:
        value = json.loads(text, parse_constant=str)
        json.dumps(value, allow_nan=False)
    except (ValueError, RecursionError):
        return text
    return value


def _json(value: Any) -> str:
    return json.dumps(value, allow_nan=False)


def _escaped(value: Any, marks: str) -> str:
    """Return JSON in which the `marks` stand in strings as escapes."""
    text = _json(value)
    if not any(mark in text for mark in marks):
        return text
    if isinstance(value, str):
        for mark in marks:
            text = text.replace(mark, f"\\u{ord(mark):04x}")
        return text
    return text.replace("#", "\\u0023")
