"""What holds for all tests.

Kernels are compiled before they run, as on a machine where all has been compiled: tests of other tiers say so. Programs
that tests start keep their bytecode, whatever the surroundings say: else each of them compiles 300 files first. Garbage
is collected seldom: a process of tests holds very many objects that stay.
"""

import gc
import os
import sys

os.environ.setdefault("DUBINS_TRAFFIC_KERNELS", "compiled")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
gc.set_threshold(50_000)
