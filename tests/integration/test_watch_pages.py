"""`watch` and `play` in a real browser: all ticks, as many pictures as an empty canvas, keys, pad, touch, and axe."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.support.wait import WebDriverWait

from dubins_traffic.cli.tables import summary
from dubins_traffic.live import playing
from dubins_traffic.live.playing import Standing
from dubins_traffic.live.stage import Stage
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.record import reader
from dubins_traffic.runs.single import Result
from tests.browser import browsing, dark, faults, sideways
from tests.driving import Eyes, KeyDriver
from tests.integration.test_watch import Program, running
from tests.pages import ask, element

pytestmark = pytest.mark.tools("browser")

WAIT_S = 600
SIZES = ((1280, 800), (400, 800))
SHARE = 0.9
"""Of the pictures of an empty canvas, those of a town at least."""
LOOK_S = 4
PACE = 0.5
"""Seconds of the trial in a second for the scripted driver: keys come late on a busy machine."""
EMPTY = """
const [seconds, done] = arguments;
document.body.innerHTML = '<canvas style="position:fixed;inset:0"></canvas>';
const canvas = document.querySelector('canvas'), context = canvas.getContext('2d');
Object.assign(canvas, {width: innerWidth, height: innerHeight});
let pictures = 0;
const began = performance.now();
function draw(now) {
  context.clearRect(0, 0, canvas.width, canvas.height);
  pictures += 1;
  if (now - began < 1000 * seconds) requestAnimationFrame(draw); else done(1000 * pictures / (now - began));
}
requestAnimationFrame(draw);
"""
TOWN = """
const [seconds, done] = arguments, before = replay.pictures, began = performance.now();
setTimeout(() => done(1000 * (replay.pictures - before) / (performance.now() - began)), 1000 * seconds);
"""
PAD = """
window.pad = {connected: true, axes: [0, -1], buttons: []};
navigator.getGamepads = () => [window.pad];
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path_factory.mktemp("profile")) as driver:
        driver.set_script_timeout(WAIT_S)
        yield driver


def until(browser: webdriver.Chrome, what: str) -> None:
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.execute_script(f"return {what}"))


def enter(browser: webdriver.Chrome, program: Program) -> None:
    """Open the address; the token is gone from it then, and the page's script has no cookie."""
    browser.set_window_size(1280, 800)
    browser.get(program.url.geturl())
    until(browser, "window.replay?.ready === true")
    assert browser.current_url == f"http://{program.url.netloc}/"
    assert browser.execute_script("return document.cookie") == ""
    (cookie,) = [own for own in browser.get_cookies() if own["name"] == f"dubins-traffic-{program.url.port}"]
    assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")


def key(browser: webdriver.Chrome, kind: str, code: str) -> None:
    browser.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": kind, "code": code, "key": code})


def check_fit(browser: webdriver.Chrome) -> None:
    """No serious fault by axe in either width and theme, and nothing wider than the page."""
    for width, height in SIZES:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        for theme in ("light", "dark"):
            dark(browser, theme == "dark")
            until(browser, f"document.documentElement.dataset.theme === '{theme}'")
            assert faults(browser) == [], (width, theme)
            assert sideways(browser) <= 0, (width, theme)
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_a_town_gets_as_many_pictures_as_an_empty_canvas_and_every_tick(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    arguments = ("watch", "town", "--controller", "rules", "--trials", "1")
    with running(tmp_path, *arguments) as program:
        enter(browser, program)
        until(browser, "replay.frames > 60")
        shares: list[float] = []
        for _ in range(10):  # both are measured while others use the machine, too
            browser.switch_to.new_window("tab")
            empty = browser.execute_async_script(EMPTY, LOOK_S)
            browser.close()
            browser.switch_to.window(browser.window_handles[0])
            shares.append(browser.execute_async_script(TOWN, LOOK_S) / empty)
            if shares[-1] >= SHARE:
                break
        assert max(shares) >= SHARE, shares
        assert browser.execute_script("return replay.live.ticks === replay.frames - 1")
        assert browser.execute_script("return replay.frames") > 30 * LOOK_S
        until(browser, "replay.time > replay.end - 1")  # it follows the newest
        check_fit(browser)
        assert browser.get_log("browser") == []


def test_trials_follow_one_another_and_the_page_keeps_the_last(browser: webdriver.Chrome, tmp_path: Path) -> None:
    with running(tmp_path, "watch", "short.json", "--controller", "simple") as program:
        enter(browser, program)
        until(
            browser,
            "replay.frames === 61 && document.getElementById('title').textContent === 'Trial 1 of seed 0'",
        )
        until(browser, "!replay.running")
        assert browser.execute_script("return replay.live.ticks") == 60
        assert program.end()[0] == 0
    assert element(browser, "ending").text == "End: duration"
    browser.execute_script("replay.seek(0.5)")
    assert ask(browser, "frame") == 15
    assert browser.get_log("browser") == []


def test_who_looks_back_stays_there_until_he_wants_to_see_the_newest(browser: webdriver.Chrome, tmp_path: Path) -> None:
    with running(tmp_path, "watch", "junction", "--trials", "1", "--pace", "4") as program:
        enter(browser, program)
        until(browser, "replay.frames > 120")
        browser.execute_script("replay.seek(1)")
        until(browser, "replay.frames > 300")
        assert ask(browser, "time") < ask(browser, "end") - 3
        element(browser, "now").click()
        until(browser, "replay.end - replay.time < 2")
        element(browser, "now").send_keys(" ")


def test_keys_pad_and_touch_drive_and_breaches_are_shown_at_once(browser: webdriver.Chrome, tmp_path: Path) -> None:
    with running(tmp_path, "play", "junction", "-o", "mine.mcap") as program:
        enter(browser, program)
        until(browser, "document.body.classList.contains('drives')")
        assert element(browser, "turn").text == "Stop at the line before the crossing"
        assert ask(browser, "frames") == 1
        check_fit(browser)
        key(browser, "keyDown", "KeyW")
        until(browser, "replay.pose(0).speed > 0.5")
        assert not element(browser, "start").is_displayed()
        until(browser, "!document.getElementById('breach').hidden")
        assert element(browser, "breach").get_property("textContent").startswith("You broke ")
        text = "ego breaks 3.stop: enters a crossing without a stop"
        until(browser, f"replay.shown.some((mark) => mark.text === '{text}')")
        key(browser, "keyUp", "KeyW")
        until(browser, "replay.pose(0).speed === 0")
        browser.execute_script(PAD)
        until(browser, "replay.pose(0).speed > 0.5")
        browser.execute_script("pad.axes[1] = 0")
        until(browser, "replay.pose(0).speed === 0")
        browser.execute_script("navigator.getGamepads = () => []")
        size = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True})
        touch(browser, "reverse", "touchStart")
        until(browser, "replay.pose(0).speed < -0.3")
        touch(browser, "reverse", "touchEnd")
        until(browser, "replay.pose(0).speed === 0")
        browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": False})
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.switch_to.new_window("tab")  # whoever comes later looks on
        browser.get(f"http://{program.url.netloc}/")
        until(browser, "window.replay?.frames > 1")
        said = "document.getElementById('role').textContent"  # what it is comes by a message of its own
        until(browser, f"{said} === 'Somebody else drives; you look on.'")
        browser.close()
        browser.switch_to.window(browser.window_handles[0])
        element(browser, "give-up").click()
        until(browser, "document.querySelectorAll('#places tbody tr').length === 4")
        assert element(browser, "verdict").text == "violated"
        assert element(browser, "place").text.startswith("You came ")
        check_fit(browser)
        assert program.end()[0] == 0
        assert browser.get_log("browser") == []
    assert reader.read(tmp_path / "mine.mcap").controller == "play"


