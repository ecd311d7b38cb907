"""The site: it is built without a warning, asks nothing of other hosts, and its search works from a file."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from tests.browser import browsing, need_browser

ROOT = Path(__file__).parents[2]
FETCHES = {"link": "href", "script": "src", "img": "src", "iframe": "src", "source": "src", "object": "data"}
"""What a browser loads by itself."""


class Page(HTMLParser):
    """The anchors of a page, where its links lead, and what a browser loads with it."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attrs if value is not None}
        if "id" in given:
            self.anchors.add(given["id"])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in FETCHES and FETCHES[tag] in given:
            self.fetched.append(given[FETCHES[tag]])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "html"
    built = subprocess.run(
        [sys.executable, ROOT / "website" / "build.py", folder],
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
    assert built.returncode == 0, built.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    made = {path: Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")}
    assert len(made) > 100
    return made


def test_every_page_of_the_documentation_is_there(pages: dict[Path, Page], site: Path) -> None:
    there = {path.relative_to(site).with_suffix(".md").as_posix() for path in pages}
    wanted = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    assert wanted - there == {"package.md"}


def leads(path: Path, link: str) -> tuple[Path, str]:
    parts = urlsplit(link)
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    return target, unquote(parts.fragment)


def test_links_lead_somewhere(pages: dict[Path, Page]) -> None:
    broken: list[str] = []
    for path, page in pages.items():
        for link in page.links:
            if urlsplit(link).scheme:
                continue
            target, fragment = leads(path, link)
            there = target in pages or (target.is_file() and not fragment)
            if not there or (fragment and fragment not in pages[target].anchors):
                broken.append(f"{path.name}: {link}")
    assert broken == []


def test_nothing_is_fetched_from_another_host(pages: dict[Path, Page], site: Path) -> None:
    fetched = {link for page in pages.values() for link in page.fetched}
    assert len(fetched) > 5
    assert [link for link in fetched if urlsplit(link).netloc] == []
    for sheet in site.rglob("*.css"):
        assert re.findall(r"url\(['\"]?(?:https?:)?//", sheet.read_text(encoding="utf-8")) == []


def test_every_trial_of_the_gallery_has_a_page(pages: dict[Path, Page], site: Path) -> None:
    shown = {
        leads(site / "gallery.html", link)[0]
        for link in pages[site / "gallery.html"].links
        if "gallery/" in link
    }
    assert {path.resolve() for path in (site / "gallery").iterdir()} == shown
    assert len(shown) >= 19


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    need_browser()
    with browsing(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


def test_the_search_works_from_a_file(site: Path, browser: webdriver.Chrome) -> None:
    browser.get(f"{(site / 'search.html').as_uri()}?q=overtaking")
    WebDriverWait(browser, 300).until(
        lambda page: page.find_elements(By.CSS_SELECTOR, "#search-results a[href*='rules.html']")
    )
