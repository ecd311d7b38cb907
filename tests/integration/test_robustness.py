"""`dubins-traffic check-controller --robustness`: tables of short trials with disturbances."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubins_traffic.checkup import robustness
from dubins_traffic.cli.main import main

LATE = """
class Late:
    def start(self, problem):
        self.told = problem.command_delay

    def act(self, observation):
        return (0.0, 0.0) if self.told < 2 else (0.7, 0.0)
"""


def test_each_cell_has_the_same_trials_with_its_disturbances(tmp_path: Path) -> None:
    """A controller that stands unless it is told of two ticks, and then drives off the road."""
    (tmp_path / "late.py").write_text(LATE)
    told: list[tuple[int, int]] = []
    found = robustness.robustness(
        f"{tmp_path}/late.py:Late", trials=2, delays=(0, 2), noises=(0.0, 0.02), losses=(0.1,),
        progress=lambda done, whole: told.append((done, whole)),
    )  # fmt: skip
    assert [(own.delay, own.noise, own.loss, own.trials) for own in found.cells] == [
        (0, 0.0, 0.1, 2), (0, 0.02, 0.1, 2), (2, 0.0, 0.1, 2), (2, 0.02, 0.1, 2)
    ]  # fmt: skip
    assert [own.clean for own in found.cells] == [2, 2, 0, 0]
    assert told == [(n, 8) for n in range(1, 9)]
    assert found.cell(2, 0.02, 0.1) is found.cells[3]


def test_the_command_prints_a_table_for_each_share_of_lost_commands(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, values in (("DELAYS", (0, 3)), ("NOISES", (0.0, 0.01)), ("LOSSES", (0.0, 0.1))):
        monkeypatch.setattr(robustness, name, values)
    assert main(["check-controller", "rules", "--robustness"]) == 0
    printed = capsys.readouterr().out
    titles = [line.strip() for line in printed.splitlines() if "lost" in line]
    assert titles == ["0% of commands lost", "10% of commands lost"]
    assert printed.count("3/3") == 8
    assert main(["check-controller", "rules", "--robustness", "--json"]) == 0
    cells = json.loads(capsys.readouterr().out)["cells"]
    assert [(own["delay"], own["noise"], own["loss"]) for own in cells][-1] == (3, 0.01, 0.1)
    assert all(own["clean"] == own["trials"] == 3 and own["counted_rounds"] > 0 for own in cells)


def test_programs_over_a_transport_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check-controller", "./drive", "--over", "lcm", "--robustness"]) == 2
    assert "--robustness" in capsys.readouterr().err
