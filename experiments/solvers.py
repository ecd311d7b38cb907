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
from itertools import permutations
from pathlib import Path
from random import Random
from time import perf_counter
from typing import Final, NamedTuple

from benchmarks.table import Row, show

from dubins_traffic.errors import InputError
from dubins_traffic.suites.running import board_of
from dubins_traffic.suites.suite import load_suite
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.specification import specification_text

ROOT: Final = Path(__file__).resolve().parents[1]
TOOLS: Final = ROOT / "build" / "crosscheck"
GAMES: Final = 12
PATIENCE: Final = 60.0
MEMORY: Final = 6 << 30
"""Bytes that a tool may take."""
TULIP: Final = """
import runpy, sys
from tulip.interfaces import omega
print(omega.is_realizable(runpy.run_path(sys.argv[1])["specification"]))
"""


class Told(NamedTuple):
    """What a tool says of a game: whether the ego wins, or None, in so many seconds, and what it prints."""

    wins: bool | None
    seconds: float
    words: str


def start_of(board: Board) -> tuple[list[int], int]:
    """Return cells of the cars, no two before one crossing, and the position that they make."""
    cells, nodes = board.road_cells, len(board.road_cells.nodes)
    every = list(permutations(range(cells.cells), board.others + 1))
    Random(2016).shuffle(every)
    for own in every:
        ends = [cells.lane_end[cell - nodes][0] for cell in own if cell >= nodes]
        if len(set(ends)) == len(ends):
            return list(own), board.number([_scene(board, node, own) for node in range(nodes)])
    raise ValueError("there is no such start")


def _scene(board: Board, node: int, cells: tuple[int, ...]) -> Scene:
    nodes = len(board.road_cells.nodes)
    who = [WHO.EGO if car == 0 else WHO.OTHER for car in range(len(cells))]
    inside = who[cells.index(node)] if node in cells else None
    lanes = [nodes + lane for lane in board.road_cells.nodes[node].inbound]
    return Scene(inside, tuple((lanes.index(cell), who[k]) for k, cell in enumerate(cells) if cell in lanes))


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
        found["TuLiP"] = told([tulip, "-c", TULIP, str(files[".py"])], lambda said: said == "True")
        written = str(ROOT / "tests" / "crosscheck" / "written_game.py")
        texts = json.dumps([files[".tlsf"].read_text(encoding="utf-8")]) + "\n"
        found["omega"] = told([omega, written], lambda said: said == "[true]", texts)
        script = [
            spot,
            str(ROOT / "examples" / "spot_solve.py"),
            str(files[".tlsf"]),
            str(Path(name) / "found.hoa"),
        ]
        found["Spot"] = told(script, lambda said: said.endswith("states"))
    return found


def measure(games: int = GAMES) -> list[Row]:
    """Return the rows of this experiment."""
    rows: list[Row] = []
    for entry in sorted(load_suite("synthesis-2026").model.games or (), key=lambda own: own.positions)[
        :games
    ]:
        board = board_of(entry)
        began = perf_counter()
        winning = solve(build(board)).winning
        ours = perf_counter() - began
        cells, position = start_of(board)
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
