"""Machines as circuits in AIGER (Biere, 2007, and version 1.9), ASCII or binary, as SYNTCOMP has its solutions.

Inputs and outputs are known by the names in the symbol table. A latch begins as its reset value, 0 unless given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, cast

from dubins_traffic.synthesis.foreign.machine import Letter, Sides, State, damaged

WHAT: Final = "AIGER"
MOST_VARIABLES: Final = 4_000_000
"""Most variables of a circuit, and most inputs, latches, outputs and gates."""
LONGEST_DELTA: Final = 28
"""Bits of a number of binary AIGER after which there are at most seven more."""


@dataclass(frozen=True)
class Latch:
    """A latch: its literal, that of its next value, and whether it begins as 1."""

    literal: int
    following: int
    reset: bool


@dataclass(frozen=True)
class Circuit:
    """A machine as and-gates, in an order in which each depends on those before it."""

    variables: int
    inputs: Sequence[tuple[str, int]]
    outputs: Sequence[tuple[str, int]]
    latches: Sequence[Latch]
    gates: Sequence[tuple[int, int, int]]

    @property
    def names(self) -> Sequence[str]:
        """All propositions."""
        return [*self.sides.read, *self.sides.answered]

    @property
    def sides(self) -> Sides:
        """Its inputs and outputs."""
        return Sides([name for name, _ in self.inputs], [name for name, _ in self.outputs])

    def begin(self) -> State:
        """Return the reset values of the latches."""
        return tuple(latch.reset for latch in self.latches)

    def step(self, state: State, letter: Letter) -> tuple[State, Letter] | None:
        """Return the next values of the latches and the outputs; propositions that are not given are false."""
        values = cast("tuple[bool, ...]", state)
        held = bytearray(self.variables + 1)
        for name, literal in self.inputs:
            held[literal >> 1] = letter.get(name, False)
        for latch, value in zip(self.latches, values, strict=True):
            held[latch.literal >> 1] = value
        for gate, left, right in self.gates:
            held[gate >> 1] = (held[left >> 1] ^ (left & 1)) & (held[right >> 1] ^ (right & 1))

        def value_of(literal: int) -> bool:
            return bool(held[literal >> 1] ^ (literal & 1))

        after = tuple(value_of(latch.following) for latch in self.latches)
        return after, {name: value_of(literal) for name, literal in self.outputs}


def is_aiger(data: bytes) -> bool:
    """Tell whether data begin as AIGER does."""
    return data.startswith((b"aag ", b"aig "))


def read_aiger(data: bytes) -> Circuit:
    """Return the machine in a file; InputError if it is none."""
    head, _, rest = data.partition(b"\n")
    words = head.split()
    sizes = [int(word) for word in words[1:] if word.isdigit() and len(word) < 20]
    if len(sizes) != len(words) - 1 or len(sizes) < 5 or any(sizes[5:]):
        raise damaged(WHAT, "not a header", value=head.decode("latin-1")[:80])
    if max(sizes) > MOST_VARIABLES:
        raise damaged(WHAT, "too large a circuit", value=max(sizes))
    reader = _Reader(rest, sizes, binary=words[0] == b"aig")
    try:
        return reader.circuit()
    except (ValueError, IndexError, UnicodeDecodeError):
        raise damaged(WHAT, "cut off, or not as its header says") from None


class _Reader:
    """Reads what follows the header."""

    def __init__(self, data: bytes, sizes: Sequence[int], *, binary: bool) -> None:
        self._data = data
        self._place = 0
        self._most, self._inputs, self._latches, self._outputs, self._gates = sizes[:5]
        self._binary = binary

    def circuit(self) -> Circuit:
        """Return the machine."""
        count = self._inputs
        inputs = [2 * k + 2 for k in range(count)] if self._binary else [self._numbers()[0] for _ in range(count)]
        latches = [self._latch(k) for k in range(self._latches)]
        outputs = [self._numbers()[0] for _ in range(self._outputs)]
        gates = [self._binary_gate(k) if self._binary else self._gate() for k in range(self._gates)]
        literals = [*inputs, *outputs, *(value for gate in gates for value in gate)]
        literals += [value for latch in latches for value in (latch.literal, latch.following)]
        if any(not 0 <= literal <= 2 * self._most + 1 for literal in literals):
            raise damaged(WHAT, "a literal of no variable")
        names = self._symbols()
        named = [
            [(names.get(f"{kind}{k}", f"{kind}{k}"), literal) for k, literal in enumerate(signals)]
            for kind, signals in (("i", inputs), ("o", outputs))
        ]
        return Circuit(self._most, named[0], named[1], latches, self._ordered(inputs, latches, gates))

    def _line(self) -> bytes:
        end = self._data.index(b"\n", self._place)
        line = self._data[self._place : end]
        self._place = end + 1
        return line

    def _numbers(self) -> list[int]:
        return [int(word) for word in self._line().split()]

    def _latch(self, number: int) -> Latch:
        numbers = self._numbers()
        literal = 2 * (self._inputs + number) + 2 if self._binary else numbers.pop(0)
        reset = numbers[1] if len(numbers) > 1 else 0
        return Latch(literal, numbers[0], reset == 1)

    def _gate(self) -> tuple[int, int, int]:
        gate, left, right = self._numbers()
        return gate, left, right

    def _binary_gate(self, number: int) -> tuple[int, int, int]:
        gate = 2 * (self._inputs + self._latches + number) + 2
        left = gate - self._delta()
        return gate, left, left - self._delta()

    def _delta(self) -> int:
        value, shift = 0, 0
        while True:
            byte = self._data[self._place]
            self._place += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value
            if shift > LONGEST_DELTA:
                raise ValueError("a number of no variable")

    def _symbols(self) -> dict[str, str]:
        names: dict[str, str] = {}
        for line in self._data[self._place :].decode("utf-8", "replace").splitlines():
            if line == "c":
                break
            key, _, name = line.partition(" ")
            if name:
                names[key] = name.strip()
        return names

    def _ordered(
        self, inputs: Sequence[int], latches: Sequence[Latch], gates: Sequence[tuple[int, int, int]]
    ) -> list[tuple[int, int, int]]:
        """Return the gates such that each comes after those that it depends on."""
        known = {0, *(literal >> 1 for literal in inputs), *(latch.literal >> 1 for latch in latches)}
        by_variable = {gate >> 1: (gate, left, right) for gate, left, right in gates}
        ordered: list[tuple[int, int, int]] = []
        stack = [gate >> 1 for gate, _, _ in reversed(gates)]
        opened: set[int] = set()
        while stack:
            variable = stack[-1]
            if variable in known:
                stack.pop()
                continue
            if variable not in by_variable:
                raise damaged(WHAT, "a variable that is nothing", value=variable)
            gate = by_variable[variable]
            missing = [literal >> 1 for literal in gate[1:] if literal >> 1 not in known]
            if missing and variable in opened:
                raise damaged(WHAT, "gates that depend on each other", value=variable)
            opened.add(variable)
            if missing:
                stack += missing
                continue
            ordered.append(gate)
            known.add(variable)
        return ordered
