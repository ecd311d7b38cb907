"""Results of one suite, of whoever ran it, compared as the controllers of one campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.report.comparison import Comparison, compare
from dubins_traffic.errors import InputError
from dubins_traffic.files import exists
from dubins_traffic.scoring.registry import STRATEGY_SHARE
from dubins_traffic.suites.results import (
    ResultModel,
    TrialsEntry,
    WallModel,
    find_results,
    load_results,
    part,
)
from dubins_traffic.suites.suite import SHORT, Suite


@dataclass(frozen=True, slots=True)
class Source:
    """A file of results: where it is, what its entries are called (empty: as they are), what it says."""

    path: Path
    name: str
    found: ResultModel
    wall: WallModel | None


def open_sources(places: Sequence[str]) -> list[Source]:
    """Return the files of results at some places, ``[NAME=]PATH`` each; what is there is a PATH, with ``=`` or without.

    Raises
    ------
    InputError
        If one can't be read, or they are not of the same suite, hash and number of trials.
    """
    sources: list[Source] = []
    for place in places:
        name, _, path = ("", "", place) if exists(place) else place.rpartition("=")
        file = find_results(path)
        sources.append(Source(file, name, *load_results(file)))
    first = sources[0].found
    for source in sources[1:]:
        for field in ("suite", "hash", "trials"):
            own, wanted = getattr(source.found, field), getattr(first, field)
            if own != wanted:
                raise InputError(
                    "results of another suite" if field != "trials" else "results of other trials",
                    file=str(source.path),
                    field=field,
                    value=own,
                    expected=f"{wanted}, as in {sources[0].path}",
                )
    return sources


def check_suite(suite: Suite, sources: Sequence[Source]) -> None:
    """Raise InputError unless results are of a suite as it is here."""
    found = sources[0].found
    if found.hash != suite.hash:
        raise InputError(
            "results of another suite than the one of that name here",
            file=str(sources[0].path),
            field="hash",
            value=found.hash,
            expected=suite.hash,
        )


def made_by(sources: Sequence[Source]) -> str:
    """Return a sentence on the versions of the code that made results, each with what it made if there are several."""
    made: dict[tuple[str, str], list[str]] = {}
    for source in sources:
        own = [entry.controller for entry in source.found.entries]
        own += [entry.solver for entry in source.found.solvers]
        made.setdefault((source.found.package, source.found.code), []).append(source.name or ", ".join(own))
    versions = [f"dubins-traffic {package} (sources {code[:SHORT]})" for package, code in made]
    if len(made) == 1:
        return f"Made by {versions[0]}."
    each = zip(made.values(), versions, strict=True)
    listed = "; ".join(f"{', '.join(names)} by {version}" for names, version in each)
    return f"Made by different versions of the code, in which trials may go differently: {listed}."


def entry_name(source: Source, own: str, count: int) -> str:
    """Return what an entry of a source is called: NAME, with its own name where the file has several."""
    if not source.name:
        return own
    return source.name if count == 1 else f"{source.name} {own}"


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
    campaign = suite.campaign(names, sources[0].found.trials, places=tuple(names))
    parts = [_part(campaign, k, one) for k, one in enumerate(named)]
    whole = rows.arrow().concat_tables(parts).sort_by("number")
    timed = any(source.wall is not None for source in sources)
    clock = table.shaped(campaign, whole, table.Kind.WALL) if timed else None
    results = table.shaped(campaign, whole, table.Kind.RESULTS)
    return compare(campaign, results, clock), _made(suite, named)


def named_entries(sources: Sequence[Source]) -> list[Named]:
    """Return the entries of all sources, named; InputError if a name stands twice."""
    found: list[Named] = []
    for source in sources:
        for entry in source.found.entries:
            name = entry_name(source, entry.controller, len(source.found.entries))
            if any(name == other.name for other in found):
                raise InputError(
                    "name taken", file=str(source.path), value=name, expected="NAME=PATH with another name"
                )
            found.append(Named(name, entry, source))
    return found


def shares(sources: Sequence[Source]) -> list[str]:
    """Return a sentence for each entry that played a strategy of another tool: which share of decisions it made.

    Raises
    ------
    InputError
        If a name stands twice, or a share is none.
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
    found: dict[str, list[str]] = {}
    for one in named_entries(sources):
        found.setdefault(one.entry.ran or "not said", []).append(one.name)
    listed = "; ".join(f"{where}: {', '.join(found[where])}" for where in sorted(found))
    return f"Where they ran: {listed}." if found else ""


def _part(campaign: Campaign, index: int, one: Named) -> Any:
    """Return the trials of an entry with the numbers that they have in a campaign, as controller number `index`."""
    numbers = [
        cell.first + index * cell.count + trial for cell in campaign.cells for trial in range(cell.count)
    ]
    wall = one.source.wall
    seconds = None if wall is None else wall.entries.get(one.entry.controller)
    try:
        return part(one.entry.columns, seconds, numbers)
    except InputError as error:
        raise error.within(file=str(one.source.path), field=one.entry.controller) from None


def _made(suite: Suite, named: Sequence[Named]) -> Mapping[str, Any]:
    codes = {one.source.found.code: one.source.found.package for one in named}
    (code, package), *others = codes.items()
    versions = {"suite": suite.name, "dubins-traffic": package}
    versions |= {f"{one.name} ran": one.entry.ran for one in named if one.entry.ran is not None}
    for one in named:
        if one.source.found.code in dict(others):
            versions[f"code of {one.name}"] = f"{one.source.found.code} ({one.source.found.package})"
    return {
        "versions": versions,
        "campaign": suite.hash,
        "configurations": {},
        "controllers": [{"name": one.name, "file": one.entry.file} for one in named],
        "code": code,
    }
