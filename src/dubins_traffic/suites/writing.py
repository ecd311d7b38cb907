"""Results of a suite: a page, a table in Markdown, and numbers as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.columns import SCORES, SECOND
from dubins_traffic.campaign.report.comparison import WALL_METRICS, Comparison, Standing, shown
from dubins_traffic.campaign.report.statistics import Estimate, Share, share
from dubins_traffic.campaign.report.write import csv_files, page
from dubins_traffic.errors import InputError
from dubins_traffic.files import make_folder, require_output, write_text
from dubins_traffic.record.sink import BY_CONTROLLER, FAULTS
from dubins_traffic.scoring.verdict import OF_SIMULATED, told_cut, was_cut
from dubins_traffic.suites.results import (
    GameResult,
    Source,
    check_suite,
    compare_trials,
    entry_name,
    made_by,
    named_entries,
    shares,
    where_they_ran,
)
from dubins_traffic.suites.running import agrees
from dubins_traffic.suites.suite import GameEntry, Suite
from dubins_traffic.viewer.pages import render

PAGE = "index.html"
TABLE = "results.md"
NOTE = "Brackets: 95 % intervals, of means by bootstrap, of shares Wilson's."
RIGHT: Mapping[bool | None, str] = {True: "right", False: "wrong", None: "no answer"}

Columns = Mapping[str, Sequence[Any]]


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers of one solver: `results` and `seconds`, by the names of the games."""

    name: str
    results: Mapping[str, GameResult]
    seconds: Mapping[str, float]


def results(suite: Suite, sources: Sequence[Source]) -> dict[str, str]:
    """Return the files of results by name: `PAGE`, `TABLE`, and of a suite of trials CSV; same sources, same texts.

    InputError as `compare_trials`, `columns_of` and `answers_of`.
    """
    how_lines = [line for line in (where_they_ran(sources), made_by(sources)) if line]
    how = " ".join(how_lines)
    note = "".join(f"\n{line}\n" for line in (*shares(sources), *how_lines))
    if suite.model.cases is not None:
        columns_by_name = columns_of(suite, sources)
        head, body, summary, made = (
            ["case", *columns_by_name],
            _case_lines(suite, columns_by_name),
            "",
            {"hash": suite.hash},
        )
    elif suite.model.games is not None:
        answers = answers_of(suite, sources)
        head, body, summary = _game_columns(answers), _game_lines(suite, answers), _summary(suite, answers)
        made = {"suite": suite.name, "hash": suite.hash}
    else:
        comparison, manifest = compare_trials(suite, sources)
        return {
            **csv_files(comparison),
            TABLE: trials_table(suite, comparison) + note,
            PAGE: page(comparison, manifest, {}),
        }
    whole = render(
        "suites/answers.html",
        title=suite.label,
        subtitle=suite.model.title,
        heading="Cases" if suite.model.games is None else "Answers",
        columns=head,
        body=body,
        summary=summary,
        made=made,
        how=how,
    )
    text = f"# {suite.name}\n\n{suite.model.title}. Hash `{suite.hash}`.\n\n{markdown_table(head, body)}"
    return {TABLE: text + (f"\n{summary}\n" if summary else "") + note, PAGE: whole}


def write_results(suite: Suite, sources: Sequence[Source], folder: Path, *, overwrite: bool = False) -> str:
    """Write the files of results into a folder and return the table in Markdown.

    Files that are there are replaced only if `overwrite` is given. InputError as `results`, if a path is refused
    (`files.require_output`), or if a file can't be written.
    """
    texts = results(suite, sources)
    make_folder(folder, "results")
    for name in texts:
        require_output(folder / name, "results", [Path(name).suffix], overwrite=overwrite)
    for name, text in texts.items():
        write_text(folder / name, text)
    return texts[TABLE]


def markdown_table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a table; the first column to the left, the others to the right."""
    lines = [head, [":--", *["--:"] * (len(head) - 1)], *body]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def trials_table(suite: Suite, comparison: Comparison) -> str:
    """Return a heading, the table of the controllers, the best by the suite's metric first, and how to read it."""
    metric = SCORES[suite.model.metric].column
    timed = [metric_of_time for metric_of_time in WALL_METRICS if metric_of_time in comparison.metrics]
    judged = any(standing.judged for standing in comparison.standings)
    verdicts = [ruling.value for ruling in OF_SIMULATED] if judged else []
    head = [
        "controller",
        "trials",
        f"{metric.heading}, mean",
        "sum",
        f"{SCORES[SECOND].column.heading}, mean",
    ]
    head += ["clean", *verdicts] if judged else []
    head += [
        "collisions",
        "fault of the ego",
        "ended by the controller",
        "came to nothing",
        *(f"{metric_of_time.label}, ms" for metric_of_time in timed),
    ]
    ranked = sorted(
        comparison.standings,
        key=lambda of_controller: [_over_all(of_controller, name) for name in (metric.name, SECOND)],
        reverse=True,
    )
    body = [
        [
            standing.controller,
            str(standing.trials),
            _estimate(standing.estimates[metric.name]),
            shown(_sum(standing.estimates[metric.name])),
            _estimate(standing.estimates[SECOND]),
            *([_clean_share(standing), *(_share(standing.verdicts.get(name)) for name in verdicts)] if judged else []),
            str(standing.collisions),
            str(standing.faults["the ego"] + standing.faults["both"]),
            str(standing.ended.count),
            str(sum(standing.ends[end].count for end in rows.NOTHING if end in standing.ends)),
            *(_milliseconds(standing.estimates[metric_of_time.name].mean) for metric_of_time in timed),
        ]
        for standing in ranked
    ]
    count = comparison.campaign.cells[0].count
    fewer = "" if count == suite.trials else f", {count} of {suite.trials} trials of each combination"
    heading = f"# {suite.name}{fewer}\n\n{suite.model.title}. Hash `{suite.hash}`."
    return f"{heading}\n\n{markdown_table(head, body)}\n{NOTE}\n"


