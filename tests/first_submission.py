"""From the commands of the page for organisers to the first place in the table, as people do it in a browser."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import sleep
from urllib.parse import urljoin

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from dubins_traffic.sandbox import available_layers
from tests.services import PASSWORD

PAGE = Path(__file__).parents[1] / "docs" / "competitions" / "organisers.md"
SECTION = "## A competition on the web"
WAIT_S = 600.0
"""How long one waits for what must happen, on however busy a machine."""
TEAM = "Ants"


def commands() -> tuple[list[str], list[str], list[str]]:
    """Return what the page says: how a competition file is made, how the service is installed, and how it is begun."""
    text = PAGE.read_text(encoding="utf-8")
    made = re.search(r"^dubins-traffic competition new \w+", text, re.MULTILINE)
    block = re.search(r"```bash\n(.*?)```", text.partition(SECTION)[2], re.DOTALL)
    assert made is not None
    assert block is not None
    install, serve = block[1].strip().splitlines()
    return shlex.split(made[0])[1:], shlex.split(install), shlex.split(serve)[1:]


@dataclass
class Served:
    """A service that has said where it is, and where the first organiser joins."""

    process: subprocess.Popen[str]
    url: str
    joining: str

    def end(self) -> None:
        """Tell it to end, and wait until it has."""
        self.process.terminate()
        self.process.communicate(timeout=WAIT_S)


def served(program: Sequence[str], folder: Path, around: Mapping[str, str]) -> Served:
    """Make a competition and begin the service as the page says, with `program` for its command."""
    new, _, serve = commands()
    environment = {**around, "PYTHONUNBUFFERED": "1"}
    subprocess.run([*program, *new], cwd=folder, env=environment, check=True, stdout=subprocess.DEVNULL)
    trust = ["--trust-submissions"] if available_layers().missing() else []
    with (folder / "service.log").open("w") as log:
        process = subprocess.Popen(
            [*program, *serve, "--port", "0", *trust],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
        )
    assert process.stdout is not None
    url = process.stdout.readline().strip().rpartition(" ")[2]
    joining = process.stdout.readline().strip().rpartition(" ")[2]
    assert joining.startswith(f"{url}/join?code="), (folder / "service.log").read_text()
    return Served(process, url, joining)


def first_place(browser: webdriver.Chrome, service: Served, entry: Path) -> str:
    """Join, invite a participant, hand in a file to the practice phase; return the row of its team in the table."""
    join(browser, service.joining, "Olga")
    browser.find_element(By.LINK_TEXT, "Desk").click()
    press(browser, "Invite")
    code = browser.find_element(By.ID, "secret").text
    browser.delete_all_cookies()
    join(browser, urljoin(service.url, f"/join?code={code}"), "Ann", TEAM)
    browser.find_element(By.LINK_TEXT, "My competition").click()
    browser.find_element(By.LINK_TEXT, "practice").click()
    browser.find_element(By.ID, "file").send_keys(str(entry))
    press(browser, "Submit")
    wait = WebDriverWait(browser, WAIT_S, poll_frequency=0.1)
    wait.until(lambda _: browser.find_elements(By.CSS_SELECTOR, ".tag.done, .tag.failed, .tag.rejected"))
    assert browser.find_elements(By.CSS_SELECTOR, ".tag.done"), browser.find_element(By.ID, "live").text
    browser.find_element(By.LINK_TEXT, "practice").click()
    browser.find_element(By.LINK_TEXT, "Table of places").click()
    while not browser.find_elements(By.XPATH, f"//th[text()='{TEAM}']"):
        sleep(0.1)
        browser.refresh()
    return browser.find_element(By.XPATH, f"//tr[th[text()='{TEAM}']]").text


def join(browser: webdriver.Chrome, address: str, name: str, team: str = "") -> None:
    """Open the address of an invitation, and choose a name and a password."""
    browser.get(address)
    for field, value in (("name", name), ("password", PASSWORD), ("team", team)):
        browser.find_element(By.ID, field).send_keys(value)
    press(browser, "Join")
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.find_elements(By.LINK_TEXT, name))


def press(browser: webdriver.Chrome, text: str) -> None:
    """Press a button, and wait for the page that follows."""
    button = browser.find_element(By.XPATH, f"//button[text()='{text}']")
    button.click()
    WebDriverWait(browser, WAIT_S).until(lambda _: is_gone(browser, button.id))


def is_gone(browser: webdriver.Chrome, number: str) -> bool:
    """Whether an element of a page before is on the present page no more."""
    return all(one.id != number for one in browser.find_elements(By.TAG_NAME, "button"))
