"""The site: it is built without a warning, asks nothing of other hosts, and its search works from a file."""

from __future__ import annotations

import json
import os
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

from dubins_traffic.campaign.report.statistics import share
from dubins_traffic.suites.suite import load_suite, shipped_suites
from tests.browser import browsing, dark, faults, sideways, widen

ROOT = Path(__file__).parents[2]
FETCHES = {"link": "href", "script": "src", "img": "src", "iframe": "src", "source": "src", "object": "data"}
"""What a browser loads by itself."""
MOST_IN_THE_SIDEBAR = 40
HEADINGS = ["Start", "The task", "Drive", "Evaluate", "Compete", "Reference"]


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


def test_the_sidebar_is_short_and_names_nothing_twice(site: Path) -> None:
    text = (site / "index.html").read_text(encoding="utf-8")
    bar = text.partition('<div class="sidebar-tree">')[2].partition("</aside>")[0]
    links = re.findall(r'<a class="[^"]*reference internal" href="([^"#]*)', bar)
    assert 30 < len(links) <= MOST_IN_THE_SIDEBAR
    assert len(set(links)) == len(links)
    assert [link for link in links if link.startswith("design/")] == []
    assert re.findall(r'<p class="caption"[^>]*><span class="caption-text">([^<]*)<', bar) == HEADINGS


def test_every_page_is_reached_from_the_first_one(pages: dict[Path, Page], site: Path) -> None:
    """By links: those that the sidebar leaves out, design notes and pages about the code, too."""
    first = site / "index.html"
    met, left = {first}, [first]
    while left:
        path = left.pop()
        found = {leads(path, link)[0] for link in pages[path].links if not urlsplit(link).scheme}
        left += (found & pages.keys()) - met
        met |= found & pages.keys()
    shown = {site / path.relative_to(ROOT / "docs").with_suffix(".html") for path in (ROOT / "docs").rglob("*.md")}
    assert shown - met == {site / "package.html"}


def test_words_are_those_that_were_written(site: Path) -> None:
    """Quotes of the tables can be copied, and fields of tuples say nothing that Python says by itself."""
    assert "\N{LEFT DOUBLE QUOTATION MARK}" not in (site / "documents.html").read_text(encoding="utf-8")
    told = (site / "reference" / "api" / "driving.html").read_text(encoding="utf-8")
    assert "yaw_rate" in told
    assert "Alias for field number" not in told


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
    shown = {leads(site / "gallery.html", link)[0] for link in pages[site / "gallery.html"].links if "gallery/" in link}
    assert {path.resolve() for path in (site / "gallery").iterdir()} == shown
    assert len(shown) >= 21


