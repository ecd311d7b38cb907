"""The verdict `satisfied` stated a second time, slowly: live, in batches and from records trials are judged so."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest
from experiments.free_flow import free_flow

from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.reader import Record, read
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score

SEED = 5


def configuration(**more: object) -> Configuration:
    """Return a small grid with few cars; the ego starts in a goal."""
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 2, "columns": 3, "length": 4}},
        "e-agents": [{"type": "lawful", "name": "car"}], "duration_bounds": [20, 90], "goals": [[0, 0], [2, 1]],
        "rate": 15, "rules": True, **more,
    }  # fmt: skip
    return Configuration.from_document(document)


def is_satisfied(record: Record, *, clean: bool) -> bool:
    """Tell it from the frames, goal by goal and frame by frame (docs/rules.md#satisfied)."""
    problem, frames = record.instance.problem, record.frames
    rules = RuleParameters.from_mapping(problem.rules)
    planned = round(record.instance.duration * problem.rate)
    limit = min(rules.gap_rounds * free_flow(record.instance).round_time, rules.gap_share * planned / problem.rate)
    points = problem.network.points.tolist()
    at = [
        next(
            (v for v, point in enumerate(points) if math.dist(point, place) < problem.intersection_radius),
            None,
        )
        for place in zip(frames.x[:, 0].tolist(), frames.y[:, 0].tolist(), strict=True)
    ]
    for goal in problem.goal_vertices:
        visits: list[int] = []
        for k, v in enumerate(at):
            rises = v == goal and (k == 0 or at[k - 1] != goal)
            if rises and (not visits or any(other not in (None, goal) for other in at[visits[-1] : k])):
                visits.append(k)
        ends = [0, *visits, planned]
        gaps = [(after - before) / problem.rate for before, after in pairwise(ends)]
        if len([k for k in visits if k > 0]) < 2 or max(gaps) > limit:
            return False
    return clean


@pytest.mark.parametrize("start", ["drawn", [0.3, -0.3, 0.0]])
@pytest.mark.parametrize("rules", [{}, {"gap_share": 0.7, "gap_rounds": 1.3}], ids=["as given", "other limits"])
def test_satisfied_is_what_the_page_says(start: object, rules: dict[str, float], tmp_path: Path) -> None:
    own = configuration(ego={"start": start}, rules=rules)
    batch = run_batch(own, "rules", trials=12, seed=SEED)
    seen: Counter[str] = Counter()
    for trial, outcome in enumerate(batch.outcomes):
        file = tmp_path / f"{trial}.mcap"
        live = run_trial(draw(own, SEED, trial), "rules", record=file).score.verdict
        record = read(file)
        assert live is not None
        assert score(record).verdict == live
        verdict = outcome.score.verdict
        assert verdict is not None
        told = (verdict.verdict, verdict.recurrent, verdict.gap_limit_s, verdict.longest_gap_s)
        assert told == (live.verdict, live.recurrent, live.gap_limit_s, live.longest_gap_s)
        assert (live.verdict.value == "satisfied") == is_satisfied(record, clean=live.clean)
        seen[live.verdict.value] += 1
    assert seen.keys() >= {"satisfied", "unfinished"}
