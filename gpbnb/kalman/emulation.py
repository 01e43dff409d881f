"""Errors of a filter whose every operation is rounded, against the same filter in double-double."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.kalman.array_forms import AnyForm, ArrayForm
from gpbnb.kalman.array_run import ArrayRun
from gpbnb.kalman.filter_run import Checkpoints, Run, log_spaced, reference
from gpbnb.kalman.forms import Form
from gpbnb.kalman.model import LinearModel
from gpbnb.kalman.named import form_named


@dataclass(frozen=True, eq=False)
class History:
    """Errors of a rounded run, against the reference, after some steps.

    Parameters
    ----------
    steps : (c,), those that were reached.
    state : (c, n), estimate minus reference, in the units of the states.
    gain, covariance : (c, n, m) and (c, n, n), likewise.
    reference : of the same steps.
    indefinite : the first step at which a variance or a pivot of the innovation covariance was not positive, if any.
    stopped : the step that a division by zero, or a number beyond the backend's range, ended, if any.
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

    @property
    def state_norm(self) -> NDArray[np.float64]:
        """Largest entry of the error of the estimate, (c,); the norm (21)."""
        return np.abs(self.state).max(axis=1)

    @property
    def gain_norm(self) -> NDArray[np.float64]:
        """Largest column sum of the error of the gain over that of the gain, (c,); the norm (22)."""
        return relative(self.gain, self.reference.K)

    @property
    def covariance_norm(self) -> NDArray[np.float64]:
        """Largest column sum of the error of the covariance over that of the covariance, (c,); the norm (22)."""
        return relative(self.covariance, self.reference.P)

    @property
    def least_eigenvalue(self) -> NDArray[np.float64]:
        """Least eigenvalue of the computed covariance, symmetric part, scaled to ones on the true diagonal, (c,)."""
        true = self.reference.P[: len(self.steps)].astype(np.float64)
        computed = true + self.covariance
        scale = np.sqrt(np.diagonal(true, axis1=1, axis2=2))
        scaled = computed / scale[:, :, np.newaxis] / scale[:, np.newaxis, :]
        return np.asarray(np.linalg.eigvalsh((scaled + np.swapaxes(scaled, 1, 2)) / 2)[:, 0], dtype=np.float64)


def relative(error: NDArray[np.float64], true: NDArray[Any]) -> NDArray[np.float64]:
    """Norms (22), largest column sums, of errors over those of what is true, (c,)."""
    size = np.abs(true[: len(error)].astype(np.float64)).sum(axis=1).max(axis=1)
    return np.asarray(np.abs(error).sum(axis=1).max(axis=1) / size)


def compare_runs(run: Run | ArrayRun, true: Checkpoints) -> History:
    """Subtract the reference from the checkpoints of a run, at the same steps."""
    checkpoints = run.checkpoints()
    c = len(checkpoints.steps)
    if checkpoints.steps != true.steps[:c]:
        raise ValueError(
            f"got checkpoint steps {checkpoints.steps} and, of the reference, {true.steps}; needed the same"
        )
    x, K, P = (
        (each - other[:c]).astype(np.float64)
        for each, other in ((checkpoints.x, true.x), (checkpoints.K, true.K), (checkpoints.P, true.P))
    )
    fmt, steps = cast(FloatFormat, run.fmt), np.array(checkpoints.steps, dtype=np.int64)
    return History(run.model, fmt, run.form, steps, x, K, P, true, run.indefinite, run.stopped)


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
) -> History:
    """Run the filter with model, measurements and every operation rounded, and compare it with the reference.

    Parameters
    ----------
    model : n states, m measurements.
    z : (steps, m), measurements.
    fmt : any format of base 2 up to 53 digits, 10 up to 18, or 16 up to 13; or fixed point.
    form : or its name, such as "UD".
    checkpoint_steps : steps at which to compare; by default four a decade.
    true : a reference to compare with. By default it gets model and measurements as the format stores them, so that
        errors are those of the arithmetic alone; a reference of the model as given adds those of storing it.
    fused : whether products are added by fused multiply-add, as processors with one do; base 2 or 16.
    sums, compensated : as of :class:`~gpbnb.kalman.filter_run.Run`.

    Raises
    ------
    ValueError : `fused`, `sums` or `compensated` with known inputs, or with a form without compiled loops.
    """
    form = form_named(form)
    measured: Any = z if hasattr(z, "to_fractions") else fmt.array(z)
    chosen = log_spaced(len(measured)) if checkpoint_steps is None else tuple(checkpoint_steps)
    if chosen and max(chosen) > len(measured):
        raise ValueError(f"got checkpoint step {max(chosen)}; needed none above the {len(measured)} steps of the run")
    run: Run | ArrayRun
    if model.has_inputs or isinstance(form, ArrayForm):
        if fused or sums is not None or compensated:
            raise ValueError(
                "got fused, sums or compensated with known inputs or a form without compiled loops; needed none of "
                'them; for compensated summation write form="compensated"'
            )
        run = ArrayRun(model, fmt, form, chosen)
    else:
        run = Run(model, fmt, form, chosen, fused, sums, compensated)
    run.take(measured)
    if true is None:
        true = reference(model.rounded(fmt), measured.to_fractions(), chosen)
    return compare_runs(run, true)
