"""The page of the baselines, and its picture, made of what is stored."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any, Final

import numpy as np

from dubins_traffic.campaign.report.statistics import estimate, is_decided
from dubins_traffic.files import write_text
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.scoring.verdict import EGO_RULES
from experiments.baselines.failures import COMMON, SUITE
from experiments.baselines.failures import FILE as FAILURES
from experiments.baselines.measuring import SUITES, stored
from experiments.baselines.methods import METHODS
from experiments.baselines.ppo.seeds import CONFIG, TRIALS
from experiments.baselines.ppo.seeds import FILE as SEEDS

DOCS: Final = Path(__file__).resolve().parents[2] / "docs"
PICTURE: Final = DOCS / "pictures" / "baselines.svg"
MORE_COLOURS: Final = ("black", "navy", "maroon", "darkgreen", "gold")
"""After the ten of Matplotlib."""
WAYS: Final = {"alone": "", "shield": " + shield"}
HEAD: Final = """\
# Baselines

This page is for whoever wants to know how good known methods are at this task, before or beside a method of one's own.
Each drives trials of the ranked [suites](suites.md), alone and under the [shield](shield.md). All numbers are stored,
trial by trial, in `experiments/baselines/results`, and this page is made of them by
`python -m experiments.baselines --page`.

"""
FOOT: Final = """\
## Again

`python -m experiments.baselines orca --suites rules-2026` runs a method again and stores what comes of it; the folder
of a method says what it assumes and pins what it needs.
`python -m experiments.baselines orca --record rules-2026 4 it.mcap` writes the record of trial 4, and with `--shield`
that of the same under the shield, to be judged and [replayed](watch.md) as any other.

`make experiments` repeats all of it, with the learning of the cloned policy and of PPO, and before it every
[experiment](experiments.md): days on two processors, nearly all of them the searches of `falsify` and `contract`
(`python -m experiments` says how long each takes).
"""


def page() -> str:
    """Return the page."""
    known = stored()
    lines = [HEAD, "| method | what it does | it needs |", "|---|---|---|"]
    lines += [
        f"| {METHODS[name].title} | {METHODS[name].says} | {METHODS[name].needs or 'nothing'} |" for name in known
    ]
    lines += [
        "",
        "![Rounds before the first breach against breaches a trial, in each suite](pictures/baselines.svg)",
        "",
    ]
    for suite in SUITES:
        lines += [*_section(suite, known), ""]
    lines += [*_failures(), "", *_seeds(), ""]
    return "\n".join([*lines, FOOT])


def _failures() -> Iterator[str]:
    """Yield what each method fails at, alone."""
    yield "## What each fails at"
    yield ""
    yield (
        f"Alone, in `{SUITE}`: what it breaks most but for `{COMMON}`, which whoever knows no stop line breaks at each"
        " of them; where it does so first; and the trial K for `--record` ([below](#again))."
    )
    yield ""
    yield "![The ego (blue) of each method where it first breaks what it breaks most](pictures/baselines-failures.svg)"
    yield ""
    yield "| method | breaks most | K | first |"
    yield "|---|---|--:|---|"
    for name, own in json.loads(FAILURES.read_text(encoding="utf-8")).items():
        cells = ("nothing", "", "") if own is None else (f"`{own['rule']}`", str(own["trial"]), own["says"])
        yield f"| {METHODS[name].title} | {' | '.join(cells)} |"


def _seeds() -> Iterator[str]:
    """Yield what each seed of PPO has learned."""
    known = json.loads(SEEDS.read_text(encoding="utf-8"))
    yield "## PPO by seed"
    yield ""
    yield (
        f"{TRIALS} trials of `{CONFIG}` that were not trained on; counted rounds a trial, and before the first breach. "
        f"`rules` makes {_two(known['rules'])}."
    )
    yield ""
    yield "| learned | seed | alone | under the shield |"
    yield "|---|--:|--:|--:|"
    kinds = {"ppo": "alone", "shielded": "under the shield", "lagrangian": "alone, a multiplier on breaches"}
    for kind, words in kinds.items():
        for own in known[kind]:
            cells = [_two(own[way]) for way in ("alone", "shield")]
            yield f"| {words} | {own['seed']} | {' | '.join(cells)} |"


def _two(own: Mapping[str, float]) -> str:
    return f"{own['counted_rounds']:.2f}; {own['rounds_before_breach']:.2f}"


def _section(suite: str, known: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    entries = {name: own[suite] for name, own in known.items() if suite in own}
    trials = {len(own["alone"]["columns"]["end"]) for own in entries.values()}
    dates = sorted({own["date"] for own in entries.values()})
    rules = [rule for rule in EGO_RULES if rule != "1.collision"]
    judged = any(one is not None for own in entries.values() for one in own["alone"]["columns"]["1.road"])
    yield f"## {suite}"
    yield ""
    when = " to ".join(dict.fromkeys((dates[0], dates[-1])))
    yield f"{', '.join(map(str, sorted(trials)))} trials of each, {when}. {_says(entries)}"
    yield ""
    broken = [*rules] if judged else []
    head = ["method", "counted rounds", "before the first breach", "collisions", *broken, "ms a decision"]
    yield f"| {' | '.join(head)} |"
    yield f"|---|{'--:|' * (len(head) - 1)}"
    for name, own in entries.items():
        for way, words in WAYS.items():
            columns = own[way]["columns"]
            cells = [_mean(columns[key]) for key in ("counted_rounds", "rounds_before_breach", "collisions", *broken)]
            seconds = own[way]["seconds"]
            cells.append(f"{1e3 * seconds:.2g}" if seconds else "")
            yield f"| {METHODS[name].title}{words} | {' | '.join(cells)} |"


def _mean(values: Sequence[float | None]) -> str:
    return f"{fmean(value or 0.0 for value in values):.2f}"


def _says(entries: Mapping[str, Mapping[str, Any]]) -> str:
    """Return what the numbers of a suite come to, in sentences."""
    best = _best(entries)
    words = f"Most counted rounds: {', '.join(best[:3])}. {_ties(entries)}"
    idle = [METHODS[name].title for name, own in entries.items() if not any(own["alone"]["columns"]["counted_rounds"])]
    if idle:
        words += f" Alone without a counted round: {', '.join(idle)}."
    most: dict[str, list[str]] = {}
    for name, own in entries.items():
        columns = own["alone"]["columns"]
        each = {rule: sum(one or 0 for one in columns[rule]) for rule in EGO_RULES if rule != "1.collision"}
        worst = max(each, key=lambda rule: each[rule])
        if each[worst]:
            most.setdefault(worst, []).append(METHODS[name].title)
    if most:
        each_rule = (f"`{rule}` by {', '.join(names)}" for rule, names in most.items())
        words += f" What they break most, alone: {'; '.join(each_rule)}."
    return words


def _ties(entries: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a sentence on those that can't be told apart from the best: the interval of the difference holds 0."""
    rounds = _rounds(entries)
    able = sorted((name for name in rounds if rounds[name].any()), key=lambda own: -rounds[own].mean())
    if not able:
        return "All fail here: the suite tells no method from another."
    best, *others = able
    ends = {name: estimate(rounds[best] - rounds[name], median=False).mean_interval for name in others}
    ties = [name for name, interval in ends.items() if interval is None or not is_decided(interval)]
    if not ties:
        return f"{best} is told apart from each of the others."
    told = f"{len(others) - len(ties)} of {len(others)} others with counted rounds are told apart from {best}"
    weak = " So it hardly tells good methods apart." if 2 * len(ties) > len(others) else ""
    return f"{told}; {', '.join(ties)} {'are' if len(ties) > 1 else 'is'} not.{weak}"


