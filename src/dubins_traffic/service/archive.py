"""A finished competition as a static site: what anybody may see of it, in files that need no server."""

from __future__ import annotations

import gzip
import io
import zipfile
from collections.abc import Iterator
from typing import Any

from sqlalchemy.orm import Session

from dubins_traffic.competition import sealing
from dubins_traffic.service import organising, texts, viewing
from dubins_traffic.service.database_tables import Competition, Phase, Submission
from dubins_traffic.service.hiding import replays_of
from dubins_traffic.service.service import Service
from dubins_traffic.service.submissions import RefusedError
from dubins_traffic.viewer.pages import part

TEMPLATE = "service/web/templates/archive.html"


def archive(service: Service, session: Session, row: Competition) -> bytes:
    """Return a competition whose phases are over, or show all, as a zip archive with a page ``index.html``.

    It holds what somebody without an account may see: no logs, no words of controllers, no submissions.

    RefusedError if a phase that does not show all is not over.
    """
    at = service.clock()
    left = [phase.name for phase in row.phases if not phase.is_closed(at) and phase.shows != "all"]
    if left:
        raise RefusedError(f"not over: {', '.join(left)}; the archive is that of a finished competition")
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in _files(service, session, row):
            entry = zipfile.ZipInfo(f"{row.slug}/{name}", organising.EPOCH)
            packed.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return made.getvalue()


def _files(service: Service, session: Session, row: Competition) -> Iterator[tuple[str, bytes]]:
    document, news = viewing.competition_document(service, row), viewing.news(session, row)
    style = part("service/web/static/site.css")
    common: dict[str, Any] = {"competition": document, "style": style, "site": service.settings.name}

    def page(title: str, **given: Any) -> bytes:
        return texts.templates().get_template(TEMPLATE).render(**common, title=title, **given).encode()

    yield "index.html", page(document["title"], news=news)
    for name, text in document["pages"].items():
        yield f"page-{name}.html", page(name.replace("-", " ").capitalize(), text=text)
    for phase, shown in zip(row.phases, document["phases"], strict=True):
        made, rows = viewing.latest_places(service, session, phase, None)
        seen: list[dict[str, Any]] = []
        for place in rows:
            submission = session.get_one(Submission, place["submission"])
            if viewing.sees_trials(phase, None, submission, service.clock()):
                replays = dict(_replays(service, session, submission))
                yield from replays.items()
                seen.append({"entry": place["entry"], "submission": submission.id, "replays": list(replays)})
        given = {"phase": shown, "rows": rows, "made": made, "seen": seen}
        yield f"{phase.name}.html", page(phase.name, **given)
        yield f"{phase.name}.csv", texts.csv_of(rows).encode()
        yield from _published(service, phase)


def _replays(service: Service, session: Session, submission: Submission) -> Iterator[tuple[str, bytes]]:
    """Return the replays of the best and of the worst trial of a submission, as everybody may see them."""
    hiding = service.hiding(submission.phase)
    for word, trial in viewing.extremes(service, session, submission).items():
        data = hiding.show(service.storage.get(trial.replay or "", "replays"), replays_of(trial))
        yield f"{word}-{submission.id}-{trial.number}.html", gzip.decompress(data)


def _published(service: Service, phase: Phase) -> Iterator[tuple[str, bytes]]:
    phase_here = service.phase(phase)
    if phase.commitment is not None:
        yield f"{phase.name}.commitment.json", sealing.commitment_path(phase_here).read_bytes()
    if phase.revealed is not None:
        yield f"{phase.name}.seeds.txt", sealing.revealed_path(phase_here).read_bytes()
