"""Numbers that are terms of the solver Z3, and the paths of code that branches on them.

A kernel is run as it stands, interpreted, on `Real`, `Whole` and `Flags`. Where it branches on a `Truth`, that asks
the `Explorer` whether the premises allow either way, and takes one; the code runs again for the other, until no way is
left. So what holds on each path holds for all numbers that the premises allow (symbolic execution: King, *Symbolic
execution and program testing*, CACM 19, 1976).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from importlib import import_module
from types import ModuleType
from typing import Any, ClassVar, Final

z3: Any = import_module("z3")
"""The solver. Its annotations name every sort of term wherever a term is meant, which says nothing."""
BITS: Final = 32
"""Width of flags."""
SQUARE: Final = z3.Function("square", z3.RealSort(), z3.RealSort())
"""The square of a number. Of squares the solver is told only that they grow: that is enough, and quick."""


@contextmanager
def replaced(module: ModuleType, names: Mapping[str, Any]) -> Iterator[None]:
    """Let names of a module stand for something else meanwhile; whatever is done to it is undone then."""
    kept = dict(vars(module))
    module.__dict__.update(names)
    try:
        yield
    finally:
        module.__dict__.clear()
        module.__dict__.update(kept)


class Truth:
    """A condition; `bool` of it is a branch."""

    def __init__(self, term: Any) -> None:
        self.term = term

    def __bool__(self) -> bool:
        return explorer().decide(self.term)

    def __or__(self, other: object) -> Truth:
        return Truth(z3.Or(self.term, truth_of(other)))

    def __and__(self, other: object) -> Truth:
        return Truth(z3.And(self.term, truth_of(other)))

    __ror__ = __or__
    __rand__ = __and__


def truth_of(value: Any) -> Any:
    """Return a condition, or True or False, as a term."""
    return value.term if isinstance(value, Truth) else z3.BoolVal(bool(value))


def real_of(value: Any) -> Any:
    """Return a number as a term; a floating-point number as the number that it is."""
    if isinstance(value, Real):
        return value.term
    return z3.RealVal(Fraction(value))


def whole_of(value: Any) -> Any:
    """Return a whole number as a term."""
    return value.term if isinstance(value, Whole) else z3.IntVal(int(value))


class Real:
    """A real number in place of one in floating point."""

    def __init__(self, term: Any) -> None:
        self.term = z3.Real(term) if isinstance(term, str) else term

    def __add__(self, other: Any) -> Real:
        return Real(self.term + real_of(other))

    def __sub__(self, other: Any) -> Real:
        return Real(self.term - real_of(other))

    def __rsub__(self, other: Any) -> Real:
        return Real(real_of(other) - self.term)

    def __mul__(self, other: Any) -> Real:
        if isinstance(other, Real) and self.term.eq(other.term):
            return Real(explorer().square(self.term))
        return Real(self.term * real_of(other))

    def __truediv__(self, other: Any) -> Real:
        return Real(self.term / real_of(other))

    def __neg__(self) -> Real:
        return Real(-self.term)

    def __abs__(self) -> Real:
        return Real(z3.If(self.term >= 0, self.term, -self.term))

    def __lt__(self, other: Any) -> Truth:
        return Truth(self.term < real_of(other))

    def __le__(self, other: Any) -> Truth:
        return Truth(self.term <= real_of(other))

    def __gt__(self, other: Any) -> Truth:
        return Truth(self.term > real_of(other))

    def __ge__(self, other: Any) -> Truth:
        return Truth(self.term >= real_of(other))

    def __eq__(self, other: object) -> Any:
        return Truth(self.term == real_of(other))

    def __ne__(self, other: object) -> Any:
        return Truth(self.term != real_of(other))

    __hash__ = None  # pyright: ignore[reportAssignmentType]  # terms are compared by the solver
    __radd__ = __add__
    __rmul__ = __mul__


class Whole:
    """A whole number: an index, a tick."""

    def __init__(self, term: Any) -> None:
        self.term = z3.Int(term) if isinstance(term, str) else term

    def __add__(self, other: Any) -> Whole:
        return Whole(self.term + whole_of(other))

    def __sub__(self, other: Any) -> Whole:
        return Whole(self.term - whole_of(other))

    def __mul__(self, other: Any) -> Whole:
        return Whole(self.term * whole_of(other))

    def __floordiv__(self, other: int) -> Whole:
        return Whole(self.term / other)

    def __rshift__(self, other: int) -> Whole:
        return Whole(self.term / 2**other)

    def __xor__(self, other: int) -> Whole:
        assert other == 1, "only the lane back is asked for"
        return Whole(z3.If(self.term % 2 == 0, self.term + 1, self.term - 1))

    def __lt__(self, other: Any) -> Truth:
        return Truth(self.term < whole_of(other))

    def __le__(self, other: Any) -> Truth:
        return Truth(self.term <= whole_of(other))

    def __gt__(self, other: Any) -> Truth:
        return Truth(self.term > whole_of(other))

    def __ge__(self, other: Any) -> Truth:
        return Truth(self.term >= whole_of(other))

    def __eq__(self, other: object) -> Any:
        return Truth(self.term == whole_of(other))

    def __ne__(self, other: object) -> Any:
        return Truth(self.term != whole_of(other))

    __hash__ = None  # pyright: ignore[reportAssignmentType]  # terms are compared by the solver
    __radd__ = __add__
    __rmul__ = __mul__


class Flags:
    """A union of flags: of each whether it is set, a condition."""

    def __init__(self, name: str = "", bits: Sequence[Any] = ()) -> None:
        self.bits = list(bits) or [z3.Bool(f"{name}{k}") for k in range(BITS)]

    def has(self, flags: int) -> Any:
        """Return the condition that one of some flags is set."""
        return z3.Or([bit for bit, there in zip(self.bits, _bits(flags), strict=True) if there])

    def __and__(self, other: Any) -> Flags:
        return self._with(other, lambda a, b: (a if b else False) if isinstance(b, bool) else z3.And(a, b))

    def __or__(self, other: Any) -> Flags:
        return self._with(other, lambda a, b: (True if b else a) if isinstance(b, bool) else z3.Or(a, b))

    def __eq__(self, other: object) -> Any:
        return Truth(z3.And([bit == there for bit, there in zip(self.bits, _bits(other), strict=True)]))

    def __ne__(self, other: object) -> Any:
        return Truth(z3.Or([bit != there for bit, there in zip(self.bits, _bits(other), strict=True)]))

    def _with(self, other: Any, join: Callable[[Any, Any], Any]) -> Flags:
        return Flags(bits=[join(_term(a), b) for a, b in zip(self.bits, _bits(other), strict=True)])

    __hash__ = None  # pyright: ignore[reportAssignmentType]  # terms are compared by the solver
    __rand__ = __and__
    __ror__ = __or__


def _term(bit: Any) -> Any:
    return z3.BoolVal(bit) if isinstance(bit, bool) else bit


def _bits(flags: Any) -> list[Any]:
    if isinstance(flags, Flags):
        return [bit if isinstance(bit, bool) else _plain(bit) for bit in flags.bits]
    return [bool(int(flags) >> k & 1) for k in range(BITS)]


def _plain(bit: Any) -> Any:
    return True if z3.is_true(bit) else False if z3.is_false(bit) else bit


def least(*values: Any) -> Any:
    """Return the least of numbers, in place of `min`."""
    found = values[0]
    for value in values[1:]:
        found = _picked(found, value, lambda a, b: a <= b)
    return found


def greatest(*values: Any) -> Any:
    """Return the greatest of numbers, in place of `max`."""
    found = values[0]
    for value in values[1:]:
        found = _picked(found, value, lambda a, b: a >= b)
    return found


def _picked(first: Any, second: Any, better: Callable[[Any, Any], Any]) -> Any:
    if not isinstance(first, (Real, Whole)) and not isinstance(second, (Real, Whole)):
        return first if better(first, second) else second
    kind, made = (Whole, whole_of) if isinstance(first, Whole) or isinstance(second, Whole) else (Real, real_of)
    a, b = made(first), made(second)
    return kind(z3.If(better(a, b), a, b))


class Explorer:
    """Takes code through all its paths.

    Parameters
    ----------
    premises : terms
        What is assumed of the numbers.
    squared : terms
        Numbers of which they have the `SQUARE`.
    """

    current: ClassVar[Explorer | None] = None
    """Who takes the present code through its paths."""

    def __init__(self, *premises: Any, squared: Sequence[Any] = ()) -> None:
        self.solver = z3.Solver()
        self.solver.add(*premises)
        self._squared: list[Any] = []
        for term in squared:
            self.square(term)
        self._first = len(self._squared)
        self._way: list[tuple[bool, bool]] = []
        self._at = 0

    def decide(self, term: Any) -> bool:
        """Return which way a branch goes on this path, and remember whether it may go the other way as well."""
        term = z3.simplify(term)
        if z3.is_true(term) or z3.is_false(term):
            return z3.is_true(term)
        if self._at == len(self._way):
            yes, no = self.may(term), self.may(z3.Not(term))
            assert yes or no, "the premises contradict each other"
            self._way.append((yes, yes and no))
        goes, _ = self._way[self._at]
        self._at += 1
        self.solver.add(term if goes else z3.Not(term))
        return goes

    def square(self, term: Any) -> Any:
        """Return the square of a number, and say where it stands among the others on this path."""
        own = SQUARE(term)
        if not any(term.eq(other) for other in self._squared):
            self.solver.add(own >= 0)
            for other in self._squared:
                both = z3.And(term >= 0, other >= 0)
                self.solver.add(z3.Implies(both, (term <= other) == (own <= SQUARE(other))))
                self.solver.add(z3.Implies(both, (term < other) == (own < SQUARE(other))))
            self._squared.append(term)
        return own

    def may(self, *terms: Any) -> bool:
        """Tell whether the premises and what this path has decided allow that terms hold together."""
        found = self.solver.check(*terms)
        if found == z3.unknown:
            raise RuntimeError(f"the solver gives up: {self.solver.reason_unknown()}")
        return found == z3.sat

    def runs(self, code: Callable[[], object]) -> Iterator[object]:
        """Run code on each path, and yield what it returns; the solver then has what the path has decided."""
        while True:
            self._at = 0
            del self._squared[self._first :]
            self.solver.push()
            Explorer.current = self
            yield code()
            self.solver.pop()
            Explorer.current = None
            while self._way and not self._way[-1][1]:
                self._way.pop()
            if not self._way:
                return
            self._way[-1] = (False, False)


def explorer() -> Explorer:
    """Return who takes the present code through its paths."""
    assert Explorer.current is not None, "a branch outside of any path"
    return Explorer.current
