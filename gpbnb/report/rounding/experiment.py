"""Compute sums and products in an emulated format, and compare their errors with the bounds.

Errors and bounds are compared as exact Fractions, so even the smallest violation counts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounded import BoundedError
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.rational import column_sum_norm, integers
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.rounding import theory
from gpbnb.report.rounding.paths import best_path, partial_sums, product_table

Bounds = Mapping[str, Callable[[], Fraction]]


@dataclass(frozen=True)
class Trial(BoundedError):
    """One computed result: its inputs, its error, and the bounds of that error.

    `bounds` omits a bound that does not exist because γ_n needs nβ < 1.
    """

    fmt: NumberFormat
    inputs: tuple[Any, ...]
    computed: Any
    true: Any
    error: Fraction
    bounds: Mapping[str, Fraction]


@dataclass(frozen=True)
class BoundStatistics:
    """How one bound compares with the errors of many trials."""

    bound: str
    trials: int
    violations: int
    largest: float
    median: float
    worst: Trial


def bound_statistics(trials: Sequence[Trial]) -> tuple[BoundStatistics, ...]:
    """Count the violations of each bound, in the order in which the names of the bounds appear."""
    names = list(dict.fromkeys(name for trial in trials for name in trial.bounds))
    result = []
    for name in names:
        having = [trial for trial in trials if name in trial.bounds]
        ratios = [trial.ratio(name) for trial in having]
        worst = having[int(np.argmax(ratios))]
        violations = sum(trial.violates(name) for trial in having)
        result.append(BoundStatistics(name, len(having), violations, max(ratios), float(np.median(ratios)), worst))
    return tuple(result)


# -- one computation beside its bounds ------------------------------------------------------------


def sum_trial(x: FloatArray) -> Trial:
    """Add the (n,) terms from left to right, and evaluate the bounds of section 6."""
    terms, beta = x.to_fractions(), x.format.unit_roundoff
    return _trial(
        (x,),
        x.sum(),
        sum(terms, start=Fraction(0)),
        {
            "1982 (18)": lambda: theory.printed_sum_bound_1982(terms, beta),
            "1984 (18)": lambda: theory.printed_sum_bound(terms, beta),
            "weights": lambda: theory.sum_bound(terms, beta),
            "strict": lambda: theory.strict_sum_bound(terms, beta),
        },
    )


def product_trial(x: FloatArray, y: FloatArray) -> Trial:
    """Multiply the (n,) factors from left to right, then divide by each of the (m,) divisors.

    The error is relative. The bounds are those of section 6.
    """
    fmt, n, m = x.format, len(x), len(y)
    computed = x.prod()
    for divisor in y:
        computed = computed / divisor
    true = Fraction(math.prod(x.to_fractions())) / math.prod(y.to_fractions())
    beta = fmt.unit_roundoff
    return _trial(
        (x, y),
        computed,
        true,
        {
            "1982 (20)": lambda: theory.product_bound(n, m, beta),
            "1984 (20)": lambda: theory.printed_product_bound(n, m, beta),
            "strict": lambda: theory.strict_product_bound(n, m, beta),
        },
        error=abs(computed.to_fractions() / true - 1),
    )


def dot_trial(a: FloatArray, b: FloatArray) -> Trial:
    """Compute the inner product of two vectors (n,), with the bounds of section 9.1."""
    fa, fb, beta = a.to_fractions(), b.to_fractions(), a.format.unit_roundoff
    return _trial(
        (a, b),
        a @ b,
        sum(fa * fb, start=Fraction(0)),
        {
            "(26)": lambda: theory.dot_bound(fa, fb, beta),
            "strict": lambda: theory.strict_dot_bound(fa, fb, beta),
        },
    )


def matrix_sum_trial(a: FloatArray, b: FloatArray) -> Trial:
    """Add two matrices; the error is the norm (22) of the error matrix, and the bounds are those of section 8."""
    fa, fb, beta = a.to_fractions(), b.to_fractions(), a.format.unit_roundoff
    return _trial((a, b), a + b, fa + fb, {"(24)": lambda: theory.matrix_sum_bound(fa, fb, beta)})


def chain_trial(matrices: Sequence[FloatArray]) -> Trial:
    """Multiply matrices from left to right; the error is in norm (22), and the bounds are those of section 9.2."""
    computed = matrices[0]
    for matrix in matrices[1:]:
        computed = computed @ matrix
    values = [matrix.to_fractions() for matrix in matrices]
    beta = computed.format.unit_roundoff
    return _trial(
        tuple(matrices),
        computed,
        theory.product(values),
        {
            "(31)": lambda: theory.printed_chain_claim(values, beta),
            "(32)": lambda: theory.chain_bound(values, beta),
            "strict": lambda: theory.strict_chain_bound(values, beta),
        },
    )


def example_trial(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Trial:
    """Compute R = ABC + D, Examples 1 and 2 of section 9.2; the error is in norm (22)."""
    fa, fb, fc, fd = (matrix.to_fractions() for matrix in (a, b, c, d))
    beta = a.format.unit_roundoff
    return _trial(
        (a, b, c, d),
        a @ b @ c + d,
        theory.product([fa, fb, fc]) + fd,
        {
            "Examples": lambda: theory.printed_example_bound(fa, fb, fc, fd, beta),
            "corrected": lambda: theory.example_bound(fa, fb, fc, fd, beta),
            "strict": lambda: theory.strict_example_bound(fa, fb, fc, fd, beta),
        },
    )


def _trial(
    inputs: tuple[FloatArray, ...],
    computed: FloatArray,
    true: Any,
    bounds: Bounds,
    error: Fraction | None = None,
) -> Trial:
    if error is None:
        difference = computed.to_fractions() - true
        error = column_sum_norm(difference) if computed.ndim else abs(difference)
    evaluated = {}
    for name, bound in bounds.items():
        try:
            evaluated[name] = bound()
        except ValueError:  # gamma: with so few digits, so many roundings have no strict bound
            if name != "strict":
                raise
    return Trial(computed.format, inputs, computed, true, error, evaluated)


# -- data -----------------------------------------------------------------------------------------

#: The kinds of random data; see :func:`random_numbers`.
KINDS = ("like signs", "mixed signs", "far exponents", "cancelling")


def random_numbers(
    rng: np.random.Generator, fmt: FloatFormat, shape: tuple[int, ...], kind: str = "mixed signs"
) -> FloatArray:
    """Draw numbers of a format with uniformly distributed significands.

    Of kind "like signs" they are positive and have one exponent. "mixed signs" draws either sign; "far exponents" also
    draws exponents over a range of twice the precision. "cancelling" draws mixed signs and replaces the last number
    along the last axis by minus the rounded sum of the others.
    """
    limit = fmt.base**fmt.precision
    significands = rng.integers(limit // fmt.base, limit, shape)
    if kind != "like signs":
        significands = significands * rng.choice([-1, 1], shape)
    far = fmt.precision if kind == "far exponents" else 0
    exponents = rng.integers(-far, far + 1, shape) if far else np.zeros(shape, np.int64)
    numbers = FloatArray.from_pairs(significands.astype(object), exponents.astype(object), fmt)
    if kind == "cancelling":
        head = numbers[..., :-1]
        last: Any = -head.sum(axis=-1)[..., np.newaxis]
        return cast(FloatArray, np.concatenate([head, last], axis=-1))
    return numbers


def sweep(trial: str, fmt: FloatFormat, sizes: Sequence[int], repeats: int, rng: np.random.Generator) -> list[Trial]:
    """Run random trials of one computation over several sizes and all :data:`KINDS` of data."""
    # Factors cannot cancel in a product, and its divisors must not be zero.
    kinds = KINDS[:3] if trial == "product" else KINDS
    trials = []
    for size in sizes:
        for kind in kinds:
            new = partial(_new, rng, fmt, kind)
            trials += [_DRAWS[trial](new, size) for _ in range(repeats)]
    return trials


#: The formats of a survey, with few and with many digits, in the bases of old and new computers and in base 3.
SURVEYED = tuple(
    FloatFormat(base, precision, rounding)
    for base, precision in ((2, 3), (2, 11), (2, 24), (3, 3), (10, 2), (10, 4), (10, 8), (16, 6))
    for rounding in Rounding.documented()
)


@cache
def survey(trial: str, repeats: int = 10, seed: int = 1984) -> tuple[Trial, ...]:
    """Run :func:`sweep` over all formats in :data:`SURVEYED`."""
    sizes = (2, 3, 5, 10) if trial in ("sum", "product", "dot") else (1, 2, 3)
    rng = np.random.default_rng(seed)
    return tuple(one for fmt in SURVEYED for one in sweep(trial, fmt, sizes, repeats, rng))


def _new(rng: np.random.Generator, fmt: FloatFormat, kind: str, *shape: int) -> FloatArray:
    return random_numbers(rng, fmt, shape, kind)


_DRAWS: dict[str, Callable[[Callable[..., FloatArray], int], Trial]] = {
    "sum": lambda new, n: sum_trial(new(n)),
    "product": lambda new, n: product_trial(new(n), new(n // 2)),
    "dot": lambda new, n: dot_trial(new(n), new(n)),
    "matrix sum": lambda new, n: matrix_sum_trial(new(n, n), new(n, n)),
    "chain": lambda new, n: chain_trial([new(n, n) for _ in range(4)]),
    "example": lambda new, n: example_trial(*(new(n, n) for _ in range(4))),
}


def sum_errors(fmt: FloatFormat, kind: str, n: int, repeats: int, rng: np.random.Generator) -> NDArray[np.float64]:
    r"""Return the signed errors of sums of n terms in units of :math:`\beta \sum_j |x_j|`, (repeats,).

    The terms are of a kind of :func:`random_numbers`, or of kind "constant" one number n times. The first-order bound
    is n - 1.
    """
    constant = kind == "constant"
    x: Any = random_numbers(rng, fmt, (repeats, 1 if constant else n), "like signs" if constant else kind)
    x = np.repeat(x, n, axis=1) if constant else x
    terms, unit = integers(x.to_fractions())
    computed = x.sum(axis=1).to_fractions() / unit - terms.sum(axis=1)
    return np.array(computed / (abs(terms).sum(axis=1) * fmt.unit_roundoff), dtype=np.float64)


# -- the worst case -------------------------------------------------------------------------------


def worst_product(fmt: FloatFormat, factors: int) -> Trial:
    """Find the factors whose product, from left to right, has the largest relative error of all.

    With unbounded exponents, only the significand of the partial product matters. Dynamic
    programming over significands therefore covers every chain.
    """
    base, t = fmt.base, fmt.precision
    start = np.arange(base ** (t - 1), base**t)
    significand, log_error = product_table(fmt)
    # State 0 is the number one; the first factor leads to its own significand without error.
    states = len(start)
    end = np.concatenate([[np.arange(1, states + 1)], significand - start[0] + 1])
    log_error = np.concatenate([np.zeros((1, states)), log_error])
    trials = []
    for sign in (1, -1):  # upward errors, downward errors
        path = best_path([sign * log_error] * factors, end)
        trials.append(product_trial(fmt.array([int(start[i]) for i in path]), fmt.array([])))
    return max(trials, key=lambda trial: trial.error)


def worst_sum(fmt: FloatFormat, terms: int, exponents: Sequence[int], products: bool = False) -> Trial:
    """Find the terms for which the error of a sum is largest relative to its first-order bound.

    Dynamic programming over partial sums covers every sequence of zeros and of terms ``±m * base**e`` with e in
    `exponents`. Dinkelbach's iteration maximizes the ratio of the error to the bound, "weights" or (26).
    """
    factors, sums = partial_sums(fmt, tuple(exponents), products)
    exact = np.array(list(factors), dtype=object)
    choices = fmt.array(exact)
    size = abs(exact).astype(np.float64)
    own_error = (choices.to_fractions() - exact).astype(np.float64)
    end, error = sums.table(terms)
    weights = theory.dot_weights(terms) if products else theory.sum_weights(terms)
    bound = "(26)" if products else "weights"
    best: Trial | None = None
    while True:
        price = float(fmt.unit_roundoff) * (best.ratio(bound) if best else 0.0)
        path = best_path([error + own_error - price * w * size for w in weights], end)
        pairs = [factors[exact[choice]] for choice in path]
        if products:
            trial = dot_trial(*(fmt.array(list(side)) for side in zip(*pairs, strict=True)))
        else:
            trial = sum_trial(fmt.array([term for term, _ in pairs]))
        if best and trial.ratio(bound) <= best.ratio(bound):
            return best
        best = trial


def tie_sum(fmt: FloatFormat, terms: int) -> Trial:
    r"""Sum 1, β, −β, …, −β, where each addition is a tie that rounds up by β.

    From 5 terms on, the error exceeds the bound of hung1984, ch. II, (18), in every precision, as long as
    (3n - 8)β < 4. Where the sum is nearly zero, it does so by a factor of nearly 2.
    """
    beta = fmt.unit_roundoff
    return sum_trial(fmt.array([1, beta, *[-beta] * (terms - 2)]))
