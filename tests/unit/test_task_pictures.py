"""The pictures of docs/task.md: all there, all shown, small, and what the command draws; and that of the README."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import matplotlib
import pytest

from dubins_traffic.cli.main import main
from tests.rules_scripts import Frame, flags, instance, label
from tests.shown_pictures import PICTURES, assert_made

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "task.md"
ANY = re.compile(r"!\[[^\]]+\]\(pictures/([^)/]+)\)")
SHOWN = re.findall(r"!\[[^\]]+\]\(pictures/([^)]+)\)", PAGE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pictures")
    subprocess.run([sys.executable, PICTURES / "make.py", folder], check=True, timeout=600)
    return folder


def test_the_page_shows_each_picture_once_and_the_command_draws_them_all(drawn: Path) -> None:
    assert len(SHOWN) == len(set(SHOWN)) > 10
    assert sorted(SHOWN) == sorted(file.name for file in drawn.iterdir())
    pages = [path for path in PAGE.parent.glob("*.md") if path != PAGE]
    elsewhere = {name for path in pages for name in ANY.findall(path.read_text(encoding="utf-8"))}
    shown = [file.name for file in PICTURES.iterdir() if file.suffix in {".svg", ".png"}]
    assert sorted({*SHOWN} | elsewhere) == sorted(shown)


def test_pictures_are_small() -> None:
    assert all((PICTURES / name).stat().st_size < 100_000 for name in SHOWN)


@pytest.mark.parametrize("script", ["docs/pictures/make", "docs/pictures/maps", "docs/pictures/house", "website/build"])
def test_a_script_that_is_asked_for_help_gives_it_and_draws_nothing(script: str, tmp_path: Path) -> None:
    words = [sys.executable, ROOT / f"{script}.py", "--help"]
    told = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=600).stdout
    assert told.startswith("usage: ")
    assert list(tmp_path.iterdir()) == []


def need_pinned() -> None:
    """Skip where Matplotlib is another one than that by which the pictures were drawn."""
    pinned = re.search(r"^matplotlib==(\S+)$", (ROOT / "constraints.txt").read_text(encoding="utf-8"), re.M)
    assert pinned is not None
    if matplotlib.__version__ != pinned[1]:
        pytest.skip(f"they were drawn with matplotlib {pinned[1]}")


def test_the_trial_of_the_readme_is_what_its_commands_draw(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_pinned()
    monkeypatch.chdir(tmp_path)
    page = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    commands = [
        found.split()[1:] for found in re.findall(r"`(dubins-traffic (?:run|replay|plot) [^`]*\bfirst\b[^`]*)`", page)
    ]
    assert [words[0] for words in commands] == ["run", "replay", "plot"]
    assert [main(words) for words in commands] == [0, 0, 0]
    assert assert_made(page, tmp_path, every=50) == [301]
    assert (tmp_path / "trial.svg").read_bytes() == (PICTURES / "trial.svg").read_bytes()


def test_pictures_are_up_to_date(drawn: Path) -> None:
    need_pinned()
    stale = [name for name in SHOWN if (drawn / name).read_bytes() != (PICTURES / name).read_bytes()]
    assert not stale, "run: python docs/pictures/make.py"


def test_the_order_drawn_is_the_order_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(PICTURES))
    make, stage = importlib.import_module("make"), importlib.import_module("stage")
    waits = [
        (stage.inward(bearing, 0.1), *arrival) for bearing, arrival in zip(make.BEARINGS, make.ARRIVALS, strict=True)
    ]
    while waits:
        script: list[Frame] = []
        for k in range(max(tick for _, tick, _ in waits) + 1):
            back = [max(0.0, 0.01 * (tick - 15 - k)) + 0.3 * (k < tick - 15) for _, tick, _ in waits]
            script.append([(p.x - d * p.c, p.y - d * p.s, p.c, p.s) for (p, _, _), d in zip(waits, back, strict=True)])
        found = label([instance(stage.STAR, len(waits), rate=30.0)], [script])
        seen = [flags(found, n) for n in range(len(waits))]
        assert [next(k for k, at in enumerate(car) if "stopped" in at) for car in seen] == [
            tick for _, tick, _ in waits
        ]
        first = min(waits, key=lambda wait: wait[2])
        assert [wait for wait, car in zip(waits, seen, strict=True) if "first" in car[-1]] == [first]
        waits.remove(first)


def test_links_of_the_page_lead_somewhere() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE.read_text(encoding="utf-8")):
        assert (PAGE.parent / target).is_file(), target
