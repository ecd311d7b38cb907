"""Codes and passwords: what is void, what is listed, and that nobody waits for a hash."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from dubins_traffic.service import accounts
from dubins_traffic.service.accounts import WrongEntryError
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Account, Team

NOW = 2_000_000_000.0
PASSWORD = "correct horse"


class Hasher:
    """Stands for that of argon2, and tries to write to the database while it works."""

    def __init__(self, file: Path) -> None:
        self._file, self.hashes = file, 0

    def hash(self, password: str) -> str:
        self._write()
        return f"hash of {password}"

    def verify(self, kept: str, password: str) -> bool:
        self._write()
        return kept == f"hash of {password}"

    def _write(self) -> None:
        self.hashes += 1
        other = sqlite3.connect(self._file, timeout=0.0)
        other.execute("BEGIN IMMEDIATE")
        other.close()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "accounts.db"


@pytest.fixture
def database(file: Path) -> Iterator[Database]:
    made = Database(f"sqlite:///{file}")
    made.migrate()
    yield made
    made.close()


@pytest.fixture
def hasher(file: Path, monkeypatch: pytest.MonkeyPatch) -> Hasher:
    made = Hasher(file)
    monkeypatch.setattr(accounts, "_hasher", lambda: made)
    return made


def invited(database: Database, team: Team | None = None, by: Account | None = None) -> str:
    with database.writing() as session:
        return accounts.invite(session, accounts.PARTICIPANT, team, NOW, by=by)


def joined(database: Database, name: str = "Ann", team: str = "Ants") -> Account:
    return accounts.join(database, invited(database), name, PASSWORD, team, NOW)


def test_nobody_who_writes_waits_for_a_hash(database: Database, hasher: Hasher) -> None:
    ann = joined(database)
    with database.writing() as session:
        code = accounts.offer_reset(session, session.get_one(Account, ann.id), NOW)
    assert accounts.reset(database, code, "another horse", NOW).password == "hash of another horse"
    assert hasher.hashes == 2


def test_who_has_no_code_costs_no_hash(database: Database, hasher: Hasher) -> None:
    with pytest.raises(WrongEntryError, match="code"):
        accounts.join(database, "guessed", "Ann", PASSWORD, "Ants", NOW)
    with pytest.raises(WrongEntryError, match="code"):
        accounts.reset(database, "guessed", PASSWORD, NOW)
    assert hasher.hashes == 0


@pytest.mark.usefixtures("hasher")
def test_codes_for_a_new_password_are_void_once_one_is_used(database: Database) -> None:
    ann, bob = joined(database), joined(database, "Bob", "Bees")
    with database.writing() as session:
        first, second = (accounts.offer_reset(session, ann, NOW) for _ in range(2))
        other = accounts.offer_reset(session, bob, NOW)
    accounts.reset(database, second, "another horse", NOW)
    with pytest.raises(WrongEntryError, match="used"):
        accounts.reset(database, first, "stolen horse", NOW)
    assert accounts.reset(database, other, "another horse", NOW).id == bob.id


@pytest.mark.usefixtures("hasher")
def test_invitations_that_a_removed_member_may_know_are_void(database: Database) -> None:
    ann = joined(database)
    with database.reading() as session:
        team = session.get_one(Team, ann.team_id)
    eve = accounts.join(database, invited(database, team), "Eve", PASSWORD, "", NOW)
    to_team, elsewhere, by_eve = invited(database, team), invited(database), invited(database, by=eve)
    with database.writing() as session:
        accounts.remove(session, session.get_one(Account, eve.id), NOW)
    for code in (to_team, by_eve):
        with pytest.raises(WrongEntryError, match="used"):
            accounts.join(database, code, "Mallory", PASSWORD, "M", NOW)
    assert accounts.join(database, elsewhere, "Bob", PASSWORD, "Bees", NOW).team_id != team.id


@pytest.mark.usefixtures("hasher")
def test_a_team_lists_and_revokes_its_own_invitations(database: Database) -> None:
    ann, bob = joined(database), joined(database, "Bob", "Bees")
    with database.reading() as session:
        team = session.get_one(Team, ann.team_id)
    code = invited(database, team, ann)
    with database.writing() as session:
        (listed,) = accounts.invitations(session, NOW, team.id)
        assert accounts.invitations(session, NOW, bob.team_id) == []
        assert accounts.invitations(session, listed.expires, team.id) == []
        with pytest.raises(WrongEntryError, match="unknown"):
            accounts.revoke_invitation(session, listed.id, NOW, bob.team_id)
        accounts.revoke_invitation(session, listed.id, NOW, team.id)
        assert accounts.invitations(session, NOW) == []
    with pytest.raises(WrongEntryError, match="used"):
        accounts.join(database, code, "Cid", PASSWORD, "", NOW)


@pytest.mark.parametrize("act", ["INSERT OR REPLACE INTO", "REPLACE INTO"])
def test_nothing_replaces_an_act(database: Database, act: str) -> None:
    """Under these SQLite deletes a row without asking the trigger of deleting."""
    with database.writing() as session:
        accounts.note(session, None, "create", "c", "", 1.0)
    with pytest.raises(DBAPIError, match="only grows"), database.writing() as session:
        session.execute(text(f"{act} act (id, at, act, subject, detail) VALUES (1, 1.0, 'x', 'x', 'x')"))
    with database.writing() as session:
        accounts.note(session, None, "create", "d", "", 1.0)
        assert session.execute(text("SELECT subject FROM act ORDER BY id")).scalars().all() == ["c", "d"]
