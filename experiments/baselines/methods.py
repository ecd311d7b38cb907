"""The methods: what drives, what it assumes, and what it needs beside this package."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from dubins_traffic.problem.instance import Instance
from experiments.baselines.gr1 import tulip

HERE: Final = Path(__file__).parent
_LEARNED: Final = HERE.parents[1] / "examples" / "learning"


@dataclass(frozen=True, slots=True)
class Method:
    """A method: its name on the page, the controller, and what there is to say about it in a sentence."""

    title: str
    controller: str | Callable[[Instance], str]
    says: str
    needs: str = ""
    """The library that it needs, as in its `constraints.txt`; none for most."""

    def drives(self, instance: Instance) -> str:
        """Return the controller in a trial."""
        return self.controller if isinstance(self.controller, str) else self.controller(instance)


def _of(folder: str, name: str) -> str:
    return f"experiments.baselines.{folder}.controller:{name}"


METHODS: Final[Mapping[str, Method]] = {
    "simple": Method("`simple`", "simple", "straight across country from goal to goal, as in 2016"),
    "lanes": Method("`lanes`", "lanes", "keeps to its lane and behind others, and overtakes; stops nowhere"),
    "rules": Method("`rules`", "rules", "keeps all the rules, by construction"),
    "potential": Method(
        "potential field", _of("potential", "Potential"), "pulled along the lane, pushed away by cars"
    ),
    "orca": Method(
        "ORCA", _of("orca", "Orca"), "the velocity nearest to the lane's that meets nobody", "pyrvo"
    ),
    "rrt": Method(
        "RRT*", _of("rrt", "Rrt"), "tracks the lane, and plans Dubins paths past who is in the way", "ompl"
    ),
    "mpc": Method(
        "model predictive control", _of("mpc", "Mpc"), "tracks the lane for two seconds ahead, clear of others",
        "casadi",
    ),
    "gr1": Method(
        "GR(1) synthesis", _of("gr1", "Gr1"),
        "the winning strategy of the game of cells; gives up where that has over 3,000,000 positions",
    ),
    "gr1-tulip": Method(
        "GR(1) synthesis by TuLiP", tulip.controller,
        "the same by TuLiP, from the start of each trial; by the rules where it has no answer; "
        "gives up over 3,000 positions", "tulip",
    ),
    "cloning": Method(
        "cloned from `rules`", str(_LEARNED / "junction.npz"), "DAgger on `junction`, a network of 96 and 48"
    ),
    "evolved": Method(
        "evolution strategy", str(_LEARNED / "town.npz"), "on `town`, by the return of earlier environments"
    ),
    "ppo": Method(
        "PPO", str(HERE / "ppo" / "ppo.npz"), "on `junction`, with the default reward; the median of three seeds"
    ),
    "ppo-shielded": Method(
        "PPO taught under the shield", str(HERE / "ppo" / "shielded.npz"),
        "the same, and the shield was there while it learned; the median of three seeds",
    ),
    "ppo-lagrangian": Method(
        "PPO-Lagrangian", str(HERE / "ppo" / "lagrangian.npz"),
        "PPO with a multiplier on breaches, so that an episode costs one at most; the median of three seeds",
    ),
}  # fmt: skip
