"""What a package of this project says of itself and holds."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_who_made_it_and_where_it_is_from() -> None:
    assert PROJECT["authors"] == [{"name": "The dubins-traffic developers"}]
    assert PROJECT["urls"]
    assert all(address.startswith("https://") for address in PROJECT["urls"].values())


def test_the_page_of_an_index_has_no_links_that_lead_nowhere_there() -> None:
    page = (ROOT / PROJECT["readme"]).read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)]*)\)", page)
    assert links
    assert all(link.startswith("https://") for link in links)


def test_the_source_distribution_holds_tests_and_documentation() -> None:
    lines = (ROOT / "MANIFEST.in").read_text(encoding="utf-8").splitlines()
    orders = [line.split() for line in lines if line and not line.startswith("#")]
    grafted = {name for order, *names in orders if order == "graft" for name in names}
    included = {name for order, *names in orders if order == "include" for name in names}
    assert {"docs", "tests", "examples", "benchmarks", "scripts"} <= grafted
    assert {"README.md", "CHANGELOG.md", "LICENSE", "Makefile", "constraints.txt"} <= included
    assert all((ROOT / name).exists() for name in grafted | included)
    assert ["global-exclude", "__pycache__", "*.py[cod]", ".DS_Store"] in orders
