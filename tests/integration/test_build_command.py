"""`dubins-traffic build`: which kernels it compiles, that it ends when all is there, and Ctrl-C."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.compiling import beside, building, linking, store
from dubins_traffic.compiling.building import build, entries
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.kernels.compile import Entry
from dubins_traffic.kernels.kinds import REAL
from dubins_traffic.kernels.trig import sincos

BUILD = [sys.executable, "-m", "dubins_traffic.cli", "build"]


@pytest.fixture
def one(monkeypatch, tmp_path) -> Path:
    """Let there be one kernel; returns the folder of compiled ones."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(building, "entries", lambda: [Entry(sincos, (REAL,))])
    store.cache_folder.cache_clear()
    yield tmp_path / "cache"
    beside.end()
    store.cache_folder.cache_clear()


def test_all_that_trials_batches_games_and_environments_call_is_built() -> None:
    names = [f"{own.kernel.__module__}.{own.kernel.__name__}".partition(".")[2] for own in entries()]
    assert {
        "agents.kernel.decide",
        "engine.batch_kernel.run_trials",
        "cars.motion.step",
        "cars.motion.step_part",
        "cars.sensing.scan",
        "cars.sensing.blur",
        "policies.lanes.policy.decide",
        "policies.lanes.policy.decide_in",
        "policies.rules.policy.decide",
        "shield.nearest_command.shield",
        "scoring.margins.find_margins",
        "rules.frame.label_frame",
        "rules.referee_kernel.judge_frames",
        "logic.kernel.advance",
        "synthesis.fixpoint.reach",
        "envs.step_kernel.begin_trials",
        "envs.step_kernel.step_trials",
        "envs.step_kernel.observe_trials",
        "envs.crew_kernel.step_crews",
        "animation.raster_kernel.paint",
    } <= set(names)


def test_a_library_is_built_and_told_of(one, capsys) -> None:
    assert main(["build"]) == 0
    (library,) = (one / "library").glob("*.so")
    assert capsys.readouterr().err == f"1 kernels in {library}\n"
    assert main(["warm", "--all"]) == 0
    assert "warm is deprecated: dubins-traffic build has taken its place" in capsys.readouterr().err


def test_without_a_linker_kernels_stay_in_files_of_their_own(one, monkeypatch, capsys) -> None:
    def none() -> list[str]:
        raise InputError("no linker", file="CC")

    monkeypatch.setattr(linking, "linker", none)
    assert main(["build"]) == 0
    assert "each in a file of its own: CC: no linker" in capsys.readouterr().err
    assert len(list(one.rglob("*.kernel"))) == 1
    assert main(["build", "--folder", str(one / "there")]) == 2


def test_a_folder_that_others_can_write_is_refused(one, tmp_path, capsys) -> None:
    one.mkdir()
    tmp_path.chmod(0o777)
    assert main(["build"]) == 2
    assert "can't hold a library" in capsys.readouterr().err
    tmp_path.chmod(0o700)


def test_another_level_is_refused_by_name(capsys) -> None:
    assert main(["build", "--level", "pentium"]) == 2
    assert "--level: no such level: got 'pentium'; expected x86-64-v2" in capsys.readouterr().err


def test_where_kernels_are_never_compiled_it_is_refused(monkeypatch) -> None:
    monkeypatch.setenv("DUBINS_TRAFFIC_KERNELS", "interpreted")
    with pytest.raises(InputError, match="never compiled"):
        build()


def test_without_the_extra_it_is_named(monkeypatch) -> None:
    monkeypatch.setattr(beside, "can_build", lambda: False)
    with pytest.raises(MissingExtraError, match="'compile'"):
        build()


def test_ctrl_c_ends_the_builder(tmp_path: Path) -> None:
    around = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "DUBINS_TRAFFIC_KERNELS": "auto"}
    process = subprocess.Popen(BUILD, env=around, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    with process:
        try:
            while not list(tmp_path.rglob("*.kernel")):
                assert process.poll() is None
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=600)[1]
        finally:
            process.kill()
    assert process.returncode == 1
    assert "Traceback" not in said
    assert not list(tmp_path.rglob("*.so"))
