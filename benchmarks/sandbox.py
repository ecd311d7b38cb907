"""What a box costs: its start beside that of bare Python, and a tick beside one of the same program without a box."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.table import Row
from dubins_traffic.cars.state import Observation
from dubins_traffic.controllers.registry import load
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import Trial
from dubins_traffic.sandbox.available import available_layers
from dubins_traffic.sandbox.controller import BoxedController
from dubins_traffic.sandbox.launch import Program
from dubins_traffic.sandbox.layers import ENVIRONMENT, JUDGE, Layers
from dubins_traffic.sandbox.limits import Limits
from dubins_traffic.sandbox.process import Processes
from dubins_traffic.sandbox.submission import PYTHON, interpreter, program_of

STARTS = 30
"""Starts of each kind, in turn, so that whatever the machine does meanwhile meets both."""
TICKS = 3000
MOST_STARTS = 3.0
MOST_TICK = 0.15e-3
"""Seconds that a box may cost a tick, by the medians."""
SPEC = f"{Path(__file__).parents[1] / 'examples' / 'controller.py'}:Homing"
BARE = Layers(frozenset({JUDGE, ENVIRONMENT}))


def bare_start() -> float:
    """Return how long Python takes to begin and end."""
    began = perf_counter()
    subprocess.run([sys.executable, "-c", "pass"], check=True, stdin=subprocess.DEVNULL)
    return perf_counter() - began


def boxed_start() -> float:
    """Return how long Python takes in a box as the shim begins it, and to take the box down."""
    python, shown, _ = interpreter()
    library = {"LD_LIBRARY_PATH": f"{PYTHON}/lib"} if python.startswith(PYTHON) else {}
    began = perf_counter()
    processes = Processes(Program((python, "-I", "-S", "-c", "pass"), shown, library), Limits(), available_layers())
    status = processes.status(60.0)
    processes.close()
    assert status == "status 0", status
    return perf_counter() - began


def observations() -> list[Observation]:
    """Return what an ego sees that is driven by the same controller, tick by tick."""
    instance = draw(load_config("demo"), seed=1)
    controller, found = load(SPEC), []
    controller.start(instance.problem)
    with Trial(instance) as trial:
        seen = trial.observation
        while trial.ending is None and len(found) < TICKS:
            found.append(seen)
            seen = trial.step(controller.act(seen) or (0.0, 0.0))
    return found


def ticks() -> tuple[list[float], list[float], list[float]]:
    """Return seconds of ticks in a box, without a box, and in this process."""
    problem = draw(load_config("demo"), seed=1).problem
    boxed = BoxedController(program_of(SPEC), Limits(), available_layers())
    bare = BoxedController(program_of(SPEC), Limits(), BARE)
    here = load(SPEC)
    found: tuple[list[float], list[float], list[float]] = ([], [], [])
    try:
        for each in (boxed, bare, here):
            each.start(problem)
        for seen in observations():
            for each, times in zip((boxed, bare, here), found, strict=True):
                began = perf_counter()
                each.act(seen)
                times.append(perf_counter() - began)
    finally:
        boxed.close()
        bare.close()
    return found


def measure() -> list[Row]:
    """Return the figures."""
    pairs = [(bare_start(), boxed_start()) for _ in range(STARTS)]
    bare, boxed = (median(each) for each in zip(*pairs, strict=True))
    inside, outside, here = (median(each) for each in ticks())
    return [
        Row(
            "start of a box, and its end",
            f"{boxed * 1e3:.1f} ms, {boxed / bare:.2f} times bare Python's {bare * 1e3:.1f} ms",
            f"at most {MOST_STARTS:g} times",
            boxed <= MOST_STARTS * bare,
        ),
        Row(
            "a tick in a box, median",
            f"{inside * 1e6:.0f} us, {(inside - outside) * 1e6:+.0f} us beside the same without a box",
            f"at most {MOST_TICK * 1e6:.0f} us more",
            inside - outside <= MOST_TICK,
        ),
        Row(
            "a tick in a box beside one in process",
            f"{(inside - here) * 1e6:+.0f} us",
            f"at most {MOST_TICK * 1e6:.0f} us more",
            inside - here <= MOST_TICK,
        ),
    ]
