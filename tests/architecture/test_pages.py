"""HTML stands in templates, which escape what they show; no module puts a page together from strings."""

import re

import pytest

from dubins_traffic.service.texts import templates
from tests.architecture.house import PACKAGE, modules

MARKUP = re.compile(r"</?(html|head|body|table|t[hdr]|div|section|h[1-6]|p|ul|li|a href)\b[^>]*>", re.IGNORECASE)


def test_no_module_holds_markup() -> None:
    assert [str(own.path.relative_to(PACKAGE)) for own in modules() if MARKUP.search(own.text)] == []


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.html")), ids=lambda path: path.name)
def test_every_template_is_one(path: object) -> None:
    templates().get_template(str(path).removeprefix(f"{PACKAGE}/"))
