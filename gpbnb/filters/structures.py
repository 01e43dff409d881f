r"""Structures of a digital filter: each is another list of rounded operations for one transfer function.

.. math:: H(z) = \frac{b_0 + b_1 z^{-1} + \dots + b_M z^{-M}}{1 + a_1 z^{-1} + \dots + a_N z^{-N}}

Without rounding, all structures have the same output. With rounding they differ, because each stores other coefficients
and other states. Here every structure is written once, as a :class:`~gpbnb.filters.program.Program` and its exact
coefficients, in the order in which the operations run:

``direct form I``
    :math:`y = b_0 u + b_1 u_1 + \dots - a_1 y_1 - \dots`, one sum from left to right over delayed inputs and outputs.
``direct form II``
    :math:`w = u - a_1 w_1 - \dots,\; y = b_0 w + b_1 w_1 + \dots`.
``direct form I transposed``
    :math:`v = u - t_1,\; t_i \leftarrow t_{i+1} + a_i v,\; y = b_0 v + s_1,\; s_i \leftarrow s_{i+1} + b_i v`.
``direct form II transposed``
    :math:`y = b_0 u + s_1,\; s_i \leftarrow (b_i u + s_{i+1}) - a_i y`, as in ``scipy.signal.lfilter``.
``cascade of …``
    sections of second order, each in one of these forms.
``lattice``
    reflection coefficients k and taps v: :math:`f_{i-1} = f_i - k_i g_{i-1},\; g_i = g_{i-1} + k_i f_{i-1}` with
    delayed :math:`g_{i-1}`, :math:`y = v_0 g_0 + v_1 g_1 + \dots`.
``state space``
    the companion form; each row of (A, B) and of (C, D) is one sum from left to right.
``balanced state space``
    the same with balanced states, which are as easy to excite as to observe.
``FIR``
    a tapped delay line, for a filter without feedback.

A lattice, a balanced form, and a cascade that is factored from b and a have coefficients that are computed; they are
exact, or have relative errors below 2**-250.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from typing import Any, NamedTuple

import mpmath
import numpy as np
from flint import fmpq, fmpq_mat
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.arithmetic.rational import exact, rationals
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.named import checked_name, naming
from gpbnb.filters.opening import packed_array
from gpbnb.filters.program import AT_LEAST, Program, dot, matrices_of, recorded
from gpbnb.filters.word_formats import WordFormats

DESIGN = FloatFormat(2, 256, Rounding.EVEN)
"""Format of computed coefficients that would be too long as fractions."""

LONGEST = 512
"""Bits of numerator and denominator together up to which a computed coefficient is kept as it is."""


_WORDS = (
    "; coefficients may have a format or a number of significant bits of their own: WordFormats(data, 15), or --kind "
    "words in the command"
)


class Cascade(NamedTuple):
    """How the coefficients of a cascade belong to its sections."""

    form: str  # the direct form of the sections
    lengths: tuple[tuple[int, int], ...]  # for each section, numbers of its coefficients b and a

    def sections(self, coefficients: NDArray[Any]) -> list[tuple[list[Fraction], list[Fraction]]]:
        """Return b and a of each section, without the leading 1 of a."""
        values = iter(coefficients.tolist())
        return [([*islice(values, above)], [*islice(values, below)]) for above, below in self.lengths]


@dataclass(frozen=True, eq=False)
class LinearFilter:
    """A linear filter: the operations of a step, and its coefficients, exact."""

    program: Program
    coefficients: NDArray[Any]  # (c,), the exact design values, which are rounded when a format stores them
    name: str = "a linear filter"  # in tables
    cascade: Cascade | None = None  # its sections, if it is a cascade

    def __post_init__(self) -> None:
        checked_name(self.name)
        try:
            _ = self.program.operations
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from None

    def stored(self, fmt: FloatFormat | FixedFormat | WordFormats) -> NDArray[Any]:
        """Return the coefficients as a run in a format stores them, exact, (c,).

        In fixed point, nothing is multiplied by 1 or -1, which need not be numbers of the format. Stochastic rounding
        begins with its first random number, as in a run.
        """
        if isinstance(fmt, WordFormats):
            kept, limits = fmt.coefficients, self.limits_in(fmt.data)
            found = self.stored(FloatFormat(2, kept) if isinstance(kept, int) else kept or fmt.data)
            found[list(limits)] = [fmt.data.strict.round(each) for each in limits.values()]
            return found
        fmt.restart()
        unit, rounded = self._stored(fmt)
        return np.where(unit, self.coefficients, np.asarray(rounded.to_fractions(), dtype=object))

    def _stored(self, fmt: FloatFormat | FixedFormat) -> tuple[NDArray[np.bool_], FloatArray]:
        """Return which coefficients are exact, and all others in the format."""
        unit, others = np.zeros(len(self.coefficients), np.bool_), self.coefficients.copy()
        if isinstance(fmt, FixedFormat):
            limits = self.limits_in(fmt)
            unit = abs(self.coefficients) == 1
            unit[list(limits)] = False  # limits are data
            others[list(limits)] = list(limits.values())
        others[unit] = Fraction(0)
        try:
            return unit, fmt.store(others)
        except OverflowError:
            raise self._beyond(fmt, others) from None

    def limits_in(self, data: FixedFormat) -> dict[int, Fraction]:
        """Return the coefficients that are limits; one beyond the data, as 1 in Q15, is their last number instead."""
        found = dict[int, Fraction]()
        for code, a, _ in self.program.operations.tolist():
            if code >= AT_LEAST:
                value = self.coefficients[a]
                found[a] = max(value, data.lowest) if code == AT_LEAST else min(value, data.largest)
        return found

    def packed(self, fmt: FloatFormat | FixedFormat) -> NDArray[Any]:
        """Return the coefficients, rounded into a format, as the compiled loops expect them."""
        unit, rounded = self._stored(fmt)
        found = packed_array(rounded)
        if unit.any():  # fixed point has loops for float64 only
            found[unit] = self.coefficients[unit].astype(np.float64)
        return found

    def _beyond(self, fmt: FloatFormat | FixedFormat, coefficients: NDArray[Any]) -> OverflowError:
        """Return the error that names the first coefficient beyond the range of a format."""
        names = self.program.coefficient_names or [str(i) for i in range(len(self.coefficients))]
        for name, value in zip(names, coefficients, strict=True):
            try:
                fmt.strict.round(value)
            except OverflowError as error:
                cure = _WORDS if isinstance(fmt, FixedFormat) else ""
                return OverflowError(f"coefficient {name}: {error}{cure}")
        return OverflowError(f"got coefficients beyond the range of {arithmetic(fmt)}")


class Section(NamedTuple):
    """A section under construction: its coefficients b0 … bM and a1 … aN, and its states."""

    b: Sequence[Any]
    a: Sequence[Any]
    x: Sequence[Any]


Writer = Callable[[Section, Any], tuple[Any, list[Any]]]
"""A function that writes a section for an input; it returns the output, and the next values of the states."""


# -- direct forms -----------------------------------------------------------------------------------------------------


def _direct_1(section: Section, u: Any) -> tuple[Any, list[Any]]:
    b, a, x = section
    inputs, outputs = x[: len(b) - 1], x[len(b) - 1 :]
    y = dot(b, [u, *inputs])
    for coefficient, value in zip(a, outputs, strict=True):
        y = y - coefficient * value
    return y, [*[u, *inputs][: len(inputs)], *[y, *outputs][: len(outputs)]]


def _direct_2(section: Section, u: Any) -> tuple[Any, list[Any]]:
    b, a, x = section
    w = u
    for coefficient, value in zip(a, x, strict=False):
        w = w - coefficient * value
    delayed = [w, *x]
    return dot(b, delayed[: len(b)]), delayed[: len(x)]


def _transposed_1(section: Section, u: Any) -> tuple[Any, list[Any]]:
    b, a, x = section
    t, s = [*x[: len(a)]], [*x[len(a) :]]
    v = u - t[0] if t else u
    y = b[0] * v
    if s:
        y = y + s[0]
    return y, [*_shifted(t, a, v), *_shifted(s, b[1:], v)]


def _shifted(states: list[Any], coefficients: Sequence[Any], v: Any) -> list[Any]:
    """Move a chain of states by one, and add the product of a value to each."""
    moved = []
    for i, coefficient in enumerate(coefficients):
        term = coefficient * v
        moved.append(states[i + 1] + term if i + 1 < len(states) else term)
    return moved


def _transposed_2(section: Section, u: Any) -> tuple[Any, list[Any]]:
    b, a, x = section
    y = b[0] * u
    if x:
        y = y + x[0]
    moved = []
    for i, coefficient in enumerate(b[1:]):
        s = coefficient * u
        if i + 1 < len(x):
            s = s + x[i + 1]
        if i < len(a):
            s = s - a[i] * y
        moved.append(s)
    return y, moved


class _Form(NamedTuple):
    """A direct form: how to write it, its number of states, and their names, for M and N."""

    write: Writer
    states: Callable[[int, int], list[str]]
    pads: bool = False
    """Whether b is extended by zeros to the length of a."""


def _numbered(letter: str, count: int) -> list[str]:
    return [f"{letter}{i + 1}" for i in range(count)]


DIRECT = {
    "direct form I": _Form(_direct_1, lambda M, N: _numbered("u", M) + _numbered("y", N)),
    "direct form II": _Form(_direct_2, lambda M, N: _numbered("w", max(M, N))),
    "direct form I transposed": _Form(_transposed_1, lambda M, N: _numbered("t", N) + _numbered("s", M)),
    "direct form II transposed": _Form(_transposed_2, lambda M, N: _numbered("s", max(M, N)), pads=True),
}
"""The direct forms, by name."""

USUAL = "direct form II transposed"
"""The form of sections, if none is named."""

CASCADES = tuple(f"cascade of {name}" for name in DIRECT)

STRUCTURES = (*DIRECT, *CASCADES, "lattice", "state space", "balanced state space")
"""Names of all structures of a filter with feedback; one without also has the structure "FIR"."""

WITH_FIR = (*STRUCTURES, "FIR")
"""Names of all structures."""


_DOUBLINGS = 64
"""After so many doublings, a sum over 2**64 steps would have converged for any eigenvalue below 1 in float64."""


def check_of_cascade(structure: str, **options: Any) -> None:
    """Reject options, each None if not given, that only a cascade has."""
    given = [name for name, value in options.items() if value is not None]
    if given and structure not in CASCADES:
        raise ValueError(
            f"got {' and '.join(given)} for {structure!r}; needed a cascade, whose sections have them; use structure "
            f"'cascade of {USUAL}', or leave out {' and '.join(given)}"
        )


def structure_named(name: Any, among: Sequence[str] = WITH_FIR) -> str:
    """Return the name of a structure as this module writes it; case and spaces do not matter.

    "cascade" alone stands for a cascade of sections in the transposed direct form II.

    Examples
    --------
    >>> structure_named("Direct Form I")
    'direct form I'
    """
    wanted = " ".join(name.lower().replace("-", " ").split()) if isinstance(name, str) else name
    if wanted == "cascade":
        wanted = f"cascade of {USUAL}".lower()
    for each in among:
        if wanted == each.lower():
            return each
    raise ValueError(f"got structure {name!r}; needed one of {', '.join(map(repr, among))}")


# -- coefficients -----------------------------------------------------------------------------------------------------


def transfer_function(b: Any, a: Any) -> tuple[list[Fraction], list[Fraction]]:
    """Check the coefficients of a filter, and return them exact, divided by a[0], without zeros at their end.

    These are b0 … bM, at least b0, and a1 … aN, without the leading 1.
    """
    rows = []
    for letter, given in (("b", b), ("a", a)):
        with naming(letter):
            entries = exact(given)
        if entries.ndim > 1 or not entries.size:
            raise ValueError(
                f"got {letter} of shape {entries.shape}; needed one row of coefficients, such as [1, -0.5]"
            )
        rows.append(np.atleast_1d(entries).tolist())
    top, bottom = rows
    if not bottom[0]:
        raise ValueError("got a[0] = 0; needed a first coefficient that is not 0: the output is divided by it")
    top, bottom = ([each / bottom[0] for each in row] for row in (top, bottom))
    for row in (top, bottom):
        while len(row) > 1 and not row[-1]:
            row.pop()
    if len(top) == len(bottom) == 1:
        raise ValueError("got b and a without any delay; needed at least a second coefficient in one of them")
    return top, bottom[1:]


def sections_of(sos: Any) -> list[tuple[list[Fraction], list[Fraction]]]:
    """Check second-order sections, and return b and a of each as :func:`transfer_function` does.

    They are (sections, 6), with rows b0, b1, b2, a0, a1, a2, as in ``scipy.signal``.
    """
    entries = exact(sos)
    if entries.ndim != 2 or entries.shape[1:] != (6,) or not len(entries):
        fives = entries.size % 5 == 0 and entries.shape[-1:] != (6,)
        cure = "; rows of CMSIS-DSP, b0, b1, b2, -a1, -a2, become b0, b1, b2, 1 and the last two with the other sign"
        raise ValueError(
            f"got sections of shape {entries.shape}; needed (sections, 6), rows of b0, b1, b2, a0, a1, a2 as in SciPy"
            f"{cure if fives else ''}"
        )
    found = []
    for i, row in enumerate(entries):
        with naming(f"section {i}"):
            found.append(transfer_function(row[:3], row[3:]))
    return found


def expanded(sections: Sequence[tuple[list[Fraction], list[Fraction]]]) -> tuple[list[Fraction], list[Fraction]]:
    """Multiply sections, and return b and a of the whole filter; a begins with 1."""
    b, a = [Fraction(1)], [Fraction(1)]
    for top, bottom in sections:
        b, a = _product(b, top), _product(a, [Fraction(1), *bottom])
    return b, a


def _product(p: Sequence[Fraction], q: Sequence[Fraction]) -> list[Fraction]:
    found = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, x in enumerate(p):
        for j, y in enumerate(q):
            found[i + j] += x * y
    return found


def shortened(values: Sequence[Fraction]) -> list[Fraction]:
    """Round computed coefficients that are longer than :data:`LONGEST` to 256 bits."""
    return [
        each if each.numerator.bit_length() + each.denominator.bit_length() <= LONGEST else DESIGN.round(each)
        for each in values
    ]


# -- structures -------------------------------------------------------------------------------------------------------


def cascade(sections: Sequence[tuple[Sequence[Fraction], Sequence[Fraction]]], name: str) -> LinearFilter:
    """Return sections in a row, each in the direct form with this name; the output of one is the input of the next."""
    form = DIRECT[name]
    padded = [([*b, *[Fraction(0)] * (len(a) + 1 - len(b))] if form.pads else [*b], [*a]) for b, a in sections]
    names = [form.states(len(b) - 1, len(a)) for b, a in padded]
    ends = [f"_{i + 1}" if len(padded) > 1 else "" for i in range(len(padded))]
    labels = [
        f"{letter}{j}{end}"
        for (b, a), end in zip(padded, ends, strict=True)
        for letter, j in [*(("b", j) for j in range(len(b))), *(("a", j + 1) for j in range(len(a)))]
    ]
    states = [each + end for own, end in zip(names, ends, strict=True) for each in own]
    outputs = list[Any]()

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        value, given, kept, moved = u[0], iter(c), iter(x), list[Any]()
        for (b, a), own in zip(padded, names, strict=True):
            parts = ([*islice(each, count)] for each, count in ((given, len(b)), (given, len(a)), (kept, len(own))))
            value, following = form.write(Section(*parts), value)
            outputs.append(value)
            moved += following
        return [*moved, value]

    program = recorded(step, len(states) + 1, 1, len(labels), 1, [*states, "y"], labels, outputs)
    lengths = tuple((len(b), len(a)) for b, a in padded)
    coefficients = exact([each for b, a in padded for each in (*b, *a)])
    return LinearFilter(program, coefficients, cascade=Cascade(name, lengths) if len(padded) > 1 else None)


def lattice(b: Sequence[Fraction], a: Sequence[Fraction]) -> LinearFilter:
    """Return the lattice and ladder of a filter, with two products for each reflection coefficient."""
    K = max(len(b) - 1, len(a))
    k, v = reflections([*b, *[Fraction(0)] * (K + 1 - len(b))], [Fraction(1), *a, *[Fraction(0)] * (K - len(a))])

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        f, backward = u[0], [u[0]] * (K + 1)
        for i in range(K, 0, -1):
            f = f - c[i - 1] * x[i - 1]
            backward[i] = x[i - 1] + c[i - 1] * f
        backward[0] = f
        return [*backward[:K], dot(c[K:], backward)]

    names = [f"k{i + 1}" for i in range(K)] + [f"v{i}" for i in range(K + 1)]
    states = [*(f"g{i}" for i in range(K)), "y"]
    return LinearFilter(recorded(step, K + 1, 1, 2 * K + 1, 1, states, names), exact([*k, *v]))


def reflections(b: Sequence[Fraction], a: Sequence[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Return the reflection coefficients (K,) and the taps (K + 1,) of a filter, by stepping down its order.

    Its coefficients b and a are (K + 1,), a with its leading 1.
    """
    a, b = [*a], [*b]
    k, v = [Fraction(0)] * (len(a) - 1), [Fraction(0)] * len(a)
    for i in range(len(a) - 1, 0, -1):
        v[i], k[i - 1] = b[i], a[i]
        if abs(a[i]) == 1:
            raise ValueError(
                f"got a filter with the reflection coefficient k{i} = {a[i]}; needed sizes below 1 for a lattice: the "
                "filter is not stable; use another structure"
            )
        b = [b[j] - v[i] * a[i - j] for j in range(i)]
        a = [(a[j] - a[i] * a[i - j]) / (1 - a[i] ** 2) for j in range(i)]
        b, a = shortened(b), shortened(a)
    v[0] = b[0]
    return shortened(k), shortened(v)


