r"""The guarantee of linear filters with fixed coefficients, and their peak gains in ball arithmetic.

A filter :math:`x_k = Ax_{k-1} + Bz_k,\ y_k = Cx_{k-1} + Dz_k` has known coefficients, so the
guarantee needs no emulation of a gain. Its outputs become states that nothing else uses. The exact filter has the same
stored coefficients, so the bound covers only rounding in the computation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.gains import Schedule
from gpbnb.filters.opening import as_packed, widened_array
from gpbnb.filters.program import functionals
from gpbnb.filters.system import LinearFilter, LinearSystem


def filter_schedule(made: LinearFilter, fmt: FloatFormat | FixedFormat) -> Schedule:
    """Return a filter in a format, for :func:`gpbnb.bounds.guarantee.from_schedule`.

    Its coefficients come from :meth:`~gpbnb.filters.system.LinearFilter.stored`, so they are fixed even if the format
    rounds at random. Each operation is then off by less than a unit in the last place, as with
    directed rounding.

    Raises
    ------
    ValueError : a filter that limits its values, which is not linear.
    """
    if not made.program.is_linear:
        raise ValueError(f"got {made.name}, which limits its values; needed a linear filter for a schedule")
    program, first = made.program, made.program.n + made.program.m
    packed = as_packed(fmt, made.stored(fmt).reshape(1, -1))
    coefficients = widened_array(packed)
    count = first + len(program.operations)
    rows, sizes = np.empty((count, first, 2)), np.empty((count, first))
    functionals(program.operations, coefficients[0], first, rows, sizes)
    whole = rows[program.outputs]
    n, m = program.n, program.m
    return Schedule(
        program,
        fmt,
        coefficients,
        packed,
        np.ascontiguousarray(whole[None, :, :n]),
        np.zeros((1, m, n, 2)),
        np.ascontiguousarray(whole[None, :, n:]),
        np.zeros((1, n, m)),
        np.array([Fraction(0)] * n, dtype=object),
        first=0,
        settled=True,
        repeat=None,
        period=None,
        origin=made,
    )


class Interval(NamedTuple):
    """Lower and upper bounds, float64."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


def peak_gain(A: Any, B: Any, C: Any, D: Any = None, terms: int | None = None) -> Interval:
    r"""Return the worst-case peak gain :math:`|D| + \sum_{l\ge0}|CA^lB|`, in ball arithmetic; (p, m).

    With each product, the radii of the balls grow by the norm of :math:`|A|` instead of the norm of A. The bits are
    therefore doubled until
    both ends agree to 2**-40.

    Parameters
    ----------
    terms : number of terms of the sum, for the gain over a finite time; by default all. The system may then grow.

    Raises
    ------
    ValueError : no power up to 2**20 has a norm below 1, in balls of up to 2**13 bits; more than 2**20 terms, or terms
        that balls of up to 2**15 bits do not enclose.
    OverflowError : a gain is beyond the range of float64.
    """
    if terms is not None and terms > 2**20:
        raise ValueError(f"got a bound over {terms + 1} steps; needed at most {2**20} where no bound holds for ever")
    bits, most = 256, 2**13 if terms is None else 2**15
    while bits <= most:
        if terms is None:
            found, negligible = _peak_gain(A, B, C, D, bits)
        else:
            found, negligible = _finite_gain((A, B, C, D), terms, bits)
        if found is not None:
            narrow = found.high - found.low <= 2.0**-40 * found.high
            if (narrow | (found.high <= negligible)).all():
                return found
        bits *= 2
    if terms is not None:
        raise ValueError(
            f"the gain over {terms + 1} steps cannot be enclosed in balls of {most} bits; take fewer steps"
        )
    raise ValueError("got a filter for which no power of its matrix was proved to contract; needed a stable filter")


