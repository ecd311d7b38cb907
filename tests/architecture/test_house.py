"""The house as it is meant to be: docstrings, sizes, circles, imports by name, and what kernels say of themselves.

What is not mended yet stands in still.json. These lists may only shrink: what is not in one of them is refused, and so
is what stands in one and has been mended (`python -m tests.architecture.house` takes it out).
"""

from __future__ import annotations

import ast
from typing import NamedTuple

import numpy as np
import pytest

from dubins_traffic.kernels.sources import imported
from tests.architecture import findings
from tests.architecture.constants import compiled, defined, is_constant, read_by
from tests.architecture.house import STILL, Module, modules, still
from tests.architecture.kernels import is_said, public_kernels

MOST_STILL = {
    "circles": 0,
    "constants": 64,
    "imports by name": 0,
    "kernels without units": 0,
    "long modules": 0,
    "wide kernels": 22,
    "without docstring": 0,
}
"""How many findings of each kind may be left; a number here may only fall."""


@pytest.mark.parametrize("what", sorted(MOST_STILL))
def test_the_house_is_in_order_but_for_what_is_listed(what: str) -> None:
    found, listed = findings.CHECKS[what](), still(what)
    assert sorted(found.keys() - listed.keys()) == [], f"{what}: to be mended"
    assert sorted(listed.keys() - found.keys()) == [], f"{what}: mended, so to be taken out of {STILL.name}"
    grown = [key for key, number in found.items() if isinstance(number, int) and number > int(listed[key])]
    assert grown == [], f"{what}: more than before"
    assert len(listed) <= MOST_STILL[what]


def kernel(text: str) -> ast.FunctionDef:
    (found,) = public_kernels(Module(STILL, text, ast.parse(text)))
    return found


def unsaid(text: str) -> list[str]:
    own = kernel(text)
    return [one.arg for one in own.args.args if not is_said(own, one)]


def test_a_kernel_says_what_its_parameters_are() -> None:
    head = "@jit\ndef move(b: int, x: float, gap: float, row: Floats) -> None:\n    "
    assert unsaid(head + '"""Move."""') == ["gap", "row"]
    assert unsaid(head + '"""Move by `gap` (m); `row` (N, 3)."""') == []
    text = '"""Move.\n\n    Parameters\n    ----------\n    gap\n        {}\n    row : (N, 3)\n        {}\n    """'
    assert unsaid(head + text.format("Metres to keep, m.", "Car, place and time.")) == []
    assert unsaid(head + text.format("What to keep.", "What there is.")) == ["gap"]


def test_every_module_is_read() -> None:
    assert len(modules()) > 300
    assert sum(1 for module in modules() for _ in public_kernels(module)) > 200


def test_a_group_of_codes_counts_as_one_constant() -> None:
    class Stage(NamedTuple):
        BEGINS: int = 0
        ENDS: int = 1

    assert is_constant(3)
    assert is_constant(np.uint64(3))
    assert is_constant(Stage())
    assert not is_constant(0.5)
    assert not is_constant(Stage)


def test_a_constant_is_one_wherever_it_is_imported() -> None:
    assert defined("agents.driving", "EGO") == defined("cars.state", "EGO") == ("cars.state", "EGO")


def test_a_kernel_is_compiled_anew_when_a_constant_that_it_reads_changes() -> None:
    files = {module.name: module.path for module in modules()}
    for module, kernel in compiled():
        sources = {files[name.rpartition(".")[0]] for name in read_by(module, kernel)}
        assert sources <= imported(files[module]), kernel.name
