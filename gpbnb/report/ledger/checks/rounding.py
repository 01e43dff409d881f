"""Sections 1 to 9 of the chapters on rounding: true values of their names, by exact arithmetic and in short formats."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.arithmetic.bounds import gamma_probabilistic
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm, row_sum_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.derivation import hold
from gpbnb.report.ledger.first_order import FirstOrder, looked_up, quantity
from gpbnb.report.ledger.judge import read
from gpbnb.report.ledger.quantities import BETA, fractions, numbered, small
from gpbnb.report.ledger.statements import statement
from gpbnb.report.rounding import derivation, experiment

Names = Mapping[str, Any]

FOUR = FloatFormat(10, 4)
FOUR_CHOPPED = FloatFormat(10, 4, Rounding.CHOP)
FORMATS = ((10, 4), (2, 11), (3, 7), (16, 4))
HALF = Fraction(1, 2)


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


@cache
def derived(*names: str) -> bool:
    """Whether SymPy confirms some derivations."""
    return all(hold(getattr(derivation, name)()) for name in names)


# -- section 1: statistics or bounds --------------------------------------------------------------


@cache
def beyond_the_law() -> tuple[float, float]:
    """Return the shares of sums of 1000 varied or equal terms whose error exceeds a law meant to fail for 1 %."""
    fmt, n = FloatFormat(2, 11), 1000
    # Each of the n terms gets an equal share of the probability.
    law = gamma_probabilistic(n - 1, fmt.unit_roundoff, 0.01 / n) / float(fmt.unit_roundoff)
    varied, constant = (
        float(np.mean(abs(experiment.sum_errors(fmt, kind, n, 30, np.random.default_rng(1))) > law))
        for kind in ("like signs", "constant")
    )
    return varied, constant


def scatter(n: int) -> float:
    """Return the relative standard deviation of the sample standard deviation of n normal numbers."""
    mean = math.sqrt(2 / (n - 1)) * math.exp(math.lgamma(n / 2) - math.lgamma((n - 1) / 2))
    return math.sqrt(1 - mean**2)


@cache
def approach() -> Names:
    varied, constant = beyond_the_law()
    strict = surveyed_bounds("dot")["strict"]
    tight = "close to the actual error" if strict.median > 0.5 else "conservative though pessimistic"
    return {
        "statistics": "not sufficiently reliable" if max(varied, constant) > 0.01 else "sufficiently reliable",
        "bounds": "violated" if strict.violations else tight, "strict": strict, "varied": varied, "constant": constant,
    }  # fmt: skip


def reliability() -> Names:
    _, constant = beyond_the_law()
    strict = [surveyed_bounds(trial)["strict"] for trial in ("sum", "product", "dot", "chain")]
    violations, trials = (sum(getattr(each, name) for each in strict) for name in ("violations", "trials"))
    found = "more reliable" if violations / trials < 0.01 < constant else "less reliable"
    return {"reliability": found, "violations": violations, "trials": trials, "constant": constant,
            "chain": surveyed_bounds("chain")["(31)"]}  # fmt: skip


def lengths() -> Names:
    longer = [x for x in samples() if FOUR.round(x) != x and FOUR_CHOPPED.round(x) != x]
    products = [(x, y) for x in range(1000, 1030) for y in range(1001, 1031) if FOUR.round(x * y) != x * y]
    need = "requires either rounding or chopping" if longer and products else "works without rounding or chopping"
    return {"need": need, "longer": len(longer), "products": len(products)}


# -- sections 2 to 4: numbers and formats ---------------------------------------------------------


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


def number_names(x: Any, base: int = 10, precision: int = 4) -> dict[str, Any]:
    """Return all quantities of sections 2 to 4 for a number: its split, rounded and chopped values, their errors."""
    x, fmt, chopping = Fraction(x), FloatFormat(base, precision), FloatFormat(base, precision, Rounding.CHOP)
    u, v, e = fmt.split(x)
    rounded, chopped = fmt.round(x), chopping.round(x)
    return {
        "b": Fraction(base), "t": Fraction(precision), "e": Fraction(e), "u": u, "v": v, "x": x,
        "x_hat": rounded, "x_R": rounded, "x_tilde": rounded - x, "epsilon": abs(rounded / x - 1),
        "x_c": chopped, "x_tilde_c": chopped - x, "epsilon_c": abs(chopped / x - 1),
        "beta": gap(base, precision) / 2, "beta_c": gap(base, precision),
        "digits": "$t$" if (u * base**precision).denominator == 1 else "$t+1$",
        "sign": "similar" if u * v >= 0 else "opposite",
    }  # fmt: skip


@cache
def numbers() -> tuple[dict[str, Any], ...]:
    """Return the names of :func:`number_names` for all samples of all formats."""
    return tuple(number_names(x, b, t) for b, t in FORMATS for x in samples(b, t))


def _allowed_splits(names: Mapping[str, Any]) -> set[tuple[Any, Any, Any]]:
    """Return the splits of a number that (2) allows: truncated, or away from zero if that is near enough."""
    b, t, u, v, e = (names[letter] for letter in "btuve")
    size = 1 if names["x"] > 0 else -1
    away = (u + size / b**t, v - size, e)
    if abs(away[0]) == 1:  # a carry
        away = (size / b, away[1] / b, e + 1)
    return {(u, v, e), away} if abs(away[1]) < 1 else {(u, v, e)}


@cache
def splits() -> tuple[dict[str, Any], ...]:
    """Return all numbers, and splits of theirs that (2) must not allow: neither truncated nor near enough."""
    found = list(numbers())
    for names in numbers():
        b, t, e = (names[letter] for letter in "bte")
        allowed = _allowed_splits(names)
        for other in (e - 1, e, e + 1):
            whole = math.trunc(names["x"] / b**other * b**t)
            for k in range(whole - 3, whole + 4):
                split = (k / b**t, names["x"] / b**other * b**t - k, other)
                if split not in allowed:
                    found.append({**names, **dict(zip("uve", split, strict=True)), "holds": False})
    return tuple(found)


def infinite_digits() -> Names:
    """Square roots without finitely many digits, by a search for numbers with these squares."""
    places, bases = range(40), (2, 10, 16)
    squares = [(r"$\sqrt2$", 2), (r"$\sqrt4$", 4)]
    irrational = {
        phrase
        for phrase, r in squares
        if not any(math.isqrt(r * b ** (2 * k)) ** 2 == r * b ** (2 * k) for b in bases for k in places)
        and not sp.sqrt(r).is_rational
    }
    return {"example": irrational, "digits": "infinite" if irrational else "finite", "places": len(places)}


@cache
def dropped_term() -> Names:
    """Which term of (2) is dropped: the rounded number is the other one, up to a unit of the last digit."""
    units = [(names, names["b"] ** (names["e"] - names["t"])) for names in numbers()]
    first = all(abs((each["x_hat"] - each["u"] * each["b"] ** each["e"]) / unit) in (0, 1) for each, unit in units)
    second = all(abs((each["x_hat"] - each["v"] * unit) / unit) in (0, 1) for each, unit in units)
    return {"term": {name for name, dropped in (("second", first), ("first", second)) if dropped}}


def carry() -> Names:
    x = Fraction("99.996")
    changes = {FOUR.split(FOUR.round(each))[2] - FOUR.split(each)[2] for each in (x, *samples())}
    said = {"$b^e$": {0}, "$b^{e+1}$": {1}, "$b^e$ or $b^{e+1}$ after a carry": {0, 1}}
    return {"exponent": {phrase for phrase, found in said.items() if changes == found}, "before": FOUR.split(x)[2],
            "rounded": FOUR.round(x), "after": FOUR.split(FOUR.round(x))[2]}  # fmt: skip


def conventional() -> Names:
    """Count the numbers for which the printed rule (3) returns a nearest number, by their sign."""
    rule = statement("hung1984.II.eq3").relation()
    covered = {"negative": 0, "positive": 0}
    for names in numbers():
        (link,) = rule.links(names, number=lambda q: q)
        nearest = 2 * abs(link.right - names["x"]) <= names["b"] ** (names["e"] - names["t"])
        covered["positive" if names["x"] > 0 else "negative"] += nearest
    return {**covered, "numbers": "any number" if sum(covered.values()) == len(numbers()) else "positive numbers alone",
            "count": len(numbers())}  # fmt: skip


def signs() -> Names:
    products = {names["u"] * names["v"] > 0 for names in numbers() if names["v"]}
    found = {(True,): "the same sign", (False,): "opposite signs"}.get(tuple(products), "either sign")
    names = number_names("765.4567")
    return {"signs": found, "u": names["u"] + Fraction(1, 10**4), "v": names["v"] - 1}


def forms_of_a_number() -> list[dict[str, Any]]:
    """Return the ways in which (1) allows 100 and 765.4 to be written; those with |u| ≥ 1/b are splits (2)."""
    forms = []
    for x in (Fraction(100), Fraction("765.4")):
        _, _, least = FOUR.split(x)
        forms += [{"u": x / Fraction(10) ** e, "e": Fraction(e), "b": Fraction(10)} for e in range(least, least + 3)]
    return [{**form, "equation": "(2)"} for form in forms]


def combined() -> Names:
    """Which of the bounds (5) and (6) give (8)."""
    error, number = (statement(f"hung1984.II.eq{k}").relation().value() for k in (5, 6))
    bound = statement("hung1984.II.eq8").relation().sides[1].value()
    reasons = {"(5) and (6)": error / number, "(5) alone": error, "(6) alone": 1 / number}
    return {"bounds": {name for name, reason in reasons.items() if sp.simplify(reason - bound) == 0}}


def meaning_of_beta() -> Names:
    example = number_names("765.4567")
    absolute = max(abs(each["x_tilde"]) / each["beta"] for each in numbers())
    relative = max(each["epsilon"] / each["beta"] for each in numbers())
    bounds = {"absolute bound of": absolute <= 1, "absolute bound of the relative": relative <= 1}
    return {"bound": {name for name, right in bounds.items() if right}, "relative": relative,
            "error": abs(example["x_tilde"]), "beta": example["beta"]}  # fmt: skip


# -- the numbers of the worked examples -----------------------------------------------------------


def example(x: str, part: int = 0, right: Iterable[Names] = (), wrong: Iterable[Names] = ()) -> list[dict[str, Any]]:
    """Return the names of a number, and values for which one part of the statement must hold, or must not."""
    names = number_names(x)
    return [names, *({**names, **each, "part": part} for each in right),
            *({**names, **each, "part": part, "holds": False} for each in wrong)]  # fmt: skip


def below(error: str, bound: str, part: int = 1) -> list[dict[str, Any]]:
    """Return the names of 765.4567, whose printed error must be compared with this bound and no other."""
    size = number_names("765.4567")[error]
    return example("765.4567", part, [{bound: size * Fraction(1001, 1000)}], [{bound: size * Fraction(999, 1000)}])


def power(x: Fraction, digits: int = 4) -> str:
    r"""Format a number as the reports do, ``$.7655\times10^{3}$``."""
    u, _, e = FloatFormat(10, digits).split(FloatFormat(10, digits).round(x))
    return rf"${'-' if u < 0 else ''}.{int(abs(u) * 10**digits):0{digits}d}\times10^{{{e}}}$"


def split_text(x: Any) -> str:
    """Format the split (2) of a decimal number as the reports do."""
    u, v, e = FOUR.split(Fraction(x))
    return rf"$u={float(u):g}$, $v={float(v):g}$, $e={e}$"


def example_text(chopped: str = "") -> str:
    """Say the errors of 765.4567 as the reports do, rounded, or chopped for the letter c."""
    names, c, x = number_names("765.4567"), f"_{chopped}" if chopped else "", "x_c" if chopped else "\\hat x"
    return (
        f"$\\beta{c}={float(names[f'beta{c}']):g}$, ${x}=$ {power(names['x_c' if chopped else 'x_hat'])}, "
        f"$|\\tilde x{c}|={float(abs(names[f'x_tilde{c}'])):g}$, $\\epsilon{c}=$ {power(names[f'epsilon{c}'], 5)}"
    )


# -- section 5: one operation ---------------------------------------------------------------------

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv,
}  # fmt: skip


@cache
def operations() -> tuple[dict[str, Any], ...]:
    """Return single operations in four digits with their rounded results; some are ties just above a power of ten."""
    rng = np.random.default_rng(16)
    x = [Fraction(int(k), 1000) for k in rng.integers(1000, 9999, 40) * rng.choice([-1, 1], 40)]
    y = [Fraction(int(k), 1000) * Fraction(10) ** int(e) for k, e in rng.integers([1000, -2], [9999, 3], (40, 2))]
    pairs = [*zip(x, y, strict=True), (Fraction(1), Fraction(5, 10**4)), (Fraction("1.5"), Fraction("0.667"))]
    return tuple(_operation(a, b, op) for a, b in pairs for op in OPERATIONS.values() if op(a, b))


def _operation(x: Fraction, y: Fraction, op: Callable[[Any, Any], Any]) -> dict[str, Any]:
    true, computed = op(x, y), op(FOUR.array([x]), FOUR.array([y])).to_fractions()[0]
    names = {"x": x, "y": y, "op": op, "fl": {true: computed}.__getitem__}
    return names | {"beta": gap(10, 4) / 2, "epsilon": computed / true - 1}


@cache
def all_pairs() -> tuple[int, Fraction]:
    """Return the number of operations on all pairs of two-digit decimal numbers, and the largest relative error / β."""
    fmt = FloatFormat(10, 2)
    x = fmt.array([sign * m for m in range(10, 100) for sign in (1, -1)])
    y = fmt.array([m * Fraction(10) ** e for m in range(10, 100) for e in (0, -1)])
    a, b = x.to_fractions()[:, np.newaxis], y.to_fractions()
    largest, count = Fraction(0), 0
    for name, op in OPERATIONS.items():
        computed, true = getattr(np, name)(x[:, np.newaxis], y).to_fractions(), op(a, b)
        largest, count = max(largest, _largest_relative_error(computed, true)), count + true.size
    return count, largest / (gap(10, 2) / 2)


def _largest_relative_error(computed: Any, true: Any) -> Fraction:
    some = true != 0
    if not np.all(computed[~some] == 0):
        raise ArithmeticError("got a nonzero computed result; needed zero, as the exact result is zero")
    computed, true = computed[some], true[some]
    error = abs(computed.astype(np.float64) / true.astype(np.float64) - 1)
    nearly = error > error.max() - 1e-12  # far more than float64 can be wrong; exact errors of all would take long
    return Fraction(max(abs(computed[nearly] / true[nearly] - 1)))


# -- section 6: sums, products and quotients ------------------------------------------------------


def _sum_names(x: list[Fraction], epsilon: list[Fraction]) -> dict[str, Any]:
    """Return a sum and its computed value, where the k-th addition has the relative error ``epsilon[k]``."""
    computed = x[0]
    for term, e in zip(x[1:], epsilon, strict=True):
        computed = (computed + term) * (1 + e)
    s = sum(x, start=Fraction(0))
    return {
        "n": Fraction(len(x)), "x": numbered(x), "s": s, "s_hat": computed, "s_tilde": computed - s, "beta": BETA,
        "errors": numbered(epsilon), "epsilon": abs((computed - s) / s),
    }  # fmt: skip


@cache
def sums(n: int | None = None) -> tuple[dict[str, Any], ...]:
    """Return sums of n terms, or of 3, 4 and 6 terms: random ones, and sums that attain the bounds (18)."""
    rng = np.random.default_rng(18)
    instances = []
    for count in (n,) if n else (3, 4, 6):
        worst = [BETA] * (count - 1)
        alternating = [Fraction(10), Fraction(3), *(Fraction(-1 - j % 2) for j in range(2, count))]
        equal = [Fraction(1, 2)] * 2 + [Fraction(1)] * (count - 2)
        instances += [_sum_names(alternating, worst) | {"tight": True}, _sum_names(equal, worst)]
        instances += [_sum_names(fractions(rng, count), small(rng, count - 1)) for _ in range(6)]
        instances += [_sum_names(fractions(rng, count), worst) for _ in range(6)]
    return tuple(instances)


def with_errors(instances: Iterable[Names]) -> list[dict[str, Any]]:
    """Return instances in which ε names the errors of single operations."""
    return [{**names, "epsilon": names["errors"]} for names in instances]


@cache
def coarse_is_wider() -> bool:
    """Whether the last member of (18), which uses the largest term for all, is never smaller than the one before."""
    return all(trial.bounds["1984 (18), coarse"] >= trial.bounds["1984 (18)"] for trial in experiment.survey("sum"))


@cache
def tie() -> float:
    """Return error / (18) of a sum of 100 terms in four digits whose additions are all ties."""
    beta = FOUR.unit_roundoff
    return experiment.sum_trial(FOUR.array([1, beta, *[-beta] * 98])).ratio("1984 (18)")


@cache
def like_signs() -> tuple[int, int]:
    """Count the violations of (18) of 1982 by sums of terms of one sign, and the sums."""
    like = [
        experiment.sum_trial(experiment.random_numbers(np.random.default_rng(seed), fmt, (5,), "like signs"))
        for fmt in experiment.SURVEYED
        for seed in range(20)
    ]
    return sum(trial.violates("1982 (18)") for trial in like), len(like)


def _quotient_names(
    x: list[Fraction], y: list[Fraction], epsilon: list[Fraction], eta: list[Fraction]
) -> dict[str, Any]:
    """Return a product divided by a product, computed from left to right, with the error of each operation."""
    true = computed = x[0]
    for factor, e in zip(x[1:], epsilon, strict=True):
        true, computed = true * factor, computed * factor * (1 + e)
    for divisor, e in zip(y, eta, strict=True):
        true, computed = true / divisor, computed / divisor * (1 + e)
    return {
        "n": Fraction(len(x)), "m": Fraction(len(y)), "x": numbered(x), "y": numbered(y), "beta": BETA,
        "Q": true, "Q_hat": computed, "Q_tilde": computed - true, "epsilon_": abs(computed / true - 1),
        "epsilon": abs(computed / true - 1), "errors": numbered(epsilon), "eta": numbered(eta),
    }  # fmt: skip


@cache
def quotients(sizes: tuple[tuple[int, int], ...]) -> tuple[dict[str, Any], ...]:
    """Return quotients of n factors and m divisors, with random errors and with errors that are all β."""
    rng = np.random.default_rng(20)
    instances = []
    for n, m in sizes:
        for _ in range(4):
            x, y = fractions(rng, n), fractions(rng, m)
            instances.append(_quotient_names(x, y, small(rng, n - 1), small(rng, m)))
            instances.append(_quotient_names(x, y, [BETA] * (n - 1), [BETA] * m))
    return tuple(instances)


@cache
def worst_twenty() -> experiment.Trial:
    """Multiply twenty factors of two digits that a search found."""
    fmt = FloatFormat(10, 2)
    return experiment.product_trial(fmt.array([14, 75, *[96] * 18]), fmt.array([]))


SIZES = ((2, 1), (1, 2), (3, 0), (4, 3))


def roundings_counted() -> bool:
    return all(len(derivation.quotient_error(n, m)[1]) == n + m - 1 for n, m in SIZES)


# -- sections 7 and 8: norms, and the sum of two matrices -----------------------------------------


def norm(matrix: FirstOrder) -> Fraction:
    """Return norm (22), the largest column sum; TypeError for anything but a matrix."""
    return column_sum_norm(_entries(matrix))


def vector_norm(vector: FirstOrder) -> Fraction:
    """Return norm (21), the largest entry; TypeError for anything but a vector."""
    return max_norm(_entries(vector))


def _entries(value: object) -> Any:
    if not isinstance(value, FirstOrder) or not value.shape:
        raise TypeError(f"got {value!r}; needed a vector or a matrix")
    return value.value


def incompatible() -> str:
    a, x = exact([[1, 1], [0, 0]]), exact([1, 1])
    return (
        f"for the matrix with rows (1, 1), (0, 0) and $x=(1,1)$, $\\|Ax\\|={max_norm(a @ x)}$, but "
        f"$\\|A\\|\\|x\\|={column_sum_norm(a) * max_norm(x)}$ with column sums and "
        f"{row_sum_norm(a) * max_norm(x)} with row sums"
    )


@cache
def norm_instances(shape: tuple[int, ...]) -> tuple[dict[str, Any], ...]:
    """Return pairs of random arrays, a pair of an array and its multiple, and a pair that starts with zero."""
    rng = np.random.default_rng(7)
    size = int(np.prod(shape))

    def random() -> Any:
        return np.array(fractions(rng, size), dtype=object).reshape(shape)

    pairs = [(random(), random()) for _ in range(40)]
    pairs += [(3 * a, a) for a, _ in pairs[:4]] + [(0 * a, a) for a, _ in pairs[:2]]
    pairs.append((exact(np.ones(shape, dtype=int)), exact(np.ones(shape, dtype=int))))
    return tuple(
        dict(zip("xyAB", map(quantity, (a, b, a, b)), strict=True)) | {"a": fractions(rng, 1)[0]} for a, b in pairs
    )


def norms(size: Callable[[FirstOrder], Fraction], shape: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return arrays with their norms; the norm is zero only for zero, or also for other arrays."""
    instances = norm_instances(shape)
    only = not any(np.any(names["x"].value != 0) for names in instances if size(names["x"]) == 0)
    return [{**names, "norm": size, "zero": lambda phrase: phrase.startswith("only if") == only} for names in instances]


