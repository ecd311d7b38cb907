"""The pages of the API: every public name, with what its docstring says."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path

import dubins_traffic
from dubins_traffic import sandbox
from pages import ORPHAN

GROUPS: dict[str, tuple[str, tuple[str, ...]]] = {
    "networks": ("Road networks", ("RoadNetwork", "generate_network")),
    "problems": (
        "Configurations, problems and instances",
        (
            "load_config", "Configuration", "draw", "load_instance", "instance_from_document", "instance_to_document",
            "Instance", "Problem", "EAgent", "Car", "Bounds", "Disc", "Rectangle", "DiscObstacle", "PolygonObstacle",
        ),
    ),
    "trials": ("Trials", ("run_trial", "Trial", "Result", "run_trials", "Job", "Plan", "plan", "End", "Ending")),
    "driving": (
        "Controllers, and what they see",
        (
            "Controller", "Observation", "Propositions", "SensedCar", "Pose", "Twist", "Command", "Contact",
            "Navigator", "Situation", "Shield",
        ),
    ),
    "batches": ("Batches", ("run_batch", "Batch")),
    "campaigns": ("Campaigns", ("run_campaign", "CampaignResults", "load_results")),
    "falsification": ("The worst case", ("falsify", "shrink", "regress", "estimate")),
    "records": (
        "Records",
        ("load", "load_record", "Record", "RecordWriter", "Frames", "verify", "Verification", "Difference"),
    ),
    "scores": (
        "Scores and verdicts",
        ("score", "Score", "ScoreSheet", "Scorer", "Verdict", "Judging", "Metric", "Column"),
    ),
    "pictures": ("Pictures and replays", ("plot", "write_plot", "write_replay", "animate", "Animation")),
    "learning": (
        "Learning",
        (
            "envs.single.TrafficEnv", "envs.vector.TrafficVectorEnv", "envs.shielded_ego.ShieldedEgo",
            "envs.parallel.parallel_env", "envs.parallel.TrafficParallelEnv",
            "envs.parallel_vector.TrafficParallelVectorEnv", "envs.shielded.Shielded",
            "learning.flat.Layout", "learning.flat.FlatObserver", "learning.policy.Policy",
            "animation.raster.Raster",
        ),
    ),
    "sandbox": ("Boxes", tuple(f"sandbox.{name}" for name in sandbox.__all__)),
    "choices": (
        "Choices of e-agents",
        tuple(f"agents.choices.{name}" for name in ("drawn", "mutated", "reductions", "with_choices", "table_of")),
    ),
    "seams": ("Seams", ("Simulator", "Sink", "Watcher")),
    "errors": ("Errors", ("DubinsTrafficError", "InputError", "ControllerError", "RecordError")),
}  # fmt: skip
"""Page: its heading and names."""


HEAD = """# API

What each public function and class takes, returns and raises. If you are looking for a way to begin, read [from
Python](../../python.md) first. Every name is imported from `dubins_traffic`, which loads it when it is first used;
a name with a dot, such as `envs.single.TrafficEnv`, is imported from its module, `dubins_traffic.envs.single`.
Lengths are in metres, times in seconds, angles in radians, unless something else is said.
"""


def write_api(folder: Path) -> None:
    """Write a page for each group of names, and the page above them.

    Raises
    ------
    SystemExit
        If a public name stands on no page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    named = {name for _, names in GROUPS.values() for name in names}
    if missing := set(dubins_traffic.__all__) - named - {"__version__"}:
        raise SystemExit(f"website/api.py: on no page stand {', '.join(sorted(missing))}")
    for page, (heading, names) in GROUPS.items():
        parts = [f"{ORPHAN}# {heading}", "", *(_entry(name) for name in names)]
        (folder / f"{page}.md").write_text("\n".join(parts), encoding="utf-8")
    (folder / "index.md").write_text(_index(), encoding="utf-8")


def _entry(name: str) -> str:
    """Return the section of a name of the package, or of a module in it: ``module.Name``."""
    place, _, own = f"dubins_traffic.{name}".rpartition(".")
    value = getattr(import_module(place), own)
    kind = "autofunction" if inspect.isroutine(value) else "autoclass"
    if inspect.isclass(value) and issubclass(value, BaseException):
        kind = "autoexception"
    options = "" if kind == "autofunction" else "   :members:\n"
    return f"## {own}\n\n```{{eval-rst}}\n.. currentmodule:: {place}\n\n.. {kind}:: {own}\n{options}```\n"


def _index() -> str:
    rows = [
        f"| [{heading}]({page}.md) | {', '.join(f'{{py:obj}}`{name} <dubins_traffic.{name}>`' for name in names)} |"
        for page, (heading, names) in GROUPS.items()
    ]
    return "\n".join([HEAD, "| page | names |", "|---|---|", *rows, ""])
