"""The plots of a report: what ranks, metrics against factors, shares of verdicts, collisions by fault."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from itertools import pairwise
from typing import Any

from dubins_traffic.campaign.report.comparison import RANKING, Comparison, Level, words
from dubins_traffic.errors import needs
from dubins_traffic.scoring.metric import Column
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.figures import METADATA, STYLE

GRID_COLOUR = "#E4E6EA"
DARK: Mapping[str, str] = {
    palette.INK_COLOUR: "#E8EAED",
    palette.FAINT_COLOUR: "#9AA4B0",
    GRID_COLOUR: "#2F363E",
    palette.EGO_COLOUR: "#2A8CD0",
    "#882255": "#C9669A",
}
"""Colours that are others on a dark ground, where the light ones can't be seen."""
LETTERS = 10.5
"""Size of all letters, in points: that of the page's text, 14 pixels."""
NARROW = 3.5
"""Width of a chart in inches: 336 pixels, which fit a page of 400."""
WIDE = 6.6
LONGEST_NAME = 20
DODGE = 0.16
"""Distance of the controllers beside one another, in distances of two values of a factor."""
MARKERS = "osD^vP*X"
VERDICTS: Mapping[str, str] = {
    "satisfied": palette.GOAL_COLOUR,
    "unfinished": "#56B4E9",
    "excused": "#E69F00",
    "violated": palette.CONTACT_COLOUR,
}
FAULTS: Mapping[str, str] = {"the ego": palette.CONTACT_COLOUR, "both": "#882255", "the other": "#56B4E9"}
FORMULA: Mapping[str, str] = {
    "true": palette.GOAL_COLOUR,
    "presumably true": "#56B4E9",
    "presumably false": "#E69F00",
    "false": palette.CONTACT_COLOUR,
}
_STYLE: Mapping[str, Any] = {
    **STYLE,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "font.size": LETTERS,
    "axes.titlesize": LETTERS,
    "axes.edgecolor": palette.FAINT_COLOUR,
    "axes.labelcolor": palette.INK_COLOUR,
    "text.color": palette.INK_COLOUR,
    "xtick.color": palette.FAINT_COLOUR,
    "ytick.color": palette.FAINT_COLOUR,
    "xtick.labelcolor": palette.INK_COLOUR,
    "ytick.labelcolor": palette.INK_COLOUR,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
}


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart: the stem of its file, its text for who can't see it, its height, and whether it has a wide form, too.

    `draw` draws it into axes of Matplotlib.
    """

    name: str
    alt: str
    draw: Callable[[Any], None]
    height: float = 2.6
    is_wide: bool = False

    @property
    def svg(self) -> str:
        """The chart for a narrow page, whose colours follow the reader's choice of a light or a dark ground."""
        return self._svg(NARROW)

    @property
    def wide_svg(self) -> str:
        """The chart for a wide page."""
        return self._svg(WIDE)

    @property
    def pdf(self) -> bytes:
        """The chart for a paper."""
        return self._drawn(WIDE if self.is_wide else NARROW, ".pdf")

    def _svg(self, width: float) -> str:
        return _themed(self._drawn(width, ".svg").decode())

    def _drawn(self, width: float, kind: str) -> bytes:
        matplotlib, made = figures()
        with matplotlib.rc_context(dict(_STYLE)):
            figure = made.Figure(figsize=(width, self.height), layout="constrained")
            self.draw(figure.add_subplot())
            stream = io.BytesIO()
            figure.savefig(stream, format=kind[1:], metadata=METADATA[kind], transparent=True)
        return stream.getvalue()


def ranking(comparison: Comparison) -> Chart:
    """Return the chart of what ranks: the mean of each controller with its 95 % interval, the best above."""
    standings = comparison.standings

    def draw(axes: Any) -> None:
        for which, metric in enumerate(RANKING):
            for k, standing in enumerate(standings):
                estimate = standing.estimates.get(metric.name)
                if estimate is None or estimate.mean is None or estimate.mean_interval is None:
                    continue
                low, high = estimate.mean_interval
                axes.errorbar(
                    [estimate.mean],
                    [k + 0.28 * (which - 0.5)],
                    xerr=[[max(0.0, estimate.mean - low)], [max(0.0, high - estimate.mean)]],
                    color=colour(k),
                    marker="os"[which],
                    markerfacecolor=colour(k) if which == 0 else "none",
                    markersize=6.0,
                    linestyle="none",
                    elinewidth=1.4,
                    capsize=3.0,
                )
        axes.set_yticks(range(len(standings)), [_short(standing.controller) for standing in standings])
        axes.set_ylim(len(standings) - 0.5, -0.5)
        axes.set_xlim(left=min(0.0, axes.get_xlim()[0]))
        axes.set_xlabel("a trial, mean with 95 % interval")
        axes.grid(axis="x", color=GRID_COLOUR, linewidth=0.8)
        axes.set_axisbelow(True)
        for metric, marker, fill in zip(RANKING, "os", (palette.FAINT_COLOUR, "none"), strict=True):
            axes.plot([], [], marker=marker, markerfacecolor=fill, color=palette.FAINT_COLOUR, linestyle="none",
                      label=metric.label)  # fmt: skip
        _legend(axes, len(RANKING))

    names = " and ".join(metric.label for metric in RANKING)
    return Chart("ranking", f"Mean {names} of each controller", draw, 1.5 + 0.5 * len(standings), is_wide=True)


