"""`dubins-traffic check` and `dubins-traffic score`: recorded trials are judged, or scored, again."""

from __future__ import annotations

import json as json_text
import re
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dubins_traffic.cli import faults, options
from dubins_traffic.errors import InputError, shown
from dubins_traffic.rules.clauses import explain

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from dubins_traffic.record.reader import Record
    from dubins_traffic.record.sink import Ending
    from dubins_traffic.scoring.score import Score
    from dubins_traffic.scoring.verdict import Verdict
    from dubins_traffic.synthesis.related import Relation


EXAMPLES = options.examples(
    "check out/*.mcap",
    "check out/trial-0000.mcap --json",
    "check out/*.mcap --formula 'on the road=[] on_road_ego'",
    "check out/*.mcap --game",
)
NAMED = re.compile(r"([A-Za-z][\w -]{0,99})=(?!>)(.+)", re.DOTALL)
"""A formula with a name before it: a `=` that is none of the formula's own, as in `=>`."""
FormulaOption = Annotated[
    list[str] | None,
    typer.Option("--formula", metavar="[NAME=]F", help="A formula that is asked of the records, too; again for more."),
]


def check(
    records: Annotated[list[str], typer.Argument(metavar="RECORD...", help="Records, `*.mcap`.", show_default=False)],
    formula: FormulaOption = None,
    game: Annotated[
        bool,
        typer.Option("--game", help="Say whether each trial is a play of the game that `synth` solves, move by move."),
    ] = False,
    json: options.Json = False,
) -> None:
    """Judge recorded trials by the rules of the road and by formulas: verdicts, and every breach of every car.

    Labels and contacts are found again from poses and commands, whatever the records say of them.
    """
    from dubins_traffic.campaign.notice import assumption_notice
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import ScoreSheet, score
    from dubins_traffic.verification.worlds import from_poses, with_formulas

    asked = _formulas(formula or [])
    read: list[tuple[str, Record]] = []
    for name in records:
        record = load_record(name)
        carrying = with_formulas(record.instance, {**record.instance.problem.formulas, **asked})
        read.append((name, from_poses(replace(record, instance=carrying))))
    scores = [score(record) for _, record in read]
    judged = [
        (name, record.ending, scored, _relation(name, record, scored) if game else None)
        for (name, record), scored in zip(read, scores, strict=True)
    ]
    if json:
        documents = [_document(record, scored, relation) for record, _, scored, relation in judged]
        print(json_text.dumps({"records": documents}, indent=2))
    else:
        for record, ending, scored, relation in judged:
            _show(shown(record), ending, scored)
            if relation is not None:
                print(f"  {_played(relation)}")
    faults.warn(assumption_notice(*ScoreSheet(tuple(scores)).assumption_broken))


def _relation(name: str, record: Record, scored: Score) -> Relation:
    """Return what a trial is as a play of the game; InputError if it has none."""
    from dubins_traffic.synthesis.related import relate

    if scored.verdict is None:
        raise InputError("the problem does not ask for the rules, so there is no game", file=name, field="rules")
    try:
        return relate(record, scored.verdict)
    except InputError as error:
        raise error.within(file=name) from None


def _played(relation: Relation) -> str:
    """Return what a trial is as a play of the game, in words."""
    unknown = relation.unknown
    if unknown is not None:
        why = f", when {unknown.breach}" if unknown.breach else ""
        play = f"a play of the game until {unknown.time:.3f} s{why}: {unknown.move} is no move of it"
    else:
        play = f"a play of the game: {relation.moves} moves"
    return f"{play}; the ego took {relation.longest_move:.1f} s at most for a move that it had"


def _formulas(given: list[str]) -> dict[str, str]:
    """Return formulas by their names; one without a name is called by its text. InputError if two have one name."""
    by_name: dict[str, str] = {}
    for text in given:
        named = NAMED.fullmatch(text.strip())
        name, formula = (text.strip(), text) if named is None else (named[1].strip(), named[2])
        if name in by_name:
            raise InputError("two formulas of one name", field="--formula", value=name)
        by_name[name] = formula
    return by_name


