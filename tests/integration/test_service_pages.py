"""The pages of the service in a real browser: live, by keyboard, on a phone, in the dark, and under axe."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait

from tests.browser import WAIT_S, browsing, dark, faults, fill, login, sideways
from tests.services import CIRCLING, CRASHING, PASSWORD, STANDING, Service, competition_text, season

pytestmark = pytest.mark.tools("browser")

NASTY = "<img src=x onerror=window.broken=1>"
PHONE, DESKTOP = (390, 844), (1280, 900)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("pages")
    with season(folder) as running:
        yield running


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path_factory.mktemp("profile"), height=900) as driver:
        yield driver


def test_a_participant_from_the_invitation_to_the_replay(
    browser: webdriver.Chrome, service: Service, tmp_path: Path
) -> None:
    organiser = service.organiser()
    browser.delete_all_cookies()
    browser.get_log("browser")  # what pages of other tests said
    browser.set_window_size(*DESKTOP)
    browser.get(f"{service.url}/join?code={organiser.invite()}")
    fill(browser, name=NASTY, password=PASSWORD, team=f"{NASTY} team")
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.current_url == f"{service.url}/")
    browser.get(f"{service.url}/c/short/practice")
    entry = tmp_path / "controller.py"
    entry.write_text(STANDING)
    browser.find_element(By.ID, "file").send_keys(str(entry))
    browser.find_element(By.XPATH, "//button[text()='Submit']").click()
    WebDriverWait(browser, WAIT_S).until(lambda _: "/s/" in browser.current_url)
    browser.execute_script("window.same = true")
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.find_elements(By.CSS_SELECTOR, ".tag.done"))
    assert browser.execute_script("return window.same"), "the page was loaded anew; htmx should have changed it"
    browser.find_element(By.LINK_TEXT, "1").click()
    frame = WebDriverWait(browser, WAIT_S).until(lambda _: browser.find_element(By.CSS_SELECTOR, "iframe.replay"))
    assert frame.get_attribute("sandbox") == "allow-scripts"
    browser.switch_to.frame(frame)
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.execute_script("return window.replay?.ready === true"))
    with pytest.raises(Exception, match=r"(?i)cookie|denied|sandbox"):
        browser.execute_script("return document.cookie")
    browser.switch_to.default_content()
    shot(browser, "trial")
    assert browser.execute_script("return window.broken === undefined")
    assert NASTY in browser.find_element(By.TAG_NAME, "h1").text
    assert [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"] == []


def shot(browser: webdriver.Chrome, name: str) -> None:
    """Keep a picture of the page where DUBINS_TRAFFIC_SHOTS says, for people to look at."""
    place = os.environ.get("DUBINS_TRAFFIC_SHOTS")
    if place:
        browser.save_screenshot(f"{place}/{name}.png")


def test_every_page_is_fit_for_all(browser: webdriver.Chrome, service: Service) -> None:
    """No serious fault by axe in the light, in the dark and on a phone; nothing wider than it; no script in names."""
    organiser = service.organiser()
    person = service.person().join(organiser.invite(), "Ann", "Ants")
    number, other = (person.submit("short/practice", text) for text in (CRASHING, CIRCLING))
    for one in (number, other):
        person.ended(one)
    texts = {"title": "Rain", "text": "Roads are *wet*.\n\n|a|b|\n|-|-|\n|1|2|"}
    assert organiser.post("/desk/news/short", form="/desk/c/short", **texts).status_code == 303
    text = competition_text().replace("version = 0", 'version = 0\npages = {rules = "# Fair\\n\\n- play"}')
    files = {"files": ("competition.toml", text.encode())}
    assert organiser.post("/desk/file/short", form="/desk/edit/short", files=files).status_code == 303
    people = {
        "": (
            "/",
            "/login",
            "/join",
            "/reset",
            "/c/short",
            "/c/short/practice",
            "/c/short/practice/table",
            "/pages/short/rules",
            "/status",
            "/none",
        ),
        "Ann": (
            "/c/short",
            "/c/short/practice",
            f"/s/{other}",
            f"/s/{other}/beside?other={number}",
            f"/s/{number}/trials/0",
            "/team",
        ),
        "Olga": (
            "/c/short",
            "/desk",
            "/desk/c/short",
            "/desk/edit/short",
            "/desk/c/short/test/close",
            "/desk/s/1/disqualify?why=x",
            "/desk/log",
            "/status",
        ),
    }
    found: dict[str, list[str]] = {}
    for name, paths in people.items():
        browser.delete_all_cookies()
        if name:
            login(browser, service.url, name, PASSWORD)
        for path in paths:
            for size, night in ((DESKTOP, False), (DESKTOP, True), (PHONE, False)):
                browser.set_window_size(*size)
                dark(browser, night)
                browser.get(service.url + path)
                wrong = faults(browser)
                if sideways(browser) > 0:
                    wrong.append(f"wider than {size[0]} pixels")
                if wrong:
                    found[f"{path} {name} {size} {'dark' if night else 'light'}"] = wrong
                where = re.sub(r"[/?=]", "-", path.strip("/")) or "home"
                shot(browser, f"{name}-{where}-{size[0]}-{'dark' if night else 'light'}")
            assert browser.execute_script("return window.broken === undefined")
    dark(browser, False)
    assert found == {}


def test_the_keyboard_is_enough(browser: webdriver.Chrome, service: Service) -> None:
    """The first Tab leads past the navigation; forms are filled in and sent without a mouse."""
    service.organiser()
    browser.set_window_size(*DESKTOP)
    browser.delete_all_cookies()
    browser.get(f"{service.url}/login")
    body = browser.find_element(By.TAG_NAME, "body")
    body.send_keys(Keys.TAB)
    assert browser.switch_to.active_element.text == "Skip to content"
    browser.switch_to.active_element.send_keys(Keys.ENTER)
    assert browser.current_url.endswith("#main")
    browser.switch_to.active_element.send_keys(Keys.TAB)
    assert browser.switch_to.active_element.get_attribute("id") == "name"
    browser.switch_to.active_element.send_keys("Olga", Keys.TAB, PASSWORD, Keys.ENTER)
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.find_elements(By.LINK_TEXT, "Desk"))
