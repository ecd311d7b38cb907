import math
import signal
import time
from dataclasses import replace

import numpy as np
import pytest

from dubins_traffic.cars.body import DiscObstacle
from dubins_traffic.errors import ControllerError, DubinsTrafficError
from dubins_traffic.kernels.trig import advance
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.parts import Disturbances, Laser
from dubins_traffic.protocols import End
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.scoring.score import Scorer
from tests.minute import a_minute


class Collect:
    """A sink that keeps all it is given."""

    def begin(self, instance):
        self.instance = instance
        self.blocks = []
        self.ending = None

    def frames(self, frames):
        assert self.ending is None
        self.blocks.append(frames)

    def end(self, ending):
        self.ending = ending

    def column(self, name):
        return np.concatenate([getattr(block, name) for block in self.blocks])


def instance(seconds=2.0, **changes):
    drawn = draw(load_config("demo"), 7, 0)
    problem = replace(drawn.problem, **{k: v for k, v in changes.items() if hasattr(drawn.problem, k)})
    rest = {k: v for k, v in changes.items() if not hasattr(drawn.problem, k)}
    return replace(drawn, problem=problem, duration=seconds, **rest)


class Straight:
    """Drives on; what a test wants to go wrong goes wrong at tick 5."""

    def __init__(self, answer=(0.3, 0.0), raises=None, sleeps=0.0):
        self.answer, self.raises, self.sleeps, self.closed = answer, raises, sleeps, 0

    def start(self, problem):
        self.problem = problem

    def act(self, observation):
        if observation.tick < 5:
            return (0.3, 0.0)
        if self.raises:
            raise self.raises
        time.sleep(self.sleeps)
        return self.answer

    def close(self):
        self.closed += 1


def test_frames_come_in_blocks_of_a_second_with_all_frames_once() -> None:
    sink = Collect()
    result = run_trial(instance(2.5), Straight(), sinks=[sink])
    assert [len(block) for block in sink.blocks] == [30, 30, 16]
    assert [block.first for block in sink.blocks] == [0, 30, 60]
    assert sink.column("time").tolist() == pytest.approx(np.arange(76) / 30)
    assert result.ending.end is End.DURATION
    assert result.ending.ticks == 75
    assert sink.ending == result.ending


def test_the_frames_are_the_commands_integrated() -> None:
    sink = Collect()
    run_trial(instance(), Straight((0.3, 0.4)), sinks=[sink])
    pose = sink.instance.starts[0]
    for k in range(60):
        pose = advance(*pose, 0.3, 0.4 if k >= 5 else 0.0, 1 / 30)
        assert tuple(column[k + 1, 0] for column in map(sink.column, "xycs")) == pose
    assert sink.column("command_yaw_rate")[5:7, 0].tolist() == [0.0, 0.4]


@pytest.mark.parametrize(
    ("controller", "end", "detail"),
    [
        (Straight(raises=ZeroDivisionError("no")), End.CONTROLLER_FAULT, "ZeroDivisionError: no at tick 5"),
        (Straight(None), End.GAVE_UP, "at tick 5"),
        (Straight("left"), End.CONTROLLER_FAULT, "'left'"),
        (Straight((1.0,)), End.CONTROLLER_FAULT, "(1.0,)"),
        (Straight((math.nan, 0.0)), End.CONTROLLER_FAULT, "nan"),
        (Straight((0.0, -math.inf)), End.CONTROLLER_FAULT, "inf"),
        (Straight(raises=StopIteration()), End.CONTROLLER_FAULT, "StopIteration"),
    ],
)
def test_a_controller_ends_its_own_trial_only(controller, end, detail) -> None:
    sink = Collect()
    result = run_trial(instance(), controller, sinks=[sink])
    assert result.ending.end is end
    assert detail in result.ending.detail
    assert result.ending.ticks == 5
    assert len(sink.column("x")) == 6
    assert sink.blocks[-1].events[-1].kind == end.value
    assert controller.closed == 1
    assert result.wall.reproducible


def test_what_a_controller_reports_is_an_event_of_the_ego():
    class Telling(Straight):
        calls = 0

        def report(self):
            self.calls += 1
            return [("turn", f"call {self.calls}")] if self.calls in (3, 31) else []

    sink = Collect()
    run_trial(instance(), Telling(), sinks=[sink])
    events = [event for block in sink.blocks for event in block.events]
    assert [(event.tick, event.kind, event.car, event.detail) for event in events] == [
        (2, "turn", 0, "call 3"),
        (30, "turn", 0, "call 31"),
    ]


def test_a_controller_that_fails_to_start() -> None:
    class Broken(Straight):
        def start(self, problem):
            raise RuntimeError(f"{len(problem.goals)} goals are too many")

    result = run_trial(instance(), Broken())
    assert result.ending.end is End.CONTROLLER_FAULT
    assert "goals are too many" in result.ending.detail
    assert result.wall.time_to_begin_s is None


@pytest.mark.parametrize("sleep", [0.05, 3600.0])
def test_a_late_controller_is_ended_by_its_deadline(sleep) -> None:
    result = run_trial(instance(), Straight(sleeps=sleep), deadline=0.02)
    assert result.ending.end is End.DEADLINE
    assert not result.wall.reproducible


