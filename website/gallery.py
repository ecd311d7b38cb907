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
CASES = Path(__file__).with_name("gallery.json")
HEAD = """# Gallery

A trial that you can play, for each [rule of the road](rules.md) that can be broken, each part of the
[assumption](task.md#the-assumption-phi_env) on the other cars (E1 to E6), and each way in which a controller can
end a trial early. In a replay, space plays and pauses, `.` and `,` go from event to event, `x` goes to what excused
the ego, and `?` shows all keys. Each page stands alone: it asks nothing of any host, and opens from a file.
`dubins-traffic replay` makes such a page of any record of yours.
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
    page.write_text("\n".join([HEAD, *table]), encoding="utf-8")


def _replay(case: dict[str, Any], page: Path) -> None:
    instance = dt.draw(_configuration(case["configuration"]), seed=case["seed"], trial=case["trial"])
    name = case["controller"]
    controller = f"{Path(__file__).parent / name}" if ":" in name else name
    deadline = DEADLINE if case["shows"] == "deadline" else None
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        result = dt.run_trial(instance, controller, record=record, deadline=deadline)
        if main(["replay", str(record), "-o", str(page), "--overwrite"]):
            raise SystemExit(f"website/gallery.json: trial {case['name']} can't be replayed")
    if case["shows"] not in _shown(result, case["own"]):
        raise SystemExit(f"website/gallery.json: trial {case['name']} shows no {case['shows']}")


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
