"""Proofs that a machine checks: the kernels of the package run on terms of a solver in place of numbers.

python -m proofs [--flaws] [--page] [NAME ...]
"""

import os

os.environ["NUMBA_DISABLE_JIT"] = "1"  # before the package is imported: terms can't be handed to machine code
