"""How a text is known to be XML: by its beginning, and by what its root is called; nothing is parsed."""

from __future__ import annotations

import re

_BEFORE_ROOT = re.compile(r"\s+|<\?.*?\?>|<!--.*?-->", re.DOTALL)
_NAME = re.compile(r"<([A-Za-z_][\w.-]*)")


def is_xml(text: str) -> bool:
    """Tell whether a text begins as XML does, whole or cut off."""
    return text.lstrip("\ufeff \t\r\n").startswith("<")


def root_name(text: str) -> str:
    """Return the name of the root element, from the beginning of a text; empty if it does not begin as XML does."""
    at = 1 if text.startswith("\ufeff") else 0
    while match := _BEFORE_ROOT.match(text, at):
        at = match.end()
    name = _NAME.match(text, at)
    return name[1] if name else ""
