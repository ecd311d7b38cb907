"""Answers of several solvers on the games of a suite: a table in Markdown and a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dubins_traffic.campaign.report.markup import base_style, document, section, table, text
from dubins_traffic.campaign.report.metrics import shown
from dubins_traffic.errors import InputError
from dubins_traffic.suites.comparing import Source, check_suite, entry_name
from dubins_traffic.suites.games import agrees
from dubins_traffic.suites.markdown import markdown_table
from dubins_traffic.suites.result_model import GameResult
from dubins_traffic.suites.settings import GameEntry
from dubins_traffic.suites.suite import Suite

RIGHT: Mapping[bool | None, str] = {True: "right", False: "wrong", None: "no answer"}


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers of one solver: `found` and `seconds`, by the names of the games."""

    name: str
    found: Mapping[str, GameResult]
    seconds: Mapping[str, float]


def answers_of(suite: Suite, sources: Sequence[Source]) -> list[Answers]:
    """Return the answers in files of results.

    Raises
    ------
    InputError
        If the suite is another one here, or a name stands twice.
    """
    check_suite(suite, sources)
    found: list[Answers] = []
    for source in sources:
        for entry in source.found.solvers:
            name = entry_name(source, entry.solver, len(source.found.solvers))
            if any(name == other.name for other in found):
                raise InputError(
                    "name taken", file=str(source.path), value=name, expected="NAME=PATH with another name"
                )
            seconds = {} if source.wall is None else source.wall.solvers.get(entry.solver, {})
            found.append(Answers(name, entry.games, seconds))
    return found


def games_table(suite: Suite, answers: Sequence[Answers]) -> str:
    """Return a heading and the table of the games, with the verdict on each solver's answer and its seconds."""
    told = f"# {suite.name}\n\n{suite.model.title}. Hash `{suite.hash}`."
    return f"{told}\n\n{markdown_table(_head(answers), _body(suite, answers))}\n{_summary(suite, answers)}\n"


def games_page(suite: Suite, answers: Sequence[Answers], how: str) -> str:
    """Return the same as a page in HTML, with a sentence on how it was made."""
    body = [[f"<th>{text(name)}</th>", *map(text, cells)] for name, *cells in _body(suite, answers)]
    facts = [
        [f"<th>{text(what)}</th>", f"<code>{text(value)}</code>"]
        for what, value in (("suite", suite.name), ("hash", suite.hash))
    ]
    head = f"<header><h1>{text(suite.label)}</h1><p>{text(suite.model.title)}</p></header>"
    sections = [
        section("Answers", table(_head(answers), body) + f"<p>{text(_summary(suite, answers))}</p>"),
        section("How it was made", table(["what", "value"], facts, "texts") + f"<p>{text(how)}</p>"),
    ]
    return document(suite.label, base_style(), head, sections)


def _head(answers: Sequence[Answers]) -> list[str]:
    head = ["game", "e-agents", "assumed", "positions", "won", "realizable"]
    return head + [f"{own.name}{what}" for own in answers for what in ("", ", s")]


def _body(suite: Suite, answers: Sequence[Answers]) -> list[list[str]]:
    return [
        [
            game.name,
            str(game.cars),
            game.assume or "nothing",
            f"{game.positions:,}",
            f"{game.winning:,}",
            _realizable(game),
            *(cell for own in answers for cell in _cells(game, own)),
        ]
        for game in suite.model.games or ()
    ]


def _realizable(game: GameEntry) -> str:
    if game.winning == game.positions:
        return "everywhere"
    return "somewhere" if game.winning else "nowhere"


def _cells(game: GameEntry, own: Answers) -> tuple[str, str]:
    found = own.found.get(game.name)
    right = None if found is None else agrees(game, found)
    return RIGHT[right], shown(own.seconds.get(game.name))


def _summary(suite: Suite, answers: Sequence[Answers]) -> str:
    games = suite.model.games or ()
    lines: list[str] = []
    for own in answers:
        right = sum(_cells(game, own)[0] == RIGHT[True] for game in games)
        spent = sum(own.seconds.get(game.name, 0.0) for game in games)
        took = f" in {shown(spent)} s" if own.seconds else ""
        lines.append(f"{own.name}: {right} of {len(games)} right{took}.")
    return " ".join(lines)
