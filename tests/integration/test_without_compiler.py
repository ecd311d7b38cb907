"""Parts of a user's own, with machine code and without a library and Numba: the same, and one line says so."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples" / "extending"
TRIAL = """
import json, sys
if sys.argv[1] == "without":
    from dubins_traffic.kernels import library
    from dubins_traffic.compiling import beside
    beside.can_build = lambda: False
    library.libraries = tuple
import dubins_traffic as dt
document, options = json.loads(sys.argv[2]), json.loads(sys.argv[3])
if "simulator" in options:
    sys.path.insert(0, options.pop("simulator"))
    from my_simulator import Stepping
    options["simulator"] = Stepping()
result = dt.run_trial(dt.draw(dt.load_config(document), 3, 0), "simple", record=sys.argv[4], **options)
told = {name: value for name, value in result.score.asdict().items() if name not in ("record", "time_to_begin_s")}
print(json.dumps(told, default=str, sort_keys=True))
print(result.ending.end.value)
"""
"""Runs a trial, as it is or as if there were no Numba."""
BICYCLE = {"model": f"{EXAMPLES / 'my_car.py'}:Bicycle", "bounds": {"turning_radius": 0.25}}
OWN: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "car model": ({"car": BICYCLE, "rules": False}, {}),
    "e-agent": ({"e-agents": [{"type": f"{EXAMPLES / 'my_e_agent.py'}:Patrol", "name": "patrol"}]}, {}),
    "metric": ({}, {"metrics": [f"{EXAMPLES / 'my_metric.py'}:Turning"]}),
    "simulator": ({}, {"simulator": str(EXAMPLES)}),
}


def ran(how: str, document: Any, options: Any, record: Path) -> tuple[str, str]:
    words = [sys.executable, "-c", TRIAL, how, json.dumps(document), json.dumps(options), str(record)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=os.environ)
    return done.stdout, done.stderr


@pytest.mark.parametrize("part", OWN)
def test_a_part_of_ones_own_does_the_same_without_a_compiler(part, tmp_path) -> None:
    changes, options = OWN[part]
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": 2, "columns": 3}},
        "e-agents": [{"type": "wander", "name": "wanderer"}],
        "number_trials": 1,
        "duration": 2.0,
        "number_goals_bounds": [2, 2],
        **changes,
    }
    told, _ = ran("with", document, options, tmp_path / "with.mcap")
    again, said = ran("without", document, options, tmp_path / "without.mcap")
    assert again == told
    assert (tmp_path / "with.mcap").read_bytes() == (tmp_path / "without.mcap").read_bytes()
    assert said.count("dubins-traffic[compile]") == said.count("\n") == 1
