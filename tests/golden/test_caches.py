"""What kernels keep from tick to tick changes nothing: without any of it the golden cases give the same."""

from __future__ import annotations

import ast
import os
import subprocess
import sys

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.kernels import compile as making
from tests.architecture.house import modules

CASES = (
    "agent/lawful-blocks/random/rules",
    "agent/lawful-tailgates/grid/lanes",
    "agent/nemesis/thinned/rules",
    "agent/wander/random/lanes",
    "batch/obstacles/rules",
    "batch/rectangles/lanes",
    "batch/disturbed/rules",
    "controller/rules+shield:law/random",
    "variant/ends/rules+shield",
    "variant/turning-radius/rules",
)
LOOKS = {
    "cars.near._is_known",
    "policies.rules.command_cache.repeat_command",
    "policies.rules.command_cache._is_of",
    "rules.label_cache.relabel_from_cache",
    "rules.location._is_in",
    "rules.referee_kernel._is_as_before",
    "scoring.tally._is_far",
}
"""Where kernels look into what is kept: one for each paragraph of docs/design/030-speed.md."""


def test_golden_cases_are_the_same_without_any_cache() -> None:
    off = {**os.environ, making.CACHES: "off"}
    command = [sys.executable, "-m", "tests.golden.hashes", *CASES]
    ran = subprocess.run(command, env=off, capture_output=True, text=True, check=False)
    assert ran.stdout == f"{len(CASES)} cases, 0 differences\n", ran.stderr


def test_without_caches_no_look_finds_anything_and_nothing_is_compiled(monkeypatch) -> None:
    def known(n: int) -> bool:
        return n > 0

    monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
    assert making.jit_look(known)(1)
    assert isinstance(making.jit(known), making.Kernel)
    monkeypatch.setenv(making.CACHES, "off")
    assert not making.jit_look(known)(1)
    assert making.jit(known) is known
    monkeypatch.setenv(making.CACHES, "maybe")
    with pytest.raises(InputError, match="on or off"):
        making.caches_are_off()


def test_every_cache_is_behind_a_look() -> None:
    found = {
        f"{module.name}.{item.name}"
        for module in modules()
        for item in module.definitions()
        if isinstance(item, ast.FunctionDef) and any(ast.unparse(one) == "jit_look" for one in item.decorator_list)
    }
    assert found == LOOKS