def columns_of(suite: Suite, sources: Sequence[Source]) -> dict[str, Columns]:
    """Return the columns of each entry in files of results, one value a case.

    InputError if the suite is another one here, a name stands twice, or a file has not the cases of the suite.
    """
    check_suite(suite, sources)
    count = len(suite.model.cases or ())
    columns_by_name: dict[str, Columns] = {}
    for one in named_entries(sources):
        columns = one.entry.columns
        for name in ("end", "verdict", "clean", "breaches"):
            if len(columns.get(name, ())) != count:
                raise InputError(
                    "a column is missing, or of another length",
                    file=str(one.source.path),
                    field=f"{one.entry.controller}.columns.{name}",
                    expected=f"{count} values",
                )
        columns_by_name[one.name] = columns
    return columns_by_name


def answers_of(suite: Suite, sources: Sequence[Source]) -> list[Answers]:
    """Return the answers in files of results; InputError if the suite is another one here, or a name stands twice."""
    check_suite(suite, sources)
    answers: list[Answers] = []
    for source in sources:
        for entry in source.results.solvers:
            name = entry_name(source, entry.solver, len(source.results.solvers))
            if any(name == other.name for other in answers):
                raise InputError(
                    "name taken", file=str(source.path), value=name, expected="NAME=PATH with another name"
                )
            seconds = {} if source.wall is None else source.wall.solvers.get(entry.solver, {})
            answers.append(Answers(name, entry.games, seconds))
    return answers


def _case_lines(suite: Suite, columns_by_name: Mapping[str, Columns]) -> list[list[str]]:
    cases = suite.model.cases or ()
    rows = [[case.name, *(_said(columns, k) for columns in columns_by_name.values())] for k, case in enumerate(cases)]
    ended = ["ended by the controller", *(str(_ended(columns)) for columns in columns_by_name.values())]
    return [*rows, ["clean", *(_clean(columns) for columns in columns_by_name.values())], ended]


def _said(columns: Columns, case: int) -> str:
    """Return the verdict on a case, or how it ended if by a fault, and how many rules the ego broke."""
    verdict, end, broken = (columns[name][case] for name in ("verdict", "end", "breaches"))
    if verdict is None or end in FAULTS:
        verdict = str(end).replace("_", " ")
    return f"{verdict}, {broken} breach{'es' if broken != 1 else ''}" if broken else str(verdict)


def _ended(columns: Columns) -> int:
    return sum(end in BY_CONTROLLER for end in columns["end"])


def _clean(columns: Columns) -> str:
    cut = sum(map(was_cut, columns["verdict"], columns["clean"], columns["end"]))
    clean = share(sum(bool(value) for value in columns["clean"]), len(columns["clean"]) - cut)
    low, high = clean.interval or (0.0, 1.0)
    return f"{clean.count} of {clean.total} [{low:.1%}, {high:.1%}]{told_cut(cut)}"


def _game_columns(answers: Sequence[Answers]) -> list[str]:
    head = ["game", "e-agents", "assumed", "positions", "won", "realizable"]
    return head + [f"{solver.name}{what}" for solver in answers for what in ("", ", s")]


def _game_lines(suite: Suite, answers: Sequence[Answers]) -> list[list[str]]:
    return [
        [
            game.name,
            str(game.cars),
            game.assume or "nothing",
            f"{game.positions:,}",
            f"{game.winning:,}",
            _realizable(game),
            *(cell for solver in answers for cell in _verdict_and_seconds(game, solver)),
        ]
        for game in suite.model.games or ()
    ]


def _realizable(game: GameEntry) -> str:
    if game.winning == game.positions:
        return "everywhere"
    return "somewhere" if game.winning else "nowhere"


def _verdict_and_seconds(game: GameEntry, solver: Answers) -> tuple[str, str]:
    answer = solver.results.get(game.name)
    right = None if answer is None else agrees(game, answer)
    return RIGHT[right], shown(solver.seconds.get(game.name))


def _summary(suite: Suite, answers: Sequence[Answers]) -> str:
    games = suite.model.games or ()
    lines: list[str] = []
    for solver in answers:
        right = sum(_verdict_and_seconds(game, solver)[0] == RIGHT[True] for game in games)
        spent = sum(solver.seconds.get(game.name, 0.0) for game in games)
        took = f" in {shown(spent)} s" if solver.seconds else ""
        lines.append(f"{solver.name}: {right} of {len(games)} right{took}.")
    return " ".join(lines)


def _over_all(standing: Standing, name: str) -> float:
    """Return the mean of a column over all trials; one that came to nothing counts 0, so no crash hides a trial."""
    estimate = standing.estimates[name]
    return (estimate.mean or 0.0) * estimate.count / max(1, standing.trials)


def _sum(estimate: Estimate) -> float | None:
    return None if estimate.mean is None else estimate.mean * estimate.count


def _milliseconds(seconds: float | None) -> str:
    return shown(None if seconds is None else 1e3 * seconds)


def _estimate(estimate: Estimate) -> str:
    ends = estimate.mean_interval
    return shown(estimate.mean) + ("" if ends is None else f" [{shown(ends[0])}, {shown(ends[1])}]")


def _clean_share(standing: Standing) -> str:
    return _share(standing.clean) + told_cut(standing.cut)


def _share(share: Share | None) -> str:
    if share is None or share.share is None or share.interval is None:
        return shown(None)
    return f"{share.share:.1%} [{share.interval[0]:.1%}, {share.interval[1]:.1%}]"
