"""A game of four cells, and one Mealy machine for it in the formats of several tools."""

from __future__ import annotations

import json
from itertools import product
from pathlib import Path
from typing import Any

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.instance import assumption_of, cell_of, cells_of

ROAD: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 6, "transform": [0, 0, 0], "segments": [[0, 0, 1, 0]]},
    "ego": {"start": [1.5, -0.3, 0.0]},
    "e-agents": [{"type": "lawful", "name": "car", "start": [4.5, 0.3, 3.141592653589793]}],
    "goals": [[0, 0], [1, 0]],
    "duration": 60,
    "laser": False,
    "rules": True,
}
"""One road with two dead ends: two nodes and two lanes."""


def instance() -> Instance:
    return draw(load_config(ROAD), 5, 0)


def board_of(some: Instance) -> Board:
    return Board(cells_of(some.problem), assumption_of(some.problem), len(some.e_agents))


def starts_of(some: Instance) -> list[int]:
    board = board_of(some)
    return [cell_of(board.road_cells, some.problem, pose) for pose in some.starts]


def round_trip() -> dict[int, int]:
    """Return the cell after each cell."""
    board = board_of(instance())
    return {cell: board.road_cells.following(cell)[0] for cell in range(board.road_cells.cells)}


def machine() -> tuple[int, dict[tuple[int, int], int]]:
    """Return the machine: its first state, and the next one by state and cell of the other car.

    A state is the cell of the ego, which is the answer too: the next one on the way round if the other is not there.
    It begins in the cell before that of the start, from which it answers with that one.
    """
    after = round_trip()
    start = starts_of(instance())[0]
    first = next(cell for cell in after if after[cell] == start)
    steps = {(own, other): own if after[own] == other else after[own] for own, other in product(after, after)}
    return first, steps


def as_hoa() -> str:
    first, steps = machine()
    lines = ["HOA: v1", "States: 4", f"Start: {first}", 'AP: 4 "car1_0" "car1_1" "ego_0" "ego_1"']
    lines += ["acc-name: all", "Acceptance: 0 t", "controllable-AP: 2 3", "--BODY--"]
    for own in range(4):
        lines.append(f'State: {own} "cell {own}"')
        for other in range(4):
            target = steps[own, other]
            bits = [other & 1, other >> 1, target & 1, target >> 1]
            label = "&".join(f"{'' if bit else '!'}{k}" for k, bit in enumerate(bits))
            lines.append(f"[{label}] {target}")
    return "\n".join([*lines, "--END--"]) + "\n"


class Gates:
    """And-gates over inputs 2 and 4 and latches 6 and 8."""

    def __init__(self) -> None:
        self.gates: list[tuple[int, int, int]] = []

    def both(self, left: int, right: int) -> int:
        self.gates.append((2 * (5 + len(self.gates)), max(left, right), min(left, right)))
        return self.gates[-1][0]

    def any(self, literals: list[int]) -> int:
        found = 0
        for literal in literals:
            found = self.both(found ^ 1, literal ^ 1) ^ 1
        return found

    def equals(self, low: int, high: int, value: int) -> int:
        return self.both(low ^ (not value & 1), high ^ (not value >> 1))


def circuit() -> tuple[Gates, list[int], int]:
    """Return the gates, the literals of the answer, and the first state."""
    first, steps = machine()
    gates = Gates()
    own = [gates.equals(6, 8, value) for value in range(4)]
    other = [gates.equals(2, 4, value) for value in range(4)]
    cases = {pair: gates.both(own[pair[0]], other[pair[1]]) for pair in steps}
    bits = [gates.any([cases[pair] for pair in steps if steps[pair] >> bit & 1]) for bit in (0, 1)]
    return gates, bits, first


SYMBOLS = "i0 car1_0\ni1 car1_1\no0 ego_0\no1 ego_1\nc\na machine of four states\n"


