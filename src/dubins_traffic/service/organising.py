"""What an organiser does with competitions: create, open, close, judge again, disqualify, reveal, export; logged."""

from __future__ import annotations

import io
import json
import re
import shutil
import tempfile
import tomllib
import zipfile
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, cast

from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.competition import sealing
from dubins_traffic.competition.competition import FILE, load_competition
from dubins_traffic.competition.competition import Competition as Loaded
from dubins_traffic.competition.templates import built_in
from dubins_traffic.errors import DubinsTrafficError, InputError, shown
from dubins_traffic.service import receiving, standings, submissions, viewing
from dubins_traffic.service.accounts import WrongEntryError, make_team, note
from dubins_traffic.service.database import numbered
from dubins_traffic.service.database_tables import Account, Announcement, Competition, Phase, Submission, Team
from dubins_traffic.service.service import Service, competition_of

SLUG = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,58}[a-z0-9])?")
PLAIN = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
NOTHING_TO_DO = "the phase is {} already"


def create(service: Service, slug: str, given: Mapping[str, bytes], by: Account | None) -> Competition:
    """Make a competition from its files: ``competition.toml``, and the configurations and networks it names.

    Parameters
    ----------
    slug : str
        Its address: lower letters, digits and hyphens.
    given : Mapping
        Name of a file to its bytes; a single one may be called as it likes.

    Raises
    ------
    WrongEntryError
        If the address is no address or taken.
    InputError
        If something is wrong in the files.
    """
    if not SLUG.fullmatch(slug):
        raise WrongEntryError("address: lower-case letters, digits and hyphens, 60 at most")
    given = {FILE: next(iter(given.values()))} if len(given) == 1 else given
    place = service.place(slug)
    place.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=place.parent) as draft:
        loaded = written(Path(draft), given)
        for phase in loaded.phases:
            if phase.secret:
                sealing.seal(phase, service.needed_key())
        with service.database.writing() as session:
            if competition_of(session, slug) is not None:
                raise WrongEntryError("address: taken")
            made = _rows(session, slug, loaded, service.clock())
            note(session, by, "create", slug, loaded.title, service.clock())
            shutil.rmtree(place, ignore_errors=True)  # of a creation that was killed before its rows were kept
            shutil.copytree(draft, place)
    publish_opened(service)
    return made


def slug_of(path: Path) -> str:
    """Return the address of a competition that is made from a path: its name, in lower-case letters and hyphens."""
    name = path.resolve().parent.name if path.name == FILE else path.resolve().stem
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60].strip("-")
    return slug or "competition"


def files_of(path: Path) -> Mapping[str, bytes]:
    """Return the files of a competition that lies in a folder, but for those that tools hide there, or is one file."""
    if path.is_file():
        return {FILE: path.read_bytes()}
    if not (path / FILE).is_file():
        raise InputError("no competition", file=str(path / FILE), expected="a competition file, TOML")
    items = sorted(item for item in path.iterdir() if item.is_file() and not item.name.startswith("."))
    return {item.name: item.read_bytes() for item in items}


def written(draft: Path, given: Mapping[str, bytes]) -> Loaded:
    """Write the files of a competition into a folder and return it; InputError if something is wrong in them."""
    for name, data in given.items():
        if not PLAIN.fullmatch(name):
            raise WrongEntryError(f"files: {shown(name, 60)}: names of letters, digits, '.', '_' and '-'")
        (draft / name).write_bytes(data)
    for entry in _named_files(draft):
        if not PLAIN.fullmatch(entry):
            raise InputError(
                "a file that was not given",
                field="configurations",
                value=entry,
                expected="files beside competition.toml",
            )
    return load_competition(draft)


def _named_files(draft: Path) -> list[str]:
    """Return the names of configurations that look like paths: such files are read only if they were given."""
    try:
        document: Any = tomllib.loads((draft / FILE).read_text(encoding="utf-8"))
        entries: list[Any] = list(document.get("configurations", []))
    except (OSError, ValueError, TypeError):
        return []  # load_competition says what is wrong
    named: list[Any] = [cast("Any", entry).get("file", "") if isinstance(entry, dict) else entry for entry in entries]
    return [name for name in named if isinstance(name, str) and ("/" in name or "\\" in name)]


def _rows(session: Session, slug: str, loaded: Loaded, at: float) -> Competition:
    document = json.dumps(loaded.document, sort_keys=True)
    made = Competition(slug=slug, title=loaded.title, document=document, created=at)
    for phase in loaded.phases:
        opens, closes = phase.opens, phase.closes
        made.phases.append(
            Phase(
                name=phase.name,
                shows=phase.shows,
                opens=opens and opens.timestamp(),
                closes=closes and closes.timestamp(),
            )
        )
    session.add(made)
    session.flush()
    return made


