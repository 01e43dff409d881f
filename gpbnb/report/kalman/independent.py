"""Count random filters by model, because formats and forms of one model are not independent trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import scipy

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run
from gpbnb.report.confidence import interval
from gpbnb.report.kalman import ensembles, report_bounds
from gpbnb.report.kalman.exact_step import exact_step

#: Forms whose covariance is (I - KH)P, which (105) describes.
DESCRIBED = (Form.HUNG, Form.HUNG_SECOND_GAIN, Form.INNOVATION)


class ModelShare(NamedTuple):
    """Mean share of the formats in which a bound is exceeded, and its 95 % interval by model.

    `at_least_once` counts the models in which the bound is exceeded in some format.
    """

    bound: str
    form: Form
    models: int
    share: float
    low: float
    high: float
    at_least_once: int


def stored_shares(bound: str, form: Form) -> ModelShare:
    """Count the stored sweep by model; each model has its own seed and kind, and twelve formats.

    Parameters
    ----------
    bound : "105", "108" or "125".
    """
    if bound not in ("105", "108", "125"):
        raise ValueError(f"got bound {bound!r}; needed 105, 108 or 125")
    rows = ensembles.SWEEP.load().records(form=form.name.lower())
    each = np.array([int(row[f"violations_{bound}"]) / int(row["trials"]) for row in rows])
    half = float(scipy.stats.t.ppf(0.975, len(each) - 1) * each.std(ddof=1) / math.sqrt(len(each)))
    mean = float(each.mean())
    return ModelShare(bound, form, len(each), mean, max(0.0, mean - half), min(1.0, mean + half), int((each > 0).sum()))


class FirstStep(NamedTuple):
    """Number of models that exceed (105) in their first step, where its assumption of an exact covariance is true.

    `low` and `high` limit the probability, each with 95 % confidence.
    """

    kind: str
    models: int
    exceeded: int
    low: float
    high: float


def first_steps(fmt: FloatFormat, models: int, kinds: Sequence[str] = ensembles.KINDS) -> tuple[FirstStep, ...]:
    """Run one step of independent models in Hung's form, and compare it with (105).

    Parameters
    ----------
    fmt : one format, so that each model counts once.
    models : number of models of each kind, with seeds that the stored sweep does not use.
    """
    found = []
    for kind in kinds:
        first = ensembles.REPEATS
        exceeded = sum(_exceeds(kind, fmt, seed) for seed in range(first, first + models))
        found.append(FirstStep(kind, models, exceeded, *interval(exceeded, models)))
    return tuple(found)


def _exceeds(kind: str, fmt: FloatFormat, seed: int) -> bool:
    """Whether some entry of the first covariance exceeds (105); the measurement does not matter."""
    drawn, _ = ensembles.random_model(np.random.default_rng([seed, ensembles.KINDS.index(kind)]), kind)
    model = drawn.rounded(fmt)
    run = Run(model, fmt, Form.HUNG, (1,))
    run.take(np.zeros((1, model.m)))
    if run.stopped:
        return False
    exact: Any = exact_step(
        model.Phi[0], model.H[0], model.Q[0], model.R[0], model.x0, model.P0, np.full(model.m, Fraction(0), object)
    ).P
    bound = report_bounds.covariance_count(model.n, model.m) * fmt.unit_roundoff * abs(exact)
    return bool((abs(run.checkpoints().P[0] - exact) > bound).any())
