"""What a clause of the norm says: in plain words where a breach names it, and as the norm has it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text
from dubins_traffic.rules.clauses import PAGE


class Words(NamedTuple):
    """A rule in words: what a car does that breaks it, and what is asked for, in a sentence; durations are defaults."""

    deed: str
    meaning: str


RULE_WORDS: Final[Mapping[str, Words]] = {
    "1.collision": Words(
        "touches another body", "The ego touches nothing, neither a car nor an obstacle, whoever is at fault."
    ),
    "1.road": Words("leaves the road", "The centre of the ego stays on the road."),
    "2.left": Words(
        "reaches over the centre line",
        "The ego comes over the centre line only while it overtakes something that stands in its lane.",
    ),
    "2.return": Words("stays over the centre line", "Who overtakes is back in his own lane within 10 seconds."),
    "2.turn": Words("turns round on a road", "The ego turns round in intersections only, not on a road."),
    "3.stop": Words(
        "enters a crossing without a stop",
        "Before it enters a crossing, the ego stops at its edge and stands there for half a second.",
    ),
    "3.order": Words("enters a crossing before its turn", "Who has stopped first at a crossing enters it first."),
    "3.clear": Words("enters a crossing that is taken", "The ego enters a crossing only if no other car is in it."),
    "E2": Words("is at fault in a collision", "The other cars are never at fault in a collision."),
    "E3.enter": Words(
        "is first at a clear crossing and does not enter",
        "Another car whose turn it is at an empty crossing enters it within 10 seconds.",
    ),
    "E3.tickets": Words(
        "loses its place in the order",
        "Another car gives up its turn at a crossing at most once while it waits there.",
    ),
    "E4": Words("stays in a disc with a free exit", "Another car leaves an intersection within 5 seconds, if it can."),
    "E5": Words(
        "takes too long from one intersection to another",
        "Another car goes on to the next intersection in time, as long as its way is free.",
    ),
    "E6": Words("keeps a goal taken", "The other cars together leave each goal free again and again."),
}
MEANINGS: Final[Mapping[str, str]] = {
    **{name: words.meaning for name, words in RULE_WORDS.items()},
    "1.goal": "The ego visits every goal again and again.",
    "E1": "The other cars stay on the road and keep rules 2 and 3.",
    "E3": "Another car whose turn it is enters the crossing, and does not give up its turn again and again.",
}
"""What the rules ask for, and parts of the norm that no breach but an excuse or a page names."""
_PACKAGE = Path(__file__).parent
_PLACES = (_PACKAGE / "rules.md", _PACKAGE.parents[2] / PAGE)
"""Where the norm stands: beside this module in a wheel (`setup.py`), and among the pages in a clone."""
_ITEM = re.compile(r"^( *)(?:-|\d+\.) ")
_ANCHOR = re.compile(r'<a id="([^"]+)"></a>')


class Clause(NamedTuple):
    """A clause: its name, its meaning in a sentence (empty: the norm alone says it), and the norm in paragraphs."""

    name: str
    meaning: str
    norm: tuple[str, ...]


def explained(name: str) -> Clause:
    """Return what a clause says.

    Parameters
    ----------
    name : str
        What a breach or a message names, such as ``3.stop``, ``E4`` or ``room``: an anchor of the norm.

    Raises
    ------
    InputError
        If the norm has no such clause.
    """
    lines = _norm()
    place = next((k for k, line in enumerate(lines) if name in _ANCHOR.findall(line)), None)
    if place is None:
        expected = f"one of {', '.join(MEANINGS)}, or another anchor of the rules"
        raise InputError("no such clause", file="explain", value=name, expected=expected)
    return Clause(name, MEANINGS.get(name, ""), tuple(map(_plain, _items(lines, place))))


@cache
def _norm() -> tuple[str, ...]:
    place = next((place for place in _PLACES if place.is_file()), _PLACES[0])
    return tuple(read_text(place).splitlines())


def _items(lines: tuple[str, ...], place: int) -> list[list[str]]:
    """Return the lines of the item of a list, or of the paragraph, that holds a line, and those of each item below."""
    first = place
    while first > 0 and lines[first - 1].strip() and not _ITEM.match(lines[first]):
        first -= 1
    top = _ITEM.match(lines[first])
    items: list[list[str]] = [[lines[first]]]
    for line in lines[first + 1 :]:
        item = _ITEM.match(line)
        if top is None:
            is_over = item is not None or not line.strip()
        else:
            is_over = not line.startswith(" ") or (item is not None and len(item[1]) <= len(top[1]))
        if is_over and (line.strip() or top is None):
            break
        if item:
            items.append([])
        items[-1].append(line)
    return items


def _plain(lines: list[str]) -> str:
    """Return lines of Markdown as one line of text: without anchors, links and emphasis."""
    text = " ".join(line.strip() for line in lines)
    text = re.sub(r"^(?:-|\d+\.|#+) ", "", _ANCHOR.sub("", text).strip())
    text = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text)
    return re.sub(r"\*\*?([^*]+)\*\*?", r"\1", text)
