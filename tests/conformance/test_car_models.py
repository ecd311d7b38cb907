"""The suite of every car model: those of the table, and one from a file outside; a new model joins by itself."""

from __future__ import annotations

import json
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dubins_traffic.cars import dynamics
from dubins_traffic.cars.body import Body, Bounds, Car, Disc, DiscObstacle, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.cars.touching import Bodies
from dubins_traffic.cli.main import main
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.envs.settings import Settings
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.scoring.score import score
from dubins_traffic.shield.filter import ShieldFilter
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.verification.verify import verify
from tests.batches import pose, scene
from tests.property.test_batch import SEED, configuration, plain

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "extending" / "my_car.py"
OUTSIDE = f"{EXAMPLE}:Bicycle"
MODELS = [*dynamics.BUILT_IN, OUTSIDE]
BOUNDS = Bounds(speed=2.0, turning_radius=0.25)


@pytest.fixture(params=MODELS, ids=lambda spec: str(spec).rpartition("/")[2])
def model(request: pytest.FixtureRequest) -> str:
    return request.param


def drawn(model: str, **parts: Any) -> Any:
    """Return a configuration whose cars are of a model."""
    car = {"model": model, "bounds": {"turning_radius": 0.25}}
    agents = [{"type": "wander", "name": "other", "count": 2}]
    given = {"car": car, "e-agents": agents, "duration_bounds": [2, 3], "number_trials": 2}
    return configuration(**{**given, **parts})


