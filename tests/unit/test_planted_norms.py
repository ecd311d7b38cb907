"""Copies of the package whose norm has a hole (`experiments.planted_norms`)."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from experiments.planted import HOLES
from experiments.planted_norms import EXIT, HOLE, NONE, SAYS, changed, plant

import dubins_traffic

ROOM = """
import dubins_traffic
from dubins_traffic.rules.parameters import RuleParameters
print(dubins_traffic.__file__, RuleParameters().room_beyond(0.3, 3))
"""


def test_every_change_has_its_place_in_the_package_as_it_is() -> None:
    for module, text in changed().items():
        ast.parse(text, module)
    assert {own.number for own in HOLES.values()} == SAYS.keys()


@pytest.mark.parametrize(("hole", "room"), [(NONE, "1.1"), (EXIT, "0.8")])
def test_a_copy_has_the_hole_that_is_asked_for(tmp_path: Path, hole: int, room: str) -> None:
    tree = plant(tmp_path)
    own = os.environ | {HOLE: str(hole), "PYTHONPATH": str(tree)}
    told = subprocess.run([sys.executable, "-c", ROOM], env=own, stdout=subprocess.PIPE, text=True, check=True)
    file, far = told.stdout.split()
    assert Path(file).is_relative_to(tmp_path)
    assert float(far) == pytest.approx(float(room))
    assert not Path(dubins_traffic.__file__).is_relative_to(tmp_path)
