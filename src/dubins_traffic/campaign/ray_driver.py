"""The process that drives Ray for a campaign: takes chunks from a pipe, sends their parts back."""

from __future__ import annotations

import contextlib
import os
import queue
import threading
from importlib import import_module
from importlib.metadata import version
from multiprocessing.connection import Connection
from typing import Any

from dubins_traffic.campaign.campaign import Chunk
from dubins_traffic.campaign.orphans import end_with_parent
from dubins_traffic.campaign.work import Surroundings, run_part
from dubins_traffic.errors import DubinsTrafficError

ALIVE, DONE, FAILED = "alive", "done", "failed"
"""Kinds of messages: (alive, processors of the cluster), (done, number, part or None if lost), (failed, why)."""
PULSE = 1.0
"""Seconds between signs of life."""
PAUSE = 0.05
"""Longest time for which a new chunk waits to be noticed, seconds."""


def drive(pipe: Connection, address: str, workers: int, around: Surroundings) -> None:
    """Join the cluster at `address` and run chunks until the pipe is closed at the other end."""
    end_with_parent()
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    # Ray's own words stand in its logs; ours go through the pipe.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    ray: Any = import_module("ray")
    send = _Sender(pipe)
    over = threading.Event()
    beat = threading.Thread(target=_beat, args=(ray, send, over), daemon=True)
    try:
        _join(ray, address, workers)
        beat.start()
        _Driver(ray, pipe, send, around).run()
    except (BrokenPipeError, EOFError):
        pass  # nobody is left to tell
    except Exception as error:
        send(FAILED, f"{type(error).__name__}: {error}")
    finally:
        over.set()
        if beat.is_alive():
            beat.join(PULSE)
        ray.shutdown()


def _join(ray: Any, address: str, workers: int) -> None:
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address == "local":
        os.environ.setdefault(
            "RAY_worker_niceness", "0"
        )  # as processes of the pool; 15 is meant for shared machines
        ray.init(address="local", num_cpus=workers, include_dashboard=False, **quiet)
    else:
        ray.init(address=address, **quiet)


class _Sender:
    """Sends messages from several threads."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._lock = threading.Lock()

    def __call__(self, *message: Any) -> None:
        with self._lock:
            self._pipe.send(message)


def _beat(ray: Any, send: _Sender, over: threading.Event) -> None:
    """Tell how many processors the cluster has, as long as its head answers and the work is not over."""
    gone = (BrokenPipeError, ray.exceptions.RayError)  # nobody is left to tell, or nothing but silence
    with contextlib.suppress(*gone):
        while not over.is_set():
            nodes: list[dict[str, Any]] = ray.nodes()
            send(ALIVE, int(sum(node["Resources"].get("CPU", 0) for node in nodes if node["Alive"])))
            over.wait(PULSE)


class _Driver:
    """Keeps the chunks that are under way."""

    def __init__(self, ray: Any, pipe: Connection, send: _Sender, around: Surroundings) -> None:
        self._ray = ray
        self._send = send
        self._around = ray.put(around)
        self._task = ray.remote(num_cpus=1, max_retries=0)(_run)
        self._version = version("dubins-traffic")
        self._numbers: dict[Any, int] = {}
        self._waiting: queue.SimpleQueue[Chunk | None] = queue.SimpleQueue()
        threading.Thread(target=self._listen, args=(pipe,), daemon=True).start()

    def run(self) -> None:
        """Run chunks until there is nobody to run them for."""
        while self._submit():
            if not self._numbers:
                continue
            ready, _ = self._ray.wait(list(self._numbers), num_returns=1, timeout=PAUSE)
            for reference in ready:
                self._send(DONE, self._numbers.pop(reference), self._result(reference))

    def _submit(self) -> bool:
        """Hand over what has come; with nothing under way wait for it. False: the pipe is closed."""
        chunk: Chunk | None
        while True:
            try:
                chunk = self._waiting.get(block=not self._numbers)
            except queue.Empty:
                return True
            if chunk is None:
                return False
            reference = self._task.remote(chunk, self._around, self._version)
            self._numbers[reference] = chunk.number

    def _result(self, reference: Any) -> bytes | None:
        """Return the part of a chunk, None if it was lost with a worker or a node.

        Raises
        ------
        DubinsTrafficError
            If the worker is fit for nothing, such as one of another version.
        """
        errors = self._ray.exceptions
        try:
            return self._ray.get(reference)
        except errors.RayTaskError as error:
            raise DubinsTrafficError(str(error.cause or error)) from None
        except errors.RayError:
            return None

    def _listen(self, pipe: Connection) -> None:
        try:
            while True:
                self._waiting.put(pipe.recv())
        except (EOFError, OSError):
            self._waiting.put(None)


def _run(chunk: Chunk, around: Surroundings, wanted: str) -> bytes:
    """Run a chunk on a worker of the cluster."""
    if version("dubins-traffic") != wanted:
        raise DubinsTrafficError(f"a node has dubins-traffic {version('dubins-traffic')}, not {wanted}")
    return run_part(chunk, around)
