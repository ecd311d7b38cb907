"""The page of a report: self-contained HTML, except for the replays beside it, to which it links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.campaign.report import plots
from dubins_traffic.campaign.report.comparison import Comparison, shown, words
from dubins_traffic.campaign.report.worst import Bad
from dubins_traffic.rules.clauses import clause
from dubins_traffic.scoring.notice import assumption_notice
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, told_cut
from dubins_traffic.viewer.pages import render

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
    carried = list(dict.fromkeys(name for own in standings for name in own.formulas))
    return render(
        "campaign/report/report.html",
        title=comparison.campaign.model.name,
        comparison=comparison,
        standings=standings,
        told=_facts(comparison),
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
        formulas={name: [own for own in standings if name in own.formulas] for name in carried},
        formula_charts=[(f"Verdicts on {name}", plots.formula(comparison, name)) for name in carried],
        pairs=list(dict.fromkeys((one.first, one.second) for one in comparison.differences)),
        factors=[_against(comparison, factor) for factor in comparison.factors],
        worst=worst,
        shares=_shares(comparison),
        made=_made(manifest),
        number=_number,
        words=words,
        told_cut=told_cut,
    )


def _facts(comparison: Comparison) -> list[str]:
    campaign = comparison.campaign
    cells = len(campaign.cells)
    return [
        f"{comparison.trials:,} trials",
        f"{len(campaign.controllers)} controllers",
        f"{cells} combination{'s' if cells > 1 else ''} of configuration and factors",
        f"seed {campaign.model.seed}",
    ]


def _overview(comparison: Comparison) -> list[tuple[str, str]]:
    charts: list[tuple[str, str]] = []
    if any(standing.verdicts for standing in comparison.standings):
        charts.append(("Shares of the verdicts", plots.verdicts(comparison)))
    if not plots.no_faults(comparison):
        charts.append(("Collisions by fault", plots.faults(comparison)))
    return charts


def _against(comparison: Comparison, factor: str) -> tuple[str, list[tuple[str, str]], list[Any]]:
    """Return a factor, the charts against it, and the metrics that have none: 0 or absent everywhere."""
    silent = [metric for metric in comparison.metrics if plots.says_nothing(comparison, factor, metric)]
    charts = [
        (f"{metric.heading} against {words(factor)}", plots.against(comparison, factor, metric))
        for metric in comparison.metrics
        if metric not in silent
    ]
    return factor, charts, silent


def _shares(comparison: Comparison) -> list[tuple[str, list[str], list[str], list[Any], str]]:
    """Return tables of shares: heading, what is counted, the same in words, shares by controller, the clauses."""
    standings = comparison.standings
    groups = {
        "Trials in which the ego broke a rule": [own.broken for own in standings],
        "Trials in which others broke the assumption": [own.fallen for own in standings],
        "Ends of all trials": [own.ends for own in standings],
    }
    found: list[tuple[str, list[str], list[str], list[Any], str]] = []
    for title, shares in groups.items():
        names = list(dict.fromkeys(name for group in shares for name in group))
        cited = ", ".join(clause(name) for name in names if name in (*EGO_RULES, *ASSUMPTIONS))
        if names:
            heads = [words(name) for name in names]
            found.append((title, names, heads, list(zip(standings, shares, strict=True)), cited))
    return found


def _made(manifest: Mapping[str, Any]) -> dict[str, str]:
    return {
        **manifest["versions"],
        "campaign file": manifest["campaign"],
        **{f"configuration {name}": digest for name, digest in manifest["configurations"].items()},
        **{f"controller {one['name']}": one["file"] for one in manifest["controllers"] if one["file"]},
        "code": manifest["code"],
    }


def _number(value: float | None, signed: bool = False) -> str:
    return (
        f"+{shown(value)}" if signed and value is not None and value > 0 else shown(value).replace("-", MINUS)
    )
