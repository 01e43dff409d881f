r"""Linear systems without a covariance: digital filters, controllers and observers with fixed coefficients.

.. math:: x_{k+1} = A x_k + B u_k, \qquad y_k = C x_k + D u_k

Each row of A and B, and of C and D, is one sum from left to right. The error of an output is the difference from the
system with the given coefficients, so it includes the errors of storing them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm  # type: ignore[import-untyped]

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.kernels.tags import DoubleDouble
from gpbnb.arithmetic.rational import exact, rationals
from gpbnb.arithmetic.search import CHECKED, Search
from gpbnb.bounds.envelope import Limits
from gpbnb.bounds.gains import pack, widened_array
from gpbnb.bounds.guarantee import from_schedule, limits
from gpbnb.bounds.linear import LinearFilter, peak_gain, state_space
from gpbnb.bounds.probable import probable_error
from gpbnb.bounds.storing import stored_sizes, storing_errors
from gpbnb.filters.missing import real_numbers
from gpbnb.filters.named import checked_name, whole_number
from gpbnb.filters.program import Program, advance
from gpbnb.wordlength.requirement import ANY_BINARY, Basis, Requirement, checked_tolerance, largest_ratio, listed


@dataclass(frozen=True, eq=False)
class LinearSystem:
    r"""A linear system with known inputs: :math:`x_{k+1} = Ax_k + Bu_k`, :math:`y_k = Cx_k + Du_k`.

    Entries are stored exactly, as Fractions; numbers, strings and Decimals are read exactly.

    Parameters
    ----------
    A : (n, n), transition.
    B : (n, m), inputs.
    C : (p, n), outputs; by default the states.
    D : (p, m), feedthrough; by default none.
    x0 : (n,), the first state; by default zeros.
    name : name in tables and reports.

    Raises
    ------
    TypeError : an entry that is not a number, or a name that is not text.
    ValueError : shapes that do not fit; NaN or infinity.

    Examples
    --------
    Exponential smoothing that forgets a tenth in each step:

    >>> system = LinearSystem([["0.9"]], [["0.1"]])
    >>> system.n, system.m, system.p
    (1, 1, 1)
    """

    A: NDArray[Any]
    B: NDArray[Any]
    C: Any = None
    D: Any = None
    x0: Any = None
    name: str = "a linear system"

    def __post_init__(self) -> None:
        checked_name(self.name)
        for letter in ("A", "B", "C", "D", "x0"):
            given = getattr(self, letter)
            if given is None and letter in ("C", "D", "x0"):
                n, m = self.A.shape[0], self.B.shape[1]
                given = {
                    "C": np.eye(n, dtype=int),
                    "D": np.zeros((len(self.C) if letter == "D" else n, m), dtype=int),
                    "x0": np.zeros(n, dtype=int),
                }[letter]
            try:
                entries = exact(given)
            except (TypeError, ValueError) as error:
                raise type(error)(f"{letter}: {error}") from None
            if letter != "x0" and (entries.ndim != 2 or not entries.size):
                raise ValueError(f"got {letter} of shape {entries.shape}; needed a matrix")
            entries.flags.writeable = False
            object.__setattr__(self, letter, entries)
        n, m, p = self.n, self.m, self.p
        for letter, shape in (("A", (n, n)), ("B", (n, m)), ("C", (p, n)), ("D", (p, m)), ("x0", (n,))):
            if getattr(self, letter).shape != shape:
                raise ValueError(
                    f"got {letter} of shape {getattr(self, letter).shape}; needed {shape}: A has {n} rows, B {m} "
                    f"columns and C {p} rows"
                )

    @property
    def n(self) -> int:
        """Number of states."""
        return int(self.A.shape[0])

    @property
    def m(self) -> int:
        """Number of inputs."""
        return int(self.B.shape[1])

    @property
    def p(self) -> int:
        """Number of outputs."""
        return int(self.C.shape[0])

    def as_filter(self) -> LinearFilter:
        """Return the same system for the guarantee, with outputs after the states."""
        return state_space(self.A, self.B, self.C, self.D, self.name)

    def outputs(self, u: Any, fmt: FloatFormat | None = None) -> NDArray[np.float64]:
        """Return outputs in a format with every operation rounded, or in double-double, as pairs of float64.

        Parameters
        ----------
        u : (steps, m), inputs; each is rounded into the format.

        Returns
        -------
        y : (steps, p, 2), each output as a sum of two float64.

        Raises
        ------
        OverflowError : a number is beyond the range of float64 or of the format's compiled loops. The message names
            the state or output, counted from 0, and the step, counted from 1.
        """
        given, inputs = self.as_filter(), _inputs(self, u)
        start = np.concatenate([self.x0, exact([0] * self.p)])
        if fmt is None:
            tag: Any = DoubleDouble()
            coefficients, z, x = (double_doubles(exact(each)) for each in (given.coefficients, inputs, start))
        else:
            tag = fmt.run_tag()
            fmt.restart()
            coefficients, z, x = (pack(fmt, each) for each in (given.coefficients, inputs, start))
        program, out = given.program, np.zeros((len(inputs), *x.shape), x.dtype)
        first = x.copy()
        try:
            advance(tag, program.operations, program.outputs, coefficients[None], 0, z, x, out)
        except OverflowError:
            place = self._overflow(tag, program, coefficients, z, first)
            raise OverflowError(f"{place}: {self._beyond(fmt)}") from None
        outputs = np.ascontiguousarray(out[:, self.n :])
        return outputs if fmt is None else self._widened(outputs)

    def unstable(self, fmt: FloatFormat | None = None) -> str:
        """Return in words that the system, as given or as stored in a format, is not stable; empty if both are stable.

        The test is exact, and calls a system with an eigenvalue of size 1 not stable.
        """
        if not is_stable(self.A):
            return f"the system as given is not stable, since A has {_eigenvalue(self.A)}"
        if fmt is not None and not is_stable(stored := np.asarray(fmt.array(self.A).to_fractions(), dtype=object)):
            return f"the system is stable, but as stored in {fmt} it is not, since A has {_eigenvalue(stored)}"
        return ""

    def _beyond(self, fmt: FloatFormat | None) -> str:
        """Return why a number cannot be stored, and what to do about it."""
        what = "a number beyond the range of float64"
        if fmt is not None and (fmt.limits is not None or fmt.base == 10):
            what = f"a number beyond the range of {fmt}"
        if cause := self.unstable(fmt):
            return f"got {what}; {cause}, so numbers grow without end; scaling delays that, no precision prevents it"
        cure = "scale the numbers"
        if fmt is not None and fmt.limits is not None:
            cure += ", or use a format with a larger range"
        elif fmt is not None and fmt.base != 10:
            cure += ", or use base 10"
        return f"got {what}; {cure}"

    def _overflow(self, tag: Any, program: Program, coefficients: Any, z: Any, x: Any) -> str:
        """Return the first state or output that cannot be stored, and its step; `x` is the first state."""
        for k in range(len(z)):
            for i, value in enumerate(program.outputs):
                operations = program.operations[: value - len(x) - z.shape[1] + 1]  # those that lead to this value
                try:
                    advance(
                        tag,
                        operations,
                        np.minimum(program.outputs, value),
                        coefficients[None],
                        0,
                        z[k : k + 1],
                        x.copy(),
                        np.empty((1, *x.shape), x.dtype),
                    )
                except OverflowError:
                    return f"{f'state {i}' if i < self.n else f'output {i - self.n}'} at step {k + 1}"
            advance(tag, program.operations, program.outputs, coefficients[None], 0, z[k : k + 1], x, x[None].copy())
        return "the run"

    def _widened(self, outputs: NDArray[Any]) -> NDArray[np.float64]:
        """Return packed outputs (steps, p) of any format as pairs of float64."""
        try:
            return widened_array(outputs)
        except OverflowError:
            for k, i in np.ndindex(outputs.shape[:2]):
                try:
                    widened_array(outputs[k : k + 1, i : i + 1])
                except OverflowError:
                    raise OverflowError(f"output {i} at step {k + 1}: {self._beyond(None)}") from None
            raise


def required_system_precision(
    system: LinearSystem,
    steps: int,
    tolerance: Any,
    u: Any = None,
    like: FloatFormat = ANY_BINARY,
    basis: Basis = "emulation",
    within: Limits | None = None,
    progress: bool = False,
    largest_tried: int | None = None,
) -> Requirement:
    """Find the smallest precision with which the outputs of a linear system stay within a tolerance.

    Parameters
    ----------
    tolerance : largest error of each output, in its unit; one number, or (p,).
    u : (steps, m), inputs.
    like : a format of any precision, with base, rounding and range of those to try.
    basis : "emulation" compares with the system as given, for these inputs. "bound" holds forever and for every input
        that is never larger than the largest of `u`, from rest; "guarantee" for inputs within the limits on the
        measurement. Both bound rounding, and the errors of storing coefficients and inputs. "probable" takes three
        standard deviations for rounding in place of its bound.
    within : result of :func:`gpbnb.bounds.guarantee.limits`; only the limit on the measurement is used.
    largest_tried : highest precision to try; by default the largest with compiled loops.

    Raises
    ------
    ValueError : inputs are missing or do not fit; the tolerance is not positive; or a bound is required for a system
        that does not start from rest.
    OverflowError : an output of the system as given is beyond the range of float64.
    """
    tolerances = checked_tolerance(tolerance, system.p, "outputs", like.base, basis)
    steps = whole_number("steps", steps)
    if u is None and (within is None or basis in ("emulation", "bound")):
        raise ValueError(f'got no inputs for basis "{basis}"; needed z=, of shape ({steps}, {system.m})')
    largest = np.array([np.inf])
    if u is not None:
        u = _inputs(system, u, steps)
        largest = np.abs(u.astype(np.float64)).max(axis=0)
    if basis in ("guarantee", "probable"):
        if within is None:
            raise ValueError(f'got basis "{basis}" without limits; needed within=limits(..., measurement=...)')
        largest = np.asarray(within.measurement, dtype=np.float64)
        if largest.shape != (system.m,):
            raise ValueError(
                f"got limits of shape {largest.shape} on the measurement; needed ({system.m},), one for each input: "
                f"write limits({system.n}, {system.m}, measurement=...)"
            )
    if basis != "emulation" and any(system.x0):
        raise ValueError(f'got a first state {system.x0.tolist()} and basis "{basis}"; needed x0 = 0 for a bound')
    true = system.outputs(u) if basis == "emulation" else None

    def error(fmt: FloatFormat) -> tuple[float, str]:
        try:
            if true is None and (cause := system.unstable(fmt)):
                return math.inf, cause
            errors = _observed(system, u, fmt, true) if true is not None else _bounded(system, fmt, largest, basis)
        except (ValueError, OverflowError) as fault:
            return math.inf, str(fault)
        ratio = largest_ratio(errors, tolerances)
        if ratio < math.inf:
            return ratio, ""
        what = "an error over its tolerance" if np.isfinite(errors).all() else "an output or a bound"
        return math.inf, f"{what} is beyond the range of float64"

    with tqdm(desc="precisions", unit="run", disable=not progress) as bar:
        found = Search(error, like, CHECKED[like.base], bar.update, basis != "emulation", largest_tried)
    advice = f"no bound exists in {listed(found.undecided)} digits" if found.undecided else ""
    cause = "" if found.fmt is not None else system.unstable()
    if cause and basis == "emulation":
        cause, advice = "", f"{cause}, so that errors grow with every step, whatever the precision: take fewer steps"
    elif cause:
        cause += ", so that an error of rounding never decays"
    return Requirement(
        found.fmt,
        basis,
        steps,
        found.tried,
        found.why,
        None,
        found.irregular,
        advice,
        limit=found.limit,
        cause=cause,
    )


def is_stable(A: NDArray[Any]) -> bool:
    r"""Whether all eigenvalues of an exact matrix lie inside the unit circle, by the exact test of Schur and Cohn.

    A polynomial p with the coefficients :math:`a_0 \dots a_n` is stable if :math:`|a_0| < |a_n|` and
    :math:`(a_n\,p(x) - a_0\,x^n p(1/x))/x` is stable.
    """
    polynomial = rationals(A).charpoly()
    p = [polynomial[i] for i in range(len(A) + 1)]
    while len(p) > 1:
        first, last = p[0], p[-1]
        if not abs(first) < abs(last):
            return False
        share = first / last
        p = [high - share * low for high, low in zip(p[1:], p[-2::-1], strict=True)]
    return True


def unobserved(Phi: NDArray[Any], H: NDArray[Any]) -> str:
    """Return in words that no measurement observes a state which does not decay; empty if there is none.

    The unobserved states are those that H Φᵏ maps to zero for every k; Φ maps them to each other. The test is exact.
    """
    n, rows = len(Phi), [H]
    for _ in range(n - 1):
        rows.append(rows[-1] @ Phi)
    reduced, rank = rationals(np.concatenate(rows)).rref()
    pivots = [next(j for j in range(n) if reduced[i, j]) for i in range(rank)]
    free = [j for j in range(n) if j not in pivots]
    if not free:
        return ""
    basis = np.full((n, len(free)), Fraction(0), dtype=object)
    for at, j in enumerate(free):
        basis[j, at] = Fraction(1)
        for i, pivot in enumerate(pivots):
            basis[pivot, at] = -Fraction(int(reduced[i, j].p), int(reduced[i, j].q))
    moved = (Phi @ basis)[free]  # the coordinates in this basis are the free entries
    if is_stable(moved):
        return ""
    return f"no measurement observes a part of the state that does not decay, with {_eigenvalue(moved)}"


def _eigenvalue(A: NDArray[Any]) -> str:
    """Name the size of the largest eigenvalue of a matrix that is not stable."""
    with np.errstate(all="ignore"):
        entries = A.astype(np.float64)
        size = float(np.abs(np.linalg.eigvals(entries)).max()) if np.isfinite(entries).all() else math.nan
    return f"an eigenvalue of size {size:.6g}" if size > 1 + 1e-6 else "an eigenvalue of size 1 or more"


def _inputs(system: LinearSystem, u: Any, steps: int | None = None) -> NDArray[Any]:
    given = real_numbers(u)
    if given.ndim != 2 or given.shape[1] != system.m or not len(given) or steps not in (None, len(given)):
        column = "; write u.reshape(-1, 1)" if given.ndim == system.m == 1 else ""
        raise ValueError(f"got inputs of shape {given.shape}; needed ({steps or 'steps'}, {system.m}){column}")
    return given if given.dtype.kind == "f" and np.isfinite(given).all() else exact(given)


def _observed(system: LinearSystem, u: Any, fmt: FloatFormat, true: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest error of each output, (p,)."""
    found = system.outputs(u, fmt)
    error = (found[..., 0] - true[..., 0]) + (found[..., 1] - true[..., 1])
    largest = np.abs(error).max(axis=0)
    return np.asarray(np.where(np.isnan(largest), np.inf, largest))