@cache
def rounded_sums() -> tuple[dict[str, Any], ...]:
    """Return sums of matrices in four digits: random ones, differences of nearly equal and equal numbers, and ties."""
    rng = np.random.default_rng(24)

    def random(rows: int, columns: int, power: int) -> Any:
        digits = rng.integers(1000, 10000, (rows, columns)) * rng.choice([-1, 1], (rows, columns))
        return FOUR.array(exact(digits) * Fraction(10) ** power)

    pairs = [(random(n, m, k), random(n, m, 0)) for n, m in ((1, 1), (2, 3), (3, 3)) for k in (-3, -1, 0, 2)]
    pairs += [(FOUR.array([["7.654"]]), FOUR.array([["7.653"]])), (FOUR.array([["1"]]), FOUR.array([["0.0005"]]))]
    pairs.append((FOUR.array([["7.654"]]), FOUR.array([["-7.654"]])))
    return tuple(_rounded_sum((a + b).to_fractions(), a.to_fractions(), b.to_fractions()) for a, b in pairs)


def _rounded_sum(computed: Any, a: Any, b: Any) -> dict[str, Any]:
    true, error = a + b, computed - a - b
    return {
        "A": quantity(a), "B": quantity(b), "R": quantity(error), "norm": norm, "beta": gap(10, 4) / 2,
        "b": Fraction(10), "t": Fraction(4),
        "epsilon": column_sum_norm(error) / column_sum_norm(true) if np.any(true) else Fraction(0),
    }  # fmt: skip


