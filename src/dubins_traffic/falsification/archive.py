"""The folder of a search: one case for each kind of failure, what the search has done, and where it goes on."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Container, Generator, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.case import Case, read_case
from dubins_traffic.falsification.journal import Journal
from dubins_traffic.files import locked, make_folder, read_text, write_text
from dubins_traffic.problem.files import parse_json

CASES: Final = "cases"
"""The folder of the cases."""
REPORT: Final = "search.json"
"""What was searched and what came of it."""
PAGE: Final = "coverage.html"
"""What was put to the test and found, to be read."""
STATE: Final = "state.json"
"""Where the search goes on."""
JOURNAL: Final = "journal.txt"
"""The trials that it has finished since."""


class Archive:
    """The folder of a search.

    Attributes
    ----------
    cases : dict of str to Case
        The cases by the names of their cells.
    journal : Journal
        The trials that the search has finished since its state was written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.journal = Journal(folder / JOURNAL)
        self.cases = {path.stem: read_case(path) for path in files(folder)}

    def keep(self, name: str, case: Case) -> Path:
        """Write a case under a name, and return its file."""
        path = self.folder / CASES / f"{name}.json"
        case.write(path, overwrite=True)
        self.cases[name] = case
        return path

    def forget_but(self, names: Container[str]) -> None:
        """Forget all cases but some: what a search that was killed had found after it last wrote down where it was."""
        self.cases = {name: case for name, case in self.cases.items() if name in names}

    def write(self, name: str, document: Any) -> None:
        """Write a document as JSON; equal documents give equal bytes."""
        write_text(self.folder / name, json.dumps(document, indent=1, allow_nan=False) + "\n")

    def tell(self, page: str) -> None:
        """Write the page of the search."""
        write_text(self.folder / PAGE, page)

    def state(self) -> Any:
        """Return where the search goes on, None for one that has not begun."""
        path = self.folder / STATE
        if not path.is_file():
            return None
        found = parse_json(read_text(path), str(path))
        if "state" not in found or found.get("sha256") != _digest(found["state"]):
            raise InputError(
                "not the state of a search as it was written", file=str(path), field="sha256",
                value=found.get("sha256"), expected="the hash of `state`; begin anew in another folder",
            )  # fmt: skip
        return found["state"]

    def remember(self, state: Mapping[str, Any]) -> None:
        """Write down where the search goes on; once this returns, it survives a loss of power."""
        whole = {"sha256": _digest(state), "state": state}
        write_text(self.folder / STATE, json.dumps(whole, allow_nan=False) + "\n", durable=True)


def _digest(state: Any) -> str:
    return hashlib.sha256(json.dumps(state).encode()).hexdigest()


def files(folder: Path) -> Iterator[Path]:
    """Yield the files of the cases in a folder, or in the folder `cases` in it, in order."""
    place = folder / CASES if (folder / CASES).is_dir() else folder
    yield from sorted(path for path in place.glob("*.json") if path.name not in (REPORT, STATE))


@contextlib.contextmanager
def opened(folder: Path, settings: Any, *, resume: bool) -> Generator[Archive]:
    """Open the folder of a search for this process alone, and make it if there is none.

    Parameters
    ----------
    folder : Path
        The folder.
    settings : JSON
        What is searched; a search that is resumed must have the same.
    resume : bool
        Whether to go on with what has been begun there; otherwise the folder must be new or empty.

    Raises
    ------
    InputError
        If the folder holds something else, another search, is in use or can't be written.
    """
    make_folder(folder, "a search", begun=resume)
    make_folder(folder / CASES, "a search")
    with locked(folder):
        archive = Archive(folder)
        state = archive.state()
        if state is None and (archive.cases or any((folder / name).exists() for name in (REPORT, JOURNAL))):
            raise InputError("holds files that are no search's", file=str(folder), expected="a new folder")
        if state is not None and not resume:
            raise InputError(
                "holds a search", file=str(folder), expected="a new folder; --resume goes on with it"
            )
        if state is not None and state.get("settings") != settings:
            changed = [name for name in settings if settings[name] != state.get("settings", {}).get(name)]
            raise InputError(
                f"holds another search: {', '.join(changed)} differ",
                file=str(folder),
                expected="the same settings",
            )
        yield archive
