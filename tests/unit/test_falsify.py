"""Cells, passages, cases and splitting, each by itself."""

import json
from itertools import pairwise
from math import hypot
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.agents.choices import CHOICE
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.archive import opened
from dubins_traffic.falsification.case import Case, Story, read_case
from dubins_traffic.falsification.coverage import CELLS, Cell, Manoeuvre, coverage, possible
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.falsification.passages import find_passages
from dubins_traffic.falsification.sampling import Source, Stream, prepared
from dubins_traffic.falsification.strategies import make
from dubins_traffic.falsification.trying import Tried, with_passages
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.starts import gap_radius
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.propositions import FLAG
from tests.minute import a_minute

JUNCTION = a_minute("junction")
STORY = Story("3.clear", "left", 4, "simple", 2.0, 60, "At 2.00 s the ego entered.")


def test_cells_are_numbered_one_by_one() -> None:
    assert [Cell.of(number).number for number in range(CELLS)] == list(range(CELLS))
    assert Cell("3.clear", Manoeuvre.LEFT, 4).name == "3.clear-left-4"


def _lanes(network: RoadNetwork, way: list[tuple[int, int]]) -> list[int]:
    """Return the lanes along a way of lattice points."""
    found: list[int] = []
    for (x0, y0), (x1, y1) in pairwise(way):
        for s, road in enumerate(network.segments):
            found += [2 * s] * (road == (x0, y0, x1, y1)) + [2 * s + 1] * (road == (x1, y1, x0, y0))
    return found


@pytest.mark.parametrize(
    ("last", "manoeuvre"),
    [
        ((2, 1), Manoeuvre.STRAIGHT),
        ((1, 2), Manoeuvre.LEFT),
        ((1, 0), Manoeuvre.RIGHT),
        ((0, 1), Manoeuvre.BACK),
    ],
)
def test_a_passage_is_what_the_ego_did_in_the_disc(last: tuple[int, int], manoeuvre: Manoeuvre) -> None:
    network = JUNCTION.network
    assert network is not None
    first, second = _lanes(network, [(0, 1), (1, 1), last])
    lane = np.array([[first] * 4 + [-1] * 3 + [second] * 2 + [0]])
    bits = np.zeros((1, 10), dtype=np.uint32)
    bits[0, 2] = FLAG.STOPPED | FLAG.AHEAD
    found = find_passages(lane, bits, np.array([9]), [network])
    assert found.first.tolist() == [0, 4, 7]
    assert found.end.tolist() == [4, 7, 9]
    assert found.cell("1.collision", 0, 5) == Cell("1.collision", manoeuvre, 4)
    assert found.cell("3.stop", 0, 3) == Cell("3.stop", manoeuvre, 4)
    assert found.cell("1.collision", 0, 2) == Cell("1.collision", Manoeuvre.DRIVING, 4)
    (tested,) = found.exercised(1, 3)
    assert tested.count(Cell("3.order", manoeuvre, 4).number) == 1
    assert tested.count(Cell("3.clear", manoeuvre, 4).number) == 1
    assert tested.count(Cell("2.left", Manoeuvre.DRIVING, 4).number) == 0
    assert tested == tuple(sorted(tested))
    sound, faulty = with_passages(
        [Tried(False, False, {}, ()), Tried(False, True, {}, ())],
        find_passages(lane.repeat(2, 0), bits.repeat(2, 0), np.array([9, 9]), [network, network]),
        draw(JUNCTION, 1, 0),
    )
    assert sound.exercised == tested
    assert faulty.exercised == (), "a trial that ended by a fault tests nothing"


def test_an_empty_cell_stands_in_the_coverage() -> None:
    instance = draw(JUNCTION, 1, 0)
    expected = possible([instance])
    assert Cell("3.order", Manoeuvre.LEFT, 4) in expected
    nothing = np.zeros(CELLS, dtype=np.int64)
    rows = coverage(expected, nothing, nothing)
    assert [row.cell for row in rows] == expected
    assert not any(row.tested or row.broken for row in rows)