def sums_of_matrices() -> Names:
    beta = gap(10, 4) / 2
    matrix, single = (max(abs(names["epsilon"]) for names in each) / beta for each in (rounded_sums(), operations()))
    factors = {"the same as": Fraction(1), "twice": Fraction(2), "half of": HALF}
    same = {name for name, factor in factors.items() if abs(matrix - factor * single) < Fraction(1, 100)}
    return {"comparison": same, "matrix": float(matrix), "single": float(single)}


def inner_products() -> Names:
    """What the elements of a product of random matrices are of its rows and columns."""
    rng = np.random.default_rng(9)
    a, b = exact(rng.integers(-9, 10, (3, 4))), exact(rng.integers(-9, 10, (4, 2)))
    pairs = [(i, j) for i in range(3) for j in range(2)]
    kinds = {"inner products of vector pairs": operator.mul, "sums of vector pairs": operator.add}
    found = {name: [sum(map(kind, a[i], b[:, j]), Fraction(0)) for i, j in pairs] for name, kind in kinds.items()}
    right = [(a @ b)[pair] for pair in pairs]
    return {"elements": {name for name, each in found.items() if each == right}, "count": len(pairs)}


# -- section 9.1: inner products ------------------------------------------------------------------


def rounded_dot(a: Sequence[Fraction], b: Sequence[Fraction], epsilon: Sequence[Fraction]) -> Fraction:
    """Return an inner product in the order of section 9.1, with errors numbered as in that section."""
    errors = iter(epsilon)
    computed = a[0] * b[0] * (1 + next(errors))
    for p, q in zip(a[1:], b[1:], strict=True):
        term = p * q * (1 + next(errors))
        computed = (computed + term) * (1 + next(errors))
    return computed


