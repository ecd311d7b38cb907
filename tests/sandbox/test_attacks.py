"""Attacks on boxes: all stopped, as root and as an ordinary user, and not all once a layer is taken away."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

import dubins_traffic
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.sandbox import Layers, available_layers, boxed_controller
from dubins_traffic.sandbox.attacks import ATTACKS, Attack
from dubins_traffic.sandbox.launch import staged
from dubins_traffic.sandbox.layers import BOX, CLOCK, FILES, MEMORY, NAMES, PROCESSES, SECCOMP
from dubins_traffic.sandbox.submission import interpreter
from dubins_traffic.sandbox.suite import Baits, strike, strikes
from tests.boxes import needs_boxes

pytestmark = pytest.mark.tools

USER = 65533
as_root = pytest.mark.skipif(os.getuid() != 0, reason="only root becomes another user")


@needs_boxes
def test_all_attacks_are_stopped() -> None:
    assert len(ATTACKS) >= 60
    assert len({attack.name for attack in ATTACKS}) == len(ATTACKS)
    through = [f"{found.attack.name}: {found.words}" for found in strikes(available_layers()) if not found.stopped]
    assert through == []


@needs_boxes
@as_root
def test_all_attacks_are_stopped_as_an_ordinary_user() -> None:
    done = as_user(USER, ["-m", "dubins_traffic.cli", "sandbox", "check", "--json"])
    assert done.stdout, done.stderr
    found = json.loads(done.stdout)
    assert found["user"] == USER
    assert found["missing"] == []
    assert "cgroup" not in found["limits"]["memory"]
    assert [each for each in found["attacks"] if not each["stopped"]] == []
    assert len(found["attacks"]) == len(ATTACKS)
    assert done.returncode == 0, done.stderr


@needs_boxes
@as_root
def test_a_controller_drives_in_a_box_of_an_ordinary_user_as_in_process(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["run", "demo", "--controller", "simple", "--trials", "2", "--json"]
    done = as_user(USER, ["-m", "dubins_traffic.cli", *words, "--sandbox"])
    assert done.returncode == 0, done.stderr
    assert main(words) == 0
    here = json.loads(capsys.readouterr().out)["trials"]
    for trial, own in zip(json.loads(done.stdout)["trials"], here, strict=True):
        assert trial["controller"] == "simple+sandbox"
        assert (trial["goals"], trial["distance_m"]) == (own["goals"], own["distance_m"])


@needs_boxes
@pytest.mark.parametrize("attack", [each for each in ATTACKS if each.alone], ids=lambda own: own.name)
def test_an_attack_gets_through_once_its_layers_are_taken_away(attack: Attack) -> None:
    """So the suite notices when a layer is gone: what stops an attack is what is said to stop it."""
    gone = set(attack.layers) | (set(BOX) if FILES in attack.layers else set())
    if FILES in gone and SECCOMP in available_layers():
        gone.add(SECCOMP)  # bubblewrap is what puts the filter in force
    with Baits() as baits:
        found = strike(attack, available_layers().without(*gone), baits)
    assert not found.stopped, found.words


@needs_boxes
@pytest.mark.parametrize("layer", sorted(set(NAMES) - {"users", CLOCK, MEMORY, PROCESSES}))
def test_the_suite_fails_without_a_layer(layer: str) -> None:
    """Of `users`, `memory` and `processes` another layer does the same, and of `clock` the clocks of processes."""
    gone = BOX if layer == FILES else (layer,)
    sole = [each for each in ATTACKS if each.alone and each.layers == (layer,)]
    assert sole
    assert any(not found.stopped for found in strikes(available_layers().without(*gone), sole[:4]))


@needs_boxes
def test_what_no_cgroup_enforces_other_layers_do() -> None:
    bare = available_layers().without(MEMORY, PROCESSES, CLOCK)
    names = ("memory", "processes", "threads", "processor time")
    attacks = [each for each in ATTACKS if each.name.startswith(names)]
    assert len(attacks) >= 13
    assert [found.attack.name for found in strikes(bare, attacks) if not found.stopped] == []


HONEST = """
import asyncio, fcntl, multiprocessing
async def wait():
    await asyncio.sleep(0)
    return (await asyncio.create_subprocess_exec('true')).pid
