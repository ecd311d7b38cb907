"""Records as tables: one row per frame and car."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import replace_file, require_output
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.record.reader import Record

COLUMNS = ("tick", "time", "car", "x", "y", "theta", "speed", "yaw_rate")
"""Frame number, seconds, name of the car, metres, radians in (-pi, pi], m/s, rad/s."""


def table(record: Record) -> dict[str, Any]:
    """Return the columns of a record, frame by frame and the ego first in each: arrays, `car` a list of names."""
    frames = record.frames
    count, cars = frames.x.shape
    ticks: Ints = np.arange(frames.first, frames.first + count, dtype=np.int64)
    columns: dict[str, Any] = {
        "tick": np.repeat(ticks, cars),
        "time": np.repeat(frames.time, cars),
        "car": list(record.instance.names) * count,
    }
    for name in COLUMNS[3:]:
        columns[name] = getattr(frames, name).reshape(-1)
    return columns


def write_csv(record: Record, path: Path | str, *, overwrite: bool = False) -> None:
    """Write a record as CSV, lines ended by LF; floats read back to the same bits.

    Raises
    ------
    InputError
        If `path` is refused (`files.require_output`), or the file can't be written; nothing is left behind.
    """
    require_output(path, "a table", (".csv",), overwrite=overwrite)
    columns = table(record)
    columns["car"] = [_quoted(name) for name in columns["car"]]
    cells = [columns[name] if name == "car" else _texts(columns[name]) for name in COLUMNS]
    lines = [",".join(COLUMNS), *map(",".join, zip(*cells, strict=True)), ""]
    text = "\n".join(lines).encode()
    replace_file(Path(path), lambda neighbour: neighbour.write_bytes(text))


def write_parquet(record: Record, path: Path | str, *, overwrite: bool = False) -> None:
    """Write a record as Parquet, with the columns of the CSV.

    Raises
    ------
    MissingExtraError
        Without the extra `parquet`.
    InputError
        As `write_csv`.
    """
    require_output(path, "a table", (".parquet",), overwrite=overwrite)
    with needs("writing Parquet", "parquet"):
        arrow: Any = import_module("pyarrow")
        parquet: Any = import_module("pyarrow.parquet")
    made = arrow.table(table(record))
    replace_file(Path(path), lambda neighbour: parquet.write_table(made, neighbour))


FORMATS: dict[str, Callable[..., None]] = {".csv": write_csv, ".parquet": write_parquet}
"""Writers by the suffix of the file."""


def export(record: Record, path: Path | str, *, overwrite: bool = False) -> None:
    """Write a record as the table that the suffix of `path` asks for, ``.csv`` or ``.parquet``.

    Raises
    ------
    InputError
        For another suffix, or as `write_csv`.
    """
    suffix = Path(path).suffix.lower()
    writer = FORMATS.get(suffix)
    if writer is None:
        raise InputError("not a table's suffix", file=str(path), value=suffix, expected=" or ".join(FORMATS))
    writer(record, path, overwrite=overwrite)


def _texts(column: np.ndarray) -> list[str]:
    return [repr(value) for value in column.tolist()]


def _quoted(text: str) -> str:
    if any(mark in text for mark in ',"\r\n'):
        doubled = text.replace('"', '""')
        return f'"{doubled}"'
    return text
