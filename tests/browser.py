"""A real browser for tests of pages: headless Chromium, with the log of its console, and what axe finds there."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from selenium import webdriver
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.wait import WebDriverWait

from tests.tools import need_programs

AXE = Path(__file__).parent / "vendor" / "axe.min.js"
WAIT_S = 600
"""How long a test waits for what a page must show."""
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)


def need() -> None:
    """Skip the test on a user's machine without a browser; under CI it fails."""
    need_programs("chromium", "chromedriver")


@contextmanager
def browsing(
    profile: Path, width: int = 1280, height: int = 800, *, traffic: bool = False
) -> Iterator[webdriver.Chrome]:
    """Run a browser with a window of so many pixels; its profile is kept in a folder. `traffic`: logs requests, too."""
    need()
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for flag in (*FLAGS.split(), f"--window-size={width},{height}", f"--user-data-dir={profile}"):
        options.add_argument(flag)
    logs = {"browser": "ALL", **({"performance": "ALL"} if traffic else {})}
    options.set_capability("goog:loggingPrefs", logs)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        yield driver
    finally:
        driver.quit()


def fill(browser: webdriver.Chrome, **fields: str) -> None:
    """Fill in fields by their ids, and send the form by the Enter key."""
    last = None
    for name, value in fields.items():
        last = browser.find_element(By.ID, name)
        last.clear()
        last.send_keys(value)
    assert last is not None
    last.send_keys(Keys.ENTER)


def login(browser: webdriver.Chrome, url: str, name: str, password: str) -> None:
    """Log in at the service of an address as nobody else."""
    browser.delete_all_cookies()
    browser.get(f"{url}/login")
    fill(browser, name=name, password=password)
    WebDriverWait(browser, WAIT_S).until(lambda _: browser.current_url == f"{url}/")


def faults(browser: webdriver.Chrome, *rules: str) -> list[str]:
    """Return what axe finds of the page that is serious, by all its rules or by those that are named."""
    browser.execute_script(f"if (!window.axe) {{ {AXE.read_text(encoding='utf-8')} }}")
    asked = {"iframes": False, **({"runOnly": rules} if rules else {})}
    found = browser.execute_async_script(
        "const [asked, done] = arguments; axe.run(asked).then(r => done(r.violations))", asked
    )
    return [
        f"{one['id']}: {one['nodes'][0]['html'][:200]}" for one in found if one["impact"] in ("serious", "critical")
    ]


def dark(browser: webdriver.Chrome, on: bool) -> None:
    """Let the browser say that its reader wants dark pages, or light ones."""
    features = [{"name": "prefers-color-scheme", "value": "dark" if on else "light"}]
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def widen(browser: webdriver.Chrome, width: int, height: int = 800) -> None:
    """Give the page so many pixels; below 600 as on a telephone."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)


def sideways(browser: webdriver.Chrome) -> int:
    """Return by how many pixels the page is wider than its window, once it has been drawn with its present size."""
    return browser.execute_async_script(
        "const done = arguments[0], root = document.documentElement;"
        "requestAnimationFrame(() => requestAnimationFrame(() => done(root.scrollWidth - root.clientWidth)))"
    )
