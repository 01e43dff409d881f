"""Compute sums and products in an emulated format, and compare their errors with the bounds.

Errors and bounds are compared as exact Fractions, so even the smallest violation counts.
"""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounded import BoundedError
from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.number_format import NumberFormat
from gpbnb.arithmetic.rational import column_sum_norm, integers
from gpbnb.arithmetic.rounding import Rounding


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
    """Add the (n,) terms from left to right, and evaluate the bounds of section 6.

    The bound "weights" multiplies each term by the number of roundings that it passes through: n - 1 for the first two,
    n + 1 - j for the j-th. "strict" is the same to every order.
    """
    terms, beta, n = x.to_fractions(), x.format.unit_roundoff, len(x)
    true, sizes, weights = sum(terms, start=Fraction(0)), abs(terms), [n - 1, *range(n - 1, 0, -1)]
    printed_1982 = (n - 1) * beta * abs(true)
    bounds = {
        "1982 (18)": printed_1982,
        "1984 (18)": printed_1982 + beta * sum((j - 2) * sizes[j - 1] for j in range(3, n + 1)),
        "1984 (18), coarse": printed_1982 + beta * (n - 1) * (n - 2) / 2 * max(sizes),
        "weights": beta * (weights @ sizes),
    }
    return _trial((x,), x.sum(), true, bounds, lambda: [gamma(w, beta) for w in weights] @ sizes)


def product_trial(x: FloatArray, y: FloatArray) -> Trial:
    """Multiply the (n,) factors from left to right, then divide by each of the (m,) divisors.

    The error is relative. The bounds are those of section 6.
    """
    roundings, beta = len(x) + len(y) - 1, x.format.unit_roundoff
    computed = x.prod()
    for divisor in y:
        computed = computed / divisor
    true = Fraction(math.prod(x.to_fractions())) / math.prod(y.to_fractions())
    bounds = {"1982 (20)": roundings * beta, "1984 (20)": (roundings + 2) * beta}
    error = abs(computed.to_fractions() / true - 1)
    return _trial((x, y), computed, true, bounds, lambda: gamma(roundings, beta), error)


def dot_trial(a: FloatArray, b: FloatArray) -> Trial:
    """Compute the inner product of two vectors (n,), with the bounds of section 9.1."""
    products, beta, n = a.to_fractions() * b.to_fractions(), a.format.unit_roundoff, len(a)
    bounds = {"(26)": beta * ([n, *range(n, 1, -1)] @ abs(products))}
    true = sum(products, start=Fraction(0))
    return _trial((a, b), a @ b, true, bounds, lambda: gamma(n, beta) * sum(abs(products)))


def matrix_sum_trial(a: FloatArray, b: FloatArray) -> Trial:
    """Add two matrices; the error is the norm (22) of the error matrix, and the bound is that of section 8."""
    true = a.to_fractions() + b.to_fractions()
    return _trial((a, b), a + b, true, {"(24)": a.format.unit_roundoff * column_sum_norm(true)})


def chain_trial(matrices: Sequence[FloatArray]) -> Trial:
    """Multiply matrices from left to right; the error is in norm (22), and the bounds are those of section 9.2.

    An entry of the product is a sum over paths, each with one entry from every factor. A path passes through at
    most as many roundings as all factors but the last have columns.
    """
    computed = functools.reduce(operator.matmul, matrices)
    wholes, units = zip(*(integers(matrix.to_fractions()) for matrix in matrices), strict=True)
    true = functools.reduce(operator.matmul, wholes) * math.prod(units)
    roundings, beta = sum(matrix.shape[1] for matrix in matrices[:-1]), computed.format.unit_roundoff
    norms = math.prod(column_sum_norm(matrix) for matrix in matrices)
    bounds = {"(31)": roundings * beta * column_sum_norm(true), "(32)": roundings * beta * norms}
    return _trial(tuple(matrices), computed, true, bounds, lambda: gamma(roundings, beta) * norms)


