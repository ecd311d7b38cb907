"""What a package of this project says of itself and holds."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML  # rosbags needs it too

pytestmark = pytest.mark.path

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
    assert {"docs", "tests", "examples", "benchmarks", "experiments", "scripts"} <= grafted
    assert {"README.md", "CHANGELOG.md", "LICENSE", "Makefile", "constraints.txt"} <= included
    assert all((ROOT / name).exists() for name in grafted | included)
    assert ["global-exclude", "__pycache__", "*.py[cod]", ".DS_Store"] in orders


def test_how_to_cite_it_says_what_the_package_says() -> None:
    cited: dict[str, Any] = YAML(typ="safe").load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["cff-version"] == "1.2.0"
    assert cited["title"] == PROJECT["name"]
    assert cited["version"] == PROJECT["version"]
    assert cited["license"] == PROJECT["license"]
    assert cited["authors"] == PROJECT["authors"]
    assert cited["keywords"] == PROJECT["keywords"]
    assert cited["url"] == PROJECT["urls"]["Homepage"]
    assert PROJECT["description"].split(": ")[1] in cited["abstract"]
    assert all(one["title"] and one["authors"] for one in cited["references"])


def test_hooks_run_the_checks_in_the_project_s_own_environment() -> None:
    hooks = YAML(typ="safe").load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    assert [one["repo"] for one in hooks] == ["local"]
    own = {hook["id"]: hook for hook in hooks[0]["hooks"]}
    assert all(hook["language"] == "system" for hook in own.values())
    checks = re.findall(r"^\t\$\(BIN\)/(\S+)", _recipe("check"), re.MULTILINE)
    assert {hook["entry"].split()[0] for hook in own.values()} == {f".venv/bin/{name}" for name in checks}


def test_hosted_ci_runs_what_ci_runs_here() -> None:
    flow = YAML(typ="safe").load((ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8"))
    runs = [step["run"] for job in flow["jobs"].values() for step in job["steps"] if "run" in step]
    assert "bash .ci/run" in runs


def _recipe(target: str) -> str:
    """Return the lines of a target of the Makefile."""
    return f"\n{(ROOT / 'Makefile').read_text(encoding='utf-8')}".partition(f"\n{target}:")[2].partition("\n\n")[0]