def _dot_names(a: list[Fraction], b: list[Fraction], epsilon: list[Fraction]) -> dict[str, Any]:
    true = sum((p * q for p, q in zip(a, b, strict=True)), start=Fraction(0))
    computed = rounded_dot(a, b, epsilon)
    return {
        "n": Fraction(len(a)), "a": numbered(a), "b": numbered(b), "epsilon": numbered(epsilon), "beta": BETA,
        "I": true, "I_hat": computed, "I_tilde": computed - true, "fl": {true: computed}.__getitem__,
    }  # fmt: skip


@cache
def dots(sizes: tuple[int, ...]) -> tuple[dict[str, Any], ...]:
    """Return inner products with random errors, and with products of one sign whose errors are all β."""
    rng = np.random.default_rng(26)
    instances = []
    for n in sizes:
        for _ in range(6):
            a, b = fractions(rng, n), fractions(rng, n)
            instances.append(_dot_names(a, b, small(rng, 2 * n - 1)))
            instances.append(_dot_names([abs(x) for x in a], [abs(x) for x in b], [BETA] * (2 * n - 1)))
    return tuple(instances)


@cache
def dot_weights(n: int) -> list[int]:
    """Count the roundings of each product in an inner product, from its derived first-order error."""
    error, products, _ = derivation.dot_error(n)
    return [len(sp.Add.make_args(error.coeff(p).coeff(q))) for p, q in (product.args for product in products)]


