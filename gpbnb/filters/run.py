"""A resumable filter run with every operation rounded, or in double-double as the reference."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import Compiled, double_doubles
from gpbnb.arithmetic.kernels.tags import Decimal, DoubleDouble, Tag
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Order
from gpbnb.filters.factors import combined_gain, covariance_of_factors
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.bounded import widen
from gpbnb.filters.kernels.step import DONE, INDEFINITE, NEXT_CHECKPOINT, QUANTITIES, STOPPED, advance, advance_ud
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import compiled_form
from gpbnb.filters.opening import as_packed, opening
from gpbnb.filters.reference import precise_steps

LEAST_SHARE = 2.0**-60
"""Smallest share of the noise in an innovation that double-double resolves; see :func:`reference`."""

BLOCK = 256
"""Number of steps whose results are kept at a time."""


class Run:
    """A resumable run of a filter: inputs, state and checkpoints.

    Parameters
    ----------
    model : n states, m measurements.
    fmt : the format in which everything is stored and computed; None for double-double.
    form : form in which a step is computed, or its name, such as "UD".
    checkpoint_steps : steps, 1 or more, after which estimate, gain and covariance are saved, in ascending order.
    fused : whether products are added by fused multiply-add; base 2 or 16.
    sums : the format that keeps the sums of matrix products until they are stored; `fmt` itself by default.
    compensated : whether the estimate is updated by Kahan's compensated summation, which carries the rounding error of
        a step over to the next; only for the innovation form and Joseph's.
    order, block : order of the additions in matrix products, as for :func:`gpbnb.arithmetic.linalg.matmul`. Orders
        other than "left" need base 2 or 16, and a form other than UD, which has few matrix products.

    Raises
    ------
    ValueError : a format or form without compiled loops; checkpoint steps that do not ascend; compensation or another
        order of additions in a form that does not have it; covariances that lose their definiteness when they are
        factored or inverted in this format, see :mod:`gpbnb.filters.opening`.
    TypeError : `sums` is not a format.
    OverflowError : the model has entries beyond the range of the format's backend.
    """

    def __init__(
        self,
        model: LinearModel,
        fmt: FloatFormat | None,
        form: Form | str,
        checkpoint_steps: Sequence[int],
        fused: bool = False,
        sums: FloatFormat | FixedFormat | None = None,
        compensated: bool = False,
        order: Order = "left",
        block: int = 32,
    ) -> None:
        model.refuse_inputs("a run in compiled loops")
        self.model, self.fmt, self.form = model, fmt, compiled_form(form)
        steps = np.array(checkpoint_steps).reshape(-1)
        if steps.size and steps.dtype.kind not in "iu":
            raise ValueError(f"got checkpoint steps {list(checkpoint_steps)[:5]} …; needed whole numbers")
        self.checkpoint_steps = steps.astype(np.int64)
        if np.any(np.diff(self.checkpoint_steps, prepend=0) <= 0):
            raise ValueError(
                f"got checkpoint steps {list(checkpoint_steps)[:5]} …; needed increasing steps of 1 or more"
            )
        if fmt is not None:
            fmt.check_compiled()
        if sums is not None and not isinstance(sums, (FloatFormat, FixedFormat)):
            raise TypeError(f"sums: got {sums!r}; needed a FloatFormat or a FixedFormat")
        if compensated and self.form not in (Form.INNOVATION, Form.JOSEPH):
            raise ValueError(
                f"got compensated summation in the {self.form} form; needed the innovation form or Joseph's"
            )
        if order != "left" and self.form is Form.UD:
            raise ValueError(f"got {order} sums in the UD form; needed another form")
        #: The arithmetic of the compiled loops.
        self.tag: Tag = DoubleDouble() if fmt is None else fmt.run_tag(fused, sums, order, block)
        start = opening(model, fmt, self.form, self.tag)
        #: Changes of the covariances, including those of the model.
        self.repairs = list(start.repairs)
        PhiT, HT = (np.ascontiguousarray(np.swapaxes(each, 1, 2)) for each in (start.Phi, start.H))
        n, m, count = model.n, model.m, len(self.checkpoint_steps)
        identity = self.as_packed(np.eye(n, dtype=int))
        self.x = np.ascontiguousarray(start.x0[:, np.newaxis])
        self.P = start.U0 if self.form is Form.UD else start.P0
        self.UQ, self.UR = start.UQ, start.UR
        self.X, self.G, self.C = (
            np.zeros((count, *shape, *self.x.shape[2:]), self.x.dtype) for shape in ((n, 1), (n, m), (n, n))
        )
        self.notes = np.zeros(4, dtype=np.int64)
        increment = self.as_packed(model.Phi - np.eye(n, dtype=int) if compensated else np.zeros((0, n, n)))
        self._place = np.zeros(1, dtype=np.int64)  # of QUANTITIES
        rest = (identity, increment, np.zeros_like(self.x), self._place)
        self.matrices = (start.Phi, PhiT, start.H, HT, start.Q, start.R, start.RI, *rest)
        #: Why the run stopped, if it did.
        self.reason = ""

    @property
    def steps(self) -> int:
        """Number of steps done."""
        return int(self.notes[DONE])

    @property
    def indefinite(self) -> int | None:
        """The first step at which a variance or a pivot of the innovation covariance was not positive."""
        return int(self.notes[INDEFINITE]) or None

    @property
    def stopped(self) -> int | None:
        """The step at which a division by zero, or a number beyond the range of the backend, ended the run."""
        return int(self.notes[STOPPED]) or None

    def take(self, z: Any) -> None:
        """Continue by as many steps as there are measurements, (steps, m); a run that has stopped does not continue."""
        self.model.check_measurements(z, self.steps)
        if self.stopped:
            return
        try:
            self.advance(self.pack_measurements(z), (self.checkpoint_steps, self.X, self.G, self.C), self.notes)
        except (OverflowError, ZeroDivisionError) as error:
            self.notes[STOPPED] = self.steps + 1
            self.reason = self.stopped_by(error)
        else:
            if self.stopped:
                self.reason = f"a zero pivot in the innovation covariance at step {self.stopped}"

    def states(self, z: Any) -> NDArray[np.float64]:
        """Continue by as many steps as there are measurements, (steps, m), and return all estimates.

        Returns
        -------
        x : (steps done, n, 2), as double-double.
        """
        found = [np.zeros((0, self.model.n, 2))]
        found += [widened(x)[1:, :, 0] for x, _ in self.blocks(z)]
        return np.concatenate(found)

    def blocks(self, z: Any) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
        """Continue as :meth:`take` does, and give estimates and covariances, as :meth:`take_block`."""
        self.model.check_measurements(z, self.steps)
        packed = self.pack_measurements(z)
        for begin in range(0, len(packed), BLOCK):
            if not self.stopped:
                x, _, P = self.take_block(packed[begin : begin + BLOCK])
                yield x, P

    def pack_measurements(self, z: Any) -> NDArray[Any]:
        """Round measurements (steps, m) into the format, as :meth:`advance` expects them."""
        packed = self.as_packed(z)
        return packed.reshape(len(packed), self.model.m, 1, *packed.shape[2:])

    def take_block(self, z: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Take some steps with packed measurements; return estimates, gains and covariances, or factors.

        The first of each is that before these steps, for the gain zeros; one follows for each step done.
        """
        first, at = self.steps, int(self.notes[NEXT_CHECKPOINT])
        x, K, P = (np.zeros((len(z) + 1, *each.shape[1:]), each.dtype) for each in (self.X, self.G, self.C))
        x[0], P[0] = self.x, self.P
        every, notes = np.arange(first + 1, first + len(z) + 1), self.notes.copy()
        notes[NEXT_CHECKPOINT] = 0
        failure: ArithmeticError | None = None
        try:
            self.advance(z, (every, x[1:], K[1:], P[1:]), notes)
        except (OverflowError, ZeroDivisionError) as error:
            notes[STOPPED], failure = notes[DONE] + 1, error
        done = int(notes[DONE]) - first
        notes[NEXT_CHECKPOINT] = np.searchsorted(self.checkpoint_steps, notes[DONE], side="right")
        saved = slice(at, notes[NEXT_CHECKPOINT])
        rows = self.checkpoint_steps[saved] - first
        self.X[saved], self.G[saved], self.C[saved], self.notes[:] = x[rows], K[rows], P[rows], notes
        if self.stopped:
            pivot = f"a zero pivot in the innovation covariance at step {self.stopped}"
            self.reason = self.stopped_by(failure) if failure else pivot
        return x[: done + 1], K[: done + 1], P[: done + 1]

    def advance(self, z: NDArray[Any], kept: tuple[NDArray[Any], ...], notes: NDArray[np.int64]) -> None:
        """Take one step per packed measurement, (steps, m, columns of x).

        Parameters
        ----------
        kept : the checkpoint steps; arrays for estimates, gains and covariances, or factors, at them.
        notes : the status of the run, which is brought up to date.

        Raises
        ------
        OverflowError, ZeroDivisionError : one more step than are noted as done came to that.
        """
        if self.form is Form.UD:
            Phi, _, H, HT, *_ = self.matrices
            factors = Phi, H, HT, self.UQ, self.UR, self._place
            advance_ud(self.tag, factors, z, self.steps, self.x, self.P, kept, notes)
        else:
            repeated = kept[1][:0], kept[3][:0], self.UR[:0]
            advance(self.tag, int(self.form), self.matrices, z, self.steps, self.x, self.P, repeated, kept, notes)

    def stopped_by(self, error: ArithmeticError) -> str:
        """Name the cause that ended the last step, as in "overflow in the gain at step 812"."""
        kind = "overflow" if isinstance(error, OverflowError) else "a division by zero"
        return f"{kind} in {QUANTITIES[int(self._place[0])]} at step {self.stopped}"

    def as_packed(self, values: Any) -> NDArray[Any]:
        """Round numbers into the format, and return them as the compiled loops expect them."""
        return as_packed(self.fmt, values)

    def exactly(self, packed: NDArray[Any]) -> NDArray[Any]:
        """Convert results of the compiled loops to exact Fractions."""
        if self.fmt is None:
            high, low = (part.astype(object) for part in (packed[..., 0], packed[..., 1]))
            return np.asarray(np.frompyfunc(_exact_sum, 2, 1)(high, low), dtype=object)
        backend = cast(Compiled, self.fmt.backend)
        return np.asarray(
            FloatArray.from_components(backend, backend.unpack(packed), self.fmt).to_fractions(), dtype=object
        )

    def checkpoints(self) -> Checkpoints:
        """Return estimate, gain and covariance at the checkpoint steps that were reached."""
        count = int(self.notes[NEXT_CHECKPOINT])
        x, K, P = (self.exactly(each[:count]) for each in (self.X, self.G, self.C))
        if self.form is Form.UD:
            K, P = self._from_factors(K, P)
        return Checkpoints(tuple(int(step) for step in self.checkpoint_steps[:count]), x[..., 0], K, P)

    def _from_factors(self, K: NDArray[Any], U: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return gains and covariances from factors and from the gains of one measurement after the other."""
        gains, covariances = np.empty_like(K), np.empty_like(U)
        H, UR = self.exactly(self.matrices[2]), self.exactly(self.UR)
        for at, step in enumerate(self.checkpoint_steps[: len(K)] - 1):
            gains[at] = combined_gain(list(K[at].T), UR[step % len(UR)], H[step % len(H)])
            covariances[at] = covariance_of_factors(U[at])
        return gains, covariances


def _exact_sum(high: float, low: float) -> Fraction:
    # Both denominators are powers of two: faster than the sum of two Fractions.
    (n, d), (p, q) = high.as_integer_ratio(), low.as_integer_ratio()
    return Fraction(n * (q // d) + p, q) if q > d else Fraction(n + p * (d // q), d)


def widened(packed: NDArray[Any]) -> NDArray[np.float64]:
    """Convert results of compiled loops in any format, (k, n, m) or (k, n, m, 2), to double-double."""
    if packed.ndim == 3:
        return np.stack([packed, np.zeros_like(packed)], axis=-1)
    if packed.dtype == np.float64:
        return np.ascontiguousarray(packed)
    wide = np.empty(packed.shape)
    widen(Decimal(1, True), packed, wide)  # of any precision
    return wide


@dataclass(frozen=True, eq=False)
class Checkpoints:
    """Exact values after some steps, object arrays of Fractions: x (c, n), K (c, n, m), P (c, n, n)."""

    steps: tuple[int, ...]
    x: NDArray[Any]
    K: NDArray[Any]
    P: NDArray[Any]


def log_spaced(steps: int, per_decade: int = 4) -> tuple[int, ...]:
    """Return steps from 1 to the last, at equal ratios.

    Raises
    ------
    ValueError : no steps, or none per decade.
    """
    if steps < 1 or per_decade < 1:
        raise ValueError(f"got {steps} steps, {per_decade} per decade; needed both at least 1")
    grid = np.rint(10 ** (np.arange(0, int(math.log10(steps) * per_decade) + 1) / per_decade))
    return tuple(sorted({int(k) for k in grid if k <= steps} | {steps}))


def reference(
    model: LinearModel, z: Any, checkpoint_steps: Sequence[int], form: Form | str = Form.INNOVATION
) -> Checkpoints:
    """Run the filter in double-double, whose operations have relative errors below 2**-102.

    Where it would lose half of these digits, :mod:`gpbnb.filters.reference` computes the filter instead.

    Parameters
    ----------
    model : also with known inputs and offsets.
    z : (steps, m), measurements; float64 or Fractions.
    checkpoint_steps : steps whose results are saved.

    Raises
    ------
    ArithmeticError : the model is degenerate, or more digits are necessary for too many steps.
    """
    run = Run(model.without_inputs(), None, form, checkpoint_steps)
    if model.has_inputs:
        _take_with_inputs(run, model, z)
    else:
        run.take(z)
    if run.form is not Form.UD:
        start = Run(model.without_inputs(), None, run.form, ()).P
        count = int(run.notes[NEXT_CHECKPOINT])
        at = np.array([0, *run.checkpoint_steps[:count]])
        if run.stopped or _loses_digits(model, at, np.concatenate([start[None], run.C[:count]])):
            steps = precise_steps(model, z)
            x, K, P = zip(*(steps[step - 1] for step in run.checkpoint_steps), strict=True)
            return Checkpoints(tuple(int(each) for each in run.checkpoint_steps), *(np.array(v) for v in (x, K, P)))
    if run.stopped:
        raise ArithmeticError(f"{model.name}: the reference stopped at step {run.stopped}; scale or correct the model")
    return run.checkpoints()


def _loses_digits(model: LinearModel, at: NDArray[np.int64], P: NDArray[np.float64]) -> bool:
    r"""Whether innovations are so much larger than their noise that the innovation form loses half of double-double.

    Scale innovations to unit variances, so that S has ones on its diagonal. The relative error of the covariance is
    then roughly that of one operation over :math:`\lambda(R)\,\lambda(S)`, the least eigenvalues.

    Parameters
    ----------
    at : (k,), numbers of steps done.
    P : (k, n, n, 2), the covariances after them.
    """
    given = model.to_float()
    Phi, H, Q, R = (given[letter][at % len(given[letter])] for letter in ("Phi", "H", "Q", "R"))
    with np.errstate(all="ignore"):
        S = H @ (Phi @ P[..., 0] @ np.swapaxes(Phi, 1, 2) + Q) @ np.swapaxes(H, 1, 2) + R
        deviations = np.sqrt(np.diagonal(S, axis1=1, axis2=2))
        both = np.stack([R, S]) / deviations[:, :, None] / deviations[:, None, :]
    if not np.isfinite(both).all():
        return True
    noise, whole = np.linalg.eigvalsh(both)[..., 0]
    return bool(np.any(noise * np.maximum(whole, noise) < LEAST_SHARE))


def reference_states(model: LinearModel, z: Any) -> NDArray[np.float64]:
    """Run the filter as :func:`reference` does, and return the estimates after every step, (steps, n, 2).

    Raises
    ------
    ArithmeticError : as for :func:`reference`.
    """
    run = Run(model.without_inputs(), None, Form.INNOVATION, range(1, len(z) + 1) if model.has_inputs else ())
    if model.has_inputs:
        start = run.x.copy()[np.newaxis], run.P.copy()[np.newaxis]
        _take_with_inputs(run, model, z)
        kept = run.X[: run.steps], run.C[: run.steps]
        blocks = iter([(np.concatenate([start[0], kept[0]]), np.concatenate([start[1], kept[1]]))])
    else:
        blocks = run.blocks(z)
    found, done = [np.zeros((0, model.n, 2))], 0
    for x, P in blocks:
        if run.stopped or _loses_digits(model, np.arange(done, done + len(P)), P):
            return double_doubles(np.array([each for each, *_ in precise_steps(model, z)], dtype=object))
        found.append(x[1:, :, 0])
        done += len(x) - 1
    return np.concatenate(found)


def _take_with_inputs(run: Run, model: LinearModel, z: Any) -> None:
    """Take steps with known inputs c: from x to E(x, z - d - Hc) + c, with the step E of a filter without inputs."""
    model.check_steps(len(z))
    for k, measured in enumerate(exact(z)):
        state, measurement = model.known(k)
        at = int(run.notes[NEXT_CHECKPOINT])
        run.take((measured - measurement - model.H[k % len(model.H)] @ state)[np.newaxis])
        if run.stopped:
            return
        run.x = run.as_packed(run.exactly(run.x) + state.reshape(-1, 1))
        if run.notes[NEXT_CHECKPOINT] > at:
            run.X[at] = run.x