def crowd(model: str, body: Body, seed: int) -> tuple[Instance, list[Floats]]:
    """Return cars close to each other and to an obstacle, and commands that change now and then."""
    rng = np.random.default_rng(seed)
    starts = [pose((k % 3) * 0.9, (k // 3) * 0.9, rng.uniform(-3, 3)) for k in range(6)]
    instance = scene(starts, Car(body=body, bounds=BOUNDS, model=model), [DiscObstacle(-1.0, 1.0, 0.4)])
    phases = [rng.uniform(-1, 1, (1, 6, 2)) * [2, 3] for _ in range(5)]
    return instance, [phases[k // 12].copy() for k in range(60)]


def test_alone_again_in_a_batch_and_from_a_record_it_does_the_same(model: str, tmp_path: Path) -> None:
    made = drawn(model)
    together = run_batch(made, "lanes", trials=2, seed=SEED)
    for trial, outcome in enumerate(together.outcomes):
        record = tmp_path / f"{trial}.mcap"
        instance = draw(made, SEED, trial)
        alone = run_trial(instance, "lanes", record=record)
        run_trial(instance, "lanes", record=tmp_path / "again.mcap", overwrite=True)
        assert alone.ending.end is End.DURATION
        assert plain(outcome.score) == plain(alone.score) == plain(score(read(record)))
        assert record.read_bytes() == (tmp_path / "again.mcap").read_bytes()
        assert read(record).instance.problem.car == instance.problem.car
        assert instance.problem.car.model == model
        assert verify(record).verified


def test_a_fork_goes_on_as_its_trial(model: str) -> None:
    with Trial(draw(drawn(model), SEED, 0)) as trial:
        for _ in range(25):
            trial.step((0.5, 0.4))
        with trial.fork() as twin:
            while trial.ending is None:
                assert trial.step((0.6, -0.3)) == twin.step((0.6, -0.3))
            assert trial.ending == twin.ending


def test_what_is_clipped_is_clipped_and_bounds_hold(model: str) -> None:
    instance = scene([pose(0, 0)], Car(bounds=BOUNDS, model=model))
    first, second = Embedded(), Embedded()
    state, same = first.reset([instance]), second.reset([instance])
    for speed, yaw_rate in ((9.0, 0.0), (0.7, -9.0), (-0.4, 1.0), (0.0, 1.0), (0.5, 0.5)) * 6:
        commands = np.array([[[speed, yaw_rate]]])
        first.step(commands)
        taken = commands.copy()
        second.step(commands)
        assert np.array_equal(commands, taken)
        assert all(np.array_equal(one, two) for one, two in zip(state, same, strict=True))
        u, w = float(state.speed[0, 0]), float(state.yaw_rate[0, 0])
        assert abs(u) <= BOUNDS.speed
        assert abs(w) <= abs(u) / BOUNDS.turning_radius + 1e-12


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_bodies_never_overlap_and_what_is_fixed_stands(model: str, body: Body) -> None:
    touched = 0
    for seed in range(3):
        instance, drives = crowd(model, body, seed)
        simulator = Embedded()
        state = simulator.reset([instance])
        bodies = Bodies(instance.problem.car, instance.problem.obstacles)
        pairs = [(i, j) for i in range(6) for j in (-1, *range(i + 1, 6))]
        for tick, drive in enumerate(drives, start=1):
            (contacts,) = simulator.step(drive)
            touched += len(contacts)
            assert all(bodies.separation(state, *pair)[0] > -3e-9 for pair in pairs)
            times = [contact.time for contact in contacts]
            assert times == sorted(times)
            assert all((tick - 1) / 30 - 1e-12 <= time <= tick / 30 + 1e-12 for time in times)
            for contact in contacts:
                assert max(contact.moved)
                if contact.time < tick / 30 - 1e-9:
                    assert state.speed[0, contact.car] == 0.0
    assert touched >= 3


def driven(model: str, commands: Sequence[tuple[float, float]], start: Pose, rate: float = 30.0) -> Floats:
    """Return x, y, cosine and sine (K + 1, 4) of a car that holds each of the commands for a tick."""
    simulator = Embedded()
    state = simulator.reset([scene([start], Car(bounds=BOUNDS, model=model), rate=rate)])
    rows = [[state.x[0, 0], state.y[0, 0], state.c[0, 0], state.s[0, 0]]]
    for command in commands:
        simulator.step(np.array([[command]]))
        rows.append([state.x[0, 0], state.y[0, 0], state.c[0, 0], state.s[0, 0]])
    return np.array(rows)


PHASES = [(0.8, 0.0), (0.8, 1.2), (0.3, -0.6), (-0.5, 0.4), (0.0, 1.0), (1.1, 2.0)]
HELD = [command for command in PHASES for _ in range(10)]
"""Commands, each for ten ticks."""


def test_what_is_clipped_once_is_taken_as_it_is(model: str) -> None:
    """Else records, which hold the commands taken, could not be run again."""
    own = dynamics.begun(Car(bounds=BOUNDS, model=model), 1 / 30)
    for speed, yaw_rate in [*PHASES, (9.0, -9.0), (-9.0, 0.0), (0.0, 0.0)]:
        taken = own.clip(speed, yaw_rate)
        assert own.clip(*taken) == taken
        arcs = own.advance(*taken)
        assert sum(seconds for _, _, seconds in arcs) == pytest.approx(1 / 30, rel=1e-12)


def test_a_car_is_where_a_fine_integration_of_its_arcs_leads(model: str) -> None:
    own = dynamics.begun(Car(bounds=BOUNDS, model=model), 1 / 30)
    place = [0.3, -0.2, 0.4]
    rows = driven(model, HELD, pose(*place))
    for tick, command in enumerate(HELD):
        for speed, yaw_rate, seconds in own.advance(*own.clip(*command)):
            u = min(max(speed, -BOUNDS.speed), BOUNDS.speed)
            most = min(BOUNDS.yaw_rate, abs(u) / BOUNDS.turning_radius)
            w = min(max(yaw_rate, -most), most)

            def flow(_t: float, at: Any, u: float = u, w: float = w) -> list[float]:
                return [u * math.cos(at[2]), u * math.sin(at[2]), w]

            if seconds > 0.0:
                place = solve_ivp(flow, (0.0, seconds), place, rtol=1e-11, atol=1e-12).y[:, -1].tolist()
        assert rows[tick + 1] == pytest.approx([place[0], place[1], math.cos(place[2]), math.sin(place[2])], abs=1e-8)


def test_a_command_held_twice_as_long_leads_where_two_ticks_do(model: str) -> None:
    whole = driven(model, HELD, pose(0, 0, 0.5))
    halves = driven(model, [command for command in HELD for _ in range(2)], pose(0, 0, 0.5), rate=60.0)
    exact = 1e-9 if model == "dubins" else 5e-3 if model == OUTSIDE else 1e-4
    assert np.abs(whole - halves[::2]).max() < exact


def test_rigid_motions_commute_with_the_motion(model: str) -> None:
    rows = driven(model, HELD, pose(0.3, -0.2, 0.4))
    turn, c, s = 1.1, math.cos(1.1), math.sin(1.1)
    moved = driven(model, HELD, pose(0.3 * c + 0.2 * s + 5.0, 0.3 * s - 0.2 * c - 3.0, 0.4 + turn))
    turned = np.array([[c, -s], [s, c]])
    assert moved[:, :2] == pytest.approx(rows[:, :2] @ turned.T + [5.0, -3.0], abs=1e-9)
    assert moved[:, 2:] == pytest.approx(rows[:, 2:] @ turned.T, abs=1e-9)


def test_interpreted_it_writes_the_same_record(model: str, tmp_path: Path) -> None:
    (tmp_path / "small.json").write_text(json.dumps(drawn(model, duration_bounds=[1, 1]).to_document()))
    found: list[bytes] = []
    for switch in ("0", "1"):
        out = tmp_path / switch
        command = [
            "run",
            str(tmp_path / "small.json"),
            "--controller",
            "lanes",
            "--trials",
            "1",
            "--records",
            str(out),
        ]
        env = {**os.environ, "NUMBA_DISABLE_JIT": switch}
        subprocess.run([sys.executable, "-m", "dubins_traffic.cli", *command], env=env, check=True, timeout=600)
        found.append((out / "trial-0000.mcap").read_bytes())
    assert found[0] == found[1]


def test_the_bicycle_follows_its_equations() -> None:
    """Speed and steering angle go to what is asked for at their limits; the way follows, to 1e-4 m in two seconds."""
    base, gain, loss, rate, steps = 0.2, 1.5, 3.0, 2.0, 500
    most = math.atan(base / BOUNDS.turning_radius)
    rows = driven("bicycle", HELD, pose(0, 0))
    x = y = heading = v = angle = 0.0
    h = 1 / 30 / steps
    for k, (speed, yaw_rate) in enumerate(HELD, start=1):
        wheel = min(max(math.atan(base * yaw_rate / speed), -most), most) if speed else angle
        for _ in range(steps):
            goal = 0.0 if v * speed < 0.0 else speed
            limit = (loss if abs(goal) < abs(v) else gain) * h
            now, turned = (
                min(max(goal, v - limit), v + limit),
                min(max(wheel, angle - rate * h), angle + rate * h),
            )
            bend = math.tan(0.5 * (angle + turned)) / base
            middle = heading + 0.25 * h * (v + now) * bend
            x += 0.5 * h * (v + now) * math.cos(middle)
            y += 0.5 * h * (v + now) * math.sin(middle)
            heading += 0.5 * h * (v + now) * bend
            v, angle = now, turned
        assert rows[k, :2] == pytest.approx([x, y], abs=1e-4)


@pytest.mark.parametrize(
    ("name", "value"),
    [("wheelbase", 0.0), ("wheelbase", 5e-324), ("braking", -1.0), ("steering_rate", "much")],
)
def test_a_bicycle_that_is_none_is_refused(name: str, value: Any) -> None:
    car = {"model": "bicycle", "parameters": {name: value}}
    with pytest.raises(InputError, match=rf"car\.parameters\.{name}"):
        run_trial(draw(drawn("bicycle", car=car), SEED, 0), "lanes")


def test_environments_refuse_a_car_model_by_name() -> None:
    with pytest.raises(InputError, match="environments move cars together") as caught:
        Settings(drawn("bicycle"))
    assert caught.value.field == "car.model"


TWIN = """
class Twin:
    def begin(self, car, period, parameters): self.period = period
    def clip(self, speed, yaw_rate): return speed, yaw_rate
    def advance(self, speed, yaw_rate): return [(speed, yaw_rate, self.period)]
"""


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_a_dubins_car_of_ones_own_is_the_dubins_car_bit_for_bit(body: Body, tmp_path: Path) -> None:
    (tmp_path / "twin.py").write_text(TWIN)
    ends: list[Any] = []
    for spec in ("dubins", f"{tmp_path / 'twin.py'}:Twin"):
        instance, drives = crowd(spec, body, 1)
        simulator = Embedded()
        state = simulator.reset([instance])
        found = [simulator.step(drive) for drive in drives]
        ends.append((repr(found), [array.tobytes() for array in state]))
    assert "Contact(" in ends[0][0]
    assert ends[0] == ends[1]


HALVES = """
class Halves:
    def begin(self, car, period, parameters): self.half = 0.5 * period
    def clip(self, speed, yaw_rate): return speed, yaw_rate
    def advance(self, speed, yaw_rate): return [(speed, 0.0, self.half), (0.0, 0.0, self.half)]
"""


def test_contacts_of_later_parts_know_of_the_tick(tmp_path: Path) -> None:
    """One car drives in the first half of a tick; the other hits it in the second, when it stands."""
    (tmp_path / "halves.py").write_text(HALVES)
    (tmp_path / "late.py").write_text(HALVES.replace("(speed, 0.0, self.half), (0.0", "(0.0, 0.0, self.half), (speed"))
    late = HALVES.replace("[(speed, 0.0, self.half), (0.0, 0.0, self.half)]", "self.arcs(speed)") + (
        "    def arcs(self, speed):\n"
        "        still, go = (0.0, 0.0, self.half), (speed, 0.0, self.half)\n"
        "        return [go, still] if speed > 0.0 else [still, go]\n"
    )
    (tmp_path / "late.py").write_text(late)
    car = Car(bounds=Bounds(speed=3.0), model=f"{tmp_path / 'late.py'}:Halves")
    simulator = Embedded()
    state = simulator.reset([scene([pose(0, 0), pose(0.354 + 0.06, 0)], car)])
    (contacts,) = simulator.step(np.array([[[1.2, 0.0], [-3.0, 0.0]]]))
    (contact,) = contacts
    assert contact.time == pytest.approx(1 / 60 + (0.06 - 1.2 / 60) / 3.0, abs=1e-9)
    assert contact.moved == (True, True)
    assert contact.closing == pytest.approx((0.0, 3.0))
    assert state.x[0, 0] == pytest.approx(1.2 / 60)


def test_it_runs_in_every_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE, "my_car.py")
    Path("small.json").write_text(json.dumps(drawn("my_car:Bicycle").to_document()))
    assert main(["run", "small.json", "--controller", "lanes", "--records", "out"]) == 0
    assert main(["batch", "small.json", "--controller", "lanes", "--keep", "all", "--records", "other"]) == 0
    for name in ("trial-0000.mcap", "trial-0001.mcap"):
        assert Path("out", name).read_bytes() == Path("other", name).read_bytes()
        assert main(["verify", f"out/{name}"]) == 0
    assert main(["replay", "out/trial-0000.mcap", "-o", "replay.html"]) == 0
    header = read("out/trial-0000.mcap").instance.problem.car
    assert (header.model, dict(header.parameters)) == ("my_car:Bicycle", {})


def test_a_model_of_another_package_is_found_by_its_entry_point(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other_cars.py").write_text(EXAMPLE.read_text())
    info = tmp_path / "other_cars-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: other-cars\nVersion: 1\n")
    entry = EntryPoint("other-bicycle", "other_cars:Bicycle", dynamics.GROUP)
    (info / "entry_points.txt").write_text(f"[{entry.group}]\n{entry.name} = {entry.value}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    dynamics.forget()
    try:
        assert run_trial(draw(drawn("other-bicycle"), SEED, 0), "lanes").ending.end is End.DURATION
        assert main(["list", "car-models"]) == 0
        assert "other-bicycle  Speeds up, brakes and steers" in capsys.readouterr().out
    finally:
        dynamics.forget()


@pytest.mark.parametrize("options", [["--controller", "rules"], ["--controller", "lanes", "--shield"]])
def test_a_run_of_another_model_is_refused_before_it_begins(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "bicycle.json"
    file.write_text(json.dumps(drawn("bicycle").to_document()))
    records = tmp_path / "records"
    assert main(["run", str(file), "--trials", "1", "--records", str(records), *options]) == 2
    said = capsys.readouterr().err
    assert "bicycle.json" in said
    assert "car.model: " in said
    assert "is known to be right for the Dubins car only: got 'bicycle'" in said
    assert not records.exists()
    assert main(["run", str(file), "--trials", "1", "--controller", "lanes"]) in (0, 1)


def test_what_is_for_dubins_cars_alone_is_refused() -> None:
    words = "for the Dubins car only"
    made = draw(drawn(OUTSIDE), SEED, 0)
    for controller in ("rules", "lanes+shield"):
        ending = run_trial(made, controller).ending
        assert ending.end is End.CONTROLLER_FAULT
        assert words in ending.detail
    with pytest.raises(InputError, match=words):
        ShieldFilter().start(made.problem)
    lawful = drawn(OUTSIDE, **{"e-agents": [{"type": "lawful", "name": "other"}]})
    with pytest.raises(InputError, match=words) as caught:
        run_trial(draw(lawful, SEED, 0), "lanes")
    assert caught.value.field == "car.model"
    with pytest.raises(InputError, match="by themselves"):
        Embedded().reset([made, made])


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        ("nothing", "unknown car model.*'nothing'.*dubins"),
        ("os:abort", "abort is not a class"),
        ("pathlib:Path", "lacks the method begin"),
        ("nowhere_at_all:Car", "no module nowhere_at_all"),
    ],
)
def test_what_is_no_car_model_is_refused(spec: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        run_trial(draw(drawn(spec), SEED, 0), "lanes")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("return speed, yaw_rate", "1 / 0"),
            "clip gave ZeroDivisionError: division by zero; expected no exception",
        ),
        (("return speed, yaw_rate", "return speed"), "; expected 2 finite numbers"),
        (("(speed, yaw_rate, self.period)", ""), "advance gave 0 arcs"),
        (("self.period)", "0.5 * self.period)"), "advance gave arcs that last 0.0166667 s"),
        (("[(", "iter(lambda: (0.0, 0.0, 0.0), None) or [("), "advance gave more than 256 arcs"),
        (("(speed, yaw", "(float('nan'), yaw"), "advance gave (nan, 0.0, "),
        (("return [(", "return 5, [("), "advance gave 5; expected 3 finite numbers"),
    ],
)
def test_what_a_model_gets_wrong_ends_its_trial_by_name(change: tuple[str, str], words: str, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(TWIN.replace(*change))
    spec, record = f"{tmp_path / 'bad.py'}:Twin", tmp_path / "a.mcap"
    ending = run_trial(draw(drawn(spec, **{"e-agents": []}), SEED, 0), "lanes", record=record).ending
    assert (ending.end, ending.ticks) == (End.WORLD_LOST, 0)
    assert f"the model {spec} of the ego is not fit: " in ending.detail
    assert words in ending.detail
    assert verify(record).verified


def test_a_model_that_raises_in_begin_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(TWIN.replace("self.period = period", "1 / 0"))
    with pytest.raises(InputError, match="Twin raised ZeroDivisionError: division by zero in begin"):
        run_trial(draw(drawn(f"{tmp_path / 'bad.py'}:Twin"), SEED, 0), "lanes")


def test_parameters_are_those_of_the_class() -> None:
    car = {"model": OUTSIDE, "parameters": {"accelerations": 1.0}}
    with pytest.raises(InputError, match=r"unknown parameter.*accelerations.*acceleration, braking"):
        run_trial(draw(drawn(OUTSIDE, car=car), SEED, 0), "lanes")
    slow = {"model": OUTSIDE, "parameters": {"acceleration": 0.3}, "bounds": {"turning_radius": 0.25}}
    with Trial(draw(drawn(OUTSIDE, car=slow), SEED, 0)) as trial:
        for _ in range(15):
            trial.step((0.7, 0.0))
        assert math.isclose(trial.observation.twist.speed, 0.15, rel_tol=1e-9)
