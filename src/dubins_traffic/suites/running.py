"""A suite is run: its trials as a campaign, its cases one by one, its games by a solver."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final

from pydantic import ValidationError

from dubins_traffic.above import ABOVE
from dubins_traffic.campaign import rows
from dubins_traffic.campaign.manifest import hash_of_file
from dubins_traffic.campaign.notice import fault_notice
from dubins_traffic.campaign.report.plots import figures
from dubins_traffic.campaign.report.statistics import distributions
from dubins_traffic.campaign.run_campaign import Progress, run_campaign
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers import registry as controllers_by_name
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked, make_folder, read_text, write_text
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.header import bare_name
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.jobs import Job, run_trials
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.registry import STRATEGY_SHARE
from dubins_traffic.suites.results import KEPT, GameResult, played, save, save_trials
from dubins_traffic.suites.suite import CaseEntry, GameEntry, Suite
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build, save_game
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.solver import solve

CASES_FILE: Final = "cases.jsonl"
COLUMNS: Final = (*KEPT, STRATEGY_SHARE, "reason", *rows.WALL)
"""What is kept of a case; reasons stay in the folder."""
Found = dict[str, dict[str, dict[str, Any]]]
"""What came of each case, by controller and case: columns of a campaign's table."""


def case_instance(entry: CaseEntry) -> Instance:
    """Return the instance of a case; InputError if it is none, or leaves something to be drawn."""
    left = [name for name in ("starts", "duration", "seed", "trial") if name not in entry.document]
    if left:
        raise InputError("a case that leaves something to be drawn", field=f"{entry.name}.{left[0]}")
    return instance_from_document(entry.document, entry.name)


def case_instances(entries: Sequence[CaseEntry]) -> dict[str, Instance]:
    """Return the instances of cases by their names.

    InputError if one is none, leaves something to be drawn, or is another one once more.
    """
    instances = {entry.name: case_instance(entry) for entry in entries}
    names: dict[str, str] = {}
    for name, instance in instances.items():
        if (other := names.setdefault(_key(instance), name)) != name:
            raise InputError("the same case twice", field="cases", value=name, expected=f"one other than {other}")
    return instances


