"""What pages of the documentation show as code is run, in their order, and prints what they show."""

from __future__ import annotations

import os
import re
import runpy
import shlex
import tomllib
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import typer

import dubins_traffic as dt
from dubins_traffic.cli.commands import app
from tests.reader import Reader
from tests.shown import COMMAND, ROOT, Block, all_pages, blocks
from tests.shown_pages import PAGES
from tests.shown_pictures import assert_made
from tests.shown_scores import require_progress, tables

ALL = os.environ.get("DUBINS_TRAFFIC_PAGES") == "all"
IMPROVED = ("competitions/", "tutorials/competition")
"""Pages whose examples show scores that the reader's own work makes better, and are run here at full length."""
ELSEWHERE = {
    "README.md": "test_readme.py",
    "batches.md": "test_readme.py",
    "python.md": "test_readme.py",
    "learning-agents.md": "test_parallel_env.py",
    "tutorials/campaign.md": "test_stranger.py",
    "tutorials/first-controller.md": "test_stranger.py",
    "tutorials/lane-keeper.md": "test_stranger.py",
    "tutorials/learning.md": "test_tutorials.py",
    "tutorials/reading-a-verdict.md": "test_stranger.py",
    "tutorials/synthesis.md": "test_tutorials.py",
}
"""Page: the test that runs all of its code, but what is marked."""
MOST_NOT_RUN = 4
"""Blocks that no test can run. This number may only fall."""

PATTERNS = (
    "dubins-traffic is ",
    "dubins-traffic seeds 1",
    "dubins-traffic campaign run FILE -o DIR [",
)
"""A sentence, a line of a file, and a line with words that stand for others."""
SHOWN = [(name, block) for name, path in all_pages().items() for block in blocks(path)]


def typed() -> list[str]:
    """Return the commands in all blocks of all pages, run or not, without comments."""
    texts = [path.read_text(encoding="utf-8") for path in all_pages().values()]
    found = [line for text in texts for line in re.findall(r"^(dubins-traffic \w.*)$", text, re.MULTILINE)]
    return sorted({line.partition(" #")[0].strip() for line in found if not line.startswith(PATTERNS)})


@pytest.mark.parametrize("line", typed())
@pytest.mark.path
def test_a_command_of_a_page_can_be_read(line: str) -> None:
    command: Any = typer.main.get_command(app)
    words = shlex.split(re.split(r" (?:\||2?>|&&) ", line)[0])[1:]
    context = None
    while hasattr(command, "commands"):
        context = command.make_context(words[0], words, parent=context)
        _, command, words = command.resolve_command(context, words)
    command.make_context(words[0] if words else "", words, parent=context)


def named() -> list[str]:
    """Return the beginnings of commands in the text of pages: `dubins-traffic ros1 run`; a page adds one of its own."""
    pages = {name: path for name, path in all_pages().items() if name != "extending/transport.md"}
    texts = [path.read_text(encoding="utf-8") for path in pages.values()]
    return sorted(
        {line for text in texts for line in re.findall(r"`(dubins-traffic [a-z][\w-]*(?: [a-z][\w-]*)?)", text)}
    )


@pytest.mark.parametrize("line", named())
@pytest.mark.path
def test_a_command_that_a_page_names_exists(line: str) -> None:
    command: Any = typer.main.get_command(app)
    for word in line.split()[1:]:
        if hasattr(command, "commands"):
            assert word in command.commands
            command = command.commands[word]


@pytest.mark.path
def test_for_every_page_it_is_known_where_its_code_is_run() -> None:
    with_code = {name for name, block in SHOWN if block.runs and not {"not run", "run by"} & {*block.marks}}
    followed = {*PAGES} | {name for page in PAGES.values() for name in page.with_pages}
    assert with_code == (followed & with_code) | {*ELSEWHERE}
    for test in ELSEWHERE.values():
        assert (Path(__file__).parent / test).is_file()


@pytest.mark.path
def test_what_is_run_elsewhere_or_not_at_all_says_where_and_why() -> None:
    for name, block in SHOWN:
        if where := block.marks.get("run by"):
            assert (ROOT / where).is_file(), (name, block.line)
        assert block.marks.get("not run", "why") != "", (name, block.line)
        assert block.marks.get("test-all", "why") != "", (name, block.line)
    assert len([block for _, block in SHOWN if "not run" in block.marks]) <= MOST_NOT_RUN


@pytest.mark.path
def test_no_command_hides_where_no_test_looks_for_it() -> None:
    for name, path in all_pages().items():
        assert COMMAND.findall(path.read_text(encoding="utf-8")) == [], name
    known = {"", "sh", "bash", "python", "text", "toml", "json", "xml", "nginx"}
    assert {block.language for _, block in SHOWN} <= known


@pytest.mark.path
def test_the_site_shows_nothing_of_what_pages_say_to_the_tests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "website")
    runpy.run_path(str(ROOT / "website" / "pages.py"))["gather"](tmp_path)
    texts = {path: path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.md")}
    assert len(texts) > 50
    assert [path for path, text in texts.items() if re.search(r"^<!-- test: .* -->$", text, re.MULTILINE)] == []


@pytest.mark.parametrize(
    "block",
    [pytest.param(block, id=f"{name}:{block.line}") for name, block in SHOWN if block.language in {"toml", "xml"}],
)
@pytest.mark.path
def test_a_document_of_a_page_can_be_read(block: Block) -> None:
    if block.language == "toml":
        assert tomllib.loads(block.code)
    else:
        assert len(ElementTree.fromstring(block.code))


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.tools) if PAGES[name].needs else name for name in sorted(PAGES)],
)
def test_the_code_of_a_page_runs(name: str, tmp_path: Path) -> None:
    page = PAGES[name]
    for need in page.needs:
        need()
    folder = tmp_path / "here"
    folder.mkdir()
    for put in page.there:
        put(folder)
    reader = Reader(folder, page.replaced(), page.environment())
    try:
        for followed in (*page.with_pages, name):
            for block in blocks(all_pages()[followed]):
                if block.language in page.elsewhere or {"not run", "run by"} & {*block.marks}:
                    continue
                if "test-all" in block.marks and not ALL:
                    continue
                for text, happens in page.before.items():
                    if text in block.code:
                        happens(reader)
                reader.follow(block)
        reader.wait()
        if name.startswith("tutorials/"):
            assert_made(all_pages()[name].read_text(encoding="utf-8"), folder)
        if name.startswith(IMPROVED):
            require_progress([table for log in reader.notes.iterdir() for table in tables(log.read_text())])
    finally:
        reader.close()


def test_what_drives_in_the_examples_that_are_cut_short_here_gets_somewhere_at_full_length() -> None:
    """Pages on middleware run `demo`, with controllers that drive straight across country, as this one does."""
    plan = dt.plan("demo", f"{ROOT / 'examples' / 'controller.py'}:Homing", trials=1)
    (score,) = plan.conclude(dt.run_trials(plan.jobs)).trials
    assert score.rounds_before_breach > 0
