"""The contraction bound of a run, taken along step by step, in compiled runs and in array runs alike."""

from __future__ import annotations

from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels.tags import DoubleDouble
from gpbnb.arithmetic.machine import code_of, evaluate, packed_constants, tables
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
from gpbnb.filters.kalman_step import StepModel
from gpbnb.filters.kernels.bounded import represented, residuals, symmetric_parts, whole_gain
from gpbnb.filters.model import LinearModel
from gpbnb.filters.opening import StepArrays, as_packed, opening, step_arrays
from gpbnb.filters.recording import recorded_step, step_kind

Array = NDArray[np.float64]

DECAYED = 2.0**-700
"""Size below which an entry of the estimate becomes zero where a step would leave the range of float64."""

_UNIT = 2.0**-100  # of double-double
_NUMBERS = 1 << 19  # that are computed at once


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
    #: (steps + 1, n, 1, 2), estimates before and after each step.
    x: Array
    #: (steps + 1, n, n, 2), covariances, or factors in the UD form, before and after each step.
    P: Array
    #: (steps, n, m, 2), gains as the run computed them.
    gains: Array
    #: (k, m, m, 2), factors of R as the run computed them.
    UR: Array


class CarriedBound:
    """The contraction bound of :mod:`gpbnb.filters.contraction`, computed along with a run.

    Parameters
    ----------
    stored : the model as the run stores it, without known inputs.
    form : the form whose covariances, or factors, and gains the steps have.
    first : (n, n), the covariance from which the run starts, as Fractions, if factors represent it; otherwise None.
    checkpoint_steps : steps after which bounds are saved.
    """

    def __init__(
        self, stored: LinearModel, form: Form, first: NDArray[Any] | None, checkpoint_steps: NDArray[np.int64]
    ) -> None:
        self.form, self.checkpoint_steps = form, checkpoint_steps
        given = stored.to_float()
        self._plain = given["Phi"], given["H"], given["Q"], given["R"]
        start = opening(stored, None, Form.INNOVATION, DoubleDouble())
        self._exact = step_arrays(start, as_packed(None, np.eye(stored.n)))
        self._repetition = _Repetition(self._exact)
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
        """Continue the bound over steps that a run has taken, and save it at checkpoint steps.

        Each step is repeated in double-double from the run's state before that step, and its residuals enter the bound.
        Entries of the state below :data:`DECAYED` count as zero, so that this size is added to the bound. If a step
        cannot be repeated, there is no bound from there on.

        Parameters
        ----------
        first : how many steps were taken before these.
        """
        try:
            sizes = np.abs(taken.x[..., 0])
            decayed = (sizes > 0) & (sizes < DECAYED)
            if decayed.any():
                taken, self._dropped = taken._replace(x=np.where(decayed[..., np.newaxis], 0.0, taken.x)), True
            covariances = np.empty_like(taken.P)
            (represented if self.form == Form.UD else symmetric_parts)(taken.P, covariances)
            done = self._take(first, taken, covariances)
        except (OverflowError, ZeroDivisionError):
            done = 0
        if done < len(taken.z):
            self.end()

    def _take(self, first: int, taken: Taken, covariances: Array) -> int:
        """Take the bound over as many steps as can be repeated; return their number."""
        z, x, exact = taken.z, taken.x, self._exact
        xe, Ke, Pe, Se = self._repetition.take(z, first, x[:-1], covariances[:-1])
        steps, n, m = len(xe), x.shape[1], z.shape[1]
        if not steps:
            return 0
        y, q, T = np.empty((steps, m)), np.empty((steps, n)), np.empty((steps, n, n))
        residuals(exact, z[:steps], first, x[: steps + 1], covariances[: steps + 1], (xe, Pe), (y, q, T))
        before, measured, K, S, size = map(
            np.ascontiguousarray, (x[..., 0, 0], z[..., 0, 0], Ke[..., 0], Se[..., 0], covariances[..., 0])
        )
        if self.form == Form.UD:
            diagonal = np.diagonal(size, axis1=1, axis2=2)
            size = np.sqrt(np.abs(diagonal[:, :, np.newaxis] * diagonal[:, np.newaxis, :])) * (1 + 2.0**-50)
        every = np.arange(first, first + steps)
        model = StepModel(*(each[every % len(each)] for each in self._plain))
        off = evaluation_errors(model, before[:steps], size[:steps], measured[:steps], K, S, _UNIT)
        bounds = contraction_steps(self.now, model, Repeated(K, S, y, q, T), off)
        self.now = at_step(bounds, -1)
        at, last = np.searchsorted(self.checkpoint_steps, (first, first + steps), side="right")
        i = self.checkpoint_steps[at:last] - first - 1
        some, used = Contraction(*(each[i] for each in bounds)), taken.gains[i]
        if self.form == Form.UD:
            used = np.empty_like(used)
            for j, k in enumerate(i):
                of_step = exact.H[(first + k) % len(exact.H)], taken.UR[(first + k) % len(taken.UR)]
                whole_gain(taken.gains[k], *of_step, used[j])
        bound = state_error_bound(some)
        self.saved.state[at:last] = np.nextafter(bound + DECAYED, np.inf) if self._dropped else bound
        self.saved.gain[at:last] = gain_error_bound(some, K[i], used[..., 0], off.gain[i])
        self.saved.covariance[at:last] = covariance_error_bound(some)
        return steps


