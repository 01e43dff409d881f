"""Instances in which printed relations are evaluated, and the judgement of relations over many instances.

Every name in a relation gets a value that is computed without the relation: by exact arithmetic, in an emulated format,
or from independent rounding errors. A bound is judged right if it holds in all instances and some instance attains it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.ledger.formula import Link, Relation
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.rounding import experiment

Names = Mapping[str, Any]

BETA = Fraction(1, 10**40)
"""Unit roundoff of the instances for first-order statements, so small that its square is negligible."""
SECOND_ORDER = Fraction(1, 10**60)
"""Differences below this value are of second order in :data:`BETA`, because the data are of order one."""
ATTAINED = Fraction(99, 100)
"""A bound counts as attained if the value reaches this share of it."""


# -- judging relations over instances -------------------------------------------------------------


@dataclass(frozen=True)
class RelationOutcome:
    """The outcome of some relations in all instances.

    Parameters
    ----------
    instances : number of instances.
    violated : number of instances in which a comparison fails.
    loose : printed inequalities that no instance attains.
    """

    instances: int
    violated: int
    loose: tuple[int, ...]

    @property
    def holds(self) -> bool:
        """Whether every comparison holds in every instance."""
        return self.violated == 0

    @property
    def right(self) -> bool:
        """Whether the relations hold and every bound is attained, so that no bound can be tightened."""
        return self.holds and not self.loose

    @property
    def count(self) -> str:
        """Number of instances in which the relations hold."""
        if self.holds:
            return f"holds in all {self.instances} instances"
        return f"holds in {self.instances - self.violated} of {self.instances} instances"

    def __str__(self) -> str:
        if not self.loose:
            return self.count
        never = f"{'the bound is' if len(self.loose) == 1 else 'the bounds are'} never attained"
        return f"{self.count}, {'but' if self.holds else 'and'} {never}"


def relations(printed: Statement) -> tuple[Relation, ...]:
    """Return the relations of a statement, without products with dots, which cannot be evaluated."""
    return tuple(part for part in printed.parts if isinstance(part, Relation) and "*...*" not in part.text)


def judge(found: Iterable[Relation], instances: Iterable[Names], first_order: bool = False) -> RelationOutcome:
    """Evaluate relations in all instances.

    Parameters
    ----------
    found : printed relations.
    instances : the values of their names; where ``tight`` is true, the first bound of each relation must be attained.
    first_order : whether differences of second order are allowed; ``≈`` always allows them.
    """
    found = tuple(found)
    count = violated = 0
    attained: dict[int, bool] = {}
    missed: set[int] = set()
    for names in instances:
        links = [(k, link) for k, relation in enumerate(found) for link in relation.links(names, number=lambda q: q)]
        count += 1
        violated += not all(link_holds(link, first_order) for _, link in links)
        bounds = {i: (k, _attains(link)) for i, (k, link) in enumerate(links) if link.symbol not in ("==", "≈")}
        for i, (_, reached) in bounds.items():
            attained[i] = attained.get(i, False) or reached
        if names.get("tight"):
            first = {k: i for i, (k, _) in reversed(bounds.items())}
            missed |= {i for i in first.values() if not bounds[i][1]}
    return RelationOutcome(count, violated, tuple(i for i, reached in attained.items() if not reached or i in missed))


def link_holds(link: Link, first_order: bool = False) -> bool:
    """Whether a comparison holds, exactly or to first order; < and > then need a difference of first order."""
    left, right = _entries(link.left), _entries(link.right)
    if left.shape != right.shape:
        return False
    slack = SECOND_ORDER if first_order or link.symbol == "≈" else 0
    difference = left - right
    match link.symbol:
        case "==" | "≈":
            return bool(np.all(abs(difference) <= slack))
        case "!=":
            return bool(np.any(abs(difference) > slack))
        case "<=" | ">=":
            return bool(np.all(difference <= slack if link.symbol == "<=" else difference >= -slack))
        case _:
            return bool(np.all(difference < -slack if link.symbol == "<" else difference > slack))


def _attains(link: Link) -> bool:
    smaller, larger = (link.left, link.right) if link.symbol in ("<=", "<") else (link.right, link.left)
    a, b = _entries(smaller), _entries(larger)
    if a.shape != b.shape:
        return False
    zero = link.symbol == ">="  # zero attains a bound of zero, but no other bound
    return any((y > 0 and x >= ATTAINED * y) or (zero and x == y) for x, y in zip(a.ravel(), b.ravel(), strict=True))


def _entries(value: Any) -> Any:
    return value.entries if isinstance(value, Matrix) else np.asarray(value, dtype=object)


class Matrix:
    """A matrix of exact numbers with ``*`` as matrix product; relations between matrices hold entry by entry."""

    def __init__(self, entries: Any) -> None:
        self.entries = exact(entries)

    def __add__(self, other: Matrix) -> Matrix:
        return Matrix(self.entries + other.entries)

    def __sub__(self, other: Matrix) -> Matrix:
        return Matrix(self.entries - other.entries)

    def __mul__(self, other: Any) -> Matrix:
        if isinstance(other, Matrix):
            return Matrix(self.entries @ other.entries)
        return Matrix(self.entries * Fraction(other))

    def __rmul__(self, factor: Any) -> Matrix:
        return Matrix(self.entries * Fraction(factor))

    def __abs__(self) -> Matrix:
        return Matrix(abs(self.entries))


class IndexedVector(dict[int, Fraction]):
    """A vector with indices from 1; ``a.T*b`` is the inner product."""

    @property
    def T(self) -> _Row:
        return _Row(self)


@dataclass(frozen=True)
class _Row:
    vector: IndexedVector

    def __mul__(self, other: IndexedVector) -> Fraction:
        return sum((self.vector[i] * other[i] for i in self.vector), start=Fraction(0))


def numbered(values: Sequence[Fraction]) -> IndexedVector:
    """Return values by their indices from 1."""
    return IndexedVector(enumerate(values, start=1))


def fractions(rng: np.random.Generator, count: int) -> list[Fraction]:
    """Draw random numbers of either sign between 1 and 10 in size, with three decimals."""
    numerators = rng.integers(1001, 9999, count) * rng.choice([-1, 1], count)
    return [Fraction(int(numerator), 1000) for numerator in numerators]


def small(rng: np.random.Generator, count: int) -> list[Fraction]:
    """Draw random rounding errors of at most :data:`BETA`."""
    return [BETA * Fraction(int(k), 1000) for k in rng.integers(-1000, 1001, count)]


# -- numbers and formats --------------------------------------------------------------------------

FOUR = FloatFormat(10, 4)
FOUR_CHOPPED = FloatFormat(10, 4, Rounding.CHOP)
FORMATS = ((10, 4), (2, 11), (3, 7), (16, 4))


@cache
def samples(base: int = 10, precision: int = 4) -> tuple[Fraction, ...]:
    """Return numbers of either sign whose tails v are random, zero, a half, and nearly one."""
    rng = np.random.default_rng(1982)
    smallest, unit = base ** (precision - 1), Fraction(1, base**5)
    heads = [smallest, smallest + 1, base * smallest - 1, *map(int, rng.integers(smallest, base * smallest, 5))]
    tails = [Fraction(0), Fraction(1, 2), 1 - unit, Fraction(1, 2) - unit]
    tails += [Fraction(int(k), 10**5) for k in rng.integers(1, 10**5, 2)]
    numbers = [(head + tail) / Fraction(base) ** precision for head in heads for tail in tails]
    signs, powers = rng.choice([-1, 1], len(numbers)), rng.integers(-6, 7, len(numbers))
    return tuple(x * int(s) * Fraction(base) ** int(k) for x, s, k in zip(numbers, signs, powers, strict=True))


@cache
def gap(base: int, precision: int) -> Fraction:
    """Find the distance from 1 to the next number of a format by trying."""
    fmt = FloatFormat(base, precision)
    step = Fraction(1, base ** (precision + 1))
    tried = (k * step for k in range(1, base**3 + 1))
    return next(distance for distance in tried if fmt.round(1 + distance) == 1 + distance)


def number_names(x: Fraction, base: int = 10, precision: int = 4) -> dict[str, Any]:
    """Return all quantities of sections 2 to 4 for a number: its split, rounded and chopped values, their errors."""
    fmt, chopping = FloatFormat(base, precision), FloatFormat(base, precision, Rounding.CHOP)
    u, v, e = fmt.split(x)
    rounded, chopped = fmt.round(x), chopping.round(x)
    return {
        "b": Fraction(base), "t": Fraction(precision), "e": Fraction(e), "u": u, "v": v, "x": x,
        "x_hat": rounded, "x_R": rounded, "x_tilde": rounded - x, "epsilon": abs(rounded / x - 1),
        "x_c": chopped, "x_tilde_c": chopped - x, "epsilon_c": abs(chopped / x - 1),
        "beta": gap(base, precision) / 2, "beta_c": gap(base, precision),
    }  # fmt: skip


@cache
def all_numbers() -> tuple[dict[str, Any], ...]:
    """Return the names of :func:`number_names` for all samples of all formats."""
    return tuple(number_names(x, b, t) for b, t in FORMATS for x in samples(b, t))


# -- random trials in emulated arithmetic ---------------------------------------------------------


@cache
def surveyed_bounds(trial: str) -> dict[str, experiment.BoundStatistics]:
    """Return the statistics of each bound over the survey of one kind of computation."""
    return {each.bound: each for each in experiment.bound_statistics(experiment.survey(trial))}


def surveyed(trial: str, bound: str) -> tuple[bool, str]:
    """Whether a survey found no violation of a bound, and its result."""
    found = surveyed_bounds(trial)[bound]
    return found.violations == 0, (
        f"{found.violations} violations in {found.trials} random trials, with a largest ratio of "
        f"error to bound of {found.largest:.3g}"
    )


# -- display --------------------------------------------------------------------------------------


def power(x: Fraction, digits: int = 4) -> str:
    r"""Format a number as the reports do, ``$.7655\times10^{3}$``."""
    u, _, e = FloatFormat(10, digits).split(x)
    return rf"${'-' if u < 0 else ''}.{int(abs(u) * 10**digits):0{digits}d}\times10^{{{e}}}$"


def split_text(x: Fraction) -> str:
    """Format the split (2) of a decimal number as the reports do."""
    u, v, e = FOUR.split(x)
    return rf"$u={float(u):g}$, $v={float(v):g}$, $e={e}$"