@cache
def worst_twelve() -> float:
    """Return error / bound (26) of an inner product of 12 terms in three bits that a search found."""
    fmt = FloatFormat(2, 3)
    a = fmt.array([10, 12, "2.5", "2.5", 10, 5, 5, 5, 10, 10, 10, 40])
    return experiment.dot_trial(a, fmt.array([6] * 12)).ratio("(26)")


def relative_dot_bound_holds() -> bool:
    rng, fmt = np.random.default_rng(26), FloatFormat(10, 6)
    for _ in range(200):
        trial = experiment.dot_trial(*experiment.random_numbers(rng, fmt, (2, 5)))
        if trial.violates("strict"):  # both divided by |I|
            return False
    return True


# -- section 9.2: products of matrices ------------------------------------------------------------


def rounded_product(a: Any, b: Any, errors: Any) -> Any:
    """Return a matrix product whose entries are inner products; ``errors(count)`` gives the errors of an entry."""
    n = a.shape[1]
    return exact([[rounded_dot(list(row), list(column), errors(2 * n - 1)) for column in b.T] for row in a])


def _dominated(shape: tuple[int, int]) -> Any:
    """Return a matrix whose first entry is far larger than the others, so that products attain their bounds."""
    matrix = np.full(shape, Fraction(1, 10**4), dtype=object)
    matrix[0, 0] = Fraction(1)
    return matrix


