"""The folder of a search: one case for each kind of failure, what the search has done, and where it goes on.

Its journal has the trials that are finished since the search last wrote that down, so that none of them is run again;
its page tells what was found and loads nothing from elsewhere.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import time
import zlib
from collections.abc import Container, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.campaign.chunks import KEPT_S
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.case import Case, read_case
from dubins_traffic.falsification.coverage import Row
from dubins_traffic.falsification.trying import Tried
from dubins_traffic.files import locked, make_folder, read_bytes, read_text, write_text
from dubins_traffic.problem.files import parse_json
from dubins_traffic.viewer.pages import render

if TYPE_CHECKING:
    from dubins_traffic.falsification.moves import Genome


Key = tuple[int, str]
"""The number of a trial, and the hash of its genome."""
Finished = tuple[int, "Genome", Tried]
"""The number of a trial, its genome, and what came of it."""


class Journal:
    """What came of the trials that are finished and not yet part of the state of a search, a line each.

    A trial is known by its number and the hash of its genome: another one of that number is run. A line begins with its
    checksum; what is not as it was written, such as a last line that was cut off, is passed over, and its trial run.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lines: dict[Key, str] = {}
        self._waiting: list[Finished] = []
        self._written = time.monotonic()
        lines = read_bytes(path).decode(errors="replace").splitlines(keepends=True) if path.is_file() else []
        for line in lines:
            checksum, _, text = line.partition(" ")
            if checksum == _checksum(text):
                number, digest, _ = json.loads(text)
                self._lines[number, digest] = line
        self._sound = 0 < len(self._lines) == len(lines)

    def known(self, number: int, genome: Genome) -> Tried | None:
        """Return what came of a trial; None if it is not here."""
        line = self._lines.get(_key(number, genome)) if self._lines else None
        return None if line is None else Tried.from_json(json.loads(line.partition(" ")[2])[2])

    def keep(self, finished: Iterable[Finished]) -> None:
        """Keep trials that are finished: at once if the last were written `KEPT_S` ago, else with the next ones."""
        self._waiting += finished
        if time.monotonic() - self._written > KEPT_S:
            self._append()

    def taken(self) -> None:
        """A generation has been taken over: what of it is not written yet is left to the state that is written next."""
        self._waiting.clear()
        self._written = time.monotonic()

    def settle(self, trials: int) -> None:
        """Forget the first `trials` trials, which the state knows, and write down all others."""
        self._take_lines()
        self._lines = {key: line for key, line in self._lines.items() if key[0] >= trials}
        self._write()

    def _take_lines(self) -> str:
        """Return the lines of what waits, which are lines like the others from now on."""
        lines: list[str] = []
        for number, genome, tried in self._waiting:
            key = _key(number, genome)
            text = json.dumps([*key, tried.to_json()]) + "\n"
            self._lines[key] = line = f"{_checksum(text)} {text}"
            lines.append(line)
        self._waiting.clear()
        return "".join(lines)

    def _append(self) -> None:
        """Write what waits behind the lines that are there, if all are as they were written."""
        lines = self._take_lines()
        if not self._sound:
            self._write()
            return
        try:
            with self._path.open("ab") as file:
                file.write(lines.encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise InputError(f"can't be written ({error.strerror})", file=str(self._path)) from error
        self._written = time.monotonic()

    def _write(self) -> None:
        """Write all lines anew."""
        if self._lines:
            write_text(self._path, "".join(self._lines.values()), durable=True)
        else:
            self._path.unlink(missing_ok=True)
        self._sound = bool(self._lines)
        self._written = time.monotonic()


def _checksum(text: str) -> str:
    return f"{zlib.crc32(text.encode()):08x}"


def _key(number: int, genome: Genome) -> Key:
    return number, hashlib.sha256(json.dumps(genome.to_json()).encode()).hexdigest()


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
        document = parse_json(read_text(path), str(path))
        if "state" not in document or document.get("sha256") != _digest(document["state"]):
            raise InputError(
                "not the state of a search as it was written", file=str(path), field="sha256",
                value=document.get("sha256"), expected="the hash of `state`; begin anew in another folder",
            )  # fmt: skip
        return document["state"]

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
    settings : JSON
        What is searched; a search that is resumed must have the same.
    resume : bool
        Whether to go on with what has been begun there; otherwise the folder must be new or empty.
    """
    make_folder(folder, "a search", begun=resume)
    make_folder(folder / CASES, "a search")
    with locked(folder):
        archive = Archive(folder)
        state = archive.state()
        if state is None and (archive.cases or any((folder / name).exists() for name in (REPORT, JOURNAL))):
            raise InputError("holds files that are no search's", file=str(folder), expected="a new folder")
        if state is not None and not resume:
            raise InputError("holds a search", file=str(folder), expected="a new folder; --resume goes on with it")
        if state is not None and state.get("settings") != settings:
            changed = [name for name in settings if settings[name] != state.get("settings", {}).get(name)]
            raise InputError(
                f"holds another search: {', '.join(changed)} differ",
                file=str(folder),
                expected="the same settings",
            )
        yield archive


COUNTS: Final = {
    "trials": "trials",
    "violated": "in which the ego broke what was asked for",
    "discarded": "discarded, since the assumption fell before",
    "faulty": "ended by a fault",
    "unconfirmed": "breaches that did not come again",
}
"""The counts of a search (`coverage.Counts`), and what the page calls them."""


def coverage_page(
    settings: Mapping[str, Any],
    counts: Mapping[str, int],
    rows: Sequence[Row],
    cases: Mapping[str, Case],
    found_in: Mapping[str, int],
) -> str:
    """Return the page of a search; equal arguments give equal text.

    Parameters
    ----------
    settings : mapping
        What tells the search from others: `controller`, `targets`, `seed`, `strategy`.
    counts : mapping
        What became of its trials, by the keys of `COUNTS`.
    cases : mapping
        What was found, by the names of the files.
    found_in : mapping
        For some of these the number of the trial in which each was found, from 0.
    """
    lines: dict[str, dict[str, dict[int, Row]]] = {}
    for row in rows:
        manoeuvres = lines.setdefault(row.cell.rule, {})
        manoeuvres.setdefault(row.cell.manoeuvre.name.lower(), {})[row.cell.degree] = row
    made = [("asked for", ", ".join(settings["targets"]))]
    made += [(name, settings[name]) for name in ("controller", "strategy", "seed")]
    return render(
        "falsification/coverage.html",
        title=f"Coverage of a search: {settings['controller']}",
        told=f"{counts['trials']:,} trials, {len(cases)} kinds of failure.",
        cells=len(rows),
        never=[_name(row) for row in rows if row.empty],
        lines=lines,
        roads={degree: _roads(degree) for degree in sorted({row.cell.degree for row in rows})},
        cases=cases,
        folder=CASES,
        found_in=found_in,
        made=[*made, *((words, f"{counts[name]:,}") for name, words in COUNTS.items())],
    )


def _name(row: Row) -> str:
    return f"{row.cell.rule} {row.cell.manoeuvre.name.lower()}, {_roads(row.cell.degree)}"


def _roads(degree: int) -> str:
    return f"{degree} road{'s' if degree != 1 else ''}" if degree else "no crossing known"


@dataclass(frozen=True, slots=True)
class Found:
    """What a search leaves."""

    folder: Path
    """Its folder."""
    cases: Mapping[str, Case]
    """One case for each kind of failure, by the name of its cell."""
    trials: int
    discarded: int
    faulty: int
    violated: int
    """`trials`, `discarded`, `faulty`, `violated`: how many trials it has run; of these, in how many the assumption
    was broken first, how many ended by a fault, and in how many the ego broke a rule that was asked for.
    """
    coverage: list[Row]
    """Which rule, manoeuvre and crossing were put to the test."""
    fault: str = ""
    """How many trials ended by which fault, and why the first; empty if none did."""

    @property
    def page(self) -> Path:
        """The page with the coverage and what was found."""
        return self.folder / PAGE
