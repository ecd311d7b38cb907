"""Cars in SUMO, within this process through libsumo, on a grid. usage: sumo_peer.py CARS SECONDS

Lanes are scaled up to SUMO's cars of 5 m: a segment takes about as long to drive as ours. Every car has a random route
that is longer than the measurement, so that nobody arrives.
"""

from __future__ import annotations

import random
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import libsumo
import sumo
import sumolib
from timing import run

STEP = 0.033
"""Seconds of a step; SUMO counts in milliseconds."""
ROUTE = 200
SECONDS = 300


@cache
def grid(rows: int, columns: int) -> str:
    """Return a network of SUMO's own making: one lane each way, everybody stops at every intersection."""
    tool = Path(sumo.SUMO_HOME) / "bin" / "netgenerate"
    size = ["--grid", f"--grid.y-number={rows}", f"--grid.x-number={columns}", "--grid.length=50"]
    kind = ["--default-junction-type=allway_stop", "--no-turnarounds"]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "grid.net.xml"
        subprocess.run([str(tool), *size, *kind, f"--output-file={made}"], check=True, capture_output=True)
        return made.read_text()


class World:
    """A grid with cars on it; its size follows from the number of cars, as ours."""

    def __init__(self, cars: int) -> None:
        self.cars = cars
        if libsumo.isLoaded():
            libsumo.close()
        with tempfile.TemporaryDirectory() as folder:
            network = Path(folder) / "grid.net.xml"
            network.write_text(grid(4, 5) if cars <= 8 else grid(10, 16))
            quiet = ["--no-step-log", "--no-warnings", "--duration-log.disable"]
            options = [f"--step-length={STEP}", "--collision.check-junctions", "--time-to-teleport=-1"]
            libsumo.start(["sumo", f"--net-file={network}", *options, *quiet])
            roads = sumolib.net.readNet(str(network))
        draws = random.Random(1)
        for n, edge in enumerate(draws.sample(roads.getEdges(), cars)):
            libsumo.route.add(f"route{n}", walk(edge, draws))
            libsumo.vehicle.add(f"car{n}", f"route{n}")
        while libsumo.vehicle.getIDCount() < cars:
            self.tick()

    def drive(self) -> int:
        """Go on for some minutes; SUMO is called once."""
        began = libsumo.simulation.getTime()
        libsumo.simulationStep(began + SECONDS)
        if libsumo.vehicle.getIDCount() != self.cars:
            raise RuntimeError("cars have arrived")
        return round((libsumo.simulation.getTime() - began) / STEP) * self.cars

    def tick(self) -> None:
        """Go on for a step."""
        libsumo.simulationStep()

    def positions(self) -> list[tuple[float, float]]:
        """Return where the cars are."""
        return [libsumo.vehicle.getPosition(f"car{n}") for n in range(self.cars)]


def walk(edge: sumolib.net.edge.Edge, draws: random.Random) -> list[str]:
    """Return a random route that begins with an edge."""
    names = [edge.getID()]
    for _ in range(ROUTE):
        edge = draws.choice(sorted(edge.getOutgoing(), key=lambda one: one.getID()))
        names.append(edge.getID())
    return names


run(libsumo.getVersion()[1].removeprefix("SUMO "), World)
