"""Run filters as on different processors: limited range, wide sums, fused operations, compensated updates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BFLOAT16, BINARY32
from gpbnb.arithmetic.rounding import Order, Rounding
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import checked_name
from gpbnb.filters.run import Run, Sums, reference_states

Format = FloatFormat | FixedFormat


@dataclass(frozen=True)
class Processor:
    """How a processor computes.

    Parameters
    ----------
    name : what tables call it.
    fmt : the format of stored numbers and of results.
    sums : the format that keeps the sums of matrix products until they are stored; `fmt` by default.
    fused : whether products are added by fused multiply-add.
    compensated : whether the program updates the estimate by Kahan's compensated summation.
    order : of the additions in matrix products.
    """

    name: str
    fmt: Format
    sums: Format | None = None
    fused: bool = False
    compensated: bool = False
    order: Order = "left"

    def __post_init__(self) -> None:
        checked_name(self.name)


#: A microcontroller with single precision, an accelerator with and without wide sums, and 16-bit fixed point.
PROCESSORS = (
    Processor("Cortex-M4F, binary32", BINARY32),
    Processor("accelerator, bfloat16 with binary32 sums", BFLOAT16, sums=BINARY32),
    Processor("bfloat16 alone", BFLOAT16),
    Processor("16-bit fixed point, 9 bits before the point", FixedFormat(9, 6, Rounding.EVEN)),
)


def variants(precision: int) -> tuple[Processor, ...]:
    """Return processors of one precision that add properties one by one; the first has Hung's arithmetic.

    The range is that of binary32.
    """
    away, even = FloatFormat(2, precision), FloatFormat(2, precision, Rounding.EVEN)
    ranged = FloatFormat(2, precision, Rounding.EVEN, emin=-126, emax=127)
    found = [
        Processor("ties away from zero, any exponent", away),
        Processor("ties to even", even),
        Processor("and the range of binary32", ranged),
        Processor("and fused multiply-add", ranged, fused=True),
        Processor("and pairwise sums instead", ranged, order="pairwise"),
    ]
    if precision < BINARY32.precision:
        found.append(Processor("and binary32 sums instead", ranged, sums=BINARY32))
    return (
        *found,
        Processor("and a compensated update instead", ranged, compensated=True),
        Processor("chopped, any exponent", FloatFormat(2, precision, Rounding.CHOP)),
    )


class ProcessorResult(NamedTuple):
    """Result of a filter on a processor: the largest error of each state, or why the filter fails."""

    processor: Processor
    error: NDArray[np.float64]
    refused: str


def outcome(
    model: LinearModel,
    z: Any,
    processor: Processor,
    form: Form | str = Form.INNOVATION,
    true: NDArray[np.float64] | None = None,
) -> ProcessorResult:
    """Run a filter on a processor and compare it with the given filter in double-double.

    Errors of storing the model and the measurements are included.

    Parameters
    ----------
    z : (steps, m).
    true : the result of :func:`~gpbnb.filters.run.reference_states`, if known.
    """
    nothing = np.full(model.n, math.inf)
    sums = Sums(processor.fused, processor.sums, processor.order)
    try:
        run = Run(model, processor.fmt, form, (), sums, processor.compensated)  # type: ignore[arg-type]
        states = run.states(processor.fmt.array(z))
    except OverflowError as error:
        return ProcessorResult(processor, nothing, f"overflow in the model or the measurements: {error}")
    except ValueError as error:
        return ProcessorResult(processor, nothing, str(error))
    if run.stopped is not None:
        return ProcessorResult(processor, nothing, run.reason)
    if run.indefinite is not None:
        return ProcessorResult(processor, nothing, f"a computed variance was not positive at step {run.indefinite}")
    errors = (states - (reference_states(model, z) if true is None else true)).sum(axis=2)
    return ProcessorResult(processor, np.abs(errors).max(axis=0), "")


def typical_errors(
    model: LinearModel,
    records: Sequence[Any],
    processors: Sequence[Processor],
    form: Form | str = Form.INNOVATION,
) -> NDArray[np.float64]:
    """Return the rms over records of each state's largest error, (processors, n), infinite if a filter fails."""
    squares = np.zeros((len(processors), model.n))
    for z in records:
        true = reference_states(model, z)
        squares += np.array([outcome(model, z, each, form, true).error for each in processors]) ** 2
    return np.asarray(np.sqrt(squares / len(records)))


class Sum(NamedTuple):
    """How an integrator adds its increments."""

    name: str
    add: Callable[[NDArray[np.float64]], NDArray[np.float64]]


def integrators() -> tuple[Sum, ...]:
    """Return integrators for several processors, which turn increments (samples, paths) into sums (paths,)."""
    fixed = FixedFormat(1, 14)
    return (
        Sum("Cortex-M4F, binary32", lambda x: _left(BINARY32, BINARY32, x)),
        Sum("accelerator, bfloat16 with binary32 sums", lambda x: _left(BFLOAT16, BINARY32, x)),
        Sum("bfloat16 alone", lambda x: _left(BFLOAT16, BFLOAT16, x)),
        Sum("bfloat16 alone, compensated", lambda x: compensated_sum(BFLOAT16.array(x))),
        Sum(
            "bfloat16 alone, stochastic rounding",
            lambda x: _left(BFLOAT16, replace(BFLOAT16, rounding=Rounding.STOCHASTIC, seed=704), x),
        ),
        Sum("16-bit fixed point, nearest", lambda x: _left(fixed, fixed, x)),
        Sum("16-bit fixed point, floor", lambda x: _left(*2 * (replace(fixed, rounding=Rounding.DOWN),), x)),
        Sum("Apollo's 15 bits, chopped", lambda x: _left(*2 * (FixedFormat(1, 13, Rounding.CHOP),), x)),
    )


def _left(stored: Format, kept: Format, x: NDArray[np.float64]) -> NDArray[np.float64]:
    if isinstance(kept, FloatFormat):
        kept.restart()
    return np.asarray(kept.array(stored.array(x)).sum(axis=0).to_float())


def compensated_sum(x: FloatArray) -> NDArray[np.float64]:
    """Compute Kahan's sum along the first axis, with each operation rounded in the format of the array."""
    total = x[0]
    carried = total - total
    for each in x[1:]:
        d = each - carried
        new = total + d
        carried, total = (new - total) - d, new
    return np.asarray(total.to_float())


def increments(samples: int, paths: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate the angles that a gyroscope adds in each step, (samples, paths).

    Each is the product of half the period and the sum of two samples of a Gauss-Markov process, with 1 °/s rms, a
    bandwidth of 50 Hz and 1024 samples a second.
    """
    rate, rng = 1024.0, np.random.default_rng(seed)
    keep = math.exp(-2 * math.pi * 50 / rate)
    x = rng.standard_normal((samples + 1, paths))
    for k in range(1, samples + 1):
        x[k] = keep * x[k - 1] + math.sqrt(1 - keep * keep) * x[k]
    return np.asarray((x[1:] + x[:-1]) / (2 * rate))
