"""The export of a competition: its files, the revealed seeds, submissions, results and tables, in one archive."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator

from sqlalchemy.orm import Session

from dubins_traffic.service import receiving, standings, submissions, viewing
from dubins_traffic.service.office import Office
from dubins_traffic.service.tables import Competition, Phase, Submission

EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of everything in the archive, so that equal contents are equal bytes."""
README = """\
A competition of dubins-traffic, exported.

  competition.toml, *.json    the competition as it was run
  published/                  commitments to secret seeds, and the seeds where they are revealed
  submissions/DIGEST          what teams have sent
  PHASE/submissions.json      all submissions of a phase, and which of them counted
  PHASE/results-N.json        the results of submission N, a row a trial; why a controller failed is its team's alone
  PHASE/table.json            the places

Run the entry on the first place again, and compare its rows:

  dubins-traffic evaluate submissions/DIGEST --competition competition.toml --phase PHASE
"""


def export(office: Office, session: Session, row: Competition) -> bytes:
    """Return a competition as a zip archive; phases that are still open are left out.

    Parameters
    ----------
    office : Office
        The service.
    session : Session
        A reader's.
    row : Competition
        Which one.
    """
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in _entries(office, session, row):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), data, zipfile.ZIP_DEFLATED)
    return made.getvalue()


def _entries(office: Office, session: Session, row: Competition) -> Iterator[tuple[str, bytes]]:
    yield "README.txt", README.encode()
    place = office.place(row.slug)
    for path in sorted(item for item in place.rglob("*") if item.is_file()):
        name = path.relative_to(place)
        if name.parts[0] != "sealed":
            yield name.as_posix(), path.read_bytes()
    sent: set[str] = set()
    for phase in row.phases:
        if not phase.is_closed(office.clock()) and phase.shows != "all":
            continue
        found = receiving.submissions_of(session, phase, None)
        yield from _of_phase(office, session, phase, found)
        sent |= {one.digest for one in found}
    for digest in sorted(sent):
        yield f"submissions/{digest}", office.storage.get(digest, "submissions")


def _of_phase(
    office: Office, session: Session, phase: Phase, found: list[Submission]
) -> Iterator[tuple[str, bytes]]:
    hiding = office.hiding(phase)
    latest = standings.latest_standing(session, phase, hiding)
    counted = {own.id for own in standings.counting(session, phase).values()}
    yield f"{phase.name}/table.json", _json([] if latest is None else latest.places)
    described = [
        {
            "submission": one.id,
            "team": one.team.name,
            "digest": one.digest,
            "content": one.content,
            "received": viewing.iso(one.received),
            "state": one.state,
            "disqualified": one.disqualified,
            "counted": one.id in counted,
        }
        for one in sorted(found, key=lambda own: own.id)
    ]
    yield f"{phase.name}/submissions.json", _json(described)
    for one in found:
        trials = submissions.trials(session, one, hiding)
        rows = [{**viewing.shared(own.row), "frames": own.frames} for own in trials]
        yield f"{phase.name}/results-{one.id}.json", _json(rows)


def _json(document: object) -> bytes:
    return (json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
