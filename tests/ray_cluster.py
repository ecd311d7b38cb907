"""A Ray cluster of several nodes on this machine, in a process of its own, and the words to harm it."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from tests.tools import need_module

NODES = 3
NOTICE: dict[str, Any] = {
    "health_check_initial_delay_ms": 1000,
    "health_check_period_ms": 500,
    "health_check_failure_threshold": 3,
}
"""How soon the head notices that a node is gone: within some two seconds, not the usual twenty."""


class RayCluster:
    """A cluster of `NODES` nodes with one processor each, one of them its head."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.address = self._answer()

    def kill_node(self) -> None:
        """Kill all processes of a node that is not the head."""
        self._tell("node")

    def kill_head(self) -> None:
        """Kill all processes of the head."""
        self._tell("head")

    def actors(self) -> list[int]:
        """Return the processes of the cluster that are actors."""
        parents = _parents()
        return [process for process in parents if self._process.pid in _line(process, parents) and _is_actor(process)]

    def _tell(self, word: str) -> None:
        print(word, file=_there(self._process.stdin), flush=True)
        assert self._answer() == word

    def _answer(self) -> str:
        return _there(self._process.stdout).readline().strip()


def _there(stream: IO[str] | None) -> IO[str]:
    assert stream is not None
    return stream


@contextmanager
def running() -> Generator[RayCluster]:
    """Start a cluster, and stop it in the end."""
    need_module("ray")
    arguments = [sys.executable, "-m", "tests.ray_cluster"]
    environment = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0"}
    pipe = subprocess.PIPE
    with subprocess.Popen(
        arguments, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True, env=environment
    ) as process:
        try:
            yield RayCluster(process)
        finally:
            _there(process.stdin).close()
            process.wait(timeout=600)


def main() -> None:
    """Start the cluster, do as standard input says, and stop it at its end."""
    from ray.cluster_utils import Cluster

    common: dict[str, Any] = {
        "num_cpus": 1,
        "object_store_memory": 80_000_000,
    }
    head = {**common, "include_dashboard": False, "_system_config": NOTICE}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    nodes = [cluster.add_node(wait=False, **common) for _ in range(NODES - 1)]
    cluster.wait_for_nodes()
    helpers = _helpers()
    print(cluster.address, flush=True)
    for line in sys.stdin:
        word = line.strip()
        if word == "node":
            cluster.remove_node(nodes.pop(), allow_graceful=False)
        elif word == "head":
            cluster.head_node.kill_gcs_server()
            cluster.head_node.kill_raylet()
        print(word, flush=True)
    cluster.shutdown()
    for helper in helpers:
        with contextlib.suppress(ProcessLookupError):
            os.kill(helper, signal.SIGKILL)


def _helpers() -> list[int]:
    """Return the processes that those started here have started: Ray leaves them behind when these are killed."""
    parents = _parents()
    return [child for child, parent in parents.items() if parents.get(parent) == os.getpid()]


def _parents() -> dict[int, int]:
    """Return the parent of each process of this machine."""
    parents: dict[int, int] = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()
            parents[int(status.parent.name)] = int(fields[1])
    return parents


def _line(process: int, parents: dict[int, int]) -> set[int]:
    """Return the parent of a process, that of its parent, and so on."""
    found: set[int] = set()
    while (process := parents.get(process, 0)) > 1:
        found.add(process)
    return found


def _is_actor(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/cmdline").read_text().startswith("ray::Carried")
    except OSError:
        return False


if __name__ == "__main__":
    main()