def test_a_deadline_leaves_the_alarm_that_somebody_else_has_set(request) -> None:
    request.addfinalizer(lambda: signal.setitimer(signal.ITIMER_REAL, 0.0))
    signal.setitimer(signal.ITIMER_REAL, 3600.0)
    assert run_trial(instance(), Straight(), deadline=600.0).ending.end is End.DURATION
    assert signal.getitimer(signal.ITIMER_REAL)[0] > 600.0


def test_ctrl_c_ends_the_trial_as_interrupted() -> None:
    sink = Collect()
    with pytest.raises(KeyboardInterrupt):
        run_trial(instance(), Straight(raises=KeyboardInterrupt()), sinks=[sink])
    assert sink.ending.end is End.INTERRUPTED
    assert len(sink.column("x")) == 6


def test_an_error_of_our_own_is_not_the_controllers_fault() -> None:
    class Broken(Collect):
        def frames(self, _frames):
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        run_trial(instance(), Straight(), sinks=[Broken()])


def test_step_by_step() -> None:
    trial = Trial(instance())
    assert trial.observation.tick == 0
    while trial.ending is None:
        observation = trial.step((0.1, 0.0))
    assert observation.tick == trial.tick == 60
    assert observation.time == 2.0
    with pytest.raises(DubinsTrafficError, match="has ended"):
        trial.step((0.1, 0.0))
    trial = Trial(instance())
    with pytest.raises(ControllerError):
        trial.step((math.nan, 0.0))
    assert trial.ending.end is End.CONTROLLER_FAULT


def test_stepping_gives_the_frames_of_running() -> None:
    stepped, ran = Collect(), Collect()
    trial = Trial(instance(), sinks=[stepped])
    controller = Straight((0.2, 0.3))
    while trial.ending is None:
        trial.step(controller.act(trial.observation))
    run_trial(instance(), Straight((0.2, 0.3)), sinks=[ran])
    for name in ("x", "c", "segment", "bits", "command_speed"):
        assert stepped.column(name).tobytes() == ran.column(name).tobytes()


def test_a_collision_ends_the_trial_if_asked() -> None:
    drawn = instance(10.0)
    ego = drawn.starts[0]
    ahead = DiscObstacle(ego.x + 1.0 * ego.c, ego.y + 1.0 * ego.s, 0.2)
    asked = instance(10.0, obstacles=(ahead,), end_on_collision=True)
    result = run_trial(asked, Straight())
    assert result.ending.end is End.COLLISION
    assert "obstacle 0" in result.ending.detail
    assert result.score.collisions[0].at_fault
    goes_on = run_trial(replace(asked, end_on_collision=False), Straight())
    assert goes_on.ending.end is End.DURATION
    assert len(goes_on.score.collisions) == 1


def test_delay_and_loss_of_commands() -> None:
    def commanded(**disturbances):
        sink = Collect()
        run_trial(instance(10.0, disturbances=Disturbances(**disturbances)), Straight((0.4, 0.0)), sinks=[sink])
        return sink.column("command_speed")[1:, 0]

    assert commanded(command_delay=3)[:10].tolist() == [0, 0, 0, 0.3, 0.3, 0.3, 0.3, 0.3, 0.4, 0.4]
    assert set(commanded(command_loss=1.0)) == {0.0}
    some = commanded(command_loss=0.5, command_delay=2)
    assert some[-1] == 0.4
    assert some.tolist() == commanded(command_loss=0.5, command_delay=2).tolist()


def test_noise_touches_observations_only() -> None:
    noisy = Trial(instance(disturbances=Disturbances(position_noise=0.1, heading_noise=0.2)))
    exact = Trial(instance())
    gaps = []
    for _ in range(60):
        gaps.append(noisy.observation.pose.x - exact.observation.pose.x)
        noisy.step((0.3, 0.0))
        exact.step((0.3, 0.0))
    assert 0.05 < np.std(gaps) < 0.15
    assert noisy._state.x.tobytes() == exact._state.x.tobytes()


def test_the_laser_sweeps_at_its_own_rate() -> None:
    trial = Trial(instance(laser=Laser(rays=8, rate=10.0)))
    scans = []
    for _ in range(12):
        scans.append(trial.observation.scan)
        trial.step((0.0, 0.0))
    assert [scan is scans[k - 1] for k, scan in enumerate(scans)][1:] == [True, True, False] * 3 + [
        True,
        True,
    ]
    assert scans[0].shape == (8,)
    assert Trial(instance()).observation.scan is None


def test_a_judged_trial_is_scored_before_its_first_second_has_passed() -> None:
    trial = Trial(draw(a_minute("town"), 1, 0), sinks=[Scorer()])
    assert Scorer in {type(sink) for sink in trial.sinks}
    first = trial.sinks[0].result()
    trial.step((0.5, 0.0))
    second = trial.sinks[0].result()
    assert (first.duration_s, second.duration_s) == (0.0, trial.instance.problem.period)
    assert first.verdict is not None
