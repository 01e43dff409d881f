"""Experiments: compute inverses in a format, with their true errors and every bound.

True errors are exact rationals, computed by python-flint, so even the smallest violation counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounded import BoundedError
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, rationals, true_inverse
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.inverse import a_posteriori, true_error
from gpbnb.report.inversion import bounds, procedure, theory
from gpbnb.report.stored_table import Column
from gpbnb.report.sweep import Sweep

# -- one inverse beside its bounds ----------------------------------------------------------------

#: Every reading of the printed procedure in the norm of the report.
PRINTED = tuple(reading for reading in procedure.readings() if reading.norm == "column sum")


@dataclass(frozen=True)
class InverseTrial(BoundedError):
    r"""One computed inverse: its matrix, its error and the bounds on that error, in the norm (22).

    `bounds` omits bounds that do not exist for this inverse. `condition` is :math:`\|A\|\|A^{-1}\|`.
    """

    family: str
    matrix: FloatArray
    computed: FloatArray
    pivot: bool
    condition: float
    error: Fraction
    bounds: Mapping[str, float]

    @property
    def regular(self) -> bool:
        """Whether the condition number is at most :data:`REGULAR` over β, which leaves at least two correct digits."""
        return self.condition * float(self.matrix.format.unit_roundoff) <= REGULAR


def trial(a: FloatArray, pivot: bool = True, names: Iterable[str] | None = None, family: str = "") -> InverseTrial:
    """Invert a matrix and evaluate bounds on the error of its inverse.

    Parameters
    ----------
    a : (n, n).
    names : names of bounds from :data:`PRINTED`, as text, and :data:`BETTER`; all by default.
    """
    inverse = true_inverse(a)
    wanted = ALL_BOUNDS if names is None else tuple(names)
    computing = _Computing(a, pivot)
    evaluated = {}
    for name in wanted:
        try:
            evaluated[name] = float(_BETTER[name](computing) if name in _BETTER else computing.printed[name])
        except ValueError:  # the bound does not exist here
            if name not in BETTER[1:]:
                raise
    error = true_error(computing.x, inverse)
    condition = float(column_sum_norm(rationals(a))) * float(column_sum_norm(inverse))
    return InverseTrial(family, a, computing.x, pivot, condition, error, evaluated)


class _Computing:
    """A matrix, its inverse and intermediate results, each computed once when it is needed."""

    def __init__(self, a: FloatArray, pivot: bool) -> None:
        self.a, self.pivot = a, pivot
        self.x = linalg.inv(a, pivot)
        self.beta = float(a.format.unit_roundoff)

    @cached_property
    def reduction(self) -> theory.Reduction:
        return procedure.as_floats(procedure.reduce(self.a, self.pivot))

    @cached_property
    def factors(self) -> linalg.LU:
        return linalg.lu(self.a, self.pivot)

    @cached_property
    def printed(self) -> dict[str, float]:
        """The bound in every reading of the printed procedure."""
        outcomes = procedure.evaluate_all(self.reduction, self.beta, PRINTED)
        return {str(one.reading): float(one.bound) for one in outcomes}


#: Other bounds, which are valid; see :func:`trial`.
_BETTER: dict[str, Callable[[_Computing], Any]] = {
    "corrected": lambda c: theory.bound(c.reduction, c.beta),
    "Wilkinson": lambda c: bounds.wilkinson(c.factors, c.x),
    "Higham": lambda c: bounds.higham(c.factors, c.x),
    "ball": lambda c: bounds.ball(c.a, c.x),
    "a posteriori": lambda c: a_posteriori(c.a, c.x),
}
BETTER = tuple(_BETTER)
ALL_BOUNDS = (*map(str, PRINTED), *BETTER)


# -- matrices -------------------------------------------------------------------------------------


def _uniform(n: int, rng: np.random.Generator) -> NDArray[Any]:
    """Draw entries from -1 to 1 in steps of 2**-30, which are the same on every machine."""
    return np.asarray(rng.integers(-(2**30), 2**30, (n, n)).astype(object) * Fraction(1, 2**30))


def _graded(n: int, rng: np.random.Generator) -> NDArray[Any]:
    rows, columns = (Fraction(10) ** -rng.permutation(n).astype(object) for _ in range(2))
    return rows[:, np.newaxis] * _uniform(n, rng) * columns


def _symmetric(n: int, rng: np.random.Generator) -> NDArray[Any]:
    a = _uniform(n, rng)
    return a + a.T


def _nearly_singular(n: int, rng: np.random.Generator) -> NDArray[Any]:
    """Draw a matrix whose last row is the sum of the others plus a thousandth of random numbers."""
    a = _uniform(n, rng)
    a[-1] = a[:-1].sum(axis=0) + a[-1] * Fraction(10.0**-3)
    return a


def _hilbert(n: int, rng: np.random.Generator) -> NDArray[Any]:
    return _table(n, lambda i, j: Fraction(1, i + j + 1))


def _wilkinson(n: int, rng: np.random.Generator) -> NDArray[Any]:
    """Return a randomly scaled Wilkinson matrix, whose last column doubles in each step of pivoted elimination."""
    a = _table(n, lambda i, j: Fraction(1) if i == j or j == n - 1 else Fraction(-1 if i > j else 0))
    scale = 1 + _uniform(n, rng)[0] / 1000
    return a * scale


def _frank(n: int, rng: np.random.Generator) -> NDArray[Any]:
    return _table(n, lambda i, j: Fraction(n - max(i, j)) if j >= i - 1 else Fraction(0))


def _kahan(n: int, rng: np.random.Generator) -> NDArray[Any]:
    """Return Kahan's upper triangular matrix: row i is s**i times (1, -c, -c, …), with s = 4/5 and c = 3/5."""
    s, c = Fraction(4, 5), Fraction(3, 5)
    return _table(n, lambda i, j: s**i * (1 if i == j else -c if j > i else 0))


