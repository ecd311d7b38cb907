"""Controllers in boxes: the same frames as in process, and a named end with an owner for what goes wrong."""

from __future__ import annotations

import json
import stat
import subprocess
import textwrap
from dataclasses import replace
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.controllers import registry
from dubins_traffic.errors import InputError
from dubins_traffic.learning.policy import load
from dubins_traffic.protocols import End
from dubins_traffic.sandbox import Limits, boxed_controller
from tests.boxes import driven, needs_boxes, written
from tests.conformance.transport import frames
from tests.onnx_models import exported, product
from tests.recordings import make_instance
from tests.tools import need_programs

pytestmark = needs_boxes
LEARNED = Path(__file__).parents[2] / "examples" / "learning"
HOMING = f"{Path(__file__).parents[2] / 'examples' / 'controller.py'}:Homing"


def test_twenty_trials_in_a_box_have_the_frames_of_the_same_controller_in_process(tmp_path: Path) -> None:
    configuration = dt.load_config("demo")
    for trial in range(20):
        instance = replace(dt.draw(configuration, seed=7, trial=trial), duration=2.0)
        there = dt.run_trial(instance, boxed_controller(HOMING), record=tmp_path / f"{trial}.mcap")
        here = dt.run_trial(instance, HOMING, record=tmp_path / f"{trial}-here.mcap")
        assert there.ending == here.ending
        assert frames(tmp_path / f"{trial}.mcap") == frames(tmp_path / f"{trial}-here.mcap")


def test_a_box_loads_what_it_drives_with_and_tells_its_processor_time(tmp_path: Path) -> None:
    """Each trial begins a box: what it loads in vain is paid a hundred times a submission."""
    body = "print(*sorted({name.partition('.')[0] for name in sys.modules}))\nreturn 0.1, 0.0"
    result, controller = driven(written(tmp_path, body), ticks=1)
    loaded = set(controller.log_tail.split())
    assert {"dubins_traffic", "numpy"} <= loaded
    assert not loaded & {"pydantic", "pyseccomp", "llvmlite", "rich", "typer", "mcap"}
    assert 0.01 < controller.seconds < 60.0
    assert result.ending.end == End.DURATION


def test_a_box_reads_the_users_machine_code_and_cannot_write_it(tmp_path: Path, monkeypatch) -> None:
    library = tmp_path / "kernels" / "library"
    library.mkdir(parents=True)
    (library / "mine.so").write_text("machine code")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    body = (
        "place = os.environ['NUMBA_CACHE_DIR'] + '/library'\n"
        "print(open(place + '/mine.so').read())\n"
        "for name in ('mine.so', 'x86-64-v2.json'):\n"
        "    try:\n        print(open(place + '/' + name, 'a'))\n"
        "    except OSError as error:\n        print(type(error).__name__)\n"
        "return 0.1, 0.0"
    )
    result, controller = driven(written(tmp_path, body), ticks=1)
    assert result.ending.end == End.DURATION
    assert controller.log_tail.split("\n")[0] == "machine code"
    assert set(controller.log_tail.split("\n")[1:3]) <= {"OSError", "PermissionError"}
    assert [path.name for path in library.iterdir()] == ["mine.so"]


REPORTING = """
class Mine:
    def start(self, problem): pass
    def act(self, seen): return 0.1, 0.0
    def report(self): return [("note", "x" * 500)] * 100
"""


def test_what_a_box_reports_is_limited_as_what_it_prints(tmp_path: Path) -> None:
    """Records and replays hold it: one that no service takes would be a fault of ours, free of charge."""
    (tmp_path / "mine.py").write_text(REPORTING)
    result, controller = driven(f"{tmp_path / 'mine.py'}:Mine", Limits(output=200_000))
    assert (result.ending.end, result.ending.ticks) == (End.OUTPUT_FLOOD, 3)
    assert controller.end is not None
    assert controller.end.fault == "submission"


def test_a_built_in_controller_in_a_box_drives_as_it_does_in_process(tmp_path: Path) -> None:
    instance = replace(dt.draw(dt.load_config("demo"), seed=3), duration=3.0)
    dt.run_trial(instance, "lanes+sandbox", record=tmp_path / "there.mcap")
    dt.run_trial(instance, "lanes", record=tmp_path / "here.mcap")
    assert frames(tmp_path / "there.mcap") == frames(tmp_path / "here.mcap")