def against(comparison: Comparison, factor: str, metric: Column) -> Chart:
    """Return the plot of a metric's mean against a factor, with 95 % intervals, a line a controller."""
    levels = [level for level in comparison.levels if level.factor == factor and level.metric is metric]
    values = list(comparison.factors[factor])
    places = _places(values)
    step = min((b - a for a, b in pairwise(places)), default=1.0)

    def draw(axes: Any) -> None:
        controllers = comparison.controllers
        for k, controller in enumerate(controllers):
            shown = [level for level in levels if level.controller == controller]
            shift = DODGE * step * (k - 0.5 * (len(controllers) - 1))
            _line(axes, [place + shift for place in places], shown, k)
        axes.set_xticks(places, values)
        axes.set_xlim(places[0] - 0.5 * step, places[-1] + 0.5 * step)
        if max(len(value) for value in values) * len(values) > 30:
            axes.tick_params(axis="x", labelrotation=20.0)
        axes.set_xlabel(words(factor))
        _show_zero(axes, levels)
        axes.set_title(metric.heading, loc="left", fontweight="bold")
        axes.grid(axis="y", color=GRID_COLOUR, linewidth=0.8)
        axes.set_axisbelow(True)

    stem = re.sub(r"\W+", "-", f"{metric.name}-against-{factor}").strip("-")
    return Chart(stem, f"{metric.heading} against {words(factor)}", draw)


def verdicts(comparison: Comparison) -> Chart:
    """Return the shares of the verdicts as bars."""
    rows = {
        standing.controller: {name: standing.verdicts[name].share or 0.0 for name in VERDICTS}
        for standing in comparison.standings
        if standing.verdicts
    }
    return _bars("verdicts", "Shares of the verdicts", rows, VERDICTS, "share of the judged trials", percent=True)


def formula(comparison: Comparison, name: str, number: int) -> Chart:
    """Return the shares of the verdicts on a formula of the user's own, the report's `number`th, as bars."""
    rows = {
        standing.controller: {held: one.share or 0.0 for held, one in standing.formulas[name].items()}
        for standing in comparison.standings
        if name in standing.formulas
    }
    return _bars(
        f"formula-{number}",
        f"Verdicts on {name}",
        rows,
        FORMULA,
        f"{_short(name)}:\nshare of the trials",
        percent=True,
    )


def says_nothing(comparison: Comparison, factor: str, metric: Column) -> bool:
    """Tell whether the plot of a metric against a factor would show nothing: it is 0 or absent everywhere."""
    levels = (level for level in comparison.levels if level.factor == factor and level.metric is metric)
    return not any(level.estimate.mean for level in levels)


def no_faults(comparison: Comparison) -> bool:
    """Tell whether no controller had a collision, so that there is nothing to show of whose fault it was."""
    return not any(standing.faults[name] for standing in comparison.standings for name in FAULTS)


def faults(comparison: Comparison) -> Chart:
    """Return the collisions per 100 trials by fault as bars."""
    rows = {
        standing.controller: {name: 100.0 * standing.faults[name] / max(1, standing.trials) for name in FAULTS}
        for standing in comparison.standings
    }
    return _bars("faults", "Collisions by fault", rows, FAULTS, "collisions of the ego in 100 trials", percent=False)


def colour(index: int) -> str:
    """Return the colour of the controller of a number."""
    return palette.car_colour(index)


def _places(values: Sequence[str]) -> list[float]:
    """Return where the values of a factor stand on their axis: numbers where they are, if they are not too uneven."""
    try:
        numbers = [float(value) for value in values]
    except ValueError:
        return [float(k) for k in range(len(values))]
    gaps = [b - a for a, b in pairwise(numbers)]
    even = bool(gaps) and min(gaps) > 0.1 * (numbers[-1] - numbers[0])
    return numbers if even else [float(k) for k in range(len(values))]


