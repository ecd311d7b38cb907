"""Solves games of cells symbolically, with omega and dd; run by the Python that has them.

Standard input, a line for each game: {"following": cells that each cell leads to, "nodes": how many cells are nodes,
"goals": nodes of each goal, "targets": nodes in which the ego is to be again and again, "others": e-agents, "ordered":
whether crossings keep the order of arrival, "enters": nodes that are to be entered, "crossings": nodes that are such,
"opposite": the other half of each bend or -1, "beside": lanes near the exits of each node, "leaves", "frees": what is
assumed, "unmet", "moves_up": whether E4 is weak and E5 strict}. Standard output, a line for each: {"seconds", "valid",
"winning"}, the latter two as numbers of labelled positions, and with "list" in the request also "lost": those that are
not won, each the cells of the cars, ego first, and pairs (i, j) such that i is before j if they wait together.
"""

from __future__ import annotations

import json
import sys
import time
from itertools import combinations
from typing import Any

from omega.games import gr1
from omega.symbolic import temporal


class Game:
    """One game as formulas: cars are 0 (the ego) to n, `c1` is the cell of car 1, `b_1_2`: 1 waits before 2."""

    def __init__(self, request: dict[str, Any]) -> None:
        self.following = request["following"]
        self.nodes = range(request["nodes"])
        self.inbound = {
            v: [cell for cell in range(request["nodes"], len(self.following)) if self.following[cell] == [v]]
            for v in self.nodes
        }
        self.cars = range(request["others"] + 1)
        self.request = request
        self.aut = temporal.Automaton()
        self.aut.bdd.configure(reordering=True)
        last = len(self.following) - 1
        self.pairs = list(combinations(self.cars, 2)) if request["ordered"] else []
        names = {f"c{i}": (0, last) for i in self.cars} | {f"b_{i}_{j}": "bool" for i, j in self.pairs}
        self.aut.declare_variables(**names)
        self.aut.varlist["sys"] = ["c0", *(f"b_{i}_{j}" for i, j in self.pairs if i == 0)]
        self.aut.varlist["env"] = [name for name in names if name not in self.aut.varlist["sys"]]
        self.aut.moore = False
        self.aut.plus_one = False

    def bdd(self, text: str) -> Any:
        return self.aut.add_expr(text)

    def waits(self, car: str, node: int) -> str:
        return any_of(f"({car} = {lane})" for lane in self.inbound[node])

    def together(self, car: str, other: str) -> str:
        """Say that two cars wait at one node."""
        nodes = [v for v in self.nodes if len(self.inbound[v]) > 1]
        return any_of(f"({self.waits(car, v)} /\\ {self.waits(other, v)})" for v in nodes)

    def before(self, i: int, j: int) -> str:
        return f"b_{i}_{j}" if i < j else f"(~ b_{j}_{i})"

    def first(self, i: int) -> str:
        if not self.pairs:
            return "TRUE"
        others = [j for j in self.cars if j != i]
        return all_of(f"(~ {self.together(f'c{i}', f'c{j}')} \\/ {self.before(i, j)})" for j in others)

    def clear(self, node: int, mover: int, prime: str = "") -> str:
        return all_of(f"(c{j}{prime} # {node})" for j in self.cars if j != mover)

    def ready(self, i: int) -> str:
        """Say that a car waits where it owes an entry: at a clear crossing, or before a bend or dead end."""
        found: list[str] = []
        for v in self.request["enters"]:
            owed = [f"({self.waits(f'c{i}', v)} /\\ {self.clear(v, i)})", self.unmet(v)]
            if v not in self.request["crossings"]:
                up = f"({self.exits_free(v)} \\/ ~ {self.ego_among(self.following[v])})"
                owed.append(up if self.request["moves_up"] else self.open(v))
            found.append(all_of(owed))
        return any_of(found)

    def stuck(self, i: int) -> str:
        """Say that a car is in a node that it owes to leave."""
        return any_of(f"((c{i} = {v}) /\\ {self.open(v)} /\\ {self.unmet(v)})" for v in self.nodes)

    def open(self, node: int) -> str:
        """Say that some exit of a node is free; with E4:unmet also that no e-agent passes by."""
        free = self.exits_free(node)
        other = self.request["opposite"][node]
        if other < 0 or not self.request["unmet"]:
            return free
        return f"({free} /\\ {self.clear(other, 0)})"

    def exits_free(self, node: int) -> str:
        return any_of(all_of(f"(c{j} # {lane})" for j in self.cars) for lane in self.following[node])

    def unmet(self, node: int) -> str:
        """Say that the ego is not in the other half of a bend."""
        other = self.request["opposite"][node]
        return "TRUE" if other < 0 else f"(c0 # {other})"

    def taken(self, nodes: list[int]) -> str:
        return any_of(f"(c{i} = {v})" for i in self.cars[1:] for v in nodes)

    def held_up(self, nodes: list[int]) -> str:
        """Say that nobody in the goal has a free exit, and that the ego is near an exit of one who is there."""
        stuck = all_of(f"(~ {self.taken([v])} \\/ ~ {self.exits_free(v)})" for v in nodes)
        near = any_of(f"({self.taken([v])} /\\ {self.ego_among([*self.request['beside'][v], *nodes])})" for v in nodes)
        return f"({stuck} /\\ {near})"

    def ego_among(self, cells: list[int]) -> str:
        return any_of(f"(c0 = {cell})" for cell in cells)

    def environment(self) -> Any:
        parts = self.aut.true
        for i in self.cars[1:]:
            leave = any_of(
                f"((c{i} = {v}) /\\ {any_of(f'''(c{i}' = {lane})''' for lane in self.following[v])})"
                for v in self.nodes
            )
            enter = any_of(f"({self.waits(f'c{i}', v)} /\\ {self.clear(v, i)} /\\ (c{i}' = {v}))" for v in self.nodes)
            parts &= self.bdd(f"(c{i}' = c{i}) \\/ {leave} \\/ ({enter} /\\ {self.first(i)})")
            parts &= self.bdd(all_of([f"(c{i}' # c0)", *(f"(c{i}' # c{j}')" for j in self.cars[1:i])]))
        for i, j in self.pairs:
            if i:
                parts &= self.order(i, j)
        for i, j, k in combinations(self.cars[1:], 3) if self.pairs else ():
            cycle = f"(b_{i}_{j}' /\\ b_{j}_{k}' /\\ ~ b_{i}_{k}')"
            other = f"(~ b_{i}_{j}' /\\ ~ b_{j}_{k}' /\\ b_{i}_{k}')"
            three = f"({self.together(f'c{i}', f'c{j}')} /\\ {self.together(f'c{j}', f'c{k}')})"
            parts &= ~self.prime(self.bdd(three)) | ~self.bdd(f"{cycle} \\/ {other}")
        return parts

    def prime(self, u: Any) -> Any:
        return self.aut.replace_with_primed([name for name in self.aut.vars if not name.endswith("'")], u)

    def order(self, i: int, j: int) -> Any:
        """Say who is before whom after the turn of the environment."""
        both = self.prime(self.bdd(self.together(f"c{i}", f"c{j}")))
        stayed = self.bdd(f"(c{i}' = c{i}) /\\ (c{j}' = c{j}) /\\ (b_{i}_{j}' <=> b_{i}_{j})")
        one = self.bdd(
            f"((c{i}' = c{i}) /\\ (c{j}' # c{j}) /\\ b_{i}_{j}') \\/ "
            f"((c{i}' # c{i}) /\\ (c{j}' = c{j}) /\\ ~ b_{i}_{j}') \\/ ((c{i}' # c{i}) /\\ (c{j}' # c{j}))"
        )
        return (both & (stayed | one)) | (~both & self.bdd(f"~ b_{i}_{j}'"))

    def ego(self) -> Any:
        leave = any_of(
            f"((c0 = {v}) /\\ {any_of(f'''(c0' = {lane})''' for lane in self.following[v])})" for v in self.nodes
        )
        enter = any_of(f"({self.waits('c0', v)} /\\ {self.clear(v, 0, chr(39))} /\\ (c0' = {v}))" for v in self.nodes)
        may = self.aut.true
        if self.pairs:
            for j in self.cars[1:]:
                there = self.bdd(self.together("c0", f"c{j}")) & self.bdd(f"c{j}' = c{j}")
                may &= ~there | self.bdd(f"b_0_{j}")
        parts = self.bdd(f"(c0' = c0) \\/ {leave}") | (self.bdd(enter) & may)
        parts &= self.bdd(all_of(f"(c0' # c{j}')" for j in self.cars[1:]))
        for j in self.cars[1:] if self.pairs else ():
            both = self.prime(self.bdd(self.together("c0", f"c{j}")))
            ahead = self.bdd(f"(c0' = c0) /\\ ((c{j}' # c{j}) \\/ b_0_{j})")
            now = self.bdd(f"b_0_{j}'")
            parts &= (now & both & ahead) | (~now & ~(both & ahead))
        return parts

    def valid(self) -> Any:
        """Say what is a position: one car a cell, and an order among those who wait together."""
        last = len(self.following)
        found = self.bdd(all_of(f"(c{i} < {last})" for i in self.cars))
        for i, j in combinations(self.cars, 2):
            found &= self.bdd(f"c{i} # c{j}")
        for i, j in self.pairs:
            found &= self.bdd(f"{self.together(f'c{i}', f'c{j}')} \\/ ~ b_{i}_{j}")
        for i, j, k in combinations(self.cars, 3) if self.pairs else ():
            three = self.bdd(f"{self.together(f'c{i}', f'c{j}')} /\\ {self.together(f'c{j}', f'c{k}')}")
            cycles = f"(b_{i}_{j} /\\ b_{j}_{k} /\\ ~ b_{i}_{k}) \\/ (~ b_{i}_{j} /\\ ~ b_{j}_{k} /\\ b_{i}_{k})"
            found &= ~three | ~self.bdd(cycles)
        return found

    def debts(self) -> list[Any]:
        asked = self.request
        found: list[Any] = []
        for i in self.cars[1:]:
            if asked["enters"]:
                found.append(self.bdd(f"{self.ready(i)} /\\ {self.first(i)}"))
            if asked["leaves"]:
                found.append(self.bdd(self.stuck(i)))
        for nodes in asked["goals"] if asked["frees"] else ():
            found.append(self.bdd(f"{self.taken(nodes)} /\\ ~ {self.held_up(nodes)}"))
        return found or [self.aut.false]

    def solve(self) -> Any:
        self.aut.action["env"] = self.environment() & self.valid()
        self.aut.action["sys"] = self.ego()
        self.aut.init["env"] = self.aut.init["sys"] = self.aut.true
        self.aut.win["<>[]"] = self.debts()
        goals = [self.bdd(any_of(f"(c0 = {v})" for v in nodes)) for nodes in self.request["targets"]]
        self.aut.win["[]<>"] = goals
        self.aut.prime_varlists()
        return gr1.solve_streett_game(self.aut)[0]


def any_of(parts: Any) -> str:
    return "(" + (" \\/ ".join(parts) or "FALSE") + ")"


def all_of(parts: Any) -> str:
    return "(" + (" /\\ ".join(parts) or "TRUE") + ")"


def main() -> None:
    for line in sys.stdin:
        print(json.dumps(answer_to(json.loads(line))), flush=True)


def answer_to(request: dict[str, Any]) -> dict[str, Any]:
    begun = time.perf_counter()
    game = Game(request)
    won = game.solve()
    seconds = time.perf_counter() - begun
    names = [f"c{i}" for i in game.cars] + [f"b_{i}_{j}" for i, j in game.pairs]
    valid = game.valid()
    answer: dict[str, Any] = {"seconds": seconds}
    for name, some in (("valid", valid), ("winning", valid & won)):
        answer[name] = game.aut.count(some, care_vars=names)
    if request.get("list"):
        lost = game.aut.pick_iter(valid & ~won, care_vars=names)
        answer["lost"] = [
            [
                [found[f"c{i}"] for i in game.cars],
                [[i, j] if found[f"b_{i}_{j}"] else [j, i] for i, j in game.pairs],
            ]
            for found in lost
        ]
    return answer


if __name__ == "__main__":
    main()