def _best(entries: Mapping[str, Mapping[str, Any]]) -> list[str]:
    rounds = {name: own.mean() for name, own in _rounds(entries).items()}
    return [f"{name} ({rounds[name]:.2f})" for name in sorted(rounds, key=lambda own: -rounds[own])]


def _rounds(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Floats]:
    """Return the counted rounds of each method and way, trial by trial."""
    return {
        METHODS[name].title + words: np.array([one or 0.0 for one in own[way]["columns"]["counted_rounds"]])
        for name, own in entries.items()
        for way, words in WAYS.items()
    }


def breaches(columns: Mapping[str, Sequence[int | None]]) -> float:
    """Return how many breaches and collisions there are a trial."""
    each = [columns["collisions"], *(columns[rule] for rule in EGO_RULES if rule != "1.collision")]
    return sum(fmean(one or 0 for one in own) for own in each)


def draw() -> None:
    """Draw rounds before the first breach against breaches, a field a suite."""
    import matplotlib as mpl

    mpl.use("svg")
    from matplotlib import pyplot

    mpl.rcParams["svg.hashsalt"] = "baselines"
    mpl.rcParams["font.size"] = 8
    known = stored()
    figure, fields = pyplot.subplots(1, len(SUITES), figsize=(9.5, 3.6), layout="constrained")
    for field, suite in zip(fields, SUITES, strict=True):
        for k, (name, own) in enumerate(known.items()):
            if suite not in own:
                continue
            points = [
                (
                    breaches(own[suite][way]["columns"]),
                    fmean(own[suite][way]["columns"]["rounds_before_breach"]),
                )
                for way in WAYS
            ]
            colour = f"C{k}" if k < 10 else MORE_COLOURS[k - 10]
            field.plot(*zip(*points, strict=True), color=colour, linewidth=0.6, alpha=0.5)
            field.plot(*points[0], "o", color=colour, markersize=5, label=METHODS[name].title.replace("`", ""))
            field.plot(*points[1], "s", color=colour, markersize=5, markerfacecolor="none")
        field.set_xscale("symlog", linthresh=0.1)
        field.set_xlim(left=-0.02)
        field.set_ylim(bottom=-0.05)
        field.set_title(suite, fontsize=9)
        field.set_xlabel("breaches a trial")
    fields[0].set_ylabel("rounds before the first breach")
    figure.legend(*fields[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, frameon=False,
                  title="filled: alone; hollow: under the shield")  # fmt: skip
    figure.savefig(PICTURE, metadata={"Date": None, "Creator": None})
    pyplot.close(figure)


def write_page() -> None:
    """Write the page, and draw its picture."""
    draw()
    write_text(DOCS / "baselines.md", page())
