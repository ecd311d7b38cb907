"""docs/index.md names every page, docs/architecture.md and its pages every room; its pictures are as drawn."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.architecture.buildings import BUILDINGS, ROOF, town
from tests.architecture.house import PACKAGE

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PICTURES = DOCS / "pictures"
NAME = re.compile(r"`(dubins_traffic(?:\.\w+)+)`")
NO_NAMES = {f"dubins_traffic.{group}" for group in ("metrics", "map_formats", "car_models")}
"""Groups of entry points."""


def page(name: str) -> str:
    return (DOCS / name).read_text(encoding="utf-8")


def rooms() -> set[str]:
    places = [path for path in PACKAGE.iterdir() if path.name not in {"__init__.py", "__pycache__"}]
    return {path.stem for path in places if path.is_dir() or path.suffix == ".py"}


def test_the_index_names_every_page_and_only_those() -> None:
    named = set(re.findall(r"\]\(([\w./-]+\.md)\)", page("index.md")))
    pages = {path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")}
    notes = {name for name in pages if name.startswith("design/")} - {"design/index.md"}
    assert {name for name in named if not name.startswith("../")} == pages - notes - {"index.md"}
    assert all((DOCS / name).exists() for name in named)


def test_the_page_of_the_design_notes_names_each() -> None:
    named = set(re.findall(r"^\| \[\d+\]\(([\w-]+\.md)\)", page("design/index.md"), re.MULTILINE))
    assert named == {path.name for path in (DOCS / "design").glob("*.md")} - {"index.md"}


def test_the_index_has_five_headings_and_reference() -> None:
    headings = re.findall(r"^## (.*)$", page("index.md"), re.MULTILINE)
    assert headings == ["Start", "The task", "Drive", "Evaluate", "Compete", "Reference"]


@pytest.mark.parametrize("building", [name for name in BUILDINGS if name != ROOF])
def test_the_page_of_a_building_names_its_rooms(building: str) -> None:
    lines = page(f"architecture/{building}.md").splitlines()
    cells = [line.split("|")[1] for line in lines if line.startswith("| `")]
    assert [name for cell in cells for name in re.findall(r"`(\w+)`", cell)] == town().rooms(building)
    assert f"](architecture/{building}.md)" in page("architecture.md")


def test_each_room_has_a_page() -> None:
    assert {room for name in BUILDINGS for room in town().rooms(name)} == rooms()
    assert all(f"| `{room}` |" in page("architecture.md") for room in town().rooms(ROOF))


def names() -> list[str]:
    pages = [path for path in DOCS.rglob("*.md") if path.parent.name != "design"]
    texts = [path.read_text(encoding="utf-8") for path in [*pages, ROOT / "README.md"]]
    return sorted({name for text in texts for name in NAME.findall(text)} - NO_NAMES)


@pytest.mark.parametrize("name", names())
def test_a_name_of_the_package_on_a_page_exists(name: str) -> None:
    """It is a module, or stands in one, or is the field of a class in one."""
    words = name.split(".")
    for count in range(len(words), 0, -1):
        try:
            found: object = importlib.import_module(".".join(words[:count]))
        except ModuleNotFoundError:
            continue
        for word in words[count:]:
            found = getattr(found, word)
        return
    pytest.fail(name)


def test_the_files_that_the_notes_name_exist() -> None:
    pages = [
        DOCS / "architecture.md",
        *(DOCS / "architecture").glob("*.md"),
        *sorted((DOCS / "design").glob("*.md")),
    ]
    missing: list[str] = []
    for path in pages:
        for name in re.findall(r"`((?:[a-z_0-9]+/)+[a-z_0-9]+\.py)(?:: [^`]*)?`", path.read_text(encoding="utf-8")):
            if not any((base / name).exists() for base in (PACKAGE, ROOT, PACKAGE / "campaign")):
                missing.append(f"{path.name}: {name}")
    assert missing == []


def test_the_pictures_show_the_layers_as_they_are(tmp_path: Path) -> None:
    subprocess.run([sys.executable, PICTURES / "house.py", tmp_path], check=True, timeout=600)
    shown = re.findall(r"\]\(pictures/house/([\w.]+)\)", page("architecture.md"))
    assert sorted(shown) == sorted(path.name for path in tmp_path.iterdir())
    for name in shown:
        drawn = (tmp_path / name).read_text(encoding="utf-8")
        assert drawn == (PICTURES / "house" / name).read_text(encoding="utf-8")
    assert all(f">{room}</text>" in (tmp_path / "rooms.svg").read_text(encoding="utf-8") for room in rooms())
