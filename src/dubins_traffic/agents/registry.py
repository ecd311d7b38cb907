"""The kinds of e-agents by name, for people."""

from __future__ import annotations

from collections.abc import Mapping

from dubins_traffic.problem.kinds import KINDS


def names() -> Mapping[str, str]:
    """Return the kinds of e-agents, each with one line that says what it does."""
    return {name: (model.__doc__ or "").strip().splitlines()[0] for name, model in KINDS.items()}
