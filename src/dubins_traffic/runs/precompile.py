"""The first run on a machine compiles the kernels in two processes.

A trial compiles what it needs in the order in which it needs it, labels first. Where nothing has been compiled yet,
a companion process (`python -m dubins_traffic.runs.precompile`) begins with what comes last, motion and e-agents, and
leaves it in the common cache for the trial to find.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Generator

import numpy as np

from dubins_traffic.kernels.compile import nothing_compiled


@contextlib.contextmanager
def companion() -> Generator[subprocess.Popen[bytes] | None]:
    """Compile in a second process while the body runs, if this is a first run and there is a second core.

    Yields that process, or None where there is none. It is ended with the body.
    """
    if (os.cpu_count() or 1) < 2 or not nothing_compiled():
        yield None
        return
    command = [sys.executable, "-m", "dubins_traffic.runs.precompile"]
    quiet = subprocess.DEVNULL
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def compile_motion_and_agents() -> None:
    """Compile what moves the cars and what drives the e-agents, by one tick of a shipped instance."""
    from dubins_traffic.agents.fleet import Fleet
    from dubins_traffic.cars.state import Labels
    from dubins_traffic.problem.configuration import load_config
    from dubins_traffic.problem.draw import draw
    from dubins_traffic.simulators.embedded import Embedded

    instance = draw(load_config("demo"), 0, 0)
    simulator, fleet = Embedded(), Fleet()
    state = simulator.reset([instance])
    commands = np.zeros((*state.x.shape, 2))
    simulator.step(commands)
    fleet.reset([instance], state)
    fleet.decide(0, state, Labels.zeros(*state.x.shape), commands)


if __name__ == "__main__":
    compile_motion_and_agents()