def _random_matrix(rng: np.random.Generator, shape: tuple[int, int]) -> Any:
    return np.array(fractions(rng, shape[0] * shape[1]), dtype=object).reshape(shape)


@cache
def matrix_products() -> tuple[dict[str, Any], ...]:
    """Products of an m × n and an n × p matrix with random errors, with errors that are all β, and of zeros."""
    rng = np.random.default_rng(28)
    instances = []
    for m, n, p in ((2, 3, 2), (3, 4, 2), (2, 5, 3)):
        cases = [(_random_matrix(rng, (m, n)), _random_matrix(rng, (n, p)), lambda k: small(rng, k)) for _ in range(3)]
        cases.append((_dominated((m, n)), _dominated((n, p)), lambda k: [BETA] * k))
        cases.append((0 * cases[0][0], 0 * cases[0][1], lambda k: [BETA] * k))
        cases.append((abs(cases[0][0]), abs(cases[0][1]), lambda k: [BETA] * k))
        instances += [_product_names(*case) | {"positive": case is cases[-1]} for case in cases]
    return tuple(instances)


def _product_names(a: Any, b: Any, errors: Any) -> dict[str, Any]:
    (m, n), p, error = a.shape, b.shape[1], rounded_product(a, b, errors) - a @ b
    entries = {
        name: {(i + 1, j + 1): value for (i, j), value in np.ndenumerate(matrix)}
        for name, matrix in (("a", a), ("b", b), ("c_tilde", error))
    }
    matrices = {"A": a, "B": b, "C_tilde": error, "D": np.diag([n, *range(n, 1, -1)])}
    return entries | {name: quantity(each) for name, each in matrices.items()} | {
        "n": Fraction(n), "i": Fraction(m), "j": Fraction(p), "beta": BETA, "norm": norm, "bracket": abs,
    }  # fmt: skip


