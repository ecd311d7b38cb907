"""The window of moving pictures in a real browser."""

from __future__ import annotations

from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
from selenium.webdriver.support.wait import WebDriverWait

from dubins_traffic.animation.live import LiveView, png
from tests.browser import browsing

pytestmark = pytest.mark.tools("browser")

COLOUR = """const c = document.createElement("canvas").getContext("2d");
c.drawImage(document.querySelector("img"), 0, 0); return Array.from(c.getImageData(3, 3, 1, 1).data)"""


def test_a_page_shows_each_picture_as_it_comes(tmp_path: Path) -> None:
    view = LiveView(opens=False)
    try:
        with browsing(tmp_path / "profile") as driver:
            driver.get(view.url)
            for number, grey in enumerate((40, 200, 90), start=1):
                view.show(np.full((50, 60, 3), grey, dtype=np.uint8))
                WebDriverWait(driver, 600).until(
                    lambda _, number=number: driver.execute_script("return document.body.dataset.shown") == str(number)
                )
                assert driver.execute_script(COLOUR) == [grey, grey, grey, 255]
            assert driver.get_log("browser") == []
    finally:
        view.close()


def test_others_are_told_that_there_is_no_such_page() -> None:
    view = LiveView(opens=False)
    try:
        with pytest.raises(HTTPError, match="404"):
            urlopen(view.url + "other")
        picture = np.zeros((20, 20, 3), dtype=np.uint8)
        view.show(picture)
        with urlopen(view.url + "newer/0") as answer:
            assert answer.headers["number"] == "1"
            assert answer.read() == png(picture)
    finally:
        view.close()