def test_a_case_is_read_as_it_was_written(tmp_path: Path) -> None:
    case = Case(draw(JUNCTION, 1, 0), STORY)
    case.write(tmp_path / "case.json")
    again = read_case(tmp_path / "case.json")
    assert again.story == STORY
    assert again.to_text() == case.to_text()
    other = tmp_path / "other.json"
    other.write_text(case.to_text().replace('"rule": "3', '"law": "3'))
    with pytest.raises(InputError, match="not a case"):
        read_case(other)
    other.write_text(case.to_text().replace('"controller": "simple"', '"controller": ["simple"]'))
    with pytest.raises(InputError, match=r"case\.controller.*expected str"):
        read_case(other)


def test_a_genome_comes_back_from_json_and_builds_the_same_instance() -> None:
    source = Source(prepared(JUNCTION, 15.0, {}), 3)
    genome = source.fresh(5)
    children = [source.varied(genome, source.fresh(7), source.dice(number, Stream.CHANGES)) for number in range(40)]
    for own in (genome, *children, source.arranged(8, source.dice(8, Stream.CHANGES))):
        again = Genome.from_json(own.to_json())
        assert source.build([again]) == source.build([own])
    assert {child.base for child in children} == {5, 7}
    assert any(child.starts for child in children)
    assert any(child.tables.keys() == genome.tables.keys() and not child.starts for child in children)
    assert {agent.kind for agent in source.build([genome])[0].e_agents} == {"chosen"}


def test_two_trials_of_one_genome_are_two_instances() -> None:
    """Where nothing is left to choose, a child may equal its parent: what came of the two is told apart."""
    source = Source(prepared(JUNCTION, 15.0, {}), 3, frees=False)
    genome = source.fresh(5)
    one, other = source.build([genome, genome])
    assert one == other
    assert one is not other


def test_a_folder_holds_one_search(tmp_path: Path) -> None:
    with opened(tmp_path / "a", {"seed": 1}, resume=False) as archive:
        archive.remember({"settings": {"seed": 1}})
    with pytest.raises(InputError, match="holds a search"), opened(tmp_path / "a", {"seed": 1}, resume=False):
        pass
    with (
        pytest.raises(InputError, match="another search: seed"),
        opened(tmp_path / "a", {"seed": 2}, resume=True),
    ):
        pass


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"settings": {"seed": 1}}', '{"sha256": "%s", "state": {"a": 2}}'])
def test_a_state_that_is_not_as_it_was_written_is_refused(tmp_path: Path, text: str) -> None:
    with opened(tmp_path / "a", {"seed": 1}, resume=False) as archive:
        archive.remember({"settings": {"seed": 1}, "a": 1})
        assert archive.state() == {"settings": {"seed": 1}, "a": 1}
    state = tmp_path / "a" / "state.json"
    known = json.loads(state.read_text())["sha256"]
    state.write_text(text.replace("%s", known))
    with pytest.raises(InputError, match=r"state\.json"), opened(tmp_path / "a", {"seed": 1}, resume=True):
        pass


def test_cma_moves_by_what_it_is_told_and_goes_the_same_way_again() -> None:
    source = Source(prepared(JUNCTION, 6.0, {}), 3)
    targets = ("3.order", "3.clear")
    first, second = (make("cma", source, targets) for _ in range(2))
    for generation in range(4):
        numbers = range(32 * generation, 32 * generation + 32)
        for number, genome in zip(numbers, first.propose(numbers), strict=True):
            near = float(np.nansum(genome.tables[1][:, CHOICE.HOLD]))
            first.tell(number, genome, Tried(False, False, dict.fromkeys(targets, near), ()), False)
    second.restore(first.state())
    ways = [own.propose(range(128, 160)) for own in (first, second)]
    assert [own.to_json() for own in ways[0]] == [own.to_json() for own in ways[1]]
    begun = make("cma", source, targets).propose(range(32))
    held = [np.mean([own.tables[1][:, CHOICE.HOLD].sum() for own in way]) for way in (begun, ways[0])]
    assert held[1] < 0.9 * held[0]


