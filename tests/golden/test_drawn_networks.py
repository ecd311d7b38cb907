"""Random networks are those that their seeds have always given, grown or woven, of every kind of request."""

import json
import os
import subprocess
import sys

import pytest

from tests.golden.drawn_networks import FILE, drawn


def test_networks_of_some_hundred_seeds_are_the_golden_ones() -> None:
    known = json.loads(FILE.read_text(encoding="utf-8"))
    found = dict(drawn())
    assert len(found) > 400
    assert found == known


@pytest.mark.long
def test_they_are_the_same_where_kernels_run_interpreted() -> None:
    around = {**os.environ, "DUBINS_TRAFFIC_KERNELS": "interpreted"}
    command = [sys.executable, "-m", "tests.golden.drawn_networks"]
    done = subprocess.run(command, env=around, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "")
