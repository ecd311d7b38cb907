"""What Sphinx is told; `website/build.py` gathers the sources and calls it."""

import re
import sys
from pathlib import Path
from typing import Any

from dubins_traffic import __version__

sys.path.insert(0, str(Path(__file__).parent))

project = "dubins-traffic"
author = "The dubins-traffic developers"
copyright = author
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc"]
source_suffix = {".md": "markdown"}
root_doc = "index"
nitpicky = True
nitpick_ignore_regex = [
    (
        r"py:.*",
        r"(numpy|np|npt|pathlib|collections|typing|matplotlib|pandas|os|IO|types|gymnasium|pettingzoo|datetime)(\..*)?",
    ),
    (
        r"py:.*",
        r"(Path|Any|Callable|Iterable|Iterator|Sequence|Mapping|Generator|Literal|Self|ArrayLike|NDArray)",
    ),
    (
        r"py:class",
        r"AutoresetMode|Body|Bools|Cancelled|Disturbances|Event|Floats|Image|Levels|Link|MetricSpec|Propositions|Run|Subject",
    ),
    (r"py:.*", r"dubins_traffic\.(?!envs)[a-z_]+\..*"),
]
"""Standard and foreign libraries, whose inventories this page would have to fetch, and types that are not public."""
suppress_warnings = ["myst.header"]
smartquotes = False  # what stands in quotes in the tables of parameters is to be copied
highlight_language = "none"  # blocks that name no language are commands and what they print

myst_enable_extensions = ["attrs_inline", "attrs_block", "colon_fence", "dollarmath"]
myst_heading_anchors = 4

autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = f"dubins-traffic {release}"
html_show_sphinx = False
html_copy_source = False
html_show_search_summary = False  # a page opened from a file may not read others
html_theme_options: dict[str, Any] = {"navigation_with_keys": True}

SCROLLED = r'<pre\b|<div class="table-wrapper\b[^"]*"|<p(?=><img [^>]*\.(?:svg|png)")'
"""What is as wide as its content on a narrow page, and moves sideways there: code, tables, and drawings with words."""


def without_aliases(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Take away what Python itself says of the fields of a named tuple: "Alias for field number 0"."""
    if any(line.startswith("Alias for field number") for line in lines):
        lines.clear()


def with_pages(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Make links of the pages that docstrings name: ``docs/scores.md``."""
    lines[:] = [re.sub(r"`?\bdocs/([\w/-]+)\.md`?(?!#)", r":doc:`\1 </\1>`", line) for line in lines]


def for_every_reader(_app: Any, _page: str, _template: str, context: dict[str, Any], _tree: Any) -> None:
    """Let keys move what is wider than its page, and say which level the headings of the sidebar have."""
    if "furo_navigation_tree" in context:
        headed = context["furo_navigation_tree"].replace('role="heading"', 'role="heading" aria-level="2"')
        context["furo_navigation_tree"] = headed
    if "body" in context:
        context["body"] = re.sub(SCROLLED, r'\g<0> tabindex="0"', context["body"])


def setup(app: Any) -> None:
    """Tell Sphinx what is done with docstrings, and with pages when they have been made."""
    app.connect("autodoc-process-docstring", without_aliases)
    app.connect("autodoc-process-docstring", with_pages)
    app.connect("html-page-context", for_every_reader, priority=900)  # after the theme
