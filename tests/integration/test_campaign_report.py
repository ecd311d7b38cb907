"""The report of a campaign: its numbers, its bytes, and its page in a real browser."""

from __future__ import annotations

import csv
import html
import json
import re
import statistics
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from pyarrow import parquet
from selenium import webdriver
from selenium.webdriver.common.by import By

from dubins_traffic.campaign import manifest
from dubins_traffic.campaign.columns import REPORTED, SCORES
from dubins_traffic.campaign.report.comparison import Comparison, compare
from dubins_traffic.campaign.report.conclusion import conclusion
from dubins_traffic.campaign.report.write import latex_table, page, write_report
from dubins_traffic.campaign.results import load_results
from dubins_traffic.campaign.run_campaign import run_campaign
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from tests.browser import browsing, dark, faults, widen
from tests.campaigns import campaign, written

TEN = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 2, "columns": 3}},
    "e-agents": [{"type": "lawful"}],
    "rules": True,
    "duration": 10.0,
    "formulas": {"goes on a road": "F on_road_ego", "stays": "G on_road_ego"},
}
CONTROLLERS = ["lanes", "simple", "simple+shield"]
MOST_SCREENS = 4
"""So long may the page be before anything on it is opened, in windows of 1280 by 800 pixels."""
DOCUMENT = campaign(
    name="<b>two & <i>two",
    controllers=CONTROLLERS,
    configurations=[{"name": "ten", "document": TEN}],
    trials=6,
    factors={"e_agents": [1, 3]},
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign that has been run, with its report."""
    place = tmp_path_factory.mktemp("campaign")
    run_campaign(written(place, DOCUMENT), place / "out", workers=2)
    write_report(place / "out", worst=1)
    return place / "out"


def rows(folder: Path) -> list[dict[str, Any]]:
    return parquet.read_table(folder / "results.parquet").to_pylist()


def sheet(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "report" / name).open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_means_medians_and_differences_are_those_of_the_table(folder: Path) -> None:
    own = {name: [row for row in rows(folder) if row["controller"] == name] for name in CONTROLLERS}
    for line in sheet(folder, "controllers.csv"):
        values = [float(row[line["metric"]]) for row in own[line["controller"]] if row[line["metric"]] is not None]
        assert int(line["count"]) == len(values)
        assert float(line["mean"]) == pytest.approx(statistics.fmean(values))
        assert float(line["median"]) == pytest.approx(statistics.median(values))
        assert float(line["mean_low"]) <= float(line["mean"]) <= float(line["mean_high"])
    for line in sheet(folder, "differences.csv"):
        metric = line["metric"]
        pairs = [
            float(one[metric]) - float(other[metric])
            for one in own[line["first"]]
            for other in own[line["second"]]
            if (one["cell"], one["trial"]) == (other["cell"], other["trial"]) and one[metric] is not None
        ]
        assert float(line["mean"]) == pytest.approx(statistics.fmean(pairs))
        assert int(line["first_larger"]) == sum(value > 0 for value in pairs)
    judged = [line for line in sheet(folder, "shares.csv") if line["of_what"] == "verdict"]
    for line in judged:
        verdicts = [row["verdict"] for row in own[line["controller"]]]
        assert (int(line["count"]), int(line["of"])) == (verdicts.count(line["which"]), 12)
    assert {line["which"] for line in judged} == {"satisfied", "violated", "excused", "unfinished"}
    for line in sheet(folder, "shares.csv"):
        mine = own[line["controller"]]
        if line["of_what"] == "clean":
            assert (int(line["count"]), int(line["of"])) == (sum(row["clean"] for row in mine), 12)
        if line["of_what"] == "excused":
            excused = [row["near"] for row in mine if row["verdict"] == "excused"]
            assert (int(line["count"]), int(line["of"])) == (sum(excused), len(excused))


@pytest.mark.path
def test_controllers_are_ranked_by_counted_rounds(folder: Path) -> None:
    found = rows(folder)
    for row in found:
        whole = row["clean"] and row["end"] == "duration"
        assert row["counted_rounds"] == (row["rounds"] if whole else 0)
    order = list(dict.fromkeys(line["controller"] for line in sheet(folder, "controllers.csv")))
    sums = [sum(row["counted_rounds"] for row in found if row["controller"] == name) for name in order]
    assert set(order) == set(CONTROLLERS)
    assert sums == sorted(sums, reverse=True)
    metrics = [line["metric"] for line in sheet(folder, "controllers.csv") if line["controller"] == order[0]]
    assert metrics[:2] == ["clean", "counted_rounds"]
    assert metrics[-1] == "icra2016"


def test_every_metric_of_a_score_is_compared(folder: Path) -> None:
    compared = {line["metric"] for line in sheet(folder, "controllers.csv")}
    parts = {"breaches.", "breaches_of_others."}
    numbers = {
        name
        for name, own in SCORES.items()
        if own.column.kind != "string" and not any(name.startswith(part) for part in parts)
    }
    assert compared == numbers - {"excuse_sensed", "near"}
    means = {(line["controller"], line["metric"]): float(line["mean"]) for line in sheet(folder, "controllers.csv")}
    assert means["lanes", "interventions"] == means["simple", "interventions"] == 0.0
    assert means["simple+shield", "interventions"] > 0.0


def test_formulas_are_told_as_shares(folder: Path) -> None:
    own = {name: [row for row in rows(folder) if row["controller"] == name] for name in CONTROLLERS}
    told = [line for line in sheet(folder, "shares.csv") if line["of_what"].startswith("formula ")]
    assert {line["of_what"] for line in told} == {"formula goes on a road", "formula stays"}
    for line in told:
        name = line["of_what"].removeprefix("formula ")
        held = [json.loads(row["formulas"])[name] for row in own[line["controller"]]]
        assert (int(line["count"]), int(line["of"])) == (held.count(line["which"]), 12)
        assert float(line["low"]) <= float(line["share"]) <= float(line["high"])
    text = (folder / "report" / "index.html").read_text()
    assert "goes on a road" in text
    assert "presumably false" in text


def test_the_same_folder_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    write_report(folder, tmp_path, worst=1)
    first = {path.relative_to(folder / "report"): path for path in (folder / "report").rglob("*.*")}
    assert {path.relative_to(tmp_path) for path in tmp_path.rglob("*.*")} == set(first)
    assert sum(path.parts[0] == "replays" for path in first) == 3
    for name, path in first.items():
        assert (tmp_path / name).read_bytes() == path.read_bytes(), name


@pytest.mark.tools("browser")
def test_the_page_in_a_browser(folder: Path, browser: webdriver.Chrome) -> None:
    browser.get((folder / "report" / "index.html").as_uri())
    assert browser.title == DOCUMENT["name"]
    assert browser.find_element(By.TAG_NAME, "h1").text == DOCUMENT["name"]
    assert browser.find_element(By.CSS_SELECTOR, ".conclusion").text == conclusion(compared(folder))
    high = browser.execute_script("return document.documentElement.scrollHeight")
    assert high <= MOST_SCREENS * 800
    open_all(browser)
    sizes = browser.execute_script("return [...document.images].map(image => image.naturalWidth)")
    assert len(sizes) > 10
    assert min(sizes) > 100
    width = browser.execute_script("return [document.body.scrollWidth, innerWidth]")
    assert width[0] <= width[1]
    links = [link.get_attribute("href") for link in browser.find_elements(By.LINK_TEXT, "replay")]
    assert len(links) == 3
    browser.get(str(links[0]))
    assert "Trial" in browser.title
    assert browser.get_log("browser") == []


@pytest.mark.tools("browser")
@pytest.mark.parametrize("width", [1280, 400])
def test_letters_of_charts_are_as_large_as_those_of_the_page(
    width: int, folder: Path, browser: webdriver.Chrome
) -> None:
    widen(browser, width)
    browser.get((folder / "report" / "index.html").as_uri())
    open_all(browser)
    sizes = browser.execute_script(
        "return [...new Set([...document.querySelectorAll('p, td, th, li, h3, code')]"
        ".map(e => getComputedStyle(e).fontSize))]"
    )
    assert sizes == ["14px"]
    charts = browser.execute_script(
        "return [...document.images].map(i => [i.clientWidth / i.naturalWidth, atob(i.currentSrc.split(',')[1])])"
    )
    assert len(charts) > 10
    for scale, svg in charts:
        assert scale == pytest.approx(1.0, abs=0.005)
        letters = {float(points) * 4 / 3 for points in re.findall(r"font(?:-size)?: (?:\w+ )?([\d.]+)px", svg)}
        assert letters == {14.0}


@pytest.mark.tools("browser")
@pytest.mark.parametrize("width", [1280, 400])
def test_no_words_of_a_chart_are_cut_off(width: int, folder: Path, browser: webdriver.Chrome) -> None:
    widen(browser, width)
    browser.get((folder / "report" / "index.html").as_uri())
    open_all(browser)
    charts = browser.execute_script("return [...document.images].map(image => image.currentSrc)")
    assert len(charts) > 10
    for chart in charts:
        browser.get(chart)
        words = browser.execute_script(
            "const room = document.documentElement.getBoundingClientRect().width;"
            "return [...document.querySelectorAll('text')].map(word => {"
            "  const {left, right} = word.getBoundingClientRect();"
            "  return [word.textContent, left >= 0 && right <= room];"
            "})"
        )
        assert len(words) > 3
        assert [text for text, is_whole in words if not is_whole] == []


@pytest.mark.tools("browser")
def test_the_page_is_dark_where_it_should_be_and_nothing_scrolls_sideways(
    folder: Path, browser: webdriver.Chrome
) -> None:
    for scheme, is_ground in (("dark", range(60)), ("light", range(200, 256))):
        dark(browser, scheme == "dark")
        browser.get((folder / "report" / "index.html").as_uri())
        open_all(browser)
        assert faults(browser) == []
        shot = browser.find_element(By.CSS_SELECTOR, "section img").screenshot_as_png
        pixels = np.asarray(Image.open(BytesIO(shot)).convert("L"))
        assert int(np.median(pixels[:3])) in is_ground
        assert abs(int(pixels.max()) - int(pixels.min())) > 150
        ink = browser.execute_script("return getComputedStyle(document.querySelector('td')).color")
        assert (sum(map(int, re.findall(r"\d+", ink)[:3])) > 384) == (scheme == "dark")
    widen(browser, 400)
    browser.get((folder / "report" / "index.html").as_uri())
    open_all(browser)
    wide = browser.execute_script(
        "return [...document.querySelectorAll('*')].filter(e => e.scrollWidth > e.clientWidth + 1 && e.clientWidth"
        " || e.getBoundingClientRect().right > 400.5).map(e => e.outerHTML.slice(0, 90))"
    )
    assert wide == []


def compared(folder: Path) -> Comparison:
    results = load_results(folder)
    return compare(results.campaign, results.table)


def open_all(browser: webdriver.Chrome) -> None:
    browser.execute_script("document.querySelectorAll('details').forEach(d => { d.open = true })")


def test_a_paper_gets_a_table_and_figures(folder: Path) -> None:
    made = folder / "report"
    assert (made / "table.tex").read_text() == latex_table(compared(folder))
    names = {path.name for path in (made / "figures").iterdir()}
    assert {"ranking.pdf", "verdicts.pdf", "faults.pdf", "formula-1.pdf", "formula-2.pdf"} <= names
    assert "rounds_before_breach-against-e_agents.pdf" in names
    for path in (made / "figures").iterdir():
        data = path.read_bytes()
        assert data.startswith(b"%PDF-")
        assert b"/Type3" not in data, "publishers want fonts that are no drawings"


def test_results_are_a_table_a_dict_and_a_picture(folder: Path) -> None:
    results = load_results(folder)
    assert len(results) == 36
    assert repr(results) == f"<CampaignResults {folder}: 36 of 36 trials of {', '.join(CONTROLLERS)}>"
    columns = results.asdict()
    assert [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)] == rows(folder)
    text = results._repr_html_()
    assert text.count("<svg") == 1
    assert all(name in text for name in CONTROLLERS)
    with pytest.raises(InputError, match="no campaign"):
        load_results(folder / "report")


def test_results_are_a_data_frame(folder: Path) -> None:
    pytest.importorskip("pandas")
    table = load_results(folder).to_pandas()
    assert table.shape == (36, len(rows(folder)[0]))
    assert list(table["controller"].unique()) == CONTROLLERS


def test_no_chart_shows_nothing_and_a_line_says_of_what(folder: Path) -> None:
    text = html.unescape((folder / "report" / "index.html").read_text())
    told = sheet(folder, "controllers.csv")
    silent = {line["metric"] for line in told} - {line["metric"] for line in told if float(line["mean"] or 0.0)}
    assert "collisions_among_others" in silent
    (note,) = re.findall(r"No chart of what is 0 or absent everywhere: (.*?)\.</p>", text)
    named = {metric.label for metric in REPORTED if metric.name in silent}
    assert set(note.split("; ")) == named
    charts = re.findall(r'<img alt="([^"]*) against e-agents"', text)
    assert set(charts) == {metric.heading for metric in REPORTED if metric.name not in silent}
    assert 'alt="Collisions by fault"' in text
    assert "the egos had none" not in text


def test_without_collisions_there_is_no_chart_of_faults(folder: Path) -> None:
    results = load_results(folder)
    comparison = compare(results.campaign, results.table)
    quiet = [replace(own, faults=dict.fromkeys(own.faults, 0)) for own in comparison.standings]
    known = manifest.read(folder)
    assert known is not None
    text = page(replace(comparison, standings=quiet), known, {})
    assert "No chart of collisions by fault: the egos had none." in text
    assert "Collisions by fault" not in text


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path / "profile") as driver:
        yield driver


def test_a_report_in_the_terminal(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["campaign", "report", str(folder), "-o", str(tmp_path / "r"), "--worst", "0", "--wall"]
    assert main([*words, "--all"]) == 0
    everything = capsys.readouterr().out
    assert "time to" in everything
    assert all(metric.label.split()[0] in everything for metric in compared(folder).metrics)
    assert main([*words, "--overwrite"]) == 0
    told = capsys.readouterr().out
    assert "36 of 36 trials" in told
    assert len(told.rstrip().split("\n")) <= 30
    assert max(len(line.rstrip()) for line in told.split("\n")[:-2]) <= 80
    assert conclusion(compared(folder)).split(":")[0] in told
    assert not (tmp_path / "r" / "replays").exists()


def test_the_terminal_names_the_worst_trials_and_how_to_replay_them(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["campaign", "report", str(folder), "-o", str(tmp_path / "r"), "--worst", "1", "--all"]) == 0
    told = capsys.readouterr().out
    commands = re.findall(r"^ +dubins-traffic (campaign replay \S+ \d+)$", told, re.MULTILINE)
    assert len(commands) == len(CONTROLLERS)
    by_number = {row["number"]: row for row in rows(folder)}
    assert {by_number[int(command.split()[-1])]["controller"] for command in commands} == set(CONTROLLERS)
    number = int(commands[0].split()[-1])
    row = by_number[number]
    factor = f"e-agents {row['factor.e_agents']}"
    name = f"{row['controller']}, ten, {factor}, trial {row['trial']} of seed {row['seed']}: "
    assert name in told
    page = tmp_path / "page.html"
    assert main([*commands[0].split(), "-o", str(page)]) == 0
    assert page.read_bytes() == (tmp_path / "r" / "replays" / f"trial-{number:09d}.html").read_bytes()
    assert main(["campaign", "replay", str(folder), "36"]) == 2
    assert "36 of 36 have" in capsys.readouterr().err


def test_a_folder_without_a_campaign(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no campaign; expected the folder of a campaign"):
        write_report(tmp_path)
