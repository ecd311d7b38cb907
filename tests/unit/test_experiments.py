"""Experiments: each claim has a command, its stored result is read as it was written, and the page is made of them."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest
from benchmarks.table import Row
from experiments import __main__ as program
from experiments import stored


def test_the_page_is_made_of_what_is_stored() -> None:
    assert stored.PAGE.read_text(encoding="utf-8") == stored.page(), "run `python -m experiments --page`"


@pytest.mark.parametrize("name", stored.CLAIMS)
def test_each_claim_can_be_run_and_names_a_page(name: str) -> None:
    assert callable(importlib.import_module(f"experiments.{name}").measure)
    assert (stored.ROOT / "docs" / stored.CLAIMS[name].page.partition("#")[0]).is_file()


def test_all_that_is_stored_is_of_a_claim_and_dated() -> None:
    for path in stored.FOLDER.glob("*.json"):
        found = stored.load(path.stem)
        assert path.stem in stored.CLAIMS
        assert found is not None
        assert len(found.date.split("-")) == 3
        assert found.commit
        assert found.rows


def test_a_result_is_stored_with_date_commit_and_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stored, "FOLDER", tmp_path)
    monkeypatch.setattr(stored, "_commit", lambda: "0123abc")
    rows = [Row("trials", "2", "0", False), Row("metres", "3.5", "", True)]
    stored.store("lanes", rows)
    found = stored.load("lanes")
    assert found is not None
    assert (found.command, found.commit, list(found.rows)) == ("python -m experiments lanes", "0123abc", rows)
    assert "cores of" in json.loads((tmp_path / "lanes.json").read_text())["machine"]
    assert "| trials | 2 | 0: missed |" in stored.page()
    assert "No result is stored" in stored.page()


def test_an_unknown_one_is_refused_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert program.main(["lines"]) == 2
    assert "NAME: unknown: lines; expected some of rules, lanes, " in capsys.readouterr().err
