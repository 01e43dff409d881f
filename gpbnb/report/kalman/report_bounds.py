r"""The rounding error bounds of hung1984, ch. II, section 12, and its closing example.

:func:`coefficients` gives (125) as printed and with each of its faults corrected. All functions are exact: they take
ints and Fractions and return Fractions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from typing import Any, NamedTuple

from gpbnb.arithmetic.formats import prints_as
from gpbnb.arithmetic.rational import column_sum_norm, max_norm
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.arithmetic.search import smallest_precision

# -- the counts of the report -----------------------------------------------------------------------------------------


def prediction_count(n: int) -> int:
    """Count the roundings of the predicted covariance, 2n + 1; hung1984, ch. II, (103)."""
    return 2 * n + 1


def covariance_count(n: int, m: int) -> int:
    """Count the roundings of the covariance, 3n + m + 2; hung1984, ch. II, (105)."""
    return 3 * n + m + 2


def gain_count(n: int, m: int) -> int:
    """Count the roundings of the gain, 4n + 2m + 3; hung1984, ch. II, (108)."""
    return 4 * n + 2 * m + 3


def transition_count(n: int, m: int) -> int:
    """Count the roundings of the closed loop in a step, including its product with the state, 6n + 3m + 5; (115)."""
    return 6 * n + 3 * m + 5


def input_count(n: int, m: int) -> int:
    """Count the roundings of the input of a step, including its addition, 4n + 3m + 4; hung1984, ch. II, (116)."""
    return 4 * n + 3 * m + 4


class Coefficients(NamedTuple):
    r"""Factors of :math:`\beta\|x_k\|` and :math:`\beta B` in a bound like (125)."""

    first: int
    second: int


def coefficients(
    k: int, n: int, m: int, once: bool = False, free_signs: bool = False, carried: bool = False
) -> Coefficients:
    r"""Return the coefficients of (125), as printed or with faults corrected.

    With :math:`c_j` roundings of the closed loop of step j and :math:`d_j` of its input, the report bounds
    :math:`\|\tilde x_k\|` by :math:`\beta\{a_0\|x_k\| + \sum_{i=1}^k (a_0 - a_i)B\}`,
    :math:`a_i = \sum_{j=i+1}^k c_j + d_i`, :math:`a_0 = \sum_{j=1}^k c_j`.

    Parameters
    ----------
    k : steps.
    n, m : dimensions of the state and of the measurement.
    once : whether to count only once the product with the state and the last addition, which (114)-(116) count already.
    free_signs : whether each term has an error of its own sign, so that :math:`a_0 + a_i` replaces :math:`a_0 - a_i`.
    carried : whether the errors of P from earlier steps propagate into P, K and F, as all other errors do in the
        report's own algebra; this adds 3n + m + 2 roundings at each step.

    References
    ----------
    hung1984, ch. II, (112)-(125).
    """
    if min(k, n, m) < 1:
        raise ValueError(f"got k = {k}, n = {n}, m = {m}; needed each at least 1")
    c, d, more = transition_count(n, m), input_count(n, m), covariance_count(n, m) if carried else 0
    if not once:
        c, d = c + n + 1, d + 1
    first = c * k + more * k * (k - 1) // 2
    loops = c * k * (k + 1) // 2 + more * (k + 1) * k * (k - 1) // 6  # sum over i of c_1 + ... + c_i
    inputs = d * k + more * k * (k - 1) // 2
    return Coefficients(first, 2 * k * first - loops + inputs if free_signs else loops - inputs)


CORRECTIONS: dict[str, dict[str, bool]] = {
    "as printed": {},
    "roundings counted once": {"once": True},
    "and errors of either sign": {"once": True, "free_signs": True},
    "and covariance errors carried on": {"once": True, "free_signs": True, "carried": True},
}
"""Arguments of :func:`coefficients`, one more fault of (125) corrected on each line."""

ALL_CORRECTED = CORRECTIONS["and covariance errors carried on"]
"""Arguments of :func:`coefficients` with every fault of (125) corrected."""


def printed_input_bound(transitions: Sequence[Any], inputs: Sequence[Any]) -> Fraction:
    r"""Return the least B of (122), :math:`F^i u \le B` for i = 0 … k - 1, in the norms (21) and (22).

    Parameters
    ----------
    transitions : F_1 … F_k of (109).
    inputs : u_1 … u_k of (110).
    """
    if not transitions or len(transitions) != len(inputs):
        raise ValueError(
            f"got {len(transitions)} transitions and {len(inputs)} inputs; needed equal numbers, at least one of each"
        )
    F, u = max(map(column_sum_norm, transitions)), max(map(max_norm, inputs))
    return u * max(Fraction(1), F ** (len(inputs) - 1))


def precision_for_coefficient(coefficient: int | Fraction, tolerance: Fraction | int = 1, base: int = 10) -> int:
    r"""Return the smallest t with :math:`\text{coefficient}\cdot\beta(t) \le \text{tolerance}`; (8), (13)."""
    if coefficient <= 0 or tolerance <= 0:
        raise ValueError(f"got coefficient {coefficient} and tolerance {tolerance}; needed both positive")
    found = smallest_precision(
        lambda fmt: coefficient * fmt.unit_roundoff <= tolerance, base, Rounding.NEAREST, monotone=True
    )
    if found is None:
        raise ArithmeticError("got no sufficient precision, although the unit roundoff can be arbitrarily small")
    return found.precision


# -- the closing example ----------------------------------------------------------------------------------------------

EXAMPLE = (3_153_600, 10, 2)
"""The k, n and m of the closing example, a year of steps of 10 s; hung1984, ch. II, section 12."""

PRINTED = {
    "first coefficient": "2.6490e8",
    "second coefficient": "1.2949e16",
    "first beta": ".3775e-8",
    "first digits": "9",
    "second beta": ".7723e-16",
    "second digits": "17",
}
"""Numbers of the closing example as hung1982 prints them; hung1984 loses a minus sign."""


def example_digits(tolerance: Fraction) -> dict[str, float]:
    """Return the decimal digits that the closing example demands, from its first number to a corrected formula.

    They are those t at which coefficient · 0.5 × 10^(1-t) equals the allowed error: first one as large as the state,
    then the relative error `tolerance`. Each change is made together with those before it.
    """
    formula = coefficients(*EXAMPLE)
    demanded: dict[str, Fraction] = {
        "printed number, first term": Fraction(PRINTED["first coefficient"]),
        "printed number, second term": Fraction(PRINTED["second coefficient"]),
        "formula as printed": Fraction(formula.second),
        "1 mas in place of the drift": formula.second / tolerance,
    }
    for name, faults in [*CORRECTIONS.items()][1:]:
        demanded[name.removeprefix("and ")] = coefficients(*EXAMPLE, **faults).second / tolerance
    return {name: math.log10(coefficient / 2) + 1 for name, coefficient in demanded.items()}


def written_changes(digits: Mapping[str, float]) -> dict[str, tuple[str, str]]:
    """Write digits, and their changes since the name before, to two decimals, so that a reader can add them up."""
    rounded = {name: round(count, 2) for name, count in digits.items()}
    changes = [f"{after - before:+.2f}".replace("-", "−") for before, after in pairwise(rounded.values())]
    return {
        name: (f"{count:.2f}", change) for (name, count), change in zip(rounded.items(), ["", *changes], strict=True)
    }


def one_digit_misprints(k: int, n: int, m: int, printed: str) -> list[tuple[int, int, int]]:
    """List every (a, b, c) that differs from (7, 3, 6) in one digit and makes k(an + bm + c) print as `printed`."""
    right = (7, 3, 6)
    changed = [(*right[:i], figure, *right[i + 1 :]) for i in range(3) for figure in range(10) if figure != right[i]]
    return [(a, b, c) for a, b, c in changed if prints_as(k * (a * n + b * m + c), printed)]


def order(second: bool) -> tuple[str, ...] | None:
    """Return an order in which (98)-(101) can be computed with the first or the second form of (99), or None."""
    needs = {"(100)": [], "(99)": ["(101)" if second else "(100)"], "(101)": ["(99)", "(100)"], "(98)": ["(99)"]}
    try:
        return tuple(TopologicalSorter(needs).static_order())
    except CycleError:
        return None
