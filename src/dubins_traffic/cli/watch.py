"""`dubins-traffic watch`."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any, get_type_hints

from dubins_traffic.cli import faults, options
from dubins_traffic.cli.run import run
from dubins_traffic.errors import needs

if TYPE_CHECKING:
    from dubins_traffic.record.reader import Record

EXAMPLES = options.examples(
    "watch town --controller rules",
    "watch junction --controller my_controller.py:MyController --trials 1 --pace 2",
    "watch out/trial-0003.mcap",
    "watch town --no-browser --port 8765",
)
_PAGE = ("pace", "port", "no_browser")
"""Options of the page, by the parameter of `run`; all others say what is run."""
_HINTS = get_type_hints(run, include_extras=True)
_PARAMETERS = [
    parameter.replace(annotation=_HINTS[parameter.name])
    for parameter in inspect.signature(run).parameters.values()
    if parameter.name != "watch"
]


def watch(source: str, **chosen: Any) -> None:
    """Show trials in a page of the browser as they run, or a record, also one that is still being written.

    It takes the options of `run`; with one of them the trial of a record is run again. Ctrl-C ends it.
    """
    from dubins_traffic.record.reader import Record
    from dubins_traffic.runs.plan import load_runnable

    usual = {parameter.name: parameter.default for parameter in _PARAMETERS}
    page = {name: chosen[name] for name in _PAGE}
    if all(value == usual[name] for name, value in chosen.items() if name not in _PAGE):
        runnable = load_runnable(source, rnd=None, seed=0)
        if isinstance(runnable, Record):
            _show(source, runnable, **page)
            return
    run(source, watch=True, **chosen)


watch.__annotations__ = {parameter.name: parameter.annotation for parameter in _PARAMETERS}
setattr(watch, "__signature__", inspect.Signature(_PARAMETERS))  # noqa: B010  # a function has none of its own


def _show(source: str, record: Record, *, pace: float, port: int, no_browser: bool) -> None:
    with needs("watching a record in a page", "watch"):
        from dubins_traffic.live.stage import Stage

    from dubins_traffic.cli.tables import summary
    from dubins_traffic.live.recorded import show
    from dubins_traffic.scoring.score import score

    page = Stage(options.tell, port, opens=not no_browser, pace=pace)
    with faults.interruptible(lambda: "interrupted"), page as stage:
        last = show(stage.feed, source, record)
        scored = score(last)
        stage.feed.end(last.instance, last.ending, summary(scored), scored.verdict)
