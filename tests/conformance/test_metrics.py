"""The suite of every metric: the registered ones, one from a file outside, and one that sees all there is to see."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.campaign.results import load_results
from dubins_traffic.campaign.run_campaign import run_campaign
from dubins_traffic.cars.state import Frames
from dubins_traffic.cli.main import main
from dubins_traffic.controllers.simple import Simple
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.errors import InputError
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring import registry
from dubins_traffic.scoring.blocks import cut
from dubins_traffic.scoring.metric import Measured
from dubins_traffic.scoring.score import Scorer, score
from tests.property.test_batch import SEED, configuration, plain

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "extending" / "my_metric.py"
METRICS: tuple[str, ...] = (
    *registry.names(),
    f"{EXAMPLE}:Turning",
    f"{ROOT / 'tests' / 'witness.py'}:Witness",
)
CASES: dict[str, dict[str, Any]] = {
    "judged": {},
    "to collision": {"rules": False, "end_on_collision": True},
    "disturbed": {"disturbances": {"command_delay": 2, "command_loss": 0.2, "position_noise": 0.01}},
    "obstacle at an odd rate": {"rate": 12.5, "obstacles": [{"disc": {"x": 4.0, "y": 0.3, "radius": 0.2}}]},
    "alone": {"e-agents": []},
}


class Quits(Simple):
    """Gives up in some trials, raises in others, and reports something now and then."""

    def start(self, problem: Any) -> None:
        super().start(problem)
        self._tick, self._goals = 0, len(problem.goals)

    def act(self, observation: Any) -> Any:
        self._tick = observation.tick
        if observation.tick == 29 and self._goals == 1:
            return None
        if observation.tick == 31 and self._goals == 2:
            raise ValueError("two goals are too many")
        return super().act(observation)

    def report(self) -> Sequence[tuple[str, str]]:
        return [("remark", f"tick {self._tick}")] if self._tick % 30 in (0, 29) else []


@pytest.fixture(params=METRICS, ids=lambda spec: str(spec).rpartition("/")[2])
def spec(request: pytest.FixtureRequest) -> str:
    return request.param


def test_it_says_what_it_tells(spec: str) -> None:
    maker = registry.load(spec)
    assert (maker.__doc__ or "").strip()
    columns = registry.columns([spec])
    assert len({column.name for column in columns}) == len(columns)
    for column in columns:
        assert column.label
        assert column.better in (-1, 0, 1)
        assert "\n" not in column.label + column.unit + column.meaning
        assert column.meaning or spec not in registry.names()


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("controller", ["rules", "lanes", "lanes+shield", Quits])
def test_in_a_run_a_batch_and_a_record_it_tells_the_same(
    controller: str | Callable[[], Any], case: str, tmp_path: Path
) -> None:
    """All metrics at once, those with a compiled form, too; trials of several lengths end at several ticks."""
    drawn = configuration(**CASES[case], number_trials=3, duration_bounds=[1, 4])
    together = run_batch(drawn, controller, trials=3, seed=SEED, batch=2, metrics=METRICS)
    for trial, outcome in enumerate(together.outcomes):
        instance, record = draw(drawn, SEED, trial), tmp_path / f"{trial}.mcap"
        driver = controller if isinstance(controller, str) else controller()
        alone = run_trial(instance, driver, record=record, metrics=METRICS).score
        assert outcome.score.metrics == alone.metrics
        assert plain(outcome.score) == plain(alone)
        assert score(read(record), METRICS).metrics == alone.metrics


def test_threads_and_the_size_of_a_batch_change_nothing() -> None:
    drawn = configuration(number_trials=5, duration_bounds=[1, 3])
    one = run_batch(drawn, trials=5, seed=SEED, batch=1, metrics=METRICS)
    other = run_batch(drawn, trials=5, seed=SEED, batch=3, threads=2, metrics=METRICS)
    assert [plain(own.score) for own in one.outcomes] == [plain(own.score) for own in other.outcomes]
    assert len({own.score.metrics for own in one.outcomes}) == 5


def test_how_the_frames_are_cut_changes_nothing(spec: str, tmp_path: Path) -> None:
    instance = draw(configuration(duration_bounds=[3, 3]), SEED, 0)
    expected = run_trial(instance, "lanes", record=tmp_path / "a.mcap", metrics=[spec]).score.metrics
    record = read(tmp_path / "a.mcap")
    chance = np.random.default_rng(1)
    for pieces in (1, 2, 7, 40, len(record.frames)):
        assert _scored(record, spec, _cuts(record.frames, pieces, chance)) == expected


def test_a_record_that_was_cut_off_is_scored_up_to_its_end(spec: str, tmp_path: Path) -> None:
    instance = draw(configuration(duration_bounds=[3, 3]), SEED, 0)
    run_trial(instance, "lanes", record=tmp_path / "a.mcap")
    record = read(tmp_path / "a.mcap")
    for count in (1, 29, 30, 31):
        scorer = Scorer([spec])
        scorer.begin(instance)
        scorer.frames(cut(record.frames, 0, count))
        found = scorer.result().metrics
        assert [own.column for own in found] == list(registry.columns([spec]))
        json.dumps([own.value for own in found], allow_nan=False)


def test_values_stand_in_json_tables_and_rows_of_every_command(
    spec: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    document = configuration(number_trials=2, duration_bounds=[1, 2]).to_document()
    Path("small.json").write_text(json.dumps(document))
    chosen = ["--metric", spec]
    whole: list[Any] = []
    for words in (
        ["run", "small.json", "--controller", "rules", "--records", "out"],
        ["batch", "small.json"],
        ["score", "out/trial-0000.mcap", "out/trial-0001.mcap"],
    ):
        assert main([*words, *chosen, "--json"]) == 0
        whole.append([own["metrics"] for own in json.loads(capsys.readouterr().out)["trials"]])
    assert whole[0] == whole[1] == whole[2]
    assert main(["score", "out/trial-0000.mcap", *chosen]) == 0
    shown = "".join(capsys.readouterr().out.split())
    first = registry.columns([spec])[0]
    assert all(word in shown for word in (first.short or first.label).split())


def test_a_campaign_tells_them_in_its_table_and_report(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    own = tmp_path / "mine.py"
    own.write_text(EXAMPLE.read_text())
    document = configuration(number_trials=2, duration_bounds=[1, 2]).to_document()
    (tmp_path / "small.json").write_text(json.dumps(document))
    witness = METRICS[-1]
    (tmp_path / "c.toml").write_text(
        'version = 0\ncontrollers = ["rules", "simple"]\nconfigurations = ["small.json"]\n'
        f'metrics = ["time_to_collision", "mine.py:Turning", {json.dumps(witness)}]\n'
    )
    ran = run_campaign(tmp_path / "c.toml", tmp_path / "c", workers=1)
    table = load_results(tmp_path / "c").table
    specs = ["time_to_collision", f"{own}:Turning", witness]
    names = [column.name for column in registry.columns(specs)]
    assert table.schema.names[-len(names) :] == names
    for row in table.to_pylist():
        cell = ran.campaign.cells[row["cell"]]
        instance = draw(cell.settled, cell.seed, row["trial"])
        expected = run_trial(instance, row["controller"], metrics=specs).score.metrics
        assert [row[name] for name in names] == [own.value for own in expected]
    assert main(["campaign", "report", str(tmp_path / "c"), "--worst", "0"]) == 0
    page = next((tmp_path / "c").rglob("*.html")).read_text()
    assert "sideways, largest" in page
    assert "hash of all that was seen" not in page
    own.write_text(EXAMPLE.read_text() + "\n# another one\n")
    with pytest.raises(InputError, match=r"metrics\[1\]"):
        run_campaign(tmp_path / "c.toml", tmp_path / "c", workers=1, resume=True)
    own.unlink()
    assert main(["campaign", "report", str(tmp_path / "c"), "--worst", "0"]) == 0


BODY = """
import dubins_traffic as dt

