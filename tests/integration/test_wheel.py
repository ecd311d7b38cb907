"""Wheels: for every machine, or with machine code for those that it is for."""

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

ROOT = Path(__file__).parents[2]


def test_a_wheel_holds_machine_code_and_says_for_which_machines(tmp_path: Path) -> None:
    for machine in (False, True):  # in turn: both are built in this tree
        (tmp_path / str(machine)).mkdir()
        holds_what_it_says(tmp_path / str(machine), machine=machine)


def holds_what_it_says(tmp_path: Path, *, machine: bool) -> None:
    around = {name: own for name, own in os.environ.items() if name != "PYTHONPATH"}
    if machine:
        (tmp_path / "machine").mkdir()
        for name in ("x86-64-v2.json", "x86-64-v2-1.so"):
            (tmp_path / "machine" / name).write_text(name)
        around["DUBINS_TRAFFIC_MACHINE"] = str(tmp_path / "machine")
    words = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path / "dist"), str(ROOT)]
    subprocess.run(words, env=around, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").iterdir()
    assert wheel.name.endswith("-py3-none-manylinux_2_17_x86_64.whl" if machine else "-py3-none-any.whl")
    held = {name for name in ZipFile(wheel).namelist() if name.startswith("dubins_traffic/machine/")}
    assert held == {f"dubins_traffic/machine/x86-64-v2{end}" for end in (".json", "-1.so") if machine}
    norm = ZipFile(wheel).read("dubins_traffic/rules/rules.md")
    assert norm == (ROOT / "docs" / "rules.md").read_bytes(), "`explain` prints it"
    (metadata,) = (name for name in ZipFile(wheel).namelist() if name.endswith("/METADATA"))
    plain = [
        line for line in ZipFile(wheel).read(metadata).decode().splitlines()
        if line.startswith("Requires-Dist:") and "extra ==" not in line
    ]  # fmt: skip
    assert not [line for line in plain if "numba" in line or "llvmlite" in line]
