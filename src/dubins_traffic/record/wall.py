"""The sidecar of a record: wall-clock figures, kept apart so that equal trials make equal records."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, cast

import numpy as np

from dubins_traffic.errors import RecordError
from dubins_traffic.files import replace_file

VERSION = 1


@dataclass(frozen=True, slots=True)
class Wall:
    """What a sidecar holds.

    `time_to_begin_s` is the wall-clock time of the controller's `start`, None if it did not return; `act_s` sums
    up the latencies of its `act` (count, mean, median, p99, max; empty without calls); `reproducible` is false for
    a trial that a wall clock ended or that ran in real time; `date` is UTC, ISO 8601; `machine` tells the system,
    processor, number of cores and version of Python; `transport` is empty unless a driver was in another process, and
    then says how punctual everyone was (docs/records.md).
    """

    time_to_begin_s: float | None
    act_s: Mapping[str, float]
    reproducible: bool
    date: str
    machine: Mapping[str, Any]
    transport: Mapping[str, Any] = field(default_factory=dict[str, Any])


def summary(values: Sequence[float]) -> dict[str, float]:
    """Return count, mean, median, p99 and max of `values`, an empty mapping if there are none."""
    if not values:
        return {}
    array = np.array(values)
    return {
        "count": float(len(values)),
        "mean": float(array.mean()),
        "median": float(np.median(array)),
        "p99": float(np.percentile(array, 99)),
        "max": float(array.max()),
    }


def measured(time_to_begin_s: float | None, act_s: Mapping[str, float], *, reproducible: bool = True) -> Wall:
    """Return the sidecar of a trial that has just run on this machine."""
    machine = {
        "system": platform.system(),
        "processor": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
    }
    date = datetime.now(UTC).isoformat(timespec="seconds")
    return Wall(time_to_begin_s, dict(act_s), reproducible, date, machine)


def sidecar(record: Path | str) -> Path:
    """Return the path of a record's sidecar: ``NAME.wall.json`` beside ``NAME.mcap``."""
    path = Path(record)
    name = path.stem if path.suffix == ".mcap" else path.name
    return path.with_name(f"{name}.wall.json")


def write(record: Path | str, wall: Wall) -> None:
    """Write the sidecar of `record`, atomically."""
    fields = asdict(wall)
    if not wall.transport:
        del fields["transport"]
    text = json.dumps({"version": VERSION, **fields}, indent=2) + "\n"
    replace_file(sidecar(record), lambda path: path.write_text(text, encoding="utf-8"))


def read(record: Path | str) -> Wall | None:
    """Return the sidecar of `record`, or None if there is none.

    Raises
    ------
    RecordError
        If a file of that name is there and is no sidecar.
    """
    path = sidecar(record)
    try:
        document: Any = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, RecursionError) as error:
        raise RecordError("can't be read as a sidecar of a record", file=str(path), expected="JSON") from error
    if not isinstance(document, dict):
        raise RecordError("not a sidecar of a record", file=str(path), expected="a JSON object")
    fields = cast("dict[str, Any]", document)
    if fields.pop("version", None) != VERSION:
        raise RecordError("not a version of a sidecar", file=str(path), field="version", expected=str(VERSION))
    for name, value in fields.items():
        rule = _TYPES.get(name)
        if rule is not None and not rule[0](value):
            raise RecordError("not a sidecar of a record", file=str(path), field=name, value=value, expected=rule[1])
    try:
        return Wall(**fields)
    except TypeError as error:
        raise RecordError(f"not a sidecar of a record: {error}", file=str(path)) from error


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _holds_numbers(value: object) -> bool:
    return isinstance(value, dict) and all(map(_is_number, cast("dict[str, Any]", value).values()))


_TYPES: Final[Mapping[str, tuple[Callable[[object], bool], str]]] = {
    "time_to_begin_s": (lambda value: value is None or _is_number(value), "seconds or null"),
    "act_s": (_holds_numbers, "an object of numbers"),
    "reproducible": (lambda value: isinstance(value, bool), "true or false"),
    "date": (lambda value: isinstance(value, str), "a text"),
    "machine": (lambda value: isinstance(value, dict), "an object"),
    "transport": (lambda value: isinstance(value, dict), "an object"),
}
"""The check of each field of a sidecar, and what it expects."""


def remove_record(record: Path) -> None:
    """Remove a record and its sidecar."""
    record.unlink(missing_ok=True)
    sidecar(record).unlink(missing_ok=True)