def touch(browser: webdriver.Chrome, name: str, kind: str) -> None:
    middle = browser.execute_script(
        "const {x, y, width, height} = document.getElementById(arguments[0]).getBoundingClientRect();"
        "return {x: x + width / 2, y: y + height / 2}",
        name,
    )
    points = [middle] if kind == "touchStart" else []
    browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_a_page_that_is_loaded_again_goes_on_and_one_that_is_closed_ends_it(
    browser: webdriver.Chrome, tmp_path: Path
) -> None:
    with running(tmp_path, "play", "junction", "-o", "mine.mcap") as program:
        enter(browser, program)
        until(browser, "document.body.classList.contains('drives')")
        key(browser, "keyDown", "ArrowUp")
        until(browser, "replay.frames > 10")
        browser.refresh()
        until(browser, "document.body.classList.contains('drives')")
        frames = ask(browser, "frames")
        until(browser, f"replay.frames > {frames + 10}")
        browser.get("about:blank")
        status, _, told = program.end()
    assert status == 1
    assert told.splitlines()[-2:] == [
        "dubins-traffic: the page was closed: the trial is interrupted",
        "mine.mcap",
    ]
    ending = reader.read(tmp_path / "mine.mcap").ending
    assert ending is not None
    assert ending.end.value == "interrupted"


def test_a_scripted_driver_makes_a_clean_lap_by_key_presses_alone(browser: webdriver.Chrome, tmp_path: Path) -> None:
    instance = replace(draw(load_config("junction"), 0, 0), duration=70.0)
    laps: list[int] = []
    for attempt in range(3):  # on a busy machine a key may come late
        result, standings = driven(browser, instance, tmp_path / f"{attempt}.mcap")
        laps.append(result.score.counted_rounds)
        assert standings[0].score.controller == "rules"
        assert element(browser, "place").text.startswith("You came ")
        if laps[-1]:
            assert element(browser, "verdict").text in ("satisfied", "unfinished")
            assert "You came second of four" in element(browser, "place").text
            break
    assert max(laps) >= 1, laps
    assert browser.get_log("browser") == []


def driven(browser: webdriver.Chrome, instance: Any, record: Path) -> tuple[Result, list[Standing]]:
    """Play a trial in this process, so that the driver sees what the ego does; what he does are keys in the browser."""
    told: list[str] = []
    with Stage(told.append, opens=False, pace=PACE, plays=True) as stage:
        eyes: Any = Eyes(stage.feed)
        stage.feed = eyes
        driver = KeyDriver(browser, eyes, instance)

        def sit_down() -> None:
            while not told:
                time.sleep(0.05)
            browser.get(told[0].split(" at ")[1])
            driver.start()

        Thread(target=sit_down, daemon=True).start()
        try:
            return playing.play(stage, instance, summary, record)
        finally:
            driver.over.set()
            driver.join(WAIT_S)


def test_messages_of_the_page_are_as_few_as_its_changes(browser: webdriver.Chrome, tmp_path: Path) -> None:
    with running(tmp_path, "play", "short.json", "--pace", "0.2") as program:
        enter(browser, program)
        until(browser, "document.body.classList.contains('drives')")
        browser.execute_script(
            "window.sent = []; const send = WebSocket.prototype.send;"
            "WebSocket.prototype.send = function (text) { sent.push(text); send.call(this, text); }"
        )
        for kind in ("keyDown", "keyDown", "keyDown", "keyUp"):
            key(browser, kind, "ArrowUp")
        sent = [json.loads(text) for text in browser.execute_script("return sent")]
        assert sent == [{"drive": [1, 0]}, {"drive": [0, 0]}]
