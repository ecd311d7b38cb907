"""Files of a suite's results, with the seconds in one beside it: what they may say; made from a campaign, and read.

Results of one suite, of whoever ran it, are compared as the controllers of one campaign.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.report.comparison import Comparison, compare
from dubins_traffic.controllers.registry import ran
from dubins_traffic.errors import InputError
from dubins_traffic.files import exists, is_file, read_text, write_text
from dubins_traffic.problem.faults import Strict, fault, parse
from dubins_traffic.problem.files import parse_json
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.release import sources_hash
from dubins_traffic.scoring.registry import STRATEGY_SHARE
from dubins_traffic.scoring.verdict import OF_SIMULATED
from dubins_traffic.suites.suite import SHORT, Count, Suite

FORMAT = "dubins-traffic suite results"
WALL_FORMAT = "dubins-traffic suite seconds"
WALL = ".wall.json"
KEPT = tuple(name for name in rows.RESULT if name not in ("number", "reason"))
"""Columns of a campaign's table that a file of results has; a reason may name what is private to a machine."""

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Entry = Annotated[str, Field(min_length=1, max_length=200)]
Seconds = Annotated[float, Field(ge=0)]
Columns = dict[str, list[bool | int | float | str | None]]


class TrialsEntry(Strict):
    """What came of the trials of one controller."""

    controller: Entry = Field(description="its name in tables")
    file: Digest | None = Field(default=None, description="SHA-256 of its file, if it is one in Python")
    ran: Literal["in process", "boxed", "trusted"] | None = Field(
        default=None,
        description="where it ran: in process (trusted), in a box, or told to be trusted; null: not said",
    )
    columns: Columns = Field(description="columns of the campaign's table, one value a trial, cell after cell")

    @model_validator(mode="after")
    def _of_one_length(self) -> TrialsEntry:
        if len({len(values) for values in self.columns.values()}) > 1:
            raise fault("columns of several lengths", "one value a trial in each", "columns")
        for clean, end in zip(self.columns.get("clean", ()), self.columns.get("end", ()), strict=False):
            if clean and end in BY_CONTROLLER:
                expected = "false where the controller ended the trial: run the suite again"
                raise fault("a clean trial that its controller ended", expected, "columns.clean", end)
        return self


class GameResult(Strict):
    """What a solver says of a game."""

    positions: Count | None = Field(default=None, description="positions, if the solver says how many")
    winning: Count | None = Field(default=None, description="positions from which the ego wins")
    realizable: bool | None = Field(default=None, description="whether the ego wins from all of them")
    fault: str | None = Field(default=None, max_length=500, description="why there is no answer")


class GamesEntry(Strict):
    """What one solver says of all games."""

    solver: Entry = Field(description="its name in tables")
    games: dict[str, GameResult] = Field(description="the answers, by the names of the games")


class ResultModel(Strict):
    """Results of a suite."""

    format: Literal["dubins-traffic suite results"] = Field(description=f'"{FORMAT}"')
    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    suite: str = Field(description="name of the suite")
    hash: Digest = Field(description="its hash, of all that decides problems and scores")
    trials: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="trials of each combination; null for games"
    )
    package: str = Field(description="version of dubins-traffic")
    code: Digest = Field(description="SHA-256 over its sources")
    entries: list[TrialsEntry] = Field(default=[], description="a controller each")
    solvers: list[GamesEntry] = Field(default=[], description="a solver each")


class WallModel(Strict):
    """Seconds on a wall clock, which do not repeat."""

    format: Literal["dubins-traffic suite seconds"] = Field(description=f'"{WALL_FORMAT}"')
    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    hash: Digest = Field(description="hash of the suite")
    entries: dict[str, dict[str, list[Any]]] = Field(
        default={}, description="of each controller, columns of seconds, one value a trial"
    )
    solvers: dict[str, dict[str, Seconds]] = Field(default={}, description="of each solver, seconds for each game")


def file_name(suite: Suite, trials: int | None) -> str:
    """Return the name of a file of results: the hash is in it, and the number of trials if some were left out."""
    fewer = "" if trials in (None, suite.trials) else f"-trials{trials}"
    return f"{suite.label}{fewer}.json"


