import math
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car
from dubins_traffic.cars.state import Observation, Pose, Propositions, Twist
from dubins_traffic.controllers import registry
from dubins_traffic.controllers.simple import Simple
from dubins_traffic.errors import InputError

PLACES = np.array([[2.0, 0.0], [2.0, 2.0], [-1.0, 0.5]])


def problem(count: int = 3, radius: float = 1.0) -> Any:
    return SimpleNamespace(
        car=Car(),
        network=SimpleNamespace(points=PLACES),
        goals=tuple((k, 0) for k in range(count)),
        goal_vertices=tuple(range(count)),
        intersection_radius=radius,
    )


def seen(x: float, y: float, theta: float) -> Observation:
    pose = Pose(x, y, math.cos(theta), math.sin(theta))
    return Observation(0, 0.0, pose, Twist(0.0, 0.0), Propositions(0, -1, -1, -1, 0), (), None)


def begun(count: int = 3) -> Simple:
    controller = Simple()
    controller.start(problem(count))
    return controller


def test_simple_turns_then_drives() -> None:
    assert begun().act(seen(0.0, 0.0, 0.0)) == (0.5, 0.0)
    assert begun().act(seen(0.0, 0.0, 0.099)) == (0.5, 0.0)
    assert begun().act(seen(0.0, 0.0, 0.101)) == (0.0, -0.9)
    assert begun().act(seen(0.0, 0.0, -0.101)) == (0.0, 0.9)


def test_simple_wraps_the_bearing_error() -> None:
    assert begun().act(seen(4.0, -0.1, -3.0)) == (0.0, -0.9)
    assert begun().act(seen(4.0, 0.1, 3.0)) == (0.0, 0.9)


def test_simple_takes_the_next_goal_within_half_the_radius() -> None:
    controller = begun()
    assert controller.act(seen(1.49, 0.0, 0.0)) == (0.5, 0.0)
    assert controller.act(seen(1.51, 0.0, 0.0)) == (0.0, 0.9)
    assert controller.act(seen(2.0, 1.6, math.pi / 2)) == (0.0, 0.9)
    assert controller.act(seen(-0.9, 0.5, 0.0)) == (0.0, -0.9)


def test_simple_drives_arcs_with_a_car_that_cannot_turn_in_place() -> None:
    """A point within its tightest circle it leaves behind first; one behind it turns for."""
    own = problem(1, 0.01)
    own.car = Car(bounds=Bounds(turning_radius=1.0))
    controller = Simple()
    controller.start(own)
    gx, gy = PLACES[0]
    assert controller.act(seen(gx - 4.0, gy, 0.0)) == pytest.approx((0.5, 0.0))
    assert controller.act(seen(gx, gy - 0.5, 0.0)) == (0.5, 0.0)
    assert controller.act(seen(gx + 4.0, gy - 1.0, 0.0)) == pytest.approx((0.5, 0.5))
    assert controller.act(seen(gx + 4.0, gy + 1.0, 0.0)) == pytest.approx((0.5, -0.5))


def test_simple_goes_round_its_goals() -> None:
    controller = begun()
    x = y = theta = 0.0
    visits = []
    for _ in range(3000):
        speed, yaw_rate = controller.act(seen(x, y, theta))
        theta += yaw_rate / 30
        x += speed / 30 * math.cos(theta)
        y += speed / 30 * math.sin(theta)
        near = [k for k in range(3) if math.dist((x, y), PLACES[k]) < 0.5]
        if near and (not visits or visits[-1] != near[0]):
            visits.append(near[0])
    assert visits[:9] == [0, 1, 2, 0, 1, 2, 0, 1, 2]


def test_simple_without_goals_stands() -> None:
    assert begun(0).act(seen(0.0, 0.0, 1.0)) == (0.0, 0.0)


def test_simple_costs_microseconds() -> None:
    controller, observation = begun(), seen(0.0, 0.0, 0.5)
    began = time.process_time()
    for _ in range(20_000):
        controller.act(observation)
    assert time.process_time() - began < 20_000 * 20e-6


def test_built_in_controllers_are_listed() -> None:
    listed = registry.names()
    assert set(listed) == {"simple", "lanes", "rules", "synthesized"}
    assert all(line and "\n" not in line for line in listed.values())
    assert isinstance(registry.load("simple"), Simple)


def test_listing_does_not_load_the_compiler() -> None:
    code = (
        "import sys; from dubins_traffic.controllers import registry; registry.names(); registry.load('simple');"
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


GOOD = """
from dataclasses import dataclass
@dataclass
class Mine:
    speed: float = 0.25
    def start(self, problem): pass
    def act(self, observation): return self.speed, 0.0
class Halting:
    def start(self, problem): pass
class Numb:
    def act(self, observation): return 0.0, 0.0
class Picky:
    def __init__(self, size): pass
class Angry:
    def __init__(self): raise RuntimeError("no")
number = 3
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "fine_controller.py").write_text(GOOD)
    (tmp_path / "broken_controller.py").write_text("import fine_controller\nraise ValueError('early')\n")
    (tmp_path / "needy_controller.py").write_text("import no_such_library\n")
    (tmp_path / "odd_controller.py").write_text("def f(:\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return tmp_path


@pytest.mark.parametrize("place", ["fine_controller.py", "{}/fine_controller.py", "fine_controller"])
def test_a_controller_of_ones_own_is_loaded(folder: Path, place: str) -> None:
    made = registry.load(f"{place.format(folder)}:Mine")
    assert made.act(cast(Observation, None)) == (0.25, 0.0)


@pytest.mark.parametrize(
    ("spec", "said"),
    [
        ("nobody", "unknown controller"),
        ("", "unknown controller"),
        ("fine_controller.py", "unknown controller"),
        ("fine_controller.py:", "unknown controller"),
        ("nowhere.py:Mine", "no such file: nowhere.py"),
        ("fine_controller.py:Yours", "no class Yours"),
        ("fine_controller.py:number", "number in fine_controller.py is not a class"),
        ("fine_controller.py:Halting", "it lacks the method act"),
        ("fine_controller.py:Numb", "it lacks the method start"),
        ("fine_controller.py:Picky", "Picky raised TypeError"),
        ("fine_controller.py:Angry", "Angry raised RuntimeError: no (fine_controller.py:"),
        (
            "broken_controller.py:Mine",
            "raised ValueError: early (broken_controller.py:2 in <module>: raise ValueError('early')) while it was",
        ),
        ("odd_controller.py:Mine", "raised SyntaxError"),
        ("no_such_module:Mine", "no module no_such_module"),
        ("needy_controller:Mine", "needy_controller raised ModuleNotFoundError"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_what_is_no_controller_is_refused(spec: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        registry.load(spec)
    assert said in str(caught.value)
    assert str(caught.value).startswith("controller: ")
    assert caught.value.value == spec


def test_a_refusal_names_the_classes_there_are(folder: Path) -> None:
    with pytest.raises(InputError, match="one of Mine, Numb"):
        registry.load(f"{folder}/fine_controller.py:Yours")


def test_the_example_is_a_controller() -> None:
    file = Path(__file__).parents[2] / "examples" / "controller.py"
    controller = registry.load(f"{file}:Homing")
    controller.start(problem(2))
    assert controller.act(seen(0.0, 0.0, 0.0)) == (0.5, 0.0)
    assert controller.act(seen(0.0, 0.0, 3.0)) == (0.0, 0.9)
    assert len([line for line in file.read_text().splitlines()[3:] if line and '"""' not in line]) <= 11
