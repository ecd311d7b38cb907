"""The outcome of verifying a record."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

from dubins_traffic.record.header import PACKAGE


@dataclass(frozen=True, slots=True)
class Difference:
    """The first difference: `what` differs, its car and frame if it has any, the recorded and the expected value."""

    what: str
    recorded: Any
    expected: Any
    tick: int | None = None
    car: str | None = None

    def __str__(self) -> str:
        place = "" if self.car is None else f" of {self.car}"
        place += "" if self.tick is None else f" at tick {self.tick}"
        return f"{self.what}{place}: recorded {_as_text(self.recorded)}, expected {_as_text(self.expected)}"

    def to_json(self) -> dict[str, Any]:
        """Return the difference as a JSON object."""
        values = {name: _plain(getattr(self, name)) for name in ("recorded", "expected")}
        return {"what": self.what, "tick": self.tick, "car": self.car, **values}


@dataclass(frozen=True, slots=True)
class Verification:
    """The outcome for one record.

    Attributes
    ----------
    record : str or None
        The name it was read from.
    difference : Difference or None
        What differs first, None if nothing does.
    world : str
        The simulator that the record's instance names; `embedded` is simulated again, others are not ours.
    ticks, cars : int
        Ticks of the trial that the record holds, and its cars.
    end : str or None
        The named end; None if the record was cut off, and what is there has been verified.
    written_by : str
        The version of this package that wrote the record.
    unchecked : tuple of str
        What could not be checked, and is taken as it was recorded.
    sheet : str or None
        The score sheet beside the record, whose score of it was computed again.
    """

    record: str | None
    difference: Difference | None
    world: str
    ticks: int
    cars: int
    end: str | None
    written_by: str
    unchecked: tuple[str, ...]
    sheet: str | None = None

    @property
    def verified(self) -> bool:
        """Whether nothing differs."""
        return self.difference is None

    def __str__(self) -> str:
        if self.difference is not None:
            return f"differs: {self.difference}{self._versions()}"
        early = "" if self.end is not None else f", ends early: cut off after tick {self.ticks}"
        only = "" if self.world == OURS else f", in the world {self.world}: frames fit the bounds, contacts the poses"
        score = "" if self.sheet is None else f", with its score in {self.sheet}"
        return f"verified{early}{only}{score}"

    def to_json(self) -> dict[str, Any]:
        """Return the outcome as a JSON object."""
        return {
            "record": self.record,
            "verified": self.verified,
            "difference": None if self.difference is None else self.difference.to_json(),
            "world": self.world,
            "ticks": self.ticks,
            "cars": self.cars,
            "end": self.end,
            "written_by": self.written_by,
            "unchecked": list(self.unchecked),
            "sheet": self.sheet,
        }

    def _versions(self) -> str:
        """Return the remark on a record of another version of the package, which may have given other results."""
        installed = version(PACKAGE)
        return "" if installed == self.written_by else f" (written by {PACKAGE} {self.written_by}, this is {installed})"


OURS = "embedded"
"""The simulator whose trials can be simulated again."""


def _as_text(value: Any) -> str:
    text = "nothing" if value is None else value if isinstance(value, str) else repr(value)
    return text if len(text) <= 300 else f"{text[:297]}..."


def _plain(value: Any) -> Any:
    return value if value is None or isinstance(value, bool | int | float | str) else _as_text(value)
