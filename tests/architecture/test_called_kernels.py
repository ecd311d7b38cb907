"""The library of machine code has every kernel that Python calls."""

from dubins_traffic.compiling.building import entries
from tests.architecture.called_kernels import called_kernels


def test_every_kernel_that_python_calls_is_in_the_library() -> None:
    """A new call needs a moment in `dubins_traffic.compiling.moments`, which says of what kinds its arguments are."""
    held = {f"{own.kernel.__module__}.{own.kernel.__qualname__}" for own in entries()}
    called = called_kernels()
    assert len(called) > 40
    assert {name: str(file) for name, file in called.items() if name not in held} == {}
