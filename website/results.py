"""The results of the shipped suites: `python website/results.py` runs them with the built-in controllers, for an hour.

The files of results stand in `website/results/`; the site's page is made of them, as `suite compare` makes one.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

from dubins_traffic.cli.main import main
from dubins_traffic.suites.results import WALL, open_sources
from dubins_traffic.suites.suite import load_suite
from dubins_traffic.suites.writing import PAGE, TABLE, results

HERE = Path(__file__).parent
KEPT = HERE / "results"
FRONT = "<!-- results -->"
"""Where the first page shows some of them."""
CONTROLLERS = ("lanes", "lanes+shield", "rules", "rules+shield", "simple", "simple+shield")
"""Who drives where a suite does not say: the built-in ones, with and without the shield."""
ASKED = {"adversary-2026": [word for name in CONTROLLERS for word in ("--controller", name)]}
SUITES = ("icra2016", "rules-2026", "towns-2026", "adversary-2026", "synthesis-2026")
HEAD = """# Results

This page shows how every built-in controller does, with and without the [shield](shield.md), on every shipped
[suite](suites.md), and how our solver does on the suite of games. To set results of yours beside these, run
`dubins-traffic suite run NAME --controller YOURS -o DIR`, and then `dubins-traffic suite compare`.

In the tables of controllers the best one stands first. Numbers in brackets are 95 % intervals. *Counted rounds* are
rounds through all goals in [trials that are clean](scores.md#what-ranks-controllers); *satisfied*, *violated*,
*excused* and *unfinished* are [verdicts](verdicts.md). The controller *ended* a trial if it raised, gave up, fell
silent or overran a limit; such a trial is never clean. A trial *came to nothing* if it could not be drawn or scored,
or killed its process. Times are of a wall clock, and depend on the machine; all other numbers are the same
wherever the suite is run.

`make results` makes the files. The controller `synthesized` is not here, since the games behind most trials are
too large for it.
"""


def kept(name: str) -> Path:
    """Return the file of results of a suite."""
    return KEPT / f"{load_suite(name).label}.json"


def write_results(page: Path, folder: Path) -> None:
    """Write the page of results, with a table for each suite, and a page with all numbers and plots for each."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = [HEAD]
    for name in SUITES:
        made = results(load_suite(name), open_sources([str(kept(name))]))
        (folder / f"{name}.html").write_text(made[PAGE], encoding="utf-8")
        file = kept(name).name
        shutil.copy(kept(name), folder / file)
        links = (
            f'<a href="results/{name}.html">All numbers and plots</a>, '
            f'<a href="results/{file}">the file of results</a>.'
        )
        parts += [f"#{made[TABLE]}", links, ""]
    page.write_text("\n".join(parts), encoding="utf-8")


def put_on_front(page: Path) -> None:
    """Put a table of the built-in controllers where the first page says so, best first in `rules-2026`."""
    files = {
        name: json.loads(kept(name).read_text(encoding="utf-8"))
        for name in ("rules-2026", "adversary-2026", "icra2016")
    }
    rules, adversary, icra = (
        {entry["controller"]: entry["columns"] for entry in file["entries"]} for file in files.values()
    )
    rows = [
        "| controller | counted rounds a trial, `rules-2026` | clean there | clean in `adversary-2026` | `icra2016` |",
        "|---|---|---|---|---|",
    ]
    for name in sorted(rules, key=lambda name: -sum(rules[name]["counted_rounds"])):
        own, worst = rules[name], adversary[name]
        mean = sum(own["counted_rounds"]) / len(own["counted_rounds"])
        score = sum(icra[name]["icra2016"]) / len(icra[name]["icra2016"])
        clean, held = (f"{sum(found['clean'])} of {len(found['clean'])}" for found in (own, worst))
        rows.append(f"| `{name}` | {mean:.2f} | {clean} | {held} | {score:.0f} |")
    text = page.read_text(encoding="utf-8")
    page.write_text(text.replace(FRONT, "\n".join(rows)), encoding="utf-8")


def run() -> int:
    """Run what is left of all suites in `build/results`, and keep the files of results; return the exit status."""
    for name in SUITES:
        folder = HERE.parent / "build" / "results" / name
        begun = ["--resume"] if folder.exists() else []
        if status := main(["suite", "run", name, "-o", str(folder), *ASKED.get(name, []), *begun]):
            return status
        for file in (kept(name).name, kept(name).name.replace(".json", WALL)):
            shutil.copy(folder / file, KEPT / file)
    return 0


if __name__ == "__main__":
    sys.exit(run())
