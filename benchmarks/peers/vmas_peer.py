"""Discs with VMAS's differential drive, many worlds in one batch of PyTorch. usage: vmas_peer.py CARS SECONDS."""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import torch
import vmas
from timing import PERIOD, RADIUS, SPEED, lattice, run
from vmas.simulator.core import Agent, Sphere
from vmas.simulator.core import World as Batch
from vmas.simulator.dynamics.diff_drive import DiffDrive
from vmas.simulator.scenario import BaseScenario

TICKS = 100
BATCH = 65536
"""Cars in all worlds together; with twice as many a car-step costs a few per cent less."""


class Discs(BaseScenario):
    """Cars on an empty plane, elsewhere in each world, that see their own position and are paid nothing."""

    def make_world(self, batch_dim: int, device: torch.device, **options: Any) -> Batch:
        """Make the worlds."""
        self.starts = lattice(options["cars"])
        world = Batch(batch_dim, device, dt=PERIOD, substeps=1, drag=0.0)
        for n in range(len(self.starts)):
            drive = DiffDrive(world, integration="euler")
            world.add_agent(Agent(f"car{n}", shape=Sphere(RADIUS), u_range=[1.0, 1.0], dynamics=drive))
        return world

    def reset_world_at(self, env_index: int | None = None) -> None:
        """Put the cars anywhere about their places, in all worlds: from the first tick on, some are about to meet."""
        for agent, start in zip(self.world.agents, self.starts, strict=True):
            away = 2.0 * torch.rand(self.world.batch_dim, 2) - 1.0
            agent.set_pos(torch.tensor(start) + away, env_index)

    def observation(self, agent: Agent) -> torch.Tensor:
        """Return the position."""
        return agent.state.pos

    def reward(self, _agent: Agent) -> torch.Tensor:
        """Return nothing, in every world."""
        return torch.zeros(self.world.batch_dim)


class World:
    """As many worlds as make up the batch."""

    def __init__(self, cars: int) -> None:
        torch.set_num_threads(1)
        worlds = BATCH // cars
        self.cars = cars * worlds
        self.environment = vmas.make_env(Discs(), worlds, seed=1, cars=cars)
        self.commands = []
        for _ in range(cars):
            yaw = 2.0 * torch.rand(worlds, 1) - 1.0
            self.commands.append(torch.cat([torch.full_like(yaw, SPEED), yaw], dim=1))

    def drive(self) -> int:
        """Go on for some ticks."""
        for _ in range(TICKS):
            self.tick()
        return TICKS * self.cars

    def tick(self) -> None:
        """Step all worlds."""
        self.environment.step(self.commands)

    def positions(self) -> list[tuple[float, float]]:
        """Return where the cars of the first world are."""
        return [tuple(agent.state.pos[0].tolist()) for agent in self.environment.agents]


run(version("vmas"), World)
