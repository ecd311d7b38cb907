"""The replay page in a real browser: it opens without errors, plays, scrubs, and obeys the keyboard."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait

import dubins_traffic as dt
from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer.marks import Mark
from dubins_traffic.viewer.replay import write_replay
from tests.browser import browsing, dark, faults, sideways, widen
from tests.pages import ask, element, has_colour, press
from tests.synthetic import ROUGH, driven, instance, obstacles_beside, verdict

pytestmark = pytest.mark.tools("browser")

FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1280,800"
)
NASTY = "</script><script>window.broken = true</script>"
PICTURE = "return document.getElementById('map').toDataURL()"


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture(scope="module")
def trial() -> tuple[Instance, Frames]:
    grid = RoadNetwork.grid(3, 4)
    return driven(instance(grid, 6, 30.0, names=(NASTY, "b", "c", "d", "e"), obstacles=obstacles_beside(grid)))


@pytest.fixture
def page(browser: webdriver.Chrome, trial: tuple[Instance, Frames], tmp_path: Path) -> Iterator[webdriver.Chrome]:
    """The page of `trial`, open; whatever a test does there must leave the browser's log empty."""
    tried, frames = trial
    path = tmp_path / "replay.html"
    marks = [Mark(9.0, "breach", "rule 2: ego", 0, (1.0, 1.0), since=4.0)]
    write_replay(path, tried, frames, Ending(End.DURATION, len(frames) - 1), {"rounds": 2}, marks)
    browser.set_window_size(1280, 800)
    browser.get(path.as_uri())
    WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
    yield browser
    assert browser.get_log("browser") == []


BREACHES = [
    (4.0, "b", "3.stop"), (9.0, "ego", "2.left"), (9.0, "c", "E4"), (12.0, "ego", "3.stop"), (12.0, "b", "E4"),
    (20.0, "d", "E5"),
]  # fmt: skip


@pytest.fixture
def judged(browser: webdriver.Chrome, trial: tuple[Instance, Frames], tmp_path: Path) -> Iterator[webdriver.Chrome]:
    """The page of `trial` with breaches, of which the first excuses the ego."""
    tried, frames = trial
    write_replay(tmp_path / "judged.html", tried, frames, None, verdict=verdict(tried, BREACHES, 0))
    browser.set_window_size(1280, 800)
    browser.get((tmp_path / "judged.html").as_uri())
    WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
    yield browser
    assert browser.get_log("browser") == []


def test_a_page_begins_at_the_second_that_it_is_told(
    browser: webdriver.Chrome, trial: tuple[Instance, Frames], tmp_path: Path
) -> None:
    tried, frames = trial
    write_replay(tmp_path / "late.html", tried, frames, None, at=12.5)
    browser.get((tmp_path / "late.html").as_uri())
    WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
    assert (ask(browser, "time"), ask(browser, "playing")) == (12.5, False)
    assert browser.get_log("browser") == []


def test_an_exported_notebook_plays_a_record(
    browser: webdriver.Chrome, trial: tuple[Instance, Frames], tmp_path: Path
) -> None:
    """Of nothing but what the record shows of itself: its picture changes as it plays, and nothing is loaded."""
    tried, frames = trial
    record = dt.Record(tried, frames, (frames,), Ending(End.DURATION, len(frames) - 1), "none", {})
    exported = tmp_path / "notebook.html"
    text = f"<!DOCTYPE html><html lang=en><title>Notebook</title><body>{record._repr_html_()}</body></html>"
    exported.write_text(text, encoding="utf-8")
    browser.get(exported.as_uri())
    browser.switch_to.frame(browser.find_element(By.TAG_NAME, "iframe"))
    WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
    before, begun = browser.execute_script(PICTURE), ask(browser, "time")
    element(browser, "play").click()
    WebDriverWait(browser, 600).until(lambda driver: ask(driver, "time") > begun + 0.5)
    assert browser.execute_script(PICTURE) != before
    assert browser.execute_script("return window.broken === undefined")
    browser.switch_to.default_content()
    assert browser.get_log("browser") == []


