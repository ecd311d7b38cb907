"""The game of cells: the known results, speed and memory, long plays, and omega with dd on the same game.

Speed is measured in a process of its own whose kernels have been compiled before.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.table import Row
from tests.game_reference import Arrays
from tests.property.test_game_reference import SQUARE, position, reference

from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Leaving
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.routes import route_bound
from dubins_traffic.synthesis.solver import Solution, solve
from dubins_traffic.synthesis.strategy import Strategy
from experiments.play import Environment, play

ROOT = Path(__file__).resolve().parents[1]
OMEGA = ROOT / "build" / "crosscheck" / "omega" / "bin" / "python"
ALL = "E1,E2,E3,E4,E5,E6"
KEEP_MOVING = "E1:any-order,E2,E3,E4,E5,E6"
ONCE = "E1,E2,E3:one-forfeit,E4,E5,E6"
OFTEN = "E1,E2,E3:forfeits,E4,E5,E6"
UNMET = "E1,E2,E3,E4:unmet,E5,E6"
MOVES_UP = "E1,E2,E3,E4,E5:moves-up,E6"
TURNS = 1_000_000

KNOWN: tuple[tuple[int, int, int, str, int, int, int, int], ...] = (
    (3, 4, 1, "E6", 1, 3_668, 0, 0),
    (2, 2, 2, KEEP_MOVING, 1, 660, 660, 0),
    (3, 4, 2, KEEP_MOVING, 1, 45_540, 45_540, 0),
    (2, 2, 3, KEEP_MOVING, 1, 1_980, 0, 0),
    (3, 4, 3, KEEP_MOVING, 1, 652_740, 0, 0),
    (2, 2, 3, ALL, 1, 2_724, 2_724, 0),
    (2, 2, 4, ALL, 1, 6_600, 6_600, 0),
    (2, 2, 9, ALL, 1, 4_800, 4_800, 0),
    (2, 2, 10, ALL, 1, 1_408, 1_408, 1_088),
    (3, 4, 3, ALL, 1, 788_336, 788_336, 0),
    (3, 3, 4, ALL, 1, 1_748_215, 1_748_215, 0),
    (4, 4, 3, ALL, 1, 2_951_656, 2_951_656, 0),
    (2, 2, 3, ONCE, 1, 13_284, 13_284, 0),
    (3, 4, 3, ONCE, 1, 4_298_028, 4_298_028, 0),
    (3, 4, 3, OFTEN, 1, 788_336, 0, 0),
    (3, 4, 1, "E6", 3, 3_784, 0, 0),
    (3, 4, 2, KEEP_MOVING, 3, 58_800, 57_664, 0),
    (3, 4, 3, KEEP_MOVING, 3, 921_200, 196, 196),
    (2, 2, 2, ALL, 3, 1_680, 1_680, 0),
    (2, 2, 3, ALL, 3, 7_280, 7_280, 0),
    (2, 2, 4, ALL, 3, 21_840, 21_340, 60),
    (2, 2, 6, ALL, 3, 80_080, 64_060, 2_460),
    (2, 2, 7, ALL, 3, 102_960, 67_728, 6_448),
    (3, 4, 3, ALL, 3, 1_063_444, 1_063_444, 0),
    (3, 3, 4, ALL, 3, 2_836_770, 2_836_770, 0),
    (3, 4, 3, OFTEN, 3, 1_063_444, 588, 588),
    (2, 2, 2, UNMET, 3, 1_680, 784, 0),
    (3, 4, 2, UNMET, 3, 63_204, 63_012, 0),
    (2, 2, 4, MOVES_UP, 3, 21_840, 21_840, 0),
    (2, 2, 6, MOVES_UP, 3, 80_080, 80_080, 0),
    (2, 2, 7, MOVES_UP, 3, 102_960, 102_960, 16),
)
"""Rows, columns, e-agents, assumption, least degree of a crossing; positions, those won, those of them vacuous."""

TIMED = """
import json, resource, sys, tempfile, time
from experiments.synthesis import board
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.solver import solve
from dubins_traffic.synthesis.strategy import Strategy
def run(size):
    begun = time.perf_counter()
    solution = solve(build(board(*size)))
    with tempfile.TemporaryDirectory() as folder:
        Strategy.of(solution).save(folder + "/strategy.npz")
    return time.perf_counter() - begun
