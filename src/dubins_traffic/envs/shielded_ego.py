"""The shield as a wrapper of single environments for Gymnasium."""

from __future__ import annotations

from typing import Any, cast

import gymnasium
from gymnasium.utils import RecordConstructorArgs

from dubins_traffic.envs.single import TrafficEnv
from dubins_traffic.errors import InputError
from dubins_traffic.shield.tables import Overtakes


class ShieldedEgo(gymnasium.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """An environment whose ego keeps rules 1 to 3 under a shield, whatever its actions.

    In every tick a command that would break a rule is changed to the nearest one that breaks none;
    ``info["interventions"]`` is the number of ticks of the step in which that was done, and
    ``env.unwrapped.given`` has what was let through, with which `run_trial` makes the same frames.

    Parameters
    ----------
    env : gymnasium.Env
        A `TrafficEnv`, or a wrapper of one.
    overtakes : {"sure", "law", "never"}
        When it may cross the centre line, see docs/shield.md.

    Raises
    ------
    InputError
        If it is another environment, its car can't keep the rules, or `overtakes` is something else.
    """

    def __init__(self, env: gymnasium.Env[Any, Any], *, overtakes: Overtakes = "sure") -> None:
        RecordConstructorArgs.__init__(self, overtakes=overtakes)
        gymnasium.Wrapper.__init__(self, env)
        base = cast(object, env.unwrapped)
        if not isinstance(base, TrafficEnv):
            raise InputError("no shield", field="env", value=type(base).__name__, expected="a TrafficEnv")
        base.shield(overtakes)
