"""What is said of trials that are too short for `satisfied`, before they run, and how a gap is put into words."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubins_traffic.cli.long_enough import is_too_short, least_duration, short_notice
from dubins_traffic.cli.main import main
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.routing.rounds import round_time
from dubins_traffic.suites.suite import load_suite, shipped_suites


def document(seconds: float, **more: object) -> dict[str, object]:
    """Return a configuration of two goals at the ends of a road of three segments, driven once to and fro in 40 s."""
    return {
        "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 1, "columns": 4}},
        "goals": [[0, 0], [3, 0]], "ego": {"start": [1.5, -0.3, 0.0]}, "duration": seconds, "rules": True,
        "car": {"bounds": {"speed": 0.45}}, **more,
    }  # fmt: skip


def test_two_free_flow_rounds_are_long_enough() -> None:
    instance = draw(load_config(document(60.0)))
    problem = instance.problem
    once = round_time(problem.network, problem.goal_vertices, 0.45)
    assert least_duration(instance) == 2.0 * once == pytest.approx(2 * 18.0 / 0.45)
    assert not is_too_short(draw(load_config(document(80.1))))
    assert is_too_short(draw(load_config(document(79.9))))
    assert not is_too_short(draw(load_config(document(5.0, rules=None))))
    assert not is_too_short(draw(load_config(document(5.0, goals=[]))))


def test_the_notice_is_one_line_and_only_where_a_trial_is_too_short() -> None:
    short, long = (draw(load_config(document(seconds))) for seconds in (30.0, 100.0))
    assert short_notice([lambda: long]) == short_notice([]) == ""
    need = "lasts 30 s, and a car that meets nobody takes 80 s for two rounds through all goals"
    assert short_notice([lambda: short]) == f"the trial is too short for the verdict `satisfied`: it {need}"
    told = short_notice([lambda: short, lambda: long])
    assert told == f"1 of 2 trials looked at are too short for the verdict `satisfied`: one {need}"


@pytest.mark.parametrize("command", ["run", "batch", "campaign"])
def test_commands_say_it_before_trials_run(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "own.json"
    own.write_text(json.dumps(document(2.0)))
    arguments = [command, str(own), "--controller", "rules", "--trials", "2"]
    if command == "campaign":
        plan = tmp_path / "plan.toml"
        plan.write_text('version = 0\ncontrollers = ["rules"]\nconfigurations = ["own.json"]\n')
        arguments = ["campaign", "run", str(plan), "-o", str(tmp_path / "out"), "--workers", "1"]
    assert main(arguments) == 0
    assert capsys.readouterr().err.count("too short for the verdict `satisfied`") == 1
    if command != "campaign":
        assert main([*arguments, "--json"]) == 0
        told = capsys.readouterr()
        assert "too short" not in told.err
        assert "trials" in json.loads(told.out)


def test_check_puts_the_gap_into_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "own.json"
    own.write_text(json.dumps(document(2.0)))
    assert main(["run", str(own), "--trials", "1", "--records", str(tmp_path / "out")]) == 0
    capsys.readouterr()
    assert main(["check", str(tmp_path / "out" / "trial-0000.mcap")]) == 0
    sentence = (
        "the longest time without a visit of some goal was 2.0 s, and `satisfied` allows 1.0 s; "
        "some goal was not visited twice after the start"
    )
    assert sentence in capsys.readouterr().out


@pytest.mark.parametrize("name", ["junction", "suburb", "town", "wanderers"])
def test_shipped_configurations_are_long_enough(name: str) -> None:
    configuration = load_config(name)
    assert short_notice([lambda k=k: draw(configuration, 0, k) for k in range(16)]) == ""
    assert configuration.settings.goal_segments_apart == 2


def test_ranked_suites_are_long_enough() -> None:
    for name in shipped_suites():
        suite = load_suite(name)
        if suite.model.campaign is not None:
            assert short_notice(suite.campaign(["simple"]).first_trials()) == "", name
