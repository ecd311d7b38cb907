"""`jit_rare`: the compiler is told which functions few ticks need."""

import os
import subprocess
import sys

KERNELS = """
from dubins_traffic.kernels.compile import jit, jit_rare

@DECORATOR
def go_round(way):
    '''Return the sum of the steps of a way.'''
    total = 0.0
    for k in range(way.shape[0]):
        total += way[k]
    return total

@jit
def drive(way):
    '''Return what `go_round` does where the way begins below zero, else 1.'''
    return go_round(way) if way[0] < 0.0 else 1.0
"""
COMPILE = """
from dubins_traffic.kernels import compile as making
from dubins_traffic.compiling.compiler import Compiler

class Watched(Compiler):
    def _set_apart(self, program):
        super()._set_apart(program)
        for own in program.functions:
            if not own.is_declaration:
                said = b" ".join(own.attributes).decode().split()
                print("go_round" in own.name, "cold" in said)

compiler = Watched()
making.builder = compiler.jit
import driving
compiler.machine_code(driving.drive, (("array", "f8", 1, "C", True),), "drive")
"""


def told(folder, decorator: str) -> set[str]:
    folder.mkdir()
    (folder / "driving.py").write_text(KERNELS.replace("DECORATOR", decorator))
    around = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path]), "NUMBA_DISABLE_JIT": ""}
    made = subprocess.run([sys.executable, "-c", COMPILE], env=around, check=True, stdout=-1, text=True)
    return set(made.stdout.splitlines())


def test_the_compiler_is_told_what_is_rare_and_nothing_else(tmp_path) -> None:
    assert told(tmp_path / "usual", "jit") == {"True False", "False False"}
    assert told(tmp_path / "rare", "jit_rare") == {"True True", "False False"}
