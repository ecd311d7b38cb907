"""Problem instances as documents: version 0 as in 2016, version 1 with all of an instance."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import PlannedAgent, check_goal, plan_agents, pose_of
from dubins_traffic.problem.draw import (
    Stream,
    agent_wishes,
    check_numbers,
    complete_agents,
    draw_duration,
    origin_start,
)
from dubins_traffic.problem.faults import parse, version_of
from dubins_traffic.problem.files import FileKind, plain, read_source
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.problem.obstructions import check_obstructions
from dubins_traffic.problem.parts import CarModel, ObstacleModel
from dubins_traffic.problem.preconditions import check_demands
from dubins_traffic.problem.settings import INSTANCE_0_KEYS, InstanceModel, InstanceModel0
from dubins_traffic.problem.starts import Ground, Wish, areas_of, check_given, draw_starts
from dubins_traffic.roads.network import RoadNetwork

DURATION_BOUNDS = (30, 90)
"""Bounds of the duration that is drawn if a document gives none, seconds."""


def instance_to_document(instance: Instance, version: int = 1) -> dict[str, Any]:
    """Return the document of `instance`.

    Parameters
    ----------
    instance : Instance
        The instance to write.
    version : int
        0: what a controller of 2016 is given; 1: everything, so that reading it gives an equal instance.
    """
    problem = instance.problem
    public: dict[str, Any] = {
        "version": version,
        "goals": [list(goal) for goal in problem.goals],
        "rnd": problem.network.to_document(),
        "intersection_radius": problem.intersection_radius,
    }
    if version == 0:
        return {**public, **instance.extra}
    poses = zip(instance.names, instance.starts, strict=True)
    return {
        **public,
        "starts": {name: list(pose) for name, pose in poses},
        "duration": instance.duration,
        "e-agents": [
            {"type": agent.type, "name": agent.name, "parameters": dict(agent.parameters)}
            for agent in instance.e_agents
        ],
        "seed": instance.seed,
        "trial": instance.trial,
        "car": CarModel.document(problem.car),
        "rate": problem.rate,
        "sensing_radius": problem.sensing_radius,
        "laser": problem.laser.model_dump() if problem.laser else None,
        "obstacles": [ObstacleModel.document(obstacle) for obstacle in problem.obstacles],
        "rules": dict(problem.rules) or False,
        "disturbances": instance.disturbances.document(),
        "end_on_collision": instance.end_on_collision,
        "simulator": instance.simulator,
        **({"formulas": dict(problem.formulas)} if problem.formulas else {}),
        **instance.extra,
    }


def instance_from_document(
    document: Mapping[str, Any], file: str | None = None, seed: int = 0, trial: int = 0
) -> Instance:
    """Return the instance that `document` describes.

    Parameters
    ----------
    document : Mapping
        A problem instance, version 0 or 1. What it does not give is as in a version 0 instance: no e-agents, the ego
        at the world's origin if that is on the road, else drawn, the duration drawn.
    file : str, optional
        Named in messages.
    seed, trial : int
        Seed and number of the trial for what is drawn, if the document gives none.

    Raises
    ------
    InputError
        For the first thing wrong, with its field.
    """
    given = plain(document, file)
    if version_of(given, file) == 0:
        parse(InstanceModel0, given, file=file)
        model = parse(InstanceModel, {key: given[key] for key in given if key in INSTANCE_0_KEYS}, file=file)
        known = INSTANCE_0_KEYS
    else:
        model = parse(InstanceModel, given, file=file)
        known = frozenset(info.alias or name for name, info in InstanceModel.model_fields.items())
    extra = {key: value for key, value in given.items() if key not in known}
    try:
        check_numbers(seed, trial)
        return _instance(model, extra, seed, trial)
    except InputError as error:
        raise error.within(file=file) from None


def load_instance(source: str | os.PathLike[str], seed: int = 0, trial: int = 0) -> Instance:
    """Return the instance in the file at `source` (``-``: standard input).

    Raises
    ------
    InputError
        If there is no such file, it holds something else, or something in it is wrong.
    """
    text = read_source(source)
    document = text.document(FileKind.INSTANCE, "a problem instance", "goals, rnd, intersection_radius, ...")
    return instance_from_document(document, text.name, seed, trial)


def _instance(model: InstanceModel, extra: Mapping[str, Any], seed: int, trial: int) -> Instance:
    seed = seed if model.seed is None else model.seed
    trial = trial if model.trial is None else model.trial
    network = _network(model.rnd)
    car, rules = model.car.core(), model.rule_parameters
    if rules:
        check_demands(network, model.radius, car, model.sensing_radius, rules)
    planned = plan_agents(model.e_agents)
    agents = complete_agents(network, planned, Draws(seed, trial, Stream.CYCLES))
    names = ("ego", *(agent.name for agent in agents))
    problem = Problem(
        network=network,
        goals=tuple(check_goal(network, goal, k) for k, goal in enumerate(model.goals)),
        intersection_radius=model.radius,
        car=car,
        rate=model.rate,
        sensing_radius=model.sensing_radius,
        laser=model.laser,
        obstacles=model.obstacle_values,
        e_agents=names[1:],
        rules=rules,
        formulas=model.formulas,
    )
    check_formulas(problem, names)
    check_obstructions(problem)
    planned, ego = _placed(model, network, planned)
    wishes = [ego, *agent_wishes(network, planned, agents, car, problem.obstacles)]
    ground = Ground(network, car, model.radius, problem.obstacles)
    check_given(ground, names, wishes)
    duration = model.duration
    if duration is None:
        duration = draw_duration(DURATION_BOUNDS, Draws(seed, trial, Stream.DURATION))
    return Instance(
        problem=problem,
        starts=tuple(draw_starts(areas_of(ground), car, wishes, Draws(seed, trial, Stream.STARTS))),
        duration=duration,
        e_agents=agents,
        seed=seed,
        trial=trial,
        disturbances=model.disturbances,
        end_on_collision=model.end_on_collision,
        simulator=model.simulator,
        extra=extra,
    )


def _network(document: Any) -> RoadNetwork:
    if isinstance(document, str):
        raise InputError("not a road network", field="rnd", value=document, expected="an object, not a path")
    try:
        return RoadNetwork.from_document(document)
    except InputError as error:
        raise error.within(field="rnd") from None


def _placed(
    model: InstanceModel, network: RoadNetwork, planned: tuple[PlannedAgent, ...]
) -> tuple[tuple[PlannedAgent, ...], Wish]:
    """Return the e-agents and the ego with the starts that `starts` gives, else their entries, else none."""
    given = {name: _pose(row) for name, row in model.starts.items()}
    names = ["ego", *(plan.agent.name for plan in planned)]
    for name in given:
        if name not in names:
            expected = f"one of {', '.join(names[:20])}"
            raise InputError("start of an unknown car", field="starts", value=name, expected=expected)
    placed = tuple(PlannedAgent(plan.agent, given.get(plan.agent.name, plan.start), plan.field) for plan in planned)
    return placed, Wish(given.get("ego") or origin_start(network, model.car.w), None, "starts.ego")


def _pose(row: tuple[float, ...]) -> Pose:
    return Pose(*row) if len(row) == 4 else pose_of(row[0], row[1], row[2])
