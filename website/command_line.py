"""The page of the command line, read off the commands themselves."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from dubins_traffic.cli.commands import app

HEAD = """# The command line

Every command with all that it takes, as `dubins-traffic COMMAND --help` says it. [A tour of the commands](../tour.md)
shows what they are for. The exit status is 0 if all went well, 2 if the input is wrong, and 1 if a fault of a
controller ended a trial, Ctrl-C was pressed or something unexpected happened.
"""
PAGE = re.compile(r"\bdocs/([\w/-]+)\.md(?!#)")
"""A page that a command names, which the site has."""


def write_command_line(path: Path) -> None:
    """Write a section for each command."""
    sections = [_section(name, command) for name, command in _leaves(typer.main.get_command(app), "dubins-traffic")]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([HEAD, *sections]), encoding="utf-8")


def _leaves(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Give the commands that do something, each with its whole name."""
    below: dict[str, Any] | None = getattr(command, "commands", None)
    if below is None:
        yield name, command
        return
    for own, made in below.items():
        if not made.hidden:
            yield from _leaves(made, f"{name} {own}")


def _section(name: str, command: Any) -> str:
    context = typer.Context(command, info_name=name)
    records = [record for own in command.get_params(context) if (record := own.get_help_record(context))]
    rows = [f"| {_code(taken)} | {_cell(said)} |" for taken, said in records]
    usage = " ".join([name, *command.collect_usage_pieces(context)])
    lines = [
        f"## {name}",
        "",
        *_block(usage),
        _linked(_plain(command.help)),
        "",
        "| takes | |",
        "|---|---|",
        *rows,
        "",
    ]
    return "\n".join([*lines, *_block(_plain(command.epilog))])


def _plain(text: str | None) -> str:
    return re.sub(r"\[/?\w+\]|\x08", "", inspect.cleandoc(text or "")).strip()


def _cell(text: str) -> str:
    plain = " ".join(text.split())
    return _linked(plain if "`" in text else re.sub(r"([|<>*_\[\]])", r"\\\1", plain))


def _linked(text: str) -> str:
    return PAGE.sub(r"[\1](../\1.md)", text)


def _block(text: str) -> list[str]:
    return ["```text", text, "```", ""] if text else []


def _code(text: str) -> str:
    return f"`{' '.join(text.split())}`".replace("|", "\\|")
