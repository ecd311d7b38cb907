"""The database: SQLite with a write-ahead log in the folder of the service, or PostgreSQL by its address.

Writers go one after another on both: SQLite by ``BEGIN IMMEDIATE``, PostgreSQL by a lock that the transaction holds.
So what a writer has read is still true when it commits, and one text of the queue serves both.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Generator
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, Engine, create_engine, event, inspect, text
from sqlalchemy.exc import DBAPIError, OperationalError
from sqlalchemy.orm import Session
from sqlalchemy.pool import ConnectionPoolEntry

from dubins_traffic.errors import InputError
from dubins_traffic.service.database_tables import Base

WRITERS_LOCK = 0x64756269
"""Number of the lock that writers hold on PostgreSQL."""
PATIENCE_S = 60.0
"""How long a writer waits for the database to come back."""
LONGEST_PAUSE_S = 0.5
"""How long a writer waits at most until it tries again: well under the shortest lease of use."""
Found = TypeVar("Found")
LARGEST_NUMBER = (1 << 31) - 1
"""The largest number that a column of numbers holds."""


class Database:
    """Sessions for reading and for writing.

    Parameters
    ----------
    url : str
        Address as SQLAlchemy has it: ``sqlite:///FILE`` or ``postgresql+psycopg://...``.
    """

    def __init__(self, url: str) -> None:
        sqlite = url.startswith("sqlite")
        options: dict[str, Any] = {"connect_args": {"timeout": 30}} if sqlite else {"pool_pre_ping": True}
        # What a statement was given may be secret, and its error goes to the log: `hide_parameters`.
        self.engine: Engine = create_engine(url, pool_size=16, max_overflow=32, hide_parameters=True, **options)
        self._writes = self.engine.execution_options(writes=True)
        self._failed = threading.Event()
        if sqlite:
            event.listen(self.engine, "connect", _prepare_sqlite)
            event.listen(self.engine, "begin", _begin_sqlite)
        else:
            event.listen(self.engine, "begin", _begin_postgresql)

    @contextlib.contextmanager
    def reading(self) -> Generator[Session]:
        """Give a session that sees one state of the database."""
        with Session(self.engine, expire_on_commit=False) as session:
            yield session

    @contextlib.contextmanager
    def writing(self) -> Generator[Session]:
        """Give a session that is the only writer; it commits when the body ends well, all of it or nothing."""
        with Session(self._writes, expire_on_commit=False) as session, session.begin():
            yield session

    def patiently(self, work: Callable[[Session], Found]) -> Found:
        """Return what `work` gives in a writer's session; it is tried again while the database is away.

        `work` is called anew in a new transaction each time, so it must do nothing outside of it.

        sqlalchemy.exc.DBAPIError if the database stays away for `PATIENCE_S`.
        """
        until, pause = time.monotonic() + PATIENCE_S, 0.05
        while True:
            try:
                with self.writing() as session:
                    return work(session)
            except DBAPIError as error:
                away = isinstance(error, OperationalError) or error.connection_invalidated
                if away:
                    self._failed.set()
                if not away or time.monotonic() > until:
                    raise
            time.sleep(pause)
            pause = min(LONGEST_PAUSE_S, 2.0 * pause)

    def was_away(self) -> bool:
        """Tell whether a patient writer has found the database away since this was asked last."""
        failed = self._failed.is_set()
        self._failed.clear()
        return failed

    def migrate(self, revision: str = "head") -> None:
        """Bring the tables to those of this version of the package, whatever version before it made them.

        InputError if a later version made them, or one from before the first release.
        """
        config = Config()
        config.set_main_option("script_location", str(Path(__file__).with_name("migrations")))
        with self._writes.begin() as connection:
            config.attributes["connection"] = connection
            _check_known(connection, ScriptDirectory.from_config(config))
            command.upgrade(config, revision)
            _check_columns(connection)

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


def numbered(session: Session, table: type[Found], number: int) -> Found | None:
    """Return the row of a table that has a number, whatever number was asked for; None if there is none."""
    return session.get(table, number) if number <= LARGEST_NUMBER else None


def _check_known(connection: Connection, known: ScriptDirectory) -> None:
    revision = MigrationContext.configure(connection).get_current_revision()
    ours = {script.revision for script in known.walk_revisions()}
    if revision is not None and revision not in ours:
        raise InputError(
            "a later version of dubins-traffic made these tables",
            file=_named(connection),
            field="version of the tables",
            value=revision,
            expected=f"{known.get_current_head()} at most: this is dubins-traffic {version('dubins-traffic')}; install "
            "the version that made them, or restore the backup from before the upgrade",
        )


def _check_columns(connection: Connection) -> None:
    inspector = inspect(connection)
    for table in Base.metadata.sorted_tables:
        missing = {column.name for column in table.columns} - {
            column["name"] for column in inspector.get_columns(table.name)
        }
        if missing:
            raise InputError(
                "a version from before the first release made these tables",
                file=_named(connection),
                field=table.name,
                value=f"no column {min(missing)}",
                expected="a new folder or database: competitions of such a version are not taken over",
            )


def _named(connection: Connection) -> str:
    return connection.engine.url.render_as_string(hide_password=True)


def _prepare_sqlite(connection: Any, _entry: ConnectionPoolEntry) -> None:
    """Let SQLAlchemy begin transactions, not the driver; a commit has reached the disk before it returns."""
    connection.isolation_level = None
    for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "busy_timeout=30000"):
        connection.execute(f"PRAGMA {setting}").close()


def _begin_sqlite(connection: Connection) -> None:
    connection.exec_driver_sql("BEGIN IMMEDIATE" if _writes(connection) else "BEGIN")


def _begin_postgresql(connection: Connection) -> None:
    if _writes(connection):
        connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": WRITERS_LOCK})


def _writes(connection: Connection) -> bool:
    return bool(connection.get_execution_options().get("writes"))
