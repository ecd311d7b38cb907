"""Changes of a competition that has begun: dates, quotas, texts and pages; what decides trials and places is locked."""

from __future__ import annotations

import copy
import json
import re
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple, cast

from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import FILE
from dubins_traffic.competition.competition import Competition as Loaded
from dubins_traffic.errors import shown
from dubins_traffic.files import replace_file
from dubins_traffic.service import organising
from dubins_traffic.service.accounts import WrongEntryError, note
from dubins_traffic.service.database_tables import Account, Competition, Phase
from dubins_traffic.service.service import Service, competition_of
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.service.viewing import iso

EDITABLE = re.compile(r"title|about|pages\.[^.]+|phases\.[^.]+\.(opens|closes|quota\.[^.]+)")
"""Fields that may be changed after a start."""
DATES = ("opens", "closes")
QUOTAS = ("a_day", "total", "queued")
TEXT = 200
"""Letters of a text that the log of acts keeps of what it was before and after."""


class Change(NamedTuple):
    """A field of a competition file that has another value."""

    field: str
    before: Any
    after: Any

    def __str__(self) -> str:
        return f"{self.field}: {_said(self.before)} -> {_said(self.after)}"

    @property
    def same(self) -> bool:
        """Whether the edit changes nothing; dates are shown to the second, so they are compared to the second."""
        if self.date and self.before is not None and self.after is not None:
            return seconds(self.before) == seconds(self.after)
        return self.before == self.after

    @property
    def locked(self) -> bool:
        """Whether it decides trials or places, or what is shown of them, so that it stays as it was begun with."""
        return EDITABLE.fullmatch(self.field) is None

    @property
    def date(self) -> tuple[str, str] | None:
        """The phase and the name of a date, None if it is none."""
        _, _, rest = self.field.partition("phases.")
        name, _, key = rest.partition(".")
        return (name, key) if key in DATES else None


def present(service: Service, row: Competition) -> dict[str, Any]:
    """Return the document of a competition as it is now, with its dates."""
    document = copy.deepcopy(dict(service.competition(row).document))
    for phase in row.phases:
        for name, at in (("opens", phase.opens), ("closes", phase.closes)):
            _set(document["phases"][phase.name], name, at and datetime.fromtimestamp(at, UTC).isoformat())
    return document


def changes(service: Service, row: Competition, other: Loaded) -> list[Change]:
    """Return in what a competition file differs from the competition as it is now."""
    now = Loaded.from_document(present(service, row), row.slug, service.place(row.slug))
    before, after = _flat(now), _flat(other)
    changed = [Change(name, before.get(name), after.get(name)) for name in dict.fromkeys((*before, *after))]
    return [change for change in changed if not change.same]


def edit(
    service: Service, session: Session, slug: str, document: Mapping[str, Any], by: Account | None
) -> list[Change]:
    """Change a competition into what a document says, each change with a line in the log of acts.

    Raises
    ------
    InputError
        If something is wrong in the document.
    RefusedError
        If it would change what is locked: rules, seeds, what is shown, the opening of a phase that has opened, the
        end of one that is over, which is re-opened instead.
    """
    row, at = competition_of(session, slug), service.clock()
    if row is None:
        raise WrongEntryError("no such competition")
    loaded = Loaded.from_document(document, FILE, service.place(slug))
    changed = changes(service, row, loaded)
    phases = {phase.name: phase for phase in row.phases}
    for change in changed:
        if change.locked:
            raise RefusedError(f"{change}: locked since the start; dates, quotas, texts and pages may change")
    for change in changed:
        if change.date:
            _move(change, phases[change.date[0]], loaded, at)
        note(session, by, "edit", slug, str(change), at)
    row.title, row.document = loaded.title, json.dumps(loaded.document, sort_keys=True)
    return changed


def edit_by_files(service: Service, slug: str, given: Mapping[str, bytes], by: Account | None) -> list[Change]:
    """Change a competition into what its file says, as `edit` does; the file is kept in place of the one before."""
    given = {FILE: next(iter(given.values()))} if len(given) == 1 else given
    with tempfile.TemporaryDirectory(dir=service.place(slug).parent) as draft:
        loaded = organising.written(Path(draft), given)
        with service.database.writing() as session:
            changed = edit(service, session, slug, loaded.document, by)
    replace_file(service.place(slug) / FILE, lambda neighbour: neighbour.write_bytes(given[FILE]))
    return changed


def edited_by_form(document: dict[str, Any], form: Mapping[str, str]) -> dict[str, Any]:
    """Return a document with what the form of the desk says: texts, dates, quotas; an empty page is removed."""
    for name in ("title", "about"):
        document[name] = form.get(name, document.get(name, ""))
    pages = {name: form.get(f"page: {name}", text) for name, text in document.get("pages", {}).items()}
    if form.get("new page", "").strip():
        pages[form["new page"].strip()] = form.get("new text", "")
    document["pages"] = {name: text for name, text in pages.items() if text.strip()}
    for name, phase in document["phases"].items():
        for date in DATES:
            given = form.get(f"{name} {date}", "").strip()
            if given != seconds(phase.get(date)):
                _set(phase, date, given or None)
        limits = {limit: _count(form.get(f"{name} {limit}", ""), f"{name}: {limit}") for limit in QUOTAS}
        phase["quota"] = {limit: count for limit, count in limits.items() if count is not None}
    return document


def seconds(date: str | None) -> str:
    """Return a date of a document as the form of the desk shows it."""
    return "" if date is None else iso(datetime.fromisoformat(date).timestamp()) or ""


def _set(model: dict[str, Any], name: str, value: str | float | None) -> None:
    if value is None:
        model.pop(name, None)
    else:
        model[name] = value


def _count(text: str, field: str) -> int | None:
    if not text.strip():
        return None
    try:
        return int(text)
    except ValueError:
        raise WrongEntryError(f"{field}: {shown(text, 40)}: a number, or nothing for no limit") from None


def _move(change: Change, phase: Phase, loaded: Loaded, at: float) -> None:
    """Set the opening or the end of a phase; RefusedError if it has passed, or is to have passed."""
    moved = loaded.phase(phase.name)
    if change.field.endswith(".opens"):
        if phase.opens is None or phase.opens <= at:
            raise RefusedError(f"{change}: the phase has opened already")
        phase.opens = moved.opens and moved.opens.timestamp()
    else:
        if phase.is_closed(at):
            raise RefusedError(f"{change}: the phase is over; re-open it at the desk")
        phase.closes = moved.closes and moved.closes.timestamp()
        if phase.is_closed(at):
            raise RefusedError(f"{change}: in the past; close the phase at the desk")


def _flat(loaded: Loaded) -> dict[str, Any]:
    """Return what decides a competition by its fields, defaults filled in."""
    document = loaded.model.model_dump(mode="json", exclude={"configurations"})
    flat: dict[str, Any] = {}
    _flatten("", document, flat)
    for named in loaded.configurations:
        flat[f"configurations.{named.name}"] = named.configuration.inlined()
    return flat


def _flatten(prefix: str, value: Mapping[str, Any], flat: dict[str, Any]) -> None:
    for name, item in value.items():
        if isinstance(item, dict):
            _flatten(f"{prefix}{name}.", cast("dict[str, Any]", item), flat)
        else:
            flat[f"{prefix}{name}"] = item


def _said(value: Any) -> str:
    return "nothing" if value is None else shown(str(value), TEXT)
