"""Draws the instances of a configuration; what they have in common is computed once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import Configuration, check_goal, pose_of
from dubins_traffic.problem.drawing import (
    Stream,
    agent_wishes,
    complete_agents,
    draw_duration,
    draw_goals,
    drawn_cycle,
    origin_start,
)
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.instance import EAgent, Instance, Problem
from dubins_traffic.problem.obstructions import check_obstructions
from dubins_traffic.problem.preconditions import check_demands
from dubins_traffic.problem.starts import Areas, Ground, Wish, areas_of, check_given, draw_starts
from dubins_traffic.roads.clearance import LEAST_RADIUS, SEGMENT_SLACK
from dubins_traffic.roads.formats.rnd import grid_segments
from dubins_traffic.roads.generate import random_network, thinned_grid
from dubins_traffic.roads.network import RoadNetwork

if TYPE_CHECKING:
    from dubins_traffic.problem.placing import Lots


@dataclass(slots=True)
class Site:
    """A road network with the e-agents on it, and where they are to start; `lots` are made when needed."""

    network: RoadNetwork
    agents: tuple[EAgent, ...]
    wishes: list[Wish]
    ground: Ground
    lots: Lots | None = None


class Recipe:
    """Draws the instances of a configuration.

    Where the road network is the same in all trials, and no cycles are drawn on it, all instances share one site.
    """

    def __init__(self, configuration: Configuration) -> None:
        settings = configuration.settings
        self._configuration = configuration
        self._settings = settings
        self._car = configuration.car
        self._radius = settings.radius
        self._rules = settings.rule_parameters
        self._obstacles = settings.obstacle_values
        self._laser = settings.laser
        self._disturbances = settings.disturbances
        self._names = ("ego", *(plan.agent.name for plan in configuration.agents))
        self._steady = not any(drawn_cycle(plan.agent) for plan in configuration.agents)
        self._network = configuration.network
        self._site: Site | None = None
        self._areas_kept: tuple[RoadNetwork, Areas] | None = None

    def draw(self, seed: int, trial: int) -> Instance:
        """Return the instance of a trial."""
        site = self._site_of(seed, trial)
        return self._instance(site, seed, trial, None)

    def draw_many(self, seed: int, trials: Sequence[int]) -> Iterator[Instance]:
        """Yield the instances of some trials, with compiled code; the same as those of `draw`, bit for bit."""
        from dubins_traffic.problem.placing import place_cars

        k = 0
        while k < len(trials):
            site = self._site_of(seed, trials[k])
            some = trials[k:] if site is self._site else trials[k : k + 1]
            starts = place_cars(self._lots(site), site.wishes, seed, some, Stream.STARTS)
            for trial, poses in zip(some, starts, strict=True):
                yield self._instance(site, seed, trial, poses)
            k += len(some)

    def _instance(self, site: Site, seed: int, trial: int, starts: list[Pose] | None) -> Instance:
        settings = self._settings
        problem = Problem(
            network=site.network,
            goals=self._goals(site.network, seed, trial),
            intersection_radius=self._radius,
            car=self._car,
            rate=settings.rate,
            sensing_radius=settings.sensing_radius,
            laser=self._laser,
            obstacles=self._obstacles,
            e_agents=self._names[1:],
            rules=self._rules,
            formulas=settings.formulas,
        )
        check_formulas(problem, self._names)
        check_obstructions(problem)
        if starts is None:
            starts = draw_starts(
                self._areas(site), site.ground, site.wishes, Draws(seed, trial, Stream.STARTS)
            )
        return Instance(
            problem=problem,
            starts=tuple(starts),
            duration=self._duration(seed, trial),
            e_agents=site.agents,
            seed=seed,
            trial=trial,
            disturbances=self._disturbances,
            end_on_collision=settings.end_on_collision,
            simulator=settings.simulator,
        )

    def _site_of(self, seed: int, trial: int) -> Site:
        if self._site is not None:
            return self._site
        network = self._network or self._draw_network(Draws(seed, trial, Stream.NETWORK))
        if self._rules:
            check_demands(network, self._radius, self._car, self._settings.sensing_radius, self._rules)
        planned = self._configuration.agents
        agents = complete_agents(network, planned, Draws(seed, trial, Stream.CYCLES))
        others = agent_wishes(network, planned, agents, self._car, self._obstacles)
        wishes = [Wish(self._ego_start(network), None, "ego.start"), *others]
        ground = Ground(network, self._car, self._radius, self._obstacles)
        check_given(ground, self._names, wishes)
        site = Site(network, agents, wishes, ground)
        if self._is_fixed(network):
            self._network = network
            self._site = site if self._steady else None
        return site

    def _is_fixed(self, network: RoadNetwork) -> bool:
        """Tell whether a network is the same in all trials: nothing about it is random."""
        wanted = self._settings.network
        if self._network is not None or wanted is None or wanted.grid is None:
            return self._network is not None
        grid = wanted.grid
        return not grid.rigid_motion and network.segments == grid_segments(grid.rows, grid.columns)

    def _areas(self, site: Site) -> Areas:
        if self._areas_kept is not None and self._areas_kept[0] is site.network:
            return self._areas_kept[1]
        areas = areas_of(site.ground)
        self._areas_kept = site.network, areas
        return areas

    def _lots(self, site: Site) -> Lots:
        from dubins_traffic.problem.placing import lots

        if site.lots is None:
            site.lots = lots(site.ground, self._areas(site).outside, site.wishes)
        return site.lots

    def _goals(self, network: RoadNetwork, seed: int, trial: int) -> tuple[tuple[float, float], ...]:
        settings = self._settings
        if settings.goals is not None:
            return tuple(check_goal(network, goal, k) for k, goal in enumerate(settings.goals))
        low, high = settings.number_goals_bounds
        draws = Draws(seed, trial, Stream.GOALS)
        return draw_goals(network, (low, high), draws, settings.goal_segments_apart)

    def _duration(self, seed: int, trial: int) -> float:
        settings = self._settings
        if settings.duration is not None:
            return settings.duration
        low, high = settings.duration_bounds
        return draw_duration((low, high), Draws(seed, trial, Stream.DURATION))

    def _ego_start(self, network: RoadNetwork) -> Pose | None:
        start = self._settings.ego.start
        if start == "drawn":
            return None
        if start == "origin":
            return origin_start(network, self._car.w)
        return pose_of(*start)

    def _draw_network(self, draws: Draws) -> RoadNetwork:
        """Return the network of one trial, with room for the rules of a configuration that asks for a random one."""
        settings, car = self._settings, self._car
        network = settings.network
        if network is None:
            raise InputError("missing", field="network", expected="random or grid")
        if network.grid is not None:
            grid = network.grid
            try:
                return thinned_grid(
                    draws,
                    grid.rows,
                    grid.columns,
                    grid.removed,
                    length=grid.length,
                    rigid_motion=grid.rigid_motion,
                )
            except InputError as error:
                raise error.within(field="network.grid") from None
        wanted = network.random
        if wanted is None:
            raise InputError("missing", field="network", expected="random or grid")
        slack = settings.rule_parameters.get("segment_slack", SEGMENT_SLACK)
        try:
            return random_network(
                draws,
                wanted.intersections,
                wanted.segments,
                minimum_angle=wanted.min_angle,
                w=car.w,
                radius=max(settings.radius, LEAST_RADIUS * car.w),
                reach=car.body.reach,
                slack=slack,
                rigid_motion=wanted.rigid_motion,
                bent=wanted.bent,
            )
        except InputError as error:
            raise error.within(field="network.random") from None