def companion(b: Sequence[Fraction], a: Sequence[Fraction]) -> tuple[NDArray[Any], ...]:
    """Return A, B, C and D of a filter in its companion form, exact."""
    K = max(len(b) - 1, len(a))
    top, bottom = [*b, *[Fraction(0)] * (K + 1 - len(b))], [*a, *[Fraction(0)] * (K - len(a))]
    A = exact(np.eye(K, k=-1, dtype=int))
    A[0] = [-each for each in bottom]
    B = exact(np.eye(K, 1, dtype=int))
    C = np.array([[x - top[0] * y for x, y in zip(top[1:], bottom, strict=True)]], dtype=object)
    return A, B, C, exact([[top[0]]])


def balanced(matrices: Sequence[NDArray[Any]]) -> tuple[NDArray[Any], ...]:
    """Return A, B, C and D in balanced states: their matrices of reachability and of observability are near equal.

    The change of states is computed with 256 bits and then applied exactly, so the filter stays the same.
    """
    A, B, C, D = matrices
    with mpmath.workprec(DESIGN.precision):
        a, b, c = (mpmath.matrix(each.tolist()).apply(mpmath.mpmathify) for each in (A, B, C))
        try:
            reach = mpmath.cholesky(_gramian(a, b * b.T))
            seen = mpmath.cholesky(_gramian(a.T, c.T * c))
            U, sizes, _ = mpmath.svd_r(reach.T * seen)
            if sizes[len(sizes) - 1] <= sizes[0] * 2.0**-128:
                raise ValueError("a state has almost no part in its response")
        except (ValueError, ZeroDivisionError) as error:
            raise ValueError(
                f"got a filter whose states cannot be balanced: {error}; needed a stable filter, each of whose states "
                "is moved by the input and moves the output; use another structure, for example a cascade"
            ) from None
        scaled = reach * U * mpmath.diag([1 / mpmath.sqrt(size) for size in sizes])
    change = rationals(np.array(scaled.tolist(), dtype=object))
    back = change.inv()
    changed = (back * rationals(A) * change, back * rationals(B), rationals(C) * change)
    return (*map(_fractions, changed), D)