def rows_of(text: str, heading: str) -> dict[str, list[str]]:
    """Return the cells of the first table below a heading, by the first of each row."""
    part = text.partition(f'<section id="{heading}">')[2].partition("</table>")[0]
    lines = re.findall(r"<tr[^>]*>(.*?)</tr>", part, re.DOTALL)
    cells = [[re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", line)] for line in lines]
    return {line[0]: line[1:] for line in cells if line}


def test_the_numbers_of_the_results_are_those_of_the_files(site: Path) -> None:
    text = (site / "results.html").read_text(encoding="utf-8")
    for name in shipped_suites():
        suite = load_suite(name)
        file = json.loads((site / "results" / f"{suite.label}.json").read_text(encoding="utf-8"))
        assert file["hash"] == suite.hash
        assert (site / "results" / f"{name}.html").is_file()
        rows = rows_of(text, name)
        assert len(file.get("entries", [])) == (0 if suite.model.games else 6)
        for k, entry in enumerate(file.get("entries", [])):
            columns = entry["columns"]
            if suite.model.cases:
                assert rows["clean"][k].startswith(f"{sum(columns['clean'])} of 56 [")
                continue
            cells = rows[entry["controller"]]
            values = [float(value or 0) for value in columns[suite.model.metric]]
            assert cells[0] == str(len(values))
            assert cells[1].startswith(f"{sum(values) / len(values):.4g}")
            if name == "rules-2026":
                clean = share(sum(columns["clean"]), len(values))
                assert cells[4].startswith(f"{clean.share:.1%} [")
        if suite.model.games:
            assert {line[-2] for line in rows.values()} == {"right"}


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path_factory.mktemp("profile"), traffic=True) as driver:
        yield driver


@pytest.mark.tools("browser")
def test_the_search_works_from_a_file(site: Path, browser: webdriver.Chrome) -> None:
    browser.get(f"{(site / 'search.html').as_uri()}?q=overtaking")
    WebDriverWait(browser, 600).until(
        lambda page: page.find_elements(By.CSS_SELECTOR, "#search-results a[href*='rules.html']")
    )


@pytest.mark.parametrize(
    "name",
    ["index", "rules", "gallery", "results", "tutorials/first-controller", "reference/api/trials"],
)
@pytest.mark.tools("browser")
def test_a_page_asks_for_files_beside_it_alone(name: str, site: Path, browser: webdriver.Chrome) -> None:
    browser.get("about:blank")
    for kind in ("performance", "browser"):
        browser.get_log(kind)  # of pages before
    browser.get((site / f"{name}.html").as_uri())
    assert sideways(browser) <= 0
    events = [json.loads(line["message"])["message"] for line in browser.get_log("performance")]
    sent = [event["params"] for event in events if event["method"] == "Network.requestWillBeSent"]
    asked = [one["request"]["url"] for one in sent if not one["request"]["url"].startswith(("data:", "chrome:"))]
    assert len(asked) > 3
    assert [address for address in asked if not address.startswith(site.as_uri())] == []
    assert [said["message"] for said in browser.get_log("browser") if said["level"] == "SEVERE"] == []


WIDTHS = (1280, 400)
LOOKS = ("color-contrast", "scrollable-region-focusable")
"""The rules of axe that tell of the width and the theme of a page."""
EVERY = os.environ.get("DUBINS_TRAFFIC_PAGES") == "all"
"""Whether axe looks at each page both ways; else at one after the other, wide and light, and narrow and dark."""


@pytest.mark.long
@pytest.mark.tools("browser")
def test_every_page_can_be_read_at_both_widths_and_in_both_themes(
    pages: dict[Path, Page], browser: webdriver.Chrome
) -> None:
    """Nothing is wider than its page, and axe finds no serious fault: wide and light, and narrow and dark."""
    wrong: list[tuple[str, int, bool, list[str]]] = []
    for k, path in enumerate(sorted(pages)):
        browser.get(path.as_uri())
        for width in WIDTHS:
            widen(browser, width)
            if sideways(browser) > 0:
                wrong.append((path.name, width, False, ["wider than its page"]))
            is_dark = width == WIDTHS[1]
            if not EVERY and is_dark != (k % 2 == 1):
                continue
            dark(browser, is_dark)
            if found := faults(browser, *(LOOKS if is_dark and EVERY else ())):
                wrong.append((path.name, width, is_dark, found))
    assert wrong == []


@pytest.mark.tools("browser")
@pytest.mark.parametrize("name", ["task", "watch", "maps", "falsify"])
def test_words_in_pictures_are_large_enough_on_a_narrow_page(name: str, site: Path, browser: webdriver.Chrome) -> None:
    """A drawing is as large as it was drawn and moves sideways, and so is a picture of a page, up to 656 pixels."""
    widen(browser, WIDTHS[1])
    browser.get((site / f"{name}.html").as_uri())
    shown = browser.execute_script(
        "return [...document.querySelectorAll('article p > img')].map("
        "image => [image.clientWidth, Math.min(image.naturalWidth, 656), image.parentElement.tabIndex])"
    )
    assert len(shown) > 0
    assert [(wide, asked, keys) for wide, asked, keys in shown if wide < asked - 1 or keys] == []
