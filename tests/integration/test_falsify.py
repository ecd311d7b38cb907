"""Searches end to end: what is found stands, is shrunk as far as can be, and comes again."""

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.campaign.report.statistics import clopper_pearson
from dubins_traffic.cli.main import main
from dubins_traffic.falsification import search
from dubins_traffic.falsification.archive import files
from dubins_traffic.falsification.case import Case, confirm, judge, read_case
from dubins_traffic.falsification.estimate import by_counting, by_splitting, drawn
from dubins_traffic.falsification.shrink import single_removals
from dubins_traffic.falsification.splitting import MeasuredGroup, Particle, follow, split
from dubins_traffic.problem.draw import draw_many
from tests.falsifying import NEAR, Rolling, corridor, standing
from tests.minute import a_minute

FULL = os.environ.get("DUBINS_TRAFFIC_ESTIMATES") == "full"
"""Whether rare events are estimated as often as the bars ask for: minutes."""


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*.*"))}


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("search") / "found"
    dt.falsify(a_minute("junction"), "simple", folder, trials=192, seed=1, duration=8.0)
    return folder


def test_every_case_is_violated_within_the_assumption_when_it_is_judged_afresh(found: Path) -> None:
    cases = [read_case(path) for path in files(found)]
    assert {case.story.rule for case in cases} >= {"1.road", "2.left", "3.stop", "3.clear"}
    for case in cases:
        judged = judge(case.instance, _simple, "simple")
        breach = judged.breach(case.story.rule)
        verdict = judged.score.verdict
        assert verdict is not None
        assert not verdict.assumption_broken
        assert breach is not None
        assert breach.tick == case.story.tick == case.instance.ticks


def test_the_page_of_a_search_tells_what_its_report_does(found: Path) -> None:
    report = json.loads((found / "search.json").read_text())
    page = (found / "coverage.html").read_text()
    never = sum(not row["tested"] and not row["broken"] for row in report["coverage"])
    assert page.count("never tested</b>") == never > 0
    assert f"{never} of {len(report['coverage'])} cells were never put to the test" in page
    links = re.findall(r'href="([^"]*)"', page)
    assert len(links) == len(report["cases"]) > 0
    assert all((found / link).is_file() for link in links)


def test_as_many_trials_are_proposed_at_a_time_as_a_search_is_told(tmp_path: Path) -> None:
    whole: list[int] = []
    dt.falsify(
        a_minute("junction"), "simple", tmp_path / "few", trials=96, seed=1, duration=8.0, most=24,
        progress=lambda own: whole.append(own.counts.trials),
    )  # fmt: skip
    assert sorted(set(whole)) == [0, 24, 48, 72, 96]
    with pytest.raises(dt.InputError, match="another search"):
        dt.falsify(a_minute("junction"), "simple", tmp_path / "few", trials=120, seed=1, duration=8.0, resume=True)
    with pytest.raises(dt.InputError, match=r"most.*at least 1"):
        dt.falsify(a_minute("junction"), "simple", tmp_path / "none", trials=96, most=0)


def _simple() -> dt.Controller:
    from dubins_traffic.controllers.registry import load

    return load("simple")


def test_the_same_seed_gives_the_same_bytes_whoever_runs_the_trials_and_however_often_it_stopped(
    found: Path, tmp_path: Path
) -> None:
    dt.falsify(a_minute("junction"), "simple", tmp_path / "two", trials=192, seed=1, duration=8.0, workers=2)
    assert _bytes(tmp_path / "two") == _bytes(found)
    stopped = tmp_path / "stopped"

    def interrupt(own: search.Search) -> None:
        if own.counts.trials:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dt.falsify(a_minute("junction"), "simple", stopped, trials=192, seed=1, duration=8.0, progress=interrupt)
    assert list(files(stopped))
    dt.falsify(a_minute("junction"), "simple", stopped, trials=192, seed=1, duration=8.0, resume=True)
    assert _bytes(stopped) == _bytes(found)


