"""Groups of codes: kernels that read them are compiled to the same bytes as kernels that read bare numbers."""

import os
import subprocess
import sys

BARE = """
from dubins_traffic.kernels.compile import jit
GOES, WAITS = 1, 4

@jit
def judge(bits, kept):
    '''Return the bits that are kept; count those that wait.'''
    if bits & WAITS != 0:
        kept[0] += GOES
    return bits & (GOES | WAITS)
"""
GROUP = """
from typing import NamedTuple
from dubins_traffic.kernels.compile import jit

class _Flag(NamedTuple):
    GOES: int = 1
    WAITS: int = 4

FLAG = _Flag()

@jit
def judge(bits, kept):
    '''Return the bits that are kept; count those that wait.'''
    if bits & FLAG.WAITS != 0:
        kept[0] += FLAG.GOES
    return bits & (FLAG.GOES | FLAG.WAITS)
"""
COMPILE = """
import sys
from dubins_traffic.kernels import compile as making
from dubins_traffic.compiling.compiler import Compiler
compiler = Compiler()
making.builder = compiler.jit
import judging
kinds = ("number", "i8"), ("array", "i8", 1, "C", True)
code, answer = compiler.machine_code(judging.judge, kinds, "judge")
assert answer == ("number", "i8")
sys.stdout.buffer.write(code)
"""


def compiled(folder, text: str) -> bytes:
    folder.mkdir()
    (folder / "judging.py").write_text(text)
    around = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path]), "NUMBA_DISABLE_JIT": ""}
    return subprocess.run([sys.executable, "-c", COMPILE], env=around, check=True, stdout=-1).stdout


def test_a_code_of_a_group_is_compiled_as_the_number_that_it_is(tmp_path) -> None:
    code = compiled(tmp_path / "bare", BARE)
    assert len(code) > 100
    assert compiled(tmp_path / "group", GROUP) == code
    assert compiled(tmp_path / "other", GROUP.replace("WAITS: int = 4", "WAITS: int = 8")) != code