def _bounded(system: LinearSystem, fmt: FloatFormat, largest: NDArray[np.float64], basis: str) -> NDArray[np.float64]:
    """Bound the error of each output, (p,), due to rounding and to storing coefficients and inputs.

    Outputs differ by at most the peak gain of the difference of the given and the stored system times the largest
    input, and the peak gain of the stored system times the largest error of storing an input, underflow included.
    """
    given, n = system.as_filter(), system.n
    stored, count = given.stored(fmt), (n + system.p) ** 2
    AC, BD = stored[:count].reshape(n + system.p, -1)[:, :n], stored[count:].reshape(n + system.p, -1)
    A, B, C, D = AC[:n], BD[:n], AC[n:], BD[n:]
    zero = exact(np.zeros((n, n), dtype=int))
    both = np.block([[system.A, zero], [zero, A]])
    difference = _gain(both, np.vstack([system.B, B]), np.hstack([system.C, -C]), system.D - D)
    inputs = _gain(A, B, C, D)
    storing, sizes = storing_errors(fmt, largest), stored_sizes(fmt, largest)
    if not np.isfinite(storing).all():
        raise ValueError(f"got inputs of up to {largest}; needed inputs within the range of {fmt}")
    unit = exact(np.eye(n, dtype=int))
    state = np.concatenate([_gain(A, B, unit), inputs]) @ sizes * (1 + 2.0**-40)
    if not np.isfinite(state).all():
        raise OverflowError("a state or an output may be beyond the range of float64; scale the numbers")
    within = limits(n + system.p, system.m, state=state, innovation=sizes, measurement=sizes)
    found = from_schedule(given.schedule(fmt), within, 1)
    if not found.for_ever:
        raise ValueError(found.why)
    rounding = found.bound if basis != "probable" else 3 * probable_error(found)
    # sums of m products in float64, with an error below 2**-40
    return np.asarray((rounding[n:] + difference @ largest + inputs @ storing) * (1 + 2.0**-40))


def _gain(*matrices: NDArray[Any]) -> NDArray[np.float64]:
    """Return upper bounds of the peak gains of a system that is known to be stable."""
    try:
        return peak_gain(*matrices).high
    except ValueError:
        raise ValueError(
            "the system is stable, but decays too slowly for its peak gain to be enclosed in balls of 8192 bits; write "
            'it as a cascade of sections, or use basis "emulation"'
        ) from None
