"""A resumable filter run with every operation rounded, or in double-double as the reference, of one record or many."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.arithmetic.kernels.tags import DoubleDouble, Tag
from gpbnb.arithmetic.machine import OVERFLOW, ZERO_DIVISOR, ZERO_PIVOT
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rounding import Limits, Order, Rounding
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.bounded_steps import Bounds, CarriedBound, Taken
from gpbnb.filters.checkpoints import Checkpoints, Progress, exactly, without_factors
from gpbnb.filters.forms import WITH_PROGRAM, Form, form_named
from gpbnb.filters.model import LinearModel, check_one
from gpbnb.filters.opening import (
    Opening,
    as_packed,
    double_doubles_of,
    opening,
)
from gpbnb.filters.pairs import nearest_floats, widened, widened_estimates
from gpbnb.filters.program import Program
from gpbnb.filters.recording import entries_taken, linear_program, recorded_step, step_kind
from gpbnb.filters.reference import precise_steps
from gpbnb.filters.stepping import DividedStep, RunningStep, StepsTaken, Stop
from gpbnb.filters.steps import FACTORED, HUNG_FORMS

LEAST_SHARE = 2.0**-60
"""Smallest share of the noise in an innovation that double-double resolves; see :func:`reference`."""


class Sums(NamedTuple):
    """How a filter adds up the terms of its matrix products.

    Parameters
    ----------
    fused : whether products are added by fused multiply-add; base 2 or 16.
    fmt : the format that keeps a sum until it is stored; by default that of the run.
    order, block : order of the additions, as for :func:`gpbnb.arithmetic.linalg.matmul`. Orders other than "left" need
        base 2 or 16, and a form other than UD, which has few matrix products.
    """

    fused: bool = False
    fmt: FloatFormat | FixedFormat | None = None
    order: Order = "left"
    block: int = 32


LEFT_TO_RIGHT = Sums()
"""Each product and each sum is rounded in the format of the run, from left to right."""


class Block(NamedTuple):
    """Results after each of some steps, which are fewer than asked for if a step has none."""

    #: (steps, n, records, ...).
    x: NDArray[Any]
    #: (steps, n, m, ...) and (steps, n, n, ...).
    K: NDArray[Any]
    P: NDArray[Any]
    #: (steps,).
    definite: NDArray[np.bool_]
    stop: Stop | None


class Run(Progress):
    """A resumable run of a filter: inputs, state and checkpoints.

    Parameters
    ----------
    model : n states, m measurements.
    fmt : the format in which everything is stored and computed, or formats for its blocks; None for double-double.
    form : form in which a step is computed, or its name, such as "UD".
    checkpoint_steps : steps, 1 or more, after which estimate, gain and covariance are saved, in ascending order.
    sums : how the terms of matrix products are added up.
    bounded : whether to compute the contraction bound, :mod:`gpbnb.filters.contraction`, along with the run: a bound of
        its errors or, in double-double, of its distance from the exact filter.
    records : number of measurement records. Covariance and gain do not depend on the measurements and are computed
        once; the estimates of all records are the columns of one matrix, and have the same digits as in separate runs.
        Many records need :meth:`carry` and a form without factors or roots, which compute gain and estimate together.
    """

    def __init__(
        self,
        model: LinearModel,
        fmt: FloatFormat | BlockFormats | None,
        form: Form | str,
        checkpoint_steps: Sequence[int],
        sums: Sums = LEFT_TO_RIGHT,
        bounded: bool = False,
        records: int = 1,
    ) -> None:
        #: Formats of the blocks, if they have their own; `fmt` is then that of the model.
        self.block_formats = fmt if isinstance(fmt, BlockFormats) else None
        if self.block_formats is not None and (sums != LEFT_TO_RIGHT or bounded or records != 1):
            raise ValueError("got formats of blocks with sums, bounded or many records; needed none of them")
        fmt = fmt.model if isinstance(fmt, BlockFormats) else fmt
        self.model, self.fmt, self.form = model, fmt, form_named(form)
        super().__init__(checkpoint_steps)
        self._check(sums, bounded, records)
        self.sums = sums
        #: The arithmetic from which the run draws random numbers, if it has any.
        self.tag: Tag = DoubleDouble() if fmt is None else fmt.run_tag(*sums)
        start = opening(model, fmt, self.form, self.tag)
        if self.block_formats is not None:
            start = self._in_blocks(start, self.block_formats)
        #: Changes of the covariances, including those of the model.
        self.repairs = list(start.repairs)
        n, m = model.n, model.m
        self.records = records
        self.x = np.ascontiguousarray(np.repeat(start.x0[:, np.newaxis], records, axis=1))
        self.P = start.P0.copy()
        #: What a step takes of the model, packed, by letters: matrices with a cycle of their own, and inputs.
        self.letters = start.letters
        if self.form is Form.COMPENSATED:
            self.letters["increment"] = as_packed(fmt, model.Phi - np.eye(n, dtype=int))
        shapes = ((n, records), (n, m), (n, n))
        self._none = tuple(np.zeros((0, *shape, *self.x.shape[2:]), self.x.dtype) for shape in shapes)
        if fmt is not None:
            check_one(fmt)
        self._compensation = np.zeros_like(self.x)
        self._running: RunningStep | None = None
        self._carried: CarriedBound | None = None
        if bounded:
            self._stored = model if fmt is None else model.rounded(fmt)
            first = FACTORED[self.form].covariance(self.exactly(self.P)) if self.form in FACTORED else None
            self._carried = CarriedBound(self._stored.without_inputs(), self.form, first, self.checkpoint_steps)

    def _check(self, sums: Sums, bounded: bool, records: int) -> None:
        """Reject options that the format or the form does not have."""
        if bounded and self.fmt is not None and self.fmt.overflow != "raise":
            raise ValueError(
                f"got a bound along with a run in {format_text(self.fmt)}; needed overflow 'raise': a result that "
                "leaves the range would be wrong by more than any rounding"
            )
        if not isinstance(sums, Sums):
            raise TypeError(f"sums: got {sums!r}; needed gpbnb.filters.run.Sums(...), such as fmt=BINARY32")
        if sums.fmt is not None and not isinstance(sums.fmt, (FloatFormat, FixedFormat)):
            raise TypeError(f"sums: got {sums.fmt!r}; needed a FloatFormat or a FixedFormat")
        form, inputs = self.form, self.model.has_inputs
        if inputs and form in HUNG_FORMS:
            raise ValueError(
                f"got known inputs in the {form} form, which is not defined with them; needed another "
                'form, such as "innovation"'
            )
        if inputs or form not in WITH_PROGRAM:
            if sums != LEFT_TO_RIGHT:
                raise ValueError(f"got sums with {'known inputs' if inputs else f'the {form} form'}; needed none")
            if self.block_formats is not None:
                raise ValueError(
                    f"got formats of blocks with {'known inputs' if inputs else f'the {form} form'}; needed neither; "
                    f"the forms of blocks are {', '.join(map(str, WITH_PROGRAM))}"
                )
        if sums.order != "left" and form is Form.UD:
            raise ValueError(f"got {sums.order} sums in the UD form; needed another form")
        if records != 1 and (records < 1 or form in FACTORED or bounded or len(self.checkpoint_steps)):
            raise ValueError(
                f"got the {form} form and {records} records; needed at least one record, and for many no bound, no "
                f"checkpoints, and a form whose gain does not depend on the measurements: any but "
                f"{', '.join(map(str, FACTORED))}"
            )

    def _in_blocks(self, start: Opening, formats: BlockFormats) -> Opening:
        """Return a start whose state and covariance are rounded into the formats of their blocks."""
        x0, P0 = as_packed(formats.state, self.exactly(start.x0)), self.exactly(start.P0)
        return start._replace(x0=x0, P0=as_packed(formats.covariance, P0))

    @property
    def X(self) -> NDArray[Any]:
        """The estimates at the checkpoint steps that were reached, packed, (c, n, records, ...)."""
        return self._saved(0)

    @property
    def G(self) -> NDArray[Any]:
        """The gains there, (c, n, m, ...)."""
        return self._saved(1)

    @property
    def C(self) -> NDArray[Any]:
        """The covariances there, (c, n, n, ...)."""
        return self._saved(2)

    def _saved(self, which: int) -> NDArray[Any]:
        kept, none = self.kept(), self._none[which]
        return kept[(0, -2, 1)[which]].reshape(-1, *none.shape[1:]) if kept else none

    @property
    def bounded(self) -> bool:
        """Whether the run also computes its contraction bound."""
        return self._carried is not None

    @property
    def bounds(self) -> Bounds:
        """Bounds of the errors at the checkpoint steps."""
        if self._carried is None:
            raise ValueError("got a run without its bound; needed bounded=True")
        return self._carried.saved

    def blocks(self, z: Any) -> Iterator[Block]:
        """Continue by as many steps as there are measurements, (steps, m), and give their results some at a time.

        A run that has stopped does not continue.
        """
        self.model.check_measurements(z, self.steps)
        packed = self.pack_measurements(z)
        yield from self.advance(packed) if self._carried is None else self._advance_bounded(self._carried, packed)

    def _advance_bounded(self, carried: CarriedBound, z: NDArray[Any]) -> Iterator[Block]:
        """Take steps with packed measurements, and the bound over a block of them at a time."""
        exact_z = widened(z) if z.dtype == np.float64 else double_doubles(self.exactly(z))
        end, before = 0, (self.x[None].copy(), self.P[None].copy())
        for found in self.advance(z):
            begin, end = end, end + len(found.x)
            if begin < end:
                x, P = (np.concatenate(each) for each in zip(before, (found.x, found.P), strict=True))
                each = (widened(part) for part in (P, found.K, self.letters["UR" if self.form in FACTORED else "R"]))
                estimates, measured, first = widened_estimates(x), exact_z[begin:end], self.steps - len(found.x)
                after = estimates[1:]
                if self.model.has_inputs:
                    after, measured = self._without_inputs(first, found.x, z[begin:end])
                carried.take(first, Taken(measured, estimates[:-1], after, *each))
            before = self.x[None].copy(), self.P[None].copy()
            yield found

    def _without_inputs(
        self, first: int, x: NDArray[Any], z: NDArray[Any]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return estimates after steps, and their measurements, as the same filter without inputs has them.

        A known input c can be moved out of a step: the exact filter goes from x to :math:`E(x, z - d - Hc) + c`,
        with the step E of the filter without inputs. Both differences are exact, then rounded to double-double, 2**-106
        of them: less than the errors of the evaluation that the bound includes.
        """
        stored, estimates, measured = self._stored, self.exactly(x), self.exactly(z)
        for k in range(len(estimates)):
            state, offset = stored.known(first + k)
            estimates[k, :, 0] -= state
            measured[k, :, 0] -= offset + stored.H[(first + k) % len(stored.H)] @ state
        return double_doubles(estimates), double_doubles(measured)

    def carry(self, z: NDArray[np.float64], states: int) -> NDArray[np.float64]:
        """Take the next measurements of all records.

        Parameters
        ----------
        z : (steps, m, records).
        states : number of first states to return.

        Returns
        -------
        estimates : (steps, states, records), the nearest float64; NaN from the step at which the filter stopped.
        """
        if np.ndim(z) != 3 or np.shape(z)[1:] != (self.model.m, self.records):
            raise ValueError(f"got measurements of shape {np.shape(z)}; needed (steps, {self.model.m}, {self.records})")
        out, end = np.full((len(z), states, self.records), np.nan), 0
        for found in self.advance(as_packed(self.fmt, z)):
            x, begin = found.x[:, :states], end
            end += len(x)
            if x.dtype == np.float64:
                out[begin:end] = x if x.ndim == 3 else x[..., 0]
            else:
                out[begin:end] = nearest_floats(x)
        return out

    def use_measurement_matrices(self, H: NDArray[np.float64], decimals: int | None = None) -> None:
        """Replace the cycle of measurement matrices, (p, m, n), whose entries are rounded into the format.

        Parameters
        ----------
        decimals : if given, entries are first rounded to this number of decimals, which is exact in base 10 and fast.
        """
        if np.shape(H)[1:] != (self.model.m, self.model.n):
            raise ValueError(f"got H of shape {np.shape(H)}; needed (p, {self.model.m}, {self.model.n})")
        if decimals is not None and self.fmt is not None and self.fmt.base == 10:
            packed = as_packed(self.fmt, np.rint(H * 10.0**decimals))
            packed[..., 1] -= np.where(packed[..., 0] == 0, 0, decimals)
        else:
            packed = as_packed(self.fmt, H)
        self.letters["H"] = packed
        self._running = None

    def save_at(self, checkpoint_steps: NDArray[np.int64]) -> None:
        """Save the results of other steps, at most as many as before, in place of all results saved so far."""
        self.checkpoint_steps, self.saved, self._kept = checkpoint_steps, 0, []
        if self._carried is not None:
            self._carried.checkpoint_steps = checkpoint_steps

    def estimates(self, found: Block) -> NDArray[np.float64]:
        """Return the estimates of some steps, (steps, n, 2), as double-double."""
        return widened_estimates(found.x)[:, :, 0]

    def pack_measurements(self, z: Any) -> NDArray[Any]:
        """Round measurements (steps, m) into the format, as :meth:`advance` expects them."""
        packed = as_packed(self.fmt if self.block_formats is None else self.block_formats.state, z)
        return packed.reshape(len(packed), self.model.m, 1, *packed.shape[2:])

    def advance(self, z: NDArray[Any]) -> Iterator[Block]:
        """Take one step per packed measurement, (steps, m, columns of x), and give the results of a block at a time."""
        if self._running is None:
            self._running = self._opened()
        states = [self.x, self.P, self._compensation][: self._running.states]
        for found in self.repeat(self._running, states, z, self._fault, self._limits is None):
            yield self._block(found)

    @property
    def _limits(self) -> Limits | None:
        """The limits of the estimate's format."""
        fmt = self.fmt if self.block_formats is None else self.block_formats.state
        return None if fmt is None else fmt.limits

    def _fault(self, stop: Stop) -> tuple[str, str]:
        """Return in words what ends the run, and a cure; only a format with a range has an overflow."""
        if stop.fault.reason == ZERO_PIVOT or (stop.fault.reason == ZERO_DIVISOR and stop.quantity == "its inverse"):
            return "a zero pivot in the innovation covariance", ""
        what, cure = stop.fault.reason, ""
        if stop.fault.overflows:
            what = "a number beyond the range of the compiled loops" if self._limits is None else OVERFLOW
            if self.form is Form.UD and isinstance(self.fmt, FixedFormat):
                cure = "; the UD form multiplies variances by each other, so scale the states or use more integer bits"
        return f"{what} in {stop.quantity}", cure

    def _opened(self) -> RunningStep:
        """Load a step in the formats of the run."""
        parts = self.recorded()
        return RunningStep(parts, self._formats()[0], self._tables(parts), self.records, self.tag)

    def recorded(self) -> DividedStep:
        """Return the operations of a step, in which entries of the model that are always 0 or 1 are constants."""
        formats, blocks, sums = self._formats()
        kind = step_kind(self.form, self.letters, formats[0], blocks, sums)
        draws = any(each is not None and each.rounding is Rounding.STOCHASTIC for each in formats)
        return recorded_step(kind, together=draws and self.records == 1)

    def _tables(self, parts: DividedStep) -> list[NDArray[Any]]:
        """Return the matrices of the model, (p, entries, ...), for the cycles of a step."""
        cycles = zip(self.letters.values(), parts.step.coefficients, strict=True)
        return [each.reshape(len(each), at.size, *each.shape[1 + at.ndim :]) for each, at in cycles]

    def linear_program(self) -> Program:
        """Return how a step computes the estimate from the measurements; ValueError with known inputs or offsets."""
        self.model.refuse_inputs("its linear program")
        return linear_program(self.recorded(), self.letters)

    def coefficients(self) -> NDArray[Any]:
        """Return those of :meth:`linear_program` at the checkpoint steps reached so far, (c, entries, ...), packed."""
        parts, at = self.recorded(), self.checkpoint_steps[: self.saved] - 1
        tables = (table[at % len(table)] for table in self._tables(parts))
        of_model = [table[:, each] for table, each in zip(tables, entries_taken(parts), strict=True)]
        rows, first, tail = len(at), of_model[0], of_model[0].shape[2:]
        shared, zero = (np.zeros_like(first, shape=(rows, count, *tail)) for count in (len(parts.shared), 1))
        if rows:
            shared[:] = self.kept()[-1].reshape(shared.shape)
        return np.concatenate([*of_model, shared, zero], axis=1)

    def _block(self, found: StepsTaken) -> Block:
        x, K, P = (
            found.given[which].reshape(-1, *none.shape[1:]) for which, none in zip((0, -1, 1), self._none, strict=True)
        )
        return Block(x, K, P, found.definite, found.stop)

    def _formats(self) -> tuple[list[Any], tuple[int, ...], tuple[Any, ...]]:
        """Return all formats; the numbers of those of the blocks and of the model; how sums are computed."""
        given, sums = self.block_formats, self.sums
        kept_in = sums.fmt if given is None else given.sums
        blocks = [self.fmt] * 5 if given is None else [*(getattr(given, name) for name in BLOCKS), self.fmt]
        formats = list(dict.fromkeys([*blocks, *([] if kept_in is None else [kept_in])]))
        number = -1 if kept_in is None else formats.index(kept_in)
        numbers = tuple(formats.index(each) for each in blocks)
        return formats, numbers, (sums.fused, sums.order, sums.block, number)

    def exactly(self, packed: NDArray[Any]) -> NDArray[Any]:
        """Convert results of the compiled loops to exact Fractions."""
        return exactly(packed, self.fmt)

    def checkpoints(self) -> Checkpoints:
        """Return estimate, gain and covariance at the checkpoint steps that were reached."""
        at = self.checkpoint_steps[: self.saved] - 1
        x, K, P = (self.exactly(each) for each in (self.X[:, :, 0], self.G, self.C))
        if self.form in FACTORED:
            H, UR = (self.exactly(self.letters[each]) for each in ("H", "UR"))
            K, P = without_factors(self.form, K, P, H[at % len(H)], UR[at % len(UR)])
        return Checkpoints(tuple((at + 1).tolist()), x, K, P)


