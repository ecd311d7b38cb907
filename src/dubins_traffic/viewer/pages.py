"""Pages in HTML: templates beside the code that fills them in, and one environment that escapes whatever they show."""

from __future__ import annotations

import base64
import hashlib
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment

PAGES = (".html", ".htm")
"""How names of pages end."""


@lru_cache(maxsize=1)
def environment() -> Environment:
    """Return the environment of all templates; each is named by its path below the package."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    made = Environment(loader=PackageLoader("dubins_traffic", ""), autoescape=True, undefined=StrictUndefined)
    made.filters |= {"base64": in_base64, "source": source}  # pyright: ignore[reportUnknownMemberType]
    made.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
    return made


def render(template: str, /, **given: object) -> str:
    """Return a page, or a part of one, from a template (`environment`); equal values give equal text."""
    return environment().get_template(template).render(given)


def part(name: str) -> str:
    """Return the text of a file below the package that goes into a page as it is, such as a script."""
    return (resources.files("dubins_traffic") / name).read_text(encoding="utf-8").strip()


def in_base64(text: str) -> str:
    """Return the bytes of a text as a data URL holds them."""
    return base64.b64encode(text.encode()).decode("ascii")


def source(text: str) -> str:
    """Return the source expression of a style sheet or a script for a Content-Security-Policy."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