def _gramian(A: Any, Q: Any) -> Any:
    r"""Return :math:`X = AXA^T + Q`, the sum of :math:`A^kQ(A^k)^T` over all k, with 2, 4, 8, … terms."""
    X = Q
    for _ in range(_DOUBLINGS):
        added = A * X * A.T
        X, A = X + added, A * A
        if mpmath.mnorm(added, "f") <= mpmath.eps * mpmath.mnorm(X, "f"):
            return (X + X.T) / 2
    raise ValueError("its covariance does not converge")


def _fractions(matrix: fmpq_mat) -> NDArray[Any]:
    found = np.empty((matrix.nrows(), matrix.ncols()), dtype=object)
    for i, j in np.ndindex(found.shape):
        entry: fmpq = matrix[i, j]
        found[i, j] = shortened([Fraction(int(entry.p), int(entry.q))])[0]
    return found


def state_space(A: Any, B: Any, C: Any = None, D: Any = None, name: str = "a state-space filter") -> LinearFilter:
    """Return a filter from its matrices; with C (p, n) and D (p, m), its last p states are the outputs."""
    A, B, C, D = (each if each is None else exact(each) for each in (A, B, C, D))
    n, m = B.shape
    p = 0 if C is None else len(C)
    if A.shape != (n, n) or (C is not None and (C.shape != (p, n) or D.shape != (p, m))):
        raise ValueError(
            f"got A of shape {A.shape} and B of shape {B.shape}; needed (n, n) and (n, m), C (p, n), D (p, m)"
        )
    names = [
        f"{letter}{i + 1}_{j + 1}"
        for letter, each in zip("ABCD", (A, B, C, D), strict=True)
        for i, j in np.ndindex(each.shape if each is not None else (0, 0))
    ]

    def step(coefficients: Any, x: Any, u: Any) -> list[Any]:
        a, b, c, d = matrices_of(coefficients, (n, n), (n, m), (p, n), (p, m))
        values = [*x[:n], *u]
        return [dot([*left, *right], values) for left, right in [*zip(a, b, strict=True), *zip(c, d, strict=True)]]

    states = [*_numbered("x", n), *(["y"] if p == 1 else _numbered("y", p))]
    coefficients = np.concatenate([np.asarray(each).reshape(-1) for each in (A, B, C, D) if each is not None])
    return LinearFilter(recorded(step, n + p, m, len(coefficients), p, states, names), coefficients, name)


