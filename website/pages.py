"""Gathers the pages of docs/, README and others, with links as Sphinx follows them."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from order import ELSEWHERE, LABELS, SECTIONS, SHOWN

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
MARKUP = (".xml", ".osm", ".xodr")
TITLES = {"readme.md": "README"}
"""Pages that are called otherwise here: the first page has the name of the package."""
OTHERS = {
    "README.md": "readme.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "benchmarks/README.md": "benchmarks.md",
    "docs/index.md": "index.md",
}
"""Pages that do not stand in docs/, or elsewhere there: where the site has them."""
LINK = re.compile(r"(?<!!)\]\((?!https?:|#|mailto:)([^)\s#]+)(#[^)\s]*)?\)")
ANCHOR = re.compile(r'<a id="([^"]+)"></a>')
FENCE = re.compile(r"^(```.*?^```|~~~.*?^~~~)", re.MULTILINE | re.DOTALL)
MARK = re.compile(r"^<!-- test: [^\n]* -->\n", re.MULTILINE)
"""What a page says to the tests, which is not for the site (`tests/shown.py`)."""
ORPHAN = "---\norphan: true\n---\n\n"
"""What a page says at its head that the sidebar does not show."""
LANGUAGES = {".py": "python", ".toml": "toml", ".json": "json", ".cpp": "cpp", ".c": "c"}


def gather(source: Path) -> None:
    """Write every page of the site that stands in the repository, and the listings that they link to."""
    listings: set[Path] = set()
    for path in sorted(DOCS.rglob("*.md")):
        name = path.relative_to(DOCS).as_posix()
        if name.removesuffix(".md") not in ELSEWHERE:
            _write(source, path, name, listings)
    for given, name in OTHERS.items():
        if given != "docs/index.md":
            _write(source, ROOT / given, name, listings)
    shutil.copytree(DOCS / "pictures", source / "pictures", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    for path in sorted(listings):
        _write_listing(source, path)
    _write_index(source)


def _write(source: Path, path: Path, name: str, listings: set[Path]) -> None:
    text = MARK.sub("", path.read_text(encoding="utf-8"))
    parts = FENCE.split(text)
    made = "".join(part if n % 2 else _linked(_anchored(part), path, name, listings) for n, part in enumerate(parts))
    if name in TITLES:
        made = re.sub(r"\A# .*", f"# {TITLES[name]}", made)
    if name.removesuffix(".md") not in SHOWN:
        made = ORPHAN + made
    place = source / name
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(made, encoding="utf-8")


def _anchored(text: str) -> str:
    """Make targets that Sphinx knows of the anchors that stand in the text."""
    return ANCHOR.sub(lambda found: f"[]{{#{_slug(found[1])}}}", text)


def _slug(anchor: str) -> str:
    """Return an anchor as Sphinx allows it: ``3.stop`` as ``clause-3-stop``."""
    made = anchor.lower().replace(".", "-")
    return f"clause-{made}" if made[0].isdigit() else made


def _fragment(path: Path, given: str | None) -> str:
    """Return the fragment of a link to `path`: of a heading as it is, of an anchor as the site has it."""
    anchors = ANCHOR.findall(path.read_text(encoding="utf-8")) if given and path.suffix == ".md" else []
    return f"#{_slug(given[1:])}" if given and given[1:] in anchors else given or ""


def _linked(text: str, path: Path, name: str, listings: set[Path]) -> str:
    def turned(found: re.Match[str]) -> str:
        target = (path.parent / found[1]).resolve()
        place = _place(target, listings)
        if place is None:
            raise SystemExit(f"{path.relative_to(ROOT)}: links to {found[1]}, which the site does not have")
        return f"]({os.path.relpath(place, Path(name).parent)}{_fragment(target, found[2])})"

    own = re.sub(r"\]\((#[^)]+)\)", lambda found: f"]({_fragment(path, found[1])})", text)
    return LINK.sub(turned, own)


def _place(target: Path, listings: set[Path]) -> str | None:
    """Return where the site has a file of the repository."""
    inside = target.relative_to(ROOT).as_posix()
    if inside in OTHERS:
        return OTHERS[inside]
    if target.is_relative_to(DOCS) and target.exists():
        return target.relative_to(DOCS).as_posix()
    if target.is_file():
        listings.add(target)
        return f"files/{inside}.md"
    return None


def _contents(names: tuple[str, ...], caption: str) -> str:
    pages = [f"{LABELS[name]} <{name}>" if name in LABELS else name for name in names]
    return "\n".join(["```{toctree}", ":maxdepth: 1", ":hidden:", f":caption: {caption}", "", *pages, "```", ""])


def _write_listing(source: Path, path: Path) -> None:
    inside = path.relative_to(ROOT).as_posix()
    place = source / "files" / f"{inside}.md"
    place.parent.mkdir(parents=True, exist_ok=True)
    language = "xml" if path.suffix in MARKUP else LANGUAGES.get(path.suffix, "text")
    text = path.read_text(encoding="utf-8")
    place.write_text(f"{ORPHAN}# `{inside}`\n\n````{language}\n{text.rstrip()}\n````\n", encoding="utf-8")


def _write_index(source: Path) -> None:
    """Write the first page: what the package is, how to begin, and the contents of the site."""
    text = MARK.sub("", Path(__file__).with_name("index.md").read_text(encoding="utf-8"))
    contents = "\n".join(_contents(names, heading) for heading, names in SECTIONS.items())
    (source / "index.md").write_text(f"{text}\n{contents}", encoding="utf-8")