here, there = multiprocessing.Pipe()
here.send('a message'); said = there.recv()
fcntl.fcntl(0, fcntl.F_SETFD, fcntl.FD_CLOEXEC)
got = [asyncio.run(wait()) > 0, said, subprocess.run(['true']).returncode]
"""


@needs_boxes
def test_what_no_cgroup_counts_honest_programs_may_use() -> None:
    """Pipes and pairs of sockets are counted, not forbidden: loops of asyncio begin with some."""
    bare = available_layers().without(MEMORY, PROCESSES, CLOCK)
    with Baits() as baits:
        found = strike(Attack("honest", (), HONEST), bare, baits)
    assert not found.stopped, found.words
    assert found.words == "[True, 'a message', 0]"


def test_a_machine_that_can_not_hold_a_program_refuses_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the kernel forbids namespaces, this is what is said; here bubblewrap is made not to be found."""
    monkeypatch.setenv("PATH", "/nowhere")
    available_layers.cache_clear()
    try:
        layers = available_layers()
        assert layers.missing() == ["bubblewrap makes no boxes here: it is not installed"]
        with pytest.raises(InputError, match="makes no boxes here"):
            boxed_controller("simple")
        assert main(["sandbox", "check", "--no-attacks"]) == 2
        assert main(["run", "demo", "--controller", "simple", "--sandbox", "--trials", "1"]) == 2
        assert "--trust-submissions" in capsys.readouterr().err
        monkeypatch.undo()
        words = ["run", "demo", "--controller", "simple", "--sandbox", "--trials", "1", "--json"]
        assert main([*words, "--trust-submissions"]) == 0
        assert json.loads(capsys.readouterr().out)["trials"][0]["end"] == "duration"
    finally:
        available_layers.cache_clear()


@needs_boxes
@as_root
def test_a_kernel_that_forbids_namespaces_is_told_of_in_one_line() -> None:
    """In a user namespace of its own, of which the kernel forbids more."""
    check = shlex.join([sys.executable, "-m", "dubins_traffic.cli", "sandbox", "check"])
    forbid = "echo 0 >/proc/sys/user/max_user_namespaces"
    done = subprocess.run(
        ["unshare", "--user", "--map-root-user", "--", "/bin/sh", "-c", f"{forbid} && exec {check}"],
        env={**os.environ, "PYTHONPATH": str(Path(dubins_traffic.__file__).parents[1])},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("dubins-traffic: --sandbox: bubblewrap makes no boxes here: ")
    assert "--trust-submissions" in line


def test_where_no_box_can_be_made_strangers_are_refused() -> None:
    if not available_layers().missing():
        boxed_controller("simple").close()
        return
    with pytest.raises(InputError):
        boxed_controller("simple")


def test_layers_are_named() -> None:
    assert Layers().without(SECCOMP).missing() == ["no filter of system calls: libseccomp2 and pyseccomp are needed"]
    assert {name for attack in ATTACKS for name in attack.layers} <= set(NAMES)


@contextmanager
def open_folder() -> Generator[Path]:
    """Yield a folder that every user can read, as those of pytest are not."""
    with tempfile.TemporaryDirectory() as name:
        Path(name).chmod(0o755)
        yield Path(name)


def as_user(user: int, words: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Run this interpreter as another user, who sees it and its packages in places that all can read."""
    with open_folder() as folder:
        return _as_user(user, words, folder)


def _as_user(user: int, words: Sequence[str], folder: Path) -> subprocess.CompletedProcess[str]:
    name, shown, paths = interpreter()
    places, steps = staged(shown)
    where = {Path(own.place): Path(there.source) for own, there in zip(shown, places, strict=True)}

    def seen(place: str) -> str:
        for inside, there in where.items():
            if Path(place).is_relative_to(inside):
                return str(there / Path(place).relative_to(inside))
        return place

    (folder / "dubins_traffic").symlink_to(seen("/own/dubins_traffic"))
    folders = [str(folder), *(seen(path) for path in paths if path != "/own")]
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": ":".join(folders),
        "LD_LIBRARY_PATH": str(Path(seen(name)).parents[1] / "lib"),
        "HOME": "/tmp",
        "DUBINS_TRAFFIC_KERNELS": "interpreted",
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    drop = f"exec setpriv --reuid={user} --regid={user} --clear-groups --bounding-set=-all --"
    command = shlex.join([seen(name), *words])
    script = "\n".join(["set -e", *steps, f"{drop} {command}"])
    return subprocess.run(
        ["unshare", "--mount", "--propagation", "private", "--", "/bin/sh", "-c", script],
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        cwd="/",
        stdin=subprocess.DEVNULL,
    )
