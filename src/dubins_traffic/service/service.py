"""The service as one object: its folder, settings, database, store, key and clock, and the competitions it holds."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import secrets
import time
import tomllib
from collections.abc import Callable
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import Field
from sqlalchemy import select
from sqlalchemy.orm import Session, joinedload

from dubins_traffic.competition import competition as files
from dubins_traffic.competition import sealing
from dubins_traffic.errors import InputError
from dubins_traffic.files import exists, read_text, replace_file
from dubins_traffic.problem.faults import Strict, parse
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Competition, Phase
from dubins_traffic.service.hiding import NOTHING, HiddenError, Hiding, hiding_of
from dubins_traffic.service.storage import Storage

FILE = "service.toml"
CHECK = "key.check"
Positive = Annotated[float, Field(gt=0)]


class ServiceSettings(Strict):
    """What may be set, and what it is unless set."""

    name: str = Field(default="dubins-traffic", min_length=1, max_length=100, description="title of the pages")
    url: str = Field(
        default="",
        description="address that people type, with https behind a TLS proxy; left out: where it listens",
    )
    database: str = Field(
        default="", description="address of a PostgreSQL, as postgresql+psycopg://...; left out: SQLite here"
    )
    storage: str = Field(default="", description="folder or s3://... for submissions and replays; left out: here")
    proxies: list[str] = Field(
        default=["127.0.0.1"], description="addresses of proxies whose X-Forwarded-* are believed"
    )
    lease: Positive = Field(default=60.0, description="how long a worker may be silent, s")
    largest_upload: Annotated[int, Field(ge=1)] = Field(default=16, description="MiB of a submission")
    largest_replay: Annotated[int, Field(ge=1)] = Field(default=32, description="MiB of a replay, packed")
    logins: Annotated[int, Field(ge=1)] = Field(default=20, description="attempts to log in, a minute and address")

    @property
    def secure(self) -> bool:
        """Whether people come by https, so that cookies are sent by nothing else."""
        return self.url.startswith("https://")


def load_settings(folder: Path) -> ServiceSettings:
    """Return the settings in the folder of a service, those that are not set at their defaults.

    InputError if the file can't be read or something in it is wrong.
    """
    path = folder / FILE
    if not exists(path):
        return ServiceSettings()
    try:
        document = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"not TOML ({error})", file=str(path)) from None
    return parse(ServiceSettings, document, file=str(path))


def secret_in(folder: Path, name: str) -> str:
    """Return a secret of this service that is drawn at its first start, in a file that only its owner may read."""
    path = folder / name
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        return read_text(path).strip()
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror})", file=str(path)) from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        drawn = secrets.token_hex(32)
        file.write(drawn)
        file.flush()
        os.fsync(file.fileno())
    return drawn


Clock = Callable[[], float]


class NoKeyError(InputError):
    """The key of what is secret is not there; what needs it waits until it is."""


class Service:
    """What every part of the service works with.

    Parameters
    ----------
    folder : Path
        The folder of the service; made if missing.
    key_file : Path, optional
        The key of secret seeds, outside of `folder`; drawn while there are no competitions. While it is missing,
        phases that need it are not judged; judging goes on as soon as it is there.
    clock : callable
        Seconds since 1970, UTC.
    """

    def __init__(self, folder: Path, key_file: Path | None = None, clock: Clock = time.time) -> None:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.folder = folder
        self.settings: ServiceSettings = load_settings(folder)
        self.clock = clock
        self.database = Database(self.settings.database or f"sqlite:///{folder / 'service.db'}")
        self.storage = Storage(self.settings.storage or str(folder / "store"))
        self.cookie_secret = secret_in(folder, "cookies.key")
        self.key_file = key_file
        self._read_key = None if key_file is None else _key(key_file, folder)
        self._competitions: dict[int, tuple[str, files.Competition]] = {}
        self._seeds: dict[tuple[int, str], tuple[int, ...]] = {}
        self._hidings: dict[int, Hiding] = {}

    def competition(self, row: Competition) -> files.Competition:
        """Return a competition as its file says it."""
        document, loaded = self._competitions.get(row.id, ("", None))
        if loaded is None or document != row.document:
            place = self.place(row.slug)
            loaded = files.Competition.from_document(json.loads(row.document), row.slug, place)
            self._competitions[row.id] = row.document, loaded
        return loaded

    def place(self, slug: str) -> Path:
        """Return the folder of a competition: its file, sealed seeds and what is published."""
        return self.folder / "competitions" / slug

    def phase(self, row: Phase) -> files.Phase:
        """Return a phase as its file says it, opening and closing when the organiser has it do."""
        phase = self.competition(row.competition).phase(row.name)
        times = {"opens": _moment(row.opens), "closes": _moment(row.closes)}
        return dataclasses.replace(phase, model=phase.model.model_copy(update=times))

    def seeds(self, row: Phase) -> tuple[int, ...]:
        """Return the seed of each trial of a phase, by number; they are unlocked once and then remembered."""
        phase = self.phase(row)
        which = (row.id, phase.rules)
        if which not in self._seeds:
            key = self.needed_key() if phase.secret and not exists(sealing.revealed_path(phase)) else None
            self._seeds[which] = phase.seeds(key)
        return self._seeds[which]

    def hiding(self, row: Phase) -> Hiding:
        """Return what hides the results of a phase, all that is kept of them; of one that shows all, nothing is hidden.

        NoKeyError if there is no key.
        """
        if row.shows == "all":
            return NOTHING
        if row.id not in self._hidings:
            self._hidings[row.id] = hiding_of(self.needed_key(), f"{row.competition.slug}/{row.name}")
        return self._hidings[row.id]

    def needed_key(self) -> bytes:
        """Return what unlocks secret seeds, as soon as its file is there; NoKeyError if it is not, or is another's."""
        if self._read_key is None and self.key_file is not None and exists(self.key_file):
            self._read_key = _read(self.key_file, self.folder)
        if self._read_key is None:
            raise NoKeyError("no key for what is secret", file="--key-file", expected="a key file outside the folder")
        return self._read_key

    def has_key(self) -> bool:
        """Tell whether what unlocks secret seeds is there."""
        try:
            self.needed_key()
        except NoKeyError:
            return False
        return True

    def waits_for_key(self, row: Phase) -> bool:
        """Tell whether a phase is not judged because the key is not there."""
        secret = row.shows != "all" or (row.commitment is not None and row.revealed is None)
        return secret and not self.has_key()

    def waiting_for_key(self, session: Session) -> list[Phase]:
        """Return the phases that are not judged because the key is not there."""
        if self.has_key():
            return []
        rows = session.scalars(select(Phase).options(joinedload(Phase.competition)).order_by(Phase.id))
        return [row for row in rows.all() if self.waits_for_key(row)]

    def close(self) -> None:
        """Let go of the database."""
        self.database.close()