def _table(n: int, entry: Callable[[int, int], Fraction]) -> NDArray[Any]:
    return np.array([[entry(i, j) for j in range(n)] for i in range(n)], dtype=object)


FAMILIES: dict[str, Callable[[int, np.random.Generator], NDArray[Any]]] = {
    "random": _uniform,
    "graded": _graded,
    "symmetric": _symmetric,
    "nearly singular": _nearly_singular,
    "Hilbert": _hilbert,
    "Wilkinson": _wilkinson,
    "Frank": _frank,
    "Kahan": _kahan,
}

#: Families whose matrices are the same at every draw.
FIXED = ("Hilbert", "Frank", "Kahan")


# -- sweeps ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InverseCell:
    """An independent part of a sweep, with its own seed.

    `sizes` are the numbers of rows, each drawn `repeats` times, or once if every draw gives the same matrix.
    """

    family: str
    fmt: FloatFormat
    pivot: bool
    sizes: tuple[int, ...]
    repeats: int
    seed: tuple[int, ...]

    def trials(self, names: Iterable[str] | None = None) -> Iterator[InverseTrial | None]:
        """Yield the trials one after the other; None if the matrix is singular in the format."""
        rng = np.random.default_rng(self.seed)
        for n in self.sizes:
            for _ in range(1 if self.family in FIXED else self.repeats):
                a = self.fmt.array(FAMILIES[self.family](n, rng))
                try:
                    yield trial(a, self.pivot, names, self.family)
                except np.linalg.LinAlgError:
                    yield None


SEED = 1984

#: The formats of the sweep over all readings and families, and of the sweep over random matrices.
VARIANT_FORMATS = (FloatFormat(10, 4), FloatFormat(10, 9), FloatFormat(2, 24), FloatFormat(10, 4, Rounding.CHOP))
RANDOM_FORMATS = (
    FloatFormat(2, 11),
    FloatFormat(2, 24),
    FloatFormat(2, 24, Rounding.CHOP),
    FloatFormat(10, 8),
    FloatFormat(16, 6, Rounding.CHOP),
)

#: Number of random inversions for each size and format.
RANDOM_SIZES = {n: 3000 if n <= 6 else 1010 if n <= 10 else 100 for n in range(2, 21)}


def variant_cells() -> list[InverseCell]:
    """Return the cells of the sweep over all families of matrices, n = 2 ... 20, with and without pivoting."""
    cases = product(FAMILIES, VARIANT_FORMATS, (False, True))
    sizes = tuple(range(2, 21))
    return [InverseCell(family, fmt, pivot, sizes, 10, (SEED, 0, i)) for i, (family, fmt, pivot) in enumerate(cases)]


def random_cells() -> list[InverseCell]:
    """Return the cells of the sweep over a hundred thousand random matrices, with pivoting."""
    cases = product(RANDOM_FORMATS, RANDOM_SIZES.items())
    return [InverseCell("random", fmt, True, (n,), many, (SEED, 1, i)) for i, (fmt, (n, many)) in enumerate(cases)]


