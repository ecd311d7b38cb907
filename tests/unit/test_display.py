"""What Python and notebooks show of values: a line, a picture that can do no harm, a figure, a data frame."""

from __future__ import annotations

import json
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

import dubins_traffic as dt
from dubins_traffic.campaign.results import rows_of
from dubins_traffic.campaign.rows import SCORES
from dubins_traffic.display import Pictured
from dubins_traffic.errors import InputError, MissingExtraError, in_python
from dubins_traffic.protocols import End, Ending
from dubins_traffic.scoring.score import ScoreSheet
from dubins_traffic.viewer import notebook
from dubins_traffic.viewer.notebook import ROWS, html_of, sheet_html
from dubins_traffic.viewer.paths import CARS, STEPS, Paths
from tests.synthetic import ROUGH, driven, instance, obstacles_beside, verdict

NASTY = '"><script>alert(1)</script><img src=x onerror=alert(2)>&\u2028'
DOCUMENT = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 2, "columns": 3}},
    "e-agents": [{"type": "wander", "name": "walker"}],
    "rules": True,
    "duration": 4.0,
    "number_trials": 3,
}


class Safe(HTMLParser):
    """Raises where HTML holds what could run, or load something from elsewhere."""

    def __init__(self) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag not in {
            "script",
            "img",
            "object",
            "image",
            "use",
            "a",
            "style",
            "link",
            "foreignobject",
        }
        self.tags.add(tag)
        if tag == "iframe":
            self.play(dict(attrs))
            return
        for name, value in attrs:
            assert not name.startswith("on")
            assert name not in {"href", "src", "xlink:href"}
            assert "url(" not in (value or "")

    def play(self, given: dict[str, str | None]) -> None:
        """A player may run its own scripts, in a box of its own, and loads nothing."""
        assert given.keys() == {"title", "sandbox", "style", "srcdoc"}
        assert given["sandbox"] == "allow-scripts"
        page = given["srcdoc"] or ""
        assert page.count("<script") == page.count("</script>") == 2
        assert "default-src 'none'" in page

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def read(text: str) -> Safe:
    found = Safe()
    found.feed(text)
    for picture in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ElementTree.fromstring(picture)  # well-formed
    return found


@pytest.fixture(scope="module")
def configuration(tmp_path_factory: pytest.TempPathFactory) -> dt.Configuration:
    path = tmp_path_factory.mktemp("display") / "small.json"
    path.write_text(json.dumps(DOCUMENT))
    return dt.load_config(path)


@pytest.fixture(scope="module")
def result(configuration: dt.Configuration, tmp_path_factory: pytest.TempPathFactory) -> dt.Result:
    record = tmp_path_factory.mktemp("record") / "trial.mcap"
    return dt.run_trial(dt.draw(configuration, 1, 0), "lanes", record=record)


@pytest.fixture(scope="module")
def record(result: dt.Result) -> dt.Record:
    assert result.record is not None
    return dt.load_record(result.record)


@pytest.fixture(scope="module")
def batch(configuration: dt.Configuration) -> dt.Batch:
    return dt.run_batch(configuration, "lanes", trials=3)


@pytest.fixture(scope="module")
def values(configuration: dt.Configuration, result: dt.Result, record: dt.Record, batch: dt.Batch) -> dict[str, Any]:
    own = result.instance
    found = [
        own.problem.network, own.problem, own, record, record.frames, result, result.score, result.score.verdict,
        batch, batch.outcomes[0], batch.sheet, configuration,
    ]  # fmt: skip
    return {type(value).__name__: value for value in found}


def test_every_value_is_told_in_a_line(values: dict[str, Any]) -> None:
    assert len(values) == 12
    for name, value in values.items():
        text = repr(value)
        assert text.startswith(f"<{name}")
        assert text.endswith(">")
        assert len(text) < 200, text
        assert "\n" not in text
    assert re.search(r"\d goals?", repr(values["Instance"]))
    assert "trial 0 of seed 1" in repr(values["Result"])
    assert "lanes" in repr(values["Score"])
    assert "3 trials" in repr(values["Batch"])
    assert len(repr([*values.values()])) < 2000