def long_products() -> list[dict[str, Any]]:
    """Return the products with at least four terms in each entry, so that the printed dots have a meaning.

    Where all numbers and errors are positive, each entry attains its bound.
    """
    return [
        {**each, "diag": lambda *numbers: quantity(np.diag(numbers)), "tight": each["positive"]}
        for each in matrix_products()
        if each["n"] >= 4
    ]


def products_with_digits() -> list[dict[str, Any]]:
    """Return products whose β is that of 41 digits, so that (28) can express it by b and t."""
    return [
        {**each, "b": Fraction(10), "t": Fraction(41), "beta": HALF / 10**40, "C_tilde": HALF * each["C_tilde"]}
        for each in matrix_products()
    ]


@cache
def _survey_of_products() -> tuple[int, int]:
    rng, fmt = np.random.default_rng(28), FloatFormat(2, 11)
    trials = [
        experiment.chain_trial(list(experiment.random_numbers(rng, fmt, (2, n, n))))
        for n in (1, 2, 3, 5)
        for _ in range(20)
    ]
    return sum(trial.violates("(32)") for trial in trials), len(trials)


def _chain_names(factors: list[Any], errors: Any) -> dict[str, Any]:
    products = [factors[0]]
    computed = [factors[0]]
    for factor in factors[1:]:
        products.append(products[-1] @ factor)
        computed.append(rounded_product(computed[-1], factor, errors))
    count = len(factors)
    steps = zip(computed[:-1], factors[1:], computed[1:], strict=True)
    rounded = [(quantity(left @ factor), quantity(value)) for left, factor, value in steps]
    return {
        "N": Fraction(count), "M": {i + 1: quantity(f) for i, f in enumerate(factors)}, "norm": norm,
        "fl": looked_up(rounded),
        "d": {i + 1: Fraction(f.shape[1]) for i, f in enumerate(factors[:-1])}, "beta": BETA, "epsilon": BETA,
        "P_hat": {i + 1: quantity(p) for i, p in enumerate(computed)},
        "P_tilde": {i + 1: quantity(c - p) for i, (c, p) in enumerate(zip(computed, products, strict=True))},
    }  # fmt: skip