@pytest.mark.parametrize("on", [False, True])
def test_the_page_has_no_serious_fault_by_axe(page: webdriver.Chrome, on: bool) -> None:
    try:
        for width in (1280, 400):
            widen(page, width)
            dark(page, on)
            assert faults(page) == []
            assert sideways(page) <= 0
    finally:
        dark(page, False)
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


@pytest.mark.parametrize("width", [1280, 400])
def test_a_long_reason_of_an_end_is_shown_in_full_and_makes_the_page_no_wider(
    width: int, browser: webdriver.Chrome, trial: tuple[Instance, Frames], tmp_path: Path
) -> None:
    tried, frames = trial
    why = f"ValueError: {'no way to the goal, ' * 20}{'x' * 200}"
    write_replay(tmp_path / "long.html", tried, frames, Ending(End.CONTROLLER_FAULT, 9, why))
    try:
        widen(browser, width)
        browser.get((tmp_path / "long.html").as_uri())
        WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
        assert why in element(browser, "ending").text
        assert sideways(browser) <= 0
        whole = "const e = document.getElementById('ending'); return e.scrollWidth <= e.clientWidth"
        assert browser.execute_script(whole)
        assert element(browser, "play").rect["x"] + element(browser, "play").rect["width"] < width
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_opens_and_shows_the_trial(page: webdriver.Chrome, trial: tuple[Instance, Frames]) -> None:
    tried, _ = trial
    assert page.title.startswith("Trial 2 of seed 7")
    assert element(page, "ending").text == "End: duration"
    rows = page.find_elements(By.CSS_SELECTOR, "#cars tbody tr")
    assert [row.find_element(By.TAG_NAME, "span").text for row in rows] == list(tried.names)
    assert len(page.find_elements(By.CSS_SELECTOR, "#goals li")) == len(tried.problem.goals)
    assert "rule 2: ego" in element(page, "events").get_attribute("textContent")
    assert page.execute_script("return window.broken === undefined")
    colours = page.execute_script(
        "const c = document.getElementById('map');"
        "const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        "const seen = new Set(); for (let i = 0; i < d.length; i += 4) seen.add(d[i] << 16 | d[i+1] << 8 | d[i+2]);"
        "return seen.has(0x0072b2) && seen.has(0xcfd3d8) && seen.has(0xe69f00)"
    )
    assert colours is True


def test_plays_pauses_and_stops_at_the_end(page: webdriver.Chrome) -> None:
    before = page.execute_script(PICTURE)
    assert ask(page, "playing") is False
    element(page, "play").click()
    WebDriverWait(page, 600).until(lambda _: ask(page, "time") > 0.3)
    assert ask(page, "playing") is True
    assert float(element(page, "slider").get_property("value")) > 0.0
    element(page, "play").click()
    stopped = ask(page, "time")
    assert ask(page, "playing") is False
    assert page.execute_script(PICTURE) != before
    assert ask(page, "time") == stopped
    page.execute_script(
        "const s = document.getElementById('speed'); s.value = '16'; s.dispatchEvent(new Event('change'))"
    )
    page.execute_script("replay.seek(28); replay.play()")
    WebDriverWait(page, 600).until(lambda _: ask(page, "playing") is False)
    assert ask(page, "time") == 30.0
    assert ask(page, "frame") == 900


