"""What a metric is: a sink that turns the frames of a trial into a few named values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, Protocol, TypeAlias

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending

Value: TypeAlias = float | int | bool | str | None
"""What a metric tells; None where a trial has no such value."""
Kind = Literal["float64", "int32", "int64", "bool", "string"]
KINDS: Final[Mapping[Kind, tuple[type, ...]]] = {
    "float64": (float, int),
    "int32": (int,),
    "int64": (int,),
    "bool": (bool,),
    "string": (str,),
}
"""Kinds of values, with the types of Python that are taken for them."""


@dataclass(frozen=True, slots=True)
class Column:
    """One value that is told of each trial: a key in JSON, a column of tables, a line of reports.

    Attributes
    ----------
    name : str
        Key and column, such as ``min_clearance_m``: letters, digits and underscores.
    label : str
        The same for people, without the unit.
    short : str
        A label for narrow tables; by default `label`.
    unit : str
        ``s``, ``m``, ``share``, ...; empty: a number.
    better : int
        1 where more is better, -1 where less is, 0 where neither is.
    kind : str
        Of its values: ``float64``, ``int32``, ``int64``, ``bool`` or ``string``.
    rare : bool
        Whether a report tells it only where some trial has more than none of it.
    bounded : bool
        Whether it is not defined for every trial, which a report then says.
    meaning : str
        What it tells, in a sentence.
    """

    name: str
    label: str
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
    """A value with the column that says what it is."""

    column: Column
    value: Value


class Metric(Protocol):
    """A sink with a result; a class without arguments, of which one object sees one trial.

    The frames come in blocks of one simulated second, ``int(rate)`` frames from frame 0 on, the last block with what is
    left: the same blocks whether the trial runs by itself, in a batch, or is read from a record. So the same sums give
    the same bits everywhere. The arrays of a block can't be written to.
    """

    @property
    def columns(self) -> Sequence[Column]:
        """What it tells; known before a trial begins and the same for all."""
        ...

    def begin(self, instance: Instance) -> None:
        """A trial begins."""
        ...

    def frames(self, frames: Frames) -> None:
        """The next block of frames, with their contacts and events."""
        ...

    def end(self, ending: Ending) -> None:
        """The trial has ended; a record that was cut off has no ending."""
        ...

    def result(self) -> Mapping[str, Value]:
        """Return the values by the names of the columns, up to the last frame."""
        ...


Maker = Callable[[], Metric]
"""Makes a metric for one trial; the class itself, as a rule."""
MetricSpec: TypeAlias = "str | Maker"
"""How a metric is asked for: its name, where its class is, or what makes it."""
