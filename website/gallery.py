"""The gallery: a recorded trial for each rule and each way to fail, as replay pages."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.scoring.verdict import assumption_of

DEADLINE = 0.5
"""Seconds that an answer may take where the case is about that."""
BEFORE, AFTER = 8.0, 4.0
"""Seconds that a thumbnail shows before a breach, and after it."""
PIXELS, WIDTH = 320, 200
"""Pixels of the longer side of a thumbnail, and the width in which the page shows it."""
CASES = Path(__file__).with_name("gallery.json")
HEAD = """# Gallery

A trial that you can play, for each [rule of the road](rules.md) that can be broken, each part of the
[assumption](task.md#the-assumption-phi_env) on the other cars (E1 to E6), and each way in which a controller can
end a trial early. In a replay, space plays and pauses, `.` and `,` go from event to event, `x` goes to what excused
the ego, and `?` shows all keys. Each page stands alone: it asks nothing of any host, and opens from a file. The small
pictures play the seconds about what the page shows, twice as fast.
`dubins-traffic replay` makes such a page, or such a picture, of any record of yours.
"""


def write_gallery(page: Path, folder: Path) -> None:
    """Run the trials of the gallery, and write their replay pages and the page that links to them.

    Raises
    ------
    SystemExit
        If a trial does not show what its case says.
    """
    thumbnails = folder.with_name("thumbnails")
    for place in (folder, thumbnails):
        place.mkdir(parents=True, exist_ok=True)
    rows: list[str] = []
    for case in json.loads(CASES.read_text(encoding="utf-8")):
        name = f"{case['name']}.html"
        thumbnail = f"{case['name']}.png"
        _replay(case, folder / name, thumbnails / thumbnail)
        picture = f'<img src="thumbnails/{thumbnail}" alt="" width="{WIDTH}" loading="lazy">'
        rows.append(
            f'| <a href="gallery/{name}">{picture}<br>{case["name"]}</a> | {case["says"]} | `{case["controller"]}` |'
        )
    table = ["| trial | what happens | controller |", "|---|---|---|", *rows, ""]
    page.write_text("\n".join([HEAD, *table]), encoding="utf-8")


def _replay(case: dict[str, Any], page: Path, thumbnail: Path) -> None:
    """Write the page that replays a trial, and the moving picture of the seconds in which it shows what it shows."""
    instance = dt.draw(_configuration(case["configuration"]), seed=case["seed"], trial=case["trial"])
    name = case["controller"]
    controller = f"{Path(__file__).parent / name}" if ":" in name else name
    deadline = DEADLINE if case["shows"] == "deadline" else None
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        result = dt.run_trial(instance, controller, record=record, deadline=deadline)
        if main(["replay", str(record), "-o", str(page), "--overwrite"]):
            raise SystemExit(f"website/gallery.json: trial {case['name']} can't be replayed")
        _draw(dt.load_record(record), result, case, thumbnail)
    if case["shows"] not in _shown(result, case["own"]):
        raise SystemExit(f"website/gallery.json: trial {case['name']} shows no {case['shows']}")


def _draw(record: dt.Record, result: dt.Result, case: dict[str, Any], thumbnail: Path) -> None:
    """Write a moving picture of the seconds about the first breach that a trial shows, or of its last ones."""
    verdict, last = result.score.verdict, float(record.frames.time[-1])
    violations = () if verdict is None else verdict.violations
    times = [
        found.time
        for found in violations
        if (found.car == "ego") is case["own"] and case["shows"] in (found.rule, assumption_of(found.rule))
    ]
    stop = min(last, times[0] + AFTER) if times else last
    start = max(0.0, stop - AFTER - BEFORE)
    moving = dt.animate(record, start=start, stop=stop, speed=2.0, fps=8.0, size=PIXELS, verdict=verdict)
    moving.write(thumbnail, overwrite=True)


def _configuration(given: dict[str, Any]) -> dt.Configuration:
    """Return a shipped configuration with some fields changed."""
    place = resources.files("dubins_traffic.problem") / "configurations" / f"{given['base']}.json"
    return dt.load_config(json.loads(place.read_text(encoding="utf-8")) | given["changes"])


def _shown(result: dt.Result, own: bool) -> set[str]:
    """Return how a trial ended, its verdict, and the rules that the ego broke, or the parts of the assumption."""
    verdict = result.score.verdict
    if verdict is None:
        return {result.ending.end.value}
    broken = {found.rule for found in verdict.violations if (found.car == "ego") is own}
    if not own:
        broken = {name for rule in broken for name in (assumption_of(rule), rule) if name.startswith("E")}
    return {result.ending.end.value, verdict.verdict.value} | broken
