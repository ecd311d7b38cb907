"""The process of `dubins-traffic serve`: the web server, the housekeeper, and workers beside it that are kept alive."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

import structlog
import uvicorn
from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from dubins_traffic.competition.competition import load_competition
from dubins_traffic.errors import InputError
from dubins_traffic.live.listening import address_of
from dubins_traffic.service import accounts, editing, organising
from dubins_traffic.service.client import TOKEN
from dubins_traffic.service.database_tables import Account, Code, Competition, Token
from dubins_traffic.service.housekeeping import Housekeeper
from dubins_traffic.service.service import Service, competition_of
from dubins_traffic.service.web.app import create_app
from dubins_traffic.service.web.patience import PatientProtocol

log = structlog.get_logger("dubins_traffic.service")
WATCH_S = 1.0


def prepare(service: Service, competitions: list[Path], url: str) -> str | None:
    """Bring the tables up to date and make competitions that are not there yet.

    Returns
    -------
    str or None
        The address at which the first organiser of all competitions joins, while there is none.

    Raises
    ------
    InputError
        If a competition can't be made.
    """
    service.database.migrate()
    given = {organising.slug_of(path) for path in competitions}
    with service.database.reading() as session:
        kept = [slug for slug in session.scalars(select(Competition.slug)) if slug not in given]
    for slug in kept:
        _say_changes(service, slug, service.place(slug))
    for path in competitions:
        slug = organising.slug_of(path)
        with service.database.reading() as session:
            known = competition_of(session, slug)
        if known is None:
            organising.create(service, slug, organising.files_of(path), None)
        else:
            _say_changes(service, slug, path)
    with service.database.writing() as session:
        of_all = (
            Account.role == accounts.ORGANISER,
            Account.competition_id.is_(None),
            Account.removed.is_(None),
        )
        if session.scalar(select(func.count()).where(*of_all)):
            return None
        offered = Code.role == accounts.ORGANISER, Code.competition_id.is_(None), Code.used.is_(None)
        session.execute(update(Code).where(*offered).values(used=service.clock()))
        code = accounts.invite(session, accounts.ORGANISER, None, service.clock())
    return f"{service.settings.url.rstrip('/') or url}/join?code={code}"


def _say_changes(service: Service, slug: str, path: Path) -> None:
    """Say in what the file of a competition that has begun differs from it: the file alone changes nothing."""
    try:
        loaded = load_competition(path)
    except InputError as error:
        log.error("the file of a competition that has begun can't be read", competition=slug, error=str(error))
        return
    with service.database.reading() as session:
        row = competition_of(session, slug)
        changed = [] if row is None else editing.changes(service, row, loaded)
    for change in changed:
        advice = "locked" if change.locked else f"to change it: /desk/edit/{slug}"
        log.warning("the file differs from the competition", competition=slug, difference=str(change), advice=advice)


def local_token(service: Service) -> str:
    """Return a token for the workers beside this server; those of servers before it end."""

    def make(session: Session) -> str:
        old = update(Token).where(Token.name == accounts.LOCAL, Token.account_id.is_(None), Token.revoked.is_(None))
        session.execute(old.values(revoked=service.clock()))
        return accounts.new_token(session, accounts.LOCAL, None, service.clock())

    return service.database.patiently(make)


class Workers(threading.Thread):
    """Workers as processes of this machine; one that ends is replaced, and all end with this process.

    `program` is the command of a worker, without its arguments.
    """

    def __init__(self, count: int, program: Sequence[str], url: str, token: str, folder: Path, *, trust: bool) -> None:
        super().__init__(name="workers", daemon=True)
        self._count, self._url, self._token, self._folder = count, url, token, folder
        self._program = program
        self._trust = trust
        self._stop_asked = threading.Event()
        self.processes: list[subprocess.Popen[bytes]] = []

    def run(self) -> None:
        """Keep the workers alive."""
        self.processes = [self._launched(number) for number in range(self._count)]
        while not self._stop_asked.wait(WATCH_S):
            for number, process in enumerate(self.processes):
                if process.poll() is not None:
                    log.warning("a worker ended", worker=number, status=process.returncode)
                    self.processes[number] = self._launched(number)

    def stop(self) -> None:
        """Let all workers give back what they have on lease, and end."""
        self._stop_asked.set()
        if self.is_alive():
            self.join(timeout=10)
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def _launched(self, number: int) -> subprocess.Popen[bytes]:
        folder = self._folder / f"worker-{number}"
        command = [
            *self._program,
            self._url,
            "--name",
            f"{socket.gethostname()[:40]} {number}",
            "--folder",
            str(folder),
        ]
        command += ["--with-parent", *(["--trust-submissions"] if self._trust else [])]
        return subprocess.Popen(command, stdin=subprocess.PIPE, env={**os.environ, TOKEN: self._token})


def _nothing(_number: int, _frame: FrameType | None) -> None:
    """Do nothing; unlike a signal that is ignored, this is not handed on to workers."""


class Server(uvicorn.Server):
    """A web server that lets the workers beside it give back what they have on lease before it closes its door."""

    def __init__(self, config: uvicorn.Config, beside: Workers) -> None:
        super().__init__(config)
        self._beside = beside
        self._leaving = False

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End when the workers have ended; told a second time, at once."""
        if self._leaving:
            super().handle_exit(sig, frame)
            return
        self._leaving = True
        threading.Thread(target=self._leave, args=(sig,), daemon=True).start()

    def _leave(self, sig: int) -> None:
        self._beside.stop()
        super().handle_exit(sig, None)


def serve(
    service: Service, opened: socket.socket, workers: int, program: Sequence[str], *, trust: bool = False
) -> None:
    """Serve until this process is told to end.

    Parameters
    ----------
    workers : int
        How many workers to keep beside the server.
    program : sequence of str
        The command of a worker, without its arguments.
    """
    config = uvicorn.Config(
        create_app(service),
        http=PatientProtocol,
        proxy_headers=True,
        forwarded_allow_ips=",".join(service.settings.proxies),
        server_header=False,
        access_log=False,
        log_level="warning",
        timeout_graceful_shutdown=10,
    )
    beside = Workers(workers, program, address_of(opened), local_token(service), service.folder / "work", trust=trust)
    for number in (signal.SIGINT, signal.SIGTERM):  # the server raises them again when it has ended
        signal.signal(number, _nothing)
    keeper = Housekeeper(service)
    keeper.start()
    beside.start()
    try:
        Server(config, beside).run(sockets=[opened])
    finally:
        beside.stop()
        keeper.stop()
        service.close()
