"""Random formulas for tests, and a semantics of our own on ultimately periodic and on finite words."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from random import Random

import numpy as np

from dubins_traffic.logic.formula import FALSE, TRUE, Formula, Op, conj, disj, make, prop

_UNARY = (Op.NOT, Op.X, Op.F, Op.G)
_BINARY = (Op.U, Op.R, Op.W, Op.M, Op.IMPLIES, Op.IFF, Op.AND, Op.OR, Op.AND, Op.OR)
_PAST = (Op.Y, Op.Z, Op.O, Op.H, Op.S, Op.T)


def drawn(random: Random, depth: int, names: tuple[str, ...], *, past: bool, bounds: bool, longest: int = 3) -> Formula:
    """Return a random formula in which past operators range over past ones only."""
    if depth == 0 or random.random() < 0.1:
        return make(Op.PROP, name=random.choice(names)) if random.random() < 0.95 else random.choice((TRUE, FALSE))
    if past and random.random() < 0.2:
        return drawn_past(random, depth, names)

    def part() -> Formula:
        return drawn(random, depth - 1, names, past=past, bounds=bounds, longest=longest)

    op = random.choice(_UNARY if random.random() < 0.5 else _BINARY)
    limits = None
    if bounds and op in (Op.F, Op.G, Op.U, Op.R) and random.random() < 0.5:
        low = random.choice((0, 0, 1, 2))
        limits = float(low), float(low + random.randint(0, longest))
    if op in _UNARY:
        return make(op, (part(),), bounds=limits)
    if op in (Op.AND, Op.OR):
        return (conj if op is Op.AND else disj)(part(), part())
    return make(op, (part(), part()), bounds=limits)


def drawn_past(random: Random, depth: int, names: tuple[str, ...]) -> Formula:
    """Return a random formula of past operators."""
    if depth == 0 or random.random() < 0.2:
        return make(Op.PROP, name=random.choice(names))
    op = random.choice((*_PAST, Op.NOT, Op.AND, Op.OR))
    count = 1 if op in (Op.Y, Op.Z, Op.O, Op.H, Op.NOT) else 2
    args = tuple(drawn_past(random, depth - 1, names) for _ in range(count))
    return conj(*args) if op is Op.AND else disj(*args) if op is Op.OR else make(op, args)


def past_depth(formula: Formula) -> int:
    """Return how many past operators stand inside each other at most."""
    inner = max((past_depth(arg) for arg in formula.args), default=0)
    return inner + (formula.op in _PAST)


@lru_cache(maxsize=64)
def words(letters: int, length: int) -> np.ndarray:
    """Return all words of a length over letters 0, 1, ..., one per row."""
    return np.array(list(product(range(letters), repeat=length)), dtype=np.int64).reshape(-1, length)


def holds(formula: Formula, prefix: np.ndarray, loop: np.ndarray, names: tuple[str, ...]) -> np.ndarray:
    """Say on which words prefix loop loop ... a formula holds at position 0, one word per row; bounds in positions.

    The loop is written out until past operators repeat; then the last copy is closed to a circle.
    """
    copies = past_depth(formula) + 2
    letters = np.concatenate([prefix, *([loop] * copies)], axis=1)
    size = letters.shape[1]
    after = np.arange(1, size + 1)
    after[-1] = size - loop.shape[1]
    return _Lasso(letters, after, names).value(formula)[:, 0]


class _Lasso:
    def __init__(self, letters: np.ndarray, after: np.ndarray, names: tuple[str, ...]) -> None:
        self.letters = letters
        self.after = after
        self.names = names
        self.known: dict[Formula, np.ndarray] = {}

    def value(self, formula: Formula) -> np.ndarray:
        if formula not in self.known:
            self.known[formula] = self._value(formula)
        return self.known[formula]

    def _value(self, f: Formula) -> np.ndarray:
        if f.op is Op.PROP:
            return (self.letters >> self.names.index(f.name) & 1).astype(bool)
        if f.op in (Op.TRUE, Op.FALSE):
            return np.full(self.letters.shape, f.op is Op.TRUE)
        values = [self.value(arg) for arg in f.args]
        p, q = values[0], values[-1]
        if f.op is Op.NOT:
            return ~p
        if f.op is Op.AND:
            return np.logical_and.reduce(values)
        if f.op is Op.OR:
            return np.logical_or.reduce(values)
        if f.op is Op.IMPLIES:
            return ~p | q
        if f.op is Op.IFF:
            return p == q
        if f.op is Op.X:
            return p[:, self.after]
        if f.op in _PAST:
            return self._past(f.op, p, q)
        low, high = (0, math.inf) if f.bounds is None else f.bounds
        true = np.ones_like(p)
        if f.op is Op.F:
            return self._until(true, p, low, high)
        if f.op is Op.G:
            return ~self._until(true, ~p, low, high)
        if f.op is Op.U:
            return self._until(p, q, low, high)
        if f.op is Op.R:
            return ~self._until(~p, ~q, low, high)
        if f.op is Op.W:
            return self._until(p, q, 0, math.inf) | ~self._until(true, ~p, 0, math.inf)
        return self._until(q, p & q, 0, math.inf)

    def _until(self, p: np.ndarray, q: np.ndarray, low: float, high: float) -> np.ndarray:
        size = p.shape[1]
        last = 2 * size if high == math.inf else int(high)
        found = np.zeros_like(p)
        so_far = np.ones_like(p)
        place = np.arange(size)
        for k in range(last + 1):
            if k >= low:
                found |= so_far & q[:, place]
            so_far = so_far & p[:, place]
            place = self.after[place]
        return found

    def _past(self, op: Op, p: np.ndarray, q: np.ndarray) -> np.ndarray:
        out = np.zeros_like(p)
        for t in range(p.shape[1]):
            if op in (Op.Y, Op.Z):
                out[:, t] = p[:, t - 1] if t else op is Op.Z
            elif op is Op.O:
                out[:, t] = p[:, : t + 1].any(axis=1)
            elif op is Op.H:
                out[:, t] = p[:, : t + 1].all(axis=1)
            else:
                good, kept = (q, p) if op is Op.S else (~q, ~p)
                held = np.zeros(len(p), dtype=bool)
                for k in range(t + 1):
                    held |= good[:, k] & kept[:, k + 1 : t + 1].all(axis=1)
                out[:, t] = held if op is Op.S else ~held
        return out


def holds_finite(formula: Formula, word: list[int], names: tuple[str, ...], at: int = 0) -> bool:
    """Say whether a formula holds at a position of a finite word, next being strong; bounds in positions."""

    def value(f: Formula, t: int) -> bool:
        return holds_finite(f, word, names, t)

    op, args, end = formula.op, formula.args, len(word)
    low, high = (0, end) if formula.bounds is None else (int(formula.bounds[0]), int(formula.bounds[1]))
    ahead = range(at + low, min(end, at + high + 1))
    if op is Op.PROP:
        return bool(word[at] >> names.index(formula.name) & 1)
    if op in (Op.TRUE, Op.FALSE):
        return op is Op.TRUE
    if op is Op.NOT:
        return not value(args[0], at)
    if op is Op.AND:
        return all(value(arg, at) for arg in args)
    if op is Op.OR:
        return any(value(arg, at) for arg in args)
    if op is Op.IMPLIES:
        return not value(args[0], at) or value(args[1], at)
    if op is Op.IFF:
        return value(args[0], at) == value(args[1], at)
    if op is Op.X:
        return at + 1 < end and value(args[0], at + 1)
    if op is Op.F:
        return any(value(args[0], t) for t in ahead)
    if op is Op.G:
        return all(value(args[0], t) for t in ahead)
    if op is Op.U:
        return any(value(args[1], t) and all(value(args[0], k) for k in range(at, t)) for t in ahead)
    if op is Op.R:
        return all(value(args[1], t) or any(value(args[0], k) for k in range(at, t)) for t in ahead)
    if op is Op.W:
        return all(value(args[0], t) or any(value(args[1], k) for k in range(at, t + 1)) for t in ahead)
    if op is Op.M:
        return any(value(args[0], t) and all(value(args[1], k) for k in range(at, t + 1)) for t in ahead)
    if op is Op.Y:
        return at > 0 and value(args[0], at - 1)
    if op is Op.Z:
        return at == 0 or value(args[0], at - 1)
    if op is Op.O:
        return any(value(args[0], t) for t in range(at + 1))
    if op is Op.H:
        return all(value(args[0], t) for t in range(at + 1))
    if op is Op.S:
        return any(value(args[1], t) and all(value(args[0], k) for k in range(t + 1, at + 1)) for t in range(at + 1))
    return all(value(args[1], t) or any(value(args[0], k) for k in range(t + 1, at + 1)) for t in range(at + 1))


def named(*names: str) -> tuple[Formula, ...]:
    """Return propositions."""
    return tuple(prop(name) for name in names)
