"""What a report says first, its short form in a terminal and for LaTeX, and two campaigns compared."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.report import across, terminal
from dubins_traffic.campaign.report.comparison import Comparison
from dubins_traffic.campaign.report.comparison import compare as compare_rows
from dubins_traffic.campaign.report.conclusion import conclusion
from dubins_traffic.campaign.report.worst import Bad
from dubins_traffic.campaign.report.write import escaped, latex_table
from dubins_traffic.cli.main import main
from dubins_traffic.protocols import End, Ending
from dubins_traffic.scoring.score import Score, Scorer
from tests.recordings import feed, make_frames, make_instance

COUNTED = {"good": [3, 3, 4, 3, 3, 4, 3, 3], "fair": [1, 1, 0, 1, 1, 2, 1, 1], "poor": [0] * 8}
BEFORE = {name: [float(value) + 0.25 for value in values] for name, values in COUNTED.items()}


@pytest.fixture(scope="module")
def plain() -> Score:
    instance = make_instance(goals=[(0, 0)], ticks=3)
    scorer = Scorer()
    feed(instance, make_frames(instance, [(0.2, 0.1)] * 4), scorer)
    return scorer.result(controller="lanes")


def kept(
    folder: Path,
    plain: Score,
    counted: Mapping[str, Sequence[int]],
    before: Mapping[str, Sequence[float]] | None = None,
    **changes: object,
) -> Comparison:
    """Keep a campaign of these counted rounds, a number a trial for each controller, in a folder, and compare them."""
    count = len(next(iter(counted.values())))
    document = {
        "version": 0,
        "name": "gaps",
        "trials": count,
        "controllers": list(counted),
        "configurations": ["demo"],
    }
    campaign = Campaign.from_document(document | changes, places=tuple(counted))
    made = [
        rows.row(
            k,
            Ending(End.DURATION, 3),
            replace(plain, counted_rounds=value, rounds=value, rounds_before_breach=first),
            {},
        )
        for k, (value, first) in enumerate(
            (value, first)
            for name, values in counted.items()
            for value, first in zip(values, (before or counted)[name], strict=True)
        )
    ]
    folder.mkdir(exist_ok=True)
    part = folder / "part.parquet"
    part.write_bytes(rows.encoded(rows.columns(made)))
    table.merge(campaign, [part], table.TableKind.RESULTS, folder / table.RESULTS)
    manifest.write(folder, campaign, manifest.make(campaign, "none"))
    return compare_rows(campaign, table.read(folder, campaign, []))


def test_it_says_who_is_best_and_by_how_much(tmp_path: Path, plain: Score) -> None:
    text = conclusion(kept(tmp_path, plain, COUNTED))
    assert text.startswith("good is best: 3.25 counted rounds a trial, 2.25 more than fair, the next (95 % interval ")
    assert "told apart" not in text


def test_it_says_who_cannot_be_told_apart(tmp_path: Path, plain: Score) -> None:
    same = {"one": [1, 2, 1, 2, 1, 2], "other": [2, 1, 2, 1, 1, 2], "none": [0] * 6, "nil": [0] * 6}
    text = conclusion(kept(tmp_path, plain, same))
    assert text.startswith("Which is best can't be told: one has 1.5 counted rounds a trial, 0 more than other")
    assert text.endswith("These can't be told apart either: none and nil.")


def test_without_counted_rounds_it_says_so_and_uses_those_before_the_first_breach(tmp_path: Path, plain: Score) -> None:
    counted = {"good": [0] * 6, "poor": [0] * 6}
    before = {"good": [0.5, 0.5, 0.75, 0.5, 0.5, 0.5], "poor": [0.25] * 6}
    text = conclusion(kept(tmp_path, plain, counted, before))
    assert text.startswith("No trial has a counted round. good is best: 0.5417 rounds before the first breach a trial,")


def test_of_five_pairs_nothing_is_claimed(tmp_path: Path, plain: Score) -> None:
    text = conclusion(kept(tmp_path, plain, {"good": [3] * 5, "poor": [0] * 5}))
    assert text.startswith("5 pairs of trials can't tell whether good or poor is better; it takes 6 or more.")


def test_of_one_controller_it_says_what_it_has(tmp_path: Path, plain: Score) -> None:
    text = conclusion(kept(tmp_path, plain, {"good": [3, 4, 3, 4]}))
    assert text == "good has 3.5 counted rounds a trial (95 % interval 3 to 4)."


def test_the_terminal_shows_thirty_lines_of_eighty_columns_whoever_drives(tmp_path: Path, plain: Score) -> None:
    names = [f"path/to/some/rather/long/folder/controller_{k}.py:Controller{k}" for k in range(12)]
    comparison = kept(tmp_path, plain, {name: [0, 0, 1, 0, 1, 0, 0, 1] for name in names})
    bad = Bad({"number": 7}, "ended by a fault: " + 9 * "for a long reason ", None, "")
    stream = StringIO()
    console = Console(width=80, file=stream, highlight=False)
    for part in terminal.short_tables(comparison):
        console.print(part, markup=False, soft_wrap=isinstance(part, str))
    for line in terminal.short_worst({name: [bad] for name in names}, "gaps"):
        console.print(line, soft_wrap=True)
    lines = stream.getvalue().rstrip("\n").split("\n")
    assert len(lines) <= 30 - 3, "three more lines say what e-agents broke, and where the page is"
    assert max(len(line) for line in lines) <= 80
    assert "5 more controllers" in stream.getvalue()


def test_metrics_that_are_zero_are_folded_away(tmp_path: Path, plain: Score) -> None:
    comparison = kept(tmp_path, plain, {"good": [3, 4, 3], "poor": [0, 1, 0]})
    shown = [metric.name for metric in terminal.short_metrics(comparison)]
    assert shown[0] == "counted_rounds", "no trial of this problem without rules is clean or not"
    assert len(shown) == terminal.MOST_COLUMNS
    assert not any(terminal.is_zero(comparison, metric) for metric in terminal.short_metrics(comparison))
    assert any(terminal.is_zero(comparison, metric) for metric in comparison.metrics)


def test_the_table_for_latex_is_one_row_a_controller(tmp_path: Path, plain: Score) -> None:
    comparison = kept(tmp_path, plain, {"my_file.py:A&B": [3, 4, 3], "100%": [0, 1, 0]})
    text = latex_table(comparison)
    assert r"\texttt{my\_file.py:A\&B} & $3.333$ [$3$, $4$] &" in text
    assert text.count(r" \\") == 3
    assert re.search(r"\\begin\{tabular\}\{lrrrr\}\n\\toprule\n.*\n\\midrule\n(.*\n){2}\\bottomrule\n", text)
    assert escaped("~^\\<x>\n%") == (
        r"\textasciitilde{}\textasciicircum{}\textbackslash{}\textless{}x\textgreater{} \%"
    )


def test_campaigns_on_the_same_instances_are_paired(tmp_path: Path, plain: Score) -> None:
    kept(tmp_path / "a", plain, {"mine": [1, 2, 3, 4, 5, 6], "gone": [0] * 6})
    kept(tmp_path / "b", plain, {"mine": [2, 3, 4, 5, 6, 7, 8], "new": [0] * 7})
    (found,), note = across.compare_campaigns(tmp_path / "a", tmp_path / "b")
    assert (found.first, found.second, found.paired, note) == ("mine", "mine", 6, "")
    change = next(own for own in found.changes if own.metric.name == "counted_rounds")
    assert (change.difference, change.interval, change.is_decided) == (1.0, (1.0, 1.0), True)
    assert across.said(found) == (
        "mine: 6 pairs of trials on the same instances (of 6 and 7 trials). "
        "B has 1 (95 % interval 1 to 1) more of counted rounds than A."
    )


def test_campaigns_of_other_seeds_are_not_paired_and_their_intervals_are_wider(tmp_path: Path, plain: Score) -> None:
    kept(tmp_path / "a", plain, {"mine": [1, 2, 3, 4, 5, 6]})
    kept(tmp_path / "b", plain, {"yours": [2, 3, 4, 5, 6, 7]}, seed=9)
    (found,), _ = across.compare_campaigns(tmp_path / "a", tmp_path / "b")
    assert (found.first, found.second, found.paired) == ("mine", "yours", 0)
    change = next(own for own in found.changes if own.metric.name == "counted_rounds")
    assert change.difference == pytest.approx(1.0)
    assert change.interval[0] < 0 < change.interval[1]
    assert "6 and 6 trials, of which no two are on the same instance" in across.said(found)
    assert "no metric tells the campaigns apart" in across.said(found)


def test_other_configurations_of_one_name_are_other_instances(tmp_path: Path, plain: Score) -> None:
    from tests.integration.test_campaign_report import TEN

    for name, duration in (("a", 10.0), ("b", 11.0)):
        entry = {"name": "ten", "document": {**TEN, "duration": duration}}
        kept(tmp_path / name, plain, {"mine": [1] * 6}, configurations=[entry])
    (found,), _ = across.compare_campaigns(tmp_path / "a", tmp_path / "b")
    assert found.paired == 0


def test_the_command_compares_two_campaigns(tmp_path: Path, plain: Score, capsys: pytest.CaptureFixture[str]) -> None:
    kept(tmp_path / "a", plain, {"mine": [1, 2, 3, 4, 5, 6]})
    kept(tmp_path / "b", plain, {"mine": [2, 3, 4, 5, 6, 7]})
    assert main(["campaign", "compare", str(tmp_path / "a"), str(tmp_path / "b")]) == 0
    said = capsys.readouterr().out
    assert "6 pairs of trials on the same instances" in said
    assert re.search(r"counted rounds +3.5 +4.5 +\+1 +1 \.\. 1", said)
    assert "0 in both; --all shows them." in said
    assert main(["campaign", "compare", str(tmp_path / "a"), str(tmp_path)]) == 2
    assert "no campaign; expected the folder of a campaign" in capsys.readouterr().err


def test_the_table_is_what_latex_reads(tmp_path: Path, plain: Score) -> None:
    """Without LaTeX here the braces and the columns are counted."""
    text = latex_table(kept(tmp_path, plain, COUNTED))
    assert text.count("{") == text.count("}")
    bodies = [line for line in text.split("\n") if line.endswith(r"\\")]
    assert {line.count(" & ") for line in bodies} == {4}


def test_the_statistics_of_independent_means_are_those_of_scipy() -> None:
    import numpy as np
    import scipy.stats

    from dubins_traffic.campaign.report.statistics import apart

    draws = np.random.default_rng(3)
    first, second = draws.normal(size=60), draws.normal(0.4, size=90)
    mean, interval = apart(first, second)
    theirs = scipy.stats.bootstrap(
        (second, first),
        lambda x, y, axis: x.mean(axis=axis) - y.mean(axis=axis),
        random_state=1,
        vectorized=True,
    ).confidence_interval
    assert mean == pytest.approx(second.mean() - first.mean())
    assert interval == pytest.approx((theirs.low, theirs.high), abs=0.05)
    assert apart(first[:0], second) == (None, None)