def log_spaced(steps: int, per_decade: int = 4) -> tuple[int, ...]:
    """Return steps from 1 to the last one, each larger than the one before by about the same factor."""
    if steps < 1 or per_decade < 1:
        raise ValueError(f"got {steps} steps, {per_decade} per decade; needed both at least 1")
    grid = np.rint(10 ** (np.arange(0, int(math.log10(steps) * per_decade) + 1) / per_decade))
    return tuple(sorted({int(k) for k in grid if k <= steps} | {steps}))


def reference(model: LinearModel, z: Any, checkpoint_steps: Sequence[int]) -> Checkpoints:
    """Run the filter in double-double, whose operations have relative errors below 2**-102.

    Where it would lose half of these digits, :mod:`gpbnb.filters.reference` computes the filter instead.

    Parameters
    ----------
    model : also with known inputs and offsets.
    z : (steps, m), measurements; float64 or Fractions.
    checkpoint_steps : steps whose results are saved.
    """
    run = Run(model, None, Form.INNOVATION, checkpoint_steps)
    start = run.P.copy()
    run.take(z)
    at = np.array([0, *run.checkpoint_steps[: run.saved]])
    if run.stopped or _loses_digits(model, at, np.concatenate([start[None], run.C])):
        return precise_steps(model, z).checkpoints(run.checkpoint_steps)
    return run.checkpoints()


def _loses_digits(model: LinearModel, at: NDArray[np.int64], P: NDArray[np.float64]) -> bool:
    r"""Whether innovations are so much larger than their noise that the innovation form loses half of double-double.

    Scale innovations to unit variances, so that S has ones on its diagonal. The relative error of the covariance is
    then roughly that of one operation over :math:`\lambda(R)\,\lambda(S)`, the least eigenvalues.
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
    """Run the filter as :func:`reference` does, and return the estimates after every step, (steps, n, 2)."""
    run = Run(model, None, Form.INNOVATION, ())
    estimates, before = [np.zeros((0, model.n, 2))], run.P[None].copy()
    for found in run.blocks(z):
        P = np.concatenate([before, found.P])
        if run.stopped or _loses_digits(model, run.steps - len(found.P) + np.arange(len(P)), P):
            try:
                return double_doubles_of(precise_steps(model, z).x)
            except OverflowError as error:
                raise OverflowError(
                    f"{model.name} without rounding: {error}; a model that is not stable takes fewer steps"
                ) from None
        estimates.append(found.x[:, :, 0])
        before = P[-1:]
    return np.concatenate(estimates)
