"""What rooms ask of rooms above them: who draws a value, tabulates it, boxes a controller, or adds to a registry.

A road network knows nothing of drawing, a score nothing of tables of campaigns, the names of controllers nothing of
boxes or games, the map formats nothing of other programs, since imports only go down. `dubins_traffic` says who answers
when it is imported.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:  # without the module `typing`, as in the package itself
    from collections.abc import Callable, Mapping
    from typing import Any


def _nobody(*_asked: object) -> Any:
    raise RuntimeError("nobody answers before dubins_traffic has been imported")


class Above:
    """Who answers.

    Attributes
    ----------
    html_of
        Returns the page, HTML, that a notebook shows of a value.
    rows_of
        Returns a value as rows of a table of trials, each a dict.
    boxed
        Returns the controller of a name, in a box with the limits of a text.
    compiled
        Returns the machine code of a kernel for arguments of some kinds where no library holds it, or what waits for
        it while it is compiled (`kernels.compile.Waiting`); None if there will be none.
    why_no_boxes
        Returns why no stranger's controller can be boxed on this machine; empty if it can.
    parts
        Returns what rooms above add to a registry (``map formats``, ``simulators``, ``controllers``, ``e-agents``): by
        name, what imports and returns it when it is called.
    """

    def __init__(self) -> None:
        self.html_of: Callable[[Any], str] = _nobody
        self.rows_of: Callable[[Any], list[dict[str, Any]]] = _nobody
        self.boxed: Callable[[str, str], Any] = _nobody
        self.compiled: Callable[[Any, Any], Any] = _nobody
        self.why_no_boxes: Callable[[], str] = _nobody
        self.parts: Callable[[str], Mapping[str, Callable[[], Any]]] = _nobody


ABOVE = Above()
