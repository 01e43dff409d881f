"""Run many filters: models x formats x forms x seeds.

A few numbers define each trial, so it can run anywhere with the same result.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, cast, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import column_sum
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.emulation import History, emulate
from gpbnb.filters.forms import WITH_PROGRAM, Form
from gpbnb.filters.model import LinearModel
from gpbnb.report.kalman import report_bounds
from gpbnb.report.stored_table import Column
from gpbnb.report.sweep import Sweep, columns

#: The kinds of random models; see :func:`random_model`.
KINDS = ("stable", "oscillating", "drifting", "one sign", "far scales")

#: Formats with few and with many digits, in three bases, with both roundings.
FORMATS = tuple(
    FloatFormat(base, precision, rounding)
    for base, precision in ((2, 11), (2, 24), (2, 53), (10, 4), (10, 8), (16, 6))
    for rounding in Rounding.documented()
)

#: Number of repetitions of each combination, 34 x 5 x 12 x 5 = 10,200 trials.
REPEATS = 34

STEPS = 32
"""Steps of a trial."""


class Summary(NamedTuple):
    """Trials of one kind and form, and the largest error over each bound.

    Violations count trials with an error above the bound at any step; an infinite bound is not violated.
    `steps_bounded` is the mean share of steps at which the contraction bound is finite. `typical` is the geometric mean
    of error / contraction bound for the state after the last step, over the `compared` trials in which neither is zero.
    `state`, `gain` and `covariance` are the largest error / contraction bound, and `worst_105` and so on those of error
    / (105) of hung1984, ch. II. `indefinite` counts trials in which a variance or pivot was not positive.
    """

    kind: str
    form: str
    trials: int
    steps_bounded: float
    contraction_violations: int
    state: float
    gain: float
    covariance: float
    compared: int
    typical: float
    violations_105: int
    worst_105: float
    violations_108: int
    worst_108: float
    violations_125: int
    worst_125: float
    indefinite: int


def random_model(rng: np.random.Generator, kind: str) -> tuple[LinearModel, float]:
    """Draw a random model with 1 to 4 states and 1 or 2 measurements, and the size of its measurements.

    Parameters
    ----------
    kind : "stable" has poles anywhere within the unit circle, "oscillating" near the circle; "drifting" has chains of
        integrators, of which only the closed loop is stable; "one sign" has positive numbers and measurements, so that
        chopping errors always have the same sign; "far scales" is stable, with units of the states up to eight powers
        of ten apart and a precise first measurement, so that covariances cancel.
    """
    if kind not in KINDS:
        raise ValueError(f"got kind {kind!r}; needed one of {', '.join(KINDS)}")
    n, m = int(rng.integers(1, 5)), int(rng.integers(1, 3))
    Phi: Any = rng.standard_normal((n, n))
    H: Any = rng.standard_normal((m, n))
    if kind == "one sign":
        Phi, H = np.abs(Phi), np.abs(H)
    radius = float(np.abs(np.linalg.eigvals(Phi)).max())
    if kind == "drifting":
        Phi = np.eye(n) + np.diag(rng.uniform(0.01, 1, n - 1), 1)
        H[:, 0] += np.sign(H[:, 0])
    else:
        Phi *= rng.uniform(0.98, 0.999) / radius if kind == "oscillating" else rng.uniform(0.3, 0.95) / radius
    q = 10.0 ** rng.uniform(-4, 0, n)
    r: Any = 10.0 ** rng.uniform(-2, 1, m)
    P0 = 10.0 ** rng.uniform(-1, 2, n)
    scale: Any = np.ones(n)
    if kind == "far scales":
        scale, r = 10.0 ** rng.integers(-4, 5, n), r * np.array([1e-4, 1.0])[:m]
    model = LinearModel(
        Phi=_short(Phi * scale[:, np.newaxis] / scale),
        H=_short(H / scale),
        Q=np.diag(_short(q * scale**2)),
        R=np.diag(_short(r)),
        x0=_short(rng.standard_normal(n) * scale),
        P0=np.diag(_short(P0 * scale**2)),
        name=kind,
    )
    return model, float(10.0 ** rng.uniform(0, 2))


def _short(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round to six digits, which are the same on every machine."""
    return np.array([float(f"{value:.6g}") for value in values.flat]).reshape(values.shape)