def publish_opened(service: Service) -> None:
    """Publish the commitments of phases that have opened since the last time."""
    at = service.clock()
    with service.database.reading() as session:
        rows = session.scalars(select(Phase).where(Phase.commitment.is_(None))).all()
        commitments: dict[int, str] = {}
        for row in rows:
            phase = service.phase(row)
            if phase.secret and (row.opens is None or row.opens <= at):
                commitments[row.id] = sealing.publish(phase, row.competition.title).commitment
    if commitments:
        with service.database.writing() as session:
            for number, commitment in commitments.items():
                row = session.get_one(Phase, number)
                row.commitment = commitment
                note(session, None, "publish", _name(row), commitment, at)


def open_phase(service: Service, session: Session, phase: Phase, by: Account) -> None:
    """Open a phase now; RefusedError if it is open or over."""
    at = service.clock()
    if phase.is_open(at) or phase.is_closed(at):
        raise submissions.RefusedError(NOTHING_TO_DO.format("open" if phase.is_open(at) else "closed"))
    phase.opens = at
    note(session, by, "open", _name(phase), "", at)


def close_phase(service: Service, session: Session, phase: Phase, by: Account) -> None:
    """Close a phase now; what is received from this second on does not count. RefusedError if it is over."""
    at = service.clock()
    if phase.is_closed(at):
        raise submissions.RefusedError(NOTHING_TO_DO.format("closed"))
    phase.closes = at
    phase.version += 1
    note(session, by, "close", _name(phase), "", at)


def reopen_phase(service: Service, session: Session, phase: Phase, by: Account, until: str) -> None:
    """Open a phase that is over until another time; RefusedError if it is not over, or its seeds are revealed."""
    at, closes = service.clock(), _later(until)
    if not phase.is_closed(at):
        raise submissions.RefusedError("the phase is not over")
    if phase.revealed is not None:
        raise submissions.RefusedError("its seeds are revealed")
    if closes <= at:
        raise WrongEntryError("until: in the past; a time to come, UTC")
    phase.closes, phase.podium_checked = closes, False
    phase.version += 1
    note(session, by, "re-open", _name(phase), f"until {until}", at)


def _later(text: str) -> float:
    try:
        time = datetime.fromisoformat(text.strip())
        if time.utcoffset():
            raise ValueError
        return time.replace(tzinfo=UTC).timestamp()
    except ValueError:
        raise WrongEntryError(f"until: {shown(text, 40)}: a time in UTC, as 2027-03-01T12:00:00Z") from None


def announce(service: Service, session: Session, row: Competition, by: Account, title: str, text: str) -> None:
    """Tell everybody something, in Markdown, on the page of a competition and in its feed."""
    if not 1 <= len(title.strip()) <= 200 or not text.strip():
        raise WrongEntryError("announcement: a title of 1 to 200 letters, and a text")
    at = service.clock()
    session.add(Announcement(competition_id=row.id, at=at, title=title.strip(), text=text))
    note(session, by, "announce", row.slug, title.strip(), at)


def announced(session: Session, number: int, by: Account) -> Announcement:
    """Return an announcement of a competition that somebody organises; UnknownError if there is none."""
    row = numbered(session, Announcement, number)
    if row is None or not viewing.organises(by, row.competition_id):
        raise receiving.UnknownError("no such announcement")
    return row


def retract(service: Service, session: Session, number: int, by: Account) -> str:
    """Take an announcement back, and return the address of its competition; UnknownError if there is none."""
    row = announced(session, number, by)
    session.delete(row)
    note(session, by, "retract", row.competition.slug, row.title, service.clock())
    return row.competition.slug


def reveal(service: Service, session: Session, phase: Phase, by: Account) -> None:
    """Reveal the secret seeds of a phase that has closed and whose submissions have all ended.

    RefusedError if the phase has no secret seeds, is not over, or something of it is still to be run.
    """
    at = service.clock()
    active = Submission.state.in_(submissions.ACTIVE)
    if session.scalars(select(Submission).where(Submission.phase_id == phase.id, active).limit(1)).first():
        raise submissions.RefusedError("submissions of this phase are still to be judged")
    if phase.revealed is not None:
        raise submissions.RefusedError("the seeds are revealed already")
    try:
        sealing.reveal(service.phase(phase), service.needed_key())
    except DubinsTrafficError as error:
        raise submissions.RefusedError(str(error)) from error
    phase.revealed = at
    note(session, by, "reveal", _name(phase), phase.commitment or "", at)


