"""The task of a worker of a Ray cluster: one chunk.

The process that drives Ray names it and hands chunks on as they came, so that it need not load what runs them.
"""

from __future__ import annotations

import pickle
from importlib.metadata import version
from typing import TYPE_CHECKING

from dubins_traffic.errors import DubinsTrafficError

if TYPE_CHECKING:
    from dubins_traffic.campaign.engines import Numbered
    from dubins_traffic.campaign.worker import Surroundings

PACKAGE = "dubins-traffic"


def run(chunk: bytes, around: bytes, wanted: str) -> bytes:
    """Run a chunk and return its part of the table.

    Parameters
    ----------
    chunk, around : bytes
        The chunk and the surroundings, pickled.
    wanted : str
        The version of this package that they are of.

    Raises
    ------
    DubinsTrafficError
        If this node has another version.
    """
    own = version(PACKAGE)
    if own != wanted:
        raise DubinsTrafficError(f"a node has {PACKAGE} {own}, not {wanted}")
    from dubins_traffic.campaign.worker import run_part

    known: Numbered = pickle.loads(chunk)
    shared: Surroundings = pickle.loads(around)
    return run_part(known, shared)
