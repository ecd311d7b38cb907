"""The door of the workers: leases, what is to be run, and reports under the token of a lease."""

from __future__ import annotations

import asyncio
from typing import Annotated, Any

import msgspec
from litestar import Controller, Request, Response, get, post, put
from litestar.exceptions import ClientException, NotFoundException
from litestar.openapi.spec import Example
from litestar.params import FromPath, FromQuery, JSONBody, PathParameter
from litestar.status_codes import HTTP_200_OK, HTTP_204_NO_CONTENT
from sqlalchemy import select
from sqlalchemy.orm import Session

from dubins_traffic.competition.judging import Owner
from dubins_traffic.service import housekeeping, queue, submissions
from dubins_traffic.service.database_tables import Chunk, Submission, Worker
from dubins_traffic.service.hiding import replays_of
from dubins_traffic.service.service import Service
from dubins_traffic.service.web import requests
from dubins_traffic.service.web.requests import ServiceHere

Digest = Annotated[str, PathParameter(pattern="^[0-9a-f]{64}$", examples=[Example(value="0" * 64)])]
Text = Annotated[str, msgspec.Meta(max_length=60)]
LongText = Annotated[str, msgspec.Meta(max_length=100_000)]
Whole = Annotated[int, msgspec.Meta(ge=0, le=2**31 - 1)]


class AskedFor(msgspec.Struct, forbid_unknown_fields=True):
    """Who asks for work."""

    name: Annotated[str, msgspec.Meta(min_length=1, max_length=60)]


class Leased(msgspec.Struct):
    """Work on lease; the seed of each trial is asked for when it is run."""

    chunk: int
    token: int
    seconds: float
    kind: str
    numbers: list[int]
    digest: str
    phase: str
    competition: dict[str, Any]


class Held(msgspec.Struct, forbid_unknown_fields=True):
    """The fencing token of a lease."""

    token: Whole


class SeedOf(msgspec.Struct):
    """The seed of one trial; as text, since it may be too large for a number of JSON."""

    seed: str


class Released(msgspec.Struct, forbid_unknown_fields=True):
    """Why a lease ends without a result; `left`: the worker stops in order."""

    token: Whole
    note: Annotated[str, msgspec.Meta(max_length=1000)] = ""
    left: bool = False


class Result(msgspec.Struct, forbid_unknown_fields=True):
    """What came of a trial, as `dubins_traffic.competition.judging.Judged` has it.

    `replay` is for everybody, `own_replay` for the team: one in which its controller has its words.
    """

    number: Whole
    row: dict[str, Any]
    end: Annotated[str, msgspec.Meta(max_length=40)]
    owner: Owner | None
    log: LongText
    frames: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")] | None
    replay: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")] | None
    own_replay: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")] | None
    ran: Annotated[str, msgspec.Meta(max_length=20)] | None = None


class Report(msgspec.Struct, forbid_unknown_fields=True):
    """The end of a lease: of a check `content` or `rejected`, of trials their results."""

    token: Whole
    content: Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{64}$")] | None = None
    rejected: Annotated[str, msgspec.Meta(max_length=5000)] | None = None
    trials: list[Result] | None = None


