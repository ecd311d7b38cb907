"""Elements of SDF documents: poses, boxes, spheres, cylinders, colours."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

Child = Element | str | float | int


def tag(name: str, /, *children: Child, **attributes: str) -> Element:
    """Return an element with children; texts and numbers become its text, numbers to their last bit."""
    element = Element(name, attributes)
    for child in children:
        if isinstance(child, Element):
            element.append(child)
        else:
            element.text = child if isinstance(child, str) else repr(child)
    return element


def numbers(name: str, *values: float) -> Element:
    """Return an element whose text is a row of numbers."""
    return tag(name, " ".join(repr(value) for value in values))


def pose(x: float, y: float, z: float, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0) -> Element:
    """Return a pose: metres and radians."""
    return numbers("pose", x, y, z, roll, pitch, yaw)


def box(x: float, y: float, z: float) -> Element:
    """Return the geometry of a box by its lengths in metres."""
    return tag("geometry", tag("box", numbers("size", x, y, z)))


def sphere(radius: float) -> Element:
    """Return the geometry of a sphere of `radius` metres."""
    return tag("geometry", tag("sphere", tag("radius", radius)))


def cylinder(radius: float, length: float) -> Element:
    """Return the geometry of an upright cylinder, metres."""
    return tag("geometry", tag("cylinder", tag("radius", radius), tag("length", length)))


def visual(name: str, where: Element, geometry: Element, colour: Sequence[float]) -> Element:
    """Return the visual of a link; `colour` is red, green, blue in [0, 1]."""
    paint = tag("material", *(numbers(kind, *colour, 1.0) for kind in ("ambient", "diffuse")))
    return tag("visual", where, geometry, paint, name=name)


def text(root: Element) -> str:
    """Return the document, indented, ending in a line feed."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