# -- sums, smoothing and control --------------------------------------------------------------------------------------


SUMS = ("left", "pairwise", "blocked", "tree")
"""Orders in which a sum is added, those of :func:`gpbnb.arithmetic.linalg.matmul`, and neighbours level by level."""


def sum_structure(count: int, order: str, block: int, running: bool) -> LinearFilter:
    """Return the sum of the inputs of a step, added to that of all earlier steps if it is running.

    The states are the sum, and the sum again as output.
    """

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        total = _SUMMED[order](u, block)
        if running:
            total = x[0] + total
        return [total, total]

    return LinearFilter(recorded(step, 2, count, 0, 1, ["sum", "y"]), exact(np.zeros(0, dtype=int)))


def _in_a_row(values: Any, block: int) -> Any:
    total = values[0]
    for each in values[1:]:
        total = total + each
    return total


def _by_halves(values: Any, block: int) -> Any:
    if len(values) == 1:
        return values[0]
    half = len(values) // 2
    return _by_halves(values[:half], block) + _by_halves(values[half:], block)


def _by_levels(values: Any, block: int) -> Any:
    while len(values) > 1:
        pairs = len(values) // 2 * 2
        values = np.concatenate([values[:pairs:2] + values[1:pairs:2], values[pairs:]])
    return values[0]


