"""Quantitative robustness: by how much a formula holds on signals, in the units of the signals.

Each proposition is a real-valued signal that is positive where it holds: a distance to what is forbidden, the time
that is left. And is the least, or the greatest, not the negative; a positive value of a formula means that it holds,
a negative one that it doesn't, and changing every signal by less than the absolute value leaves it so (Fainekos and
Pappas, 2009; Donzé and Maler, 2010). Signals end: nothing is eventually so beyond the end, everything always. For
safety and bounded formulas the value at frame 0 is final once the bounds have passed; for others it is the value so
far.

What may come after the end is left open by `outlook`: the least and the greatest value that any continuation can give
(J. Deshmukh, A. Donzé, S. Ghosh, X. Jin, G. Juniwal, S. Seshia, "Robust online monitoring of signal temporal logic",
Formal Methods in System Design 51, 2017). If the greatest is negative, every continuation breaks the formula.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.logic.formula import Formula, FormulaError, Op, subformulas, ticks


class Beyond(NamedTuple):
    """What stands for what comes after the end: under *some* time (F, U, X, M), and under *every* time (G, R, W)."""

    some: float
    every: float

    @property
    def dual(self) -> Beyond:
        """The same of the negation."""
        return Beyond(-self.every, -self.some)


OVER: Final = Beyond(-np.inf, np.inf)
"""Nothing comes any more."""
WORST: Final = Beyond(-np.inf, -np.inf)
BEST: Final = Beyond(np.inf, np.inf)


def robustness(formula: Formula, signals: Mapping[str, Floats], period: float) -> Floats:
    """Return the robustness of a formula at every frame.

    Parameters
    ----------
    formula : Formula
        Any; past operators look at the frames before.
    signals : mapping of str to (..., K) float64
        One signal per proposition, all of one shape; the last axis is time, no value is NaN.
    period : float
        Seconds between frames.

    Returns
    -------
    (..., K) float64
        In the units of the signals; infinite where the signals don't matter.

    Raises
    ------
    FormulaError
        If a proposition has no signal.
    """
    shape = _shape(signals)
    values: dict[Formula, Floats] = {}
    for part in subformulas(formula):
        if part.op in (Op.PROP, Op.TRUE, Op.FALSE):
            values[part] = _known(part, signals, shape)
        else:
            values[part] = _value(part, [values[arg] for arg in part.args], period, OVER)
    return values[formula]


def outlook(formula: Formula, signals: Mapping[str, Floats], period: float) -> tuple[Floats, Floats]:
    """Return bounds of the robustness of a formula at every frame, whatever comes after the signals.

    Parameters
    ----------
    formula, signals, period
        As of `robustness`.

    Returns
    -------
    ((..., K) float64, (..., K) float64)
        The least and the greatest value, perhaps wider than what there is. Where the greatest is negative at frame 0,
        every continuation breaks the formula; where the least is positive, none does.

    Raises
    ------
    FormulaError
        If a proposition has no signal.
    """
    shape = _shape(signals)
    least: dict[Formula, Floats] = {}
    most: dict[Formula, Floats] = {}
    for part in subformulas(formula):
        if part.op in (Op.PROP, Op.TRUE, Op.FALSE):
            least[part] = most[part] = _known(part, signals, shape)
            continue
        low, high = [least[arg] for arg in part.args], [most[arg] for arg in part.args]
        if part.op is Op.NOT:
            low, high = high, low
        elif part.op is Op.IMPLIES:
            low[0], high[0] = high[0], low[0]
        if part.op is Op.IFF:
            least[part], most[part] = _either(low, high)
        else:
            least[part], most[part] = _value(part, low, period, WORST), _value(part, high, period, BEST)
    return least[formula], most[formula]


def _either(low: list[Floats], high: list[Floats]) -> tuple[Floats, Floats]:
    """Return the bounds of an equivalence from those of its sides."""
    one, other = np.maximum(-high[0], low[1]), np.maximum(low[0], -high[1])
    least = np.minimum(one, other)
    one, other = np.maximum(-low[0], high[1]), np.maximum(high[0], -low[1])
    return least, np.minimum(one, other)


def _shape(signals: Mapping[str, Floats]) -> tuple[int, ...]:
    shapes = {np.shape(signal) for signal in signals.values()}
    if len(shapes) > 1:
        raise FormulaError("signals of different shapes", value=sorted(shapes), expected="one shape")
    return shapes.pop() if shapes else (1,)


def _known(part: Formula, signals: Mapping[str, Floats], shape: tuple[int, ...]) -> Floats:
    """Return the values of a proposition, or of a constant."""
    if part.op is not Op.PROP:
        return np.full(shape, np.inf if part.op is Op.TRUE else -np.inf)
    if part.name not in signals:
        raise FormulaError("no signal for a proposition", value=part.name, expected="one of the signals")
    return np.asarray(signals[part.name], dtype=np.float64)


def _value(part: Formula, args: list[Floats], period: float, beyond: Beyond) -> Floats:
    op, first, last = part.op, args[0], args[-1]
    if op is Op.AND:
        return np.minimum.reduce(args)
    if op is Op.OR:
        return np.maximum.reduce(args)
    if op is Op.NOT:
        return -first
    if op is Op.IMPLIES:
        return np.maximum(-first, last)
    if op is Op.IFF:
        return np.minimum(np.maximum(-first, last), np.maximum(first, -last))
    if op is Op.X:
        return _shifted(first, 1, beyond.some)
    if op in (Op.Y, Op.Z):
        return _shifted(first, -1, np.inf if op is Op.Z else -np.inf)
    if op in (Op.O, Op.H, Op.S, Op.T):
        return _past(op, first, last)
    span = None if part.bounds is None else tuple(ticks(bound, period) for bound in part.bounds)
    return _future(op, first, last, span, beyond)


def _past(op: Op, first: Floats, last: Floats) -> Floats:
    if op is Op.O:
        return np.maximum.accumulate(last, axis=-1)
    if op is Op.H:
        return np.minimum.accumulate(last, axis=-1)
    if op is Op.S:
        return _until(first[..., ::-1], last[..., ::-1], -np.inf)[..., ::-1]
    return -_past(Op.S, -first, -last)


def _future(op: Op, first: Floats, last: Floats, span: tuple[int, ...] | None, beyond: Beyond) -> Floats:
    if op is Op.F:
        return _eventually(first, span, beyond.some)
    if op is Op.G:
        return -_eventually(-first, span, -beyond.every)
    if op is Op.R:
        return -_future(Op.U, -first, -last, span, beyond.dual)
    if op is Op.W:
        return np.maximum(_until(first, last, beyond.some), -_eventually(-first, None, -beyond.every))
    if op is Op.M:
        return _until(last, np.minimum(first, last), beyond.some)
    if span is None:
        return _until(first, last, beyond.some)
    low, high = span
    held = _shifted(_until(first, last, beyond.some), low, beyond.some)
    if low > 0:
        held = np.minimum(held, -_eventually(-first, (0, low - 1), -beyond.every))
    return np.minimum(held, _eventually(last, (low, high), beyond.some))


def _until(first: Floats, last: Floats, beyond: float) -> Floats:
    out = np.empty_like(last)
    held = np.full(last.shape[:-1], beyond)
    for frame in range(last.shape[-1] - 1, -1, -1):
        held = np.maximum(last[..., frame], np.minimum(first[..., frame], held))
        out[..., frame] = held
    return out


def _eventually(signal: Floats, span: tuple[int, ...] | None, beyond: float) -> Floats:
    """Return the greatest value at the frames from t + a to t + b; windows are doubled until they are long enough."""
    if span is None:
        latest = np.maximum.accumulate(signal[..., ::-1], axis=-1)[..., ::-1]
        return np.maximum(latest, beyond)
    low, high = span
    wanted = min(high - low + 1, signal.shape[-1] + 1)
    width, best = 1, signal
    while width < wanted:
        more = min(width, wanted - width)
        best = np.maximum(best, _shifted(best, more, beyond))
        width += more
    return _shifted(best, low, beyond)


def _shifted(signal: Floats, count: int, beyond: float) -> Floats:
    """Return the signal `count` frames later, or earlier if negative; `beyond` stands for what there is none of."""
    out = np.full(signal.shape, beyond)
    size = signal.shape[-1]
    if count >= 0:
        out[..., : max(0, size - count)] = signal[..., count:]
    else:
        out[..., -count:] = signal[..., : max(0, size + count)]
    return out
