"""The suite of every kind of e-agent: those of the table, one from a file outside, and one that is registered here.

A new kind of the table joins by itself.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.agents.kinds import DOES, PACKS, Lists
from dubins_traffic.agents.script import script_rows
from dubins_traffic.agents.tables import Agent
from dubins_traffic.campaign.results import load_results
from dubins_traffic.campaign.run_campaign import run_campaign
from dubins_traffic.cli.main import main
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.errors import InputError
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.faults import Strict
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import KINDS, REMOTE
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.scoring.score import score
from dubins_traffic.verification.verify import verify
from tests.property.test_batch import SEED, configuration, plain

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "extending" / "my_e_agent.py"
OUTSIDE = f"{EXAMPLE}:Patrol"
REGISTERED = "shuttle"
TYPES = [*(kind for kind in KINDS if kind != REMOTE), OUTSIDE, REGISTERED]
NEEDED: Mapping[str, dict[str, Any]] = {"scripted": {"commands": [[2.0, 0.4, 0.3]], "repeat": True}}
"""Parameters of kinds that have some without a default."""
TOGETHER = {"type": "wander", "name": "other"}


class Shuttle(Strict):
    """Drives to and fro on the spot."""

    leg: float = 0.5
    speed: float = 0.4


def pack_shuttle(instance: Instance, given: Mapping[str, Any], agent: Agent, lists: Lists) -> None:
    """Let a car play a script of two steps."""
    seconds, first = given["leg"] / given["speed"], len(lists.script)
    commands = [[seconds, given["speed"], 0.0], [seconds, -given["speed"], 0.0]]
    lists.script += script_rows(commands, instance.problem.rate)
    agent.does, agent.first, agent.last, agent.repeat = DOES.PLAYS, first, len(lists.script), 1


@pytest.fixture(params=TYPES, ids=lambda kind: str(kind).rpartition("/")[2])
def entries(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Return two e-agents of a kind, and one of another if they may be together."""
    if request.param == REGISTERED:
        monkeypatch.setitem(KINDS, REGISTERED, Shuttle)
        monkeypatch.setitem(PACKS, REGISTERED, pack_shuttle)
    own = {"type": request.param, "name": "own", "count": 2, "parameters": NEEDED.get(request.param, {})}
    return [own] if request.param == "counter" else [own, TOGETHER]


def test_alone_in_a_batch_and_from_a_record_it_does_the_same(entries: list[dict[str, Any]], tmp_path: Path) -> None:
    drawn = configuration(**{"e-agents": entries, "number_trials": 2, "duration_bounds": [2, 4]})
    together = run_batch(drawn, "rules", trials=2, seed=SEED)
    for trial, outcome in enumerate(together.outcomes):
        record = tmp_path / f"{trial}.mcap"
        alone = run_trial(draw(drawn, SEED, trial), "rules", record=record)
        again = run_trial(draw(drawn, SEED, trial), "rules", record=tmp_path / "again.mcap", overwrite=True)
        assert alone.ending.end in (End.DURATION, End.COLLISION)
        assert plain(outcome.score) == plain(alone.score) == plain(again.score) == plain(score(read(record)))
        assert record.read_bytes() == (tmp_path / "again.mcap").read_bytes()
        assert verify(record).verified


def test_a_fork_goes_on_as_its_trial(entries: list[dict[str, Any]]) -> None:
    drawn = configuration(**{"e-agents": entries, "duration_bounds": [2, 2]})
    with Trial(draw(drawn, SEED, 0)) as trial:
        for _ in range(25):
            trial.step((0.3, 0.1))
        with trial.fork() as twin:
            while trial.ending is None:
                assert trial.step((0.3, 0.1)) == twin.step((0.3, 0.1))
            assert trial.ending == twin.ending