def save_trials(suite: Suite, campaign: Campaign, folder: Path) -> Path:
    """Write the results of a finished campaign beside its table, with the seconds in a file of their own."""
    known = manifest.read(folder) or {}
    results_table = table.read(folder, campaign, [])
    clock = table.read(folder, campaign, [], table.TableKind.WALL)
    entries: list[dict[str, Any]] = []
    seconds: dict[str, dict[str, Any]] = {}
    for k, name in enumerate(campaign.controllers):
        places_of_one = [place for place, one in enumerate(results_table["controller"].to_pylist()) if one == name]
        picked, times = results_table.take(places_of_one), clock.take(places_of_one)
        share = [STRATEGY_SHARE] if STRATEGY_SHARE in results_table.column_names else []
        columns = played({column: picked[column].to_pylist() for column in (*KEPT, *share)})
        file, where = known["controllers"][k]["file"], ran(campaign.places[k])
        entries.append({"controller": name, "file": file, "ran": where, "columns": columns})
        seconds[name] = {column: times[column].to_pylist() for column in rows.WALL}
    return save(suite, folder, {"trials": campaign.model.trials, "entries": entries}, {"entries": seconds})


def played(columns: Mapping[str, Sequence[Any]]) -> dict[str, Sequence[Any]]:
    """Return the columns of an entry without that of a strategy's share where the ego played none."""
    return {
        name: values
        for name, values in columns.items()
        if name != STRATEGY_SHARE or any(value is not None for value in values)
    }


def save(suite: Suite, folder: Path, entries: Mapping[str, Any], seconds: Mapping[str, Any]) -> Path:
    """Write a file of results and that of the seconds; return the path of the first."""
    document: dict[str, Any] = {
        "format": FORMAT,
        "version": 0,
        "suite": suite.name,
        "hash": suite.hash,
        "trials": None,
        "package": manifest.package_version(),
        "code": sources_hash(),
        **entries,
    }
    path = folder / file_name(suite, document["trials"])
    clock = {"format": WALL_FORMAT, "version": 0, "hash": suite.hash, **seconds}
    write_text(wall_path(path), _text(clock))
    write_text(path, _text(document))
    return path


def wall_path(path: Path) -> Path:
    """Return where the seconds stand beside a file of results."""
    return path.with_name(path.name.removesuffix(".json") + WALL)


def find_results(place: str) -> Path:
    """Return the file of results that a path names: itself, or the only one in a folder; InputError otherwise."""
    path = Path(place)
    if not path.is_dir():
        return path
    files_of_results = [each for each in sorted(path.glob("*.json")) if _is_result(each)]
    if len(files_of_results) != 1:
        problem = "several files of results" if files_of_results else "no results of a suite"
        raise InputError(problem, file=place, expected="the folder of `suite run` when it is finished, or a file")
    return files_of_results[0]


def _is_result(path: Path) -> bool:
    if path.name.endswith(WALL):
        return False
    with path.open("rb") as stream:
        return f'"format": "{FORMAT}"'.encode() in stream.read(200)


def load_results(path: Path) -> tuple[ResultModel, WallModel | None]:
    """Return the results in a file, and the seconds beside it if they are there.

    InputError if a file can't be read, or is not as its schema says.
    """
    results = parse(ResultModel, parse_json(read_text(path), str(path)), file=str(path))
    beside = wall_path(path)
    if not is_file(beside):
        return results, None
    wall = parse(WallModel, parse_json(read_text(beside), str(beside)), file=str(beside))
    if wall.hash != results.hash:
        raise InputError(
            "seconds of another suite", file=str(beside), field="hash", value=wall.hash, expected=results.hash
        )
    return results, wall


