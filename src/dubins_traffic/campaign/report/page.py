"""The page of a report: self-contained HTML, except for the replays beside it, to which it links."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.campaign.report import plots
from dubins_traffic.campaign.report.comparison import Comparison, Difference, Standing
from dubins_traffic.campaign.report.markup import base_style, document, section, table, text
from dubins_traffic.campaign.report.metrics import shown, words
from dubins_traffic.campaign.report.statistics import Estimate, Interval, Share
from dubins_traffic.campaign.report.worst import Bad
from dubins_traffic.rules.clauses import clause
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.notice import assumption_notice
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES, told_cut

ENDED = "ended by the controller"
MINUS = "\N{MINUS SIGN}"
HOW = (
    "Every controller is run on the same instances. Brackets hold 95 % intervals: of means and medians percentiles of "
    "1,000 bootstrap resamples (of more than 2,000 values the normal interval, and order statistics), of shares "
    "those of Wilson. A difference is taken trial by trial and set in bold where its interval leaves out 0. Trials "
    "that came to nothing are not clean and count among the ends, and in no metric."
)


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
    style = _style(comparison)
    name = comparison.campaign.model.name
    standings = comparison.standings
    sections = [
        section("Verdicts and collisions", _overview(comparison)),
        section("Formulas", _formulas(comparison)) if any(own.formulas for own in standings) else "",
        section("Metrics", _metrics(comparison)),
        section("Differences, pair by pair", _differences(comparison)) if comparison.differences else "",
        *(section(f"Against {words(factor)}", _plots(comparison, factor)) for factor in comparison.factors),
        section("Worst trials", _worst(worst)) if any(worst.values()) else "",
        section("Rules and ends", _shares(comparison)),
        section("How it was made", _made(manifest)),
    ]
    return document(name, style, _head(comparison), sections)


def _head(comparison: Comparison) -> str:
    campaign = comparison.campaign
    cells = len(campaign.cells)
    facts = [
        f"{_count(comparison.trials)} trials",
        f"{len(campaign.controllers)} controllers",
        f"{cells} combination{'s' if cells > 1 else ''} of configuration and factors",
        f"seed {campaign.model.seed}",
    ]
    missing = comparison.total - comparison.trials
    warning = (
        f'<p class="warning">Unfinished: {_count(missing)} of {_count(comparison.total)} trials have not been run.</p>'
        if missing
        else ""
    )
    notice = assumption_notice(comparison.broken, comparison.judged)
    warning += f'<p class="warning">{text(notice)}</p>' if notice else ""
    key = "".join(
        f'<li><span class="dot c{k}"></span>{text(name)}</li>'
        for k, name in enumerate(comparison.controllers)
    )
    return (
        f"<header><h1>{text(campaign.model.name)}</h1><p>{' · '.join(facts)}</p>{warning}"
        f'<ul class="key">{key}</ul></header>'
    )


def _overview(comparison: Comparison) -> str:
    figures = ""
    if any(standing.verdicts for standing in comparison.standings):
        figures += _image(plots.verdicts(comparison), "Shares of the verdicts")
    silent = plots.no_faults(comparison)
    if not silent:
        figures += _image(plots.faults(comparison), "Collisions by fault")
    note = "<p>No chart of collisions by fault: the egos had none.</p>" if silent else ""
    judged = [
        [
            _name(standing, k),
            _count(standing.judged),
            _share(standing.clean) + told_cut(standing.cut),
            _mean(standing, "counted_rounds"),
            *(_share(standing.verdicts.get(verdict)) for verdict in plots.VERDICTS),
        ]
        for k, standing in enumerate(comparison.standings)
    ]
    collided = [
        [
            _name(standing, k),
            _count(standing.trials),
            _count(standing.ended.count),
            _count(standing.collisions),
            *(_count(standing.faults[who]) for who in plots.FAULTS),
        ]
        for k, standing in enumerate(comparison.standings)
    ]
    at_fault = [
        "controller",
        "trials",
        ENDED,
        "collisions of the ego",
        *(f"fault of {who}" for who in plots.FAULTS),
    ]
    ruled = ["controller", "judged", "clean", "counted rounds", *plots.VERDICTS]
    return f'<div class="figures wide">{figures}</div>{note}{table(ruled, judged)}{table(at_fault, collided)}'


def _formulas(comparison: Comparison) -> str:
    """Return what held of each formula of the user's own."""
    standings = comparison.standings
    names = list(dict.fromkeys(name for standing in standings for name in standing.formulas))
    figures = "".join(_image(plots.formula(comparison, name), f"Verdicts on {name}") for name in names)
    body: list[list[str]] = []
    for name in names:
        own = [(k, standing) for k, standing in enumerate(standings) if name in standing.formulas]
        for place, (k, standing) in enumerate(own):
            first = "" if place else f'<th rowspan="{len(own)}" scope="rowgroup">{text(name)}</th>'
            found = standing.formulas[name]
            judged = next(iter(found.values())).total
            held = (_share(found[what]) for what in plots.FORMULA)
            body.append([first, _name(standing, k), _count(judged), *held])
    shares = table(["formula", "", "trials", *plots.FORMULA], body, "grouped")
    return f'<div class="figures wide">{figures}</div>{shares}'


