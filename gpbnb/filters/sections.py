"""Second-order sections: how to factor a filter into them, which zeros go with which poles, their order and scaling.

A cascade has many arrangements with one transfer function, and rounding errors differ between them. Nothing is arranged
silently: pairing and order are arguments.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import ctx, fmpq, fmpq_poly
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import exact_fraction
from gpbnb.arithmetic.rational import exact, roots
from gpbnb.filters.named import whole_number
from gpbnb.filters.structures import expanded, shortened

Coefficients = tuple[list[Fraction], list[Fraction]]
"""The coefficients b0 … bM, and a1 … aN without the leading 1, of a section."""

ORDERS = ("given", "up", "down")
"""Orders of sections, as given, or with the poles nearest to the unit circle last or first."""

PAIRINGS = ("given", "nearest")
"""Pairings, as given, or to each pair of poles, from the unit circle inwards, the nearest zeros that are left."""

_BITS = 320
_CONJUGATE = 2.0**-46
"""Largest relative difference of two numbers that count as conjugates, as in SciPy."""
_LONGEST_RESPONSE = 2**20


class _Factor(NamedTuple):
    """A real factor of first or second order: its coefficients, and its root nearest to the unit circle."""

    coefficients: list[Fraction]
    root: complex


def factored(
    b: Sequence[Fraction], a: Sequence[Fraction], pairing: str = "nearest", order: Any = "up"
) -> list[Coefficients]:
    """Factor a filter b0 … bM and a1 … aN, without the leading 1, into sections; the gain is in the first.

    Factors of first and second order over the rationals are exact; others have relative errors below 2**-250. For
    pairing and order see :data:`PAIRINGS` and :func:`ordered`.
    """
    if not any(b):
        raise ValueError("got coefficients b that are all zero; needed one that is not, to factor the filter")
    delay = next(i for i, each in enumerate(b) if each)
    zeros = _factors(b[delay:]) + [_Factor([Fraction(0), Fraction(1)], 0j)] * delay
    return _arranged(zeros, _factors([Fraction(1), *a]), b[delay], pairing, order)


def sections_from_zeros(z: Any, p: Any, k: Any, pairing: str, order: Any) -> list[Coefficients]:
    """Sections from zeros, poles and gain, as in ``scipy.signal``; for pairing and order see :func:`factored`."""
    gain = exact([k])[0]
    zeros, poles = (_factors_from_roots(given, name) for name, given in (("zeros", z), ("poles", p)))
    if not poles and not zeros:
        raise ValueError("got no zeros and no poles; needed at least one pole: a gain alone is no filter")
    spare = len(np.ravel(p)) - len(np.ravel(z))  # in powers of 1/z, poles beyond the zeros are delays
    if spare < 0:
        raise ValueError(f"got {len(np.ravel(z))} zeros and {len(np.ravel(p))} poles; needed at least as many poles")
    return _arranged(zeros + [_Factor([Fraction(0), Fraction(1)], 0j)] * spare, poles, gain, pairing, order)


def repaired(sections: Sequence[Coefficients], pairing: str, order: Any) -> list[Coefficients]:
    """Return sections with another pairing and order; see :func:`factored`."""
    if _one_of("pairing", pairing, PAIRINGS) == "given":
        return ordered(list(sections), order)
    b, a = expanded(sections)
    return factored(b, a[1:], pairing, "up" if order == "given" else order)


def ordered(sections: list[Coefficients], order: Any) -> list[Coefficients]:
    """Return sections in one of :data:`ORDERS`, or in that of their numbers from 0, each once."""
    if isinstance(order, str):
        if _one_of("order", order, ORDERS) == "given":
            return sections
        largest = [max((abs(each) for each in _roots(a)), default=0.0) for _, a in sections]
        at = sorted(range(len(sections)), key=lambda i: largest[i], reverse=order == "down")
    else:
        try:
            at = [whole_number("section", each, 0) for each in order]
        except (TypeError, ValueError):
            at = []
        if sorted(at) != list(range(len(sections))):
            words = ", ".join(map(repr, ORDERS))
            raise ValueError(f"got order {order!r}; needed each of 0 to {len(sections) - 1} once, or one of {words}")
    return [sections[i] for i in at]


def scaled(sections: Sequence[Coefficients], form: str) -> list[Coefficients]:
    """Multiply sections in a direct form by powers of two, so that numbers between them stay within 1 for such inputs.

    The peak gain from the input to the output of each section but the last is then at most 1 and more than 1/2; in the
    direct form II, the gain to the delayed values of the next section counts as well. The last section takes up the
    powers, so the whole filter stays the same.
    """
    found, moved = list[Coefficients](), 0
    response = np.zeros(_length(sections))
    response[0] = 1.0
    for i, (b, a) in enumerate(sections[:-1]):
        response = _filtered(response, b, a)
        reached = [response]
        if form == "direct form II":
            reached.append(_filtered(response, [Fraction(1)], sections[i + 1][1]))
        largest = max(float(np.abs(each).sum()) for each in reached)
        power = math.ceil(math.log2(largest)) if largest else 0
        found.append(([each * Fraction(2) ** (moved - power) for each in b], [*a]))
        moved = power
    b, a = sections[-1]
    return [*found, ([each * Fraction(2) ** moved for each in b], [*a])]


def _length(sections: Sequence[Coefficients]) -> int:
    """Return the number of steps after which a filter has decayed to 2**-40."""
    largest = max((abs(root) for _, a in sections for root in _roots(a)), default=0.0)
    if largest == 0.0:
        return 64
    steps = 64 + 2 * len(sections) * 40 * math.log(2) / -math.log(largest) if largest < 1 else math.inf
    if steps > _LONGEST_RESPONSE:
        raise ValueError(
            f"got a pole of size {largest:.9g}; needed a filter that decays within 2**20 steps to scale its sections"
        )
    return int(steps)


def _filtered(values: NDArray[np.float64], b: Sequence[Fraction], a: Sequence[Fraction]) -> NDArray[np.float64]:
    """Run a filter in the transposed direct form II in float64."""
    count = max(len(b), len(a) + 1)
    ahead, back = ([*map(float, each)] + [0.0] * (count - 1 - len(each)) for each in (b[1:], a))
    first, kept, found = float(b[0]), [0.0] * count, np.empty(len(values))
    for k, value in enumerate(values.tolist()):
        found[k] = result = kept[0] + first * value
        for i in range(count - 1):
            kept[i] = kept[i + 1] + value * ahead[i] - result * back[i]
    return found


def _polynomial(falling: Sequence[Fraction]) -> fmpq_poly:
    return fmpq_poly([fmpq(each.numerator, each.denominator) for each in reversed(falling)])


def _roots(a: Sequence[Fraction]) -> list[complex]:
    return [complex(each) for each in roots(_polynomial([Fraction(1), *a]))]


def _one_of(what: str, given: str, names: Sequence[str]) -> str:
    if given not in names:
        raise ValueError(f"got {what} {given!r}; needed one of {', '.join(map(repr, names))}")
    return given


def _factors(polynomial: Sequence[Fraction]) -> list[_Factor]:
    """Return the real factors of a polynomial in 1/z whose first coefficient is not zero, each with the first one 1."""
    _, found = _polynomial(polynomial).factor()
    factors = list[_Factor]()
    for each, count in found:
        entries = [Fraction(int(c.p), int(c.q)) for c in reversed(each.coeffs())]
        monic = [c / entries[0] for c in entries]
        factors += (_factors_in_balls(each) if len(monic) > 3 else [_Factor(monic, _nearest_root(monic))]) * count
    return factors


def _factors_in_balls(polynomial: Any) -> list[_Factor]:
    before, ctx.prec = ctx.prec, _BITS
    try:
        upper = [root for root, _ in polynomial.complex_roots() if not root.imag < 0]
        parts = [(exact_fraction(root.real.mid()), exact_fraction(root.imag.mid())) for root in upper]
    finally:
        ctx.prec = before
    return [_factor(*each) for each in parts]


def _factor(real: Fraction, imaginary: Fraction) -> _Factor:
    """Return the factor of a real root, or of a complex one and its conjugate."""
    if not imaginary:
        return _Factor([Fraction(1), *shortened([-real])], complex(float(real)))
    pair = shortened([-2 * real, real * real + imaginary * imaginary])
    return _Factor([Fraction(1), *pair], complex(float(real), float(imaginary)))


def _nearest_root(monic: Sequence[Fraction]) -> complex:
    return min(_roots(monic[1:]), key=lambda root: (abs(1 - abs(root)), -root.imag))


def _factors_from_roots(given: Any, name: str) -> list[_Factor]:
    numbers = [complex(each) for each in np.ravel(np.asarray(given, dtype=np.complex128))]
    if not np.isfinite(numbers).all():
        raise ValueError(f"got {name} {numbers}; needed finite numbers")
    real = [each for each in numbers if abs(each.imag) <= _CONJUGATE * abs(each)]
    upper, lower = (
        [each for each in numbers if each not in real and (each.imag > 0) == sign] for sign in (True, False)
    )
    for each in upper:
        mate = lower.pop(_nearest(each.conjugate(), lower)) if lower else 0j
        if abs(mate - each.conjugate()) > _CONJUGATE * abs(each):
            raise ValueError(f"got {name} with {each} and without its conjugate; needed both, so that b and a are real")
    if lower:
        raise ValueError(f"got {name} with {lower[0]} and without its conjugate; needed both, so that b and a are real")
    pairs = [_factor(Fraction(each.real), Fraction(each.imag)) for each in upper]
    return pairs + [_factor(Fraction(each.real), Fraction(0)) for each in real if each]


def _grouped(factors: Sequence[_Factor]) -> list[_Factor]:
    """Combine factors of first order in pairs, from the unit circle inwards."""
    second = [each for each in factors if len(each.coefficients) == 3]
    first = sorted((each for each in factors if len(each.coefficients) == 2), key=lambda each: -abs(each.root))
    for one, other in zip(first[::2], first[1::2], strict=False):
        c, d = one.coefficients, other.coefficients
        product = [c[0] * d[0], c[0] * d[1] + c[1] * d[0], c[1] * d[1]]
        second.append(_Factor(shortened(product), one.root))
    return second + (first[-1:] if len(first) % 2 else [])


def _arranged(
    zeros: list[_Factor], poles: list[_Factor], gain: Fraction, pairing: str, order: Any
) -> list[Coefficients]:
    """Pair groups of zeros and poles, order the sections, and give the gain to the first."""
    if _one_of("pairing", pairing, PAIRINGS) == "given" or (isinstance(order, str) and order == "given"):
        raise ValueError('got "given" for a filter without sections; needed pairing "nearest" and an order')
    above, below = _grouped(zeros), _grouped(poles)
    nothing = _Factor([Fraction(1)], 0j)
    count = max(len(above), len(below))
    above, below = above + [nothing] * (count - len(above)), below + [nothing] * (count - len(below))
    sections = list[Coefficients]()
    for pole in sorted(below, key=lambda each: -abs(each.root)):
        zero = above.pop(_nearest(pole.root, [each.root for each in above]))
        sections.append(([*zero.coefficients], [*pole.coefficients[1:]]))
    first, *others = ordered(sections, order)
    return [([each * gain for each in first[0]], first[1]), *others]


def _nearest(root: complex, others: Sequence[complex]) -> int:
    return min(range(len(others)), key=lambda i: abs(others[i] - root))