def part(
    columns: Mapping[str, Sequence[Any]], seconds: Mapping[str, Sequence[Any]] | None, numbers: Sequence[int]
) -> Any:
    """Return trials of a file of results as a part of a campaign's table, an Arrow table.

    Parameters
    ----------
    seconds : Mapping or None
        The wall-clock figures, if there are any.
    numbers : sequence of int
        The numbers of the trials in that campaign.

    Raises
    ------
    InputError
        If a column is missing, has another length or values of another kind; names it.
    """
    made = rows.arrow()
    count = len(numbers)
    blank = [None] * count
    known: dict[str, Sequence[Any]] = {
        **dict.fromkeys(rows.WALL, blank),
        **(seconds or {}),
        **columns,
        "number": numbers,
        "reason": blank,
    }
    arrays: list[Any] = []
    for entry in rows.part_schema():
        values = known.get(entry.name)
        if values is None or len(values) != count:
            problem = "a column is missing" if values is None else "a column of another length"
            raise InputError(problem, field=f"columns.{entry.name}", expected=f"{count} values")
        _check_words(entry.name, values)
        try:
            arrays.append(made.array(values, type=entry.type))
        except (made.ArrowInvalid, made.ArrowTypeError, OverflowError) as error:
            raise InputError(
                f"a column of other values ({error})", field=f"columns.{entry.name}", expected=str(entry.type)
            ) from None
    return made.Table.from_arrays(arrays, schema=rows.part_schema())


def _check_words(column: str, values: Sequence[Any]) -> None:
    """Refuse a trial that ended in no way at all, or whose verdict is none."""
    wrong = [value for value in values if not _is_word(column, value)]
    if wrong:
        expected = ", ".join(OF_SIMULATED) + " or null" if column == "verdict" else "how each trial ended"
        raise InputError("a column of other values", field=f"columns.{column}", value=wrong[0], expected=expected)


def _is_word(column: str, value: object) -> bool:
    if column == "verdict":
        return value is None or value in OF_SIMULATED
    return column != "end" or (isinstance(value, str) and bool(value))


def _text(document: Mapping[str, Any]) -> str:
    return json.dumps(document, allow_nan=False) + "\n"


@dataclass(frozen=True, slots=True)
class Source:
    """A file of results: where it is, what its entries are called (empty: as they are), what it says."""

    path: Path
    name: str
    results: ResultModel
    wall: WallModel | None


def open_sources(places: Sequence[str]) -> list[Source]:
    """Return the files of results at some places, ``[NAME=]PATH`` each; what is there is a PATH, with ``=`` or without.

    InputError if one can't be read, or they are not of the same suite, hash and number of trials.
    """
    sources: list[Source] = []
    for place in places:
        name, _, path = ("", "", place) if exists(place) else place.rpartition("=")
        file = find_results(path)
        sources.append(Source(file, name, *load_results(file)))
    first = sources[0].results
    for source in sources[1:]:
        for field in ("suite", "hash", "trials"):
            there, wanted = getattr(source.results, field), getattr(first, field)
            if there != wanted:
                raise InputError(
                    "results of another suite" if field != "trials" else "results of other trials",
                    file=str(source.path),
                    field=field,
                    value=there,
                    expected=f"{wanted}, as in {sources[0].path}",
                )
    return sources


def check_suite(suite: Suite, sources: Sequence[Source]) -> None:
    """Raise InputError unless results are of a suite as it is here."""
    results = sources[0].results
    if results.hash != suite.hash:
        raise InputError(
            "results of another suite than the one of that name here",
            file=str(sources[0].path),
            field="hash",
            value=results.hash,
            expected=suite.hash,
        )


def made_by(sources: Sequence[Source]) -> str:
    """Return a sentence on the versions of the code that made results, each with what it made if there are several."""
    made: dict[tuple[str, str], list[str]] = {}
    for source in sources:
        names_of_source = [entry.controller for entry in source.results.entries]
        names_of_source += [entry.solver for entry in source.results.solvers]
        made.setdefault((source.results.package, source.results.code), []).append(
            source.name or ", ".join(names_of_source)
        )
    versions = [f"dubins-traffic {package} (sources {code[:SHORT]})" for package, code in made]
    if len(made) == 1:
        return f"Made by {versions[0]}."
    each = zip(made.values(), versions, strict=True)
    listed = "; ".join(f"{', '.join(names)} by {version}" for names, version in each)
    return f"Made by different versions of the code, in which trials may go differently: {listed}."


def entry_name(source: Source, name: str, count: int) -> str:
    """Return what an entry of a source is called: NAME, with its own name where the file has several."""
    if not source.name:
        return name
    return source.name if count == 1 else f"{source.name} {name}"


