"""Makes a suite from a folder of cases: ``python -m dubins_traffic.suites.gather NAME TITLE FOLDER FILE``.

The cases are the files ``*.json`` in the folder and its subfolders, as `falsify` writes them. An existing suite is not
overwritten, since suites never change.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text, write_text
from dubins_traffic.problem.files import parse_json
from dubins_traffic.suites.running import case_instances
from dubins_traffic.suites.suite import Suite


def gather(name: str, title: str, folder: Path) -> dict[str, Any]:
    """Return the document of a suite of the cases in a folder, in the order of their names.

    InputError if there is no such file, or one is no case.
    """
    files = sorted(folder.rglob("*.json"))
    if not files:
        raise InputError("no case in it", file=str(folder), expected="files *.json that `falsify` wrote")
    entries = [{"name": _name(path, folder), "document": parse_json(read_text(path), str(path))} for path in files]
    document = {"version": 0, "name": name, "title": title, "cases": entries}
    case_instances(Suite.from_document(document, str(folder)).model.cases or ())
    return document


def _name(path: Path, folder: Path) -> str:
    """Return the name of a case: that of ``lanes/3.order.json`` is ``lanes-3-order``."""
    whole = path.relative_to(folder).with_suffix("").as_posix()
    return re.sub(r"[^a-z0-9]+", "-", whole.lower()).strip("-")


def main(arguments: list[str]) -> None:
    """Write a suite's file."""
    name, title, folder, file = arguments
    if Path(file).exists():
        raise InputError("exists already", file=file, expected="a new file: a suite never changes")
    write_text(file, json.dumps(gather(name, title, Path(folder)), indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
