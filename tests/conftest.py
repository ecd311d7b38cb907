"""What holds for all tests.

Kernels are compiled before they run, as on a machine where all has been compiled: tests of other tiers say so. Programs
that tests start keep their bytecode, whatever the surroundings say: else each of them compiles 300 files first. Garbage
is collected seldom: a process of tests holds very many objects that stay. Ctrl-C is heard, by tests and by the programs
that they start, also where tests are begun by one that ignores it, as `nohup make test &` does. No test is measured by
the clock: a machine may be as busy as it likes.
"""

import gc
import os
import signal
import sys

from hypothesis import HealthCheck, settings

os.environ.setdefault("DUBINS_TRAFFIC_KERNELS", "compiled")
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False
gc.set_threshold(50_000)
signal.signal(signal.SIGINT, signal.default_int_handler)  # a program that is started has the default instead
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
