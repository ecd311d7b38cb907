"""Which tool's a strategy is, by the content of its file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

from dubins_traffic.errors import InputError
from dubins_traffic.files import decoded, read_bytes
from dubins_traffic.synthesis.foreign.aiger import is_aiger, read_aiger
from dubins_traffic.synthesis.foreign.explicit import (
    is_slugs_text,
    is_tulip,
    read_slugs_json,
    read_slugs_text,
    read_tulip,
)
from dubins_traffic.synthesis.foreign.hoa import is_hoa, read_hoa
from dubins_traffic.synthesis.foreign.machine import MOST_BYTES, Machine

FORMS: Final = "HOA, AIGER, slugs' JSON or explicit text, or TuLiP's Python file"


def read_machine(path: str | Path) -> Machine:
    """Return the machine in a file; what it is in is told by its content.

    InputError if it can't be read, is none of these, or is damaged.
    """
    name = str(path)
    data = read_bytes(name, most=MOST_BYTES)
    try:
        return _machine(data, name)
    except InputError as error:
        raise error if error.file else error.within(file=name) from None


def _machine(data: bytes, name: str) -> Machine:
    if is_aiger(data):
        return read_aiger(data)
    text = decoded(data, name)
    if is_hoa(text):
        return read_hoa(text)
    if is_tulip(text):
        return read_tulip(text)
    if is_slugs_text(text):
        return read_slugs_text(text)
    if text.lstrip().startswith("{"):
        return read_slugs_json(_json(text))
    raise InputError("no strategy that is known", file=name, expected=FORMS)


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not JSON ({error})", expected=FORMS) from None
