"""The replay page of a case."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from dubins_traffic.falsification.crew import driver_of, name_of
from dubins_traffic.falsification.judging import judge
from dubins_traffic.scoring.verdict import EGO_NAME
from dubins_traffic.viewer.replay import write_replay

if TYPE_CHECKING:
    from dubins_traffic.falsification.case import Case
    from dubins_traffic.falsification.remote import Remote


def write_page(
    case: Case,
    path: str | os.PathLike[str],
    controller: str | Remote | None = None,
    *,
    overwrite: bool = False,
) -> None:
    """Write the page that replays a case, driven by its controller or another; equal cases give equal bytes."""
    driver = case.story.controller if controller is None else controller
    name = name_of(driver)
    judged = judge(case.instance, driver_of(driver), name)
    record, verdict = judged.record, judged.score.verdict
    own = [] if verdict is None else [broken.rule for broken in verdict.violations if broken.car == EGO_NAME]
    summary = {
        "rule": case.story.rule,
        "what happens": case.story.sentence,
        "controller": name,
        "broken by the ego": ", ".join(dict.fromkeys(own)) or "nothing",
    }
    write_replay(
        path, record.instance, record.frames, record.ending, summary, (), verdict, overwrite=overwrite
    )