def test_a_search_that_is_interrupted_while_it_judges_goes_on_as_if_it_had_not_been(
    found: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, judged = search.case_in, [0]

    def once(*given: Any) -> Case | None:
        judged[0] += 1
        if judged[0] == 4:
            raise KeyboardInterrupt
        return real(*given)

    monkeypatch.setattr(search, "case_in", once)
    with pytest.raises(KeyboardInterrupt):
        dt.falsify(a_minute("junction"), "simple", tmp_path / "found", trials=192, seed=1, duration=8.0)
    dt.falsify(a_minute("junction"), "simple", tmp_path / "found", trials=192, seed=1, duration=8.0, resume=True)
    assert _bytes(tmp_path / "found") == _bytes(found)


def test_a_search_that_was_killed_finds_again_what_it_had_not_noted(found: Path, tmp_path: Path) -> None:
    """It has written cases down, but goes on from where it had found none."""
    folder = tmp_path / "found"
    states: list[bytes] = []

    def look(_: object) -> None:
        states.append((folder / "state.json").read_bytes())

    dt.falsify(a_minute("junction"), "simple", folder, trials=64, seed=1, duration=8.0, progress=look)
    assert list(files(folder))
    (folder / "state.json").write_bytes(states[0])
    dt.falsify(a_minute("junction"), "simple", folder, trials=192, seed=1, duration=8.0, resume=True)
    assert _bytes(folder) == _bytes(found)


def test_a_shrunk_case_loses_its_breach_with_any_one_thing_less(found: Path, tmp_path: Path) -> None:
    path = next(path for path in files(found) if path.name.startswith("3.clear"))
    small = dt.shrink(path)
    assert len(small.instance.e_agents) == 1
    assert len(small.instance.problem.network.segments) == 3
    judged = judge(small.instance, _simple, "simple")
    left = single_removals(judged)
    assert left
    for what, instance in left:
        again = confirm(instance, small.story.rule, _simple, "simple")
        lasts = None if again is None else again.breach(small.story.rule)
        assert lasts is None or lasts.tick < small.story.tick == small.instance.ticks, what
    small.write(tmp_path / "small.json")
    assert dt.load_instance(tmp_path / "small.json").duration == small.instance.duration
    assert dt.run_trial(dt.load_instance(tmp_path / "small.json"), "simple").score.verdict is not None


@pytest.mark.path
def test_commands_find_shrink_and_run_cases_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "found"
    arguments = ["--controller", "simple", "--rule", "3.stop", "--trials", "16", "--duration", "6", "-o"]
    assert main(["falsify", "junction", *arguments, str(folder), "--json"]) == 0
    told = capsys.readouterr()
    report = json.loads(told.out)
    assert report["trials"] == 16
    empty = [row for row in report["coverage"] if not row["tested"] and not row["broken"]]
    warning = f"{len(empty)} of {len(report['coverage'])} cells were never put to the test"
    assert (warning in told.err) == bool(empty)
    assert all(name.startswith("3.stop") for name in report["cases"])
    assert {row["rule"] for row in report["coverage"]} == {"3.stop"}
    case = str(next(files(folder)))
    assert main(["shrink", case, "-o", str(tmp_path / "missing" / "small.json")]) == 2
    told = capsys.readouterr().err
    assert "small.json: no such folder" in told
    assert "without" not in told, "work was done that could not be kept"
    assert main(["shrink", case, "-o", str(tmp_path / "small.json")]) == 0
    assert "without having stopped" in capsys.readouterr().out
    assert "<html" in (tmp_path / "small.html").read_text()
    assert main(["regress", str(folder), "--controller", "simple"]) == 1
    assert main(["regress", str(folder), "--controller", "rules"]) == 0
    assert main(["run", str(tmp_path / "small.json"), "--controller", "simple", "--json"]) == 0
    assert main(["regress", str(tmp_path / "none")]) == 2


def test_controllers_of_ones_own_are_searched_too(tmp_path: Path) -> None:
    result = dt.falsify(a_minute("junction"), Rolling, tmp_path / "own", trials=32, duration=8.0, rules=["1.road"])
    assert result.violated
    assert {case.story.rule for case in result.cases.values()} == {"1.road"}


def test_a_formula_and_the_least_score_can_be_asked_for(tmp_path: Path) -> None:
    asked = dt.falsify(a_minute("junction"), "simple", tmp_path / "f", trials=8, duration=6.0, formula="[] !left_ego")
    assert [case.story.rule for case in asked.cases.values()][:1] == ["formula asked"]
    least = dt.falsify(a_minute("junction"), "simple", tmp_path / "s", trials=16, duration=6.0, least_score=True)
    assert {case.story.rule for case in least.cases.values()} == {"score"}


def test_a_particle_that_branches_off_is_a_fork_bit_for_bit() -> None:
    instances = list(draw_many(corridor(3), 1, range(4)))
    begin = standing()
    whole = begin(instances)
    whole.advance(90)
    twin = MeasuredGroup(whole.group.fork(range(4), [7, 8, 9, 10]), whole.rule)
    whole.reseed([7, 8, 9, 10])
    for own in (whole, twin):
        own.advance(instances[0].ticks - 90)
    particles = [
        Particle(k, ((0, own.seed), (3, seed)))
        for k, (own, seed) in enumerate(zip(instances, (7, 8, 9, 10), strict=True))
    ]
    seeds = [own.seed for own in instances]
    paths = follow(particles, begin(instances), seeds, 30, instances[0].ticks)
    assert paths.margins.tolist() == twin.margins().tolist() == whole.margins().tolist()
    assert (np.diff(paths.scores, axis=1) <= 0.0).all()
    assert (paths.scores[:, -1] <= paths.margins).all()


def test_splitting_and_monte_carlo_agree_on_an_event_whose_probability_is_known() -> None:
    crossings, particles, runs = (6, 200, 20) if FULL else (4, 60, 16)
    known = 3.0**-crossings
    configuration = corridor(crossings)
    found = by_splitting(drawn(configuration, 5), standing(), "1.collision", NEAR, particles, runs, 1, lambda _: None)
    assert found.probability == pytest.approx(known, rel=0.3)
    assert found.interval[0] <= known <= found.interval[1]
    count = 60_000 if FULL else 1_500
    happened = 0
    for first in range(0, count, 500):
        company = standing()(list(draw_many(configuration, 9, range(first, first + 500))))
        company.advance(company.group.instances[0].ticks)
        happened += int((company.margins() <= NEAR).sum())
    low, high = clopper_pearson(happened, count)
    assert low <= known <= high


def test_an_event_of_one_in_a_million_is_estimated_with_fifty_thousand_trials() -> None:
    configuration, found = corridor(13), []
    runs, particles = (10, 2_500) if FULL else (1, 400)
    for run in range(runs):
        instances = list(draw_many(configuration, run, range(particles)))
        (once,) = split(instances, standing(), NEAR, [np.random.default_rng(run)])
        assert once.trials <= 50_000
        found.append(once.probability)
    if FULL:
        assert np.std(found, ddof=1) <= 0.5 * 3.0**-13
    assert 3.0**-13 / (2 if FULL else 6) <= np.mean(found) <= 3.0**-13 * (1.5 if FULL else 6)


@pytest.mark.path
def test_monte_carlo_counts_what_the_judge_says() -> None:
    from dubins_traffic.falsification.sampling import prepared
    from dubins_traffic.falsification.trying import LocalRunner

    configuration = prepared(a_minute("junction"), 6.0, {})
    found = by_counting(
        draw_many(configuration, 1, range(32)), LocalRunner("simple", "simple"), "3.stop", 0.0, lambda _: None
    )
    scores = dt.run_batch(configuration, "simple", trials=32, seed=1).sheet.trials
    broken = sum(score.verdict is not None and score.verdict.formulas["3.stop"] == "false" for score in scores)
    assert found.events == broken
    assert found.interval[0] <= found.probability <= found.interval[1]
