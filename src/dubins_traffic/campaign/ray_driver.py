"""The process that runs errands on Ray: takes them from a pipe, sends back what came of them.

It handles them as bytes and imports none of the modules that run trials, so that it joins a cluster sooner.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import sys
import threading
from concurrent.futures import Future
from functools import partial
from importlib import import_module
from importlib.metadata import version
from multiprocessing.connection import Connection
from typing import Any, TypeAlias

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.runs.processes import prepare_worker

LOCAL = "local"
ALIVE, DONE, FAILED = "alive", "done", "failed"
"""Kinds of messages: (alive, processors of the cluster), (done, number, result or None if lost), (failed, why)."""
PULSE = 1.0
"""Seconds between signs of life."""

_Event: TypeAlias = tuple[int, bytes | Future[bytes]] | None
"""An errand that has come, or one that is done, by its number; None: the pipe is closed."""
PACKAGE = "dubins-traffic"


def drive(pipe: Connection, address: str, workers: int, paths: tuple[str, ...]) -> None:
    """Join the cluster at `address` and run errands until the pipe is closed at the other end.

    Parameters
    ----------
    pipe : Connection
        Errands come from it as (number, the errand pickled); messages go into it.
    address : str
        As of `RayCrew`.
    workers : int
        Processors of a local cluster.
    paths : tuple of str
        Where workers look modules up.
    """
    prepare_worker()
    # Ray's own words, pages of them when a node is lost, stand in its logs; ours go through the pipe.
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for output in (1, 2):
        os.dup2(nowhere, output)
    ray: Any = import_module("ray")
    send = _Sender(pipe)
    over = threading.Event()
    beat = threading.Thread(target=_beat, args=(ray, send, over), daemon=True)
    try:
        join(ray, address, workers)
        beat.start()
        _Driver(ray, pipe, send, paths).run()
    except (BrokenPipeError, EOFError):
        pass  # the other end of the pipe has gone
    except Exception as error:
        send(FAILED, f"{type(error).__name__}: {error}")
    finally:
        over.set()
        if beat.is_alive():
            beat.join(PULSE)
        ray.shutdown()


def join(ray: Any, address: str, workers: int | None) -> None:
    """Join the cluster at an address; ``local``: begin one of so many processors."""
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if address == LOCAL:
        # as processes of this machine; 15 is meant for shared machines
        os.environ.setdefault("RAY_worker_niceness", "0")
        quiet |= {"num_cpus": workers, "include_dashboard": False}
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
    """Send the number of the cluster's processors every second, as long as its head answers and chunks may come."""
    gone = (BrokenPipeError, ray.exceptions.RayError)  # nobody is left to tell, or nothing but silence
    with contextlib.suppress(*gone):
        while not over.is_set():
            nodes: list[dict[str, Any]] = ray.nodes()
            send(ALIVE, int(sum(node["Resources"].get("CPU", 0) for node in nodes if node["Alive"])))
            over.wait(PULSE)


class _Driver:
    """Hands errands over as they come, and what came of them back as they are done."""

    def __init__(self, ray: Any, pipe: Connection, send: _Sender, paths: tuple[str, ...]) -> None:
        self._errors = ray.exceptions
        self._send = send
        self._paths = ray.put(paths)
        self._task = ray.remote(num_cpus=1, max_retries=0)(run)
        self._version = version(PACKAGE)
        self._events: queue.SimpleQueue[_Event] = queue.SimpleQueue()
        threading.Thread(target=self._listen, args=(pipe,), daemon=True).start()

    def run(self) -> None:
        """Run errands until the other end of the pipe is closed."""
        while (event := self._events.get()) is not None:
            number, what = event
            if isinstance(what, bytes):
                future: Future[bytes] = self._task.remote(what, self._paths, self._version).future()
                future.add_done_callback(partial(self._note, number))
            else:
                self._send(DONE, number, self._result(what))

    def _note(self, number: int, done: Future[bytes]) -> None:
        self._events.put((number, done))

    def _result(self, done: Future[bytes]) -> bytes | None:
        """Return what came of an errand, None if it was lost with a worker or a node.

        Raises
        ------
        DubinsTrafficError
            If the worker is fit for nothing, such as one of another version.
        """
        try:
            return done.result()
        except self._errors.RayTaskError as error:
            raise DubinsTrafficError(str(error.cause or error)) from None
        except self._errors.RayError:
            return None

    def _listen(self, pipe: Connection) -> None:
        try:
            while True:
                self._events.put(pipe.recv())
        except (EOFError, OSError):
            self._events.put(None)


def run(errand: bytes, paths: tuple[str, ...], wanted: str) -> bytes:
    """Run an errand in a worker of the cluster; both it and what comes of it are pickled.

    The process that drives Ray names this task and hands errands on as they came, so that it need not load what runs
    them.

    Raises
    ------
    DubinsTrafficError
        If this node has another version of the package than the one that is wanted.
    """
    installed = version(PACKAGE)
    if installed != wanted:
        raise DubinsTrafficError(f"a node has {PACKAGE} {installed}, not {wanted}")
    sys.path += [path for path in paths if path not in sys.path]
    return pickle.dumps(pickle.loads(errand).run(lambda: False))
