r"""Peak gains of linear systems in ball arithmetic."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from gpbnb.arithmetic.rational import exact

_COLUMNS = 256
"""Smallest number of columns of a block, which balls multiply at once."""

_BITS = tuple(2**k for k in range(8, 14))
"""Bits of the balls, one after the other."""

_ACCURACY = 2.0**-40
"""Largest distance of the two ends, as a share of the gain."""

_MOST_TERMS = 2**22
"""Terms after which the rest of an infinite sum must be negligible."""

_NEGLIGIBLE = 2.0**-100
"""Share of its possible size below which a gain is negligible, so that its enclosure may be wide."""

_SHARP = 2.0**-10
"""Share of the states below which the trace of a power has decayed."""

_SMALLEST = 2.0**-1074
"""The smallest float64 number, by which a rounded one may be off where factors near 1 change nothing."""

_TOO_SLOW = (
    f"the system decays too slowly for a bound: its response is not negligible after {_MOST_TERMS} steps; needed a "
    'stable system that decays faster, or basis "emulation", which needs no bound'
)


class Interval(NamedTuple):
    """Lower and upper bounds, float64."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


def peak_gain(A: Any, B: Any, C: Any, D: Any = None) -> Interval:
    r"""Return the worst-case peak gain :math:`|D| + \sum_{l\ge0}|CA^lB|`, in ball arithmetic; (p, m).

    Multiplied step by step, balls would grow with the norm of :math:`|A|`, which exceeds 1 for most stable filters.
    Powers of A are therefore squared, so that :math:`A^lB` is a product of few factors, at most one for each bit of l.
    The bits of the balls are doubled until the two ends agree to within 2**-40 of the gain.
    """
    for bits in _BITS:
        if (found := _enclosed((A, B, C, D), bits)) is not None:
            if not np.isfinite(found.high).all():
                raise OverflowError("got a system whose largest gain is beyond the range of float64; scale its inputs")
            n = len(found.low) - len(exact(C))
            return Interval(found.low[n:], found.high[n:])
    raise ValueError(f"the gain cannot be enclosed in balls of {_BITS[-1]} bits; use another structure")


def _enclosed(matrices: tuple[Any, ...], bits: int) -> Interval | None:
    """Enclose the gains to states and outputs, (n + p, m), in balls of some bits; None if these are too few."""
    before, ctx.prec = ctx.prec, bits
    try:
        sums = _Sums(*matrices)
        while sums.count < _MOST_TERMS and not sums.lasts():
            sums.add(sums.count or sums.length)
            if sums.ends(_ACCURACY / 2) is None:  # further terms do not make balls smaller
                return None
            if (rest := sums.rest()) is not None and (found := sums.ends(_ACCURACY, rest)) is not None:
                return found
        raise ValueError(_TOO_SLOW)
    finally:
        ctx.prec = before


