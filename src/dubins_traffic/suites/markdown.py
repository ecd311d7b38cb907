"""Results of a suite as a table in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.report.comparison import Comparison, Standing
from dubins_traffic.campaign.report.metrics import WALL_METRICS, shown
from dubins_traffic.campaign.report.statistics import Estimate, Share
from dubins_traffic.scoring.columns import SCORES, SECOND
from dubins_traffic.scoring.verdict import Ruling, told_cut
from dubins_traffic.suites.suite import Suite

NOTE = "Brackets: 95 % intervals, of means by bootstrap, of shares Wilson's."


def markdown_table(head: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a table; the first column to the left, the others to the right."""
    lines = [head, [":--", *["--:"] * (len(head) - 1)], *body]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def trials_table(suite: Suite, comparison: Comparison) -> str:
    """Return a heading, the table of the controllers, the best by the suite's metric first, and how to read it."""
    metric = SCORES[suite.model.metric].column
    timed = [own for own in WALL_METRICS if own in comparison.metrics]
    judged = any(standing.judged for standing in comparison.standings)
    verdicts = [ruling.value for ruling in Ruling] if judged else []
    head = [
        "controller",
        "trials",
        f"{metric.heading}, mean",
        "sum",
        f"{SCORES[SECOND].column.heading}, mean",
    ]
    head += ["clean", *verdicts] if judged else []
    head += [
        "collisions",
        "fault of the ego",
        "ended by the controller",
        "came to nothing",
        *(f"{own.label}, ms" for own in timed),
    ]
    ranked = sorted(
        comparison.standings,
        key=lambda own: [_over_all(own, name) for name in (metric.name, SECOND)],
        reverse=True,
    )
    body = [
        [
            standing.controller,
            str(standing.trials),
            _estimate(standing.estimates[metric.name]),
            shown(_sum(standing.estimates[metric.name])),
            _estimate(standing.estimates[SECOND]),
            *(
                [_clean(standing), *(_share(standing.verdicts.get(name)) for name in verdicts)]
                if judged
                else []
            ),
            str(standing.collisions),
            str(standing.faults["the ego"] + standing.faults["both"]),
            str(standing.ended.count),
            str(sum(standing.ends[end].count for end in rows.NOTHING if end in standing.ends)),
            *(_milliseconds(standing.estimates[own.name].mean) for own in timed),
        ]
        for standing in ranked
    ]
    count = comparison.campaign.cells[0].count
    fewer = "" if count == suite.trials else f", {count} of {suite.trials} trials of each combination"
    told = f"# {suite.name}{fewer}\n\n{suite.model.title}. Hash `{suite.hash}`."
    return f"{told}\n\n{markdown_table(head, body)}\n{NOTE}\n"


def _over_all(standing: Standing, name: str) -> float:
    """Return the mean of a column over all trials; one that came to nothing counts 0, so no crash hides a trial."""
    found = standing.estimates[name]
    return (found.mean or 0.0) * found.count / max(1, standing.trials)


def _sum(estimate: Estimate) -> float | None:
    return None if estimate.mean is None else estimate.mean * estimate.count


def _milliseconds(seconds: float | None) -> str:
    return shown(None if seconds is None else 1e3 * seconds)


def _estimate(estimate: Estimate) -> str:
    ends = estimate.mean_interval
    return shown(estimate.mean) + ("" if ends is None else f" [{shown(ends[0])}, {shown(ends[1])}]")


def _clean(standing: Standing) -> str:
    return _share(standing.clean) + told_cut(standing.cut)


def _share(share: Share | None) -> str:
    if share is None or share.share is None or share.interval is None:
        return shown(None)
    return f"{share.share:.1%} [{share.interval[0]:.1%}, {share.interval[1]:.1%}]"
