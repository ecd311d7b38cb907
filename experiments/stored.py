"""What the experiments have shown: a JSON file each, and the page that is made of them."""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from benchmarks.table import Row, machine
from tests.architecture.buildings import CORE, town

from dubins_traffic.files import write_text
from dubins_traffic.release import PACKAGE

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "experiments" / "results"
PAGE = ROOT / "docs" / "experiments.md"


def code(*files: Path) -> str:
    """Return a digest of the sources on which trials and their judgement rest, and of other files of an experiment.

    These are the package's core and searches; so an experiment of hours goes on when only a page of the service or a
    transport has changed since.
    """
    digest = hashlib.sha256()
    rooms = [PACKAGE / room for room in town().rooms(CORE)]
    folders = [*rooms, PACKAGE / "falsification"]
    for path in sorted(path for folder in folders for path in (*folder.rglob("*.py"), folder.with_suffix(".py"))):
        if path.exists():
            digest.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + path.read_bytes())
    for path in files:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Claim:
    """What an experiment is to show, the page that claims it, and how long the experiment takes on two processors."""

    says: str
    page: str
    takes: str


CLAIMS: Mapping[str, Claim] = {
    "rules": Claim(
        "`rules` is clean, waits for nobody without end and makes its rounds among `lawful` cars, a `nemesis`, and "
        "cars that break every rule",
        "task.md",
        "some minutes",
    ),
    "lanes": Claim("`lanes` makes the rounds of free flow, alone and among wandering cars", "task.md", "some minutes"),
    "odd_egos": Claim(
        "no ego that is clean, however odd, brings a car that keeps the law to a breach of E1 to E6",
        "theory.md#on-the-road",
        "some minutes",
    ),
    "towns": Claim(
        "`rules` drives the two largest towns of SUMO clean among `lawful` cars, which break nothing either; on ten "
        "maps it makes counted rounds where goals are within reach",
        "maps.md",
        "some minutes",
    ),
    "former": Claim(
        "`rules` is clean on the instances of edition 2, judged by edition 3, and makes as many rounds",
        "rules.md#why",
        "two minutes",
    ),
    "shield": Claim(
        "under the shield no controller breaks rules 1 to 3, whatever it asks for, on roads that bend, too",
        "shield.md#evidence",
        "a quarter of an hour",
    ),
    "synthesis": Claim(
        "the game of cells has the known winners and sizes, and omega with dd finds the same",
        "theory.md",
        "some minutes",
    ),
    "solvers": Claim(
        "TuLiP, omega and Spot find our winners in the smallest games of `synthesis-2026`, where they end in a minute",
        "foreign-strategies.md",
        "half an hour",
    ),
    "synthesized": Claim(
        "on the road `synthesized` visits its goals again and again and breaks nothing",
        "theory.md#a-strategy-on-the-road",
        "half an hour",
    ),
    "related": Claim(
        "each trial on the road is a play of the game, up to the first breach of a rule",
        "theory.md#the-game-and-the-road",
        "some minutes",
    ),
    "disturbed": Claim(
        "`rules`, the shield and `lawful` cars keep the rules with commands up to three ticks late and 5 mm of noise",
        "shield.md#what-it-does-not-promise",
        "some minutes",
    ),
    "robustness": Claim(
        "with commands that come up to three ticks late or get lost and poses that are noisy by up to 20 mm, how many "
        "trials of `rules`, of `lanes+shield` and of `lawful` cars stay clean",
        "attach.md",
        "some minutes",
    ),
    "outside": Claim(
        "cars of worlds outside, over ROS 1 and ROS 2, with late and lost commands and noisy poses, are driven "
        "without a breach, or the verdict says that it can't be told; a delay that is not declared is said",
        "external-worlds.md#checked",
        "half an hour, in real time, with ROS 1 and rclpy installed",
    ),
    "counter": Claim(
        "under an assumption that is too weak, a team of `counter` cars keeps the ego from a goal",
        "theory.md#a-counterstrategy-on-the-road",
        "some minutes",
    ),
    "adversaries": Claim(
        "adversaries that have learned keep E1 and E2 under their shield, and take more than a fifth of the rounds "
        "of `lanes`",
        "learning-agents.md",
        "half an hour",
    ),
    "excuses": Claim(
        "how much of what an ego breaks among learners is forgiven, for the rest of an episode and in a window",
        "learning-agents.md#who-pays-for-what",
        "two minutes",
    ),
    "cloning": Claim(
        "a policy cloned from `rules` makes counted rounds, and under the shield as many as `rules`",
        "learning.md#a-policy-that-is-taught",
        "a minute",
    ),
    "falsify": Claim(
        "an evolution finds planted faults in at most a fifth of the trials that chance needs, and none in the drivers",
        "falsify.md#how-soon",
        "hours",
    ),
    "conformance": Claim(
        "who keeps an ego waiting beyond the bound breaks a rule, and no clean ego brings a lawful car to a breach, in "
        "scenes that try it",
        "theory.md#on-the-road",
        "a quarter of an hour",
    ),
    "contract": Claim(
        "who keeps E1 to E6 keeps no ego waiting for ever, and no clean ego brings a lawful car to a breach, as far as "
        "searches tell",
        "falsify.md#both-sides-of-the-contract",
        "days; what is interrupted goes on",
    ),
    "planted": Claim(
        "holes that are planted in the norm are found within 20,000 trials",
        "falsify.md#both-sides-of-the-contract",
        "some minutes",
    ),
    "shrinking": Claim(
        "a case that has been shrunk has at most three cars, and loses its breach with any one thing less",
        "falsify.md#what-is-promised-and-what-not",
        "some minutes",
    ),
    "estimate": Claim(
        "splitting agrees with Monte Carlo at 1e-3, and estimates an event of 6e-7 with 50,000 trials",
        "falsify.md",
        "a quarter of an hour",
    ),
    "verify": Claim(
        "records of every kind of driver, world and transport verify",
        "verdicts.md",
        "two minutes",
    ),
    "competition": Claim(
        "entries judged at home and by two workers of a server have the same frames",
        "design/081-competitions.md",
        "a quarter of an hour",
    ),
    "million": Claim(
        "a campaign of a million short trials takes at most five minutes and two gibibytes on two processors",
        "campaigns.md",
        "some minutes",
    ),
}
"""The experiments by name, in the order of the page."""