def _by_blocks(values: Any, block: int) -> Any:
    return _in_a_row([_in_a_row(values[i : i + block], 0) for i in range(0, len(values), block)], 0)


_SUMMED = dict(zip(SUMS, (_in_a_row, _by_halves, _by_blocks, _by_levels), strict=True))


def smoother(alpha: Fraction) -> LinearFilter:
    """Return exponential smoothing :math:`y + α(u - y)`; the states are y, and y again as output."""

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        y = x[0] + c[0] * (u[0] - x[0])
        return [y, y]

    return LinearFilter(recorded(step, 2, 1, 1, 1, ["y1", "y"], ["alpha"]), exact([alpha]))


def controller(
    Kp: Fraction,
    Ki: Fraction,
    leak: Fraction,
    Kd: Fraction | None,
    limits: tuple[Fraction, Fraction] | None,
    integral_limits: tuple[Fraction, Fraction] | None,
    back: Fraction | None,
) -> LinearFilter:
    """Return a PI or PID controller, with up to four states: integral, last error, excess over the limits, and output.

    Its equations are those of :meth:`gpbnb.filters.system.LinearSystem.pid`; None stands for a term that is absent.
    """
    numbers: dict[str, Fraction] = {"leak": leak, "Ki": Ki, "Kp": Kp}
    if Kd is not None:
        numbers["Kd"] = Kd
    for end, pair in (("", limits), ("_integral", integral_limits)):
        if pair is not None:
            numbers[f"low{end}"], numbers[f"high{end}"] = pair
    if back is not None:
        numbers["Kb"] = back
    states = ["integral", *(["last"] if "Kd" in numbers else []), *(["excess"] if "Kb" in numbers else []), "y"]

    def step(c: Any, x: Any, u: Any) -> list[Any]:
        given, state, error = dict(zip(numbers, c, strict=True)), dict(zip(states, x, strict=True)), u[0]
        integral = given["leak"] * state["integral"] + given["Ki"] * error
        if "Kb" in given:
            integral = integral + given["Kb"] * state["excess"]
        if "low_integral" in given:
            integral = np.minimum(np.maximum(integral, given["low_integral"]), given["high_integral"])
        steep = given["Kd"] * (error - state["last"]) if "Kd" in given else None
        output = given["Kp"] * error + integral
        if steep is not None:
            output = output + steep
        limited = output
        if "low" in given:
            limited = np.minimum(np.maximum(output, given["low"]), given["high"])
        following = {"integral": integral, "last": error, "y": limited}
        if "Kb" in given:
            following["excess"] = limited - output
        return [following[each] for each in states]

    program = recorded(step, len(states), 1, len(numbers), 1, states, list(numbers))
    return LinearFilter(program, exact(list(numbers.values())))
