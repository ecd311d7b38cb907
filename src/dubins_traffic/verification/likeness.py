"""Finds the first place in which two documents differ."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import zip_longest
from pathlib import PurePath
from typing import Any, cast

from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import header
from dubins_traffic.record.reader import Record
from dubins_traffic.scoring.score import score
from dubins_traffic.verification.result import Difference
from dubins_traffic.verification.sheet import entry_of


def header_difference(written: bytes, record: Record) -> Difference | None:
    """Return where the header of `record`, as `written`, differs from the document of its instance.

    The instance may be written in more ways than one: what its document leaves out has its default.
    """
    expected = header.document(record.instance, record.controller, record.versions)
    found = json.loads(written)
    different = unlike("header", {**found, "instance": None}, _as_json({**expected, "instance": None}))
    if different is None and header.as_message(found) != written:
        return Difference("header", "other text", "JSON as it is written, each key once")
    return different


def instance_difference(record: Record, expected: Instance) -> Difference | None:
    """Return the first difference between the instance of `record` and the one that should have been run."""
    same = instance_from_document(instance_to_document(expected))  # with what it leaves out at its default
    documents = [_as_json(instance_to_document(instance)) for instance in (record.instance, same)]
    return unlike("instance", documents[0], documents[1])


def score_difference(record: Record, scores: Sequence[Mapping[str, Any]]) -> Difference | None:
    """Return where the printed score of `record`, the one in `scores` that names its file, differs from its score.

    What was measured on a wall clock is left out, and so are further metrics, which code from elsewhere may compute.
    """
    name = PurePath(record.file or "").name
    printed = entry_of(name, scores)
    if printed is None:
        return Difference("score", None, f"a score of {name}")
    found, expected = dict(printed), _as_json(score(record).to_json())
    found.pop("metrics", None)
    for left_out in ("record", "time_to_begin_s"):
        found[left_out] = expected[left_out] = None
    return unlike("score", found, expected)


def unlike(path: str, recorded: object, expected: object) -> Difference | None:
    """Return the first place in which two JSON values differ; numbers are equal if they are written alike."""
    if isinstance(recorded, dict) and isinstance(expected, dict):
        one, two = cast("dict[str, object]", recorded), cast("dict[str, object]", expected)
        for name in [*two, *(name for name in one if name not in two)]:
            found = unlike(f"{path}.{name}", one.get(name), two.get(name))
            if found is not None or (name in one) != (name in two):
                return found or Difference(f"{path}.{name}", one.get(name), two.get(name))
        return None
    if isinstance(recorded, list) and isinstance(expected, list):
        rows = zip_longest(cast("list[object]", recorded), cast("list[object]", expected))
        return next((found for k, pair in enumerate(rows) if (found := unlike(f"{path}[{k}]", *pair))), None)
    if json.dumps(recorded) == json.dumps(expected):
        return None
    return Difference(path, recorded, expected)


def _as_json(document: dict[str, Any]) -> Any:
    return json.loads(json.dumps(document))
