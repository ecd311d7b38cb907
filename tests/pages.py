"""A replay page open in a browser: what tests ask of it and do there."""

from __future__ import annotations

from typing import Any

from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement


def ask(page: webdriver.Chrome, what: str) -> Any:
    return page.execute_script(f"return window.replay.{what}")


def element(page: webdriver.Chrome, name: str) -> WebElement:
    return page.find_element(By.ID, name)


def press(page: webdriver.Chrome, *keys: str) -> None:
    ActionChains(page).send_keys(*keys).perform()


def has_colour(page: webdriver.Chrome, colour: str) -> bool:
    return page.execute_script(
        "const wanted = getComputedStyle(document.documentElement).getPropertyValue(arguments[0]).trim();"
        "const c = document.getElementById('map'), copy = new OffscreenCanvas(c.width, c.height);"
        "const own = copy.getContext('2d', {willReadFrequently: true}); own.drawImage(c, 0, 0);"
        "const d = own.getImageData(0, 0, c.width, c.height).data;"
        "for (let i = 0; i < d.length; i += 4) if ('#' + [d[i], d[i+1], d[i+2]].map(v => v.toString(16)"
        ".padStart(2, '0')).join('') === wanted) return true; return false",
        f"--{colour}",
    )