@pytest.mark.parametrize("name", ["RoadNetwork", "Problem", "Instance", "Record", "Result", "Batch", "ScoreSheet"])
def test_notebooks_get_a_picture(values: dict[str, Any], name: str) -> None:
    text = values[name]._repr_html_()
    found = read(text)
    assert {"svg", "title"} <= found.tags
    assert len(text) < 200_000
    assert text == values[name]._repr_html_()
    drawn = "polyline" in found.tags
    assert drawn == (name not in {"Batch", "ScoreSheet"})
    if name in {"Record", "Result", "Instance"}:
        assert {"ego", "walker"} <= set(found.words)
        assert "goal 1" in found.words


def test_other_peoples_names_do_no_harm() -> None:
    network = dt.RoadNetwork.grid(2, 3)
    tried, frames = driven(instance(network, 3, 2.0, names=(NASTY, "b"), obstacles=obstacles_beside(network)))
    record = dt.Record(tried, frames, (frames,), Ending(End.DURATION, 60), NASTY, {}, None, NASTY)
    score = replace(dt.score(record), verdict=verdict(tried, [(1.0, NASTY, "E4"), (1.5, "ego", NASTY)], 0))
    done = dt.Result(tried, NASTY, Ending(End.DURATION, 60), score, None, None, Paths.of(tried, frames))  # pyright: ignore[reportArgumentType]
    for value in (tried, record, done, ScoreSheet((score,)), tried.problem):
        read(value._repr_html_())
        assert NASTY not in value._repr_html_()


def test_every_pictured_value_has_a_picture(values: dict[str, Any]) -> None:
    pictured = [value for value in values.values() if isinstance(value, Pictured)]
    assert len(pictured) >= 5
    assert all(html_of(value).count("<svg") == 1 for value in pictured)
    with pytest.raises(TypeError, match="no picture of a int"):
        html_of(3)


def test_many_trials_are_cut_and_the_rest_is_counted(batch: dt.Batch) -> None:
    sheet = ScoreSheet(batch.sheet.trials * 10)
    text = sheet_html("Scores", sheet)
    assert text.count("<tr>") == 1 + ROWS
    assert f"and {30 - ROWS} more" in text


def test_a_network_without_goals_and_a_record_without_frames_have_pictures(record: dt.Record) -> None:
    bare = replace(record.instance.problem, goals=())
    assert "polyline" in read(bare._repr_html_()).tags
    cut = {name: getattr(record.frames, name)[:0] for name in ("x", "y", "c", "s")}
    read(replace(record, frames=replace(record.frames, **cut))._repr_html_())


