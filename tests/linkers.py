"""The linker of which libraries of machine code are made: a compiler of the system."""

from __future__ import annotations

from dubins_traffic.compiling import linking
from dubins_traffic.errors import InputError
from tests import tools


def need() -> None:
    """Skip the test where nothing links; under CI it fails."""
    try:
        linking.linker()
    except InputError as error:
        tools.need(str(error), "scripts/system-packages.sh installs a compiler")
    else:
        tools.need("")
