"""The settings of the service: ``service.toml`` in its folder; all have defaults."""

from __future__ import annotations

import os
import secrets
import tomllib
from pathlib import Path
from typing import Annotated

from pydantic import Field

from dubins_traffic.errors import InputError
from dubins_traffic.files import exists, read_text
from dubins_traffic.problem.faults import Strict, parse

FILE = "service.toml"
Positive = Annotated[float, Field(gt=0)]


class Settings(Strict):
    """What may be set, and what it is unless set."""

    name: str = Field(
        default="dubins-traffic", min_length=1, max_length=100, description="title of the pages"
    )
    url: str = Field(
        default="",
        description="address that people type, with https behind a TLS proxy; left out: where it listens",
    )
    database: str = Field(
        default="", description="address of a PostgreSQL, as postgresql+psycopg://...; left out: SQLite here"
    )
    storage: str = Field(
        default="", description="folder or s3://... for submissions and replays; left out: here"
    )
    proxies: list[str] = Field(
        default=["127.0.0.1"], description="addresses of proxies whose X-Forwarded-* are believed"
    )
    lease: Positive = Field(default=60.0, description="how long a worker may be silent, s")
    largest_upload: Annotated[int, Field(ge=1)] = Field(default=16, description="MiB of a submission")
    largest_replay: Annotated[int, Field(ge=1)] = Field(default=32, description="MiB of a replay, packed")
    logins: Annotated[int, Field(ge=1)] = Field(
        default=20, description="attempts to log in, a minute and address"
    )

    @property
    def secure(self) -> bool:
        """Whether people come by https, so that cookies are sent by nothing else."""
        return self.url.startswith("https://")


def load_settings(folder: Path) -> Settings:
    """Return the settings in the folder of a service, those that are not set at their defaults.

    Raises
    ------
    InputError
        If the file can't be read or something in it is wrong.
    """
    path = folder / FILE
    if not exists(path):
        return Settings()
    try:
        document = tomllib.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(f"not TOML ({error})", file=str(path)) from None
    return parse(Settings, document, file=str(path))


def own_secret(folder: Path, name: str) -> str:
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