def _peak_gain(A: Any, B: Any, C: Any, D: Any, bits: int) -> tuple[Interval | None, float]:
    r"""Sum in balls until the rest is below 2**-50 of each entry or negligible; None if the balls grow too large.

    :math:`\|A^N\|_\infty = q < 1` is proved for a power, and later terms sum up to at most
    :math:`\|CA^L\|_1/(1-q)` times the largest entry of :math:`\sum_{j<N}|A^jB|`. This shares no code with
    :mod:`gpbnb.bounds.envelope` and is its oracle.
    """
    before, ctx.prec = ctx.prec, bits
    try:
        a, b, c = (_balls(each) for each in (A, B, C))
        power, N, most = a, 1, arb(2) ** (bits // 2)
        while not _row_norm(power) < 1:
            power, N = power * power, 2 * N
            if N > 2**20 or not _row_norm(power) < most:
                return None, 0.0
        left = 1 / (1 - _row_norm(power))
        moving = b
        total_columns = [[arb(0)] * b.ncols() for _ in range(b.nrows())]
        for _ in range(N):
            for i in range(b.nrows()):
                for j in range(b.ncols()):
                    total_columns[i][j] += abs(moving[i, j])
            moving = a * moving
        within = _largest(entry for line in total_columns for entry in line)
        sums = _direct(D, c.nrows(), b.ncols())
        p, m = c.nrows(), b.ncols()
        row, steps, first = c, 0, _row_norm(c) * left * within
        while True:
            tail = _row_norm(row) * left * within
            if all(tail < arb(2) ** -50 * s or s + tail < arb(2) ** -100 * first for line in sums for s in line):
                break
            if not tail > arb(2) ** -160 * first:
                break
            if not tail < most * first or steps > 2**20:
                return None, 0.0
            for _ in range(64):
                terms = row * b
                for i in range(p):
                    for j in range(m):
                        sums[i][j] += abs(terms[i, j])
                row = row * a
            steps += 64
        low = np.array([[float(s.lower()) * (1 - 2.0**-50) for s in line] for line in sums])
        high = np.array([[float((s + tail).upper()) * (1 + 2.0**-50) for s in line] for line in sums])
        if not np.isfinite(high).all():
            raise OverflowError("got a filter whose largest gain is beyond the range of float64; scale its inputs")
        return Interval(low, high), float(first) * 2.0**-100
    finally:
        ctx.prec = before


def _finite_gain(matrices: tuple[Any, ...], terms: int, bits: int) -> tuple[Interval | None, float]:
    """Sum a number of terms in balls; return the enclosure, and a negligible size; None if the balls grow too large."""
    before, ctx.prec = ctx.prec, bits
    try:
        A, moving, C = (_balls(each) for each in matrices[:3])
        p, m = C.nrows(), moving.ncols()
        sums = _direct(matrices[3], p, m)
        for _ in range(terms):
            seen = C * moving
            for i in range(p):
                for j in range(m):
                    sums[i][j] += abs(seen[i, j])
            moving = A * moving
        low = np.array([[float(s.lower()) * (1 - 2.0**-50) for s in line] for line in sums])
        high = np.array([[float(s.upper()) * (1 + 2.0**-50) for s in line] for line in sums])
        if (low == np.inf).any():
            raise OverflowError(
                f"got a system whose largest gain over {terms + 1} steps is beyond the range of float64; take fewer"
            )
        if not np.isfinite(high).all():  # the balls are too large
            return None, 0.0
        return Interval(low, high), float(high.max()) * 2.0**-100
    finally:
        ctx.prec = before


class TransferGains(NamedTuple):
    """Upper bounds of the peak gains of a system as stored.

    Parameters
    ----------
    difference, inputs : (p, m), from inputs to the difference of the outputs, and to the outputs.
    states : (n, m), from inputs to states.
    """

    difference: NDArray[np.float64]
    inputs: NDArray[np.float64]
    states: NDArray[np.float64]


def transfer_gains(system: LinearSystem, stored: Sequence[NDArray[Any]], steps: int | None = None) -> TransferGains:
    """Return the peak gains of a system whose exact A, B, C and D, as stored, are given.

    Parameters
    ----------
    steps : number of steps for which the gains hold; by default all time, for a stable system.

    Raises
    ------
    ValueError : the system is not stable, or decays too slowly; or more than 2**20 steps.
    OverflowError : a gain is beyond the range of float64.
    """
    A, B, C, D = stored
    n = system.n
    zero, unit = exact(np.zeros((n, n), dtype=int)), exact(np.eye(n, dtype=int))
    both = np.block([[system.A, zero], [zero, A]])
    if steps is not None:  # the state after a step has one term more than the output of the step
        of_difference = peak_gain(both, np.vstack([system.B, B]), np.hstack([system.C, -C]), system.D - D, steps - 1)
        inputs, states = peak_gain(A, B, C, D, steps - 1), peak_gain(A, B, unit, None, steps)
        return TransferGains(of_difference.high, inputs.high, states.high)
    difference = _gain(both, np.vstack([system.B, B]), np.hstack([system.C, -C]), system.D - D)
    return TransferGains(difference, _gain(A, B, C, D), _gain(A, B, unit))


def _gain(A: NDArray[Any], B: NDArray[Any], C: NDArray[Any], D: NDArray[Any] | None = None) -> NDArray[np.float64]:
    """Return upper bounds of the peak gains of a system that is known to be stable."""
    try:
        return peak_gain(A, B, C, D).high
    except ValueError:
        raise ValueError(
            "the system is stable, but decays too slowly for its peak gain to be enclosed in balls of 8192 bits; write "
            'it as a cascade of sections, or use basis "emulation"'
        ) from None


def error_coefficients(A: Any, B: Any, C: Any, D: Any, largest_input: float) -> NDArray[np.float64]:
    r"""Return FixIF's coefficients, the effect on the output of a unit in the last place of each state and output.

    .. math:: E_j = \mathrm{WCPG}(\text{error in } x_j \to y)\cdot 2^{\lceil\log_2\max|x_j|\rceil}

    The output error is at most the sum of :math:`E_j 2^{-w_j}` for w_j bits, up to factors due to the rounding.

    Returns
    -------
    coefficients : (n + 1,), the output last.

    Raises
    ------
    ArithmeticError : the enclosure of a largest state contains a power of two.

    References
    ----------
    Volkova, Hilaire and Lauter, IEEE Trans. Computers 69 (2020); FixIF's example files.
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


def _direct(D: Any, p: int, m: int) -> list[list[Any]]:
    """Return the sizes of the entries of D, (p, m), zeros without D."""
    if D is None:
        return [[arb(0)] * m for _ in range(p)]
    balls = _balls(D)
    return [[abs(balls[i, j]) for j in range(m)] for i in range(p)]


def _balls(values: Any) -> Any:
    return arb_mat([[arb(x.numerator) / arb(x.denominator) for x in row] for row in exact(values)])


def _row_norm(X: Any) -> Any:
    return _largest(sum((abs(X[i, j]) for j in range(X.ncols())), arb(0)) for i in range(X.nrows()))


def _largest(balls: Iterable[Any]) -> Any:
    """Return the largest upper end of balls, which may overlap; infinite if a ball is unbounded."""
    largest = arb(0)
    for ball in balls:
        if not ball.is_finite():
            return arb("inf")
        end = arb(ball.upper())
        largest = end if end > largest else largest
    return largest