class M:
    columns = (dt.Column("own", "own"),)
    def begin(self, instance): {begin}
    def frames(self, frames): {frames}
    def end(self, ending): {end}
    def result(self): {result}
"""
GOOD = {"begin": "pass", "frames": "pass", "end": "pass", "result": "return {'own': 1.0}"}


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("class M: pass", "lacks the method begin"),
        (BODY.format(**GOOD).replace("columns =", "others ="), "has no columns"),
        (BODY.format(**GOOD).replace('"own", "own"', '"own", "own", kind="float16"'), "kind float16"),
        (BODY.format(**{**GOOD, "begin": "1 / 0"}), "raised ZeroDivisionError.* in begin"),
        (BODY.format(**{**GOOD, "frames": "1 / 0"}), "raised ZeroDivisionError.* in frames"),
        (BODY.format(**{**GOOD, "frames": "frames.x[0] = 1.0"}), "read-only"),
        (BODY.format(**{**GOOD, "end": "1 / 0"}), "raised ZeroDivisionError.* in end"),
        (BODY.format(**{**GOOD, "result": "return {}"}), "other values than its columns"),
        (BODY.format(**{**GOOD, "result": "return 7"}), "other values than its columns"),
        (BODY.format(**{**GOOD, "result": "return {'own': 'much'}"}), "returns no float64 for own"),
        (BODY.format(**{**GOOD, "result": "return {'own': float('nan')}"}), "returns no float64 for own"),
        (BODY.format(**{**GOOD, "result": "return {'own': True}"}), "returns no float64 for own"),
    ],
)
def test_what_is_no_metric_is_refused_by_its_name(code: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text(code)
    instance = draw(configuration(duration_bounds=[2, 2]), SEED, 0)
    with pytest.raises(InputError, match=rf"M .*{words}|{words}"):
        run_trial(instance, "simple", metrics=[f"{tmp_path / 'bad.py'}:M"])


def test_two_columns_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="name is taken: min_time_to_collision_s"):
        run_batch("demo", metrics=["time_to_collision", "time_to_collision"])
    with pytest.raises(InputError, match="unknown metric"):
        run_batch("demo", metrics=["time_to_colision"])
    (tmp_path / "mine.py").write_text(BODY.format(**GOOD).replace('"own", "own"', '"rounds", "own"'))
    (tmp_path / "c.toml").write_text(
        'version = 0\ncontrollers = ["rules"]\nconfigurations = ["demo"]\nmetrics = ["mine.py:M"]\n'
    )
    with pytest.raises(InputError, match=r"metrics\[0\]: M has a column whose name is taken: rounds"):
        run_campaign(tmp_path / "c.toml", tmp_path / "c")


def _cuts(frames: Frames, pieces: int, chance: np.random.Generator) -> list[Frames]:
    places = sorted({0, len(frames), *chance.integers(0, len(frames), pieces - 1).tolist()})
    return [cut(frames, begin, end) for begin, end in pairwise(places)]


def _scored(record: Any, spec: str, blocks: Sequence[Frames]) -> tuple[Measured, ...]:
    scorer = Scorer([spec])
    scorer.begin(record.instance)
    for block in blocks:
        scorer.frames(block)
    scorer.end(record.ending)
    return scorer.result().metrics