def judge_again(service: Service, session: Session, submission: Submission, by: Account, why: str) -> None:
    """Let a submission be judged anew, all of it."""
    at = service.clock()
    submissions.judge_again(session, submission, service.phase(submission.phase).numbers, at)
    submission.phase.version += 1
    note(session, by, "rejudge", f"submission {submission.id}", why, at)


def disqualify(service: Service, session: Session, submission: Submission, by: Account, why: str) -> None:
    """Take a submission out of the ranking, with the reason that its team reads; an empty one lets it in again."""
    submission.disqualified = why.strip()[:500]
    submission.phase.version += 1
    act = "disqualify" if submission.disqualified else "readmit"
    note(session, by, act, f"submission {submission.id}", submission.disqualified, service.clock())


def add_baseline(service: Service, session: Session, phase: Phase, by: Account, controller: str) -> None:
    """Hand in a built-in controller, which is shown apart from the teams; it counts for no quota.

    RefusedError if the phase is over, or the controller has been handed in.
    """
    at, data, name = service.clock(), built_in(controller), f"built-in {controller}"
    if phase.is_closed(at):
        raise submissions.RefusedError("the phase is over")
    team = session.scalars(select(Team).where(Team.name == name, Team.baseline)).first()
    if team is None:
        team = make_team(session, name, at)
        team.baseline = True
    upload = submissions.Upload(service.storage.put(data, "submissions"), "controller.py", len(data))
    known = select(Submission.id).where(Submission.phase_id == phase.id, Submission.team_id == team.id)
    if session.scalars(known).first() is not None:
        raise submissions.RefusedError(f"{controller} has been handed in")
    made = Submission(phase_id=phase.id, team_id=team.id, digest=upload.digest, size=upload.size, run=0)
    submissions.begin(session, made, by, upload, at)
    note(session, by, "baseline", _name(phase), controller, at)


def _name(phase: Phase) -> str:
    return f"{phase.competition.slug}/{phase.name}"


EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of everything in the archive, so that equal contents are equal bytes."""
README = """\
A competition of dubins-traffic, exported.

  competition.toml, *.json    the competition as its file was given last
  published/                  commitments to secret seeds, and the seeds where they are revealed
  submissions/DIGEST          what teams have sent
  PHASE/submissions.json      all submissions of a phase, and which of them counted
  PHASE/results-N.json        the results of submission N, a row a trial; why a controller failed is its team's alone
  PHASE/table.json            the places

Run the entry on the first place again, and compare its rows:

  dubins-traffic evaluate submissions/DIGEST --competition competition.toml --phase PHASE
"""


def export(service: Service, session: Session, row: Competition) -> bytes:
    """Return a competition as a zip archive; phases that are still open are left out."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in _entries(service, session, row):
            archive.writestr(zipfile.ZipInfo(name, EPOCH), data, zipfile.ZIP_DEFLATED)
    return made.getvalue()


def _entries(service: Service, session: Session, row: Competition) -> Iterator[tuple[str, bytes]]:
    yield "README.txt", README.encode()
    place = service.place(row.slug)
    for path in sorted(item for item in place.rglob("*") if item.is_file()):
        name = path.relative_to(place)
        if name.parts[0] != "sealed":
            yield name.as_posix(), path.read_bytes()
    sent: set[str] = set()
    for phase in row.phases:
        if not phase.is_closed(service.clock()) and phase.shows != "all":
            continue
        its_submissions = receiving.submissions_of(session, phase, None)
        yield from _of_phase(service, session, phase, its_submissions)
        sent |= {one.digest for one in its_submissions}
    for digest in sorted(sent):
        yield f"submissions/{digest}", service.storage.get(digest, "submissions")


def _of_phase(
    service: Service, session: Session, phase: Phase, its_submissions: list[Submission]
) -> Iterator[tuple[str, bytes]]:
    hiding = service.hiding(phase)
    latest = standings.latest_standing(session, phase, hiding)
    counted = {submission.id for submission in standings.counting(session, phase).values()}
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
        for one in sorted(its_submissions, key=lambda submission: submission.id)
    ]
    yield f"{phase.name}/submissions.json", _json(described)
    for one in its_submissions:
        trials = submissions.trials(session, one, hiding)
        rows = [{**viewing.shared(trial.row), "frames": trial.frames} for trial in trials]
        yield f"{phase.name}/results-{one.id}.json", _json(rows)


def _json(document: object) -> bytes:
    return (json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
