"""What the game assumes of the e-agents, E1 to E6 (docs/rules.md#phi_env): each kept, left out, weakened, stricter."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

from dubins_traffic.errors import InputError


class Order(StrEnum):
    """How an intersection is entered (docs/rules.md#E1)."""

    KEPT = "kept"
    """In the order of arrival, by all."""
    IGNORED = "ignored"
    """By the ego in the order of arrival, by e-agents in any."""
    NONE = "none"
    """There is no order: whoever finds it clear may enter, the ego too."""


class Forfeits(StrEnum):
    """How often an e-agent that waits may give up its place for a new one (docs/rules.md#E3)."""

    NEVER = "never"
    ONCE = "once"
    """Once in a wait."""
    ALWAYS = "always"
    """Any number of times."""


class Leaving(StrEnum):
    """When an e-agent must leave a disc (docs/rules.md#E4)."""

    OWED = "owed"
    """When an exit is free; in a bend not while the ego meets the disc, and whatever other e-agents do that meet it."""
    UNMET = "unmet"
    """In a bend, besides, not while an e-agent is in it that came by the other road."""
    NEVER = "never"


class Arriving(StrEnum):
    """When an e-agent must go on in its lane (docs/rules.md#E5)."""

    OWED = "owed"
    """Up to the line of a crossing; into a bend or dead end that is clear and that the ego does not meet, if a way out
    of it is free."""
    MOVES_UP = "moves_up"
    """Into a bend or dead end, besides, though e-agents have taken the ways out of it."""
    NEVER = "never"


@dataclass(frozen=True, slots=True)
class Assumption:
    """What is assumed of the e-agents; as it stands, all of E1 to E6, as the rules have them."""

    order: Order = Order.KEPT
    """E1."""
    yields: bool = True
    """E2: no e-agent moves into the cell of the ego."""
    enters: bool = True
    """E3: who is first at a clear intersection enters at last."""
    forfeits: Forfeits = Forfeits.NEVER
    """Whether places in the order may be given up."""
    leaves: Leaving = Leaving.OWED
    """E4: who is in an intersection with a free exit leaves at last."""
    arrives: Arriving = Arriving.OWED
    """E5: who is in a lane comes to its end at last, and so into the order, or through a bend."""
    frees: bool = True
    """E6: every goal is free again and again."""

    @classmethod
    def parse(cls, words: Iterable[str]) -> Assumption:
        """Return the assumption that the words name, such as ``E1`` and ``E3:once``; what is not named is left out.

        InputError if a word is none of ours or a part is named twice.
        """
        assumption = NOTHING
        seen: set[str] = set()
        for word in words:
            name = _NAMES.get(word.strip().lower())
            if name is None:
                raise InputError("not an assumption", field="--assume", value=word, expected=_known())
            part = part_of(name)
            if part in seen:
                raise InputError("assumed twice", field="--assume", value=part, expected="each part once")
            seen.add(part)
            assumption = replace(assumption, **WORDS[name])
        return assumption

    def words(self) -> tuple[str, ...]:
        """Return the words that `parse` understands as this assumption."""
        return tuple(word for word, change in WORDS.items() if replace(self, **change) == self)

    def __str__(self) -> str:
        return ",".join(self.words()) or "nothing"


NOTHING: Final = Assumption(Order.IGNORED, False, False, Forfeits.NEVER, Leaving.NEVER, Arriving.NEVER, False)
"""No assumption at all."""

WORDS: Final[Mapping[str, Mapping[str, Any]]] = {
    "E1": {"order": Order.KEPT},
    "E1:any-order": {"order": Order.NONE},
    "E2": {"yields": True},
    "E3": {"enters": True, "forfeits": Forfeits.NEVER},
    "E3:one-forfeit": {"enters": True, "forfeits": Forfeits.ONCE},
    "E3:forfeits": {"enters": True, "forfeits": Forfeits.ALWAYS},
    "E4": {"leaves": Leaving.OWED},
    "E4:unmet": {"leaves": Leaving.UNMET},
    "E5": {"arrives": Arriving.OWED},
    "E5:moves-up": {"arrives": Arriving.MOVES_UP},
    "E6": {"frees": True},
}
"""What each word assumes."""


_NAMES: Final = {word.lower(): word for word in WORDS}


def part_of(word: str) -> str:
    """Return which of E1 to E6 a word is about."""
    return word.partition(":")[0]


def _known() -> str:
    return "some of " + ", ".join(WORDS)