def run_cases(
    suite: Suite,
    folder: Path,
    specs: Sequence[str],
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Run the cases of a suite, or those that are left, with some controllers; return the file of results.

    Raises
    ------
    InputError
        If the suite has no cases, a controller can't be loaded, the folder holds results and they are not to be gone on
        with or are of another suite, or a file can't be written.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    entries = suite.model.cases
    if entries is None:
        raise InputError("a suite without cases", file=suite.file or suite.name)
    instances = case_instances(entries)
    for spec in specs:
        controllers.load(spec)
    make_folder(folder, "results", begun=resume)
    with locked(folder):
        file = folder / CASES_FILE
        known = _kept_cases(file, suite) if file.exists() else {}
        if file.exists() and not resume:
            raise InputError("holds results", file=str(folder), expected="a new folder; --resume goes on with it")
        _run(suite, file, instances, specs, known, workers, progress or (lambda _done, _total: None))
        named = {bare_name(spec): known[bare_name(spec)] for spec in specs}
        columns = {
            name: {column: [its_rows[case][column] for case in instances] for column in COLUMNS}
            for name, its_rows in named.items()
        }
        listed = [
            {
                "controller": name,
                "file": hash_of_file(spec),
                "ran": controllers.ran(spec),
                "columns": played({column: its_columns[column] for column in (*KEPT, STRATEGY_SHARE)}),
            }
            for (name, its_columns), spec in zip(columns.items(), specs, strict=True)
        ]
        seconds = {name: {column: its_columns[column] for column in rows.WALL} for name, its_columns in columns.items()}
        return save(suite, folder, {"entries": listed}, {"entries": seconds})


def _run(
    suite: Suite,
    file: Path,
    instances: Mapping[str, Instance],
    specs: Sequence[str],
    known: Found,
    workers: int,
    progress: Callable[[int, int], object],
) -> None:
    """Run what is left and keep each case when it is done."""
    cases = {_key(instance): name for name, instance in instances.items()}
    total = len(specs) * len(instances)
    for spec in specs:
        rows_of_case = known.setdefault(bare_name(spec), {})
        left = [instance for name, instance in instances.items() if name not in rows_of_case]
        metrics = scores.with_share((), [spec])
        jobs = [Job(one.trial or 0, one.seed or 0, spec, instance=one, metrics=metrics) for one in left]
        for result in run_trials(jobs, workers):
            row = rows.row(0, result.ending, result.score, result.wall.act_s)
            rows_of_case[cases[_key(result.instance)]] = {column: row.get(column) for column in COLUMNS}
            _keep_cases(file, suite, known)
            progress(sum(map(len, known.values())), total)


def faulty(folder: Path, suite: Suite) -> str:
    """Return the notice that cases in a folder ended by a fault; empty if none did."""
    ended = [
        (f"{case} with {name}: {row['end']}: {row['reason'] or ''}".rstrip(": "), row["end"])
        for name, its_rows in _kept_cases(folder / CASES_FILE, suite).items()
        for case, row in its_rows.items()
    ]
    bad = [(line, end) for line, end in ended if end in FAULTS]
    return fault_notice(Counter(end for _, end in bad), len(ended), bad[0][0] if bad else "")


def _key(instance: Instance) -> str:
    return json.dumps(instance_to_document(instance), sort_keys=True)


def _keep_cases(file: Path, suite: Suite, known: Found) -> None:
    lines: list[Mapping[str, Any]] = [{"hash": suite.hash}]
    lines += [
        {"controller": name, "case": case, "row": row}
        for name, its_rows in known.items()
        for case, row in its_rows.items()
    ]
    write_text(file, "".join(json.dumps(line) + "\n" for line in lines))


def _kept_cases(file: Path, suite: Suite) -> Found:
    """Return what is kept in a folder; InputError if it is of another suite."""
    try:
        first, *rest = [json.loads(line) for line in read_text(file).splitlines()]
        if first != {"hash": suite.hash}:
            raise InputError("results of another suite", file=str(file), expected="a new folder")
        known: Found = {}
        for line in rest:
            if line["row"].keys() != set(COLUMNS):
                raise KeyError("row")
            known.setdefault(line["controller"], {})[line["case"]] = line["row"]
        return known
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("can't be read as results", file=str(file), expected="a new folder") from None


OWN: Final = "dubins-traffic"
GAME: Final = "{game}"
"""Stands in the command of a solver for the file of the game."""
GAMES_FILE: Final = "games.jsonl"
LONGEST_FAULT: Final = 300


@dataclass(frozen=True, slots=True)
class Solver:
    """Who solves the games: `command` with ``{game}`` for the file, None for ourselves; at most `seconds` each."""

    name: str = OWN
    command: str | None = None
    seconds: float = 600.0

    def solve(self, entry: GameEntry) -> tuple[GameResult, float]:
        """Return the answer on a game, and the seconds that it took."""
        if self.command is None:
            begun = perf_counter()
            solution = solve(build(board_of(entry)))
            winning, positions = int(solution.winning.sum()), solution.game.positions
            result = GameResult(positions=positions, winning=winning, realizable=solution.everywhere)
            return result, perf_counter() - begun
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{entry.name}.npz"
            save_game(build(board_of(entry)), path)
            return self._by_command(self.command, path)

    def _by_command(self, command: str, path: Path) -> tuple[GameResult, float]:
        words = [str(path) if word == GAME else word for word in shlex.split(command)]
        begun = perf_counter()
        try:
            ran = subprocess.run(words, capture_output=True, text=True, check=False, timeout=self.seconds)
        except subprocess.TimeoutExpired:
            return GameResult(fault=f"no answer within {self.seconds:g} s"), perf_counter() - begun
        except OSError as error:
            raise InputError(
                f"can't be run ({error.strerror})", file="--solver", value=words[0], expected="a program"
            ) from None
        seconds = perf_counter() - begun
        if ran.returncode != 0:
            last = (ran.stderr.strip().splitlines() or [""])[-1]
            return GameResult(fault=f"exit status {ran.returncode}: {last}"[:LONGEST_FAULT]), seconds
        return _answer(ran.stdout), seconds


def check_command(command: str) -> None:
    """Raise InputError unless a command of a solver names the game's file."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise InputError(f"not a command ({error})", file="--solver", value=command) from None
    if GAME not in words:
        raise InputError("names no file of a game", file="--solver", value=command, expected=f"a word {GAME}")


def _answer(printed: str) -> GameResult:
    """Return what a solver has printed: JSON on its last line."""
    line = (printed.strip().splitlines() or [""])[-1]
    try:
        answer: Any = json.loads(line)
        known = {name: answer[name] for name in ("positions", "winning", "realizable") if name in answer}
        if "winning" not in known and "realizable" not in known:
            raise ValueError
        return GameResult.model_validate(known)
    except (ValueError, TypeError, ValidationError):
        expected = 'JSON with "winning" or "realizable" on the last line'
        return GameResult(fault=f"no answer: printed {line!r}, not {expected}"[:LONGEST_FAULT])


def board_of(entry: GameEntry) -> Board:
    """Return the positions of a game; InputError if it is none."""
    network = RoadNetwork.from_document(entry.rnd)
    goals = [network.vertex((x, y)) for x, y in entry.goals]
    words = [word for word in entry.assume.split(",") if word]
    return Board(RoadCells.of(network, goals, entry.order_degree), Assumption.parse(words), entry.cars)


def agrees(entry: GameEntry, result: GameResult) -> bool | None:
    """Say whether an answer is right; None where there is none."""
    everywhere = entry.winning == entry.positions
    checks = [
        wanted == given
        for wanted, given in (
            (entry.positions, result.positions),
            (entry.winning, result.winning),
            (everywhere, result.realizable),
        )
        if given is not None
    ]
    return all(checks) if checks else None


def run_games(
    suite: Suite,
    folder: Path,
    solver: Solver,
    *,
    resume: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Let a solver solve the games of a suite, or those that are left; return the file of results.

    Each answer is kept in the folder as soon as it is known.

    Raises
    ------
    InputError
        If the suite has no games, the folder holds answers and they are not to be gone on with, those are another
        solver's, or a file can't be written.
    KeyboardInterrupt
        On Ctrl-C; the answers that are there are kept.
    """
    games = suite.model.games
    if games is None:
        raise InputError("a suite of trials, which has no games", file=suite.file or suite.name)
    make_folder(folder, "answers", begun=resume)
    with locked(folder):
        file = folder / GAMES_FILE
        answers = _kept_games(file, suite, solver) if file.exists() else {}
        if file.exists() and not resume:
            raise InputError("holds answers", file=str(folder), expected="a new folder; --resume goes on with it")
        for k, entry in enumerate(games):
            if progress is not None:
                progress(k, len(games))
            if entry.name not in answers:
                answers[entry.name] = solver.solve(entry)
                _keep_games(file, suite, solver, answers)
        if progress is not None:
            progress(len(games), len(games))
        results = {name: result.model_dump() for name, (result, _) in answers.items()}
        seconds = {name: spent for name, (_, spent) in answers.items()}
        return save(
            suite,
            folder,
            {"solvers": [{"solver": solver.name, "games": results}]},
            {"solvers": {solver.name: seconds}},
        )


def _keep_games(file: Path, suite: Suite, solver: Solver, answers: dict[str, tuple[GameResult, float]]) -> None:
    lines: list[dict[str, Any]] = [{"hash": suite.hash, "solver": solver.name, "command": solver.command}]
    lines += [{"game": name, "seconds": s, "answer": result.model_dump()} for name, (result, s) in answers.items()]
    write_text(file, "".join(json.dumps(line) + "\n" for line in lines))


def _kept_games(file: Path, suite: Suite, solver: Solver) -> dict[str, tuple[GameResult, float]]:
    """Return the answers that are kept in a folder; InputError if they are of another suite or solver."""
    try:
        first, *rest = [json.loads(line) for line in read_text(file).splitlines()]
        head = {"hash": suite.hash, "solver": solver.name, "command": solver.command}
        if first != head:
            raise InputError("answers of another suite or solver", file=str(file), expected="a new folder")
        return {each["game"]: (GameResult.model_validate(each["answer"]), float(each["seconds"])) for each in rest}
    except (ValueError, KeyError, TypeError):
        raise InputError("can't be read as answers", file=str(file), expected="a new folder") from None


def run_suite(
    suite: Suite,
    folder: str | os.PathLike[str],
    controllers: Sequence[str] = (),
    *,
    trials: int | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Path:
    """Run the trials of a suite, or the remaining ones, and write the results.

    Parameters
    ----------
    suite : Suite
        A suite of trials.
    folder : path
        Folder of a campaign, made if missing.
    controllers : sequence of str
        The controllers to run; by default those of the suite's page.
    trials : int, optional
        Number of trials of each combination, if fewer are to be run.
    workers, resume, progress
        As for `run_campaign`.

    Returns
    -------
    path : Path
        The file of results.

    Raises
    ------
    InputError
        As `Suite.campaign` and `run_campaign`; what is finished is kept.
    MissingExtraError
        Without what a page of results needs; nothing is written then.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    rows.arrow()
    figures()
    distributions()
    campaign = suite.campaign(controllers or suite.controllers, trials)
    ran = run_campaign(campaign, folder, workers=workers, resume=resume, progress=progress)
    return save_trials(suite, campaign, ran.folder)


def seated(specs: Sequence[str]) -> tuple[list[str], str]:
    """Return controllers with a box for each whose code is not ours, and a notice on those for which there is none.

    Parameters
    ----------
    specs : sequence of str
        Names of controllers; those that ask for a box have it already.

    Returns
    -------
    specs : list of str
        The names with which they run.
    notice : str
        Says which run in this process, trusted, since this machine has no boxes; empty if none does.
    """
    strangers = [
        spec
        for spec in specs
        if controllers_by_name.ran(spec) == controllers_by_name.IN_PROCESS and not controllers_by_name.is_ours(spec)
    ]
    if not strangers:
        return list(specs), ""
    if reason := ABOVE.why_no_boxes():
        return list(specs), f"{', '.join(strangers)}: in process, trusted, since {reason}"
    return [controllers_by_name.sandboxed(spec) if spec in strangers else spec for spec in specs], ""
