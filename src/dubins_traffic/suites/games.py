"""Games of a suite are solved, by us or by a program from elsewhere that is given the exported game."""

from __future__ import annotations

import json
import shlex
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any, Final

from pydantic import ValidationError

from dubins_traffic.errors import InputError
from dubins_traffic.files import locked, make_folder, read_text, write_text
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.suites.results import GameResult, save
from dubins_traffic.suites.suite import GameEntry, Suite
from dubins_traffic.synthesis.arena import Arena
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.export import save_game
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.solver import solve

OWN: Final = "dubins-traffic"
GAME: Final = "{game}"
"""Stands in the command of a solver for the file of the game."""
KEPT: Final = "games.jsonl"
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
            found = GameResult(positions=positions, winning=winning, realizable=solution.everywhere)
            return found, perf_counter() - begun
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
        said: Any = json.loads(line)
        known = {name: said[name] for name in ("positions", "winning", "realizable") if name in said}
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
    return Board(Arena.of(network, goals, entry.order_degree), Assumption.parse(words), entry.cars)


def agrees(entry: GameEntry, found: GameResult) -> bool | None:
    """Say whether an answer is right; None where there is none."""
    everywhere = entry.winning == entry.positions
    checks = [
        wanted == given
        for wanted, given in (
            (entry.positions, found.positions),
            (entry.winning, found.winning),
            (everywhere, found.realizable),
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
        file = folder / KEPT
        answers = _kept(file, suite, solver) if file.exists() else {}
        if file.exists() and not resume:
            raise InputError(
                "holds answers", file=str(folder), expected="a new folder; --resume goes on with it"
            )
        for k, entry in enumerate(games):
            if progress is not None:
                progress(k, len(games))
            if entry.name not in answers:
                answers[entry.name] = solver.solve(entry)
                _keep(file, suite, solver, answers)
        if progress is not None:
            progress(len(games), len(games))
        results = {name: found.model_dump() for name, (found, _) in answers.items()}
        seconds = {name: spent for name, (_, spent) in answers.items()}
        return save(
            suite,
            folder,
            {"solvers": [{"solver": solver.name, "games": results}]},
            {"solvers": {solver.name: seconds}},
        )


def _keep(file: Path, suite: Suite, solver: Solver, answers: dict[str, tuple[GameResult, float]]) -> None:
    lines: list[dict[str, Any]] = [{"hash": suite.hash, "solver": solver.name, "command": solver.command}]
    lines += [
        {"game": name, "seconds": s, "answer": found.model_dump()} for name, (found, s) in answers.items()
    ]
    write_text(file, "".join(json.dumps(line) + "\n" for line in lines))


def _kept(file: Path, suite: Suite, solver: Solver) -> dict[str, tuple[GameResult, float]]:
    """Return the answers that are kept in a folder; InputError if they are of another suite or solver."""
    try:
        first, *rest = [json.loads(line) for line in read_text(file).splitlines()]
        own = {"hash": suite.hash, "solver": solver.name, "command": solver.command}
        if first != own:
            raise InputError("answers of another suite or solver", file=str(file), expected="a new folder")
        return {
            each["game"]: (GameResult.model_validate(each["answer"]), float(each["seconds"])) for each in rest
        }
    except (ValueError, KeyError, TypeError):
        raise InputError("can't be read as answers", file=str(file), expected="a new folder") from None
