"""What stops `serve` says so in a line, and what need not stop it does not."""

from __future__ import annotations

import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from dubins_traffic.service.database import Database
from tests import postgres
from tests.services import COMMAND, PASSWORD, competition_text, serving

STRAY = b"\x00\x00\x00\x01Bud1\x00"


def refused(*arguments: str) -> str:
    ran = subprocess.run(
        [*COMMAND, *arguments, "--workers", "0", "--port", "0"],
        capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    assert ran.returncode == 2, ran.stderr
    (line,) = ran.stderr.splitlines()
    assert "unexpected" not in line
    return line


def test_files_of_a_desktop_stop_nothing(tmp_path: Path) -> None:
    competition, here = tmp_path / "short", tmp_path / "here"
    competition.mkdir()
    (competition / "competition.toml").write_text(competition_text())
    (competition / ".DS_Store").write_bytes(STRAY)
    arguments = ("--workers", "0", "--competition", str(competition))
    with serving(here, *arguments, clean=True) as service:
        service.organiser()
    folders = [here, *(path for path in here.rglob("*") if path.is_dir())]
    assert {"sessions", "store", "competitions"} <= {path.name for path in folders}
    for folder in folders:
        (folder / ".DS_Store").write_bytes(STRAY)
        (folder / "Thumbs.db").write_bytes(STRAY)
    with serving(here, *arguments, clean=True) as service:
        person = service.person()
        assert person.login("Olga", PASSWORD).status_code == 303
        assert person.get("/desk/c/short").status_code == 200
        assert person.get("/desk/c/short/export.zip").status_code == 200


def test_a_file_whose_name_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "short").mkdir()
    (tmp_path / "short" / "competition.toml").write_text(competition_text())
    (tmp_path / "short" / "my notes.txt").write_text("x")
    words = ("serve", str(tmp_path / "here"), "--key-file", str(tmp_path / "key"))
    assert "my notes.txt" in refused(*words, "--competition", str(tmp_path / "short"))


def test_tables_of_a_later_version_are_told_of(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(competition_text())
    words = ("--workers", "0", "--competition", str(tmp_path / "short.toml"))
    with serving(tmp_path / "here", *words):
        pass
    later(tmp_path / "here" / "service.db")
    line = refused("serve", str(tmp_path / "here"), "--key-file", str(tmp_path / "here.key"))
    assert "a later version of dubins-traffic made these tables: got '9999'" in line
    assert "install the version" in line


def test_tables_from_before_the_first_release_are_told_of(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    path = tmp_path / "here" / "service.db"
    database = Database(f"sqlite:///{path}")
    database.migrate()
    database.migrate()
    database.close()
    with closing(sqlite3.connect(path)) as opened, opened:
        opened.execute("ALTER TABLE account DROP COLUMN epoch")
    line = refused("serve", str(tmp_path / "here"), "--key-file", str(tmp_path / "here.key"))
    assert "a version from before the first release made these tables: got 'no column epoch'" in line
    assert "account" in line


def test_what_a_statement_was_given_is_in_no_error(tmp_path: Path) -> None:
    database = Database(f"sqlite:///{tmp_path / 'service.db'}")
    with pytest.raises(OperationalError) as caught, database.writing() as session:
        session.execute(text("INSERT INTO missing VALUES (:value)"), {"value": "swordfish"})
    assert "swordfish" not in str(caught.value)
    database.close()


def later(path: Path) -> None:
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE alembic_version SET version_num = '9999'")


@pytest.mark.tools
def test_tables_of_a_later_version_in_postgresql(tmp_path: Path) -> None:
    import psycopg

    with postgres.cluster() as cluster:
        url = cluster.url("later")
        with psycopg.connect(url.replace("+psycopg", "")) as database:
            database.execute("CREATE TABLE alembic_version (version_num varchar(32) NOT NULL)")
            database.execute("INSERT INTO alembic_version VALUES ('9999')")
        (tmp_path / "here").mkdir()
        (tmp_path / "here" / "service.toml").write_text(f'database = "{url}"\n')
        line = refused("serve", str(tmp_path / "here"), "--key-file", str(tmp_path / "key"))
        assert "a later version" in line


@pytest.mark.parametrize("given", ["", "a long passphrase\na long passphrase\n"])
def test_without_a_terminal_a_key_file_is_asked_for(tmp_path: Path, given: str) -> None:
    """In a session of its own, which has no terminal; with a key file the same command does what it is to do."""
    (tmp_path / "competition.toml").write_text(competition_text())
    command = [*COMMAND, "competition", "seal", str(tmp_path), "--phase", "test"]
    setsid = shutil.which("setsid")
    assert setsid is not None
    ran = subprocess.run([setsid, "-w", *command], input=given, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert ran.stderr.startswith("dubins-traffic: --key-file: no passphrase was typed, nor is a key file named")
    assert len(ran.stderr.splitlines()) == 1
    assert not (tmp_path / "sealed").exists()
    key = tmp_path.with_suffix(".key")
    done = subprocess.run([*command, "--key-file", str(key)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "sealed" / "test.json").exists()
    assert "who loses the key, or the passphrase, has no results" in done.stderr
