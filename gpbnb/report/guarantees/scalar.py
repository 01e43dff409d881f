r"""The true worst error of scalar filters in 3 to 6 bits, over all measurement sequences and for ever.

In a format with a range, the measurements within their limit and the estimates are finitely many numbers. After each
step, every number s that the estimate can be has a largest and a least possible error, and for the exact filter
:math:`x' = Fx + Kz` an error e of s becomes :math:`s' - F(s - e) - Kz`, which is monotone in e. So one table for each
step, from every pair of an estimate and a measurement to the next estimate, gives the largest and the least errors
exactly: this is dynamic programming. The tables hold what the emulated operations return, for every pair. The
exact filter's gains are computed with 400 bits after the point, and the errors in float64. Once the gains have settled,
the tables repeat. As :math:`|F| < 1`, the largest errors then converge, and the change of all later steps is bounded.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run
from gpbnb.report.display.tables import Table
from gpbnb.report.guarantees.random_filters import DETERMINISTIC
from gpbnb.report.sweep import Number, sweep_of_rows
from gpbnb.report.sweep import load as load_rows

FILTERS = 500
LONGEST = 400
"""Steps within which gains must settle and errors converge."""
CONVERGED = 1e-9
"""Largest share of the worst error that later steps may add."""


@dataclass(frozen=True, eq=False)
class ScalarFilter:
    """A filter with one state and one measurement, and the limit of its measurements, a number of the format."""

    model: LinearModel
    fmt: FloatFormat
    form: Form
    limit: Fraction


@dataclass(frozen=True, eq=False)
class Worst:
    """The largest error of a scalar filter, over all measurement sequences.

    Parameters
    ----------
    error : the largest error that is reached, at `step`.
    later : largest amount by which any later error exceeds it.
    history : (steps,), the largest error after each step.
    """

    error: float
    step: int
    later: float
    history: NDArray[np.float64]


def draw(seed: int) -> ScalarFilter:
    """Draw a scalar filter; its seed determines all random numbers."""
    rng = np.random.default_rng([37, seed])
    rounding = DETERMINISTIC[seed // len(WITH_PROGRAM) % len(DETERMINISTIC)]
    fmt = FloatFormat(2, int(rng.integers(3, 7)), rounding, -4, 5, bool(rng.integers(2)))
    sixteenths = rng.integers((-20, 1, 0, 1, 1), (21, 33, 51, 51, 51))
    Phi, H, Q, R, P0 = (exact([[int(each)]]) / 16 for each in sixteenths)
    model = LinearModel(Phi, H, Q, R, exact([0]), P0, name="a scalar filter")
    return ScalarFilter(
        model, fmt, WITH_PROGRAM[seed % len(WITH_PROGRAM)], fmt.round(Fraction(int(rng.integers(1, 65)), 16))
    )


def numbers(fmt: FloatFormat, most: Fraction) -> NDArray[np.float64]:
    """Return all numbers of a format with a range up to a size, in ascending order."""
    if fmt.emin is None or fmt.emax is None:
        raise ValueError(f"got {fmt}; needed a format with a range, which has finitely many numbers")
    unit = float(fmt.base) ** (fmt.emin - fmt.precision + 1)
    least = fmt.base ** (fmt.precision - 1)
    sizes = [np.arange(0 if fmt.subnormal else least, least) * unit]
    sizes += [np.arange(least, fmt.base * least) * unit * float(fmt.base) ** k for k in range(fmt.emax - fmt.emin + 1)]
    positive = np.concatenate(sizes)
    positive = positive[(positive > 0) & (positive <= float(most))]
    return np.concatenate([-positive[::-1], [0.0], positive])


def exact_gains(stored: LinearModel) -> Iterator[tuple[float, float]]:
    """Give the closed loop F and the gain K of each step of the exact filter."""
    Phi, H, Q, R, P = (each.flat[0] for each in (stored.Phi, stored.H, stored.Q, stored.R, stored.P0))
    while True:
        P = Phi * P * Phi + Q
        K = P * H / (H * P * H + R)
        P = (1 - K * H) * P
        yield float((1 - K * H) * Phi), float(K)
        P = Fraction(round(P * 2**400), 2**400)  # the length of an exact one grows in each step


def worst_error(given: ScalarFilter) -> Worst | None:
    """Find the largest error over all measurement sequences; None if gains or errors do not settle."""
    fmt = given.fmt
    run = Run(given.model, fmt, given.form, range(1, LONGEST + 1))
    run.take(np.zeros((LONGEST, 1)))
    if run.stopped:
        return None
    K = run.G.reshape(LONGEST, -1)[:, 0]
    stored = given.model.rounded(fmt)
    limits_of_range = fmt.limits
    s = numbers(fmt, limits_of_range.largest if limits_of_range else given.limit)
    z = numbers(fmt, given.limit)
    zero = len(s) // 2
    high, low = np.full(len(s), -np.inf), np.full(len(s), np.inf)
    high[zero] = low[zero] = 0.0
    tables: dict[float, NDArray[np.int64]] = {}
    best, at, late, history = 0.0, 0, 0, list[float]()
    before: tuple[float, float, float] | None = None
    for k, (F, gain) in zip(range(LONGEST), exact_gains(stored), strict=False):
        if K[k] not in tables:
            tables[K[k]] = following(given, stored, float(K[k]), s, z)
        new_high, new_low = _advanced(high, low, F, gain, tables[K[k]], s, z)
        worst = max(float(new_high.max()), -float(new_low.min()))
        history.append(worst)
        if worst > best:
            best, at = worst, k + 1
        now = (F, gain, float(K[k]))
        late = late + 1 if now == before else 0
        before = now
        if late and (np.isfinite(new_high) == np.isfinite(high)).all() and abs(F) < 1:
            known = np.isfinite(high)
            moved = np.abs(new_high[known] - high[known]), np.abs(new_low[known] - low[known])
            change = max(each.max() for each in moved)
            later = float(change) / (1 - abs(F))
            if later <= CONVERGED * best and (K[k:] == K[k]).all():
                return Worst(best, at, later, np.array(history))
        high, low = new_high, new_low
    return None


def following(
    given: ScalarFilter, stored: LinearModel, gain: float, s: NDArray[np.float64], z: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return the index of the next estimate for each estimate and measurement, as the emulated operations give it."""
    fmt = given.fmt
    Phi, H, K, x, column = (fmt.array(each) for each in (stored.Phi[0, 0, 0], stored.H[0, 0, 0], gain, s, z))
    reach = np.abs(s) <= float(np.abs(s).max()) / 8
    x = fmt.array(np.where(reach, s, 0.0))
    if given.form in (Form.HUNG, Form.HUNG_SECOND_GAIN):
        F = (fmt.array(1) - K * H) * Phi
        found = (F * x).reshape(-1, 1) + (K * column).reshape(1, -1)
    else:
        predicted = Phi * x
        innovation = column.reshape(1, -1) - (H * predicted).reshape(-1, 1)
        found = predicted.reshape(-1, 1) + K * innovation
    at = np.searchsorted(s, found.to_float())
    at[~reach] = -1
    return np.asarray(at, dtype=np.int64)