def _metrics(comparison: Comparison) -> str:
    many = len(comparison.standings)
    head = ["metric", "", "mean", "95 %", "median", "95 %", "trials"]
    body: list[list[str]] = []
    for metric in comparison.metrics:
        for k, standing in enumerate(comparison.standings):
            estimate = standing.estimates[metric.name]
            first = f'<th rowspan="{many}" scope="rowgroup">{_heading(metric)}</th>' if k == 0 else ""
            body.append([first, _name(standing, k), *_estimate(estimate), _count(estimate.count)])
    undefined = ", ".join(metric.label for metric in comparison.undefined)
    note = f"<p>Not defined for these trials: {text(undefined)}.</p>" if undefined else ""
    return table(head, body, "grouped") + note + f"<p>{HOW}</p>"


def _differences(comparison: Comparison) -> str:
    found: list[str] = []
    pairs = dict.fromkeys((one.first, one.second) for one in comparison.differences)
    for first, second in pairs:
        own = [one for one in comparison.differences if (one.first, one.second) == (first, second)]
        head = ["metric", "mean", "95 %", "median", "95 %", "more", "less", "equal", "better"]
        body = [[f"<th>{_heading(one.metric)}</th>", *_difference(one)] for one in own]
        found.append(f"<h3>{text(first)} minus {text(second)}</h3>{table(head, body)}")
    return "".join(found)


def _difference(one: Difference) -> list[str]:
    estimate = one.estimate
    interval = estimate.mean_interval
    decided = interval is not None and (interval[0] > 0 or interval[1] < 0)
    cells = _estimate(estimate, signed=True)
    better = ""
    if decided and estimate.mean is not None:
        cells[:2] = [f"<b>{cell}</b>" for cell in cells[:2]]
        if one.metric.better:
            better = text(one.first if (estimate.mean > 0) == (one.metric.better > 0) else one.second)
    equal = estimate.count - one.larger - one.smaller
    return [*cells, _count(one.larger), _count(one.smaller), _count(equal), better]


def _plots(comparison: Comparison, factor: str) -> str:
    """Return the plots against a factor, and a line that names the metrics which have none: 0 or absent everywhere."""
    silent = [metric for metric in comparison.metrics if plots.says_nothing(comparison, factor, metric)]
    images = (
        _image(plots.against(comparison, factor, metric), f"{metric.heading} against {words(factor)}")
        for metric in comparison.metrics
        if metric not in silent
    )
    names = "; ".join(metric.label for metric in silent)
    note = f"<p>No chart of what is 0 or absent everywhere: {text(names)}.</p>" if silent else ""
    return f'<div class="figures">{"".join(images)}</div>{note}'


def _worst(worst: Mapping[str, Sequence[Bad]]) -> str:
    head = ["controller", "trial", "configuration", "factors", "why", "replay"]
    body: list[list[str]] = []
    for k, (name, trials) in enumerate(worst.items()):
        for bad in trials:
            row = bad.row
            factors = ", ".join(
                f"{words(key.removeprefix('factor.'))} {value}"
                for key, value in row.items()
                if key.startswith("factor.")
            )
            link = f'<a href="{bad.replay}">replay</a>' if bad.replay else ""
            note = f' <span class="note">{text(bad.note)}</span>' if bad.note else ""
            cells = [f"{row['number']}", row["configuration"], factors, bad.why]
            body.append(
                [f'<th><span class="dot c{k}"></span>{text(name)}</th>', *map(text, cells), link + note]
            )
    return table(head, body, "texts")


