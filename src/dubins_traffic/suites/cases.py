"""Cases of a suite, an instance each, are run with controllers; what comes of each is kept as it comes."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.manifest import hash_of_file
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked, make_folder, read_text, write_text
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.header import bare_name
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.runs.jobs import Job, run_trials
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.notice import fault_notice
from dubins_traffic.scoring.registry import STRATEGY_SHARE
from dubins_traffic.suites.results import KEPT, played, save
from dubins_traffic.suites.suite import CaseEntry, Suite

FILE: Final = "cases.jsonl"
COLUMNS: Final = (*KEPT, STRATEGY_SHARE, "reason", *rows.WALL)
"""What is kept of a case; reasons stay in the folder."""
Found = dict[str, dict[str, dict[str, Any]]]
"""What came of each case, by controller and case: columns of a campaign's table."""


def case_instance(entry: CaseEntry) -> Instance:
    """Return the instance of a case.

    Raises
    ------
    InputError
        If it is none, or leaves something to be drawn.
    """
    left = [name for name in ("starts", "duration", "seed", "trial") if name not in entry.document]
    if left:
        raise InputError("a case that leaves something to be drawn", field=f"{entry.name}.{left[0]}")
    return instance_from_document(entry.document, entry.name)


def case_instances(entries: Sequence[CaseEntry]) -> dict[str, Instance]:
    """Return the instances of cases by their names.

    Raises
    ------
    InputError
        If one is none, leaves something to be drawn, or is another one once more.
    """
    instances = {entry.name: case_instance(entry) for entry in entries}
    names: dict[str, str] = {}
    for name, instance in instances.items():
        if (other := names.setdefault(_key(instance), name)) != name:
            raise InputError(
                "the same case twice", field="cases", value=name, expected=f"one other than {other}"
            )
    return instances


def run_cases(
    suite: Suite,
    folder: Path,
    specs: Sequence[str],
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[int, int], object] | None = None,
) -> Path:
    """Run the cases of a suite, or those that are left, with some controllers; return the file of results.

    Raises
    ------
    InputError
        If the suite has no cases, a controller can't be loaded, the folder holds results and they are not to be gone on
        with or are of another suite, or a file can't be written.
    KeyboardInterrupt
        On Ctrl-C; what is finished is kept.
    """
    entries = suite.model.cases
    if entries is None:
        raise InputError("a suite without cases", file=suite.file or suite.name)
    instances = case_instances(entries)
    for spec in specs:
        controllers.load(spec)
    make_folder(folder, "results", begun=resume)
    with locked(folder):
        file = folder / FILE
        found = _kept(file, suite) if file.exists() else {}
        if file.exists() and not resume:
            raise InputError(
                "holds results", file=str(folder), expected="a new folder; --resume goes on with it"
            )
        _run(suite, file, instances, specs, found, workers, progress or (lambda _done, _total: None))
        named = {bare_name(spec): found[bare_name(spec)] for spec in specs}
        columns = {
            name: {column: [own[case][column] for case in instances] for column in COLUMNS}
            for name, own in named.items()
        }
        listed = [
            {
                "controller": name,
                "file": hash_of_file(spec),
                "ran": controllers.ran(spec),
                "columns": played({column: own[column] for column in (*KEPT, STRATEGY_SHARE)}),
            }
            for (name, own), spec in zip(columns.items(), specs, strict=True)
        ]
        seconds = {name: {column: own[column] for column in rows.WALL} for name, own in columns.items()}
        return save(suite, folder, {"entries": listed}, {"entries": seconds})


def _run(
    suite: Suite,
    file: Path,
    instances: Mapping[str, Instance],
    specs: Sequence[str],
    found: Found,
    workers: int,
    progress: Callable[[int, int], object],
) -> None:
    """Run what is left and keep each case when it is done."""
    cases = {_key(instance): name for name, instance in instances.items()}
    total = len(specs) * len(instances)
    for spec in specs:
        own = found.setdefault(bare_name(spec), {})
        left = [instance for name, instance in instances.items() if name not in own]
        metrics = scores.with_share((), [spec])
        jobs = [Job(one.trial or 0, one.seed or 0, spec, instance=one, metrics=metrics) for one in left]
        for result in run_trials(jobs, workers):
            row = rows.row(0, result.ending, result.score, result.wall.act_s)
            own[cases[_key(result.instance)]] = {column: row.get(column) for column in COLUMNS}
            _keep(file, suite, found)
            progress(sum(map(len, found.values())), total)


def faulty(folder: Path, suite: Suite) -> str:
    """Return the notice that cases in a folder ended by a fault; empty if none did."""
    ended = [
        (f"{case} with {name}: {row['end']}: {row['reason'] or ''}".rstrip(": "), row["end"])
        for name, own in _kept(folder / FILE, suite).items()
        for case, row in own.items()
    ]
    bad = [(told, end) for told, end in ended if end in FAULTS]
    return fault_notice(Counter(end for _, end in bad), len(ended), bad[0][0] if bad else "")


def _key(instance: Instance) -> str:
    return json.dumps(instance_to_document(instance), sort_keys=True)


def _keep(file: Path, suite: Suite, found: Found) -> None:
    lines: list[Mapping[str, Any]] = [{"hash": suite.hash}]
    lines += [
        {"controller": name, "case": case, "row": row}
        for name, own in found.items()
        for case, row in own.items()
    ]
    write_text(file, "".join(json.dumps(line) + "\n" for line in lines))


def _kept(file: Path, suite: Suite) -> Found:
    """Return what is kept in a folder; InputError if it is of another suite."""
    try:
        first, *rest = [json.loads(line) for line in read_text(file).splitlines()]
        if first != {"hash": suite.hash}:
            raise InputError("results of another suite", file=str(file), expected="a new folder")
        found: Found = {}
        for line in rest:
            if line["row"].keys() != set(COLUMNS):
                raise KeyError("row")
            found.setdefault(line["controller"], {})[line["case"]] = line["row"]
        return found
    except (ValueError, KeyError, TypeError, AttributeError):
        raise InputError("can't be read as results", file=str(file), expected="a new folder") from None