def trial(kind: str, fmt: FloatFormat, form: Form, seed: int, steps: int = STEPS) -> Summary:
    """Draw a model of a kind and its measurements, run the filter, and compare it with its bounds."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    model, size = random_model(rng, kind)
    z = _short(size * rng.standard_normal((steps, model.m)))
    z = np.abs(z) if kind == "one sign" else z
    history = emulate(model, z, fmt, form, range(1, steps + 1), bounded=True)
    assert history.bounds is not None
    ratios = history.ratios()
    state, gain, covariance = (float(each) for each in (ratios.max(axis=0, initial=0.0) if len(ratios) else (0, 0, 0)))
    last = float(ratios[-1, 0]) if len(ratios) == steps else 0.0  # 0 if the bound is infinite
    of_covariance, of_gain, of_state = printed_ratios(history, float(fmt.unit_roundoff))
    return Summary(
        kind=kind,
        form=form.name.lower(),
        trials=1,
        steps_bounded=float(np.isfinite(history.bounds.state).all(axis=1).sum() / steps),
        contraction_violations=int(not all(ratio <= 1 for ratio in (state, gain, covariance))),
        state=state,
        gain=gain,
        covariance=covariance,
        compared=int(last > 0),
        typical=last or 1.0,
        violations_105=int(of_covariance > 1),
        worst_105=of_covariance,
        violations_108=int(of_gain > 1),
        worst_108=of_gain,
        violations_125=int(of_state > 1),
        worst_125=of_state,
        indefinite=int(history.indefinite is not None or history.stopped is not None),
    )


def printed_ratios(history: History, beta: float) -> tuple[float, float, float]:
    """Return the largest error / bound for (105) and (108) over all entries and steps, and for (125) over all steps."""
    c = len(history.steps)
    if not c:
        return 0.0, 0.0, 0.0
    true, n, m = history.reference, history.model.n, history.model.m
    x, K, P = (each[:c].astype(np.float64) for each in (true.x, true.K, true.P))
    with np.errstate(divide="ignore", invalid="ignore"):
        covariance = np.abs(history.covariance) / (report_bounds.covariance_count(n, m) * beta * np.abs(P))
        gain = np.abs(history.gain) / (report_bounds.gain_count(n, m) * beta * np.abs(K))
        return (
            _largest(covariance),
            _largest(gain),
            _largest(np.abs(history.state).max(axis=1) / _printed_state(history, beta, x, K)),
        )


def _printed_state(
    history: History, beta: float, x: NDArray[np.float64], K: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Evaluate (125) as printed after each step, with the least B of (122)."""
    model = cast(LinearModel, history.model)
    given = model.to_float()
    bounds, F, u = np.empty(len(x)), 0.0, 0.0
    for k in range(len(x)):
        phi, h = given["Phi"][k % len(given["Phi"])], given["H"][k % len(given["H"])]
        before = phi @ (x[k - 1] if k else given["x0"])
        loop = phi - K[k] @ (h @ phi)
        F = max(F, float(column_sum(loop)))
        # u = K z = x minus F times x of the previous step, (111)
        u = max(u, float(np.abs(x[k] - before + K[k] @ (h @ before)).max()))
        first, second = report_bounds.coefficients(k + 1, model.n, model.m)
        bounds[k] = beta * (first * np.abs(x[k]).max() + second * u * max(1.0, F**k))
    return bounds


def _largest(ratios: NDArray[np.float64]) -> float:
    """Return the largest of some ratios, where 0/0 is not a violation."""
    return float(np.nan_to_num(ratios, nan=0.0, posinf=np.inf).max(initial=0.0))


# -- what was found -----------------------------------------------------------------------------------


def merged(parts: Sequence[Summary]) -> tuple[Summary, ...]:
    """Return one summary for each kind and form, in order of appearance."""
    groups: dict[tuple[str, str], list[Summary]] = {}
    for part in parts:
        groups.setdefault((part.kind, part.form), []).append(part)
    return tuple(_merged(group) for group in groups.values())


def _merged(group: Sequence[Summary]) -> Summary:
    trials, compared = sum(each.trials for each in group), sum(each.compared for each in group)
    share = math.fsum(each.trials * each.steps_bounded for each in group) / trials
    logarithm = math.fsum(each.compared * math.log(each.typical) for each in group) / max(compared, 1)
    largest = {name: max(getattr(each, name) for each in group) for name in _LARGEST}
    counts = {name: sum(getattr(each, name) for each in group) for name in _COUNTED}
    return group[0]._replace(steps_bounded=share, typical=math.exp(logarithm), **largest, **counts)


_LARGEST = ("state", "gain", "covariance", "worst_105", "worst_108", "worst_125")
_COUNTED = (
    "trials", "contraction_violations", "compared", "violations_105", "violations_108", "violations_125", "indefinite"
)  # fmt: skip


def lines(seed: int, trials: Sequence[Summary]) -> list[tuple[str, ...]]:
    """Return the rows of ``ensembles.csv`` for the trials of one seed, with six significant digits."""
    return [
        (str(seed), *(f"{each:.6g}" if isinstance(each, float) else str(each) for each in summary))
        for summary in merged(trials)
    ]


#: Columns of ``ensembles.csv``.
COLUMNS = (Column("seed", "integer", 0), *columns(Summary))


def trials_of_seed(seed: int) -> list[tuple[str, ...]]:
    """Return the rows for one seed of the random filters."""
    return lines(seed, [trial(kind, fmt, form, seed) for kind, fmt, form in product(KINDS, FORMATS, WITH_PROGRAM)])


SWEEP = Sweep("kalman/ensembles", COLUMNS, 3, lambda: range(REPEATS), trials_of_seed)


@cache
def load(file: Path = SWEEP.file) -> tuple[Summary, ...]:
    """Load the sweep that ships with the package, for all seeds together."""
    types = get_type_hints(Summary).values()
    rows = SWEEP.load(file).rows
    return merged([Summary(*(kind(cell) for kind, cell in zip(types, row[1:], strict=True))) for row in rows])
