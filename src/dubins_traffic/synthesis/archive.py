"""NumPy archives (`.npz`) of strategies and games: read with care, written whole or not at all.

An archive from elsewhere may claim to hold any amount of data. So nothing of an array is read before its declared type
and size are known to be those that are expected.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from pydantic import TypeAdapter, ValidationError

from dubins_traffic import files
from dubins_traffic.errors import InputError

ARCHIVE: Final = "an archive"
SUFFIXES: Final = (".npz",)
MOST_HEADER: Final = 16 << 20
"""Most bytes of the JSON in an archive."""
WIDEST: Final = 8
"""Most bytes of a number."""
SPARE: Final = 4096
"""Most bytes that say what an array is like."""
_OBJECT: Final = TypeAdapter(dict[str, Any])
DAMAGED: Final = (OSError, ValueError, EOFError, AttributeError, RuntimeError, SyntaxError, zlib.error)
"""What NumPy and zipfile raise for files that are not what they claim."""


def save_arrays(
    path: str | Path,
    header: Mapping[str, Any],
    arrays: Mapping[str, npt.NDArray[Any]],
    *,
    overwrite: bool = False,
) -> None:
    """Write an archive, its header first.

    InputError if the path is refused (`files.require_output`), or the file can't be written.
    """
    files.require_output(path, ARCHIVE, SUFFIXES, overwrite=overwrite)
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    def write(neighbour: Path) -> None:
        with neighbour.open("wb") as stream:
            np.savez_compressed(stream, allow_pickle=False, header=text, **arrays)

    files.replace_file(Path(path), write)


class Archive:
    """An archive that is open for reading.

    Parameters
    ----------
    what : str
        What it should be, for messages.

    Raises
    ------
    InputError
        If it can't be read or is no archive.
    """

    def __init__(self, path: str | Path, what: str) -> None:
        self._name, self._what = str(path), what
        self._zip: zipfile.ZipFile = self._read(lambda: zipfile.ZipFile(path))

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._zip.close()

    def header(self) -> dict[str, Any]:
        """Return the header, a JSON object; InputError if there is none."""
        text = self.array("header", np.uint8, MOST_HEADER).tobytes()
        try:
            return _OBJECT.validate_json(text)
        except ValidationError:
            raise InputError(f"no {self._what}", field="header", expected=f"the header of a {self._what}") from None

    def array(self, name: str, kind: type[np.generic], most: int, *, exactly: bool = False) -> npt.NDArray[Any]:
        """Return one array of whole numbers, in one row.

        Parameters
        ----------
        name : str
            Its name in the archive.
        kind : type
            The largest type of numbers that it may hold.
        most : int
            How many numbers it may hold.
        exactly : bool
            Whether it must hold so many.

        Raises
        ------
        InputError
            If it is not there or not such an array; nothing of its numbers is read then.
        """
        try:
            member = self._zip.getinfo(f"{name}.npy")
        except KeyError:
            raise InputError(f"no {self._what}", field=name, expected=f"the arrays of a {self._what}") from None
        room = most * WIDEST + SPARE
        if member.file_size > room:
            raise InputError("too large", field=name, value=f"{member.file_size} bytes", expected=f"at most {room}")
        numbers = self._read(lambda: self._array(member, name, kind, most))
        if exactly and len(numbers) != most:
            raise InputError("of another size", field=name, value=len(numbers), expected=f"{most} numbers")
        return numbers

    def _array(self, member: zipfile.ZipInfo, name: str, kind: type[np.generic], most: int) -> npt.NDArray[Any]:
        with self._zip.open(member) as stream:
            version = np.lib.format.read_magic(stream)
            if version != (1, 0):
                raise ValueError(f"{name}: an array of version {version}")
            shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
            allowed = np.issubdtype(dtype, np.integer) and np.can_cast(dtype, kind)
            if not allowed or len(shape) != 1 or shape[0] > most:
                raise InputError(
                    f"not an array of a {self._what}",
                    field=name,
                    value=f"{dtype} {shape}",
                    expected=f"at most {most} numbers of type {np.dtype(kind)}",
                )
            data = stream.read(shape[0] * dtype.itemsize + 1)
        if len(data) != shape[0] * dtype.itemsize:
            raise ValueError(f"{name}: {len(data)} bytes instead of {shape[0]} numbers")
        return np.frombuffer(data, dtype=dtype)

    def _read(self, read: Callable[[], Any]) -> Any:
        """Return what `read` returns; InputError for all that a damaged file may bring about."""
        try:
            return read()
        except InputError:
            raise
        except FileNotFoundError:
            raise InputError("no such file", file=self._name) from None
        except zipfile.BadZipFile:
            problem = f"can't be read as a {self._what} (no NumPy archive, or only a part of one)"
            raise InputError(problem, file=self._name) from None
        except DAMAGED as error:
            raise InputError(f"can't be read as a {self._what} ({error})", file=self._name) from None
