"""XML from strangers, read by the standard library: no document types, no entities, limits on size and depth."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from dubins_traffic.errors import InputError

MOST_SIGNS = 1 << 27
MOST_ELEMENTS = 3_000_000
DEEPEST = 64
LONGEST_NUMBER = 64
LARGEST_NUMBER = 1e100
"""Largest number: squares and products of some such are numbers, too."""


def parse(text: str, root: str, file: str | None = None) -> Element:
    """Return the root element of an XML text.

    Parameters
    ----------
    text : str
        The whole text.
    root : str
        What the root element is called.
    file : str, optional
        For messages.

    Raises
    ------
    InputError
        If it is not XML, has another root, declares a document type or an entity, is too large, or nested too deep.
    """
    if len(text) > MOST_SIGNS:
        raise InputError("too large", file=file, value=len(text), expected=f"at most {MOST_SIGNS} characters")
    parser = expat.ParserCreate("utf-8")
    builder = _Builder(file)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = builder.refuse_doctype
    parser.buffer_text = True
    try:
        parser.Parse(text.removeprefix("\ufeff").encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as error:
        where = f"line {error.lineno}, column {error.offset + 1}"
        problem = f"not XML ({expat.ErrorString(error.code)}, {where})"
        raise InputError(problem, file=file, expected=f"a whole document <{root}>") from None
    top = builder.close()
    if top.tag != root:
        raise InputError("another root element", file=file, value=top.tag, expected=root)
    return top


class _Builder:
    """Builds the tree of elements within the limits."""

    def __init__(self, file: str | None) -> None:
        self._tree = TreeBuilder()
        self._file = file
        self._depth = self._count = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        self._count += 1
        if self._depth > DEEPEST:
            raise InputError("nested too deep", file=self._file, field=tag, expected=f"at most {DEEPEST} levels")
        if self._count > MOST_ELEMENTS:
            raise InputError("too many elements", file=self._file, expected=f"at most {MOST_ELEMENTS}")
        self._tree.start(tag, attributes)

    def end(self, tag: str) -> None:
        self._depth -= 1
        self._tree.end(tag)

    def data(self, text: str) -> None:
        self._tree.data(text)

    def refuse_doctype(self, name: str, *_: Any) -> NoReturn:
        expected = "XML without <!DOCTYPE> and entities"
        raise InputError("declares a document type", file=self._file, value=name, expected=expected)

    def close(self) -> Element:
        return self._tree.close()


class Reader:
    """Reads attributes of elements; its errors name the file and the place."""

    def __init__(self, file: str | None) -> None:
        self.file = file

    def fault(self, problem: str, element: Element, value: object, expected: str) -> InputError:
        """Return an error about an element, which is named by its tag and identifier."""
        return InputError(problem, file=self.file, field=place(element), value=value, expected=expected)

    def text(self, element: Element, name: str) -> str:
        """Return an attribute that must be there."""
        value = element.get(name)
        if value is None:
            raise InputError("missing", file=self.file, field=f"{place(element)}.{name}", expected="an attribute")
        return value

    def number(self, element: Element, name: str, default: float | None = None) -> float:
        """Return a finite number; `default` where the attribute is missing."""
        value = element.get(name)
        if value is None and default is not None:
            return default
        return self.parsed(self.text(element, name), f"{place(element)}.{name}")

    def parsed(self, text: str, field: str) -> float:
        """Return the number that a text is."""
        try:
            number = float(text) if len(text) <= LONGEST_NUMBER else math.nan
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError("not a number", file=self.file, field=field, value=text, expected="a finite number")
        if abs(number) > LARGEST_NUMBER:
            expected = f"at most {LARGEST_NUMBER:g} in size"
            raise InputError("too large", file=self.file, field=field, value=text, expected=expected)
        return number

    def child(self, element: Element, tag: str) -> Element:
        """Return the first child of a name; it must be there."""
        child = element.find(tag)
        if child is None:
            raise InputError("missing", file=self.file, field=f"{place(element)}.{tag}", expected=f"<{tag}>")
        return child

    def unique(self, elements: Iterator[Element]) -> Mapping[str, Element]:
        """Return elements by their attribute `id`; each may stand once."""
        by_id: dict[str, Element] = {}
        for element in elements:
            name = self.text(element, "id")
            if name in by_id:
                raise self.fault("stands twice", element, name, "each id once")
            by_id[name] = element
        return by_id


def place(element: Element) -> str:
    """Return the tag and the identifier of an element: ``edge[a1]``."""
    name = element.get("id")
    return element.tag if name is None else f"{element.tag}[{name}]"


def number_text(value: float) -> str:
    """Return the shortest text that reads as the same number."""
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(float(value))


def document(root: Element, prolog: str = "") -> str:
    """Return the text of a tree of elements, indented, with its declaration and a `prolog` of whole lines."""
    from xml.etree.ElementTree import indent, tostring

    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{prolog}{tostring(root, encoding="unicode")}\n'
