"""The tables of scores: what ranks comes first, the score of 2016 last, and all fits the terminal."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from dubins_traffic.campaign import rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.notice import assumption_notice
from dubins_traffic.campaign.report import terminal, worst
from dubins_traffic.campaign.report.comparison import Comparison, compare
from dubins_traffic.campaign.report.write import page
from dubins_traffic.cli import tables
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.scoring.collisions import Collision
from dubins_traffic.scoring.counts import ran_whole
from dubins_traffic.scoring.paper import network_size, paper_score
from dubins_traffic.scoring.score import Score, Scorer, ScoreSheet
from dubins_traffic.scoring.verdict import Excuse, Place, Ruling, Verdict, Violation, is_clean, was_cut
from tests.recordings import feed, make_frames, make_instance
from tests.rules_scripts import KITE, STAR

BREACH = Violation("2.left", "agent0", 1.0, 30, 1.0, Place(0.0, 0.0, None, None))


def verdict(ruling: str = "satisfied", *, fallen: bool = False, cut: bool = False) -> Verdict:
    excused = ruling == "excused"
    excuse = Excuse("E1", BREACH, False) if excused else None
    formulas = {"E1": "false" if fallen or excused else "presumably true"}
    clean = ruling in ("satisfied", "unfinished") and not cut
    near = False if excused else None
    found = Verdict(Ruling(ruling), clean, cut, excuse, near, (), (), 2, 1.0, 9.0, True, {}, {})
    return replace(found, formulas=formulas)


def scored(trial: int = 0, controller: str = "lanes", **changes: object) -> Score:
    instance = make_instance(goals=[(0, 0)], ticks=3)
    scorer = Scorer()
    feed(instance, make_frames(instance, [(0.2, 0.1)] * 4), scorer)
    return replace(scorer.result(controller=controller), trial=trial, **changes)


def text(*scores: Score, width: int = 80) -> str:
    stream = StringIO()
    Console(width=max(80, width), file=stream).print(tables.score_table(ScoreSheet(scores), width))
    return stream.getvalue()


def headings(told: str) -> list[str]:
    """Return the headings of a table, the words of each joined."""
    lines = told.split("\n")
    rule = next(k for k, line in enumerate(lines) if "───" in line)
    first = next(k for k, line in enumerate(lines) if "trial" in line)
    tops = lines[first - 1] if first and "controller" not in lines[first - 1] else ""
    return [*tops.split(), *lines[rule - 1].split()]


def test_what_ranks_comes_first_and_the_score_of_2016_last() -> None:
    low = headings(text(scored(verdict=verdict())))
    assert low[-2:] == ["paper", "2016"]
    assert low.index("clean") < low.index("verdict") < low.index("end")
    assert "off" not in low, "the road is one of the rules"
    assert "near" not in low, "nobody is excused"
    bare = text(scored())
    assert "clean" not in bare
    assert "off" in bare


def test_rounds_that_do_not_count_are_shown_beside_those_that_do() -> None:
    told = text(scored(rounds=7, counted_rounds=7), scored(1, rounds=5, counted_rounds=0))
    assert "0 of 5" in told
    assert " 7 " in told
    assert told.rstrip().split("\n")[-1].split()[:2] == ["sum", "7"]


def test_near_is_shown_where_somebody_is_excused() -> None:
    assert "near" in headings(text(scored(verdict=verdict("excused")), scored(1, verdict=verdict())))


def test_what_is_not_defined_is_a_dash_and_wraps_no_row() -> None:
    told = text(scored(icra2016=None), scored(1))
    lines = [line.split() for line in told.split("\n") if line.strip()]
    assert [line[-1] for line in lines if line[0] in ("0", "sum")] == ["-", "-"], "in its row and in the sum"
    assert len([line for line in lines if line[0].isdigit()]) == 2
    assert ScoreSheet((scored(icra2016=None), scored())).to_json()["icra2016_sum"] is None


@pytest.mark.parametrize("ruling", list(Ruling))
@pytest.mark.parametrize("end", [End.DURATION, End.CONTROLLER_FAULT])
def test_every_table_fits_eighty_columns(ruling: str, end: End) -> None:
    most = scored(
        end=end.value, verdict=verdict(ruling), interventions=1799, rounds=120, counted_rounds=0,
        icra2016=None, paper_score=123456.0,
    )  # fmt: skip
    for some in ((most,), (most, replace(most, controller="my_controller.py:MyController"))):
        told = text(*some)
        assert max(len(line.rstrip()) for line in told.split("\n")) <= 80
        assert headings(told)[-1] == "2016"


def test_a_wide_terminal_leaves_nothing_out() -> None:
    told = text(scored(verdict=verdict("excused"), interventions=5), width=200)
    for heading in ("driven", "gap", "fault", "end", "visited", "ticks", "near"):
        assert heading in told


def test_the_controller_with_the_most_counted_rounds_comes_first() -> None:
    stands = [scored(k, "stands", rounds=0, counted_rounds=0) for k in range(2)]
    quits = [scored(k, "quits", rounds=9, counted_rounds=0, end="gave_up") for k in range(2)]
    drives = [scored(k, "drives", rounds=1, counted_rounds=1) for k in range(2)]
    rows = [line.split()[:2] for line in text(*stands, *quits, *drives).split("\n") if line.strip()[:1].isdigit()]
    assert rows[:2] == [["0", "drives"], ["1", "drives"]]
    assert [trial for trial, _ in rows] == ["0", "1"] * 3


def test_rounds_before_the_first_breach_part_controllers_of_equal_counted_rounds() -> None:
    late = [scored(k, "late", counted_rounds=1 - k, rounds_before_breach=0.5 + k) for k in range(2)]
    soon = [scored(k, "soon", counted_rounds=k, rounds_before_breach=0.5) for k in range(2)]
    shown = text(*soon, *late, width=120)
    rows = [line.split() for line in shown.split("\n") if line.strip()[:1].isdigit()]
    assert [row[1] for row in rows] == ["late", "late", "soon", "soon"]
    assert [line.split().count("0.75") for line in shown.split("\n")].count(1) == 1, "the mean of the four"


def test_a_sheet_says_once_that_its_verdicts_say_little(capsys: pytest.CaptureFixture[str]) -> None:
    broken, kept = scored(verdict=verdict(fallen=True)), scored(verdict=verdict())
    for json in (True, False):
        tables.show(ScoreSheet((broken, broken, kept, scored())), json=json)
        told = capsys.readouterr().err
        assert told == (
            "dubins-traffic: e-agents broke what is assumed of them (E1 to E6) in 2 of 3 trials: "
            "these verdicts say little about the controller\n"
        )
        tables.show(ScoreSheet((broken, kept)), json=json)
        assert capsys.readouterr().err == ""


def test_the_notice_is_on_more_than_half() -> None:
    assert assumption_notice(0, 0) == ""
    assert assumption_notice(10, 20) == ""
    broken = "e-agents broke what is assumed of them (E1 to E6) in"
    assert assumption_notice(11, 20) == f"{broken} 11 of 20 trials: these verdicts say little about the controller"
    assert assumption_notice(1, 1) == f"{broken} 1 of 1 trial: this verdict says little about the controller"


# What counts


def test_a_trial_ran_whole_if_all_its_ticks_are_there() -> None:
    instance = make_instance(ticks=90)
    assert ran_whole(instance, Ending(End.DURATION, 90), 90)
    assert not ran_whole(instance, Ending(End.DURATION, 89), 89)
    assert not ran_whole(instance, Ending(End.DURATION, 90), 89), "a frame is missing"
    assert not ran_whole(instance, Ending(End.GAVE_UP, 90), 90)
    assert not ran_whole(instance, None, 90)


def test_a_trial_is_clean_if_it_ran_whole_and_the_ego_broke_nothing() -> None:
    hit = Collision(1.0, 30, "ego", "agent0", False, True)
    assert is_clean(None, (), whole=True)
    assert not is_clean(None, (), whole=False)
    assert not is_clean(None, (hit,), whole=True)
    assert is_clean(verdict(), (hit,), whole=True), "a verdict knows"
    assert not is_clean(verdict("violated"), (), whole=True)


@pytest.mark.parametrize("end", [*End, None])
def test_what_others_or_the_user_end_is_cut_neither_clean_nor_not(end: End | None) -> None:
    instance = make_instance(goals=[(0, 0)], ticks=90)
    instance = replace(instance, problem=replace(instance.problem, rules=RuleParameters().to_mapping()))
    scorer = Scorer()
    scorer.begin(instance)
    scorer.frames(make_frames(instance, [(0.2, -0.3)] * 4))
    if end is not None:
        scorer.end(Ending(end, 3))
    found = scorer.result()
    assert found.verdict is not None
    by_controller = end in BY_CONTROLLER
    assert (found.verdict.clean, found.verdict.cut) == (False, not by_controller)
    assert was_cut(found.verdict.verdict, found.verdict.clean, found.end) == found.verdict.cut
    assert found.counted_rounds == 0, "who is cut wins nothing by it"
    assert ScoreSheet((found,)).cut == (not by_controller)
    assert ("cut" in text(found).split()) == (not by_controller)


def test_the_paper_is_defined_everywhere() -> None:
    grid = make_instance()
    assert (network_size(grid.problem.network), network_size(STAR), network_size(KITE)) == (12, 9, 6)
    assert STAR.is_grid
    assert not KITE.is_grid
    assert paper_score(grid, (), 5, 0.5) == 2 * 12 * 5
    assert paper_score(grid, (), 5, 4.0) == 2 * 12 * 5 / 4.0
    assert paper_score(make_instance(names=["bus", "van"]), (), 5, 0.0) == 2 * 12 * 5
    assert paper_score(make_instance(names=[]), (), 5, 0.0) == 0.0
    car, post = (Collision(1.0, 30, "ego", name, True, False) for name in ("agent1", "obstacle 0"))
    assert paper_score(grid, (post, car), 5, 0.0) == -1.0
    assert paper_score(grid, (post,), 5, 0.0) == 2 * 12 * 5, "an obstacle is no vehicle"
    square = RoadNetwork(((0, 0, 2, 0), (2, 0, 2, 2)), 4.0, (0.0, 0.0, 0.0), (3, 3))
    assert network_size(square) == 3, "its segments pass over places of the lattice"


def test_the_score_of_2016_is_not_defined_off_the_grid() -> None:
    kite = make_instance(network=KITE, goals=[(0, 0)])
    scorer = Scorer()
    feed(kite, make_frames(kite, [(40.0, -12.0)] * 4), scorer)
    assert scorer.result().icra2016 is None
    assert scorer.result().paper_score == 2 * 6 * 1


# Of campaigns


def campaign_of(folder: Path, *found: tuple[End, Score]) -> tuple[Comparison, Any]:
    """Return the comparison of a campaign of two trials each of `lanes` and `simple`, and its table."""
    campaign = Campaign.from_document(
        {"version": 0, "trials": 2, "controllers": ["lanes", "simple"], "configurations": ["demo"]}
    )
    made = [rows.row(k, Ending(end, 3), own, {}) for k, (end, own) in enumerate(found)]
    part = folder / "part.parquet"
    part.write_bytes(rows.encoded(rows.columns(made)))
    results = table.read(folder, campaign, [part])
    table.merge(campaign, [part], table.TableKind.RESULTS, folder / table.RESULTS)
    return compare(campaign, results), results


def told(comparison: Comparison) -> str:
    stream = StringIO()
    for one in terminal.tables(comparison):
        Console(width=80, file=stream).print(one)
    return stream.getvalue()


def test_a_campaign_ranks_by_counted_rounds_and_puts_who_gave_up_last(tmp_path: Path) -> None:
    quits = End.GAVE_UP, scored(rounds=9, counted_rounds=0, verdict=verdict("unfinished"))
    drives = End.DURATION, scored(rounds=1, counted_rounds=1, verdict=verdict())
    comparison, results = campaign_of(tmp_path, quits, quits, drives, drives)
    assert comparison.controllers == ["simple", "lanes"]
    assert [standing.controller for standing in comparison.standings] == ["simple", "lanes"]
    assert {(one.first, one.second) for one in comparison.differences} == {("simple", "lanes")}
    assert worst.order(results).tolist() == [0, 1, 2, 3]
    why = worst.why(results.to_pylist()[0])
    assert why == "100% of the goals visited, 0 of 9 rounds count, gave up after 0.1 s"


def test_a_campaign_parts_equal_counted_rounds_by_those_before_the_first_breach(tmp_path: Path) -> None:
    found = [(End.DURATION, scored(counted_rounds=0, rounds_before_breach=own)) for own in (0.5, 0.5, 0.0, 1.5)]
    comparison, _ = campaign_of(tmp_path, *found)
    assert comparison.controllers == ["simple", "lanes"]


def test_a_ranking_of_the_worst_knows_no_excuse(tmp_path: Path) -> None:
    breach = replace(BREACH, car="ego")
    excused = replace(verdict("excused"), violations=(breach, breach))
    violated = replace(verdict("violated"), violations=(breach,))
    found = [(End.DURATION, scored(verdict=own)) for own in (violated, excused, verdict(), verdict())]
    assert worst.order(campaign_of(tmp_path, *found)[1]).tolist() == [1, 0, 2, 3], "more breaches are worse"


def test_a_campaign_counts_near_and_broken_assumptions_and_says_what_is_not_defined(tmp_path: Path) -> None:
    found = [
        (End.DURATION, scored(verdict=own, icra2016=None))
        for own in (replace(verdict("excused"), near=True), verdict("excused"), verdict(), verdict())
    ]
    comparison, _ = campaign_of(tmp_path, *found)
    assert (comparison.broken, comparison.judged) == table.assumption(tmp_path) == (2, 4)
    own = {standing.controller: standing for standing in comparison.standings}
    assert (own["lanes"].near.count, own["lanes"].near.total, own["simple"].near.total) == (1, 2, 0)
    assert [(own[name].clean.count, own[name].clean.total) for name in own] == [(0, 2), (2, 2)]
    lines = told(comparison).split("\n")
    assert any("excused, near" in line and "50.0%" in line for line in lines)
    assert any("ICRA" in line and "not defined" in line for line in lines)
    (tmp_path / "other").mkdir()
    defined, _ = campaign_of(tmp_path / "other", *((end, replace(own, icra2016=4.0)) for end, own in found))
    assert "not defined" not in told(defined)


@pytest.mark.parametrize("broken", [2, 3])
def test_the_page_of_a_report_says_that_its_verdicts_say_little(broken: int, tmp_path: Path) -> None:
    found = [(End.DURATION, scored(verdict=verdict(fallen=k < broken))) for k in range(4)]
    comparison, _ = campaign_of(tmp_path, *found)
    made = {"versions": {}, "campaign": "", "configurations": {}, "controllers": [], "code": ""}
    text = page(replace(comparison, metrics=()), made, {})
    notice = "e-agents broke what is assumed of them (E1 to E6) in 3 of 4 trials: these verdicts say little about"
    assert (notice in text) == (broken == 3)
    assert text.index("<th>clean</th>") < text.index("<th>counted rounds</th>") < text.index("<th>satisfied</th>")


def own(rule: str, time: float) -> Violation:
    return Violation(rule, "ego", time, round(30 * time), time, Place(0.0, 0.0, None, None))


def judged(trial: int, *breaches: Violation, **changes: Any) -> Score:
    return scored(trial, verdict=replace(verdict("violated"), violations=breaches), **changes)


def test_below_the_table_stands_what_cost_most_and_where_to_look():
    first = judged(0, own("3.stop", 2.0), BREACH, own("2.left", 9.0))
    second = judged(1, own("3.clear", 1.0), own("2.left", 4.77), record="out/trial 1.mcap")
    said, kept = tables.worst(ScoreSheet((first, second)))
    assert said == "Cost most: 2.left, 2 times, first in trial 0 at 9.00 s."
    assert "--records" in kept
    said, see = tables.worst(ScoreSheet((second,)))
    assert said == "Cost most: 3.clear, once, in trial 1 at 1.00 s."
    assert see == "To see it: dubins-traffic replay 'out/trial 1.mcap' --at 0.00"


def test_below_a_table_without_breaches_or_of_several_controllers_stands_nothing():
    assert tables.worst(ScoreSheet((judged(0, BREACH),))) == []
    several = judged(0, own("2.left", 1.0)), judged(0, own("2.left", 1.0), controller="simple")
    assert tables.worst(ScoreSheet(several)) == []