def _shares(comparison: Comparison) -> str:
    parts: list[str] = []
    standings = comparison.standings
    wanted: Mapping[str, list[Mapping[str, Share]]] = {
        "Trials in which the ego broke a rule": [standing.broken for standing in standings],
        "Trials in which others broke the assumption": [standing.fallen for standing in standings],
        "Ends of all trials": [standing.ends for standing in standings],
    }
    for title, groups in wanted.items():
        names = list(dict.fromkeys(name for group in groups for name in group))
        if not names:
            continue
        body = [
            [_name(standing, k), *(_share(group.get(name)) for name in names)]
            for k, (standing, group) in enumerate(zip(standings, groups, strict=True))
        ]
        cited = ", ".join(clause(name) for name in names if name in (*EGO_RULES, *ASSUMPTIONS))
        note = f"<p>Clauses: {cited}</p>" if cited else ""
        parts.append(f"<h3>{title}</h3>{table(['controller', *map(words, names)], body)}{note}")
    return "".join(parts)


def _made(manifest: Mapping[str, Any]) -> str:
    facts = {
        **manifest["versions"],
        "campaign file": manifest["campaign"],
        **{f"configuration {name}": digest for name, digest in manifest["configurations"].items()},
        **{f"controller {one['name']}": one["file"] for one in manifest["controllers"] if one["file"]},
        "code": manifest["code"],
    }
    body = [[f"<th>{text(name)}</th>", f"<code>{text(value)}</code>"] for name, value in facts.items()]
    return table(["what", "version or SHA-256"], body, "texts")


def _image(svg: str, alt: str) -> str:
    data = base64.b64encode(svg.encode()).decode()
    return f'<img alt="{text(alt)}" src="data:image/svg+xml;base64,{data}">'


def _name(standing: Standing, index: int) -> str:
    return f'<th class="name"><span class="dot c{index}"></span>{text(standing.controller)}</th>'


def _heading(metric: Column) -> str:
    unit = f' <span class="unit">{text(metric.unit)}</span>' if metric.unit else ""
    arrow = {1: "↑", -1: "↓", 0: ""}[metric.better]
    title = {1: "more is better", -1: "less is better", 0: ""}[metric.better]
    mark = f' <span class="better" title="{title}">{arrow}</span>' if arrow else ""
    return f"{text(metric.label)}{unit}{mark}"


def _estimate(estimate: Estimate, *, signed: bool = False) -> list[str]:
    return [
        _number(estimate.mean, signed),
        _interval(estimate.mean_interval),
        _number(estimate.median, signed),
        _interval(estimate.median_interval),
    ]


def _mean(standing: Standing, column: str) -> str:
    found = standing.estimates.get(column)
    return _number(None if found is None else found.mean)


def _number(value: float | None, signed: bool = False) -> str:
    return (
        f"+{shown(value)}" if signed and value is not None and value > 0 else shown(value).replace("-", MINUS)
    )


def _interval(interval: Interval | None) -> str:
    return "" if interval is None else f"[{_number(interval[0])}, {_number(interval[1])}]"


def _share(share: Share | None) -> str:
    if share is None or share.share is None or share.interval is None:
        return shown(None)
    low, high = share.interval
    return f'{share.share:.1%} <span class="unit">[{low:.1%}, {high:.1%}]</span>'


def _count(value: int) -> str:
    return f"{value:,}"


def _style(comparison: Comparison) -> str:
    colours = [plots.colour(k) for k in range(len(comparison.campaign.controllers))]
    dots = [f".c{k} {{ background: {colour} }}" for k, colour in enumerate(colours)]
    dark = [
        f".c{k} {{ background: {plots.DARK[colour]} }}"
        for k, colour in enumerate(colours)
        if colour in plots.DARK
    ]
    scheme = f"@media (prefers-color-scheme: dark) {{ {' '.join(dark)} }}"
    return "\n".join([base_style(), *dots, scheme])
