"""Records, scores and replays as bytes that hold their meaning: no versions, no layout, no wall-clock time."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np

import dubins_traffic as dt
from dubins_traffic.scoring.margins import ENTERED
from dubins_traffic.viewer.replay import replay_page
from tests.recordings import REALS, WHOLE

_DATA = re.compile(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', re.DOTALL)
_LEFT_OUT = ("record", "time_to_begin_s", "wall", "act_latency_s", "rounds_before_breach", "ran")
_YOUNG = ("journey_lengths", "journey_start_time")


def plain(value: object) -> bytes:
    """Return JSON with sorted keys; numbers by their shortest exact text."""
    return json.dumps(value, sort_keys=True, default=_simple, separators=(",", ":")).encode()


def _simple(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def decoded_score(score: dt.Score) -> bytes:
    """Return a score without the record's place and what a wall clock measured.

    What is said of `2.turn` but its breaches, the margins of rule 3, those of formulas, the rounds before the first
    breach, whether the trial was cut and where its controller ran are left out: they are younger than the hashes, and
    `tests/property/test_margin_signs.py`, `test_formula_margins.py`, `test_batch.py`,
    `tests/unit/test_score_tables.py` and `tests/unit/test_where_they_ran.py` have them.
    """
    document = score.to_json()
    for formula in document["formulas"]:
        del formula["robustness"]
    if document["verdict"] is not None:
        robustness = document["verdict"]["robustness"]
        del document["verdict"]["cut"]
        del document["verdict"]["formulas"]["2.turn"]
        document["verdict"] = {
            **document["verdict"],
            "robustness": {rule: robustness[rule] for rule in robustness if rule not in (*ENTERED, "2.turn")},
        }
    return plain({name: document[name] for name in document if name not in _LEFT_OUT})


def decoded_record(record: dt.Record) -> bytes:
    """Return instance, frames, contacts, events and ending of a record.

    Parameters of the rules that are younger than the hashes are left out.
    """
    frames = record.frames
    instance = dt.instance_to_document(record.instance)
    for name in _YOUNG if instance.get("rules") else ():
        del instance["rules"][name]
    parts = [
        plain(instance),
        plain([frames.first, frames.rate, record.controller]),
    ]
    parts += [getattr(frames, name).tobytes() for name in (*REALS, *WHOLE, "bits")]
    parts.append(plain([list(map(repr, frames.contacts)), list(map(repr, frames.events)), repr(record.ending)]))
    parts.append(plain([[len(block), len(block.contacts), len(block.events)] for block in record.blocks]))
    return b"\n".join(parts)


def replay_data(record: dt.Record) -> bytes:
    """Return the data that a replay page carries."""
    page = replay_page(record.instance, record.frames, record.ending)
    found = _DATA.search(page)
    assert found is not None
    return plain(json.loads(found.group(1)))
