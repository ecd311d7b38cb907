"""Trials as plays of the game of cells; `experiments.related` follows 1,000 of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from experiments.related import found
from experiments.synthesized import instance

from dubins_traffic.cars.state import EGO, Pose, Propositions
from dubins_traffic.cli.main import main
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import parameters_of
from dubins_traffic.record.reader import Record, read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score
from dubins_traffic.synthesis.instance import cells_of
from dubins_traffic.synthesis.related import Relation, relate
from dubins_traffic.synthesis.road_play import NOWHERE, Ground

FREE, LAWFUL, SOLVED, TURNED = 3, 1, 13, 663
"""Trials of `experiments.related` among cars that do what they like, among lawful ones, and with `synthesized`; and one
in which a car that does what it likes turns round in a bend."""


def driven(own: Instance, path: Path, controller: str = "rules") -> tuple[Record, Score]:
    score = run_trial(own, controller, record=path).score
    return read(path), score


def related(record: Record, score: Score) -> Relation:
    assert score.verdict is not None
    return relate(record, score.verdict)


@pytest.mark.path
@pytest.mark.parametrize("number", [FREE, LAWFUL, SOLVED])
def test_a_trial_without_a_breach_is_a_play_of_the_game(number: int, tmp_path: Path) -> None:
    one = found(number, str(tmp_path))
    assert not one.broken
    assert one.relation.unknown is None
    assert one.relation.moves > 30
    assert 1.0 < one.relation.longest_move < 15.0


def test_a_trial_in_which_a_car_turns_round_in_a_bend_is_counted_apart(tmp_path: Path) -> None:
    one = found(TURNED, str(tmp_path))
    assert not one.relation.related
    assert one.turned
    assert not one.strays
    assert not found(FREE, str(tmp_path)).turned


def test_a_move_that_the_game_does_not_know_is_the_breach_of_a_rule(tmp_path: Path) -> None:
    own = instance(1, 150.0)
    rolling = parameters_of("lawful", {"rolls": 1.0})
    agents = [replace(agent, kind="lawful", type="lawful", parameters=rolling) for agent in own.e_agents]
    record, score = driven(replace(own, e_agents=tuple(agents)), tmp_path / "rolls.mcap")
    relation = related(record, score)
    assert score.verdict is not None
    assert relation.unknown is not None
    assert relation.related
    rolled = {(entry.car, entry.rule, entry.time) for entry in score.verdict.violations}
    car = relation.unknown.move.partition(" ")[0]
    assert (car, relation.unknown.time) in {(who, time) for who, _, time in rolled}
    assert relation.unknown.breach in {f"{who} broke {rule}" for who, rule, _ in rolled}


def test_a_car_that_is_suddenly_elsewhere_makes_no_move_of_the_game(tmp_path: Path) -> None:
    record, score = driven(instance(LAWFUL, 30.0), tmp_path / "own.mcap")
    assert related(record, score).related
    lanes = record.frames.lane.copy()
    crosses = record.frames.crosses.copy()
    far = int(lanes.max())
    assert lanes[450, EGO] != far
    lanes[450:, EGO], crosses[450:, EGO] = far, NOWHERE
    relation = related(replace(record, frames=replace(record.frames, lane=lanes, crosses=crosses)), score)
    assert not relation.related
    assert relation.unknown is not None
    assert (relation.unknown.time, relation.unknown.move.partition(" ")[0]) == (15.0, "ego")


def test_who_goes_to_and_fro_over_the_edge_of_a_bend_has_not_moved() -> None:
    problem = instance(0).problem
    cells = cells_of(problem)
    ground, nodes = Ground(cells), len(cells.nodes)
    bend = next(n for n, node in enumerate(cells.nodes) if not node.crossing)
    crossing = next(n for n, node in enumerate(cells.nodes) if node.crossing)
    anywhere = Pose(0.0, 0.0, 1.0, 0.0)

    def cell(before: int, crosses: int, lane: int) -> int:
        return ground.cell(before, anywhere, Propositions(lane >> 1, -1, crosses, lane, 0))

    for node, stays in ((bend, True), (crossing, False)):
        here = cells.nodes[node]
        (come, *_), (out, *_) = here.inbound, here.exits
        assert cell(nodes + come, here.vertex, come) == node
        assert cell(node, -1, come) == (node if stays else nodes + come)
        assert cell(node, -1, out) == nodes + out
        assert cell(nodes + out, here.vertex, out) == (nodes + out if stays else node)


def test_check_says_which_trials_are_plays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.mcap"
    driven(instance(LAWFUL, 30.0), path)
    assert main(["check", str(path), "--game"]) == 0
    assert "a play of the game: " in capsys.readouterr().out
    assert main(["check", str(path), "--game", "--json"]) == 0
    (document,) = json.loads(capsys.readouterr().out)["records"]
    assert document["game"]["related"] is True
    assert document["game"]["moves"] > 5


def test_check_says_why_a_trial_has_no_game(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = instance(LAWFUL, 2.0)
    for change, says in (
        ({"goals": ()}, "no goals"),
        ({"e_agents": ()}, "no e-agents, so there is no game"),
        ({"rules": {}}, "does not ask for the rules"),
    ):
        path = tmp_path / f"{next(iter(change))}.mcap"
        if "e_agents" in change:
            bare = replace(own, e_agents=(), starts=own.starts[:1])
            driven(replace(bare, problem=replace(own.problem, e_agents=())), path)
        else:
            driven(replace(own, problem=replace(own.problem, **change)), path)
        assert main(["check", str(path), "--game"]) == 2
        assert says in capsys.readouterr().err
