"""The companion: compiles what processes have asked for, one kernel after another.

``python -m dubins_traffic.kernels.companion [--behind]``, which stands back behind all other processes. There is one
for an installation and a cache folder at a time. It ends some seconds after nothing is asked for any more, and after
ten minutes in any case; what is left then is compiled when it is next asked for.
"""

from __future__ import annotations

import ast
import contextlib
import importlib
import json
import os
import sys
import traceback
from pathlib import Path
from threading import Thread
from time import monotonic, process_time, sleep
from typing import TYPE_CHECKING, Any

from dubins_traffic.kernels import asking, store

if TYPE_CHECKING:
    from dubins_traffic.kernels.compiler import Compiler

NICE = 19
"""How much the companion stands back behind others."""
SESSION = Path("/proc/self/autogroup")
"""Where Linux is told how much the processes of a session stand back behind those of others."""
HEARD = 2.0
"""Seconds for which it tries to tell Linux so, while others do the same."""
LINGER = 5.0
"""Seconds for which it waits for more to do."""
LONGEST = 600.0
"""Seconds after which it begins nothing more."""
SETTLE = 1.0
"""Seconds for which it tries to be the only one: others look into the lock for a moment."""
PAUSE = 0.05
LOOK = 1.0
"""Seconds between two looks for whether somebody is in a hurry."""
SHARE = 0.6
"""The part of a processor that is little, for a process that always has something to do."""


def main() -> None:
    """Compile until nothing is asked for, if no other companion is at work."""
    if "--behind" in sys.argv[1:]:
        _stand_back()
        Thread(target=_make_room, daemon=True).start()
    began = monotonic()
    while monotonic() < began + SETTLE:
        with asking.locked() as free:
            if free:
                _work(began)
                return
        sleep(PAUSE)


def _stand_back() -> None:
    """Leave processors to all other processes, where the system can: run only where one would be idle.

    Some systems share processors among sessions first, and among the processes of each then. The companion has a
    session of its own, which would get as much as that of the command; so that stands back as well.
    """
    os.nice(NICE)
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


def _make_room() -> None:
    """End this process when another is in a hurry and this one, behind all others, gets little done."""
    hurry = asking.folder() / asking.HURRY
    while True:
        clock, used = monotonic(), process_time()
        sleep(LOOK)
        if hurry.exists() and process_time() - used < SHARE * (monotonic() - clock):
            os._exit(0)  # what it was at is still asked for


def _work(began: float) -> None:
    (asking.folder() / asking.HURRY).unlink(missing_ok=True)
    compiler: Compiler | None = None
    latest = monotonic()
    while monotonic() < min(latest + LINGER, began + LONGEST):
        notes = _notes()
        if not notes:
            sleep(PAUSE)
            continue
        wish = _read(notes[0])
        if wish is not None:
            if compiler is None:
                compiler = _begin()
            _compile(compiler, wish)
        notes[0].unlink(missing_ok=True)
        latest = monotonic()


def _begin() -> Compiler:
    """Return the compiler, and let modules that are imported from now on make their kernels with it."""
    from dubins_traffic.kernels import compile as making
    from dubins_traffic.kernels.compiler import Compiler

    compiler = Compiler()
    making.companion = compiler.jit
    return compiler


def _notes() -> list[Path]:
    """Return what is asked for, the longest wanted first."""
    found: list[tuple[int, Path]] = []
    for path in asking.folder().glob("*.json"):
        with contextlib.suppress(FileNotFoundError):
            found.append((path.stat().st_mtime_ns, path))
    return [path for _, path in sorted(found)]


def _read(note: Path) -> asking.Wish | None:
    """Return what a note asks for, None if that is there already or can't be understood."""
    try:
        own: dict[str, Any] = json.loads(note.read_bytes())
        wish = asking.Wish(**own)
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return None if wish.path.exists() else wish


def _compile(compiler: Compiler, wish: asking.Wish) -> None:
    from dubins_traffic.kernels.machine import processor

    try:
        sys.path.extend(path for path in wish.paths if path not in sys.path)
        kinds = ast.literal_eval(wish.kinds)
        found = importlib.import_module(wish.module)
        if not Path(found.__file__ or "").samefile(wish.file):
            raise ImportError(f"{wish.module} is {found.__file__} here")
        if store.kernel_file(Path(wish.file), wish.name, kinds, processor()) != wish.path:
            raise ImportError(f"{wish.file} is another than that which runs")
        code, answer = compiler.machine_code(
            compiler.kernel(found, wish.name), kinds, store.symbol(wish.path)
        )
        store.save(wish.path, answer, code)
    except Exception:
        with contextlib.suppress(OSError):
            store.write_whole(wish.failure, traceback.format_exc().encode())


if __name__ == "__main__":
    main()
    os._exit(0)  # all is on disk; to take down what Numba has made, part by part, takes as long as a kernel
