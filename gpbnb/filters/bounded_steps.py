"""The contraction bound of a run, taken along step by step."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.tags import DoubleDouble
from gpbnb.arithmetic.lanes import Lanes, recorded
from gpbnb.arithmetic.loop import DECAYED
from gpbnb.filters.contraction import (
    Contraction,
    Repeated,
    at_step,
    contraction_start,
    contraction_steps,
    covariance_error_bound,
    evaluation_errors,
    gain_error_bound,
    state_error_bound,
)
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import opening
from gpbnb.filters.recording import kalman_step, step_kind
from gpbnb.filters.steps import FACTORED, StepModel, combined_gain

Array = NDArray[np.float64]

_UNIT = 2.0**-100  # of double-double


class Bounds(NamedTuple):
    """Bounds at the checkpoint steps, infinite if there is none."""

    #: (c, n).
    state: Array
    #: (c, n, m).
    gain: Array
    #: (c, n, n), of the symmetric part.
    covariance: Array


class Taken(NamedTuple):
    """Steps that a run has taken, in double-double, (..., 2)."""

    #: (steps, m, 1, 2), the measurements.
    z: Array
    #: (steps, n, 1, 2), estimates before and after each step, after it without known inputs.
    before: Array
    after: Array
    #: (steps + 1, n, n, 2), covariances, or factors in the UD form, before and after each step.
    P: Array
    #: (steps, n, m, 2), gains as the run computed them.
    gains: Array
    #: (k, m, m, 2), factors of R as the run computed them.
    UR: Array


class CarriedBound:
    """The contraction bound of :mod:`gpbnb.filters.contraction`, computed along with a run in a form.

    The model is as the run stores it, without known inputs. If factors represent the covariance from which the run
    starts, it is given as Fractions, (n, n).
    """

    def __init__(
        self, stored: LinearModel, form: Form, first: NDArray[Any] | None, checkpoint_steps: NDArray[np.int64]
    ) -> None:
        self.form, self.checkpoint_steps = form, checkpoint_steps
        given = stored.to_float()
        self._plain = given["Phi"], given["H"], given["Q"], given["R"]
        self._exact = opening(stored, None, Form.INNOVATION, DoubleDouble()).letters
        self._repetition = _repetition(self._exact)
        n, m, count = stored.n, stored.m, len(checkpoint_steps)
        #: Bounds at the checkpoint steps.
        self.saved = Bounds(*(np.full((count, *shape), np.inf) for shape in ((n,), (n, m), (n, n))))
        off = np.zeros((n, n))
        if first is not None:  # the first factors may have errors
            off = np.abs((first - stored.P0).astype(np.float64)) * (1 + 2.0**-50)
        self._dropped = False  # whether an entry of a state counted as zero
        #: The bound after the last step that was taken.
        self.now: Contraction = contraction_start(given["P0"], np.zeros(n), off)

    def end(self) -> None:
        """Give up the bound, because a number is beyond double-double."""
        self.now = self.now._replace(eta=np.inf, zeta=np.inf)

    def take(self, first: int, taken: Taken) -> None:
        """Continue the bound over steps that a run has taken after the `first` ones, and save it at checkpoint steps.

        Each step is repeated in double-double from the run's state before that step, and its residuals enter the bound.
        Entries of the state below :data:`DECAYED` count as zero, so that this size is added to the bound. If a step
        cannot be repeated, there is no bound from there on.
        """
        try:
            taken = taken._replace(before=self._kept(taken.before), after=self._kept(taken.after))
            covariance = FACTORED[self.form].covariance if self.form in FACTORED else _symmetric
            (covariances,), _ = recorded(covariance, taken.P.shape[1:3]).begin(None, taken.P)
            done = self._take(first, taken, covariances) if len(covariances) else 0
        except (OverflowError, ZeroDivisionError):
            done = 0
        if done < len(taken.z):
            self.end()

    def _kept(self, x: Array) -> Array:
        """Let decayed entries of estimates be zero."""
        sizes = np.abs(x[..., :1])
        decayed = (sizes > 0) & (sizes < DECAYED)
        self._dropped = self._dropped or bool(decayed.any())
        return np.where(decayed, 0.0, x)

    def _take(self, first: int, taken: Taken, covariances: Array) -> int:
        """Take the bound over as many steps as can be repeated; return their number."""
        x, after, steps = taken.before[:, :, 0], taken.after[:, :, 0], len(covariances) - 1
        z, every = taken.z[:steps, :, 0], first + np.arange(steps)
        Phi, H, Q, R = (each[every % len(each)] for each in self._exact.values())
        (xe, Ke, Pe, Se), _ = self._repetition.begin(None, x[:steps], covariances[:-1], z, Phi, H, Q, R)
        steps, n, m = len(xe), x.shape[1], z.shape[1]
        compared = recorded(_residuals, (n, n), (m, n), (m,), (n,), (n,), (n, n), (n,), (n, n))
        given = Phi, H, z, x, after, covariances[1:], xe, Pe
        found, _ = compared.begin(None, *(each[:steps] for each in given))
        y, q, T = (each[..., 0] for each in found)
        steps = len(y)
        if not steps:
            return 0
        before, measured, K, S, size = map(
            np.ascontiguousarray, (x[..., 0], z[..., 0], Ke[:steps, ..., 0], Se[:steps, ..., 0], covariances[..., 0])
        )
        if self.form in FACTORED:
            diagonal = np.diagonal(size, axis1=1, axis2=2)
            size = np.sqrt(np.abs(diagonal[:, :, np.newaxis] * diagonal[:, np.newaxis, :])) * (1 + 2.0**-50)
        every = first + np.arange(steps)
        model = StepModel(*(each[every % len(each)] for each in self._plain))
        off = evaluation_errors(model, before[:steps], size[:steps], measured[:steps], K, S, _UNIT)
        bounds = contraction_steps(self.now, model, Repeated(K, S, y, q, T), off)
        self.now = at_step(bounds, -1)
        at, last = np.searchsorted(self.checkpoint_steps, (first, first + steps), side="right")
        i = self.checkpoint_steps[at:last] - first - 1
        some, used = Contraction(*(each[i] for each in bounds)), taken.gains[i]
        if self.form in FACTORED:
            UR = taken.UR[(first + i) % len(taken.UR)]
            (used,) = recorded(combined_gain, (n, m), (m, n), (m, m)).run(None, used, H[i], UR)
        bound = state_error_bound(some)
        self.saved.state[at:last] = np.nextafter(bound + DECAYED, np.inf) if self._dropped else bound
        self.saved.gain[at:last] = gain_error_bound(some, K[i], used[..., 0], off.gain[i])
        self.saved.covariance[at:last] = covariance_error_bound(some)
        return steps


def _repetition(exact: dict[str, Array]) -> Lanes:
    """Return a step in double-double from a given state; it takes the arrays x, P, z, Phi, H, Q and R."""
    step = kalman_step(step_kind(Form.INNOVATION, exact, None))
    (x, P), (K, S) = step.after, step.results
    given = [*step.states, *step.inputs, *step.coefficients]
    return Lanes(step.rows, step.tape.sizes, step.tape.all_constants, given, [x, K, P, S])


def _symmetric(P: Any) -> Any:
    return (P + P.T) * 0.5


def _residuals(Phi: Any, H: Any, z: Any, x: Any, after: Any, P: Any, repeated: Any, again: Any) -> tuple[Any, Any, Any]:
    """Return the innovation, and the state and covariance of a run minus the repeated ones."""
    return z - H @ (Phi @ x), after - repeated, P - _symmetric(again)
