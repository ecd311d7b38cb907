"""RND version 0 in JSON: one line a key, eight segments a line."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, cast

from dubins_traffic.errors import InputError


class RndJson:
    """Road network descriptions in JSON."""

    name = "rnd-json"
    suffixes = (".json",)
    description = "RND version 0 in JSON"

    def sniff(self, text: str) -> bool:
        """Tell whether a text is an object with segments or the shape of a grid, and not a document around one."""
        own = text.lstrip()[:1] == "{" and ('"segments"' in text or '"shape"' in text)
        return own and '"rnd"' not in text and '"problem_domain"' not in text

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the document in a text."""
        return parse_json(text, file)

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the text of a document."""
        return write_json(document)


def parse_json(text: str, file: str | None = None) -> dict[str, Any]:
    """Return the JSON object in `text`; keys given twice, NaN and infinities are refused."""

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in pairs:
            if key in found:
                raise InputError("key given twice", file=file, field=key)
            found[key] = value
        return found

    def constant(name: str) -> Any:
        raise InputError("not a JSON number", file=file, value=name, expected="a finite number")

    try:
        value = json.loads(text, object_pairs_hook=unique, parse_constant=constant)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"not JSON ({error.msg}, {where})", file=file) from None
    except RecursionError:
        raise InputError("nested too deeply", file=file) from None
    except ValueError as error:
        raise InputError(f"not JSON ({error})", file=file) from None
    if not isinstance(value, dict):
        raise InputError("not a JSON object", file=file, value=value, expected="an object {...}")
    return cast("dict[str, Any]", value)


def write_json(document: Mapping[str, Any]) -> str:
    """Return the JSON text of a description, one line a key and eight segments a line."""
    lines: list[str] = []
    for key, value in document.items():
        text = json.dumps(value, allow_nan=False) if key != "segments" else _segment_lines(value)
        lines.append(f"  {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _segment_lines(segments: Sequence[Sequence[int]]) -> str:
    rows = [json.dumps(list(segment), allow_nan=False) for segment in segments]
    lines = [", ".join(rows[k : k + 8]) for k in range(0, len(rows), 8)]
    return "[\n    " + ",\n    ".join(lines) + "\n  ]"
