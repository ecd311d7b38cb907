"""The benchmark "Traffic network of Dubins cars".

The public names below are loaded when they are first used, so that importing the package stays quick.
"""

from __future__ import annotations

from importlib import import_module

from dubins_traffic.above import ABOVE
from dubins_traffic.moved import keep_earlier_names

TYPE_CHECKING = False
if TYPE_CHECKING:  # without the module `typing`: the program `dubins-traffic` hears Ctrl-C the sooner
    from collections.abc import Callable, Mapping
    from typing import Any

    from dubins_traffic.animation.animate import Animation, animate
    from dubins_traffic.animation.plot import plot, write_plot
    from dubins_traffic.campaign.results import CampaignResults, load_results
    from dubins_traffic.campaign.run_campaign import run_campaign
    from dubins_traffic.cars.body import Bounds, Car, Disc, DiscObstacle, PolygonObstacle, Rectangle
    from dubins_traffic.cars.state import (
        Command,
        Contact,
        Frames,
        Observation,
        Pose,
        Propositions,
        SensedCar,
        Twist,
    )
    from dubins_traffic.controllers.navigator import Navigator, Situation
    from dubins_traffic.controllers.shield import Shield
    from dubins_traffic.engine.batch import Batch, run_batch
    from dubins_traffic.errors import ControllerError, DubinsTrafficError, InputError, RecordError
    from dubins_traffic.falsification.estimate import estimate
    from dubins_traffic.falsification.regress import regress
    from dubins_traffic.falsification.search import falsify
    from dubins_traffic.falsification.shrink import shrink
    from dubins_traffic.problem.configuration import Configuration, load_config
    from dubins_traffic.problem.document import instance_from_document, instance_to_document, load_instance
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.problem.instance import EAgent, Instance, Problem
    from dubins_traffic.protocols import Controller, End, Ending, Simulator, Sink, Watcher
    from dubins_traffic.record.reader import Record
    from dubins_traffic.record.writer import RecordWriter
    from dubins_traffic.roads.generate import generate as generate_network
    from dubins_traffic.roads.network import RoadNetwork
    from dubins_traffic.runs.jobs import Job, run_trials
    from dubins_traffic.runs.plan import Plan, plan
    from dubins_traffic.runs.single import Result, Trial, run_trial
    from dubins_traffic.runs.sources import load, load_record
    from dubins_traffic.scoring.judging import Judging
    from dubins_traffic.scoring.metric import Column, Metric
    from dubins_traffic.scoring.score import Score, Scorer, ScoreSheet, score
    from dubins_traffic.scoring.verdict import Verdict
    from dubins_traffic.verification.result import Difference, Verification
    from dubins_traffic.verification.verify import verify
    from dubins_traffic.viewer.replay import write_replay

_PLACES = {
    "engine.batch": ("Batch", "run_batch"),
    "campaign.run_campaign": ("run_campaign",),
    "runs.jobs": ("Job", "run_trials"),
    "runs.plan": ("Plan", "plan"),
    "campaign.results": ("CampaignResults", "load_results"),
    "runs.single": ("Result", "Trial", "run_trial"),
    "runs.sources": ("load", "load_record"),
    "cars.body": ("Bounds", "Car", "Disc", "DiscObstacle", "PolygonObstacle", "Rectangle"),
    "cars.state": (
        "Command",
        "Contact",
        "Frames",
        "Observation",
        "Pose",
        "Propositions",
        "SensedCar",
        "Twist",
    ),
    "controllers.navigator": ("Navigator", "Situation"),
    "controllers.shield": ("Shield",),
    "falsification.estimate": ("estimate",),
    "falsification.regress": ("regress",),
    "falsification.search": ("falsify",),
    "falsification.shrink": ("shrink",),
    "errors": ("ControllerError", "DubinsTrafficError", "InputError", "RecordError"),
    "problem.configuration": ("Configuration", "load_config"),
    "problem.document": ("instance_from_document", "instance_to_document", "load_instance"),
    "problem.draw": ("draw",),
    "problem.instance": ("EAgent", "Instance", "Problem"),
    "protocols": ("Controller", "End", "Ending", "Simulator", "Sink", "Watcher"),
    "record.reader": ("Record",),
    "record.writer": ("RecordWriter",),
    "roads.generate": ("generate_network=generate",),
    "roads.network": ("RoadNetwork",),
    "scoring.judging": ("Judging",),
    "scoring.metric": ("Column", "Metric"),
    "scoring.score": ("Score", "ScoreSheet", "Scorer", "score"),
    "scoring.verdict": ("Verdict",),
    "verification.result": ("Difference", "Verification"),
    "verification.verify": ("verify",),
    "animation.animate": ("Animation", "animate"),
    "animation.plot": ("plot", "write_plot"),
    "viewer.replay": ("write_replay",),
}
_PARTS = {
    "map formats": {
        "commonroad": "maps.commonroad:CommonRoad",
        "lanelet2": "maps.lanelet2:Lanelet2",
        "osm": "maps.osm:OpenStreetMap",
        "opendrive": "maps.opendrive:OpenDrive",
        "sumo": "maps.sumo:SumoNet",
    },
    "simulators": {"gazebo": "gazebo.simulator:Gazebo"},
    "controllers": {"learned": "learning.policy", "synthesized": "synthesis.synthesized"},
    "e-agents": {"counter": "synthesis.counter_team:CounterTeam"},
}
"""What rooms above a registry add to it, by name: a module, and a class in it; map formats in the order of asking."""
_NAMES = {entry.partition("=")[0]: (place, entry.rpartition("=")[2]) for place in _PLACES for entry in _PLACES[place]}