@cache
def chains() -> tuple[dict[str, Any], ...]:
    """Return chains of three matrices: random ones, one that cancels, some that attain (32), and one of zeros."""
    rng = np.random.default_rng(32)
    shapes = ((2, 3), (3, 4), (4, 2))
    instances = [
        _chain_names([_random_matrix(rng, shape) for shape in shapes], lambda k: small(rng, k)) for _ in range(4)
    ]
    for sizes, scales in (((2, 3, 4, 2), (2, 3, 5)), ((2, 4, 3, 2), (5, 3, 2))):
        factors = [_dominated(shape) * scale for shape, scale in zip(itertools.pairwise(sizes), scales, strict=True)]
        instances.append(_chain_names(factors, lambda k: [BETA] * k))
    row, column = exact([["1.001", "-1.002"]]), exact([["1.001"], ["1"]])
    instances.append(_chain_names([row, column, exact([["1"]])], lambda k: [BETA, -BETA] * (k // 2) + [BETA]))
    instances.append(_chain_names([exact([[0]])] * 3, lambda k: [BETA] * k))
    return tuple(instances)


def cancelling_product() -> experiment.Trial:
    """Return the smallest counterexample to (30), a row and a column in 4 digits whose product cancels."""
    return experiment.chain_trial([FOUR.array([["1.001", "-1.002"]]), FOUR.array([["1.001"], ["1"]])])


def names_product_bound(phrase: str) -> bool:
    """Whether an equation of hung1982 bounds the error of a matrix product."""
    return "norm(C_tilde)" in statement(f"hung1982.III.eq{phrase.strip('()')}").form


@cache
def shortcut() -> Names:
    """Whether (28) implies (31), by the algebra, a survey and an example, and how far errors of chains exceed (31)."""
    survey, worst = surveyed_bounds("chain")["(31)"], cancelling_product()
    holds = survey.violations == 0 and derivation.chain_shortcut() == 0 and not worst.violates("(31)")
    return {"step": "implies" if holds else "does not imply", "survey": survey, "worst": worst.ratio("(31)")}


def shortcut_text() -> str:
    found = shortcut()
    return (
        f"(31) has {found['survey'].violations} violations in {found['survey'].trials} random chains; the error of "
        f"$1.001\\cdot1.001-1.002\\cdot1$ in four digits is {found['worst']:.0f} times the bound"
    )


def chain_of_scalars() -> float:
    """Return error / (32) of the factors of :func:`worst_twenty`."""
    worst = worst_twenty().inputs[0]
    return experiment.chain_trial([worst.format.array([[x]]) for x in worst.to_fractions()]).ratio("(32)")


# -- section 9.2: the examples --------------------------------------------------------------------


def _example_names(factors: list[Any], d: Any, errors: Any, size: int) -> dict[str, Any]:
    a, b, c = factors
    computed = rounded_product(rounded_product(a, b, errors), c, errors) + d
    rounded = exact([[x * (1 + errors(1)[0]) for x in row] for row in computed])
    true = a @ b @ c + d
    matrices = {"A": a, "B": b, "C": c, "D": d, "R": true, "R_hat": rounded, "R_tilde": rounded - true}
    return {name: quantity(each) for name, each in matrices.items()} | {
        "n": Fraction(size), "m": Fraction(a.shape[1]), "r": Fraction(b.shape[1]),
        "beta": BETA, "epsilon": BETA, "norm": norm,
    }  # fmt: skip


@cache
def example_instances(rectangular: bool = False) -> tuple[dict[str, Any], ...]:
    """Return instances of R = ABC + D: random ones, one whose AB cancels, some that attain their bound, and zero."""
    rng = np.random.default_rng(9)
    instances = []
    for sizes in ((2, 2, 2, 2), (3, 3, 3, 3), (2, 3, 4, 2)) if rectangular else ((2,) * 4, (3,) * 4):
        shapes = [*itertools.pairwise(sizes), (sizes[0], sizes[-1])]
        *factors, d = (_random_matrix(rng, shape) for shape in shapes)
        instances.append(_example_names(factors, d, lambda k: small(rng, k), sizes[0]))
        *factors, d = map(_dominated, shapes)
        instances.append(_example_names(factors, d, lambda k: [BETA] * k, sizes[0]))
    a, b = exact([["1.001", "-1.002"], [0, 0]]), exact([["1.001", 0], [1, 0]])
    one = exact(np.eye(2, dtype=int))
    instances.append(_example_names([a, b, one], 0 * one, lambda k: [BETA, -BETA] * (k // 2) + [BETA], 2))
    instances.append(_example_names([0 * one] * 3, 0 * one, lambda k: [BETA] * k, 2))
    return tuple(instances)


@cache
def examples_in_four_digits() -> str:
    found, corrected = (surveyed_bounds("example")[name] for name in ("Examples", "corrected"))
    a, b = FOUR.array([["1.001", "-1.002"], [0, 0]]), FOUR.array([["1.001", 0], [1, 0]])
    one = FOUR.array(np.eye(2, dtype=int))
    return (
        f"the printed bound fails in {found.violations} of {found.trials} random trials, and by a "
        f"factor of {experiment.example_trial(a, b, one, one * 0).ratio('Examples'):.0f} in a constructed example; the "
        "corrected bound $\\beta[(m+r)\\|A\\|\\|B\\|\\|C\\|+\\|ABC+D\\|]$ fails in "
        f"{corrected.violations}"
    )


def joint_use() -> Names:
    corrected = surveyed_bounds("example")["corrected"]
    return {"use": {"can be used jointly"} if corrected.violations == 0 else set(), "corrected": corrected}


def dimensions() -> Names:
    """Which dimensions the bounds (32) and (24) contain."""
    chain = experiment.chain_trial([FOUR.array(np.full(shape, 1)) for shape in ((2, 3), (3, 5), (5, 2))])
    ratio = chain.bounds["(32)"] / (FOUR.unit_roundoff * math.prod(map(column_sum_norm, chain.inputs)))
    additions = (experiment.matrix_sum_trial(*[FOUR.array(np.full((1, columns), 1))] * 2) for columns in (9, 2))
    same = len({trial.bounds["(24)"] for trial in additions}) == 1
    involved = {3 + 5: "all the interface dimensions", 5: "the largest interface dimension alone"}
    return {"addition": "does not involve" if same else "involves", "product": involved.get(int(ratio), ""),
            "ratio": ratio}  # fmt: skip


CHECKS = read(__name__, globals())
