"""The two parts of the tests: each test is in one of them, none is lost, and no test of the first asks for a tool."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from tests import conftest, tools
from tests.architecture.house import ROOT

MARKS = ("tools", "long")


def parts() -> dict[str, str]:
    """Return the arguments of pytest in `make test` and `make test-tools`."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    recipes = {name: re.search(rf"^{name}:.*\n((?:\t.*\n)+)", text, re.MULTILINE) for name in ("test", "test-tools")}
    return {
        name: " ".join(re.findall(r"python -m pytest (.*)", found[1]))
        for name, found in recipes.items()
        if found is not None
    }


def test_each_test_is_in_one_part_and_in_one_alone() -> None:
    chosen: list[str] = []
    for arguments in parts().values():
        found = re.fullmatch(r'-n \$\(WORKERS\) --dist worksteal -m "([^"]+)"', arguments)
        assert found is not None, f"{arguments}: no paths and no names, which could leave a test out"
        chosen.append(found[1])
    assert len(chosen) == 2
    assert set(re.findall(r"\w+", " ".join(chosen))) <= {*MARKS, "not", "or", "and"}
    for carried in product((False, True), repeat=len(MARKS)):
        marks = dict(zip(MARKS, carried, strict=True))
        assert sum(bool(eval(one, {}, dict(marks))) for one in chosen) == 1, marks


class Marked:
    """A test in a file, with marks."""

    def __init__(self, path: str, *marks: str) -> None:
        self.path, self.marks = ROOT / path, {*marks}

    def get_closest_marker(self, name: str) -> str | None:
        return name if name in self.marks else None

    def add_marker(self, name: str) -> None:
        self.marks.add(name)


@pytest.mark.parametrize(
    ("path", "marks", "is_long"),
    [
        ("tests/unit/test_x.py", (), False),
        ("tests/unit/test_x.py", ("long",), True),
        ("tests/integration/test_x.py", (), True),
        ("tests/integration/test_x.py", ("path",), False),
        ("tests/sandbox/test_x.py", ("tools",), True),
        ("tests/anew/test_x.py", (), True),
    ],
)
def test_a_folder_decides_what_is_long_and_a_mark_may_say_otherwise(
    path: str, marks: tuple[str, ...], is_long: bool
) -> None:
    item = Marked(path, *marks)
    conftest.pytest_collection_modifyitems([item])  # pyright: ignore[reportArgumentType]
    assert ("long" in item.marks) == is_long


def test_continuous_integration_runs_both() -> None:
    lines = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert [line.removeprefix("exec ") for line in lines if "make test" in line] == [
        "make test",
        "make test-tools",
    ]


def test_a_test_without_the_mark_can_not_ask_for_a_tool() -> None:
    for ask in (lambda: tools.need(""), lambda: tools.need_programs("sh"), lambda: tools.program("sh")):
        with pytest.raises(pytest.fail.Exception, match="carries the mark `tools`"):
            ask()


@pytest.mark.parametrize(("ci", "word"), [("true", "1 failed"), ("", "1 skipped")])
def test_only_a_person_may_leave_a_test_out(ci: str, word: str, tmp_path: Path) -> None:
    file = tmp_path / "test_it.py"
    file.write_text("import pytest\n\ndef test_it():\n    pytest.skip('not here')\n")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-p",
        "tests.conftest",
        "-p",
        "no:cacheprovider",
        "-c",
        os.devnull,
        file,
    ]
    around = {**os.environ, "CI": ci, "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}
    done = subprocess.run(command, cwd=tmp_path, env=around, capture_output=True, text=True, check=False)
    assert word in done.stdout, done.stdout + done.stderr