class _Repetition:
    """Steps in double-double, each from a given state, all at once: each is a lane of the machine."""

    def __init__(self, exact: StepArrays) -> None:
        self._model = {"Phi": exact.Phi, "H": exact.H, "Q": exact.Q, "R": exact.R}
        self._step = recorded_step(step_kind(Form.INNOVATION, self._model, None))
        gain, estimate = self._step.gain, self._step.estimate
        rows = np.concatenate([gain.rows, estimate.rows])[np.argsort(np.concatenate([gain.at, estimate.at]))]
        self._code = code_of(rows, np.zeros(len(rows), np.int64))
        self._kind, self._formats = tables([None])

    def take(self, z: Array, first: int, x: Array, P: Array) -> tuple[Array, ...]:
        """Return estimates, gains, covariances and innovation covariances of steps, as far as they can be repeated."""
        most = max(_NUMBERS // self._step.sizes[0], 1)
        found = []
        for begin in range(0, len(z), most):
            steps = slice(begin, begin + most)
            each = self._together(z[steps], first + begin, x[steps], P[steps])
            if each is None:  # some of them, one by one
                each = self._alone(z[steps], first + begin, x[steps], P[steps])
            found.append(each)
            if len(each[0]) < len(z[steps]):
                break
        return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))

    def _alone(self, z: Array, first: int, x: Array, P: Array) -> tuple[Array, ...]:
        found = [tuple(each[:0] for each in self._together(z[:0], first, x[:0], P[:0]) or ())]
        for k in range(len(z)):
            each = self._together(z[k : k + 1], first + k, x[k : k + 1], P[k : k + 1])
            if each is None:
                break
            found.append(each)
        return tuple(np.concatenate(parts) for parts in zip(*found, strict=True))

    def _together(self, z: Array, first: int, x: Array, P: Array) -> tuple[Array, ...] | None:
        step, steps = self._step, len(z)
        values, truths = np.zeros((step.sizes[0], steps, 2)), np.zeros((step.sizes[1], steps), np.uint8)
        truths[1] = 1
        for constants in filter(attrgetter("places"), step.constants):
            values[constants.places] = packed_constants(None, constants)[:, np.newaxis]
        every = first + np.arange(steps)
        given = {"z": z, "x": x, "P": P} | {letter: each[every % len(each)] for letter, each in self._model.items()}
        for letter, each in given.items():
            places = step.places[letter].ravel()
            values[places] = np.moveaxis(each.reshape(steps, len(places), 2), 0, 1)
        if steps and evaluate(self._kind, self._formats, self._code, values, truths) < len(self._code.rows):
            return None

        def taken(places: NDArray[np.int64]) -> Array:
            return np.ascontiguousarray(np.moveaxis(values[places], -2, 0))

        return taken(step.after["x"][:, np.newaxis]), taken(step.K), taken(step.after["P"]), taken(step.S)
