"""Work that goes over from interpreted to compiled kernels on its way gives what it gives in either."""

import gc
from pathlib import Path

import pytest

from dubins_traffic.compiling import beside, store
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.engine.batch_kernel import run_trials
from dubins_traffic.kernels import compile, library
from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.machine import Code
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import run_trial
from tests.minute import a_minute

TRIALS = 6


class Switches:
    """Lets all kernels begin interpreted and go over after some looks for their machine code."""

    def __init__(self, monkeypatch, looks: int) -> None:
        self.seen: list[Kernel] = []
        self._looks = looks
        sought, there = Kernel._sought, beside.Waiting.is_there
        missed: set[tuple] = set()
        left: dict[int, int] = {}

        def seek(kernel, kinds):
            if (id(kernel), kinds) not in missed:
                missed.add((id(kernel), kinds))
                self.seen.append(kernel)
                with monkeypatch.context() as patch:
                    patch.setattr(store, "load", lambda _path: None)
                    patch.setattr(library, "find", lambda _symbol: None)
                    return sought(kernel, kinds)
            return sought(kernel, kinds)

        def look(waiting):
            left[id(waiting)] = left.get(id(waiting), looks) - 1
            return left[id(waiting)] < 0 and there(waiting)

        for kernel in [own for own in gc.get_objects() if type(own) is Kernel]:
            monkeypatch.setattr(kernel, "_known", {})
            monkeypatch.setattr(kernel, "is_quick", False)
        monkeypatch.setattr(beside, "PAUSE", 0.0)
        monkeypatch.setattr(compile, "PAUSE", 0.0)
        monkeypatch.setattr(compile, "waits", lambda: False)
        monkeypatch.setattr(beside, "waits", lambda: False)
        monkeypatch.setattr(Kernel, "_sought", seek)
        monkeypatch.setattr(beside.Waiting, "is_there", look)

    def gone_over(self) -> list[Kernel]:
        return [own for own in self.seen if any(isinstance(found, Code) for found in own._known.values())]


@pytest.mark.parametrize("looks", [0, 4, 9])
def test_a_batch_that_goes_over_on_its_way_gives_the_same(monkeypatch, looks) -> None:
    plain = run_batch(a_minute("town"), trials=TRIALS, seed=5, batch=4)
    switches = Switches(monkeypatch, looks)
    mixed = run_batch(a_minute("town"), trials=TRIALS, seed=5, batch=4)
    assert mixed.sheet.asdict() == plain.sheet.asdict()
    assert [own.ending for own in mixed.outcomes] == [own.ending for own in plain.outcomes]
    assert run_trials in switches.gone_over()


@pytest.mark.parametrize("looks", [3, 400])
@pytest.mark.parametrize("controller", ["lanes", "rules+shield"])
def test_a_trial_that_goes_over_on_its_way_records_the_same(monkeypatch, tmp_path: Path, controller, looks) -> None:
    instance = draw(a_minute("town"), 2, 1)
    run_trial(instance, controller, record=tmp_path / "plain.mcap")
    switches = Switches(monkeypatch, looks)
    run_trial(instance, controller, record=tmp_path / "mixed.mcap")
    assert (tmp_path / "mixed.mcap").read_bytes() == (tmp_path / "plain.mcap").read_bytes()
    assert len(switches.gone_over()) >= 5