def test_a_record_is_played_unless_it_is_long(record: dt.Record, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "iframe" in read(record._repr_html_()).tags
    monkeypatch.setattr(notebook, "PLAYED", 1000)
    assert "iframe" not in read(record._repr_html_()).tags
    assert "polyline" in read(record._repr_html_()).tags


def test_a_result_keeps_a_sketch_that_is_small_and_no_part_of_it(result: dt.Result) -> None:
    assert result.paths is not None
    lines = result.paths.lines()
    assert len(lines) == len(result.instance.names)
    assert (lines[0][0] == result.instance.starts[0][:2]).all()
    assert replace(result, paths=None) == result
    assert pickle.loads(pickle.dumps(result)) == result
    long, frames = driven(instance(ROUGH, CARS + 5, 40.0))
    own = Paths.of(long, frames)
    assert len(own.lines()) == CARS
    assert len(own.lines()[0]) <= 2 * STEPS + 1
    assert len(own.last) == CARS + 5
    assert own.lines()[1][-1].tolist() == [frames.x[-1, 1], frames.y[-1, 1]]
    pieces = Paths()
    pieces.begin(long)
    for first in range(0, len(frames), 7):
        cut = slice(first, first + 7)
        part = {name: getattr(frames, name)[cut] for name in ("x", "y", "c", "s")}
        pieces.frames(replace(frames, first=first, **part))
    assert all((a == b).all() for a, b in zip(own.lines(), pieces.lines(), strict=True))
    assert Paths().lines() == []


@pytest.mark.parametrize("name", ["RoadNetwork", "Instance", "Record", "Result"])
def test_plot_returns_a_figure_that_nobody_else_knows(values: dict[str, Any], name: str) -> None:
    from matplotlib import pyplot
    from matplotlib.figure import Figure

    figure = dt.plot(values[name])
    assert isinstance(figure, Figure)
    assert len(figure.axes) == 1
    assert pyplot.get_fignums() == []
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_plot_needs_no_pyplot() -> None:
    code = "import sys, dubins_traffic as dt; dt.plot(dt.RoadNetwork.grid(2, 2))"
    code += "; assert 'matplotlib.pyplot' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_asdict_is_what_the_command_line_prints(result: dt.Result, batch: dt.Batch) -> None:
    assert result.asdict() == result.score.asdict() == result.score.to_json()
    assert result.score.verdict is not None
    assert result.asdict()["verdict"] == result.score.verdict.asdict()
    assert batch.asdict() == batch.sheet.asdict() == batch.sheet.to_json()
    json.dumps(batch.asdict())


def test_rows_have_the_columns_of_campaigns(result: dt.Result, batch: dt.Batch) -> None:
    (row,) = rows_of(result)
    assert list(row) == ["trial", "seed", "controller", "record", "end", *SCORES]
    assert row["rounds"] == result.score.rounds
    assert rows_of(result.score) == [row]
    assert [own["trial"] for own in rows_of(batch)] == [0, 1, 2]
    assert rows_of(batch.sheet) == rows_of(batch)
    with pytest.raises(TypeError, match="no table of a int"):
        rows_of(3)


def test_data_frames(values: dict[str, Any]) -> None:
    pandas = pytest.importorskip("pandas")
    for name, rows in (("Score", 1), ("ScoreSheet", 3), ("Batch", 3), ("Result", 1)):
        table = values[name].to_pandas()
        assert isinstance(table, pandas.DataFrame)
        assert len(table) == rows
        assert {"trial", "controller", "rounds", "verdict", "breaches.2.left"} <= set(table.columns)


def test_without_pandas_the_extra_is_named(values: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    for name in ("Score", "Batch", "Result"):
        with pytest.raises(MissingExtraError, match=r"install dubins-traffic\[pandas\]"):
            values[name].to_pandas()


def record_beside(place: Path) -> Path:
    """Return the name of a record that is there already."""
    record = place.with_suffix(".mcap")
    record.touch()
    return record


@pytest.mark.parametrize(
    ("call", "python", "typed"),
    [
        (lambda _: dt.run_batch("demo", trials=1, keep="some"), "keep: unknown choice", "--keep: unknown choice"),
        (lambda _: dt.plan("demo", deadline=-1.0), "deadline: not a time", "--deadline: not a time"),
        (lambda place: dt.plan("demo", data=place), "overwrite_data=True", "-F"),
        (lambda place: dt.RecordWriter(record_beside(place)).begin(instance(ROUGH)), "overwrite=True", "--overwrite"),
    ],
)  # fmt: skip
def test_messages_name_the_argument_in_python_and_the_option_on_the_command_line(
    tmp_path: Path, call: Callable[[Path], object], python: str, typed: str
) -> None:
    place = tmp_path / "there.json"
    place.write_text("{}")
    with pytest.raises(InputError) as found:
        call(place)
    assert python in str(found.value)
    assert not re.search(r"(^|[\s;,])--?[a-zF]", str(found.value))
    assert typed in found.value.on_command_line()


def test_what_is_no_argument_stays() -> None:
    for text in (
        "not installed; dubins-traffic gazebo install --prefix DIR",
        "a--keep",
        "x/--records",
        "--recordsx",
    ):
        assert in_python(text) == text
    assert in_python("a new folder; --resume goes on") == "a new folder; resume=True goes on"


def test_the_command_line_names_its_options(tmp_path: Path) -> None:
    data = tmp_path / "data.json"
    data.write_text("{}")
    command = [sys.executable, "-m", "dubins_traffic.cli", "run", "demo", "--trials", "1", "-f", str(data)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 2
    assert "--overwrite-trial-data (-F) overwrites" in ran.stderr
