"""`dubins-traffic warm`: what it asks for, that it ends when all is there, and Ctrl-C."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dubins_traffic.checkup.precompile import precompile
from dubins_traffic.errors import InputError
from dubins_traffic.kernels import asking

WARM = [sys.executable, "-m", "dubins_traffic.cli", "warm"]


@pytest.fixture
def asked(monkeypatch) -> list[str]:
    """Let nothing be compiled and nothing be found; returns the names of what is asked for."""
    names: list[str] = []

    def ask(waiting: asking.Waiting) -> None:
        names.append(f"{waiting.wish.module.removeprefix('dubins_traffic.')}.{waiting.wish.name}")
        waiting.failure = "not here"

    monkeypatch.setattr(asking, "wanted", [])
    monkeypatch.setattr(asking.Waiting, "_ask", ask)
    monkeypatch.setattr(asking.store, "load", lambda _path: None)
    for kernel in [own for own in _kernels() if own._known]:
        monkeypatch.setattr(kernel, "_known", {})
    return names


def _kernels():
    import gc

    from dubins_traffic.kernels.compile import Kernel

    return [own for own in gc.get_objects() if type(own) is Kernel]


def test_what_runs_and_batches_need_is_asked_for_once(asked) -> None:
    heard: list[tuple[int, int]] = []
    failed = precompile(progress=lambda done, whole: heard.append((done, whole)))
    assert len(asked) == len(set(asked)) == len(failed)
    assert heard == [(len(asked), len(asked))]
    assert {
        "agents.kernel.decide",
        "engine.batch_kernel.run_trials",
        "cars.motion.step",
        "policies.lanes.policy.decide",
        "policies.rules.policy.decide",
        "shield.nearest_command.shield",
        "scoring.margins.find_margins",
        "rules.frame.label_frame",
        "rules.referee_kernel.judge_frames",
    } <= set(asked)
    assert not any(name.startswith("synthesis.") for name in asked)


def test_all_is_more(asked) -> None:
    precompile(everything=True)
    assert {
        "cars.sensing.scan",
        "cars.sensing.blur",
        "logic.kernel.advance",
        "synthesis.fixpoint.reach",
    } <= set(asked)


def test_where_kernels_are_never_compiled_it_is_refused(monkeypatch) -> None:
    monkeypatch.setenv("DUBINS_TRAFFIC_KERNELS", "interpreted")
    with pytest.raises(InputError, match="never compiled"):
        precompile()


def test_ctrl_c_withdraws_what_is_asked_for(tmp_path: Path) -> None:
    around = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), "DUBINS_TRAFFIC_KERNELS": "auto"}
    process = subprocess.Popen(WARM, env=around, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    with process:
        try:
            while len(list(tmp_path.glob("*/asked-*/*.json"))) < 2:
                assert process.poll() is None
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=600)[1]
        finally:
            process.kill()
    assert process.returncode == 1
    assert "Traceback" not in said
    assert not list(tmp_path.glob("*/asked-*/*.json"))
