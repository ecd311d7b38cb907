"""The short table of a report for LaTeX, with the package `booktabs`."""

from __future__ import annotations

import re

from dubins_traffic.campaign.report.comparison import Comparison, Standing, shown
from dubins_traffic.campaign.report.terminal import short_estimate, short_metrics
from dubins_traffic.scoring.metric import Column

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