def example_trial(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> Trial:
    """Compute R = ABC + D, Examples 1 and 2 of section 9.2; the error is in norm (22)."""
    chain, beta = chain_trial([a, b, c]), a.format.unit_roundoff
    true = chain.true + d.to_fractions()
    last = beta * column_sum_norm(true)
    bounds = {
        "Examples": chain.bounds["(31)"] + beta * (column_sum_norm(chain.true) + column_sum_norm(d)),
        "corrected": chain.bounds["(32)"] + last,
    }
    if "strict" in chain.bounds:
        bounds["strict"] = (1 + beta) * chain.bounds["strict"] + last
    return _trial((a, b, c, d), chain.computed + d, true, bounds)


def _trial(
    inputs: tuple[FloatArray, ...],
    computed: FloatArray,
    true: Any,
    bounds: Mapping[str, Fraction],
    strict: Callable[[], Fraction] | None = None,
    error: Fraction | None = None,
) -> Trial:
    if error is None:
        difference = computed.to_fractions() - true
        error = column_sum_norm(difference) if computed.ndim else abs(difference)
    if strict:
        with contextlib.suppress(ValueError):  # gamma: with so few digits, so many roundings have no strict bound
            bounds = {**bounds, "strict": strict()}
    return Trial(computed.format, inputs, computed, true, error, bounds)


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
    return _numbers(fmt, kind, *_drawn(rng, fmt, shape, kind))


def _drawn(rng: np.random.Generator, fmt: FloatFormat, shape: tuple[int, ...], kind: str) -> Any:
    """Draw significands and exponents."""
    limit = fmt.base**fmt.precision
    significands = rng.integers(limit // fmt.base, limit, shape)
    if kind != "like signs":
        significands = significands * rng.choice([-1, 1], shape)
    far = fmt.precision if kind == "far exponents" else 0
    return significands, rng.integers(-far, far + 1, shape) if far else np.zeros(shape, np.int64)


def _numbers(fmt: FloatFormat, kind: str, significands: Any, exponents: Any) -> FloatArray:
    numbers = FloatArray.from_pairs(significands.astype(object), exponents.astype(object), fmt)
    if kind == "cancelling":
        head = numbers[..., :-1]
        last: Any = -head.sum(axis=-1)[..., np.newaxis]
        return cast(FloatArray, np.concatenate([head, last], axis=-1))
    return numbers


#: The formats of a survey, with few and with many digits, in the bases of old and new computers and in base 3.
SURVEYED = tuple(
    FloatFormat(base, precision, rounding)
    for base, precision in ((2, 3), (2, 11), (2, 24), (3, 3), (10, 2), (10, 4), (10, 8), (16, 6))
    for rounding in Rounding.documented()
)


@functools.cache
def survey(trial: str, repeats: int = 10, seed: int = 1984) -> tuple[Trial, ...]:
    """Run random trials of one computation over the formats :data:`SURVEYED`, several sizes and kinds of data."""
    sizes = (2, 3, 5, 10) if trial in ("sum", "product", "dot") else (1, 2, 3)
    # Factors cannot cancel in a product, and its divisors must not be zero.
    kinds = KINDS[:3] if trial == "product" else KINDS
    rng, trials = np.random.default_rng(seed), []
    compute, shapes = _TRIALS[trial]
    for fmt, size, kind in itertools.product(SURVEYED, sizes, kinds):
        drawn = [[_drawn(rng, fmt, shape, kind) for shape in shapes(size)] for _ in range(repeats)]
        inputs = [_numbers(fmt, kind, *map(np.stack, zip(*same, strict=True))) for same in zip(*drawn, strict=True)]
        trials += [compute(*given) for given in zip(*inputs, strict=True)]
    return tuple(trials)


#: The function of each trial, and the shapes of its inputs for a size.
_TRIALS: dict[str, tuple[Callable[..., Trial], Callable[[int], list[tuple[int, ...]]]]] = {
    "sum": (sum_trial, lambda n: [(n,)]),
    "product": (product_trial, lambda n: [(n,), (n // 2,)]),
    "dot": (dot_trial, lambda n: [(n,)] * 2),
    "matrix sum": (matrix_sum_trial, lambda n: [(n, n)] * 2),
    "chain": (lambda *matrices: chain_trial(matrices), lambda n: [(n, n)] * 4),
    "example": (example_trial, lambda n: [(n, n)] * 4),
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
