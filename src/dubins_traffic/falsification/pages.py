"""The replay page of a case."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.falsification.judging import judge
from dubins_traffic.scoring.verdict import EGO_NAME
from dubins_traffic.viewer.replay import write_replay

if TYPE_CHECKING:
    from dubins_traffic.falsification.case import Case


def write_page(case: Case, path: str | os.PathLike[str], controller: str | None = None) -> None:
    """Write the page that replays a case, driven by its controller or another; equal cases give equal bytes."""
    name = controller or case.story.controller
    judged = judge(case.instance, lambda: controllers.load(name), name)
    record, verdict = judged.record, judged.score.verdict
    own = [] if verdict is None else [broken.rule for broken in verdict.violations if broken.car == EGO_NAME]
    summary = {
        "rule": case.story.rule,
        "what happens": case.story.sentence,
        "controller": name,
        "broken by the ego": ", ".join(dict.fromkeys(own)) or "nothing",
    }
    write_replay(path, record.instance, record.frames, record.ending, summary, (), verdict)