def test_starts_that_are_changed_are_such_as_are_drawn() -> None:
    source = Source(prepared(JUNCTION, 15.0, {}), 3)
    changed = 0
    for number in range(60):
        dice = source.dice(number, Stream.CHANGES)
        own = source.varied(source.arranged(number, dice), source.fresh(number + 1), dice)
        (instance,) = source.build([own])
        changed += bool(own.starts)
        problem = instance.problem
        places = np.array([(pose.x, pose.y) for pose in instance.starts])
        apart = np.hypot(*(places[:, None] - places[None, :]).transpose(2, 0, 1))
        assert apart[~np.eye(len(places), dtype=bool)].min() >= gap_radius(problem.car)
        from_discs = np.hypot(*(places[:, None] - problem.network.points[None, :]).transpose(2, 0, 1))
        assert from_discs.min() >= problem.intersection_radius + problem.car.body.reach
    assert changed > 30


def test_cars_are_brought_to_the_crossing_of_the_ego() -> None:
    source = Source(prepared(JUNCTION, 15.0, {}), 3)
    meets = 0
    for number in range(40):
        (instance,) = source.build([source.arranged(number, source.dice(number, Stream.CHANGES))])
        far = [hypot(pose.x - 6.0, pose.y - 6.0) for pose in instance.starts]
        toward = [(6.0 - pose.x) * pose.c + (6.0 - pose.y) * pose.s > 0.0 for pose in instance.starts]
        meets += any(toward[0] and toward[car] and abs(far[car] - far[0]) < 0.1 for car in range(1, 4))
    assert meets >= 8


def test_an_evolution_that_is_restored_goes_the_same_way() -> None:
    source = Source(prepared(JUNCTION, 15.0, {}), 3)
    targets = ("3.order", "3.clear")
    first, second = (make("evolution", source, targets) for _ in range(2))
    for generation in range(6):
        numbers = range(32 * generation, 32 * generation + 32)
        for number, genome in zip(numbers, first.propose(numbers), strict=True):
            near = float(np.nansum(genome.tables[1][:, CHOICE.HOLD]))
            margins = {"3.order": near, "3.clear": 9.0 - near}
            first.tell(
                number,
                genome,
                Tried(False, False, margins, (), (number % 7, 100 + number)),
                number % 40 == 39,
            )
    second.restore(json.loads(json.dumps(first.state())))
    ways = [own.propose(range(192, 224)) for own in (first, second)]
    assert [own.to_json() for own in ways[0]] == [own.to_json() for own in ways[1]]
    assert any(own.root != number for number, own in zip(range(192, 224), ways[0], strict=True))


def test_a_trial_that_is_drawn_in_an_evolution_chooses_as_much_as_any_that_is_drawn() -> None:
    source = Source(prepared(JUNCTION, 15.0, {}), 3)
    evolution = make("evolution", source, ("3.order",))
    for number, genome in zip(range(32), evolution.propose(range(32)), strict=True):
        evolution.tell(number, genome, Tried(False, False, {"3.order": float(number)}, (), (number,)), False)
    proposed = zip(range(32, 632), evolution.propose(range(32, 632)), strict=True)
    drawn = [own for number, own in proposed if own.base == own.root == number]
    chosen = [np.mean([np.isfinite(table).mean() for table in own.tables.values()]) for own in drawn]
    usual = [np.mean([np.isfinite(table).mean() for table in source.fresh(n).tables.values()]) for n in range(400)]
    assert len(drawn) > 150
    assert abs(np.mean(chosen) - np.mean(usual)) < 0.03
