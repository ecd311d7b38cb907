"""Maps of other programs that somebody has changed anywhere: each is read, or refused with its file."""

from __future__ import annotations

import random
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring, tostring

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.network import RoadNetwork
from tests.foreign_maps import BENT, FOREIGN, written

MAPS = Path(__file__).parents[2] / "examples" / "maps"
SHIPPED = {
    "sumo": "village.net.xml", "opendrive": "curves.xodr", "lanelet2": "crossing.osm", "commonroad": "crossing.xml",
}  # fmt: skip
VALUES = (
    "", " ", "nan", "inf", "-1e308", "5e-324", "0", "-1", "1", "1e7", "99999", "0x10", "1_000", "٣", "1,2", "1 2",
    "true", "é", "9" * 70, "1e-9", "1e3", "0.3",
)  # fmt: skip
COUNT = 12


def removed(element: Element, parent: Element, _dice: random.Random) -> None:
    parent.remove(element)


def doubled(element: Element, parent: Element, dice: random.Random) -> None:
    for _ in range(dice.choice((1, 1, 5))):
        parent.insert(dice.randrange(len(parent) + 1), deepcopy(element))


def other_value(element: Element, _parent: Element, dice: random.Random) -> None:
    if element.attrib:
        element.set(dice.choice(list(element.attrib)), dice.choice(VALUES))
    elif element.text and element.text.strip():
        element.text = dice.choice(VALUES)


def without_value(element: Element, _parent: Element, dice: random.Random) -> None:
    if element.attrib:
        del element.attrib[dice.choice(list(element.attrib))]


def values_of_another(element: Element, parent: Element, dice: random.Random) -> None:
    other = dice.choice([each for each in parent.iter() if each.tag == element.tag])
    element.attrib, other.attrib = dict(other.attrib), dict(element.attrib)


def shuffled(element: Element, _parent: Element, dice: random.Random) -> None:
    parts = list(element)
    for part in parts:
        element.remove(part)
    dice.shuffle(parts)
    element.extend(parts)


CHANGES: tuple[Callable[[Element, Element, random.Random], None], ...] = (
    removed, doubled, other_value, other_value, without_value, values_of_another, shuffled,
)  # fmt: skip


def mutated(text: str, dice: random.Random) -> str:
    """Return a map in which one to three things are changed; what stands before its root stays."""
    root = fromstring(text)
    for _ in range(dice.randint(1, 3)):
        pairs = [(each, parent) for parent in root.iter() for each in parent]
        if pairs:
            dice.choice(CHANGES)(*dice.choice(pairs), dice)
    return text[: text.index(f"<{root.tag}")] + tostring(root, encoding="unicode")


@pytest.mark.parametrize("shipped", [True, False])
@pytest.mark.parametrize("name", FOREIGN)
def test_a_changed_map_is_read_or_refused(name: str, shipped: bool) -> None:
    form = registry.load(name)
    text = (MAPS / SHIPPED[name]).read_text() if shipped else written(name, BENT)
    refused: list[str | None] = []
    for number in range(COUNT):
        try:
            RoadNetwork.from_text(mutated(text, random.Random(number)), "changed.map", form)
        except InputError as error:
            refused.append(error.file)
    assert set(refused) <= {"changed.map"}
    assert len(refused) < COUNT
