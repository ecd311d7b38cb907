"""A season in a real browser: rehearsed, edited, announced, handed in, compared, closed, opened again, archived."""

from __future__ import annotations

import base64
import io
import subprocess
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from tests.browser import WAIT_S, browsing, login
from tests.services import (
    COMMAND,
    DRIVING,
    PASSWORD,
    STANDING,
    Service,
    competition_text,
    serving,
    shown_secret,
    wait_until,
)

pytestmark = pytest.mark.tools("browser")
ENDED = ".tag.done, .tag.finished"
FETCH = """
const [path, done] = arguments;
fetch(path).then(answer => answer.arrayBuffer()).then(data => {
  let text = ""; for (const byte of new Uint8Array(data)) text += String.fromCharCode(byte);
  done(btoa(text));
});
"""


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[webdriver.Chrome]:
    with browsing(tmp_path / "profile", height=900) as driver:
        yield driver


def button(browser: webdriver.Chrome, words: str) -> None:
    """Press the first button with these words, or this name for who can't see it, and wait for the next page."""
    path = f"//button[normalize-space()='{words}' or @aria-label='{words}']"
    pressed = browser.find_element(By.XPATH, path)
    pressed.click()
    WebDriverWait(browser, WAIT_S).until(lambda _: left(pressed))


def left(element: webdriver.remote.webelement.WebElement) -> bool:
    """Tell whether an element is of a page that has been left."""
    try:
        element.is_enabled()
    except Exception:
        return True
    return False


def write(browser: webdriver.Chrome, **fields: str) -> None:
    for name, value in fields.items():
        field = browser.find_element(By.ID, name.replace("__", "-"))
        field.clear()
        field.send_keys(value)


def fetched(browser: webdriver.Chrome, path: str) -> bytes:
    """Return what the browser gets at a path, as who is logged in."""
    return base64.b64decode(browser.execute_async_script(FETCH, path))


def shows(browser: webdriver.Chrome, text: str) -> None:
    assert text in browser.find_element(By.TAG_NAME, "body").text