def _line(axes: Any, places: Sequence[float], levels: Sequence[Level], index: int) -> None:
    points = [
        (place, level.estimate.mean, level.estimate.mean_interval)
        for place, level in zip(places, levels, strict=True)
        if level.estimate.mean is not None and level.estimate.mean_interval is not None
    ]
    if not points:
        return
    x = [place for place, _, _ in points]
    y = [mean for _, mean, _ in points]
    low = [max(0.0, mean - interval[0]) for _, mean, interval in points]
    high = [max(0.0, interval[1] - mean) for _, mean, interval in points]
    axes.errorbar(
        x,
        y,
        yerr=[low, high],
        color=colour(index),
        marker=MARKERS[index % len(MARKERS)],
        markersize=4.5,
        linewidth=1.4,
        elinewidth=1.2,
        capsize=2.5,
    )


def _show_zero(axes: Any, levels: Sequence[Level]) -> None:
    """Give a metric that is the same everywhere, and not 0, an axis that shows how large it is."""
    means = {level.estimate.mean for level in levels}
    if len(means) == 1 and None not in means:
        value = float(means.pop() or 0.0)
        low, high = min(0.0, 1.1 * value), max(0.0, 1.1 * value)
        axes.set_ylim(low - 0.05 * (high - low), high)


def _short(name: str) -> str:
    """Return a name that stands beside a chart; of one that is too long its end, which says the class."""
    return name if len(name) <= LONGEST_NAME else "\N{HORIZONTAL ELLIPSIS}" + name[1 - LONGEST_NAME :]


def _legend(axes: Any, entries: int) -> None:
    """Put the legend above the axes: on a narrow chart two entries in a row, long ones below one another.

    On a narrow chart it ends where the axes end, since long names beside them leave it no room on their right.
    """
    narrow = axes.figure.get_figwidth() <= NARROW
    longest = max((len(text) for text in axes.get_legend_handles_labels()[1]), default=0)
    most = (1 if longest > 16 else 2) if narrow else entries
    axes.legend(
        loc="lower right" if narrow else "lower left",
        bbox_to_anchor=(1.0, 1.0) if narrow else (0.0, 1.0),
        ncols=most,
        frameon=False,
        handlelength=1.0,
        borderpad=0.1,
    )


def _bars(
    name: str,
    alt: str,
    rows: Mapping[str, Mapping[str, float]],
    colours: Mapping[str, str],
    label: str,
    *,
    percent: bool,
) -> Chart:
    names = list(rows)

    def draw(axes: Any) -> None:
        left = [0.0] * len(names)
        for part, fill in colours.items():
            widths = [rows[name][part] for name in names]
            axes.barh(range(len(names)), widths, left=left, color=fill, height=0.6, label=part)
            for k, width in enumerate(widths):
                if percent and width > (0.08 if axes.figure.get_figwidth() > NARROW else 0.2):
                    axes.text(left[k] + 0.5 * width, k, f"{width:.0%}", ha="center", va="center", color="white")
            left = [start + width for start, width in zip(left, widths, strict=True)]
        axes.set_yticks(range(len(names)), [_short(name) for name in names])
        axes.invert_yaxis()
        axes.set_xlabel(label)
        if percent:
            axes.set_xlim(0.0, 1.0)
            axes.xaxis.set_major_formatter(import_module("matplotlib.ticker").PercentFormatter(1.0))
        else:
            axes.set_xlim(0.0, max(1.0, *(1.05 * value for value in left)))
        _legend(axes, len(colours))

    return Chart(name, alt, draw, 1.35 + 0.4 * len(names), is_wide=True)


def figures() -> tuple[Any, Any]:
    """Return the module matplotlib, and that of its figures.

    Raises
    ------
    MissingExtraError
        Without the extra `campaign`.
    """
    with needs("a report", "campaign"):
        return import_module("matplotlib"), import_module("matplotlib.figure")


def _themed(svg: str) -> str:
    """Return a picture whose colours follow the reader's choice of a light or a dark ground."""
    names = {light: f"--c{number}" for number, light in enumerate(DARK)}
    for light, name in names.items():
        svg = re.sub(re.escape(light) + r"\b", f"var({name})", svg, flags=re.IGNORECASE)
    variables = "".join(f"{names[light]}:{light};" for light in DARK)
    other = "".join(f"{names[light]}:{dark};" for light, dark in DARK.items())
    style = f"<style>:root{{{variables}}}@media(prefers-color-scheme:dark){{:root{{{other}}}}}</style>"
    head, start, rest = svg.partition("<svg")
    tag, close, body = rest.partition(">")
    return f"{head}{start}{tag}{close}\n{style}{body}"