#: Cells and bounds of each sweep whose results are kept in the package.
SWEEPS: dict[str, tuple[Callable[[], list[InverseCell]], tuple[str, ...]]] = {
    "variants": (variant_cells, ALL_BOUNDS),
    "random": (random_cells, BETTER[1:]),
}

_COUNTS = ("trials", "failed", "exact", "absent", "violations", "regular", "violations_regular", "tight")
COLUMNS = (
    *(Column(name, "text") for name in ("family", "format", "pivot", "n", "bound")),
    *(Column(name, "integer", 0) for name in _COUNTS),
    *(Column(name, low=0, optional=True) for name in ("smallest", "smallest_regular", "median", "largest")),
)
"""Columns of the stored sweeps; a ratio is empty if no inverse had an error.

`failed` counts matrices that are singular in the format. `exact` counts inverses without error, which have no ratio.
"""

TIGHT, REGULAR = 1.1, 0.01
"""A bound is tight if it is at most this many times the error; a matrix is regular, so that first-order analysis can be
expected to hold, if its condition number times the unit roundoff is at most this."""


Trials = list[list[Any] | None]
"""Trials of a cell: None for a matrix that is singular in the format, otherwise whether it is regular, whether its
inverse is exact, and for each bound that exists whether the error exceeds it, and bound / error."""


def computed(cell: InverseCell, *, names: Sequence[str]) -> Trials:
    """Compute the trials of a cell."""
    found: Trials = []
    for one in cell.trials(names):
        if one is None:
            found.append(None)
        else:
            ratios = {name: one.overestimation(name) if one.error else 0.0 for name in one.bounds}
            of_bounds = {name: [one.violates(name), ratio] for name, ratio in ratios.items()}
            found.append([one.regular, not one.error, of_bounds])
    return found


def lines(where: Sequence[str], trials: Trials, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return one row of text for each bound: counts, and four digits of the least, median and largest bound / error."""
    done, result = [one for one in trials if one is not None], []
    for name in names:
        present = [(regular, exact, *of[name]) for regular, exact, of in done if name in of]
        ratios = [ratio for _, exact, _, ratio in present if not exact]
        of_regular = [ratio for regular, exact, _, ratio in present if regular and not exact]
        counts = (
            len(done),
            len(trials) - len(done),
            sum(exact for _, exact, _ in done),
            len(done) - len(present),
            sum(violated for *_, violated, _ in present),
            sum(regular for regular, *_ in done),
            sum(regular and violated for regular, _, violated, _ in present),
            sum(ratio <= TIGHT for ratio in ratios),
        )
        pairs = ((np.min, ratios), (np.min, of_regular), (np.median, ratios), (np.max, ratios))
        result.append((*where, name, *map(str, counts), *(f"{f(given):.4g}" if given else "" for f, given in pairs)))
    return result


def rows(cell: InverseCell, trials: Trials, *, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the rows of a cell."""
    sizes = f"{cell.sizes[0]}-{cell.sizes[-1]}" if len(cell.sizes) > 1 else str(cell.sizes[0])
    where = cell.family, format_name(cell.fmt), "yes" if cell.pivot else "no", sizes
    return lines(where, trials, names)


def sums(results: Sequence[tuple[InverseCell, Trials]], *, names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return rows for each family, if there are several, and for all families together."""
    families: dict[str, Trials] = {}
    for cell, trials in results:
        families.setdefault(cell.family, []).extend(trials)
    groups = [*(families.items() if len(families) > 1 else ()), ("all", [one for _, each in results for one in each])]
    return [row for family, trials in groups for row in lines((family, "all", "all", "all"), trials, names)]


def format_name(fmt: FloatFormat) -> str:
    """Return base, precision and rounding in one word, as in "10:4:chop"."""
    return f"{fmt.base}:{fmt.precision}:{fmt.rounding.value}"


def stored_sweep(name: str) -> Sweep[InverseCell]:
    """Return one of the sweeps of :data:`SWEEPS`."""
    cells, names = SWEEPS[name]
    return Sweep(
        f"inversion/{name}",
        COLUMNS,
        5,
        cells,
        partial(computed, names=names),
        SEED,
        rows=partial(rows, names=names),
        summary=partial(sums, names=names),
    )
