"""The protocol of metrics: sinks that turn the frames of a trial into a few named values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol, TypeAlias

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending

Value: TypeAlias = float | int | bool | str | None
"""A value of a metric; None where a trial has no such value."""
Kind = Literal["float64", "int32", "int64", "bool", "string"]
KINDS: Final[Mapping[Kind, tuple[type, ...]]] = {
    "float64": (float, int),
    "int32": (int,),
    "int64": (int,),
    "bool": (bool,),
    "string": (str,),
}
"""Kinds of values, each with the types of Python that count as it."""


@dataclass(frozen=True, slots=True)
class Column:
    """The description of one value of a metric: a key in JSON, a column of tables, a line of reports.

    Attributes
    ----------
    name : str
        Key and column, such as ``min_clearance_m``: letters, digits and underscores.
    label : str
        The heading for people, without the unit; if empty, reports have no line for it.
    short : str
        A label for narrow tables; by default `label`.
    unit : str
        ``s``, ``m``, ``share``, ...; empty: a number.
    better : int
        1 where more is better, -1 where less is, 0 where neither is.
    kind : str
        Kind of its values: ``float64``, ``int32``, ``int64``, ``bool`` or ``string``.
    rare : bool
        Whether a report shows it only if some trial has a value other than 0.
    bounded : bool
        Whether it is defined for some trials only, which a report then says.
    meaning : str
        Its meaning, in a sentence.
    """

    name: str
    label: str = ""
    unit: str = ""
    better: int = 0
    kind: Kind = "float64"
    rare: bool = False
    bounded: bool = False
    meaning: str = ""
    short: str = ""

    @property
    def heading(self) -> str:
        """The label with the unit."""
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True, slots=True)
class Measured:
    """A value with the column that describes it."""

    column: Column
    value: Value


class Metric(Protocol):
    """A sink with a result. The constructor takes no arguments; one object sees one trial.

    The frames come in blocks of one simulated second, ``int(rate)`` frames from frame 0 on; the last block has the
    rest. The blocks are the same whether the trial runs by itself, in a batch, or is read from a record, so equal sums
    have equal bits. The arrays of a block can't be written to.
    """

    @property
    def columns(self) -> Sequence[Column]:
        """Its columns; known before a trial begins, and the same for all trials."""
        ...

    def begin(self, instance: Instance) -> None:
        """Begin a trial."""
        ...

    def frames(self, frames: Frames) -> None:
        """Take the next block of frames, with their contacts and events."""
        ...

    def end(self, ending: Ending) -> None:
        """Take the ending of the trial; not called for a record that was cut off."""
        ...

    def result(self) -> Mapping[str, Value]:
        """Return the values by the names of the columns, up to the last frame."""
        ...


@dataclass(frozen=True, slots=True)
class ScoreColumn:
    """A column of every score, and how its value is taken from a `scoring.score.Score`."""

    column: Column
    of: Callable[[Any], Value]


Maker = Callable[[], Metric]
"""Makes a metric for one trial; usually the class itself."""
MetricSpec: TypeAlias = "str | Maker"
"""A metric as users give it: a name, ``module:Class``, ``path/to/file.py:Class``, or a callable that makes it."""
