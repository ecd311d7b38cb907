"""Where the norm of each rule stands: the anchors of docs/rules.md, which breaches and messages cite."""

from __future__ import annotations

from typing import Final

PAGE: Final = "docs/rules.md"
"""The norm of every verdict."""


def clause(rule: str) -> str:
    """Return the clause that states a rule, or a part of the assumption, as ``docs/rules.md#3.stop``.

    The name of a rule in breaches (`dubins_traffic.rules.breach_log.RULES`) and of a part of the assumption (``E1`` to
    ``E6``) is the anchor of its clause.
    """
    return f"{PAGE}#{rule}"


def explain(rule: str) -> str:
    """Return the command that prints the clause of a rule, as messages name it."""
    return f"dubins-traffic explain {rule}"
