"""Backup and restore by the commands of the page for organisers, while the service runs."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.services import PASSWORD, STANDING, competition_text, serving
from tests.tools import need_programs

pytestmark = pytest.mark.tools

PAGE = Path(__file__).parents[2] / "docs" / "competitions" / "organisers.md"


def test_what_was_backed_up_is_there_again(tmp_path: Path) -> None:
    need_programs("sqlite3")
    found = re.search(r"```bash\n(sqlite3 season.*?)```", PAGE.read_text(encoding="utf-8"), re.S)
    assert found is not None
    (tmp_path / "short.toml").write_text(competition_text())
    (tmp_path / "backup").mkdir()
    season = tmp_path / "season"
    arguments = ("--workers", "0", "--competition", str(tmp_path / "short.toml"))
    with serving(season, *arguments) as service:
        organiser = service.organiser()
        person = service.person().join(organiser.invite(), "Ann", "Ants")
        number = person.submit("short/test", STANDING)
        subprocess.run(["bash", "-e", "-c", found[1]], cwd=tmp_path, check=True, timeout=600)
        commitment = organiser.get("/c/short/test/commitment.json").text
        assert person.submit("short/practice", STANDING) == number + 1
    shutil.rmtree(season)
    (tmp_path / "backup").rename(season)
    (season / "joined").touch()
    with serving(season, "--trust-submissions", clean=True) as service:
        back = service.person()
        assert back.login("Ann", PASSWORD).status_code == 303
        back.ended(number, "finished")
        assert back.get(f"/s/{number + 1}").status_code == 404
        assert back.get("/c/short/test/commitment.json").text == commitment
        olga = service.person()
        olga.login("Olga")
        assert olga.get(f"/s/{number}/trials/0").status_code == 200