def as_aag() -> str:
    gates, bits, first = circuit()
    most = 4 + len(gates.gates)
    lines = [f"aag {most} 2 2 2 {len(gates.gates)}", "2", "4"]
    lines += [f"6 {bits[0]} {first & 1}", f"8 {bits[1]} {first >> 1}", *map(str, bits)]
    lines += [f"{gate} {left} {right}" for gate, left, right in gates.gates]
    return "\n".join(lines) + "\n" + SYMBOLS


def as_aig() -> bytes:
    gates, bits, first = circuit()
    most = 4 + len(gates.gates)
    lines = [f"aig {most} 2 2 2 {len(gates.gates)}"]
    lines += [f"{bits[0]} {first & 1}", f"{bits[1]} {first >> 1}", *map(str, bits)]
    body = b"".join(_delta(gate - left) + _delta(left - right) for gate, left, right in gates.gates)
    return ("\n".join(lines) + "\n").encode() + body + SYMBOLS.encode()


def _delta(value: int) -> bytes:
    found = bytearray()
    while value > 127:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])


def nodes() -> dict[str, tuple[list[int], list[int]]]:
    """Return the nodes that slugs would have: ego and other car, and the numbers of those that follow."""
    _, steps = machine()
    start = starts_of(instance())[0]
    pairs = [pair for pair in product(range(4), range(4)) if pair[0] != pair[1]]
    pairs.sort(key=lambda pair: pair[0] != start)
    number = {pair: k for k, pair in enumerate(pairs)}
    found: dict[str, tuple[list[int], list[int]]] = {}
    for own, other in pairs:
        bits = [other & 1, other >> 1, own & 1, own >> 1]
        after = {(steps[own, then], then) for then in range(4)}
        found[str(number[own, other])] = (bits, sorted(number[pair] for pair in after if pair in number))
    return found


NAMES = ["car1_0", "car1_1", "ego_0", "ego_1"]


def as_slugs_json() -> str:
    body = {key: {"rank": 0, "state": bits, "trans": to} for key, (bits, to) in nodes().items()}
    return json.dumps({"version": 0, "slugs": "0.0.1", "variables": NAMES, "nodes": body})


def as_slugs_text() -> str:
    lines: list[str] = []
    for key, (bits, to) in nodes().items():
        values = ", ".join(f"{name}:{bit}" for name, bit in zip(NAMES, bits, strict=True))
        lines += [f"State {key} with rank 0 -> <{values}>", f"\tWith successors : {', '.join(map(str, to))}"]
    return "\n".join(lines) + "\n"


def as_tulip() -> str:
    first, steps = machine()
    lines = ["class TulipStrategy:", '    """Mealy transducer."""', "    def __init__(self):"]
    lines += [f"        self.state = {first}", "        self.input_vars = ['car1_0', 'car1_1']", ""]
    lines += ["    def move(self, car1_0, car1_1) -> dict:", "        output = dict()"]
    for own in range(4):
        lines.append(f"        {'el' if own else ''}if self.state == {own}:")
        for other in range(4):
            target = steps[own, other]
            guard = f"(car1_0 == {bool(other & 1)}) and (car1_1 == {bool(other >> 1)})"
            lines += [
                f"            {'el' if other else ''}if {guard}:",
                f"                self.state = {target}",
                "",
            ]
            lines += [f'                output["ego_{bit}"] = {bool(target >> bit & 1)}' for bit in (0, 1)]
        lines += ["            else:", "                self._error(car1_0, car1_1)"]
    return "\n".join([*lines, "        else:", "            raise AssertionError()", "        return output"]) + "\n"


def files(folder: Path) -> dict[str, Path]:
    """Write the machine in all formats; return the files by format. Their names say nothing."""
    texts = {
        "hoa": as_hoa().encode(),
        "aag": as_aag().encode(),
        "aig": as_aig(),
        "slugs json": as_slugs_json().encode(),
        "slugs text": as_slugs_text().encode(),
        "tulip": as_tulip().encode(),
    }
    found: dict[str, Path] = {}
    for k, (form, data) in enumerate(texts.items()):
        found[form] = folder / (f"strategy{k}.py" if form == "tulip" else f"strategy{k}")
        found[form].write_bytes(data)
    return found