def _document(record: str, score: Score, relation: Relation | None) -> dict[str, Any]:
    verdict = score.verdict
    document: dict[str, Any] = {
        "record": record,
        "end": score.end,
        "clean": None if verdict is None else verdict.clean,
        "cut": None if verdict is None else verdict.cut,
        "verdict": None if verdict is None else verdict.verdict.value,
        "near": None if verdict is None else verdict.near,
        "violations": [] if verdict is None else [entry.to_json() for entry in verdict.violations],
        "rounds": score.rounds,
        "counted_rounds": score.counted_rounds,
        "longest_gap_s": max((goal.longest_gap_s for goal in score.goals), default=None),
    }
    if score.formulas:
        document["formulas"] = [formula.to_json() for formula in score.formulas]
    if relation is not None:
        document["game"] = relation.to_json()
    return document


def _show(record: str, ending: Ending | None, score: Score) -> None:
    """Print a verdict for people: one line, an early end, why, the formulas' verdicts, a table of the breaches."""
    from rich.console import Console

    from dubins_traffic.cli.tables import verdict_text
    from dubins_traffic.record.sink import End

    console = Console(highlight=False, soft_wrap=True)
    verdict = score.verdict
    if verdict is None:
        console.print(f"{record}: not judged, the problem does not ask for the rules", markup=False)
    else:
        _show_verdict(record, verdict, console)
    if ending is None or ending.end != End.DURATION:
        console.print(f"  ended early: {'cut off' if ending is None else shown(str(ending))}", markup=False)
    for formula in score.formulas:
        console.print(f"  {shown(formula.name)}: {verdict_text(formula)}", markup=False)
    if verdict is not None and verdict.violations:
        console.print(_breaches(verdict))
        first = verdict.violations[0].rule if verdict.excuse is None else verdict.excuse.assumption
        console.print(f"  what a rule says: {explain(first)}", markup=False)


def _show_verdict(record: str, verdict: Verdict, console: Console) -> None:
    clean = "clean" if verdict.clean else "cut" if verdict.cut else "not clean"
    console.print(f"{record}: {clean}, {verdict.verdict}, {verdict.rounds} rounds", markup=False)
    if verdict.longest_gap_s is not None and verdict.gap_limit_s is not None:
        twice = "every goal was visited" if verdict.recurrent else "some goal was not visited"
        console.print(
            f"  the longest time without a visit of some goal was {verdict.longest_gap_s:.1f} s, and `satisfied` "
            f"allows {verdict.gap_limit_s:.1f} s; {twice} twice after the start",
            markup=False,
        )
    if verdict.excuse is not None:
        excuse = verdict.excuse
        sensed = "within" if excuse.sensed else "beyond"
        first = f"{excuse.violation.car} broke {excuse.violation.rule} at {excuse.violation.time:.3f} s"
        near = "before each breach" if verdict.near else "not before every breach"
        console.print(f"  excused by {excuse.assumption}: {first}, {sensed} the sensing radius", markup=False)
        console.print(f"  {near} of the ego, a car near it had just broken a rule", markup=False)
    from dubins_traffic.scoring.margins import UNITS

    known = [(rule, value) for rule, value in verdict.robustness.items() if value is not None]
    margins = [f"{rule} {value:.3f} {UNITS.get(rule, 'm')}" for rule, value in known]
    if margins:
        console.print(f"  robustness: {', '.join(margins)}", markup=False)


def _breaches(verdict: Verdict) -> Table:
    """Return the breaches as a table."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for heading in ("time", "since", "car", "rule", "x", "y"):
        left = heading in ("car", "rule")
        table.add_column(heading, justify="left" if left else "right", no_wrap=True)
    for entry in verdict.violations:
        x, y = f"{entry.where.x:.2f}", f"{entry.where.y:.2f}"
        table.add_row(f"{entry.time:.3f}", f"{entry.since:.3f}", entry.car, entry.rule, x, y)
    return table


SCORE_EXAMPLES = options.examples(
    "score out/*.mcap", "score out/trial-0000.mcap --json", "score out/*.mcap --metric time_to_collision"
)


def score(
    records: Annotated[list[str], typer.Argument(metavar="RECORD...", help="Records, `*.mcap`.", show_default=False)],
    metric: options.Metrics = None,
    json: options.Json = False,
) -> None:
    """Score recorded trials, with the same code as `run` does live."""
    from dubins_traffic.cli.tables import show
    from dubins_traffic.runs.sources import load_record
    from dubins_traffic.scoring.score import ScoreSheet
    from dubins_traffic.scoring.score import score as score_record

    scores = (score_record(load_record(record), metric or ()) for record in records)
    show(ScoreSheet(tuple(scores)), json=json)
