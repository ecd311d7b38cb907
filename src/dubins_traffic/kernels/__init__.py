"""Compiled functions on bare arrays and numbers, shared by several rooms.

Kernels use only ``+ - * /`` and square roots on floats, so that every machine gives the same bits. They never
raise and never allocate per car. Each runs unchanged as plain Python (``NUMBA_DISABLE_JIT=1``).
"""