run((2, 2, 1))
seconds = run(tuple(json.loads(sys.argv[1])))
print(json.dumps([seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


def board(rows: int, columns: int, others: int, assumed: str = ALL, order_degree: int = 1) -> Board:
    """Return the positions on a grid with goals at two opposite corners."""
    network = RoadNetwork.grid(rows, columns)
    road_cells = RoadCells.of(network, [0, len(network.intersections) - 1], order_degree)
    return Board(road_cells, Assumption.parse(assumed.split(",")), others)


def measure() -> list[Row]:
    """Return the rows of the table."""
    rows = [*_speed(), *_against_omega(), _against_textbook()]
    for case in KNOWN:
        solution = solve(build(board(*case[:5])))
        rows.append(_known(case, solution))
        if case[:5] in ((3, 4, 3, ALL, 1), (3, 3, 4, ALL, 1)):
            rows += _played(f"{case[0]}x{case[1]}, {case[2]} cars", Strategy.of(solution))
    sizes = [(*size, degree) for degree in (1, 3) for size in ((2, 2), (3, 4), (3, 3), (4, 4))]
    bounds = [route_bound(board(*size, 1, ALL, degree).road_cells, Assumption()) for *size, degree in sizes]
    known = [9, 41, 28, 59, 3, 36, 23, 55]
    name = "bound of fixed routes, 2x2, 3x4, 3x3 and 4x4, crossings from 1 and from 3"
    return [*rows, Row(name, f"{bounds}", f"{known}", bounds == known)]


def _known(case: tuple[int, int, int, str, int, int, int, int], solution: Solution) -> Row:
    grid_rows, columns, others, assumed, degree, *expected = case
    found = [solution.game.positions, int(solution.winning.sum()), int(solution.vacuous.sum())]
    name = f"{grid_rows}x{columns}, {others} cars, {assumed}, crossings from {degree}: positions, won, vacuous"
    return Row(name, _numbers(found), _numbers(expected), found == expected)


def _numbers(values: list[int]) -> str:
    return ", ".join(f"{value:,}".replace(",", " ") for value in values)


def _speed() -> list[Row]:
    found: list[Row] = []
    for size, seconds, mebibytes in (((3, 4, 3), 5.0, 1024.0), ((4, 4, 3), 25.0, 4096.0)):
        took, used = json.loads(_run([sys.executable, "-c", TIMED, json.dumps(size)]))
        name = f"{size[0]}x{size[1]}, {size[2]} cars: build, solve, save the strategy"
        found.append(Row(name, f"{took:.2f} s", f"< {seconds:g} s", took < seconds))
        found.append(Row("  memory", f"{used:.0f} MiB", f"< {mebibytes:g} MiB", used < mebibytes))
    return found


def _played(name: str, strategy: Strategy) -> list[Row]:
    found: list[Row] = []
    for environment in Environment:
        played = play(strategy, TURNS, environment, seed=1)
        figure = f"visits {played.visits}, longest gap {max(played.gaps)} turns, astray {played.astray}"
        met = played.turns == TURNS and not played.astray and min(played.visits) > 100
        found.append(Row(f"{name}: {TURNS:,} turns, {environment.name.lower()}", figure, "goals recur", met))
    return found


def request(some: Board, *, lost: bool = False) -> dict[str, Any]:
    """Return a game as `tests/crosscheck/omega_game.py` takes it."""
    road_cells, assumed = some.road_cells, some.assumption
    return {
        "following": [list(road_cells.following(cell)) for cell in range(road_cells.cells)],
        "nodes": len(road_cells.nodes),
        "goals": [list(nodes) for nodes in road_cells.goal_nodes],
        "targets": [list(nodes) for nodes in road_cells.targets],
        "others": some.others,
        "ordered": assumed.order == "kept",
        "enters": [n for n, node in enumerate(road_cells.nodes) if _entered(node.crossing, assumed)],
        "crossings": [n for n, node in enumerate(road_cells.nodes) if node.crossing],
        "opposite": [road_cells.opposite(n) for n in range(len(road_cells.nodes))],
        "beside": [_beside(road_cells, n) for n in range(len(road_cells.nodes))],
        "leaves": assumed.leaves is not Leaving.NEVER,
        "unmet": assumed.leaves is Leaving.UNMET,
        "moves_up": assumed.arrives is Arriving.MOVES_UP,
        "frees": assumed.frees,
        "list": lost,
    }


def _beside(road_cells: RoadCells, node: int) -> list[int]:
    """Return the exits of a node and the lanes beside them."""
    return [len(road_cells.nodes) + lane for out in road_cells.nodes[node].exits for lane in (out, out ^ 1)]


def _entered(crossing: bool, assumed: Assumption) -> bool:
    return assumed.enters if crossing else assumed.arrives is not Arriving.NEVER


def _against_omega() -> list[Row]:
    if not OMEGA.is_file():
        return [Row("omega with dd to ours", "not installed: scripts/crosscheck-tools.sh", "> 10", met=False)]
    script = str(ROOT / "tests" / "crosscheck" / "omega_game.py")
    found: list[Row] = []
    for size in ((2, 2, 3), (3, 4, 2)):
        some = board(*size)
        other = json.loads(_run([str(OMEGA), script], json.dumps(request(some))))
        took, _ = json.loads(_run([sys.executable, "-c", TIMED, json.dumps(size)]))
        ratio = other["seconds"] / took
        figure = f"{other['seconds']:.1f} s to {took:.2f} s: {ratio:.0f}"
        met = ratio > 10 and other["winning"] == math.factorial(some.others) * some.positions
        name = f"{size[0]}x{size[1]}, {size[2]} cars: omega with dd to ours"
        found.append(Row(name, figure, "> 10, the same winners", met))
    return found


def _against_textbook() -> Row:
    """Compare with the nested fixpoint on labelled states, evaluated as it stands."""
    solution = solve(build(board(2, 2, 4)))
    game = reference(SQUARE, 4, {})
    arrays = Arrays(game)
    winners = arrays.winning()
    numbers = [position(solution.game.board, game, state) for state in arrays.states]
    same = bool((winners == solution.winning[numbers]).all())
    figure = f"{len(arrays.states):,} labelled states, {'the same' if same else 'other'} winners"
    return Row("2x2, 4 cars: textbook", figure, "the same winners", same)


def _run(command: list[str], text: str = "") -> str:
    ran = subprocess.run(command, input=text, capture_output=True, text=True, check=True, cwd=ROOT)
    return ran.stdout.strip().splitlines()[-1]
