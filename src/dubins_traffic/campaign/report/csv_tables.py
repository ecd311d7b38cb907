"""The numbers of a report as CSV: a file for the controllers, one for their differences, one for the factors."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

from dubins_traffic.campaign.report.comparison import Comparison
from dubins_traffic.campaign.report.statistics import Estimate, Interval, Share, share

ESTIMATE = ("count", "mean", "mean_low", "mean_high", "median", "median_low", "median_high")
SHARE = ("count", "of", "share", "low", "high")


def csv_files(comparison: Comparison) -> dict[str, str]:
    """Return the files by name; floats read back to the same bits, 95 % intervals as low and high."""
    return {
        "controllers.csv": _csv_text(("controller", "metric", *ESTIMATE), _controllers(comparison)),
        "shares.csv": _csv_text(("controller", "of_what", "which", *SHARE), _shares(comparison)),
        "differences.csv": _csv_text(
            ("first", "second", "metric", *ESTIMATE, "first_larger", "first_smaller"),
            _differences(comparison),
        ),
        "factors.csv": _csv_text(
            ("factor", "value", "controller", "metric", *ESTIMATE[:4]), _factors(comparison)
        ),
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
            **{f"formula {name}": found for name, found in standing.formulas.items()},
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
