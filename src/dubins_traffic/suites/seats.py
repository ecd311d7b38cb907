"""Where the controllers of a suite run: strangers' in boxes, so that they can't write their own results."""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.sandbox.available import available_layers


def seated(specs: Sequence[str]) -> tuple[list[str], str]:
    """Return controllers with a box for each whose code is not ours, and a notice on those for which there is none.

    Parameters
    ----------
    specs : sequence of str
        Names of controllers; those that ask for a box have it already.

    Returns
    -------
    specs : list of str
        The names with which they run.
    notice : str
        Says which run in this process, trusted, since this machine has no boxes; empty if none does.
    """
    strangers = [
        spec
        for spec in specs
        if controllers.ran(spec) == controllers.IN_PROCESS and not controllers.is_ours(spec)
    ]
    if not strangers:
        return list(specs), ""
    try:
        available_layers().require()
    except InputError as error:
        return list(specs), f"{', '.join(strangers)}: in process, trusted, since {error.problem}"
    return [controllers.sandboxed(spec) if spec in strangers else spec for spec in specs], ""
