"""What a search has finished is kept trial by trial: however it ends, none of them is run again when it goes on."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.errors import InputError
from dubins_traffic.falsification import search, trying
from dubins_traffic.falsification.archive import Journal
from dubins_traffic.falsification.moves import Genome
from dubins_traffic.falsification.sampling import Source, prepared
from dubins_traffic.falsification.trying import TrialRunner, Tried, in_order
from tests.campaigns import COMMAND
from tests.minute import a_minute

TRIALS = 12
PATIENT = """
import time
from pathlib import Path

HERE = Path(__file__).parent


class Patient:
    def start(self, problem):
        with (HERE / "begun").open("a") as begun:
            begun.write("x")

    def act(self, observation):
        time.sleep(0.0 if (HERE / "go").exists() else 0.03)
        assert observation.tick < 40 or observation.pose.x % 1.0 < 0.7, "it gives up"
        return 0.9, 1.2
"""


def searching(folder: Path, *options: str, trials: int = TRIALS) -> list[str]:
    """Return the command that searches with a controller that takes its time."""
    return [
        COMMAND, "falsify", "junction", "--controller", f"{folder / 'slow.py'}:Patient", "--trials", str(trials),
        "--duration", "1.5", "--seed", "3", *options,
    ]  # fmt: skip


def whole(folder: Path) -> dict[str, bytes]:
    """Return all files in the folder of a search."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def kept(folder: Path) -> int:
    """Return how many trials are in the journal of a search."""
    path = folder / "journal.txt"
    return path.read_bytes().count(b"\n") if path.exists() else 0


@pytest.mark.parametrize(
    ("number", "damaged"), [(signal.SIGKILL, False), (signal.SIGKILL, True), (signal.SIGINT, False)]
)
def test_trials_of_a_slow_controller_are_kept_one_by_one(tmp_path: Path, number: signal.Signals, damaged: bool) -> None:
    (tmp_path / "slow.py").write_text(PATIENT)
    out, begun = tmp_path / "out", tmp_path / "begun"
    with subprocess.Popen(
        searching(tmp_path, "-o", str(out)), stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        while kept(out) < 3 and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(number)
        told = process.communicate()[1]
    before, ran = kept(out), len(begun.read_text())
    assert 3 <= before < TRIALS
    assert ran - before <= 1, "they are run one after another"
    if number == signal.SIGINT:
        assert f"interrupted after {before} trials; --resume goes on" in told
    journal = out / "journal.txt"
    if damaged:
        lines = journal.read_bytes().splitlines(keepends=True)
        journal.write_bytes(b"".join(lines[:-1]) + lines[-1][: len(lines[-1]) // 2])
        before -= 1
    (tmp_path / "go").touch()
    done = subprocess.run(searching(tmp_path, "-o", str(out), "--resume"), capture_output=True, check=False)
    again = len(begun.read_text()) - ran
    assert not journal.exists()
    ran += again
    plain = subprocess.run(searching(tmp_path, "-o", str(tmp_path / "plain")), capture_output=True, check=False)
    assert done.returncode == plain.returncode == 1
    assert whole(out) == whole(tmp_path / "plain")
    report = json.loads((out / "search.json").read_text())
    assert report["cases"]
    assert 0 < report["faulty"] < TRIALS
    assert again == len(begun.read_text()) - ran - before


def test_what_came_of_a_trial_is_read_as_it_was_kept(tmp_path: Path) -> None:
    source = Source(prepared(a_minute("junction"), 8.0, {"soon": "[] !left_ego"}), 1)
    genomes = [source.fresh(number) for number in range(24)]
    tried = in_order(TrialRunner("simple").attempt(source.build(genomes)))
    tried.append(Tried(True, True, {"1.road": float("inf")}, (), fault="raised: a\nb"))
    genomes.append(Genome(3, 3))
    journal = Journal(tmp_path / "journal.txt")
    journal.keep(zip(range(25), genomes, tried, strict=True))
    journal.settle(0)
    again = Journal(tmp_path / "journal.txt")
    assert list(map(again.known, range(25), genomes)) == tried
    assert any(own.cells for own in tried)
    assert any(own.exercised for own in tried)
    assert again.known(0, genomes[1]) is None, "another trial of that number"
    again.settle(24)
    assert kept(tmp_path) == 1
    again.settle(25)
    assert not (tmp_path / "journal.txt").exists()


@pytest.mark.parametrize("place", range(0, 2000, 97))
def test_a_damaged_line_is_passed_over(tmp_path: Path, place: int) -> None:
    genome = Genome(3, 3)
    path = tmp_path / "journal.txt"
    journal = Journal(path)
    journal.keep((k, genome, Tried(False, False, {"1.road": 0.5 * k}, ())) for k in range(12))
    journal.settle(0)
    data = bytearray(path.read_bytes())
    hit = data[: place % len(data)].count(b"\n")
    data[place % len(data)] ^= 0x81
    path.write_bytes(data)
    again = Journal(path)
    missed = [k for k in range(12) if again.known(k, genome) is None]
    assert missed in ([hit], [hit, hit + 1])
    assert path.read_bytes() == data, "nothing is written before there is something to write"
    again.settle(0)
    assert kept(tmp_path) == 12 - len(missed)


def test_a_file_of_that_name_that_is_no_journal_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "journal.txt").write_text("Monday: rain.\n")
    with pytest.raises(InputError, match="holds files that are no search's"):
        dt.falsify(a_minute("junction"), folder=tmp_path, trials=1, duration=2.0)
    assert (tmp_path / "journal.txt").read_text() == "Monday: rain.\n"


def test_a_search_that_is_interrupted_before_it_has_used_its_journal_keeps_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if it goes on with more trials, and by other processes."""
    given = {"controller": "simple", "seed": 1, "duration": 4.0}
    dt.falsify(a_minute("junction"), folder=tmp_path / "plain", trials=64, **given)

    def interrupt(own: search.Search) -> None:
        if own.finished:
            raise KeyboardInterrupt

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        dt.falsify(a_minute("junction"), folder=out, trials=8, progress=interrupt, **given)
    before = kept(out)
    assert before > 0
    with monkeypatch.context() as patched:

        def torn(*_: object) -> None:
            raise KeyboardInterrupt

        patched.setattr(Source, "build", torn)
        with pytest.raises(KeyboardInterrupt):
            dt.falsify(a_minute("junction"), folder=out, trials=64, resume=True, **given)
    assert kept(out) == before
    handed: list[int] = []
    real = trying.PoolRunner.run

    def watched(own: trying.PoolRunner, instances: list[dt.Instance]) -> object:
        handed.append(len(instances))
        return real(own, instances)

    monkeypatch.setattr(trying.PoolRunner, "run", watched)
    dt.falsify(a_minute("junction"), folder=out, trials=64, workers=2, resume=True, **given)
    assert handed == [32 - before, 32]
    assert whole(out) == whole(tmp_path / "plain")
