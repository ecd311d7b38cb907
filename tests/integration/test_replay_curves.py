"""The replay page in a real browser on roads that bend: they are paved, and the strokes between lanes go on evenly."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from selenium.webdriver.support.wait import WebDriverWait

from dubins_traffic.cli.main import main
from dubins_traffic.record.reader import read
from dubins_traffic.roads.network import RoadNetwork
from tests.browser import browsing
from tests.integration.test_gazebo_curves import CONFIGURATION
from tests.pages import press

pytestmark = pytest.mark.tools("browser")

COLOURS = """
const at = arguments[0], origin = JSON.parse(document.getElementById('data').textContent).origin;
const c = document.getElementById('map'), own = c.getContext('2d');
const data = own.getImageData(0, 0, c.width, c.height).data;
return at.map(([x, y]) => {
  const [px, py] = replay.at(x - origin[0], y - origin[1]).map(value => Math.floor(value * devicePixelRatio));
  const k = 4 * (py * c.width + px);
  return [data[k], data[k + 1], data[k + 2]];
});
"""
"""The colours at places of the world."""
ROAD, LINE = (0xCF, 0xD3, 0xD8), (0xFF, 0xFF, 0xFF)


def inner(network: RoadNetwork, s: int, offset: float) -> np.ndarray:
    """Return places beside the middle stretch of a segment, where no junction is near."""
    line = network.lane_curve(2 * s, offset, 1e-3)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    where = np.linspace(0.35, 0.65, 60) * along[-1]
    return np.stack([np.interp(where, along, line[:, k]) for k in (0, 1)], axis=-1)


def test_bends_are_paved_and_their_strokes_are_even(tmp_path: Path) -> None:
    (tmp_path / "own.json").write_text(json.dumps(CONFIGURATION | {"duration": 3}))
    out = tmp_path / "out"
    command = [
        "run",
        str(tmp_path / "own.json"),
        "--controller",
        "rules",
        "--trials",
        "1",
        "--records",
        str(out),
    ]
    assert main(command) == 0
    record = out / "trial-0000.mcap"
    assert main(["replay", str(record), "-o", str(tmp_path / "replay.html")]) == 0
    network = read(record).instance.problem.network
    with browsing(tmp_path / "profile") as browser:
        browser.get((tmp_path / "replay.html").as_uri())
        WebDriverWait(browser, 600).until(lambda driver: driver.execute_script("return window.replay?.ready === true"))
        press(browser, "l", "n", "t")
        bent = np.flatnonzero(network.bent).tolist()
        places = np.array([[inner(network, s, side) for side in (0.0, -0.5, 0.5)] for s in bent])
        colours = np.array(browser.execute_script(COLOURS, places.reshape(-1, 2).tolist()))
        assert browser.get_log("browser") == []
    found = colours.reshape(*places.shape[:3], 3)
    assert (found[:, 1:] == ROAD).all(axis=-1).mean() > 0.9
    # Strokes are 0.2 m, gaps 0.16 m; strokes that began with each chord would leave hardly a gap.
    white = found[:, 0].mean(axis=-1) > 0.5 * (np.mean(ROAD) + np.mean(LINE))
    assert white.mean() == pytest.approx(0.2 / 0.36, abs=0.15)
