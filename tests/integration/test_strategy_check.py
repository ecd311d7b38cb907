"""Strategies against everything that the environment may do: the verdict, and the play that one does not win.

The reference plays on labelled states of the textbook's game (`tests.game_reference`): nothing of the check, and
nothing of the package's game, is in it.
"""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.record.sink import End
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.verdict import Ruling
from dubins_traffic.synthesis import answer as answering
from dubins_traffic.synthesis.answer import answer
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.exhaustive import (
    Check,
    CounterPlay,
    RankedPlayer,
    check_player,
    check_strategy,
)
from dubins_traffic.synthesis.foreign.hoa import read_hoa
from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, Machine
from dubins_traffic.synthesis.foreign.player import Labelled, MachinePlayer, PlayPosition
from dubins_traffic.synthesis.foreign.read import read_machine
from dubins_traffic.synthesis.road_play import MoveList
from dubins_traffic.synthesis.solver import Solution
from dubins_traffic.synthesis.strategy import Strategy
from tests import foreign
from tests.game_reference import Reference
from tests.property.test_game_reference import KITE, SQUARE, TEE, position, reference, solved

ROAD = ((0, 0, 1, 0),)
FORMS = ("hoa", "aag", "aig", "slugs json", "slugs text", "tulip")
ANSWERS = foreign.machine


