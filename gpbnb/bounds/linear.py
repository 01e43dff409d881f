r"""Linear filters and controllers with fixed coefficients and without a covariance.

A filter :math:`x_k = Ax_{k-1} + Bz_k,\ y_k = Cx_{k-1} + Dz_k` has known coefficients, so the
guarantee needs no emulation of a gain. Its outputs become states that nothing else uses. The exact filter has the same
stored coefficients, so the bound covers only rounding in the computation.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from flint import arb, arb_mat, ctx
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.bounds.gains import Schedule, pack, widened_array
from gpbnb.filters.named import checked_name
from gpbnb.filters.program import Program, biquad_program, controller_program, functionals, state_space_program


@dataclass(frozen=True, eq=False)
class LinearFilter:
    """A linear filter: the operations of a step, and its coefficients, exact.

    Parameters
    ----------
    program : operations of a step.
    coefficients : (c,), exact design values; a format stores each rounded.
    name : name in tables.

    Raises
    ------
    TypeError : a name that is not text.
    """

    program: Program
    coefficients: NDArray[Any]
    name: str = "a linear filter"

    def __post_init__(self) -> None:
        checked_name(self.name)

    def stored(self, fmt: FloatFormat | FixedFormat) -> NDArray[Any]:
        """Return the coefficients as a run in a format stores them, exact, (c,).

        Stochastic rounding begins with its first random number, as in a run.
        """
        fmt.restart()
        return np.asarray(fmt.array(self.coefficients).to_fractions(), dtype=object)

    def schedule(self, fmt: FloatFormat | FixedFormat) -> Schedule:
        """Return the filter in a format, for :func:`gpbnb.bounds.guarantee.from_schedule`.

        Its coefficients are those of :meth:`stored`, so they are fixed even where the format rounds at random. Each
        operation is then off by less than a unit in the last place, as with directed rounding.
        """
        program, first = self.program, self.program.n + self.program.m
        packed = pack(fmt, self.stored(fmt).reshape(1, -1))
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
        )


def state_space(A: Any, B: Any, C: Any = None, D: Any = None, name: str = "a state-space filter") -> LinearFilter:
    """Return a filter from its matrices; with C and D, outputs follow the states.

    Raises
    ------
    ValueError : shapes that do not fit.
    """
    A, B = exact(A), exact(B)
    n, m = B.shape
    outputs = 0 if C is None else len(exact(C))
    if A.shape != (n, n) or (C is not None and (exact(C).shape != (outputs, n) or exact(D).shape != (outputs, m))):
        raise ValueError(
            f"got A of shape {A.shape} and B of shape {B.shape}; needed (n, n) and (n, m), C (p, n), D (p, m)"
        )
    if C is not None:
        nothing = np.full((n + outputs, outputs), Fraction(0), dtype=object)
        A = np.hstack([np.vstack([A, exact(C)]), nothing])
        B = np.vstack([B, exact(D)])
    coefficients = np.concatenate([A.reshape(-1), B.reshape(-1)])
    return LinearFilter(state_space_program(n + outputs, m), coefficients, name)


def biquad(b0: Any, b1: Any, b2: Any, a1: Any, a2: Any, name: str = "a second-order section") -> LinearFilter:
    """Return a second-order section (b0 + b1/z + b2/z²)/(1 + a1/z + a2/z²), transposed form II; output is state 2."""
    return LinearFilter(biquad_program(), exact([b0, b1, b2, a1, a2]), name)


def controller(leak: Any, Ki: Any, Kp: Any, Kd: Any, name: str = "a PID controller") -> LinearFilter:
    """Return a PID controller whose integral decays by the factor `leak` per step; input is the error, output state 2.

    With leak = 1 the integral keeps every rounding error, and there is no bound for all time.
    """
    return LinearFilter(controller_program(), exact([leak, Ki, Kp, Kd]), name)


class Enclosure(NamedTuple):
    """Lower and upper bounds, float64."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


def peak_gain(A: Any, B: Any, C: Any, D: Any = None) -> Enclosure:
    r"""Return the worst-case peak gain :math:`|D| + \sum_{l\ge0}|CA^lB|`, in ball arithmetic; (p, m).

    Balls grow with each product by the norm of :math:`|A|` instead of that of A. The bits are therefore doubled until
    both ends agree to 2**-40.

    Raises
    ------
    ValueError : no power up to 2**20 has a norm below 1, in balls of up to 2**13 bits.
    OverflowError : a gain is beyond the range of float64.
    """
    bits = 256
    while bits <= 2**13:
        found, negligible = _peak_gain(A, B, C, D, bits)
        if found is not None:
            narrow = found.high - found.low <= 2.0**-40 * found.high
            if (narrow | (found.high <= negligible)).all():
                return found
        bits *= 2
    raise ValueError("got a filter for which no power of its matrix was proved to contract; needed a stable filter")


def _peak_gain(A: Any, B: Any, C: Any, D: Any, bits: int) -> tuple[Enclosure | None, float]:
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
        p, m = c.nrows(), b.ncols()
        sums = [[abs(_balls(D)[i, j]) if D is not None else arb(0) for j in range(m)] for i in range(p)]
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
        return Enclosure(low, high), float(first) * 2.0**-100
    finally:
        ctx.prec = before


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
