"""Errors of a filter with every operation rounded, relative to the same filter in double-double."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import arithmetic
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.bounded_steps import Bounds
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import LinearModel, stored_measurements
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.nonlinear_run import NonlinearRun, nonlinear_checkpoints, opened
from gpbnb.filters.run import Run, log_spaced, reference


@dataclass(frozen=True, eq=False)
class History:
    """Errors of a rounded run relative to the reference, after some steps.

    Parameters
    ----------
    steps : (c,), the steps that were reached.
    state : (c, n), error of the estimate: estimate minus reference, in the units of the states.
    gain, covariance : (c, n, m) and (c, n, n), likewise.
    reference : the reference at the same steps.
    indefinite : the first step at which a variance or a pivot of the innovation covariance was not positive, if any.
    stopped : the step at which a division by zero or a number beyond the format's range ended the run, if any.
    reason : what ended the run, such as "overflow in the gain at step 812".
    repairs : changes of covariances that would otherwise be indefinite, each as text.
    bounds : the contraction bound of each error, if it was computed; that of the covariance is of its symmetric part.
    """

    model: AnyModel
    fmt: FloatFormat | BlockFormats
    form: Form
    steps: NDArray[np.int64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reference: Checkpoints
    indefinite: int | None
    stopped: int | None
    reason: str = ""
    repairs: tuple[str, ...] = ()
    bounds: Bounds | None = None

    def __repr__(self) -> str:
        fmt = self.fmt if isinstance(self.fmt, BlockFormats) else arithmetic(self.fmt)
        if not len(self.steps):
            return f"{self.form} in {fmt}: no checkpoint was reached; {self.reason}"
        largest = ", ".join(f"{error:.2g}" for error in np.abs(self.state).max(axis=0))
        ended = f"; {self.reason}" if self.reason else ""
        return f"{self.form} in {fmt}, {self.steps[-1]} steps: largest error of each state {largest}{ended}"

    @property
    def estimate(self) -> NDArray[np.float64]:
        """The computed estimates in float64, (c, n), which are the reference plus its error."""
        return np.asarray(self.reference.to_float("x")[: len(self.state)] + self.state)

    def ratios(self) -> NDArray[np.float64]:
        """Return the largest error over bound of state, gain and covariance, (c, 3); above 1 if one is violated."""
        if self.bounds is None:
            raise ValueError("got a run without its bound; needed bounded=True")
        symmetric = (self.covariance + np.swapaxes(self.covariance, 1, 2)) / 2
        pairs = zip((self.state, self.gain, symmetric), self.bounds, strict=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            each = [np.where(e == 0, 0.0, np.abs(e) / b).reshape(len(e), -1).max(axis=1) for e, b in pairs]
        return np.stack(each, axis=1)


def compare_runs(run: Run | NonlinearRun, true: Checkpoints) -> History:
    """Subtract the reference from the checkpoints of a run, at the same steps."""
    checkpoints = run.checkpoints()
    x, K, P = checkpoints.minus(true)
    blocks = run.block_formats if isinstance(run, Run) else None
    fmt, steps = blocks or cast(FloatFormat | BlockFormats, run.fmt), np.array(checkpoints.steps, dtype=np.int64)
    repairs = tuple(str(each) for each in run.repairs)
    bounds = Bounds(*(each[: len(steps)] for each in run.bounds)) if isinstance(run, Run) and run.bounded else None
    ended = run.indefinite, run.stopped, run.reason
    return History(run.model, fmt, run.form, steps, x, K, P, true, *ended, repairs, bounds)


def emulate(
    model: AnyModel,
    z: Any,
    fmt: FloatFormat | BlockFormats,
    form: Form | str = Form.INNOVATION,
    checkpoint_steps: Sequence[int] | None = None,
    true: Checkpoints | None = None,
    bounded: bool = False,
) -> History:
    """Run the filter with model, measurements and every operation rounded, and compare the run with the reference.

    Parameters
    ----------
    model : a linear or nonlinear model with n states and m measurements.
    z : (steps, m), measurements; NaN or masked if missing.
    fmt : a floating-point format with at most 53 digits in base 2, 18 in base 10 or 13 in base 16; a fixed-point
        format; or one format for each block of a step, as in :class:`gpbnb.filters.blocks.BlockFormats`.
    form : a form or its name, such as "UD".
    checkpoint_steps : steps at which to compare; by default four per decade.
    true : the reference run to compare with. By default, it uses model and measurements as the format stores them, so
        the errors come only from the arithmetic. With a reference for the model as given, they include the errors of
        storing the model. The reference for a nonlinear model always uses the model as given, because its functions
        round their own constants.
    bounded : whether to compute the contraction bound of a linear filter, :mod:`gpbnb.filters.contraction`, along with
        the run.

    Returns
    -------
    The *errors* of the estimate in ``state``, of the gain and of the covariance at the checkpoint steps, and in
    ``estimate`` the estimates. If the run ended early, ``reason`` says why, and only the steps before are there.
    """
    form = form_named(form)
    if not isinstance(model, LinearModel | NonlinearModel):
        raise TypeError(
            f"got a model {type(model).__name__}; needed a LinearModel or a NonlinearModel; required_precision and "
            "write_code also take a LinearSystem"
        )
    if not isinstance(fmt, (FloatFormat, FixedFormat, BlockFormats)):
        raise TypeError(f"got the format {fmt!r}; needed a FloatFormat, a FixedFormat or BlockFormats")
    if not hasattr(z, "to_fractions"):
        model, z = model.without_missing(z)
    if not isinstance(fmt, BlockFormats):
        fmt.restart()
    measured: Any = z if hasattr(z, "to_fractions") else stored_measurements(z, fmt)
    (model if isinstance(model, LinearModel) else model.noise).check_measurements(measured, 0)
    if not len(measured):
        raise ValueError("got no measurements; needed at least one step")
    chosen = log_spaced(len(measured)) if checkpoint_steps is None else tuple(checkpoint_steps)
    if chosen and max(chosen) > len(measured):
        raise ValueError(f"got checkpoint step {max(chosen)}; needed none above the {len(measured)} steps of the run")
    run = opened(model, fmt, form, chosen, bounded)
    run.take(measured)
    if true is not None:
        return compare_runs(run, true)
    if isinstance(model, NonlinearModel):
        return compare_runs(run, nonlinear_checkpoints(model, measured, chosen))
    stored = model.rounded(fmt.model if isinstance(fmt, BlockFormats) else fmt)
    return compare_runs(run, reference(stored, measured, chosen))