@dataclass(frozen=True)
class Textbook:
    """The textbook's game, with the numbers that cells have in letters."""

    game: Reference
    board: Board

    @cached_property
    def numbers(self) -> dict[Any, int]:
        road_cells = self.board.road_cells
        network = road_cells.network
        names: dict[Any, int] = {}
        for n, node in enumerate(road_cells.nodes):
            point = network.intersections[node.vertex]
            for lane in node.inbound:
                before = network.intersections[network.lane_ends(lane)[0]]
                names["node", point] = names["node", point, before] = n
        for lane in range(network.lanes):
            ends = [network.intersections[end] for end in network.lane_ends(lane)]
            names["lane", ends[0], ends[1]] = len(road_cells.nodes) + lane
        return names

    @cached_property
    def begun(self) -> Any:
        """A state at a start: each car in a lane, nobody behind the ego."""
        game = self.game
        lanes = [cell for cell in game.cells() if cell[0] == "lane"]
        cells = tuple(lanes[k * (len(lanes) // (game.others + 1))] for k in range(game.others + 1))
        return next(
            state
            for state in game.states()
            if state[0] == cells and not state[2] and all(0 not in order[:-1] for _, order in state[1])
        )

    def number(self, cell: Any) -> int:
        return self.numbers[cell]

    def cells(self, state: Any) -> tuple[int, ...]:
        return tuple(map(self.number, state[0]))

    def letter(self, state: Any) -> dict[str, bool]:
        width = max(1, (self.board.road_cells.cells - 1).bit_length())
        _, *others = self.cells(state)
        letter = {f"car{k}_{bit}": bool(cell >> bit & 1) for k, cell in enumerate(others, 1) for bit in range(width)}
        for i, j in product(range(1, len(others) + 1), repeat=2):
            if i < j and self.game.order != "none":
                lines = [order for _, order in state[1] if i in order and j in order]
                letter[f"first_{i}_{j}"] = any(line.index(i) < line.index(j) for line in lines)
        return letter


def verdict(book: Textbook, machine: Machine, starts: list[Any]) -> bool:
    """Tell by playing everything whether a machine wins: no wrong move, no fair cycle away from a goal."""
    game = book.game
    graph: list[tuple[Any, Any]] = []
    waiting: deque[Any] = deque()
    for state in starts:
        first = machine.step(machine.begin(), book.letter(state))
        if first is None or ego_of(first[1]) != book.cells(state)[0]:
            return False
        waiting.append((state, first[0]))
    seen = set(waiting)
    while waiting:
        state, memory = waiting.popleft()
        for turn in set(game.turns(state)):
            step = machine.step(memory, book.letter(turn))
            legal = {book.number(after[0][0]): after for after in game.answers(turn)}
            if step is None or ego_of(step[1]) not in legal:
                return False
            after = legal[ego_of(step[1])], step[0]
            graph.append(((state, memory), after))
            if after not in seen:
                seen.add(after)
                waiting.append(after)
    return not any(is_kept_from(game, graph, goal) for goal in game.goals)


def is_kept_from(game: Reference, graph: list[tuple[Any, Any]], goal: Any) -> bool:
    away = [edge for edge in graph if all(node[0][0][0][:2] != ("node", goal) for node in edge)]
    nodes = list(dict.fromkeys(node for edge in away for node in edge))
    number = {node: k for k, node in enumerate(nodes)}
    ends = np.array([[number[node] for node in edge] for edge in away], dtype=int).reshape(-1, 2)
    edges = coo_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(nodes), len(nodes)))
    _, part_of = connected_components(edges, directed=True, connection="strong")
    for part in {part_of[one] for one, other in ends if part_of[one] == part_of[other]}:
        owed = [game.owed(nodes[k][0]) for k in np.flatnonzero(part_of == part)]
        if not any(all(debt) for debt in zip(*owed, strict=True)):
            return True
    return False


def ego_of(letter: Any) -> int:
    return sum(bool(value) << int(name[4:]) for name, value in letter.items() if name.startswith("ego_"))


@dataclass(frozen=True)
class Whims:
    """A machine of a few states, whose answers follow from a number: mostly moves of the game, but any of them."""

    book: Textbook
    seed: int
    states: int
    wrong: float

    @property
    def names(self) -> list[str]:
        return []

    @property
    def sides(self) -> None:
        return None

    def begin(self) -> Any:
        return None

    def step(self, state: Any, letter: Any) -> Any:
        others = [self._cell(letter, f"car{k}_") for k in range(1, self.book.game.others + 1)]
        if state is None:
            own, memory = self.start, 0
        else:
            own, memory = state
        draw = Random(repr((self.seed, own, memory, sorted(letter.items()))))
        cells = self.book.board.road_cells
        ways = [cell for cell in (*cells.following(own), *cells.following(own), own) if cell not in others]
        if draw.random() < self.wrong:
            ways = list(range(cells.cells))
        to = own if state is None or not ways else draw.choice(ways)
        bits = {f"ego_{bit}": bool(to >> bit & 1) for bit in range(8)}
        return (to, draw.randrange(self.states)), bits

    @property
    def start(self) -> int:
        return self.book.number(self.book.begun[0][0])

    def _cell(self, letter: Any, stem: str) -> int:
        return sum(value << int(name[len(stem) :]) for name, value in letter.items() if name.startswith(stem))


def checked(book: Textbook, solution: Solution, player: Any, state: Any) -> Check:
    named = Labelled(book.board, MoveList(book.board))
    place = PlayPosition(position(book.board, book.game, state), book.cells(state))
    return check_player(solution.game, player, named, [place])


@pytest.mark.parametrize(
    ("roads", "others", "assumed", "machines"),
    [
        (ROAD, 1, {"order_degree": 3}, 60),
        (TEE, 1, {}, 60),
        (TEE, 2, {"order_degree": 3}, 6),
        (SQUARE, 1, {"order_degree": 3}, 60),
        (SQUARE, 2, {}, 5),
        (KITE, 1, {"leaves": "unmet", "order_degree": 3}, 40),
        (KITE, 1, {"enters": False}, 40),
    ],
)
def test_the_verdict_is_that_of_playing_everything(
    roads: Any, others: int, assumed: dict[str, Any], machines: int
) -> None:
    solution, game = solved(roads, others, assumed), reference(roads, others, assumed)
    book = Textbook(game, solution.game.board)
    state = book.begun
    named = Labelled(book.board, MoveList(book.board))
    verdicts: list[bool] = []
    for seed in range(machines):
        whims = Whims(book, seed, 1 + seed % 3, 0.0 if seed % 4 else 0.002)
        found = checked(book, solution, MachinePlayer(named, whims), state)
        verdicts.append(found.wins)
        assert found.wins == verdict(book, whims, [state])
        if found.counter is not None:
            assert_played(book, whims, state, found.counter)
    assert False in verdicts


def assert_played(book: Textbook, machine: Machine, state: Any, play: CounterPlay) -> None:
    """Follow a play by the textbook: moves of the game, answers of the machine, and no goal and no debt for ever."""
    game = book.game
    assert play.turns[0] == book.cells(state)
    first = machine.step(machine.begin(), book.letter(state))
    if len(play.turns) == 1:
        assert first is None or ego_of(first[1]) != play.turns[0][0]
        return
    assert first is not None
    paths: list[list[Any]] = [[(state, first[0])]]
    for k in range(1, len(play.turns) - 1, 2):
        paths = [
            [*path, (after, step[0])]
            for path in paths
            for turn in set(game.turns(path[-1][0]))
            if book.cells(turn) == play.turns[k]
            for step in [machine.step(path[-1][1], book.letter(turn))]
            if step is not None
            for after in game.answers(turn)
            if book.cells(after) == play.turns[k + 1] and book.number(after[0][0]) == ego_of(step[1])
        ]
        assert paths
    if play.again is None:
        assert play.goal is None
        assert len(play.turns) % 2 == 0
        assert any(
            step is None or ego_of(step[1]) not in {book.number(after[0][0]) for after in game.answers(turn)}
            for path in paths
            for turn in game.turns(path[-1][0])
            if book.cells(turn) == play.turns[-1]
            for step in [machine.step(path[-1][1], book.letter(turn))]
        )
        return
    assert play.end is None
    assert play.turns[play.again] == play.turns[-1]
    goal = game.goals[play.goal or 0]
    (cycle,) = [path[play.again // 2 :] for path in paths if path[play.again // 2] == path[-1]][:1]
    assert len(cycle) > 1
    assert all(one[0][0][0][:2] != ("node", goal) for one in cycle)
    assert not any(all(debt) for debt in zip(*(game.owed(one) for one, _ in cycle), strict=True))


@pytest.mark.parametrize(
    ("roads", "others", "assumed"), [(TEE, 2, {}), (SQUARE, 2, {"order_degree": 3}), (KITE, 1, {})]
)
def test_a_strategy_of_ours_wins_and_loses_with_one_rank_changed(
    roads: Any, others: int, assumed: dict[str, Any]
) -> None:
    solution, game = solved(roads, others, assumed), reference(roads, others, assumed)
    book = Textbook(game, solution.game.board)
    state = book.begun
    named = Labelled(book.board, MoveList(book.board))
    strategy = Strategy.of(solution)
    player = RankedPlayer(named, strategy, solution.game.ego_cell)
    found = checked(book, solution, player, state)
    assert found.wins
    assert found.kept == found.positions
    assert verdict(book, as_machine(player, book), [state])
    outcomes = {True: 0, False: 0}
    for seed in range(4):
        draw = Random(seed)
        ranks = [own.rank.copy() for own in strategy.ranks]
        for rank in ranks:
            for _ in range(1 + seed * len(rank) // 12):
                rank[draw.randrange(len(rank))] = draw.randrange(-1, 12)
        changed = Strategy(
            strategy.board,
            tuple(type(own)(rank, own.start, own.debt) for own, rank in zip(strategy.ranks, ranks, strict=True)),
        )
        player = RankedPlayer(named, changed, solution.game.ego_cell)
        found = checked(book, solution, player, state)
        outcomes[found.wins] += 1
        machine = as_machine(player, book)
        assert found.wins == verdict(book, machine, [state])
        if found.counter is not None:
            assert_played(book, machine, state, found.counter)
    assert outcomes[False] > 0


def as_machine(player: RankedPlayer, book: Textbook) -> Machine:
    """Return a strategy of ours as a machine that knows the textbook's letters."""
    return Follower(player, book)


@dataclass(frozen=True)
class Follower:
    """A machine whose state is a place of our game, in which the environment is to move, and what is remembered."""

    player: RankedPlayer
    book: Textbook
    names: tuple[str, ...] = ()
    sides: None = None

    def begin(self) -> Any:
        return None

    def step(self, state: Any, letter: Any) -> Any:
        if state is None:
            book = self.book
            start = book.begun
            place = PlayPosition(position(book.board, book.game, start), book.cells(start))
            memory = self.player.begin(place)
            return None if memory is None else ((place, memory), self._bits(place.cells[0]))
        place, memory = state
        for turn in self.player.game.turns(place):
            if self.player.game.letter(turn) == letter:
                answered = self.player.answer(turn, memory)
                if answered is None:
                    return None
                return (answered.place, answered.memory), self._bits(answered.place.cells[0])
        raise AssertionError("no move of the game")

    def _bits(self, cell: int) -> dict[str, bool]:
        return {f"ego_{bit}": bool(cell >> bit & 1) for bit in range(8)}


def test_two_hundred_files_of_four_tools_have_the_verdict_of_playing_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    instance = foreign.instance()
    solution = answer(instance).solution
    game = reference(ROAD, 1, {"order_degree": 3})
    book = Textbook(game, solution.game.board)
    cells = tuple(foreign.starts_of(instance))
    (state,) = [one for one in game.states() if book.cells(one) == cells]
    wins = {form: [0, 0] for form in FORMS}
    for seed in range(34):
        monkeypatch.setattr(foreign, "machine", changed(seed))
        (tmp_path / str(seed)).mkdir()
        for form, path in foreign.files(tmp_path / str(seed)).items():
            found = check_strategy(path, solution.game, instance)
            assert found.wins == verdict(book, read_machine(path), [state]), (form, seed)
            wins[form][found.wins] += 1
            if found.counter is not None:
                assert_played(book, read_machine(path), state, found.counter)
    assert sum(map(sum, wins.values())) > 200
    assert all(min(counts) > 0 for counts in wins.values())


@pytest.mark.parametrize("form", [FORMS[0], *(pytest.param(own, marks=pytest.mark.long) for own in FORMS[1:])])
def test_every_strategy_that_loses_loses_on_the_road_to_its_counter_play(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the two hundred files those of one form, each in a trial whose e-agents drive by the play.

    In some the play lets a car stay in an intersection from which the ego keeps the lane: on the road that is an E4.
    """
    instance = replace(foreign.instance(), duration=90.0)
    solution = answer(instance).solution
    stays = 0
    for seed in range(34):
        monkeypatch.setattr(foreign, "machine", changed(seed))
        (tmp_path / str(seed)).mkdir()
        path = foreign.files(tmp_path / str(seed))[form]
        play = check_strategy(path, solution.game, instance).counter
        if play is None:
            continue
        times = Judging()
        came = run_trial(play.trial(instance), str(path), sinks=[times])
        verdict = came.score.verdict
        assert verdict is not None
        assert verdict.verdict is not Ruling.SATISFIED
        others = [one for one in verdict.violations if one.car != "ego"]
        stays += bool(others)
        assert [one.rule for one in others] in ([], ["E4"], ["E4", "E6"]), seed
        if came.ending.end is not End.CONTROLLER_FAULT:
            # The first 35 s are for what comes before the play repeats.
            late = {goal for tick, goal in times.visits if tick > 35.0 * instance.problem.rate}
            assert late < {0, 1}, seed
            assert play.goal not in late, seed
    assert stays <= 7


def changed(seed: int) -> Callable[[], tuple[int, dict[tuple[int, int], int]]]:
    """Return the machine of `foreign` with some of its answers changed, more and more with the number."""
    first, steps = ANSWERS()
    draw = Random(seed)
    for _ in range(seed // 5):
        own, other = draw.choice(sorted(steps))
        steps[own, other] = draw.choice([own, own, draw.randrange(4)])
    return lambda: (first, steps)


def test_a_split_machine_is_that_which_it_was_split_from() -> None:
    whole = read_hoa(foreign.as_hoa())
    split = read_hoa(as_split(whole))
    assert split.sides == whole.sides
    for word in product(range(4), repeat=4):
        states, told = [whole.begin(), split.begin()], [[], []]
        for cell in word:
            letter = {"car1_0": bool(cell & 1), "car1_1": bool(cell >> 1)}
            for k, machine in enumerate((whole, split)):
                step = machine.step(states[k], letter)
                assert step is not None
                states[k] = step[0]
                told[k].append(step[1])
        assert told[0] == told[1]


def as_split(whole: Explicit) -> str:
    """Return a machine as Spot writes a split one: each edge in two, with a state of player 1 between."""
    names, inputs = list(whole.names), [name for name in whole.names if name.startswith("car")]
    first = {state: 2 * k for k, state in enumerate(whole.edges)}
    lines: list[str] = []
    between = 2 * len(whole.edges)
    players = {2 * k: 0 for k in range(len(whole.edges))}
    later: list[str] = []
    for state, edges in whole.edges.items():
        lines.append(f"State: {first[state]}")
        for edge in edges:
            lines.append(f"[{label(names, edge, inputs)}] {between}")
            rest = [name for name in names if name not in inputs]
            later += [f"State: {between}", f"[{label(names, edge, rest)}] {first[edge.target]}"]
            players[between] = 1
            between += 1
    numbers = {old: new for new, old in enumerate(sorted(players))}
    body = re.sub(
        r"(State: |\] )(\d+)",
        lambda found: f"{found[1]}{numbers[int(found[2])]}",
        "\n".join([*lines, *later]),
    )
    head = f"""HOA: v1
States: {len(players)}
Start: {numbers[first[whole.first]]}
AP: {len(names)} {" ".join(f'"{name}"' for name in names)}
acc-name: all
Acceptance: 0 t
spot-state-player: {" ".join(str(players[old]) for old in sorted(players))}
controllable-AP: {" ".join(str(k) for k, name in enumerate(names) if name not in inputs)}
--BODY--
"""
    return f"{head}{body}\n--END--\n"


def label(names: list[str], edge: Edge, wanted: list[str]) -> str:
    return "&".join(
        ("" if value else "!") + str(names.index(name)) for name, value in edge.cube.items() if name in wanted
    )


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("spot-state-player: 0", "spot-state-player: 1", "answers before it has read|does not lead"),
        (r"spot-state-player: .*", "spot-state-player: 0 1", "not of each state"),
        (r"\] 19", "] 0", "from player 0 to player 1"),
        (r"\] 19", "] 99", "from player 0 to player 1"),
    ],
)
def test_a_damaged_split_machine_is_refused(old: str, new: str, problem: str) -> None:
    text = as_split(read_hoa(foreign.as_hoa()))
    damaged = re.sub(old, new, text, count=1)
    assert damaged != text
    with pytest.raises(InputError, match=problem):
        read_hoa(damaged)


def turns_of(document: Any) -> Iterator[tuple[int, ...]]:
    return map(tuple, document["turns"])


@pytest.mark.path
def test_the_command_tells_who_wins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("road.json").write_text(json.dumps(foreign.ROAD))
    good = foreign.files(tmp_path)["tulip"]
    line = ["synth", "road.json", "--seed", "5"]
    assert main([*line, "--check", str(good)]) == 0
    assert "wins every play" in capsys.readouterr().out
    assert main([*line, "-o", "own.npz"]) == 0
    capsys.readouterr()
    assert main([*line, "--check", "own.npz", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["check"]["wins"] is True
    assert told["check"]["share"] == 1.0
    monkeypatch.setattr(foreign, "machine", standing)
    (tmp_path / "bad").mkdir()
    bad = foreign.files(tmp_path / "bad")["hoa"]
    shown = ["--counter-play", "play.json", "--counter-trial", "lost.json"]
    assert main([*line, "--check", str(bad), *shown]) == 1
    out = capsys.readouterr().out
    assert "is kept from goal" in out
    assert "From here on nobody moves any more." in out
    play = json.loads(Path("play.json").read_text())
    assert play["format"] == "dubins-traffic counter-play"
    assert list(turns_of(play))[play["again"]] == list(turns_of(play))[-1]
    assert main(["run", "lost.json", "--controller", str(bad), "--records", "lost"]) == 0
    capsys.readouterr()
    assert main(["check", next(map(str, Path("lost").glob("*.mcap")))]) == 0
    assert "0 rounds" in capsys.readouterr().out
    assert main([*line, "--check", str(bad), *shown]) == 2
    assert main([*line, "--check", str(bad), "--counter-trial", "play.json", "--counter-play", "play.json", "-F"]) == 2
    assert main([*line, "--counter-trial", "other.json"]) == 2
    assert "--counter-trial: no strategy to be checked" in capsys.readouterr().err
    damaged = json.loads(Path("lost.json").read_text())
    for own in damaged["e-agents"]:
        own["parameters"]["turns"][0] = [0, 99]
    Path("damaged.json").write_text(json.dumps(damaged))
    assert main(["run", "damaged.json", "--controller", str(bad)]) == 2
    assert "parameters.turns.0: no turn of this game: got [0, 99]" in capsys.readouterr().err
    assert main(["synth", "demo", "--cars", "1", "--check", str(good)]) == 2
    assert str(good) in capsys.readouterr().err
    monkeypatch.setattr(answering, "answer", None)  # a file is read before the game is solved
    assert main([*line, "--check", "missing.hoa"]) == 2
    assert main([*line, "--check", "road.json"]) == 2


def standing() -> tuple[int, dict[tuple[int, int], int]]:
    """Return the machine that stays for ever where it starts."""
    first, steps = ANSWERS()
    start = foreign.starts_of(foreign.instance())[0]
    return first, {(own, other): start if own == start else to for (own, other), to in steps.items()}
