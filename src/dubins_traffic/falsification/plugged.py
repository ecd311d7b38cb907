"""A search's strategy from outside: a class of a user's own, or an adapter of another package's sampler.

It runs in this process and is trusted. What it proposes is looked at: a point that is none, or no answer at all for a
minute, ends the search with a message that names it, and what has been found is kept.
"""

from __future__ import annotations

import hashlib
import math
import queue
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol, TypeVar, cast

import numpy as np

from dubins_traffic import outside
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.cube import Cube
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.falsification.sampling import Source

if TYPE_CHECKING:
    from dubins_traffic.falsification.trying import Tried
    from dubins_traffic.kernels.arrays import Floats

WAIT: Final = 60.0
"""Seconds within which it has to answer."""
_SEAM: Final = outside.Seam(
    "--strategy", "strategy", ("begin", "tell", "propose"),
    "begin(space), propose(history) -> points and tell(results)",
)  # fmt: skip
Answer = TypeVar("Answer")


class Space(NamedTuple):
    """What is searched: points of `size` numbers from 0 to 1, for breaches of `targets`; all follows from `seed`."""

    size: int
    seed: int
    targets: tuple[str, ...]


class Trial(NamedTuple):
    """What came of a point: how far from a breach the ego stayed.

    `margin` is the least of those of the targets, negative if one was broken, infinite if the ego came near none, and
    None if the trial says nothing of the ego: others broke their rules first, or it ended by a fault.
    """

    point: tuple[float, ...]
    margin: float | None


class Sampler(Protocol):
    """Proposes points. The same seed and results must lead to the same proposals: so a search can be resumed."""

    def begin(self, space: Space) -> None:
        """Begin a search."""
        ...

    def propose(self, history: Sequence[Trial]) -> Sequence[Sequence[float]]:
        """Return the points to try next, as many as it likes; none: the search is over. `history` is all so far."""
        ...

    def tell(self, results: Sequence[Trial]) -> None:
        """Learn what came of all that was proposed last, in that order."""
        ...


class Plugged:
    """Lets a class at ``module:Class`` or ``path/to/file.py:Class`` propose (a `strategies.Strategy`).

    Raises
    ------
    InputError
        If there is no such class, or it can't begin, raises, proposes what is no point, or does not answer.
    """

    def __init__(self, spec: str, source: Source, targets: Sequence[str]) -> None:
        self._spec, self._cube = spec, Cube(source, 0, starts=True)
        self._space = Space(self._cube.size, source.seed, tuple(targets))
        if self._space.size == 0:
            raise InputError(
                "there is nothing to choose", file="--strategy", value=spec,
                expected="e-agents of the kind lawful, or starts that are drawn",
            )  # fmt: skip
        self._history: list[Trial] = []
        self._waiting: list[tuple[float, ...]] = []
        """Points that have been proposed and not tried yet."""
        self._under_way: list[tuple[float, ...]] = []
        self._round: list[Trial] = []
        """Results of the points that were proposed last."""
        self._begin()

    def _begin(self) -> None:
        made = outside.make(outside.find(self._spec, _SEAM), self._spec, _SEAM)
        self._sampler = cast("Sampler", made)
        self._asked("begin", lambda: self._sampler.begin(self._space))

    def propose(self, numbers: Sequence[int]) -> list[Genome]:
        """Return the genomes of the points that are proposed next: at most one for each number."""
        if not self._waiting:
            self._waiting = self._points()
        count = min(len(numbers), len(self._waiting))
        self._under_way, self._waiting = self._waiting[:count], self._waiting[count:]
        return [self._cube.genome(np.array(point)) for point in self._under_way]

    def _points(self) -> list[tuple[float, ...]]:
        """Return what is proposed, looked at."""
        history = tuple(self._history)
        given: Any = self._asked("propose", lambda: list(self._sampler.propose(history)))
        return [self._point(point) for point in given]

    def _point(self, given: Any) -> tuple[float, ...]:
        size = self._space.size
        try:
            point: Floats = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError):
            point = np.zeros(0)
        if point.shape != (size,) or not bool(((point >= 0.0) & (point <= 1.0)).all()):
            wrong = next((number for number in point.ravel().tolist() if not 0.0 <= number <= 1.0), given)
            value = f"{point.size} numbers" if point.shape != (size,) else wrong
            raise self._refused("proposes no point", value, f"{size} numbers from 0 to 1")
        return tuple(point.tolist())

    def tell(self, number: int, genome: Genome, tried: Tried, known: bool) -> None:  # noqa: ARG002  # as all strategies
        """Learn what came of a point; the sampler is told after the last one that it has proposed."""
        if tried.discarded or tried.faulty:
            margin = None
        else:
            margin = min(tried.margins.get(target, math.inf) for target in self._space.targets)
        self._hear(margin)

    def _hear(self, margin: float | None) -> None:
        trial = Trial(self._under_way.pop(0), margin)
        self._round.append(trial)
        self._history.append(trial)
        if not self._under_way and not self._waiting:
            told, self._round = tuple(self._round), []
            self._asked("tell", lambda: self._sampler.tell(told))

    def state(self) -> Any:
        """Return the margins of all trials, from which `restore` goes the same way again."""
        return {
            "margins": [_written(trial.margin) for trial in self._history],
            "points": _digest(self._history),
        }

    def restore(self, state: Any) -> None:
        """Go the way again that led to a state; InputError if the sampler proposes something else this time."""
        margins: list[Any] = list(state["margins"])
        while margins:
            count = len(self.propose(range(len(margins))))
            if count == 0:
                break
            for margin in margins[:count]:
                self._hear(math.inf if margin == "inf" else margin)
            del margins[:count]
        if margins or _digest(self._history) != state["points"]:
            raise self._refused(
                "does not propose again what it did",
                self._spec,
                "all to follow from the seed and what it is told",
            )

    def _asked(self, method: str, call: Callable[[], Answer]) -> Answer:
        """Return what the sampler answers; InputError if it raises, or does not answer within `WAIT`."""
        came: queue.SimpleQueue[tuple[Answer | None, BaseException | None]] = queue.SimpleQueue()

        def run() -> None:
            try:
                came.put((call(), None))
            except BaseException as error:  # whatever it raises is told
                came.put((None, error))

        # A daemon: what never ends must not keep the process, either.
        threading.Thread(target=run, daemon=True).start()
        try:
            answer, error = came.get(timeout=WAIT)
        except queue.Empty:
            raise self._refused(f"{method} has not ended after {WAIT:g} s", self._spec, "an answer") from None
        if isinstance(error, InputError):
            raise error
        if error is not None:
            raise self._refused(f"{method} raised {outside.plainly(error)}", self._spec, "an answer") from error
        return cast("Answer", answer)

    def _refused(self, problem: str, value: object, expected: str) -> InputError:
        field = None if value == self._spec else self._spec
        return InputError(problem, file="--strategy", field=field, value=value, expected=expected)


def _written(margin: float | None) -> float | str | None:
    return "inf" if margin == math.inf else margin


def _digest(history: Sequence[Trial]) -> str:
    """Return what tells the points of trials from others."""
    return hashlib.sha256(np.array([trial.point for trial in history]).tobytes()).hexdigest()
