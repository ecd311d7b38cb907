"""Progress bars for people, on standard error."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def progress(trials: int | None = None, *, what: str = "trials") -> Generator[Callable[[int, int], object]]:
    """Show how many of the trials, or of `what` else, are done, on standard error and only to people.

    Yields what is to be told (trials done, trials in all); `trials` is how many there are, if that is known before.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        SpinnerColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    console = Console(stderr=True)
    columns = (
        SpinnerColumn(),
        what,
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        task = shown.add_task(what, total=trials)
        yield lambda done, total: shown.update(task, completed=done, total=total)
