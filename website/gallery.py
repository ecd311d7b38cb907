"""The gallery: a recorded trial for each rule and each way to fail, as replay pages."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import dubins_traffic as dt
from dubins_traffic.cli.main import main

DEADLINE = 0.5
"""Seconds that an answer may take where the case is about that."""
CASES = Path(__file__).with_name("gallery.json")
HEAD = """# Gallery

A trial for each rule that can be broken and each way a trial can end early. Every page stands alone: it asks
nothing of any host, and opens from a file. In it, `.` and `,` go from event to event, `x` to what excused the ego,
and `?` shows all keys.

"""


def write_gallery(page: Path, folder: Path) -> None:
    """Run the trials of the gallery, and write their replay pages and the page that links to them.

    Raises
    ------
    SystemExit
        If a trial does not show what its case says.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rows: list[str] = []
    for case in json.loads(CASES.read_text(encoding="utf-8")):
        name = f"{case['name']}.html"
        _replay(case, folder / name)
        rows.append(
            f'| <a href="gallery/{name}">{case["name"]}</a> | {case["says"]} | `{case["controller"]}` |'
        )
    table = ["| trial | what happens | controller |", "|---|---|---|", *rows, ""]
    page.write_text(HEAD + "\n".join(table), encoding="utf-8")


def _replay(case: dict[str, Any], page: Path) -> None:
    instance = dt.draw(_configuration(case["configuration"]), seed=case["seed"], trial=case["trial"])
    name = case["controller"]
    controller = f"{Path(__file__).parent / name}" if ":" in name else name
    deadline = DEADLINE if case["shows"] == "deadline" else None
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        result = dt.run_trial(instance, controller, record=record, deadline=deadline)
        if main(["replay", str(record), "-o", str(page)]):
            raise SystemExit(f"website/gallery.json: trial {case['name']} can't be replayed")
    if case["shows"] not in _shown(result, case["own"]):
        raise SystemExit(f"website/gallery.json: trial {case['name']} shows no {case['shows']}")


def _configuration(given: dict[str, Any]) -> dt.Configuration:
    """Return a shipped configuration with some fields changed."""
    place = resources.files("dubins_traffic.problem") / "configurations" / f"{given['base']}.json"
    return dt.load_config(json.loads(place.read_text(encoding="utf-8")) | given["changes"])


def _shown(result: dt.Result, own: bool) -> set[str]:
    """Return how a trial ended, its verdict, and the rules that the ego broke or the others did."""
    verdict = result.score.verdict
    if verdict is None:
        return {result.ending.end.value}
    broken = {found.rule for found in verdict.violations if (found.car == "ego") is own}
    return {result.ending.end.value, verdict.verdict.value} | broken
