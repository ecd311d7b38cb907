"""A moment of each kind of work that calls kernels from Python, for the library that `compiling.building` makes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dubins_traffic.cars.body import DiscObstacle
from dubins_traffic.cars.dynamics import BUILT_IN
from dubins_traffic.cars.propositions import FLAG
from dubins_traffic.cars.state import EGO, NONE, Observation, Propositions, State, Twist
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.cars.touching import Bodies
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers.navigator import Navigator
from dubins_traffic.engine.batch import outcomes
from dubins_traffic.engine.controlled import BatchView, LanesGroup, Maker
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.learning.flat import FlatObserver
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw, draw_many
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.problem.parts import Disturbances, Laser
from dubins_traffic.record import reader
from dubins_traffic.roads.closeness import Finder
from dubins_traffic.roads.generate import thinned_grid
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.roads.room import clearances
from dubins_traffic.roads.sketch import Sketcher
from dubins_traffic.roads.weave import Weaver
from dubins_traffic.rules.obstacles import place_obstacles
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import score
from dubins_traffic.synthesis.answer import answer
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.synthesis.game import scene_numbers
from dubins_traffic.synthesis.strategy import Strategy
from dubins_traffic.verification.worlds import from_poses

SECONDS = 0.2
"""Simulated seconds of a moment."""
MANY = 3
"""Number of trials in a moment of trials that are drawn and run together."""
DRIVERS = ("simple", "lanes", "rules")
POLICIES = ("", ":law", ":never")
"""How the shield is told when it may leave its lane."""
TURNING = 0.25
"""Turning radius of cars of a model, metres."""
FORMULAS = {"late": "[] (left_ego -> <>[5,10] !left_ego)", "way": "[] <>[0,1] !way_ego"}
ASSUMED = (None, ("E2", "E6"))
"""What games assume of e-agents, as the problem says or less: they are won, and lost."""


def moments() -> Iterator[Callable[[], object]]:
    """Yield functions that run a moment of each kind of work."""
    town, demo = (_brief(draw(load_config(name), 0, 0)) for name in ("town", "demo"))
    pair = [town, replace(town, trial=1)]
    for driver in DRIVERS:
        shielded = [controllers.shielded(driver) + when for when in POLICIES]
        for name in (driver, *shielded):
            yield partial(run_trial, town, name)
        yield partial(run_trial, demo, driver)
        for name in (driver, shielded[0]):
            yield partial(_together, pair, name)
    yield partial(list, draw_many(load_config("town"), 0, range(MANY)))
    yield _roads
    yield lambda: LanesGroup(pair, "sure").drive(1)
    visited = "visit_ego_{}_{}".format(*town.problem.goals[0])
    problem = replace(town.problem, laser=Laser(), formulas={**FORMULAS, "again": f"[] <> {visited}"})
    noise = Disturbances(position_noise=0.01, heading_noise=0.01, command_delay=1, command_loss=0.1, cars="all")
    yield partial(run_trial, replace(town, problem=problem, disturbances=noise), "lanes")
    yield partial(run_trial, replace(town, problem=problem), _Watching())
    yield partial(_together, pair, _Watching)
    yield partial(_checked, town)
    yield partial(_between, town)
    yield partial(_navigated, town)
    yield _bend
    for changes in _changes():
        yield partial(_drawn_and_run, changes)
    for instance in scenarios().values():
        yield partial(run_trial, _brief(instance), "lanes")
    for assumed in ASSUMED:
        yield partial(_game, scenarios()["dead ends"], assumed)
    yield _learning


def _brief(instance: Instance) -> Instance:
    return replace(instance, duration=SECONDS)


def _changes() -> Iterator[dict[str, Any]]:
    """Yield what makes configurations of the town others: car models, kinds of e-agents, obstacles, roads that bend."""
    for model in BUILT_IN:
        car = {"model": model, "bounds": {"turning_radius": TURNING}}
        yield {"car": car, "e-agents": [{"type": "wander", "name": "one"}], "rules": False}
    for kind in ("free", "nudged"):
        yield {"e-agents": [{"type": kind, "name": "one"}]}
    disc = {"disc": {"x": 4.5, "y": 2.7, "radius": 0.2}}
    yield {"network": {"grid": {"rows": 3, "columns": 4}}, "obstacles": [disc]}


def _drawn_and_run(changes: dict[str, Any]) -> None:
    instance = _brief(draw(load_config({**load_config("town").to_document(), **changes}), 0, 0))
    run_trial(instance, "simple")


class _Watching:
    """Stands and makes flat observations, or is asked for many trials at once."""

    def start(self, problem: Problem) -> None:
        """Make what observes."""
        self._observe = FlatObserver(problem)

    def act(self, observation: Observation) -> tuple[float, float]:
        """Observe."""
        self._observe(observation)
        return 0.0, 0.0

    def start_batch(self, trials: Sequence[int], problems: Sequence[Problem]) -> None:
        """Begin trials."""

    def act_batch(self, view: BatchView) -> Floats:
        """Return commands to stand, (B, 2)."""
        return np.zeros((len(view.trial), 2))


def _together(instances: Sequence[Instance], driver: str | Maker) -> list[Any]:
    return list(outcomes(instances, driver))


def _checked(instance: Instance) -> None:
    """Record a trial, and judge the record."""
    with TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        run_trial(instance, "rules", record=record)
        score(from_poses(reader.read(record)))


def _between(instance: Instance) -> None:
    """Find how far apart a car is from another and from an obstacle."""
    bodies = Bodies(instance.problem.car, [DiscObstacle(1.0, 1.0, 0.1)])
    for other in (1, -1):
        bodies.separation(State.zeros(1, 2), 0, other)


def _navigated(instance: Instance) -> None:
    """Ask what a driver asks where nothing tells the lane, in a queue before a crossing, and in a disc, at once too."""
    pose = instance.starts[EGO]
    lane = 0
    vertex = instance.problem.network.lane_ends(lane)[1]
    unknown = Propositions(0, NONE, NONE, NONE, 0)
    queued = Propositions(0, NONE, NONE, lane, FLAG.STOPPED)
    inside = Propositions(0, vertex, vertex, NONE, 0)
    for frames in ((unknown, queued, inside), (inside,)):
        navigator = Navigator(instance.problem)
        for tick, seen in enumerate(frames):
            here = navigator.look(Observation(tick, 0.0, pose, Twist(0.0, 0.0), seen, (), None))
            here.line(SECONDS)


def _roads() -> None:
    """Draw and check road networks with tables of their own: calls with kept ones look at no kernel again."""
    least, draws = clearances(1.0, 0.177, 0.3).in_units(0.3), Draws(0, 0, 1)
    Sketcher(4, 4, least.length).run(draws, least, 1)
    Weaver(4, 4).run(draws, least)
    thinned_grid(draws, 3, 3, 0.2)
    finder = Finder(2, 1, 2)
    node, bar = finder.frame.node, finder.frame.bar
    node["x"][1] = 9.0
    bar["b"][0] = 1
    finder.put_bars(np.array([[0.0, 0.0]]), np.array([[9.0, 0.0]]))
    finder.tight(least)
    finder.crowded_and_sharp(least)
    finder.meetings()


def _bend() -> None:
    """Place an obstacle beside a road that bends."""
    road = RoadNetwork(((0, 0, 4, 4),), 1.0, (0.0, 0.0, 0.0), (5, 5), corners=(((4, 0, 1.0),),))
    obstacles = pack_obstacles([[DiscObstacle(1.0, 0.0, 0.1)]])
    place_obstacles(obstacles, pack([road], [0.3]), np.zeros(1, dtype=np.int64))


def _game(instance: Instance, assumed: Sequence[str] | None) -> None:
    """Solve a game, keep its strategy if it is won, and drive by it."""
    answered = answer(instance, assumption=None if assumed is None else Assumption.parse(assumed))
    scene_numbers(answered.solution.game.board)
    strategy = Strategy.of(answered.solution)
    with contextlib.suppress(InputError), TemporaryDirectory() as folder:
        strategy.save(kept := Path(folder) / "strategy.npz")
        Strategy.load(kept)
    with contextlib.suppress(InputError):
        run_trial(_brief(instance), "synthesized")


def _learning() -> None:
    """Step environments, alone, many and with several agents; none of them without Gymnasium and PettingZoo."""
    with contextlib.suppress(ModuleNotFoundError):
        from dubins_traffic.envs.parallel import TrafficParallelEnv
        from dubins_traffic.envs.single import TrafficEnv
        from dubins_traffic.envs.vector import TrafficVectorEnv

        alone = TrafficEnv("town", levels=2, render_mode="rgb_array")
        vector = TrafficVectorEnv(2, "town", render_mode="rgb_array")
        environments: list[Any] = [alone, vector]
        for made in environments:
            made.reset(seed=0)
            made.step(made.action_space.sample())
            made.render()
        several = TrafficParallelEnv("town", render_mode="rgb_array")
        several.reset(seed=0)
        several.step({name: several.action_space(name).sample() for name in several.agents})
