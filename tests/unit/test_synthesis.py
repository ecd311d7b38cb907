"""The game, its solver and its strategies: the known results, and what is refused."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from experiments.play import Environment, play

from dubins_traffic.errors import InputError
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.synthesis.assumption import Arriving, Assumption, Forfeits, Leaving, Order
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.counter import Counterstrategy, story_of
from dubins_traffic.synthesis.game import build, estimate, save_game
from dubins_traffic.synthesis.queues import WHO
from dubins_traffic.synthesis.road_cells import RoadCells
from dubins_traffic.synthesis.solver import Solution, solve
from dubins_traffic.synthesis.strategy import Strategy, StrategyError, check_ranks
from tests.games import ALL, board, pan, solved

KEEP_MOVING = "E1:any-order,E2,E3,E4,E5,E6"


def figures(solution: Solution) -> tuple[int, int, int]:
    return solution.game.positions, int(solution.winning.sum()), int(solution.vacuous.sum())


def test_fairness_alone_wins_nowhere() -> None:
    for assumed in ("E6", "E1,E2,E6", "E1:any-order,E2,E6"):
        assert figures(solved(3, 4, 1, assumed))[1:] == (0, 0), assumed


def test_keep_moving_unless_blocked_is_won_with_two_cars_and_lost_with_three() -> None:
    assert figures(solved(2, 2, 2, KEEP_MOVING)) == (660, 660, 0)
    assert figures(solved(3, 4, 2, KEEP_MOVING)) == (45_540, 45_540, 0)
    assert figures(solved(2, 2, 3, KEEP_MOVING)) == (1_980, 0, 0)
    assert figures(solved(3, 4, 3, KEEP_MOVING)) == (652_740, 0, 0)


def test_with_the_assumption_every_position_is_won() -> None:
    assert figures(solved(2, 2, 3)) == (2_724, 2_724, 0)
    assert figures(solved(2, 2, 4)) == (6_600, 6_600, 0)
    assert figures(solved(3, 4, 3)) == (788_336, 788_336, 0)


def test_so_it_is_where_opposing_cars_pass_each_other_in_bends() -> None:
    assert figures(solved(2, 2, 3, ALL, 3)) == (7_280, 7_280, 0)
    assert figures(solved(3, 4, 2, ALL, 3)) == (63_204, 63_204, 0)


def test_e_agents_that_meet_in_a_bend_must_not_excuse_each_other() -> None:
    weak = "E1,E2,E3,E4:unmet,E5,E6"
    assert figures(solved(2, 2, 2, ALL, 3)) == (1_680, 1_680, 0)
    assert figures(solved(2, 2, 2, weak, 3)) == (1_680, 784, 0)
    assert figures(solved(3, 4, 2, weak, 3)) == (63_204, 63_012, 0)


def test_a_way_out_that_an_e_agent_holds_excuses_who_waits_before_a_bend() -> None:
    """So the rules lose what is won if only the ego excuses there."""
    strict = "E1,E2,E3,E4,E5:moves-up,E6"
    assert figures(solved(2, 2, 4, ALL, 3)) == (21_840, 21_340, 60)
    assert figures(solved(2, 2, 4, strict, 3)) == (21_840, 21_840, 0)
    dead_end = pan(2, (0, 4), "E1,E2,E3,E4,E5", 3)
    assert figures(solve(build(dead_end))) == (2_598, 0, 0)
    strict_end = replace(dead_end, assumption=Assumption.parse(["E1", "E2", "E3", "E4", "E5:moves-up"]))
    assert figures(solve(build(strict_end))) == (2_598, 2_598, 0)


def test_where_each_place_is_a_crossing_no_bend_makes_a_difference() -> None:
    for weak in ("E1,E2,E3,E4:unmet,E5,E6", "E1,E2,E3,E4,E5:moves-up,E6"):
        assert np.array_equal(solved(2, 2, 2, weak).game.owed, solved(2, 2, 2).game.owed)


def test_whom_the_ego_blocks_at_a_bend_owes_nothing() -> None:
    """On the square each corner is two cells; lanes and cells of one direction follow each other."""
    some = board(2, 2, 1, ALL, 3)
    game, road_cells = build(some), some.road_cells
    nodes = len(road_cells.nodes)
    seen = 0
    for position in range(game.positions):
        owed = game.owed[game.owed_at[position] : game.owed_at[position + 1]].tolist()
        scenes = some.scenes(position)
        ego = int(game.ego_cell[position])
        inside = [n for n, scene in enumerate(scenes) if scene.inside == WHO.OTHER]
        waits = [
            nodes + road_cells.nodes[n].inbound[0] for n, scene in enumerate(scenes) if (0, WHO.OTHER) in scene.queue
        ]
        for n in inside:
            excused = ego == road_cells.opposite(n) or ego in road_cells.following(n)
            assert (n in owed) is not excused
            seen += excused
        for lane in waits:
            (node,) = road_cells.following(lane)
            excused = ego in (node, road_cells.opposite(node), *road_cells.following(node))
            assert (lane in owed) is not excused
            seen += excused
    assert seen == 8 * 2 + 8 * 3


def test_a_single_goal_is_left_between_two_visits() -> None:
    """An ego that stays at its only goal does not win: the strategy has a second table, for all other places."""
    some = pan(1, (3,))
    solution = solve(build(some))
    check_ranks(solution.game, solution.ranks)
    away = solution.game.at_target(1)
    assert len(solution.ranks) == 2
    assert not (away & solution.game.at_target(0)).any()
    assert ((solution.ranks[1].rank == 0) == away).all()
    played = play(Strategy.of(solution), 5_000, Environment.GREEDY, seed=2)
    assert played.astray == 0
    assert min(played.visits) > 100
    shut = solve(build(pan(1, (4,), "E1,E2,E3,E5,E6")))
    assert not shut.winning[shut.game.at_target(0)].all()


def test_a_place_may_be_given_up_at_any_time_but_once_in_a_wait() -> None:
    """As who backs out of the approach and stops again: also behind others, and before a crossing that is not clear."""
    some = board(2, 2, 2, "E1,E2,E3:one-forfeit,E4,E5,E6")
    kind = some.scenery(0)
    for scene, row in zip(kind.scenes, kind.removed().tolist(), strict=True):
        for slot, who in scene.queue:
            assert (row[slot] >= 0) is (who == WHO.OTHER)


def test_one_forfeit_a_wait_does_no_harm_and_any_number_does() -> None:
    assert board(3, 4, 3, "E1,E2,E3:one-forfeit,E4,E5,E6").positions == 4_298_028
    assert figures(solved(3, 4, 2, "E1,E2,E3:one-forfeit,E4,E5,E6")) == (154_200, 154_200, 0)
    assert figures(solved(2, 2, 3, "E1,E2,E3:forfeits,E4,E5,E6"))[1] == 0
    assert figures(solved(3, 4, 3, "E1,E2,E3:forfeits,E4,E5,E6")) == (788_336, 0, 0)


def test_each_part_of_the_assumption_is_needed_but_the_last() -> None:
    for left_out, lost in (
        ("E1", True),
        ("E2", True),
        ("E3", True),
        ("E4", True),
        ("E5", True),
        ("E6", False),
    ):
        assumed = ",".join(part for part in ALL.split(",") if part != left_out)
        assert (not solved(2, 2, 3, assumed).winning.any()) is lost, left_out


@pytest.mark.parametrize(("rows", "columns", "degree"), [(2, 2, 1), (2, 2, 3), (3, 4, 1), (2, 3, 3)])
def test_strategies_are_right_and_every_goal_recurs(rows: int, columns: int, degree: int) -> None:
    solution = solved(rows, columns, 3, ALL, degree)
    check_ranks(solution.game, solution.ranks)
    strategy = Strategy.of(solution)
    for environment in Environment:
        played = play(strategy, 20_000, environment, seed=7)
        assert (played.turns, played.astray) == (20_000, 0)
        assert min(played.visits) > 10
        assert max(played.gaps) < 1_500


def test_the_check_finds_a_rank_that_is_wrong() -> None:
    solution = solved(2, 2, 3)
    first = solution.ranks[0]
    found = 0
    for place in range(0, solution.game.positions, 97):
        if first.rank[place] > 1:
            ranks = first.rank.copy()
            ranks[place] = 1
            with pytest.raises(StrategyError, match="on the way to"):
                check_ranks(solution.game, (replace(first, rank=ranks), *solution.ranks[1:]))
            found += 1
    assert found > 10
    idle = replace(first, debt=np.full_like(first.debt, -1))
    with pytest.raises(StrategyError, match="nothing is owed"):
        check_ranks(solution.game, (idle, *solution.ranks[1:]))


def test_the_ego_chooses_the_lowest_rank() -> None:
    solution = solved(2, 2, 2)
    strategy, game = Strategy.of(solution), solution.game
    for position in range(0, game.positions, 41):
        options = game.ego_to[game.ego_at[position] : game.ego_at[position + 1]].tolist()
        chosen = strategy.choose(position, 1)
        assert chosen in options
        assert strategy.ranks[1].rank[chosen] == min(strategy.ranks[1].rank[option] for option in options)


def test_too_large_a_game_is_refused_before_it_is_built() -> None:
    with pytest.raises(InputError, match=r"too large a game: got '2951656 positions, about \d+ MiB"):
        build(board(4, 4, 3), limit=100 << 20)
    with pytest.raises(InputError, match="less than 2147483647"):
        build(board(3, 4, 8))
    with pytest.raises(InputError, match=r"cars: .* got 63; expected 1 to 62"):
        estimate(board(2, 2, 63))
    with pytest.raises(InputError, match="more cars than cells: got 13; expected at most 12"):
        estimate(board(2, 2, 12))


def test_crowds_too_are_solved_and_the_bound_is_exact_on_the_square() -> None:
    for others, found in ((9, (4_800, 4_800, 0)), (10, (1_408, 1_408, 1_088))):
        solution = solved(2, 2, others)
        assert figures(solution) == found
        check_ranks(solution.game, solution.ranks)


def test_there_may_be_many_goals() -> None:
    road_cells = RoadCells.of(RoadNetwork.grid(9, 9), range(81))
    some = Board(road_cells, Assumption(), 1)
    assert estimate(some).moves > some.positions


def test_the_estimate_is_close() -> None:
    game = solved(3, 4, 3).game
    expected = estimate(game.board)
    assert expected.positions == game.positions
    assert 0.9 < expected.moves / game.to.shape[0] < 1.1
    assert game.bytes < expected.bytes < 500 << 20


def lean(rows: int, columns: int, others: int, assumed: str = ALL, order_degree: int = 1) -> Solution:
    some = board(rows, columns, others, assumed, order_degree)
    game = build(some, limit=estimate(some).lean_bytes)
    assert game.lean
    assert game.bytes < solved(rows, columns, others, assumed, order_degree).game.bytes
    return solve(game)


@pytest.mark.parametrize(
    ("size", "assumed", "degree"),
    [
        ((2, 2, 3), ALL, 1),
        ((2, 2, 3), KEEP_MOVING, 1),
        ((2, 3, 3), "E1,E2,E3:forfeits,E4,E5,E6", 3),
        ((2, 3, 2), "E1,E2,E3:one-forfeit,E4,E5,E6", 3),
        ((3, 4, 2), "E1,E3,E4,E5,E6", 1),
    ],
)
def test_a_lean_game_has_the_same_moves_winners_and_ranks(
    size: tuple[int, int, int], assumed: str, degree: int
) -> None:
    whole, thin = solved(*size, assumed, degree), lean(*size, assumed, degree)
    assert np.concatenate([turns.to for turns in thin.game.turns()]).tolist() == whole.game.to.tolist()
    assert thin.game.moves == whole.game.moves
    for position in range(0, whole.game.positions, 97):
        assert thin.game.turns_of(position).tolist() == whole.game.turns_of(position).tolist()
    assert np.array_equal(thin.winning, whole.winning)
    assert np.array_equal(thin.vacuous, whole.vacuous)
    assert len(thin.ranks) == len(whole.ranks) == 2
    for own, other in zip(thin.ranks, whole.ranks, strict=True):
        assert np.array_equal(own.rank, other.rank)
        assert own.debt.tolist() == other.debt.tolist()
    check_ranks(thin.game, thin.ranks)
    assert [int(loss.lost.sum()) for loss in thin.losses] == [int(loss.lost.sum()) for loss in whole.losses]


def test_a_counterstrategy_of_a_lean_game_tells_the_same_story() -> None:
    whole, thin = solved(2, 2, 3, KEEP_MOVING), lean(2, 2, 3, KEEP_MOVING)
    assert story_of(Counterstrategy(thin), 0) == story_of(Counterstrategy(whole), 0)


def test_a_lean_game_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"game.npz: too large a game to be written: got '\d+ moves"):
        save_game(lean(2, 2, 2).game, tmp_path / "game.npz")
    assert not list(tmp_path.iterdir())


def test_assumptions_by_name() -> None:
    assert Assumption.parse(ALL.split(",")) == Assumption()
    assert str(Assumption()) == ALL
    weaker = Assumption.parse(["e1:any-order", "E3:one-forfeit"])
    assert (weaker.order, weaker.forfeits, weaker.leaves) == (Order.NONE, Forfeits.ONCE, Leaving.NEVER)
    weaker = Assumption.parse(["E4:unmet", "E5:moves-up"])
    assert (weaker.leaves, weaker.arrives) == (Leaving.UNMET, Arriving.MOVES_UP)
    assert Assumption.parse(weaker.words()) == weaker
    for words in (["E7"], ["E1", "E1:any-order"]):
        with pytest.raises(InputError, match="assume"):
            Assumption.parse(words)


def test_positions_and_their_numbers() -> None:
    for some in (board(2, 3, 3), board(2, 2, 2, "E1,E2,E3:one-forfeit,E4,E6", 3)):
        for position in range(0, some.positions, 1 + some.positions // 500):
            assert some.number(some.scenes(position)) == position


def test_progress_goes_up_to_the_whole() -> None:
    told: list[tuple[str, float]] = []
    game = build(board(3, 4, 2), progress=lambda what, share: told.append((what, share)))
    solve(game, progress=lambda what, share: told.append((what, share)))
    assert told[0][0].startswith("build 50,112 positions, about 1")
    assert [share for what, share in told if what.startswith("build")][-1] == 1.0
    assert [share for what, share in told if what == "solve"][-1] == 1.0


def test_ctrl_c_ends_a_search_soon() -> None:
    game = build(board(3, 4, 3))
    begun = process_time()
    solve(build(board(3, 4, 3)))
    whole = process_time() - begun

    def interrupt(what: str, _: float) -> None:
        raise KeyboardInterrupt(what)

    begun = process_time()
    with pytest.raises(KeyboardInterrupt, match="build"):
        build(board(3, 4, 3), progress=interrupt)
    with pytest.raises(KeyboardInterrupt, match="solve"):
        solve(game, progress=interrupt)
    assert process_time() - begun < 0.5 * whole


PLAIN = """
import numpy as np
from tests.games import solved
from experiments.play import Environment, play
from dubins_traffic.synthesis.strategy import Strategy
solution = solved(2, 2, 1)
game = solution.game
print(game.to.tolist(), game.moved.tolist(), game.ego_to.tolist(), game.owed.tolist())
print([own.rank.tolist() for own in solution.ranks])
print(play(Strategy.of(solution), 60, Environment.RANDOM, seed=3))
"""


def test_compiled_and_interpreted_are_equal() -> None:
    texts = {
        subprocess.run(
            [sys.executable, "-c", PLAIN],
            env={**os.environ, "NUMBA_DISABLE_JIT": plain},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for plain in ("0", "1")
    }
    assert len(texts) == 1
    assert "Played(turns=60, astray=0" in texts.pop()
