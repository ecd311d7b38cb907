"""A real browser for tests of pages: headless Chromium, with the log of its console."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from selenium import webdriver

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync"
)
REASON = "needs chromium and chromedriver; scripts/system-packages.sh installs them"


def need_browser() -> None:
    """Skip the tests of a module on a user's machine without a browser."""
    if (CHROMIUM is None or DRIVER is None) and os.environ.get("CI") != "true":
        pytest.skip(REASON, allow_module_level=True)


@contextmanager
def browsing(
    profile: Path, width: int = 1280, height: int = 800, *, traffic: bool = False
) -> Iterator[webdriver.Chrome]:
    """Run a browser with a window of so many pixels; its profile is kept in a folder. `traffic`: logs requests, too."""
    if CHROMIUM is None or DRIVER is None:
        pytest.fail(REASON)
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS.split(), f"--window-size={width},{height}", f"--user-data-dir={profile}"):
        options.add_argument(flag)
    logs = {"browser": "ALL", **({"performance": "ALL"} if traffic else {})}
    options.set_capability("goog:loggingPrefs", logs)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    try:
        yield driver
    finally:
        driver.quit()