def test_it_moves_and_leaves_the_ego_alone(entries: list[dict[str, Any]], tmp_path: Path) -> None:
    drawn = configuration(**{"e-agents": entries, "duration_bounds": [4, 4]})
    run_trial(draw(drawn, SEED, 0), "simple", record=tmp_path / "a.mcap")
    frames = read(tmp_path / "a.mcap").frames
    moved = abs(frames.x[-1] - frames.x[0]) + abs(frames.y[-1] - frames.y[0]) > 0.0
    assert moved[0]
    assert moved[1:].any() or entries[0]["type"] in ("parked", "counter")


def test_one_of_the_users_own_runs_in_every_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE, "my_e_agent.py")
    own = {"type": "my_e_agent:Patrol", "name": "patrol", "parameters": {"leg": 0.5}}
    document = configuration(**{"e-agents": [own, TOGETHER], "number_trials": 2, "duration_bounds": [2, 3]})
    Path("small.json").write_text(json.dumps(document.to_document()))
    assert main(["run", "small.json", "--controller", "rules", "--records", "out"]) == 0
    assert main(["batch", "small.json", "--keep", "all", "--records", "other"]) == 0
    for name in ("trial-0000.mcap", "trial-0001.mcap"):
        assert Path("out", name).read_bytes() == Path("other", name).read_bytes()
        assert main(["verify", f"out/{name}"]) == 0
    Path("c.toml").write_text('version = 0\ncontrollers = ["rules"]\nconfigurations = ["small.json"]\n')
    run_campaign("c.toml", "c", workers=1)
    assert load_results("c").table["end"].to_pylist() == ["duration", "duration"]


BODY = """
class A:
    parameters = dict(speed=0.3)
    def begin(self, instance, car, parameters): {begin}
    def act(self, observation): {act}
"""


@pytest.mark.parametrize(
    ("code", "given", "words"),
    [
        ("class A: pass", {}, "A is not a driver of an e-agent: it lacks the method begin"),
        (BODY.format(begin="1 / 0", act="return 0, 0"), {}, "own raised ZeroDivisionError.* in begin"),
        (BODY.format(begin="pass", act="return 0, 0"), {"sped": 1}, r"unknown parameter.*'sped'|sped.*speed"),
    ],
)
def test_what_is_no_driver_is_refused(code: str, given: dict[str, Any], words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words):
        _run(code, given, tmp_path)


def test_what_a_strangers_record_names_is_not_called_unless_it_is_a_driver() -> None:
    for spec, words in (("os:abort", "abort is not a class"), ("pathlib:Path", "lacks the method begin")):
        drawn = configuration(**{"e-agents": [{"type": spec, "name": "own"}], "duration_bounds": [1, 1]})
        with pytest.raises(InputError, match=words):
            run_trial(draw(drawn, SEED, 0), "simple")


@pytest.mark.parametrize("act", ["1 / 0", "return None", "return 1", "return float('nan'), 0.0", "return 'ab', 'cd'"])
def test_what_it_raises_ends_the_trial_as_its_fault_and_verifies(act: str, tmp_path: Path) -> None:
    ending, record = _run(BODY.format(begin="pass", act=act), {}, tmp_path)
    assert (ending.end, ending.ticks) == (End.AGENT_FAULT, 0)
    assert ending.detail == "own asked for a command that is not finite"
    told = [event.detail for event in read(record).frames.events if event.kind == "e-agent"]
    assert (len(told) == 1 and "own raised" in told[0]) == ("nan" not in act)
    assert verify(record).verified


def _run(code: str, given: dict[str, Any], tmp_path: Path) -> tuple[Any, Path]:
    (tmp_path / "bad.py").write_text(code)
    own = {"type": f"{tmp_path / 'bad.py'}:A", "name": "own", "parameters": given}
    instance = draw(configuration(**{"e-agents": [own], "duration_bounds": [1, 1]}), SEED, 0)
    return run_trial(instance, "simple", record=tmp_path / "a.mcap").ending, tmp_path / "a.mcap"
