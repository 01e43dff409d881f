"""Errors of a filter with every operation rounded, relative to the same filter in double-double."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Order
from gpbnb.filters.array_forms import AnyForm, ArrayForm
from gpbnb.filters.array_run import ArrayRun
from gpbnb.filters.forms import Form
from gpbnb.filters.missing import without_missing
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import form_named
from gpbnb.filters.run import Checkpoints, Run, log_spaced, reference


@dataclass(frozen=True, eq=False)
class History:
    """Errors of a rounded run relative to the reference, after some steps.

    Parameters
    ----------
    steps : (c,), the steps that were reached.
    state : (c, n), estimate minus reference, in the units of the states.
    gain, covariance : (c, n, m) and (c, n, n), likewise.
    reference : the reference at the same steps.
    indefinite : the first step at which a variance or a pivot of the innovation covariance was not positive, if any.
    stopped : the step at which a division by zero or a number beyond the format's range ended the run, if any.
    reason : what ended it, such as "overflow in the gain at step 812".
    repairs : changes of covariances that would otherwise be indefinite, each as text.
    """

    model: LinearModel
    fmt: FloatFormat
    form: AnyForm
    steps: NDArray[np.int64]
    state: NDArray[np.float64]
    gain: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reference: Checkpoints
    indefinite: int | None
    stopped: int | None
    reason: str = ""
    repairs: tuple[str, ...] = ()

    @property
    def state_norm(self) -> NDArray[np.float64]:
        """Largest entry of the error of the estimate, (c,), in norm (21)."""
        return np.abs(self.state).max(axis=1)

    @property
    def gain_norm(self) -> NDArray[np.float64]:
        """Relative error of the gain, (c,), by largest column sums, norm (22)."""
        return relative(self.gain, self.reference.K)

    @property
    def covariance_norm(self) -> NDArray[np.float64]:
        """Relative error of the covariance, (c,), by largest column sums, norm (22)."""
        return relative(self.covariance, self.reference.P)

    @property
    def least_eigenvalue(self) -> NDArray[np.float64]:
        """Least eigenvalue of the symmetric part of the computed covariance, (c,), in units of the true variances."""
        true = self.reference.P[: len(self.steps)].astype(np.float64)
        computed = true + self.covariance
        scale = np.sqrt(np.diagonal(true, axis1=1, axis2=2))
        scaled = computed / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
        return np.asarray(np.linalg.eigvalsh((scaled + np.swapaxes(scaled, 1, 2)) / 2)[:, 0], dtype=np.float64)


def relative(error: NDArray[np.float64], true: NDArray[Any]) -> NDArray[np.float64]:
    """Return norms (22) of errors over norms of the true matrices, (c,)."""
    size = np.abs(true[: len(error)].astype(np.float64)).sum(axis=1).max(axis=1)
    return np.asarray(np.abs(error).sum(axis=1).max(axis=1) / size)


def compare_runs(run: Run | ArrayRun, true: Checkpoints) -> History:
    """Subtract the reference from the checkpoints of a run, at the same steps."""
    checkpoints = run.checkpoints()
    c = len(checkpoints.steps)
    if checkpoints.steps != true.steps[:c]:
        raise ValueError(
            f"got checkpoint steps {checkpoints.steps} for the runs and {true.steps} for the "
            "reference; needed equal steps"
        )
    x, K, P = (
        (each - other[:c]).astype(np.float64)
        for each, other in ((checkpoints.x, true.x), (checkpoints.K, true.K), (checkpoints.P, true.P))
    )
    fmt, steps = cast(FloatFormat, run.fmt), np.array(checkpoints.steps, dtype=np.int64)
    repairs = tuple(str(each) for each in run.repairs)
    return History(run.model, fmt, run.form, steps, x, K, P, true, run.indefinite, run.stopped, run.reason, repairs)


def emulate(
    model: LinearModel,
    z: Any,
    fmt: FloatFormat,
    form: AnyForm | str = Form.INNOVATION,
    checkpoint_steps: Sequence[int] | None = None,
    true: Checkpoints | None = None,
    fused: bool = False,
    sums: FloatFormat | FixedFormat | None = None,
    compensated: bool = False,
    order: Order = "left",
    block: int = 32,
) -> History:
    """Run the filter with model, measurements and every operation rounded, and compare it with the reference.

    Parameters
    ----------
    model : a model with n states and m measurements.
    z : (steps, m), measurements; NaN or masked if missing.
    fmt : any format of base 2 up to 53 digits, 10 up to 18, or 16 up to 13; or fixed point.
    form : a form or its name, such as "UD".
    checkpoint_steps : steps at which to compare; by default four per decade.
    true : a reference to compare with. By default it gets model and measurements as the format stores them, so
        errors come only from the arithmetic. With a reference for the model as given, they include those of storing it.
    fused : whether products are added by fused multiply-add, as processors with one do; base 2 or 16.
    sums, compensated, order, block : as for :class:`~gpbnb.filters.run.Run`.

    Raises
    ------
    TypeError : no model, or no format.
    ValueError : no measurements; one of these options together with known inputs or a form without compiled loops.
    """
    form = form_named(form)
    if not isinstance(model, LinearModel):
        raise TypeError(f"got a model {type(model).__name__}; needed a LinearModel")
    if not isinstance(fmt, (FloatFormat, FixedFormat)):
        raise TypeError(f"got the format {fmt!r}; needed a FloatFormat or a FixedFormat")
    if not hasattr(z, "to_fractions"):
        model, z = without_missing(model, z)
    fmt.restart()
    measured: Any = z if hasattr(z, "to_fractions") else fmt.array(z)
    model.check_measurements(measured, 0)
    if not len(measured):
        raise ValueError("got no measurements; needed at least one step")
    chosen = log_spaced(len(measured)) if checkpoint_steps is None else tuple(checkpoint_steps)
    if chosen and max(chosen) > len(measured):
        raise ValueError(f"got checkpoint step {max(chosen)}; needed none above the {len(measured)} steps of the run")
    run: Run | ArrayRun
    if model.has_inputs or isinstance(form, ArrayForm):
        if fused or sums is not None or compensated or order != "left":
            raise ValueError(
                "got fused, sums, compensated or order with known inputs or a form without compiled loops; needed none "
                'of them; for compensated summation write form="compensated"'
            )
        run = ArrayRun(model, fmt, form, chosen)
    else:
        run = Run(model, fmt, form, chosen, fused, sums, compensated, order, block)
    run.take(measured)
    if true is None:
        true = reference(model.rounded(fmt), measured.to_fractions(), chosen)
    return compare_runs(run, true)