def _advanced(
    high: NDArray[np.float64],
    low: NDArray[np.float64],
    F: float,
    gain: float,
    table: NDArray[np.int64],
    s: NDArray[np.float64],
    z: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest and the least error of each estimate after one more step."""
    known = np.flatnonzero(np.isfinite(high))
    to = table[known]
    if (to < 0).any():
        raise OverflowError("got an estimate near the end of the range; needed a smaller limit of the measurements")
    largest, least = (high, low) if F >= 0 else (low, high)
    rest = s[to] - F * s[known, None] - gain * z[None, :]
    new_high, new_low = np.full(len(s), -np.inf), np.full(len(s), np.inf)
    np.maximum.at(new_high, to, rest + F * largest[known, None])
    np.minimum.at(new_low, to, rest + F * least[known, None])
    return new_high, new_low


# -- the stored table -------------------------------------------------------------------------------------------------


class ScalarRow(NamedTuple):
    """A scalar filter, its guarantee, and its worst error. `result` names what is missing, if anything is."""

    seed: int
    precision: int
    rounding: str
    subnormal: int
    form: str
    result: str
    steps: int
    bound: Number
    worst: Number
    ratio: Number


def examine(seed: int) -> ScalarRow:
    """Compute one row; its seed determines all random numbers."""
    given = draw(seed)
    fmt = given.fmt
    about = (seed, fmt.precision, fmt.rounding.value, int(fmt.subnormal), given.form.name.lower())
    within = limits(measurement=float(given.limit))
    try:
        found = guarantee(given.model, fmt, within, form=given.form, most=LONGEST)
    except (ValueError, ArithmeticError):
        return ScalarRow(*about, "no bound for ever", 0, "0", "0", "0")
    if not found.for_ever:
        return ScalarRow(*about, "no bound for ever", 0, "0", "0", "0")
    bound = float(found.bound[0])
    try:
        worst = worst_error(given)
    except OverflowError:
        return ScalarRow(*about, "leaves the range", 0, f"{bound:.6g}", "0", "0")
    if worst is None:
        return ScalarRow(*about, "not settled", 0, f"{bound:.6g}", "0", "0")
    ratio = (worst.error + worst.later) / bound if worst.error else 0.0
    return ScalarRow(*about, "compared", worst.step, f"{bound:.6g}", f"{worst.error:.6g}", f"{ratio:.4g}")


def _above(file: Path) -> list[str]:
    return [" ".join(map(str, row)) for row in load(file) if float(row.ratio) > 1]


SWEEP = sweep_of_rows("guarantees/scalar", ScalarRow, lambda: range(FILTERS), examine, faults=_above)
load = partial(load_rows, SWEEP, ScalarRow)


def table(rows: Sequence[ScalarRow]) -> Table:
    """Tabulate the distribution of worst error / bound by form."""
    header = ("form", "filters", "compared", "least", "lower quartile", "median", "upper quartile", "largest")
    body = []
    for form in WITH_PROGRAM:
        chosen = [row for row in rows if row.form == form.name.lower()]
        ratios = [float(row.ratio) for row in chosen if row.result == "compared"]
        spread = np.quantile(ratios, (0, 0.25, 0.5, 0.75, 1)) if ratios else ()
        body.append((str(form), str(len(chosen)), str(len(ratios)), *(f"{ratio:.3f}" for ratio in spread)))
    return Table("worst error over bound of scalar filters", header, tuple(body))