@dataclass(frozen=True, slots=True)
class Stored:
    """A result: the command that gave it, when, of which commit, on what, and its rows.

    `counts` is what its rows sum up, for an experiment that further runs add to.
    """

    command: str
    date: str
    commit: str
    machine: str
    rows: tuple[Row, ...]
    counts: tuple[dict[str, Any], ...] = ()


def load(name: str) -> Stored | None:
    """Return what is stored of an experiment, None if nothing is."""
    path = FOLDER / f"{name}.json"
    if not path.is_file():
        return None
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return Stored(**{**found, "rows": tuple(Row(**row) for row in found["rows"])})


def store(name: str, rows: Sequence[Row], counts: Sequence[dict[str, Any]] = ()) -> None:
    """Keep the rows of an experiment that has just been run on this tree, and what they sum up."""
    made = Stored(
        f"python -m experiments {name}",
        datetime.now(UTC).strftime("%Y-%m-%d"),
        _commit(),
        machine(),
        tuple(rows),
        counts=tuple(counts),
    )
    FOLDER.mkdir(exist_ok=True)
    write_text(FOLDER / f"{name}.json", json.dumps(asdict(made), indent=1, ensure_ascii=False) + "\n")


def _commit() -> str:
    """Return the commit of this tree, with a plus where files have been changed since."""

    def said(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True
        ).stdout.strip()

    changed = said("status", "--porcelain", "--untracked-files=no", "--", "src", "experiments/*.py")
    return said("rev-parse", "--short", "HEAD") + ("+" if changed else "")


def page() -> str:
    """Return docs/experiments.md as what is stored makes it."""
    return "\n".join([HEAD, *(_section(name, claim) for name, claim in CLAIMS.items())])


def write_page() -> None:
    """Write docs/experiments.md anew."""
    write_text(PAGE, page())


HEAD = """\
# Experiments

This page is for whoever asks what the other pages rest on: each claim that takes many trials to show, the command that
shows it, and the result that is stored. It is made of the files in `experiments/results` by `python -m experiments
--page`; `python -m experiments --store NAME` runs an experiment, stores its result and writes the page anew. A result
says when it was measured, and of which commit.
[Benchmarks](../benchmarks/README.md) are about speed alone.
"""


def _section(name: str, claim: Claim) -> str:
    says = claim.says[0].upper() + claim.says[1:]
    lines = [f"## {name}", "", f"{says} ([{claim.page.partition('#')[0]}]({claim.page}))."]
    found = load(name)
    if found is None:
        lines += ["", f"No result is stored. `python -m experiments --store {name}` takes {claim.takes}."]
        return "\n".join([*lines, ""])
    where = f" {found.machine}" if found.machine else ""
    lines += ["", f"`{found.command}`, {found.date}, commit {found.commit}.{where}", ""]
    lines += ["| what | measured | bar |", "|---|---|---|"]
    lines += [f"| {row.name} | {row.figure} | {_bar(row)} |" for row in found.rows]
    return "\n".join([*lines, ""])


def _bar(row: Row) -> str:
    return f"{row.bar}: {'met' if row.met else 'missed'}" if row.bar else ""