class _Sums:
    """Sums of :math:`|A^lB|`, n rows, and :math:`|CA^lB|`, p rows, over the first l, in blocks of consecutive l."""

    def __init__(self, A: Any, B: Any, C: Any, D: Any) -> None:
        power, block, self._C = (_balls(each) for each in (A, B, C))
        n, self._inputs = block.nrows(), block.ncols()
        zero = [[arb(0)] * self._inputs]
        direct = zero * self._C.nrows() if D is None else _sizes(_balls(D))
        self._sums, self._n = [*zero * n, *direct], n
        self.count, self.length = 0, 1
        while self._inputs * self.length < _COLUMNS:
            block = arb_mat([[*x, *y] for x, y in zip(block.tolist(), (power * block).tolist(), strict=True)])
            power, self.length = power * power, 2 * self.length
        self._block, self._powers = block, [power]  # A to the power of length, then its squares

    def _power(self, level: int) -> Any:
        """Return A to the power of length times 2**level."""
        while len(self._powers) <= level:
            self._powers.append(self._powers[-1] * self._powers[-1])
        return self._powers[level]

    def _reached(self) -> Any:
        """Return the power of A with which the next term begins; the count is length times a power of two."""
        return self._power((self.count // self.length).bit_length() - 1)

    def lasts(self) -> bool:
        """Whether the response is not negligible after the most terms: the trace is the sum of the eigenvalues."""
        power = self._power((_MOST_TERMS // self.length).bit_length() - 1)
        return bool(abs(power.trace()) > self._n * _SHARP)

    def add(self, terms: int) -> None:
        """Add further terms, a multiple of the length of a block."""
        block = self._reached() * self._block if self.count else self._block
        for each in self._blocks(block, terms // self.length):
            rows, width, m = [*each.entries(), *(self._C * each).entries()], each.ncols(), self._inputs
            for i, row in enumerate(self._sums):
                own = rows[i * width : (i + 1) * width]
                self._sums[i] = [sum(map(abs, own[j::m]), s) for j, s in enumerate(row)]
        self.count += terms

    def _blocks(self, block: Any, count: int) -> Iterator[Any]:
        """Yield a block and those after it; the count is a power of two."""
        if count == 1:
            yield block
            return
        level = count.bit_length() - 2
        yield from self._blocks(block, count // 2)
        yield from self._blocks(self._power(level) * block, count // 2)

    def rest(self) -> list[list[Any]] | None:
        r"""Bound the sums over all later terms; None if no bound follows yet.

        Let S be the sum of :math:`|A^lb|` over the first L terms, and :math:`v \ge S` positive with
        :math:`|A^L|v \le qv`, q < 1. The sum W over all terms obeys :math:`W \le S + |A^L|W`, so
        :math:`W \le v/(1-q)`, and later terms of an output add up to at most :math:`|CA^L|v/(1-q)`. A state whose
        first n terms are zero stays zero, by the theorem of Cayley and Hamilton, and counts for nothing.
        """
        power, columns = self._reached(), []
        rows = arb_mat([*_sizes(power), *_sizes(self._C * power)])
        for j in range(self._inputs):
            sizes = [row[j] for row in self._sums[: self._n]]
            largest = _largest(sizes)
            reached = [not size.is_zero() or self.count < self._n for size in sizes]
            v = [
                _largest([size, largest * _NEGLIGIBLE]) if real else arb(0)
                for size, real in zip(sizes, reached, strict=True)
            ]
            after = (rows * arb_mat([[x] for x in v])).entries()
            q = _largest(x / y for x, y, real in zip(after, v, reached, strict=False) if real)
            if not q < 1:
                return None
            columns.append([x / (1 - q) for x in after])
        return [[*row] for row in zip(*columns, strict=True)]

    def ends(self, accuracy: float, rest: list[list[Any]] | None = None) -> Interval | None:
        """Return both ends of the gains; None if they are too far apart."""
        totals = self._sums
        if rest is not None:
            totals = [[x + y for x, y in zip(*rows, strict=True)] for rows in zip(totals, rest, strict=True)]
        lows = [[arb(x.lower()) for x in row] for row in self._sums]
        highs = [[arb(x.upper()) for x in row] for row in totals]
        if not all(high.is_finite() for row in highs for high in row):
            return None
        for *rows, sizes in zip(lows, highs, self._possible(highs), strict=True):
            for low, high, size in zip(*rows, sizes, strict=True):
                if not (high - low <= accuracy * high or high <= size * _NEGLIGIBLE):
                    return None
        low = np.array([[float(x) * (1 - 2.0**-50) for x in row] for row in lows])
        high = np.array([[float(x) * (1 + 2.0**-50) for x in row] for row in highs])
        positive = np.array([[bool(x > 0) for x in row] for row in highs])
        return Interval(np.maximum(low - _SMALLEST, 0), high + _SMALLEST * positive)

    def _possible(self, highs: list[list[Any]]) -> list[list[Any]]:
        """Return the sizes that states and outputs could have if all states were at their largest at once."""
        states = highs[: self._n]
        largest = [_largest(column) for column in zip(*states, strict=True)]
        return [*[largest] * self._n, *(arb_mat(_sizes(self._C)) * arb_mat(states)).tolist()]


def error_coefficients(A: Any, B: Any, C: Any, D: Any, largest_input: float) -> NDArray[np.float64]:
    r"""Return FixIF's coefficients, the effect on the output of a unit in the last place of each state and output.

    .. math:: E_j = \mathrm{WCPG}(\text{error in } x_j \to y)\cdot 2^{\lceil\log_2\max|x_j|\rceil}

    The output error is at most the sum of :math:`E_j 2^{-w_j}` for w_j bits, up to factors due to the rounding. There
    are n + 1 of them, that of the output last. Source: Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020);
    FixIF's example files.
    """
    n = len(exact(A))
    unit = exact(np.eye(n, dtype=np.int64))
    to_output = peak_gain(A, unit, C)
    states, output = peak_gain(A, B, unit), peak_gain(A, B, C, D)
    low = np.concatenate([states.low[:, 0], output.low[:, 0]]) * largest_input
    high = np.concatenate([states.high[:, 0], output.high[:, 0]]) * largest_input
    exponents = np.ceil(np.log2(high))
    if np.any(exponents != np.ceil(np.log2(low))):
        raise ArithmeticError("the largest value of a state is too near a power of two; use more bits")
    return np.concatenate([to_output.high[0], [1.0]]) * 2.0**exponents


def _balls(values: Any) -> Any:
    return arb_mat([[arb(x.numerator) / arb(x.denominator) for x in row] for row in exact(values)])


def _sizes(X: Any) -> list[list[Any]]:
    """Return the sizes of the entries of a matrix of balls."""
    return [[abs(x) for x in row] for row in X.tolist()]


def _largest(balls: Iterable[Any]) -> Any:
    """Return the largest upper end of balls, which may overlap; infinite if a ball is unbounded."""
    largest = arb(0)
    for ball in balls:
        if not ball.is_finite():
            return arb("inf")
        end = arb(ball.upper())
        largest = end if end > largest else largest
    return largest