def competition_of(session: Session, slug: str) -> Competition | None:
    """Return the competition at an address, its phases with it."""
    query = select(Competition).where(Competition.slug == slug).options(joinedload(Competition.phases))
    return session.scalars(query).unique().first()


def phase_of(session: Session, slug: str, name: str) -> Phase | None:
    """Return a phase by the address of its competition and its name."""
    query = select(Phase).join(Competition).where(Competition.slug == slug, Phase.name == name)
    return session.scalars(query.options(joinedload(Phase.competition))).first()


def default_key(folder: Path) -> Path:
    """Return where the key of a folder's secret seeds lies unless told otherwise: in the user's configuration."""
    import platformdirs

    name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]
    return Path(platformdirs.user_config_dir("dubins-traffic")) / "keys" / f"{folder.resolve().name}-{name}.key"


def _moment(at: float | None) -> datetime | None:
    return None if at is None else datetime.fromtimestamp(at, UTC)


def _key(path: Path, folder: Path) -> bytes | None:
    if not path.exists():
        if _has_competitions(folder):  # a new key would read nothing of what they hold
            return None
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        sealing.make_key_file(path, folder)
    return _read(path, folder)


def _has_competitions(folder: Path) -> bool:
    return any((folder / "competitions").glob("*/"))


def _read(path: Path, folder: Path) -> bytes:
    """Return the key in a file; NoKeyError if a service of this folder has had another one before.

    What the first key has encrypted stays in the folder, and tells the others. It is kept before there are
    competitions: later nobody could tell whether a key is that with which they were sealed.
    """
    key, check = sealing.read_key(path, folder), folder / CHECK
    if check.exists():
        if not _fits(key, check.read_bytes()):
            raise NoKeyError("not the key of this folder", file=str(path), expected=f"the key that wrote {check}")
    elif not _has_competitions(folder):
        hidden = hiding_of(key, CHECK).hide(b"", CHECK)
        replace_file(check, lambda neighbour: neighbour.write_bytes(hidden), durable=True)
    return key


@lru_cache(maxsize=4)
def _fits(key: bytes, check: bytes) -> bool:
    """Tell whether a key has written a check; it is remembered, since scrypt takes a while and pages ask again."""
    try:
        hiding_of(key, CHECK).show(check, CHECK)
    except HiddenError:
        return False
    return True
