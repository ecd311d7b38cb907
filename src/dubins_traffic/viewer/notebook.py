"""How notebooks show values: a picture and a few numbers as HTML, without anything to load; a record can be played.

Only the player of a record has a script. It is a page of its own within the notebook's, which reaches nothing else.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.cars.state import Pose
from dubins_traffic.display import Tabulated
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.reader import Record
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.scoring.score import Score, ScoreSheet
from dubins_traffic.viewer import svg
from dubins_traffic.viewer.marks import Mark, breach_marks, contact_mark, verdict_text
from dubins_traffic.viewer.pages import render
from dubins_traffic.viewer.paths import Paths
from dubins_traffic.viewer.replay import replay_page

ROWS = 12
"""Most rows of a table."""
MARKS = 200
"""Most contacts, and most breaches, that are drawn."""
PLAYED = 8 << 20
"""Most characters of a player: notebooks keep them; of a longer trial the picture is shown alone."""


class Sheeted(Tabulated):
    """A value with a score sheet, shown and tabulated as that is."""

    __slots__ = ()

    @property
    def sheet(self) -> ScoreSheet:
        """The scores."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.sheet.summary}>"

    def _repr_html_(self) -> str:
        return sheet_html(type(self).__name__, self.sheet)

    def asdict(self) -> dict[str, Any]:
        """Return the scores as ``run --json`` prints them."""
        return self.sheet.to_json()


def html_of(subject: object) -> str:
    """Return the HTML of a road network, a problem, an instance, a record or a score sheet."""
    if isinstance(subject, RoadNetwork):
        return _page(svg.network_picture(subject), "Road network", subject.summary)
    if isinstance(subject, Problem):
        return _page(svg.problem_picture(subject), "Problem", subject.summary)
    if isinstance(subject, Instance):
        caption = f"{subject.title}, {subject.duration:g} s; {subject.problem.summary}"
        return _page(svg.trial_picture(subject), "Instance", caption)
    if isinstance(subject, Record):
        return record_html(subject)
    if isinstance(subject, ScoreSheet):
        return sheet_html("Scores", subject)
    raise TypeError(f"no picture of a {type(subject).__name__}")


def record_html(record: Record) -> str:
    """Return the HTML of a record: a player, and beneath it all paths, contacts, and where the cars ended."""
    caption = repr(record).strip("<>").removeprefix("Record")
    if len(record.frames) == 0:
        return _page(svg.trial_picture(record.instance), "Record", caption.strip(": "))
    marks = [contact_mark(record.instance, contact) for contact in record.frames.contacts[:MARKS]]
    paths = Paths.of(record.instance, record.frames)
    picture = svg.trial_picture(record.instance, paths.last, paths.lines(), marks)
    player = replay_page(record.instance, record.frames, record.ending)
    if len(player) > PLAYED:
        return _page(picture, "Record", caption.strip(": "))
    return render("viewer/player.html", player=player, picture=picture, heading="Record", caption=caption.strip(": "))


def trial_html(instance: Instance, score: Score, paths: Sequence[Floats] = (), end: Sequence[Pose] = ()) -> str:
    """Return the HTML of a trial that was run: its paths, breaches and contacts, and its score."""
    marks: list[Mark] = []
    if score.verdict is not None:
        marks = breach_marks(instance, score.verdict.violations[:MARKS])
    picture = svg.trial_picture(instance, end or None, paths, marks)
    why = "" if score.verdict is None else verdict_text(score.verdict)
    caption = f"{instance.title}, {score.summary}. {why}"
    return _page(picture, "Result", caption)


def sheet_html(heading: str, sheet: ScoreSheet) -> str:
    """Return the HTML of scores: the shares of their verdicts, or ends, and the first trials as a table."""
    by_controller: dict[str, Counter[str]] = {}
    for trial in sheet.trials:
        by_controller.setdefault(trial.controller or "-", Counter())[trial.outcome] += 1
    head = ("trial", "controller", "verdict", "end", "rounds", "goals visited", "collisions")
    rows = [
        (
            str(trial.trial),
            trial.controller or "-",
            "-" if trial.verdict is None else trial.verdict.verdict.value,
            (trial.end or "cut off").replace("_", " "),
            str(trial.rounds),
            f"{trial.goals_visited:.0%}",
            str(len(trial.collisions)),
        )
        for trial in sheet.trials[:ROWS]
    ]
    return shares_html(heading, sheet.summary, by_controller, head, rows, len(sheet.trials))


def shares_html(
    heading: str,
    caption: str,
    shares: Mapping[str, Mapping[str, int]],
    head: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    total: int = 0,
) -> str:
    """Return the HTML of counts, a bar for each row of `shares`, above the first `rows` of a table of `total`."""
    picture = svg.bars({row: dict(sorted(counts.items())) for row, counts in shares.items()})
    return _page(picture, heading, caption, head, rows, total)


def _page(
    picture: str,
    heading: str,
    caption: str,
    head: Sequence[str] = (),
    rows: Sequence[Sequence[str]] = (),
    total: int = 0,
) -> str:
    return render(
        "viewer/notebook.html",
        picture=picture,
        heading=heading,
        caption=caption,
        head=head,
        rows=rows,
        total=total,
    )
