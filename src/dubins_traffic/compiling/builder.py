"""The builder: one process that compiles what it is told, one kernel after another.

``python -m dubins_traffic.compiling.builder [--behind]``, which stands back behind all other processes;
`compiling.beside` begins it and tells it by standard input what is wanted, a line for a kernel. It ends when it has
compiled all that it was told and whoever began it has ended or has told nothing for a second, and after ten minutes in
any case.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import os
import sys
import traceback
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from time import monotonic, process_time, sleep
from typing import TYPE_CHECKING

from dubins_traffic.compiling import beside, store
from dubins_traffic.errors import shown
from dubins_traffic.kernels.sources import key_of, symbol

if TYPE_CHECKING:
    from dubins_traffic.compiling.compiler import Compiler

NICE = 19
"""How much the builder stands back behind others."""
SESSION = Path("/proc/self/autogroup")
"""Where Linux is told how much the processes of a session stand back behind those of others."""
HEARD = 2.0
"""Seconds for which it tries to tell Linux so, while others do the same."""
LINGER = 1.0
"""Seconds for which it waits for more to do; others may wait for its lock."""
LONGEST = 600.0
"""Seconds after which it begins nothing more."""
PAUSE = 0.05
LOOK = 1.0
"""Seconds between two looks for whether somebody is in a hurry."""
SHARE = 0.6
"""The part of a processor that is little, for a process that always has something to do."""


def main() -> None:
    """Compile what is told."""
    began = monotonic()
    hurry = store.cache_folder() / beside.HURRY
    hurry.unlink(missing_ok=True)
    if "--behind" in sys.argv[1:]:
        _stand_back()
        Thread(target=_make_room, args=(hurry,), daemon=True).start()
    told: SimpleQueue[bytes] = SimpleQueue()
    Thread(target=_hear, args=(told,), daemon=True).start()
    compiler: Compiler | None = None
    while monotonic() < began + LONGEST:
        try:
            line = told.get(timeout=LINGER)
        except Empty:
            return
        if not line:
            return
        wish = beside.wish_of(line)
        if wish is not None and not wish.path.exists():
            compiler = compiler or _begin()
            _compile(compiler, wish)


def _hear(told: SimpleQueue[bytes]) -> None:
    """Take up what is told, line after line; an empty one when no more can come."""
    for line in sys.stdin.buffer:
        told.put(line)
    told.put(b"")


def _stand_back() -> None:
    """Leave processors to all other processes, where the system can: run only where one would be idle.

    Some systems share processors among sessions first, and among the processes of each then. The builder has a
    session of its own, which would get as much as that of the command; so that stands back as well.
    """
    os.setpriority(os.PRIO_PROCESS, 0, NICE)
    with contextlib.suppress(OSError):
        _stand_back_as_session()
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def _stand_back_as_session() -> None:
    """Let the whole session stand back; of all ordinary users, Linux hears one in a tenth of a second."""
    until = monotonic() + HEARD
    while True:
        try:
            SESSION.write_bytes(str(NICE).encode())
            return
        except BlockingIOError:
            if monotonic() > until:
                return
            sleep(PAUSE)


def _make_room(hurry: Path) -> None:
    """End this process when another is in a hurry and this one, behind all others, gets little done."""
    while True:
        clock, used = monotonic(), process_time()
        sleep(LOOK)
        if hurry.exists() and process_time() - used < SHARE * (monotonic() - clock):
            os._exit(0)  # what it was at is still wanted


def _begin() -> Compiler:
    """Return the compiler, and let modules that are imported from now on make their kernels with it."""
    from dubins_traffic.compiling.compiler import Compiler
    from dubins_traffic.kernels import compile as making

    compiler = Compiler()
    making.builder = compiler.jit
    return compiler


def _compile(compiler: Compiler, wish: beside.Wish) -> None:
    from dubins_traffic.compiling.loading import target

    try:
        sys.path.extend(path for path in wish.paths if path not in sys.path)
        kinds = ast.literal_eval(wish.kinds)
        module = importlib.import_module(wish.module)
        if not Path(module.__file__ or "").samefile(wish.file):
            raise ImportError(f"{wish.module} is {module.__file__} here")
        key = key_of(Path(wish.file), wish.name, kinds)
        if store.kernel_file(key, target()) != wish.path:
            raise ImportError(f"{wish.file} is another than that which runs")
        code, answer = compiler.machine_code(compiler.kernel(module, wish.name), kinds, symbol(key))
        store.save(wish.path, answer, code)
    except Exception as error:
        # Numba's messages end with a line of source: the last line of what is told says what is wrong.
        told = f"{traceback.format_exc()}{shown(f'{type(error).__name__}: {error}', 300)}"
        with contextlib.suppress(OSError):
            store.write_whole(wish.failure, told.encode())


if __name__ == "__main__":
    main()
    os._exit(0)  # all is on disk; to take down what Numba has made, part by part, takes as long as a kernel
