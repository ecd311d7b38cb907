"""What other tools for reactive synthesis make of the smallest games of `synthesis-2026`, from one start each.

    python -m experiments solvers

TuLiP, omega with dd, and Spot, each in an environment of its own (`make tools`), get the game as a specification and
say whether the ego wins; Spot makes a strategy as well. Each has `PATIENCE` seconds and `MEMORY` a game. Ours solves
the whole game, from all positions; its seconds are those of building and solving it.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Final, NamedTuple

from benchmarks.table import Row, show
from tests.games import positions

from dubins_traffic.errors import InputError
from dubins_traffic.suites.running import board_of
from dubins_traffic.suites.suite import load_suite
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.specification import specification_text

ROOT: Final = Path(__file__).resolve().parents[1]
TOOLS: Final = ROOT / "build" / "crosscheck"
GAMES: Final = 12
PATIENCE: Final = 60.0
MEMORY: Final = 6 << 30
"""Bytes that a tool may take."""


class Told(NamedTuple):
    """What a tool says of a game: whether the ego wins, or None, in so many seconds, and what it prints."""

    wins: bool | None
    seconds: float
    words: str


def told(command: list[str], wins: Callable[[str], bool], given: str | None = None) -> Told:
    """Return what a tool prints for a game, given on its standard input or in a file."""
    began = perf_counter()
    try:
        done = subprocess.run(
            command, input=given, capture_output=True, text=True, timeout=PATIENCE, check=False,
            preexec_fn=_limit,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Told(None, PATIENCE, f"not in {PATIENCE:g} s")
    if done.returncode and ("emory" in done.stderr or "bad_alloc" in done.stderr):
        return Told(None, perf_counter() - began, f"not in {MEMORY >> 30} GiB")
    said = done.stdout.strip().splitlines()[-1:] or done.stderr.strip().splitlines()[-1:] or [""]
    return Told(wins(said[0]), perf_counter() - began, said[0])


def _limit() -> None:
    """Let this process have so much memory and no more."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def asked(board: Board, cells: list[int]) -> dict[str, Told]:
    """Return what each tool says of a game from one start."""
    found: dict[str, Told] = {}
    with tempfile.TemporaryDirectory() as name:
        files = {ending: Path(name) / f"game{ending}" for ending in (".py", ".tlsf")}
        for ending, file in files.items():
            file.write_text(specification_text(board, cells, ending), encoding="utf-8")
        tulip, omega, spot = (str(TOOLS / tool / "bin" / "python") for tool in ("tulip", "omega", "spot"))
        for tool, python, script, ending in (
            ("TuLiP", tulip, "tulip_realizable.py", ".py"), ("omega", omega, "written_game.py", ".tlsf")
        ):  # fmt: skip
            asks = [python, str(ROOT / "tests" / "crosscheck" / script)]
            texts = json.dumps([files[ending].read_text(encoding="utf-8")]) + "\n"
            found[tool] = told(asks, lambda said: said == "[true]", texts)
        solves = [
            spot,
            str(ROOT / "examples" / "spot_solve.py"),
            str(files[".tlsf"]),
            str(Path(name) / "found.hoa"),
        ]
        found["Spot"] = told(solves, lambda said: said.endswith("states"))
    return found


def measure(games: int = GAMES) -> list[Row]:
    """Return the rows of this experiment."""
    rows: list[Row] = []
    for entry in sorted(load_suite("synthesis-2026").model.games or (), key=lambda own: own.positions)[:games]:
        board = board_of(entry)
        if board.others + 1 > 2 * len(board.road_cells.nodes):
            rows.append(Row(entry.name, "no start without a queue: its order is no input", "", met=True))
            continue
        began = perf_counter()
        winning = solve(build(board)).winning
        ours = perf_counter() - began
        cells, position = next(positions(board, 1))
        wins = bool(winning[position])
        try:
            others = asked(board, cells)
        except InputError as error:
            rows.append(Row(entry.name, f"no specification: {error.problem}", "", met=True))
            continue
        words = [f"{name} {_figure(own)}" for name, own in others.items()]
        agrees = all(own.wins in (wins, None) for own in others.values())
        rows.append(
            Row(
                f"{entry.name}, {entry.positions:,} positions, the ego {'wins' if wins else 'loses'}: seconds",
                f"ours {ours:.2g}; " + "; ".join(words),
                "the same winner",
                agrees,
            )
        )
        print(rows[-1].name, rows[-1].figure, flush=True)
    return rows


def _figure(own: Told) -> str:
    if own.wins is None:
        return own.words
    return f"{own.seconds:.2g}" + (f", {own.words}" if own.words.endswith("states") else "")


if __name__ == "__main__":
    sys.exit(0 if show("solvers", measure(*map(int, sys.argv[1:]))) else 1)
