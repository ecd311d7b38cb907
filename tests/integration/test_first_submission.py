"""The commands of the page for organisers lead to the first place in the table, in a real browser."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from dubins_traffic.competition.templates import write_template
from tests.browser import browsing
from tests.first_submission import TEAM, first_place, served

pytestmark = pytest.mark.tools("browser")


def test_from_the_commands_of_the_page_to_the_first_place(tmp_path: Path) -> None:
    write_template("python", tmp_path / "entry")
    around = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path / "config")}  # where the key of secret seeds goes
    service = served([sys.executable, "-m", "dubins_traffic.cli"], tmp_path, around)
    try:
        with browsing(tmp_path / "profile") as browser:
            row = first_place(browser, service, tmp_path / "entry" / "controller.py")
            assert [one for one in browser.get_log("browser") if one["level"] == "SEVERE"] == []
    finally:
        service.end()
    assert row.startswith(f"1 {TEAM} ")
    assert list((tmp_path / "config").rglob("season-*.key"))
    said = (tmp_path / "service.log").read_text()
    assert "Traceback" not in said
    assert "Fatal Python error" not in said
