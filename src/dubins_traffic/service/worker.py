"""A worker: it asks a service for work, judges trials in the sandbox, and reports under the token of its lease.

It knows nothing but an address and a token; the seed of a trial comes when it is run, and is gone with it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import gzip
import os
import signal
import threading
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import structlog

from dubins_traffic.competition.competition import Competition, Phase
from dubins_traffic.competition.judging import Judged, judge
from dubins_traffic.competition.submission import Submission
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.record.reader import Record, from_bytes
from dubins_traffic.sandbox import available_layers
from dubins_traffic.sandbox.submission import program_of
from dubins_traffic.service.client import AwayError, Connection, RefusalError
from dubins_traffic.service.unpacked import Unpacked

log = structlog.get_logger("dubins_traffic.worker")
IDLE_S = 0.5
AWAY_S = 2.0
UNFIT_S = 5.0
"""How long a worker that has no room leaves the work to others."""
LONGEST_S = 1.0
"""A chunk whose trials have taken so long is reported as far as it is done: others wait for no more than this."""
NO_ROOM = frozenset((errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO, errno.EMFILE, errno.ENFILE, errno.ENOMEM))


class Worker:
    """Takes chunks until it is told to stop.

    Parameters
    ----------
    connection : Connection
        To the service, with a worker's token.
    name : str
        Shown on the page of the queue.
    folder : Path
        For submissions that are unpacked; kept between chunks, until they are old or too many.
    trust : bool
        Whether submissions may run with fewer limits than this machine should enforce.
    """

    def __init__(self, connection: Connection, name: str, folder: Path, *, trust: bool = False) -> None:
        self._service = connection
        self._name = name
        folder.mkdir(parents=True, exist_ok=True)
        self._unpacked = Unpacked(folder / "submissions")
        self._trust = trust
        self._stopping = threading.Event()

    def stop(self) -> None:
        """Give back what is on lease, and end."""
        self._stopping.set()

    def work(self) -> None:
        """Work until `stop`, then hang up; a service that is away is waited for.

        InputError if this machine can't hold a stranger's program, and the worker does not trust submissions.
        """
        check_boxes(trust=self._trust)
        with contextlib.closing(self._service):
            while not self._stopping.is_set():
                self._ask()

    def _ask(self) -> None:
        """Ask for work, and do it; if there is none, or nobody answers, wait a little."""
        try:
            lease = self._service.post("/worker/lease", {"name": self._name})
            if lease:
                self._serve(lease)
            else:
                self._stopping.wait(IDLE_S)
        except AwayError as error:
            log.warning("the service is away", error=str(error))
            self._stopping.wait(AWAY_S)

    def _serve(self, lease: dict[str, Any]) -> None:
        where = f"/worker/chunks/{lease['chunk']}"
        token = {"token": lease["token"]}
        with self._heartbeat(where, token, float(lease["seconds"])) as lost:
            try:
                report = self._done(lease, lost)
                if report is None:
                    self._service.post(f"{where}/release", {**token, "note": "worker stopped", "left": True})
                else:
                    done = {**token, **report}
                    self._service.patiently(lambda: self._service.post(f"{where}/done", done))
            except RefusalError as error:
                log.info("a lease is lost", chunk=lease["chunk"], error=str(error))
                self._give_back(where, token, error)
            except AwayError:
                raise
            except Exception as error:
                log.exception("a chunk failed", chunk=lease["chunk"])
                self._give_back(where, token, error)

    def _give_back(self, where: str, token: dict[str, Any], error: Exception) -> None:
        """End a lease that came to nothing, if it has not ended; without room here that is no attempt at the chunk."""
        note, unfit = f"{type(error).__name__}: {error}"[:500], lacks_room(error)
        release = {**token, "note": note, "left": unfit}
        with contextlib.suppress(RefusalError):
            self._service.patiently(lambda: self._service.post(f"{where}/release", release), self._stopping.is_set)
        if unfit:
            self._stopping.wait(UNFIT_S)

    @contextlib.contextmanager
    def _heartbeat(self, where: str, token: dict[str, Any], seconds: float) -> Generator[threading.Event]:
        """Renew a lease while the body runs; the event says that it is lost."""
        lost, ended = threading.Event(), threading.Event()

        def beat() -> None:
            while not ended.wait(seconds / 4.0):
                try:
                    self._service.post(f"{where}/heartbeat", token)
                except AwayError:
                    continue
                except RefusalError:
                    lost.set()
                    return

        thread = threading.Thread(target=beat, daemon=True, name="heartbeat")
        thread.start()
        try:
            yield lost
        finally:
            ended.set()
            thread.join()

    def _done(self, lease: dict[str, Any], lost: threading.Event) -> dict[str, Any] | None:
        """Return the report of a chunk, None if the worker is to stop or has lost the lease before its end."""
        where = f"/worker/submissions/{lease['digest']}"
        data = self._service.patiently(lambda: self._service.fetch(where), self._over(lost))
        with contextlib.ExitStack() as held:
            try:
                submission = held.enter_context(self._unpacked.held(data))
                program_of(str(submission.path))
            except InputError as error:
                if lacks_room(error) or lease["kind"] != "check":
                    raise
                return {"rejected": str(error)}
            if lease["kind"] == "check":
                return {"content": submission.digest}
            phase = Competition.from_document(lease["competition"]).phase(lease["phase"])
            return self._judged(phase, submission, lease, lost)

    def _judged(
        self, phase: Phase, submission: Submission, lease: dict[str, Any], lost: threading.Event
    ) -> dict[str, Any] | None:
        numbers: list[int] = lease["numbers"]
        trials: list[dict[str, Any]] = []
        began = time.monotonic()
        again = lease["kind"] == "again"
        for number in numbers:
            seeds = {number: self._seed(number, lease, lost)}
            (judged,) = judge(phase, [number], submission, seeds=seeds, trust=self._trust, remember=not again)
            if not judged.counts:
                raise DubinsTrafficError(f"trial {judged.number}: {judged.end}: {judged.row['reason']}")
            trials.append({**judged.to_json(), **self._replays(judged, lease, lost)})
            if lost.is_set():
                return None
            if self._stopping.is_set() or time.monotonic() - began > LONGEST_S:
                break
        return {"trials": trials}

    def _seed(self, number: int, lease: dict[str, Any], lost: threading.Event) -> int:
        """Return the seed of a trial that is run next; the service gives one at a time."""
        where, token = f"/worker/chunks/{lease['chunk']}/trials/{number}/seed", {"token": lease["token"]}
        return int(self._service.patiently(lambda: self._service.post(where, token), self._over(lost))["seed"])

    def _over(self, lost: threading.Event) -> Callable[[], bool]:
        """Return what tells that a lease is of no use any more."""
        return lambda: lost.is_set() or self._stopping.is_set()

    def _replays(self, judged: Judged, lease: dict[str, Any], lost: threading.Event) -> dict[str, str | None]:
        """Send the pages that replay a trial, and return their SHA-256; None for a trial without a frame."""
        sent: dict[str, str | None] = {"replay": None, "own_replay": None}
        if judged.recorded is None:
            return sent
        try:
            record = from_bytes(judged.recorded)
            mute = without_words(record)
            sent["replay"] = self._sent(judged.number, replay_of(mute), lease, lost)
            if mute is not record:
                sent["own_replay"] = self._sent(judged.number, replay_of(record), lease, lost)
        except InputError:
            return sent
        return sent

    def _sent(self, number: int, page: str, lease: dict[str, Any], lost: threading.Event) -> str | None:
        """Send a page, and return its SHA-256; None if it is too large for the service."""
        where = f"/worker/chunks/{lease['chunk']}/replays?token={lease['token']}"
        packed = gzip.compress(page.encode(), 6, mtime=0)
        try:
            return self._service.patiently(lambda: self._service.put(where, packed), self._over(lost))["digest"]
        except RefusalError as error:  # too large for the service: the result counts without it
            log.warning("a replay is refused", trial=number, error=str(error))
            return None


def lacks_room(error: BaseException | None) -> bool:
    """Tell whether an error comes of this machine: a full or broken disk, no memory, no more open files."""
    while error is not None:
        if isinstance(error, OSError) and error.errno in NO_ROOM:
            return True
        error = error.__cause__ or error.__context__
    return False


def without_words(record: Record) -> Record:
    """Return a record without the details of its end and events, which may quote a controller; the same if none has."""
    worded = (*record.frames.events, *filter(None, (record.ending,)))
    if not any(one.detail for one in worded):
        return record
    events = tuple(dataclasses.replace(event, detail="") for event in record.frames.events)
    frames = dataclasses.replace(record.frames, events=events)
    return dataclasses.replace(
        record, frames=frames, ending=record.ending and dataclasses.replace(record.ending, detail="")
    )


def replay_of(record: Record) -> str:
    """Return the page that replays a record, with its score; InputError if it holds no frame."""
    from dubins_traffic.scoring.score import score
    from dubins_traffic.viewer.replay import replay_page

    scored = score(record)
    figures = {
        "counted_rounds": scored.counted_rounds,
        "rounds": scored.rounds,
        "collisions": len(scored.collisions),
        "duration_s": scored.duration_s,
    }
    return replay_page(record.instance, record.frames, record.ending, figures, (), scored.verdict)


def check_boxes(*, trust: bool) -> None:
    """Refuse to work where this machine can't hold a stranger's program, unless submissions are trusted.

    InputError with the layers of the box that are missing.
    """
    if not trust:
        available_layers().require()


def default_folder() -> Path:
    """Return where a worker unpacks submissions unless told otherwise."""
    import platformdirs

    return Path(platformdirs.user_cache_dir("dubins-traffic")) / "worker"


def until_signalled(worker: Worker, *, with_parent: bool = False) -> None:
    """Work until this process is told to end; the chunk on lease is given back then.

    Parameters
    ----------
    with_parent : bool
        End at once when the process at the other end of standard input has ended.
    """

    def stop(_number: int, _frame: object) -> None:
        worker.stop()

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    if with_parent:
        threading.Thread(target=_end_with_parent, daemon=True).start()
    os.nice(10)
    worker.work()


def _end_with_parent() -> None:
    """End when nobody holds the other end of standard input; read without Python's own lock on it.

    An interpreter that ends while a thread holds that lock aborts.
    """
    while os.read(0, 1024):
        continue
    os._exit(1)
