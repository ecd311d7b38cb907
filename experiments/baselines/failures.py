"""What each method fails at, and when: found in what is stored of `rules-2026`, seen again in a record, and drawn."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any, Final

import dubins_traffic as dt
from dubins_traffic.controllers.registry import load
from dubins_traffic.falsification.case import sentence_of
from dubins_traffic.files import write_text
from dubins_traffic.record.reader import Record
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.verdict import EGO_NAME, EGO_RULES
from experiments.baselines.measuring import RESULTS, instances_of, stored
from experiments.baselines.methods import METHODS

SUITE: Final = "rules-2026"
COMMON: Final = "3.stop"
"""The rule that whoever does not know of stop lines breaks at each of them; what else it breaks says more."""
FILE: Final = RESULTS / "failures.json"
PICTURE: Final = Path(__file__).resolve().parents[2] / "docs" / "pictures" / "baselines-failures.svg"
SHOWN, TRAIL = 2.6, 6.0
"""How far around the ego a picture goes, metres, and for how long it shows where the ego came from, seconds."""


def typical(columns: dict[str, list[Any]]) -> tuple[str, int] | None:
    """Return the rule that is broken most, but for `COMMON`, and the first trial in which it is; None without any."""
    counts = {rule: sum(columns[rule]) for rule in EGO_RULES if rule != COMMON}
    rule = max(counts, key=lambda own: counts[own])
    return (rule, next(k for k, own in enumerate(columns[rule]) if own)) if counts[rule] else None


def seen_again(method: str, rule: str, trial: int, file: Path) -> tuple[Record, Any, str]:
    """Run a trial again; return its record, its first breach of a rule, and the sentence on it."""
    instance = instances_of(SUITE)[trial]
    spec = METHODS[method].drives(instance)
    result = run_trial(instance, load(spec), name=spec, record=file)
    verdict = result.score.verdict
    assert verdict is not None
    breach = next(own for own in verdict.violations if own.car == EGO_NAME and own.rule == rule)
    record = dt.load_record(file)
    return record, breach, sentence_of(record, result.score, breach)


def find() -> None:
    """Find the typical failure of each method, keep what it is, and draw them all."""
    import matplotlib as mpl

    mpl.use("svg")
    from matplotlib import pyplot

    mpl.rcParams["svg.hashsalt"] = "failures"
    mpl.rcParams["font.size"] = 7
    known, kept = stored(), dict[str, Any]()
    for name in METHODS:
        found = typical(known[name][SUITE]["alone"]["columns"])
        kept[name] = None if found is None else {"rule": found[0], "trial": found[1]}
    drawn = {name: own for name, own in kept.items() if own is not None}
    rows = -(-len(drawn) // 5)
    figure, fields = pyplot.subplots(rows, 5, figsize=(9.5, 2.1 * rows), layout="constrained")
    for field in fields.flat[len(drawn) :]:
        field.set_axis_off()
    with tempfile.TemporaryDirectory() as folder:
        for field, (name, own) in zip(fields.flat, drawn.items(), strict=False):
            record, breach, sentence = seen_again(name, own["rule"], own["trial"], Path(folder) / f"{name}.mcap")
            own |= {"time": breach.time, "says": sentence}
            draw(field, record, breach.tick)
            field.set_title(f"{METHODS[name].title.replace('`', '')}: {own['rule']}", fontsize=7)
    figure.savefig(PICTURE, metadata={"Date": None, "Creator": None})
    pyplot.close(figure)
    write_text(FILE, json.dumps(kept, indent=1) + "\n")


def draw(field: Any, record: Record, tick: int) -> None:
    """Draw the roads, the cars and the way of the ego up to a frame, about the ego."""
    from matplotlib.patches import Circle

    problem, frames = record.instance.problem, record.frames
    network, car = problem.network, problem.car
    for lane in range(0, network.lanes, 2):
        left, right = (network.lane_curve(lane, side * car.lane_width) for side in (1.0, -1.0))
        field.fill(*zip(*left, *right[::-1], strict=True), color="0.9", linewidth=0)
        field.plot(*network.lane_curve(lane, 0.0).T, color="0.6", linewidth=0.6, linestyle=(0, (4, 4)))
    for point in network.points:
        field.add_patch(Circle(point, problem.intersection_radius, fill=False, color="0.75", linewidth=0.6))
    reach = car.body.reach
    for n in range(frames.x.shape[1]):
        x, y, colour = frames.x[tick, n], frames.y[tick, n], "tab:blue" if n == 0 else "0.4"
        field.add_patch(Circle((x, y), reach, color=colour, linewidth=0))
        tip = x + 1.6 * reach * frames.c[tick, n], y + 1.6 * reach * frames.s[tick, n]
        field.plot((x, tip[0]), (y, tip[1]), color=colour, linewidth=1.2)
    first = max(0, tick - round(TRAIL * problem.rate))
    field.plot(frames.x[first : tick + 1, 0], frames.y[first : tick + 1, 0], color="tab:blue", linewidth=0.9)
    x, y = frames.x[tick, 0], frames.y[tick, 0]
    field.set_xlim(x - SHOWN, x + SHOWN)
    field.set_ylim(y - SHOWN, y + SHOWN)
    field.set_aspect("equal")
    field.set_xticks([])
    field.set_yticks([])