@pytest.mark.parametrize(
    ("body", "end", "words"),
    [
        ("return None", End.GAVE_UP, "gave up at tick 0"),
        ("raise ValueError('lost')", End.CONTROLLER_FAULT, "ValueError: lost at tick 0 (mine.py:"),
        ("return 1.0", End.CONTROLLER_FAULT, "two numbers"),
        ("return float('nan'), 0.0", End.CONTROLLER_FAULT, "finite"),
        ("os._exit(3)", End.PEER_LOST, "status 3"),
        ("print('here'); sys.exit(4)", End.CONTROLLER_FAULT, "SystemExit: 4"),
        ("os.close(3); os.close(4)", End.PEER_LOST, "Bad file descriptor"),
        ("while True: pass", End.OUT_OF_TIME, "processor time"),
        ("time.sleep(1e6)", End.PEER_SILENT, "no answer"),
        ("sys.stdout.write('x' * 200_000); return 0.1, 0.0", End.OUTPUT_FLOOD, "printed more"),
        ("os.write(3, b'[' * 60_000 + b'\\n'); time.sleep(1e6)", End.PEER_GARBAGE, "not a message"),
        ("os.write(3, b'x' * 70_000); time.sleep(1e6)", End.PEER_GARBAGE, "longer"),
        ("os.write(3, b'{}\\n{}\\n'); time.sleep(1e6)", End.PEER_FLOOD, "more than it was asked"),
        ("return 0.5, 1 << 2000", End.CONTROLLER_FAULT, ""),
    ],
)
def test_a_driving_ends_by_name_and_its_owner_is_told(body: str, end: End, words: str, tmp_path: Path) -> None:
    limits = Limits(decision_seconds=0.5, bank_seconds=0.5, wall_seconds=20.0, output=100_000)
    if "sleep" in body and end is End.PEER_SILENT:
        limits = replace(limits, wall_seconds=5.0)
    result, controller = driven(written(tmp_path, body), limits)
    assert result.ending.end is end, result.ending
    assert words in result.ending.detail
    assert controller.end is not None
    assert (controller.end.name, controller.end.fault) == (end.value, "submission")


def test_a_fault_in_a_box_is_told_as_in_process(tmp_path: Path) -> None:
    spec = written(tmp_path, "return 1 / (3 - seen.tick), 0.0")
    instance = make_instance(names=(), ticks=30)
    there, here = dt.run_trial(instance, boxed_controller(spec)), dt.run_trial(instance, spec)
    assert there.ending == here.ending


def test_what_a_controller_prints_is_no_message_and_its_end_is_kept(tmp_path: Path) -> None:
    spec = written(tmp_path, "print('tick', seen.tick, flush=True)\nos.write(1, b'raw ')\nreturn 0.1, 0.0")
    result, controller = driven(spec)
    assert result.ending.end is End.DURATION
    assert "tick 29" in controller.log_tail.splitlines()[-2]


def test_a_decision_may_take_longer_while_the_bank_lasts(tmp_path: Path) -> None:
    body = "until = time.process_time() + 0.2\nwhile time.process_time() < until: pass\nreturn 0.1, 0.0"
    spec = written(tmp_path, body)
    within, _ = driven(spec, Limits(decision_seconds=0.1, bank_seconds=60.0), ticks=10)
    assert within.ending.end is End.DURATION
    beyond, _ = driven(spec, Limits(decision_seconds=0.1, bank_seconds=0.5), ticks=10)
    assert beyond.ending.end is End.OUT_OF_TIME
    assert 3 <= beyond.ending.ticks <= 6


def test_what_a_controller_could_do_in_the_judges_process_it_can_not_do_from_a_box(tmp_path: Path) -> None:
    """In process one of these read the instance's seed through `gc`, and another replaced `Scorer.result`."""
    body = """
import gc
if seen.tick == 0:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.scoring.score import Scorer
    print([each.seed for each in gc.get_objects() if isinstance(each, Instance)])
    Scorer.result = lambda self, **more: 1 / 0
class Lying(float):
    def __repr__(self): return 'os.system'
return Lying(0.25), True
"""
    result, controller = driven(written(tmp_path, body))
    assert controller.log_tail == "[]"
    plain, _ = driven(written(tmp_path, "return 0.25, 1.0", "plain.py"))
    assert result.ending.end is End.DURATION, result.ending
    clocks = {"time_to_begin_s": None}
    assert result.score.asdict() | clocks == plain.score.asdict() | clocks