__version__: str

__all__ = [
    "Animation",
    "Batch",
    "Bounds",
    "CampaignResults",
    "Car",
    "Column",
    "Command",
    "Configuration",
    "Contact",
    "Controller",
    "ControllerError",
    "Difference",
    "Disc",
    "DiscObstacle",
    "DubinsTrafficError",
    "EAgent",
    "End",
    "Ending",
    "Frames",
    "InputError",
    "Instance",
    "Job",
    "Judging",
    "Metric",
    "Navigator",
    "Observation",
    "Plan",
    "PolygonObstacle",
    "Pose",
    "Problem",
    "Propositions",
    "Record",
    "RecordError",
    "RecordWriter",
    "Rectangle",
    "Result",
    "RoadNetwork",
    "Score",
    "ScoreSheet",
    "Scorer",
    "SensedCar",
    "Shield",
    "Simulator",
    "Sink",
    "Situation",
    "Trial",
    "Twist",
    "Verdict",
    "Verification",
    "Watcher",
    "__version__",
    "animate",
    "draw",
    "estimate",
    "falsify",
    "generate_network",
    "instance_from_document",
    "instance_to_document",
    "load",
    "load_config",
    "load_instance",
    "load_record",
    "load_results",
    "plan",
    "plot",
    "regress",
    "run_batch",
    "run_campaign",
    "run_trial",
    "run_trials",
    "score",
    "shrink",
    "verify",
    "write_plot",
    "write_replay",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("dubins-traffic")
    if name not in _NAMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    place, attribute = _NAMES[name]
    value = getattr(import_module(f"{__name__}.{place}"), attribute)
    globals()[name] = value
    return value


def _html_of(value: Any) -> str:
    from dubins_traffic.viewer.notebook import html_of

    return html_of(value)


def _rows_of(value: Any) -> list[dict[str, Any]]:
    from dubins_traffic.campaign.results import rows_of

    return rows_of(value)


def _boxed(spec: str, limits: str) -> Any:
    from dubins_traffic.sandbox.controller import named

    return named(spec, limits)


def _compiled(kernel: Any, kinds: Any) -> Any:
    from dubins_traffic.compiling.beside import sought

    return sought(kernel, kinds)


def _why_no_boxes() -> str:
    from dubins_traffic.errors import InputError
    from dubins_traffic.sandbox.available import available_layers

    try:
        available_layers().require()
    except InputError as error:
        return error.problem
    return ""


def _parts(registry: str) -> Mapping[str, Callable[[], Any]]:
    from functools import partial

    return {name: partial(_part, place) for name, place in _PARTS[registry].items()}


def _part(place: str) -> Any:
    module, _, name = place.partition(":")
    part = import_module(f"{__name__}.{module}")
    return getattr(part, name) if name else part


ABOVE.html_of, ABOVE.rows_of, ABOVE.compiled = _html_of, _rows_of, _compiled
ABOVE.boxed, ABOVE.why_no_boxes, ABOVE.parts = _boxed, _why_no_boxes, _parts
keep_earlier_names()


def __dir__() -> list[str]:
    """Return the public names, all of them, loaded or not, and no module that happens to have been imported."""
    return sorted(__all__)