class WorkerApi(Controller):
    """What workers ask."""

    path = "/worker"
    guards = [requests.worker]  # noqa: RUF012
    tags = ["workers"]  # noqa: RUF012
    include_in_schema = True

    @post("/lease", sync_to_thread=True, status_code=HTTP_200_OK)
    def lease(self, service: ServiceHere, data: JSONBody[AskedFor]) -> Response[Leased | None]:
        """Lease the next chunk; nothing if none waits."""
        leased = service.database.patiently(lambda session: _lease(service, session, data.name))
        if leased is None:
            return Response(None, status_code=HTTP_204_NO_CONTENT)
        return Response(leased)

    @get("/submissions/{digest:str}", sync_to_thread=True)
    def submission(self, service: ServiceHere, digest: Digest) -> Response[bytes]:
        """Return what a team has sent, by its SHA-256."""
        with service.database.reading() as session:
            if session.scalars(select(Submission.id).where(Submission.digest == digest).limit(1)).first() is None:
                raise NotFoundException("no such submission")
        return Response(service.storage.get(digest, "submissions"), media_type="application/octet-stream")

    @post("/chunks/{number:int}/heartbeat", sync_to_thread=True, status_code=HTTP_204_NO_CONTENT)
    def heartbeat(self, service: ServiceHere, number: FromPath[int], data: JSONBody[Held]) -> None:
        """Renew a lease."""

        def renew(session: Session) -> None:
            chunk = queue.held(session, number, data.token)
            chunk.leased_until = service.clock() + service.settings.lease
            _seen(session, chunk.worker, service.clock(), _busy(chunk))

        service.database.patiently(renew)

    @post("/chunks/{number:int}/trials/{trial:int}/seed", sync_to_thread=True, status_code=HTTP_200_OK)
    def seed(self, service: ServiceHere, number: FromPath[int], trial: FromPath[int], data: JSONBody[Held]) -> SeedOf:
        """Return the seed of a trial on lease, which is about to be run."""
        with service.database.reading() as session:
            chunk = queue.held(session, number, data.token)
            if trial not in chunk.numbers:
                raise NotFoundException("no trial of this lease")
            return SeedOf(str(service.seeds(chunk.submission.phase)[trial]))

    @put("/chunks/{number:int}/replays", status_code=HTTP_200_OK, opt={requests.FILES: True})
    async def replay(
        self,
        service: ServiceHere,
        number: FromPath[int],
        token: FromQuery[int],
        request: Request[Any, Any, Any],
    ) -> dict[str, str]:
        """Keep the page that replays a trial, packed by gzip, and return its SHA-256."""
        with service.database.reading() as session:
            queue.held(session, number, token)
        data = await request.body()
        if not data.startswith(b"\x1f\x8b"):
            raise ClientException("a replay is packed by gzip")
        return {"digest": await asyncio.to_thread(_keep_replay, service, number, data)}

    @post(
        "/chunks/{number:int}/done",
        sync_to_thread=True,
        status_code=HTTP_204_NO_CONTENT,
        opt={requests.FILES: True},
    )
    def done(self, service: ServiceHere, number: FromPath[int], data: JSONBody[Report]) -> None:
        """End a lease with its results; they and what follows from them are kept together, or not at all."""
        service.database.patiently(lambda session: _done(service, session, number, data))

    @post("/chunks/{number:int}/release", sync_to_thread=True, status_code=HTTP_204_NO_CONTENT)
    def release(self, service: ServiceHere, number: FromPath[int], data: JSONBody[Released]) -> None:
        """End a lease without a result: the chunk waits again."""

        def give_back(session: Session) -> None:
            chunk = queue.held(session, number, data.token)
            note = _note(chunk, data.note)
            if data.left:
                queue.release(session, chunk, note, service.clock(), worker_left=True)
            else:
                housekeeping.give_back(session, chunk.id, note, service.clock())
            _seen(session, chunk.worker, service.clock(), "")

        service.database.patiently(give_back)


def _keep_replay(service: Service, number: int, data: bytes) -> str:
    with service.database.reading() as session:
        chunk = session.get_one(Chunk, number)
        kept = service.hiding(chunk.submission.phase).hide(data, replays_of(chunk))
    return service.storage.put(kept, "replays")


def _note(chunk: Chunk, why: str) -> str:
    """Return why a lease ended without a result; a phase that does not show all keeps nothing of what a worker saw."""
    return why if chunk.submission.phase.shows == "all" else f"the log of worker {chunk.worker} says why"


def _lease(service: Service, session: Session, name: str) -> Leased | None:
    at = service.clock()
    unjudged = [row.id for row in service.waiting_for_key(session)]
    chunk = queue.take(session, name, at, service.settings.lease, unjudged)
    _seen(session, name, at, "" if chunk is None else _busy(chunk))
    if chunk is None:
        return None
    submission = chunk.submission
    submissions.taken(submission, chunk, at)
    return Leased(
        chunk=chunk.id,
        token=chunk.token,
        seconds=service.settings.lease,
        kind=chunk.kind,
        numbers=chunk.numbers,
        digest=submission.digest,
        phase=submission.phase.name,
        competition=dict(service.competition(submission.phase.competition).document),
    )


def _done(service: Service, session: Session, number: int, report: Report) -> None:
    at = service.clock()
    chunk = queue.held(session, number, report.token)
    submission = chunk.submission
    if report.rejected is not None and chunk.kind != "check":
        housekeeping.give_back(session, chunk.id, _note(chunk, report.rejected), at)
    elif chunk.kind != "check":
        results = [msgspec.to_builtins(trial) for trial in report.trials or ()]
        submissions.record(session, chunk, results, at, service.hiding(submission.phase))
    elif report.rejected is not None:
        queue.finish(session, chunk, at)
        submissions.reject(session, submission, report.rejected, at)
    else:
        queue.finish(session, chunk, at)
        submission.content = report.content
        submissions.accept(session, submission, service.phase(submission.phase).numbers, at)
    _seen(session, chunk.worker, at, "")


def _seen(session: Session, name: str, at: float, busy: str) -> None:
    row = session.scalars(select(Worker).where(Worker.name == name)).first()
    if row is None:
        row = Worker(name=name)
        session.add(row)
    row.seen, row.busy = at, busy


def _busy(chunk: Chunk) -> str:
    what = "check" if chunk.kind == "check" else f"{len(chunk.numbers)} trials"
    return f"submission {chunk.submission_id}, {what}"