def test_scrubbing_draws_the_frame_of_that_time(page: webdriver.Chrome, trial: tuple[Instance, Frames]) -> None:
    _, frames = trial
    before = page.execute_script(PICTURE)
    slider = element(page, "slider")
    width = slider.size["width"]
    ActionChains(page).move_to_element_with_offset(slider, int(0.25 * width), 0).click().perform()
    frame = ask(page, "frame")
    assert frame == pytest.approx(0.75 * 900, abs=15)
    assert page.execute_script(PICTURE) != before
    origin = page.execute_script("return JSON.parse(document.getElementById('data').textContent).origin")
    for car in (0, 3):
        pose = ask(page, f"pose({car})")
        assert pose["x"] + origin[0] == pytest.approx(frames.x[frame, car], abs=0.02)
        assert pose["y"] + origin[1] == pytest.approx(frames.y[frame, car], abs=0.02)
    page.execute_script(
        "const s = document.getElementById('slider'); s.value = 10;s.dispatchEvent(new Event('input', {bubbles: true}))"
    )
    assert ask(page, "time") == pytest.approx(10.0)
    assert slider.get_attribute("aria-valuetext") == "10.00 s of 30.00 s"
    ask(page, "seek(99)")
    assert ask(page, "time") == 30.0


def test_between_frames_cars_move_evenly(page: webdriver.Chrome, trial: tuple[Instance, Frames]) -> None:
    _, frames = trial
    ask(page, "seek(100.5 / 30)")
    origin = page.execute_script("return JSON.parse(document.getElementById('data').textContent).origin")
    assert ask(page, "pose(1)")["x"] + origin[0] == pytest.approx(frames.x[100:102, 1].mean(), abs=1e-4)


def test_the_keyboard_does_it_all(page: webdriver.Chrome) -> None:
    press(page, Keys.SPACE)
    WebDriverWait(page, 600).until(lambda _: ask(page, "playing") and ask(page, "time") > 0)
    press(page, Keys.SPACE)
    assert ask(page, "playing") is False
    element(page, "play").click()
    press(page, Keys.SPACE)
    assert ask(page, "playing") is False
    press(page, Keys.HOME)
    press(page, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_LEFT)
    assert ask(page, "frame") == 2
    ActionChains(page).key_down(Keys.SHIFT).send_keys(Keys.ARROW_RIGHT).key_up(Keys.SHIFT).perform()
    assert ask(page, "time") == pytest.approx(1.0 + 2 / 30)
    press(page, Keys.END)
    assert ask(page, "frame") == 900
    for key, name in (("f", "follow"), ("t", "trails"), ("l", "labels"), ("n", "lanes"), ("r", "sensing")):
        before, picture = element(page, name).is_selected(), page.execute_script(PICTURE)
        press(page, key)
        assert element(page, name).is_selected() is not before
        assert page.execute_script(PICTURE) != picture, name
    press(page, ">")
    assert element(page, "speed").get_property("value") == "2"


def test_zooms_pans_and_fits(page: webdriver.Chrome) -> None:
    fitted = page.execute_script(PICTURE)
    element(page, "zoom-in").click()
    zoomed = page.execute_script(PICTURE)
    ActionChains(page).drag_and_drop_by_offset(element(page, "map"), 80, 40).perform()
    assert len({fitted, zoomed, page.execute_script(PICTURE)}) == 3
    element(page, "fit").click()
    assert page.execute_script(PICTURE) == fitted


def test_choosing_a_car_or_an_event_leads_there(page: webdriver.Chrome) -> None:
    page.find_elements(By.CSS_SELECTOR, "#cars tbody button")[2].click()
    assert element(page, "chosen").text == "b"
    assert all(label.text.startswith("b_") for label in page.find_elements(By.CSS_SELECTOR, "#current code"))
    press(page, Keys.ESCAPE)
    page.execute_script("[...document.querySelectorAll('#events .breach button')][0].click()")
    assert ask(page, "time") == pytest.approx(9.0)


