"""Bounds without a search, counterstrategies and their stories, strengthenings, and the command `synth`."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

import numpy as np
import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.files import write_document
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.answer import answer, smallest
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.counter import Counterstrategy, story_of
from dubins_traffic.synthesis.game import build
from dubins_traffic.synthesis.instance import cell_of, cells_of, start_positions
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.routes import route_bound
from dubins_traffic.synthesis.solver import Solution, solve
from dubins_traffic.synthesis.strategy import Strategy, check_ranks
from tests.games import ALL, board, pan, solved

KEEP_MOVING = "E1:any-order,E2,E3,E4,E5,E6"


def solved_pan(others: int, goals: Sequence[int], assumed: str = ALL) -> Solution:
    return solve(build(pan(others, goals, assumed)))


def test_bounds_of_an_ego_on_shortest_routes() -> None:
    up = Assumption.parse(["E1", "E2", "E3", "E4", "E5:moves-up"])
    bounds = {
        (rows, columns, degree): [
            route_bound(board(rows, columns, 1, ALL, degree).road_cells, assumed) for assumed in (Assumption(), up)
        ]
        for rows, columns, degree in ((2, 2, 1), (3, 4, 1), (2, 2, 3), (3, 4, 3))
    }
    assert bounds == {(2, 2, 1): [9, 9], (3, 4, 1): [41, 41], (2, 2, 3): [3, 5], (3, 4, 3): [36, 42]}
    for left_out in ("E1", "E2", "E3", "E4", "E5"):
        parts = [part for part in ALL.split(",") if part != left_out]
        assert route_bound(board(2, 2, 1).road_cells, Assumption.parse(parts)) == 0
    assert route_bound(board(3, 4, 1, ALL, 4).road_cells, Assumption()) == 0
    for weak in ("E1,E2,E3,E4:unmet,E5", "E1,E2,E3:forfeits,E4,E5"):
        assert route_bound(board(3, 4, 1).road_cells, Assumption.parse(weak.split(","))) == 0
    once = Assumption.parse(["E1", "E2", "E3:one-forfeit", "E4", "E5"])
    assert route_bound(board(3, 4, 1).road_cells, once) == 41


def test_a_goal_in_a_dead_end_bears_two_or_one_if_it_is_no_crossing() -> None:
    network = pan(1, [0]).road_cells.network
    dead_end = network.vertex((2, 1))
    assert route_bound(RoadCells.of(network, [0, dead_end]), Assumption()) == 2
    assert route_bound(RoadCells.of(network, [0, dead_end], 3), Assumption()) == 1
    up = Assumption.parse(["E1", "E2", "E3", "E4", "E5:moves-up"])
    assert route_bound(RoadCells.of(network, [0, dead_end], 3), up) == 2
    assert route_bound(RoadCells.of(network, [0, 3]), Assumption()) > 2


def test_the_bound_holds_where_games_can_be_solved() -> None:
    for others in (5, 6):
        assert solved(2, 2, others).everywhere
    for others in (1, 2):
        assert solved_pan(others, [0, 4], "E1,E2,E3,E4,E5").everywhere
    assert not solved_pan(3, [0, 4], "E1,E2,E3,E4,E5").everywhere
    assert solved(2, 2, 3, "E1,E2,E3,E4,E5", 3).everywhere
    assert not solved(2, 2, 4, "E1,E2,E3,E4,E5", 3).everywhere
    assert solved(2, 2, 5, "E1,E2,E3,E4,E5:moves-up", 3).everywhere
    for others, assumed in ((1, "E1,E2,E3,E4,E5"), (2, "E1,E2,E3,E4,E5:moves-up")):
        assert solve(build(pan(others, [0, 4], assumed, 3))).everywhere
    assert not solve(build(pan(2, [0, 4], "E1,E2,E3,E4,E5", 3))).everywhere


def test_wins_at_the_cost_of_the_environment_are_told_apart() -> None:
    """Three e-agents fill a dead end; the ego before it keeps them there, so that the goal is never free again."""
    for others, goals, vacuous in ((2, [0, 4], 0), (3, [0, 3], 0), (3, [0, 4], 7_476)):
        found = solved_pan(others, goals)
        assert found.everywhere
        assert int(found.vacuous.sum()) == vacuous
    found = solved_pan(3, [4])
    check_ranks(found.game, found.ranks)
    assert found.everywhere
    assert ((found.ranks[0].rank >= 0) == ~found.vacuous).all()
    assert 0 < int(found.vacuous.sum()) < found.game.positions
    assert not found.vacuous[found.game.at_target(0)].any()


@pytest.mark.parametrize(
    ("rows", "columns", "others", "assumed"),
    [
        (2, 2, 3, KEEP_MOVING),
        (3, 4, 1, "E6"),
        (2, 2, 2, "E1,E2,E3,E4,E6"),
        (2, 2, 3, "E2,E3,E4,E5,E6"),
        (2, 2, 2, "E1,E2,E3:forfeits,E4,E5,E6"),
    ],
)
def test_the_counterstrategy_keeps_a_goal_from_the_ego_and_pays_its_debts(
    rows: int, columns: int, others: int, assumed: str
) -> None:
    solution = solved(rows, columns, others, assumed)
    counter, game, random = Counterstrategy(solution), solution.game, Random(3)
    lost = np.flatnonzero(~solution.winning)
    for start in (lost[0], lost[len(lost) // 2], lost[-1]):
        position = int(start)
        debt, level, streaks, at_goal = 0, counter.level(position), dict[int, int](), 0
        for _ in range(250):
            after, debt = counter.choose(position, debt)
            assert after in game.to[game.to_at[position] : game.to_at[position + 1]]
            position = random.choice(game.ego_to[game.ego_at[after] : game.ego_at[after + 1]].tolist())
            before, level = level, counter.level(position)
            assert level <= before
            streaks = {owed: streaks.get(owed, 0) + 1 for owed in counter.debts(position)}
            assert level < before or max(streaks.values(), default=0) < 60
            sought = solution.losses[level].goal
            at_goal = at_goal + int(game.at_target(sought)[position]) if level == before else 0
        assert at_goal == 0


def test_the_story_of_the_gatekeeper_and_the_relay() -> None:
    solution = solved(2, 2, 3, KEEP_MOVING)
    lines = story_of(Counterstrategy(solution), 1_000)
    text = "\n".join(lines)
    assert "the ego can be kept from goal [0, 0] for ever" in lines[0]
    assert "turns this repeats every" in text
    kept = re.search(r"e-agent (\d) holds \S+ \d\] > \[0, 0\]: again and again e-agent (\d) is in \[0, 0\]", text)
    assert kept is not None
    assert re.search(rf"e-agent {kept[2]} goes by .*\[0, 0\], ", text)


def test_the_story_of_a_parked_car_and_of_one_that_rams() -> None:
    parked = solved(2, 2, 2, "E1,E2,E3,E4,E6")
    text = "\n".join(story_of(Counterstrategy(parked), 0))
    assert "E5 is not assumed, so it need not come to the end of the lane" in text
    rams = solved(2, 2, 2, "E1,E3,E4,E5,E6")
    text = "\n".join(story_of(Counterstrategy(rams), int(np.argmax(~rams.winning))))
    assert "an e-agent drives into the ego: E2 is not assumed" in text


def test_the_smallest_strengthening() -> None:
    def everywhere(solution: Solution) -> bool:
        return solution.everywhere

    for assumed, better in (
        ("E1,E2,E4,E5,E6", ["E1,E2,E3:one-forfeit,E4,E5,E6"]),
        (KEEP_MOVING, [ALL]),
        ("E2,E4,E5", ["E1,E2,E3:one-forfeit,E4,E5"]),
    ):
        found = smallest(board(2, 2, 3, assumed), everywhere)
        assert [str(assumption) for assumption in found] == better
    for some in (board(2, 2, 4, ALL, 3), board(2, 2, 4, ALL.replace("E5,", ""), 3)):
        (found,) = smallest(some, everywhere)
        assert str(found) == "E1,E2,E3,E4,E5:moves-up,E6"


def test_the_starts_of_an_instance_are_positions_of_the_game() -> None:
    for trial in range(6):
        instance = draw(load_config("demo"), 3, trial)
        road_cells = cells_of(instance.problem)
        some = Board(road_cells, Assumption(), len(instance.e_agents))
        cells = [cell_of(road_cells, instance.problem, pose) for pose in instance.starts]
        starts = start_positions(some, instance)
        assert bool(starts) is (len(set(cells)) == len(cells))
        for position in starts:
            scenes = some.scenes(position)
            lanes = {
                len(road_cells.nodes) + road_cells.nodes[n].inbound[slot]
                for n, scene in enumerate(scenes)
                for slot, _ in scene.queue
            }
            assert lanes | {n for n, scene in enumerate(scenes) if scene.inside is not None} == set(cells)


@pytest.mark.parametrize(
    ("some", "excuse"),
    [
        (board(2, 2, 2, "E1,E2,E3,E4:unmet,E5,E6", 3), r"e-agent \d is in the same bend"),
        (board(2, 2, 3, "E1,E2,E3,E4:unmet,E5,E6", 3), r"e-agent \d is in the bend before it"),
        (pan(2, (0, 4), "E1,E2,E3,E4,E5", 3), r"e-agent \d is in the way out of \[2, 1\]"),
        (board(2, 2, 1, "E1,E2,E3,E5,E6"), "E4 is not assumed, so it need not leave"),
        (board(2, 2, 1, "E1,E2,E3,E4,E6", 3), "E5 is not assumed, so it need not enter"),
    ],
)
def test_the_story_names_who_excuses_a_car_at_a_bend(some: Board, excuse: str) -> None:
    counter = Counterstrategy(solve(build(some)))
    lost = np.flatnonzero(~counter.solution.winning)
    stories = ["\n".join(story_of(counter, int(position))) for position in lost[:: 1 + len(lost) // 12]]
    assert any(re.search(excuse, story) for story in stories), stories[0]


def test_the_command_answers_in_json(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "won.npz"
    assert main(["synth", "demo", "--cars", "2", "--order-degree", "1", "--json", "-o", str(path)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found.pop("seconds") > 0.0
    expected = {"states": 50_112, "winning": 50_112, "vacuous": 0, "realizable": True, "route_bound": 41}
    assert found == expected
    assert Strategy.load(path).board.positions == 50_112


def test_the_game_as_a_graph_says_what_its_numbers_mean(tmp_path: Path) -> None:
    path = tmp_path / "game.npz"
    assert main(["synth", "demo", "--cars", "1", "--graph", str(path), "--json"]) == 0
    with np.load(path, allow_pickle=False) as archive:
        arrays = dict(archive)
    header = json.loads(arrays["header"].tobytes())
    assert (header["format"], header["version"], header["cars"]) == ("dubins-traffic game", 2, 1)
    for position in range(0, len(arrays["ego_cell"]), 37):
        ego: list[int] = []
        others: list[int] = []
        for n, node in enumerate(header["nodes"]):
            scene = header["kinds"][node["kind"]][arrays["scene"][position, n]]
            cars = [(node["inbound"][slot], who) for slot, who in scene["queue"]]
            cars += [(n, scene["inside"])] if scene["inside"] else []
            for cell, who in cars:
                (ego if who == "ego" else others).append(cell)
        assert ego == [arrays["ego_cell"][position]]
        assert len(others) == 1
        reached = arrays["ego_to"][arrays["ego_at"][position] : arrays["ego_at"][position + 1]]
        near = {ego[0], *(cell for node in header["nodes"] for cell in node["exits"])}
        near |= {n for n, node in enumerate(header["nodes"]) if ego[0] in node["inbound"]}
        assert {int(cell) for cell in arrays["ego_cell"][reached]} <= near


def test_the_command_explains(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["synth", "demo", "--assume", "E1,E2,E4,E5,E6", "--explain"]) == 0
    text = capsys.readouterr().out
    assert "but not where the instance starts" in text
    assert "E3 is not assumed, so it need not enter" in text
    assert "The ego would win if this were assumed: E1,E2,E3:one-forfeit,E4,E5,E6." in text
    assert main(["synth", "demo", "--explain"]) == 0
    text = capsys.readouterr().out
    assert "The ego wins everywhere." in text
    assert "waits until one leaves (E4) in" in text


def test_the_command_refuses_what_is_wrong(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for arguments, message in (
        (["--assume", "E9"], "--assume: not an assumption: got 'E9'; expected some of E1,"),
        (["--cars", "9"], "proved to win against up to 36 e-agents"),
        (
            ["-o", "won.json"],
            "won.json: not a name of an archive: got '.json'; expected a name that ends in .npz",
        ),
        (["--cars", "4", "--memory", "100"], "MiB'; expected at most 100 MiB (--memory)"),
        (["--assume", "nothing", "-o", str(tmp_path / "none.npz")], "a strategy that wins from nowhere"),
    ):
        assert main(["synth", "demo", *arguments]) == 2
        assert message in capsys.readouterr().err
    assert not (tmp_path / "none.npz").exists()


def test_targets_are_checked_before_the_game_is_solved(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, closed = tmp_path / "there.npz", tmp_path / "closed"
    there.write_bytes(b"old")
    (tmp_path / "folder.npz").mkdir()
    closed.mkdir(mode=0o500)
    for option in ("-o", "--graph"):
        for name, message in (
            (there, "exists already; expected a new name, or --overwrite"),
            (tmp_path / "folder.npz", "a folder; expected a file to write"),
            (tmp_path / "none" / "own.npz", "own.npz: no such folder"),
            (there / "own.npz", "own.npz: no such folder"),
        ):
            assert main(["synth", "demo", "--cars", "8", option, str(name)]) == 2
            assert message in capsys.readouterr().err
    monkeypatch.setattr(os, "access", lambda path, _: Path(path) != closed)
    assert main(["synth", "demo", "--cars", "8", "-o", str(closed / "own.npz")]) == 2
    assert "no permission to write" in capsys.readouterr().err
    assert there.read_bytes() == b"old"
    assert main(["synth", "demo", "--cars", "1", "-o", str(there), "--overwrite"]) == 0
    assert Strategy.load(there).board.others == 1


def test_wins_that_are_all_vacuous_are_called_so(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """On one road of three places, each a crossing, three e-agents fill the dead end that the ego is not in."""
    own = draw(load_config("demo"), 0, 0)
    network = RoadNetwork(((0, 0, 1, 0), (1, 0, 2, 0)), 3.0, (0.0, 0.0, 0.0), (1, 3))
    problem = replace(own.problem, network=network, goals=((0, 0), (2, 0)))
    path = tmp_path / "road.json"
    write_document(instance_to_document(replace(own, problem=problem)), path)
    asked = ["synth", str(path), "--order-degree", "1"]
    for cars, realizable in (("2", True), ("3", "vacuously"), ("4", "vacuously")):
        assert main([*asked, "--cars", cars, "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["realizable"] == realizable, cars
        assert found["vacuous"] == (found["winning"] if realizable == "vacuously" else 0)
    assert main([*asked, "--cars", "3", "--assume", "E6", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["realizable"] is False
    assert main([*asked, "--cars", "3", "--explain"]) == 0
    text = capsys.readouterr().out
    assert "It wins vacuously: each of these wins rests on an assumption that can't be kept then." in text
    assert "The ego has no strategy but to keep the e-agents from freeing a goal (E6)." in text
    assert main([*asked, "--cars", "3", "-o", str(tmp_path / "none.npz")]) == 2
    assert "wins from nowhere" in capsys.readouterr().err


def test_instances_without_goals_are_refused() -> None:
    network = RoadNetwork.grid(2, 2)
    with pytest.raises(InputError, match="no goals"):
        RoadCells.of(network, [])


def test_what_is_said_of_an_instance() -> None:
    found = answer(draw(load_config("demo"), 0, 0), cars=1)
    assert (found.outcome, found.realizable, found.starts) == ("everywhere", True, [])
    assert found.lines()[-1] == "On shortest routes it is proved to win against up to 36 e-agents."
