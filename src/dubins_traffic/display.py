"""What notebooks and data frames ask of a value; rooms above the one in which it is defined answer (`above`)."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from dubins_traffic.above import ABOVE
from dubins_traffic.errors import needs


class Pictured:
    """A value that notebooks show as a small page with a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        return ABOVE.html_of(self)


class Tabulated:
    """A value that becomes a table of trials, one a row, with the columns of a campaign's table."""

    __slots__ = ()

    def to_pandas(self) -> Any:
        """Return a pandas `DataFrame` with one row a trial; the columns are those of docs/campaigns.md.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        return data_frame(ABOVE.rows_of(self))


def data_frame(rows: Any) -> Any:
    """Return rows (name to value), or columns, as a pandas `DataFrame`.

    Raises
    ------
    MissingExtraError
        If pandas is not installed.
    """
    return pandas().DataFrame(rows)


def pandas() -> Any:
    """Return pandas; MissingExtraError if it is not installed."""
    with needs("a DataFrame", "pandas"):
        return import_module("pandas")


def count(number: int, noun: str) -> str:
    """Return a number with its noun: ``1 goal``, ``3 goals``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
