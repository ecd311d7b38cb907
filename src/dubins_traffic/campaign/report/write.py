"""Writing the report of a campaign: its page, its numbers as CSV, its table for LaTeX, and replays of worst trials.

The page is self-contained HTML, except for the replays beside it, to which it links.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from dubins_traffic.campaign import folder as folders
from dubins_traffic.campaign import manifest, rows, table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.notice import assumption_notice
from dubins_traffic.campaign.report import plots
from dubins_traffic.campaign.report.comparison import RANKING, Comparison, Standing, compare, number_of, shown, words
from dubins_traffic.campaign.report.conclusion import conclusion
from dubins_traffic.campaign.report.plots import figures
from dubins_traffic.campaign.report.statistics import Estimate, Interval, Share, distributions, share
from dubins_traffic.campaign.report.terminal import short_estimate, short_metrics
from dubins_traffic.campaign.report.worst import OTHER_WAY, Bad, replay, replay_name, same
from dubins_traffic.campaign.report.worst import worst as find_worst
from dubins_traffic.errors import InputError
from dubins_traffic.files import make_folder, replace_file, require_output, write_text
from dubins_traffic.rules.clauses import explain
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, told_cut
from dubins_traffic.viewer.pages import PAGES, render

MINUS = "\N{MINUS SIGN}"


def page(comparison: Comparison, manifest: Mapping[str, Any], worst: Mapping[str, Sequence[Bad]]) -> str:
    """Return the page; equal arguments give equal text.

    Parameters
    ----------
    comparison : Comparison
        What it says.
    manifest : Mapping
        The manifest of the campaign: versions and hashes.
    worst : Mapping
        The worst trials of each controller.
    """
    standings = comparison.standings
    carried = _formulas(comparison)
    return render(
        "campaign/report/report.html",
        title=comparison.campaign.model.name,
        comparison=comparison,
        standings=standings,
        told=_facts(comparison),
        conclusion=conclusion(comparison),
        ranking=plots.ranking(comparison),
        ranks=RANKING,
        missing=comparison.total - comparison.trials,
        notice=assumption_notice(comparison.broken, comparison.judged),
        colours=[plots.colour(k) for k in range(len(comparison.controllers))],
        dark=plots.DARK,
        overview=_overview(comparison),
        no_faults=plots.no_faults(comparison),
        verdicts=list(plots.VERDICTS),
        faults=list(plots.FAULTS),
        by_fault=[f"fault of {who}" for who in plots.FAULTS],
        ended="ended by the controller",
        held=list(plots.FORMULA),
        formulas={name: [standing for standing in standings if name in standing.formulas] for name in carried},
        formula_charts=_formula_charts(comparison),
        pairs=list(dict.fromkeys((one.first, one.second) for one in comparison.differences)),
        factors=[_against(comparison, factor) for factor in comparison.factors],
        worst=worst,
        shares=_page_shares(comparison),
        made=_made(manifest),
        number=_number,
        words=words,
        told_cut=told_cut,
    )


def _facts(comparison: Comparison) -> list[str]:
    campaign = comparison.campaign
    cells = len(campaign.cells)
    return [
        number_of(comparison.trials, "trial"),
        number_of(len(campaign.controllers), "controller"),
        f"{number_of(cells, 'combination')} of configuration and factors",
        f"seed {campaign.model.seed}",
    ]


def charts(comparison: Comparison) -> list[plots.Chart]:
    """Return all charts of the page, which are written for papers, too."""
    drawn = [plots.ranking(comparison), *_overview(comparison), *_formula_charts(comparison)]
    return [*drawn, *(chart for factor in comparison.factors for chart in _against(comparison, factor)[1])]


def _overview(comparison: Comparison) -> list[plots.Chart]:
    charts: list[plots.Chart] = []
    if any(standing.verdicts for standing in comparison.standings):
        charts.append(plots.verdicts(comparison))
    if not plots.no_faults(comparison):
        charts.append(plots.faults(comparison))
    return charts


def _formulas(comparison: Comparison) -> list[str]:
    return list(dict.fromkeys(name for standing in comparison.standings for name in standing.formulas))


def _formula_charts(comparison: Comparison) -> list[plots.Chart]:
    return [plots.formula(comparison, name, k) for k, name in enumerate(_formulas(comparison), 1)]


def _against(comparison: Comparison, factor: str) -> tuple[str, list[plots.Chart], list[Any]]:
    """Return a factor, the charts against it, and the metrics that have none: 0 or absent everywhere."""
    silent = [metric for metric in comparison.metrics if plots.says_nothing(comparison, factor, metric)]
    shown_ones = [metric for metric in comparison.metrics if metric not in silent]
    return factor, [plots.against(comparison, factor, metric) for metric in shown_ones], silent


def _page_shares(comparison: Comparison) -> list[tuple[str, list[str], list[str], list[Any], str]]:
    """Return tables of shares: heading, what is counted, the same in words, shares by controller, the clauses."""
    standings = comparison.standings
    groups = {
        "Trials in which the ego broke a rule": [standing.broken for standing in standings],
        "Trials in which others broke the assumption": [standing.fallen for standing in standings],
        "Ends of all trials": [standing.ends for standing in standings],
    }
    bars: list[tuple[str, list[str], list[str], list[Any], str]] = []
    for title, shares in groups.items():
        names = list(dict.fromkeys(name for group in shares for name in group))
        cited = next((explain(name) for name in names if name in (*EGO_RULES, *ASSUMPTIONS)), "")
        if names:
            heads = [words(name) for name in names]
            bars.append((title, names, heads, list(zip(standings, shares, strict=True)), cited))
    return bars


def _made(manifest: Mapping[str, Any]) -> dict[str, str]:
    return {
        **manifest["versions"],
        "campaign file": manifest["campaign"],
        **{f"configuration {name}": digest for name, digest in manifest["configurations"].items()},
        **{f"controller {one['name']}": one["file"] for one in manifest["controllers"] if one["file"]},
        "code": manifest["code"],
    }


def _number(value: float | None, signed: bool = False) -> str:
    return f"+{shown(value)}" if signed and value is not None and value > 0 else shown(value).replace("-", MINUS)


ESTIMATE = ("count", "mean", "mean_low", "mean_high", "median", "median_low", "median_high")
SHARE = ("count", "of", "share", "low", "high")
REPORT = "report"
PAGE = "index.html"
TABLE = "table.tex"
FIGURES = "figures"


@dataclass(frozen=True, slots=True)
class Written:
    """A report: what it says, the worst trials of each controller, and where its page is."""

    comparison: Comparison
    worst: Mapping[str, Sequence[Bad]]
    page: Path


def write_report(
    folder: str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    worst: int = 3,
    wall: bool = False,
    progress: Callable[[int, int], object] | None = None,
    overwrite: bool = False,
) -> Written:
    """Compare the controllers of a campaign and write a page, its numbers as CSV and the replays it links to.

    For papers there are a table for LaTeX and the charts as PDF.

    The same folder gives the same bytes. An unfinished campaign is compared as far as it has come.

    Parameters
    ----------
    folder : path
        The folder of a campaign.
    output : path, optional
        Where to write; by default ``report`` in that folder.
    worst : int
        How many of the worst trials of each controller are run again and replayed.
    wall : bool
        Whether to tell what was measured on a wall clock.
    progress : callable, optional
        Is told how many of how many replays there are.
    overwrite : bool
        Whether files of `output` that are there may be replaced; those of ``report`` in `folder` always are.

    Raises
    ------
    InputError
        If there is no campaign in `folder` or nothing of it is finished, or a file can't be written.
    MissingExtraError
        Without the extra `campaign`.
    """
    figures()
    distributions()
    place, known, campaign, results = open_campaign(folder)
    parts = [path for _, _, path in folders.parts(place)]
    clock = table.read(place, campaign, parts, table.TableKind.WALL) if wall else None
    comparison = compare(campaign, results, clock)
    target = place / REPORT if output is None else Path(output)
    make_folder(target, "a report")
    texts = {**csv_files(comparison), TABLE: latex_table(comparison)}
    for name in (PAGE, *texts):
        suffix = Path(name).suffix
        require_output(target / name, "a report", [suffix], overwrite=overwrite or output is None)
    ranked = comparison.controllers
    bad = find_worst(campaign, results, ranked, worst, target, progress or _silent) if worst else {}
    for name, text in texts.items():
        write_text(target / name, text)
    make_folder(target / FIGURES, "a report")
    for chart in charts(comparison):
        replace_file(target / FIGURES / f"{chart.name}.pdf", partial(Path.write_bytes, data=chart.pdf))
    write_text(target / PAGE, page(comparison, known, bad))
    return Written(comparison, bad, target / PAGE)


def replay_trial(
    folder: str | os.PathLike[str],
    number: int,
    output: str | os.PathLike[str] | None = None,
    *,
    overwrite: bool = False,
) -> tuple[Path, str]:
    """Run a trial of a campaign again and write its replay.

    Parameters
    ----------
    folder : path
        The folder of a campaign.
    number : int
        Number of the trial in the campaign, the column `number` of its table.
    output : path, optional
        The page; by default where a report has it.
    overwrite : bool
        Whether a page `output` that is there may be replaced.

    Returns
    -------
    page : Path
        Where the replay is.
    note : str
        What is odd about it: that it went another way; empty if it went as in the campaign.
    """
    if output is not None:
        require_output(output, "a page", PAGES, overwrite=overwrite)
    place, _, campaign, results = open_campaign(folder)
    compute: Any = rows.arrow().compute
    matching = results.filter(compute.equal(results["number"], number)).to_pylist()
    if not matching:
        expected = f"the number of a trial that has been run; {len(results)} of {campaign.total} have"
        raise InputError("no such trial", file=str(place), field="number", value=number, expected=expected)
    if output is None:
        target = place / REPORT / replay_name(number)
        make_folder(target.parent, "a report")
    else:
        target = Path(output)
    again = replay(campaign, matching[0], target)
    return target, "" if same(matching[0], again) else OTHER_WAY


def open_campaign(folder: str | os.PathLike[str]) -> tuple[Path, Mapping[str, Any], Campaign, Any]:
    """Return the folder of a campaign, its manifest, the campaign and its table, of what is finished.

    Raises
    ------
    InputError
        If there is no campaign in `folder`, nothing of it is finished, or its table can't be read.
    MissingExtraError
        Without the extra `campaign`.
    """
    rows.arrow()
    place = Path(folder)
    known = manifest.read(place)
    if known is None:
        raise InputError("no campaign", file=str(place), expected="the folder of a campaign, with manifest.json")
    campaign = manifest.stored_campaign(place, known)
    results = table.read(place, campaign, [path for _, _, path in folders.parts(place)])
    if not len(results):
        raise InputError("nothing is finished yet", file=str(place), expected="a campaign that has begun")
    return place, known, campaign, results


def _silent(_done: int, _total: int) -> None:
    """Tell nobody."""


def csv_files(comparison: Comparison) -> dict[str, str]:
    """Return the files by name; floats read back to the same bits, 95 % intervals as low and high."""
    return {
        "controllers.csv": _csv_text(("controller", "metric", *ESTIMATE), _controllers(comparison)),
        "shares.csv": _csv_text(("controller", "of_what", "which", *SHARE), _shares(comparison)),
        "differences.csv": _csv_text(
            ("first", "second", "metric", *ESTIMATE, "first_larger", "first_smaller"),
            _differences(comparison),
        ),
        "factors.csv": _csv_text(("factor", "value", "controller", "metric", *ESTIMATE[:4]), _factors(comparison)),
    }


def _controllers(comparison: Comparison) -> Iterator[Sequence[object]]:
    for standing in comparison.standings:
        for metric in comparison.metrics:
            yield standing.controller, metric.name, *_estimate(standing.estimates[metric.name])


def _shares(comparison: Comparison) -> Iterator[Sequence[object]]:
    for standing in comparison.standings:
        groups = {
            "clean": {"clean": standing.clean} if standing.judged else {},
            "verdict": standing.verdicts,
            "excused": {"near": standing.near} if standing.near.total else {},
            "cut": {"cut": share(standing.cut, standing.judged)} if standing.cut else {},
            "end": standing.ends,
            "rule broken by the ego": standing.broken,
            "assumption broken by others": standing.fallen,
            **{f"formula {name}": formula for name, formula in standing.formulas.items()},
        }
        for what, group in groups.items():
            for which, part in group.items():
                yield standing.controller, what, which, *_share(part)


def _differences(comparison: Comparison) -> Iterator[Sequence[object]]:
    for one in comparison.differences:
        estimate = _estimate(one.estimate)
        yield one.first, one.second, one.metric.name, *estimate, one.larger, one.smaller


def _factors(comparison: Comparison) -> Iterator[Sequence[object]]:
    for level in comparison.levels:
        estimate = _estimate(level.estimate)[:4]
        yield level.factor, level.value, level.controller, level.metric.name, *estimate


def _estimate(estimate: Estimate) -> tuple[object, ...]:
    mean, median = estimate.mean_interval, estimate.median_interval
    return estimate.count, estimate.mean, *_ends(mean), estimate.median, *_ends(median)


def _share(share: Share) -> tuple[object, ...]:
    return share.count, share.total, share.share, *_ends(share.interval)


def _ends(interval: Interval | None) -> tuple[object, object]:
    return interval or (None, None)


def _csv_text(headings: Sequence[str], rows: Iterator[Sequence[object]]) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(headings)
    writer.writerows(["" if cell is None else cell for cell in row] for row in rows)
    return stream.getvalue()


SPECIAL = {character: f"\\{character}" for character in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
}


def latex_table(comparison: Comparison) -> str:
    r"""Return the controllers, the best first, in the metrics of the terminal's table, with 95 % intervals.

    A document that puts it in by ``\input{table}`` needs ``\usepackage{booktabs}``.
    """
    metrics = short_metrics(comparison)
    title = escaped(comparison.campaign.model.name)
    lines = [
        f"% {title}: {comparison.trials} of {comparison.total} trials; means, with 95 % intervals. Needs booktabs.",
        rf"\begin{{tabular}}{{l{'r' * len(metrics)}}}",
        r"\toprule",
        _row("controller", *(escaped(metric.heading) for metric in metrics)),
        r"\midrule",
        *(_row(_name(standing), *(_cell(standing, metric) for metric in metrics)) for standing in comparison.standings),
        r"\bottomrule",
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    """Return a text as LaTeX prints it, in one line."""
    return re.sub(r".", lambda match: SPECIAL.get(match[0], match[0]), " ".join(text.split()))


def _name(standing: Standing) -> str:
    return rf"\texttt{{{escaped(standing.controller)}}}"


def _row(*cells: str) -> str:
    return f"{' & '.join(cells)} \\\\"


def _cell(standing: Standing, metric: Column) -> str:
    mean, ends = short_estimate(standing, metric)
    if mean is None or ends is None:
        return "--"
    low, high = map(shown, ends)
    return f"${shown(mean)}$ [${low}$, ${high}$]"