def test_a_season_from_the_rehearsal_to_the_archive(browser: webdriver.Chrome, tmp_path: Path) -> None:
    (tmp_path / "short").mkdir()
    (tmp_path / "short/competition.toml").write_text(competition_text())
    rehearse = [*COMMAND, "competition", "rehearse", "short", "--trust-submissions", "--trials", "1"]
    ran = subprocess.run(
        [*rehearse, "--controller", "lanes"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=True,
    )
    assert "The season's load takes" in ran.stdout
    arguments = ("--competition", str(tmp_path / "short"), "--trust-submissions")
    with serving(tmp_path / "here", *arguments, settings="logins = 10000\n") as service:
        organiser = service.organiser()
        ann = service.person().join(organiser.invite(), "Ann", "Ants")
        service.person().join(shown_secret(ann.post("/team/invite", form="/team")), "Amy")
        at_the_desk(browser, service)
        number = handing_in(browser, service, tmp_path)
        site = closing(browser, service, number)
        said = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
        assert said == []
    with zipfile.ZipFile(io.BytesIO(site)) as packed:
        packed.extractall(tmp_path / "site")
    without_a_server(browser, tmp_path / "site/short")


def at_the_desk(browser: webdriver.Chrome, service: Service) -> None:
    """Edit texts, a page, a date and a quota; announce; add a baseline."""
    login(browser, service.url, "Olga", PASSWORD)
    browser.get(f"{service.url}/desk/c/short")
    browser.find_element(By.LINK_TEXT, "Edit").click()
    write(browser, title="Autumn", about="Drive *well*.")
    browser.find_element(By.XPATH, "//summary[text()='A new page']").click()
    write(browser, **{"new-page": "prizes", "new-text": "# A cup"})
    write(browser, **{"test-closes": "2038-01-01T00:00:00Z", "test-a_day": "9"})
    button(browser, "Save")
    shows(browser, "Organise Autumn")
    browser.find_element(By.XPATH, "//summary[text()='Announce something']").click()
    write(browser, title="Rain", text="Roads are *wet*.")
    button(browser, "Announce")
    shows(browser, "Roads are wet.")
    browser.find_element(By.LINK_TEXT, "Prizes").click()
    shows(browser, "A cup")
    browser.get(f"{service.url}/desk/c/short")
    Select(browser.find_element(By.CSS_SELECTOR, '[aria-label="Built-in controller for test"]')).select_by_visible_text(
        "lanes"
    )
    button(browser, "Add baseline to test")
    browser.get(f"{service.url}/desk/log")
    for words in (
        "title: A <b>short</b> season -> Autumn",
        "phases.test.quota.a_day: 3 -> 9",
        "baseline",
        "announce",
    ):
        shows(browser, words)


def handing_in(browser: webdriver.Chrome, service: Service, folder: Path) -> int:
    """Hand in twice, compare both, get one back, remove a member; return the number of the one to the test phase."""
    login(browser, service.url, "Ann", PASSWORD)
    numbers: list[int] = []
    for phase, text in (("practice", STANDING), ("practice", DRIVING), ("test", STANDING)):
        entry = folder / "controller.py"
        entry.write_text(text)
        browser.get(f"{service.url}/c/short/{phase}")
        browser.find_element(By.ID, "file").send_keys(str(entry))
        button(browser, "Submit")
        WebDriverWait(browser, WAIT_S).until(lambda _: browser.find_elements(By.CSS_SELECTOR, ENDED))
        numbers.append(int(browser.current_url.rpartition("/")[2]))
    browser.get(f"{service.url}/s/{numbers[1]}")
    Select(browser.find_element(By.ID, "other")).select_by_value(str(numbers[0]))
    button(browser, "Compare")
    shows(browser, f"Submission {numbers[1]} beside {numbers[0]}")
    maps = browser.find_elements(By.CSS_SELECTOR, ".small img")
    WebDriverWait(browser, WAIT_S).until(lambda _: all(int(one.get_property("naturalWidth")) for one in maps))
    assert len(maps) == 4
    assert fetched(browser, f"/s/{numbers[0]}/file").decode() == STANDING
    browser.get(f"{service.url}/c/short/practice")
    assert browser.find_element(By.CSS_SELECTOR, "svg.progress").is_displayed()
    browser.get(f"{service.url}/team")
    button(browser, "Remove Amy")
    button(browser, "Remove Amy")
    assert "Amy" not in browser.find_element(By.TAG_NAME, "main").text
    return numbers[2]


def closing(browser: webdriver.Chrome, service: Service, number: int) -> bytes:
    """Close, open again, close and reveal, each asked once; return the archive."""
    login(browser, service.url, "Olga", PASSWORD)
    wait_until(lambda: service.person().api("GET", "/status").json()["waiting"] == 0)
    desk = f"{service.url}/desk/c/short"
    for act in ("Close test", "Reopen test", "Close test", "Reveal test", "Close validation"):
        browser.get(desk)
        button(browser, act)
        shows(browser, f"{act}?")
        if act == "Reopen test":
            script = "document.getElementById('until').value = '2040-01-01T00:00'"
            browser.execute_script(script)
        wait_until(lambda act=act: done(browser, desk, act))
    path = "/competitions/short/phases/test/table"
    places = wait_until(lambda: service.person().api("GET", path).json())
    assert [place["place"] for place in places] == [1, None]
    browser.delete_all_cookies()
    browser.get(f"{service.url}/c/short")
    shows(browser, f"best of {places[0]['entry']}")
    assert browser.find_elements(By.CSS_SELECTOR, f'a.small[href^="/s/{number}/trials/"]')
    login(browser, service.url, "Olga", PASSWORD)
    browser.get(desk)
    link = browser.find_element(By.LINK_TEXT, "Static site")
    return fetched(browser, link.get_attribute("href") or "")


def done(browser: webdriver.Chrome, desk: str, act: str) -> bool:
    """Confirm an act; what is still judged keeps seeds from being revealed, so that it is tried again."""
    button(browser, act)
    if browser.current_url == desk:
        return True
    browser.back()
    return False


def without_a_server(browser: webdriver.Chrome, site: Path) -> None:
    """Read the archive from its files: places, news, seeds, and a replay that plays."""
    browser.get(f"{site.as_uri()}/index.html")
    shows(browser, "Autumn")
    shows(browser, "Roads are wet.")
    browser.find_element(By.LINK_TEXT, "test").click()
    shows(browser, "built-in lanes")
    assert browser.find_element(By.CSS_SELECTOR, "main").value_of_css_property("max-width") != "none"
    assert browser.find_element(By.LINK_TEXT, "revealed").is_displayed()
    browser.find_element(By.PARTIAL_LINK_TEXT, "best trial of Ants").click()
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.execute_script("return window.replay?.ready === true"))