def test_a_program_that_speaks_lines_drives(tmp_path: Path) -> None:
    program = tmp_path / "drive"
    program.write_text(
        textwrap.dedent("""\
        #!/bin/sh
        tick=0
        while read -r line; do
            case "$line" in
            '{"frame"'*) echo "{\\"command\\":[0.25,0.125],\\"tick\\":$tick}"; tick=$((tick + 1)) ;;
            esac
        done
        """)
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    result, controller = driven(f"program:{program}")
    assert result.ending.end is End.DURATION, controller.log_tail
    folder = tmp_path / "entry"
    folder.mkdir()
    program.rename(folder / "drive")
    (folder / "controller.toml").write_text('program = ["./drive"]\n')
    result, _ = driven(str(folder))
    assert result.ending.end is End.DURATION


@pytest.mark.tools
def test_a_program_in_cpp_with_threads_drives(tmp_path: Path) -> None:
    need_programs("g++")
    source = tmp_path / "drive.cc"
    source.write_text(
        textwrap.dedent("""\
        #include <iostream>
        #include <string>
        #include <thread>
        int main() {
            std::string line;
            for (int tick = 0; std::getline(std::cin, line);) {
                if (line.rfind("{\\"frame\\"", 0) != 0) continue;
                double speed = 0.0;
                std::thread([&] { speed = 0.25; }).join();
                std::cout << "{\\"command\\": [" << speed << ", 0], \\"tick\\": " << tick++ << "}" << std::endl;
            }
        }
        """)
    )
    subprocess.run(["g++", "-pthread", source, "-o", tmp_path / "drive"], check=True, timeout=600)
    result, controller = driven(f"program:{tmp_path / 'drive'}")
    assert result.ending.end is End.DURATION, controller.end


def test_a_folder_with_a_manifest_may_import_its_neighbours(tmp_path: Path) -> None:
    (tmp_path / "near.py").write_text("SPEED = 0.125\n")
    (tmp_path / "main.py").write_text(
        "import near\nclass Mine:\n    def start(self, problem): pass\n"
        "    def act(self, seen): return near.SPEED, 0.0\n"
    )
    (tmp_path / "controller.toml").write_text('python = "main.py:Mine"\n')
    result, _ = driven(str(tmp_path))
    assert result.ending.end is End.DURATION


@pytest.mark.parametrize("spec", ["nobody", "program:/no/such", "no.py:Mine", "nowhere:Mine"])
def test_what_can_not_drive_in_a_box_is_refused(spec: str) -> None:
    with pytest.raises(InputError):
        boxed_controller(spec)


def test_limits_are_read_as_they_are_written() -> None:
    limits = Limits.from_text("memory=512M,decision_seconds=0.25")
    assert limits == Limits(memory=512 << 20, decision_seconds=0.25)
    assert Limits.from_text(limits.text()) == limits
    for text in ("memory=0", "speed=1", "memory=1.5", "bank_seconds=-1", "wall_seconds=nan"):
        with pytest.raises(InputError):
            Limits.from_text(text)


def test_a_campaign_can_tell_who_answers_for_every_end() -> None:
    from dubins_traffic.sandbox import owner_of

    assert {json.dumps(owner_of(end)) for end in End} == {'"platform"', '"submission"'}


def test_what_closing_does_in_a_box_is_told_as_in_process(tmp_path: Path) -> None:
    spec = written(tmp_path, "return 0.1, 0.0")
    with (tmp_path / "mine.py").open("a") as file:
        file.write("    def close(self): raise ValueError('not yet')\n")
    result, _ = driven(spec)
    assert result.ending.end is End.DURATION
    assert "close raised" in result.ending.detail
    assert "ValueError: not yet" in result.ending.detail


def test_what_a_controller_makes_that_answers_at_once_is_looked_at_too(tmp_path: Path) -> None:
    body = "for k in range(200): open(f'/tmp/{seen.tick}-{k}', 'w').close()\nreturn 0.1, 0.0"
    result, controller = driven(written(tmp_path, body), Limits(files=1 << 20), ticks=3000)
    assert result.ending.end is End.OUT_OF_MEMORY
    assert "more than 1024 files" in result.ending.detail
    assert controller.end is not None


def test_a_policy_in_onnx_drives_in_a_box_whether_or_not_one_is_asked_for(tmp_path: Path) -> None:
    policy = load(LEARNED / "junction.npz")
    model = exported(policy, tmp_path / "policy.onnx")
    instance = replace(dt.draw(dt.load_config("junction"), seed=1000), duration=20.0)
    in_process = dt.run_trial(instance, f"{LEARNED / 'junction.npz'}")
    for name in (f"{model}", f"{model}+sandbox"):
        found = dt.run_trial(instance, name)
        assert found.ending.end == End.DURATION
        assert registry.ran(name) == registry.BOXED
        assert found.score.goals_visited == in_process.score.goals_visited
    product(model, 7, 2)
    ended = dt.run_trial(instance, f"{model}+shield").ending
    assert ended.end == End.CONTROLLER_FAULT
    assert "input: does not fit: got 7; expected" in ended.detail
    model.unlink()
    with pytest.raises(InputError, match="no such file"):
        dt.run_trial(instance, f"{model}")
