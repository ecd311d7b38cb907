"""Labels as texts, in the form of 2016: `<car>_s_x0_y0_x1_y1` and `<car>_t_x_y`."""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.cars.state import Labels
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.roads.network import RoadNetwork


def words(network: RoadNetwork, names: Sequence[str], segment: Ints, at: Ints) -> tuple[str, ...]:
    """Return the labels that hold in one frame.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    names : sequence of str
        Names of the cars.
    segment, at : (N,) int64
        Nearest segment of each car, and the intersection whose disc holds its centre (-1: none).

    Returns
    -------
    tuple of str
        One segment label per car, by car, each followed by the intersection label if there is one.
    """
    labels: list[str] = []
    for n, name in enumerate(names):
        x0, y0, x1, y1 = network.segments[int(segment[n])]
        labels.append(f"{name}_s_{x0}_{y0}_{x1}_{y1}")
        v = int(at[n])
        if v >= 0:
            x, y = network.intersections[v]
            labels.append(f"{name}_t_{x}_{y}")
    return tuple(labels)


class Caption:
    """The labels, as texts, that hold in the latest frame of a trial; they are made anew only when they change.

    Parameters
    ----------
    network : RoadNetwork
        The roads.
    names : sequence of str
        Names of the cars.
    """

    def __init__(self, network: RoadNetwork, names: Sequence[str]) -> None:
        self._network, self._names = network, names
        self._shown = (b"", b"")
        self.words: list[str] = []

    def update(self, labels: Labels) -> bool:
        """Take the labels of trial 0 of a batch; return whether the texts have changed."""
        segment, at = labels.segment[0], labels.at[0]
        shown = (segment.tobytes(), at.tobytes())
        if shown == self._shown:
            return False
        self._shown = shown
        self.words = list(words(self._network, self._names, segment, at))
        return True
