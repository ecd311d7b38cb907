"""Earlier names of modules: each imports the module itself, once, and says where it is now."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module

import pytest

from dubins_traffic import moved


@pytest.mark.parametrize(("earlier", "place"), moved.PLACES.items())
def test_an_earlier_name_is_the_module_itself(earlier: str, place: str) -> None:
    sys.modules.pop(f"dubins_traffic.{earlier}", None)
    with pytest.warns(DeprecationWarning, match=f"has moved: import dubins_traffic.{place}"):
        found = import_module(f"dubins_traffic.{earlier}")
    assert found is import_module(f"dubins_traffic.{place}")
    assert found.__name__ == f"dubins_traffic.{place}" == getattr(found.__spec__, "name", "")


def test_what_has_an_earlier_name_is_loaded_once() -> None:
    program = (
        "from dubins_traffic.roads.maps.losses import Losses as earlier\n"
        "from dubins_traffic.maps.losses import Losses as now\n"
        "assert earlier is now\n"
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True)


def test_no_other_name_is_taken() -> None:
    assert moved.place_of("dubins_traffic.roads.network") is None
    assert moved.place_of("roads.maps") is None
    with pytest.raises(ModuleNotFoundError, match=r"roads\.nowhere"):
        import_module("dubins_traffic.roads.nowhere")