def test_breaches_stand_on_the_map_in_two_colours_with_filters(judged: webdriver.Chrome) -> None:
    assert not has_colour(judged, "breach")
    assert not has_colour(judged, "others")
    ask(judged, "seek(4.5)")
    assert has_colour(judged, "others")
    assert not has_colour(judged, "breach")
    ask(judged, "seek(10)")
    assert has_colour(judged, "breach")
    element(judged, "filter-others").click()
    assert has_colour(judged, "breach")
    assert not has_colour(judged, "others")
    listed = [row.text for row in judged.find_elements(By.CSS_SELECTOR, "#events .breach span")]
    assert listed == ["ego breaks 2.left: reaches over the centre line",
                      "ego breaks 3.stop: enters a crossing without a stop"]  # fmt: skip
    assert {mark["group"] for mark in ask(judged, "shown")} >= {"breach"}
    press(judged, "o")
    assert element(judged, "filter-others").is_selected()
    element(judged, "filter-breach").click()
    assert not has_colour(judged, "breach")
    assert len(judged.find_elements(By.CSS_SELECTOR, "#events .breach")) == 4


def test_keys_and_buttons_lead_from_event_to_event(judged: webdriver.Chrome) -> None:
    element(judged, "filter-goal").click()
    if judged.find_elements(By.ID, "filter-contact"):
        element(judged, "filter-contact").click()
    element(judged, "filter-event").click()
    went: list[tuple[float, int]] = []
    for _ in BREACHES:
        press(judged, ".")
        went.append((ask(judged, "time"), ask(judged, "chosen")))
    names = ["ego", NASTY, "b", "c", "d", "e"]
    assert went == [(time, names.index(car)) for time, car, _ in BREACHES]
    press(judged, ".")
    assert ask(judged, "time") == 20.0
    press(judged, ",")
    assert (ask(judged, "time"), ask(judged, "mark.rule")) == (12.0, "E4")
    element(judged, "previous").click()
    assert (ask(judged, "time"), ask(judged, "mark.rule")) == (12.0, "3.stop")
    element(judged, "next").click()
    assert ask(judged, "mark.rule") == "E4"
    press(judged, "B")
    assert (ask(judged, "time"), ask(judged, "mark.rule"), ask(judged, "chosen")) == (12.0, "3.stop", 0)
    press(judged, "B")
    assert (ask(judged, "time"), ask(judged, "mark.rule")) == (9.0, "2.left")
    press(judged, Keys.HOME, "b", "b")
    assert ask(judged, "time") == 12.0


def test_what_excused_the_ego_is_said_and_shown(judged: webdriver.Chrome) -> None:
    assert element(judged, "verdict").text == "excused"
    why = element(judged, "why").text
    assert why == (
        "The ego broke 2.left at 9.00 s. It is excused by b, which broke 3.stop at 4.00 s near (1, 1) "
        "(enters a crossing without a stop); the ego sensed it."
    )
    element(judged, "excuse").click()
    assert (ask(judged, "time"), ask(judged, "chosen"), ask(judged, "mark.rule")) == (4.0, 2, "3.stop")
    press(judged, Keys.END, "x")
    assert ask(judged, "time") == 4.0
    (excused,) = judged.find_elements(By.CSS_SELECTOR, "#events em")
    assert excused.text == "excuses the ego"
    (here,) = judged.find_elements(By.CSS_SELECTOR, "#events li.here")
    assert "b breaks 3.stop" in here.text


def test_an_event_beyond_the_map_is_brought_onto_it(judged: webdriver.Chrome) -> None:
    for _ in range(8):
        element(judged, "zoom-in").click()
    ActionChains(judged).drag_and_drop_by_offset(element(judged, "map"), 300, -200).perform()
    assert not has_colour(judged, "others")
    press(judged, "x")
    ask(judged, "seek(5)")
    assert has_colour(judged, "others")


def test_the_legend_of_keys_names_every_key(judged: webdriver.Chrome) -> None:
    assert not element(judged, "keys").is_displayed()
    press(judged, "?")
    assert element(judged, "keys").is_displayed()
    keys = element(judged, "keys").text
    for word in (
        "previous, next event",
        "next, previous breach of the ego",
        "what excused the ego",
        "this legend",
    ):
        assert word in keys
    element(judged, "help").click()
    assert not element(judged, "keys").is_displayed()