@dataclass(frozen=True, slots=True)
class Named:
    """An entry of a source, and what it is called beside the others."""

    name: str
    entry: TrialsEntry
    source: Source


def compare_trials(suite: Suite, sources: Sequence[Source]) -> tuple[Comparison, Mapping[str, Any]]:
    """Compare results of a suite of trials.

    Returns
    -------
    comparison : Comparison
        As that of a campaign that has run all these controllers.
    made : Mapping
        How it was made, as the manifest of a campaign says it.

    Raises
    ------
    InputError
        If the suite is another one here, a name stands twice, or a file has not the trials of the suite.
    """
    check_suite(suite, sources)
    named = named_entries(sources)
    names = [one.name for one in named]
    campaign = suite.campaign(names, sources[0].results.trials, places=tuple(names))
    parts = [_part(campaign, k, one) for k, one in enumerate(named)]
    whole = rows.arrow().concat_tables(parts).sort_by("number")
    timed = any(source.wall is not None for source in sources)
    clock = table.shaped(campaign, whole, table.TableKind.WALL) if timed else None
    results = table.shaped(campaign, whole, table.TableKind.RESULTS)
    return compare(campaign, results, clock), _made(suite, named)


def named_entries(sources: Sequence[Source]) -> list[Named]:
    """Return the entries of all sources, named; InputError if a name stands twice."""
    entries: list[Named] = []
    for source in sources:
        for entry in source.results.entries:
            name = entry_name(source, entry.controller, len(source.results.entries))
            if any(name == other.name for other in entries):
                raise InputError(
                    "name taken", file=str(source.path), value=name, expected="NAME=PATH with another name"
                )
            entries.append(Named(name, entry, source))
    return entries


def shares(sources: Sequence[Source]) -> list[str]:
    """Return a sentence for each entry that played a strategy of another tool: which share of decisions it made.

    InputError if a name stands twice, or a share is none.
    """
    lines: list[str] = []
    for one in named_entries(sources):
        known = [value for value in one.entry.columns.get(STRATEGY_SHARE, ()) if value is not None]
        for value in known:
            if isinstance(value, str) or not 0 <= value <= 1:
                field, file = f"{one.entry.controller}.columns.{STRATEGY_SHARE}", str(one.source.path)
                raise InputError("not a share", file=file, field=field, value=value, expected="0 to 1")
        if known:
            share = sum(map(float, known)) / len(known)
            lines.append(f"{one.name}: the strategy made {share:.1%} of the decisions.")
    return lines


def where_they_ran(sources: Sequence[Source]) -> str:
    """Return a sentence on which entries ran in a process that trusts them and which in a box; empty without any."""
    names_by_place: dict[str, list[str]] = {}
    for one in named_entries(sources):
        names_by_place.setdefault(one.entry.ran or "not said", []).append(one.name)
    listed = "; ".join(f"{where}: {', '.join(names_by_place[where])}" for where in sorted(names_by_place))
    return f"Where they ran: {listed}." if names_by_place else ""


def _part(campaign: Campaign, index: int, one: Named) -> Any:
    """Return the trials of an entry with the numbers that they have in a campaign, as controller number `index`."""
    numbers = [cell.first + index * cell.count + trial for cell in campaign.cells for trial in range(cell.count)]
    wall = one.source.wall
    seconds = None if wall is None else wall.entries.get(one.entry.controller)
    try:
        return part(one.entry.columns, seconds, numbers)
    except InputError as error:
        raise error.within(file=str(one.source.path), field=one.entry.controller) from None


def _made(suite: Suite, named: Sequence[Named]) -> Mapping[str, Any]:
    codes = {one.source.results.code: one.source.results.package for one in named}
    (code, package), *others = codes.items()
    versions = {"suite": suite.name, "dubins-traffic": package}
    versions |= {f"{one.name} ran": one.entry.ran for one in named if one.entry.ran is not None}
    for one in named:
        if one.source.results.code in dict(others):
            versions[f"code of {one.name}"] = f"{one.source.results.code} ({one.source.results.package})"
    return {
        "versions": versions,
        "campaign": suite.hash,
        "configurations": {},
        "controllers": [{"name": one.name, "file": one.entry.file} for one in named],
        "code": code,
    }