def test_goals_bear_the_numbers_of_pictures(page: webdriver.Chrome, trial: tuple[Instance, Frames]) -> None:
    tried, _ = trial
    told = [item.text.split()[:2] for item in page.find_elements(By.CSS_SELECTOR, "#goals li")]
    assert told == [[str(n + 1), f"{x},{y}"] for n, (x, y) in enumerate(tried.problem.goals)]


BAR = """
const map = document.getElementById("map"), frame = map.getBoundingClientRect(), ratio = map.width / frame.width;
const faint = getComputedStyle(document.documentElement).getPropertyValue("--faint").trim();
const [red, green, blue] = [1, 3, 5].map((at) => parseInt(faint.slice(at, at + 2), 16));
const data = map.getContext("2d").getImageData(0, 0, map.width, map.height).data;
for (let y = map.height - 1; y > 0; y -= 1) {
  for (let x = map.width - 1, run = 0; x >= 0; x -= 1) {
    const k = 4 * (y * map.width + x);
    run = data[k] === red && data[k + 1] === green && data[k + 2] === blue ? run + 1 : 0;
    if (run >= 30 * ratio) {
      const box = document.getElementById("toggles").getBoundingClientRect();
      const [left, top] = [frame.left + x / ratio, frame.top + y / ratio];
      if (left > box.right || top < box.top) return true;
    }
  }
}
return false;"""
"""Whether 30 pixels in a row of the scale's colour, the lowest of all, lie beside or above the toggles."""


SHARPNESS = "const map = document.getElementById('map'); return map.width / map.getBoundingClientRect().width"


def show_at(page: webdriver.Chrome, size: dict[str, float]) -> None:
    """Show the page on such a screen, and wait until its map is drawn for that one's pixels."""
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    ratio = pytest.approx(size["deviceScaleFactor"], rel=0.01)
    WebDriverWait(page, 600).until(lambda _: page.execute_script(SHARPNESS) == ratio)


@pytest.mark.parametrize("width", [360, 400, 820, 1280])
def test_fits_any_width_in_light_and_dark(page: webdriver.Chrome, width: int) -> None:
    size = {"width": width, "height": 780, "deviceScaleFactor": 2, "mobile": width < 600}
    try:
        show_at(page, size)
        assert page.execute_script("return document.documentElement.scrollWidth") <= width
        assert element(page, "play").is_displayed()
        assert page.execute_script(
            "return ['next', 'play', 'previous', 'clock', 'speed'].every(id => {"
            "const box = document.getElementById(id); const r = box.getBoundingClientRect();"
            "return r.left >= 0 && r.right <= innerWidth && box.scrollWidth <= Math.ceil(r.width) })"
        )
        assert WebDriverWait(page, 600).until(lambda _: page.execute_script(BAR))
        light = page.execute_script(PICTURE)
        element(page, "theme").click()
        assert page.execute_script("return document.documentElement.dataset.theme") == "dark"
        assert page.execute_script(PICTURE) != light
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_is_drawn_anew_for_a_screen_of_other_pixels(page: webdriver.Chrome) -> None:
    try:
        for ratio in (1, 3, 2):
            show_at(page, {"width": 820, "height": 780, "deviceScaleFactor": ratio, "mobile": False})
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_single_frame_and_rectangles_open_too(browser: webdriver.Chrome, tmp_path: Path) -> None:
    tried, frames = driven(instance(ROUGH, 3, 0.0, rectangles=True, obstacles=obstacles_beside(ROUGH)))
    assert len(frames) == 1
    write_replay(tmp_path / "one.html", tried, frames, None)
    browser.get((tmp_path / "one.html").as_uri())
    assert ask(browser, "ready") is True
    element(browser, "play").click()
    assert ask(browser, "playing") is False
    assert element(browser, "ending").text == "The record was cut off"
    assert browser.get_log("browser") == []
