"""A run of an extended or unscented Kalman filter in any format, and its reference in many bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, NegativeRootError, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.factors import upper_factors
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.listing import Listing
from gpbnb.filters.model import identity_in
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.opening import double_doubles_of
from gpbnb.filters.program import Program, entries
from gpbnb.filters.recording import block_algebra
from gpbnb.filters.reference import PreciseSteps, agreed, stacked
from gpbnb.filters.repeating import RepeatedStep, StepTaken
from gpbnb.filters.run import LEFT_TO_RIGHT, Run, Sums, reference_states
from gpbnb.filters.simulation import covariance_root, fine_resolution, simulated_measurements
from gpbnb.filters.steps import (
    FACTORED,
    BlockAlgebra,
    UnscentedModel,
    combined_gain,
    corrected_by,
    measured_in,
    observed,
    predicted_in,
    root_of_factors,
    unscented_step,
)

NONLINEAR_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.UD, Form.SYMMETRIZED, *ROOTS)
"""Forms of an extended filter. An unscented one has the innovation form only."""

BLOCK_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.UD)
"""Forms of an extended filter whose blocks may have formats of their own."""


class _Ahead(NamedTuple):
    """A predicted estimate (n,), and its covariance, factors or root (n, n)."""

    x: Any
    P: Any


class NonlinearRun:
    """A run of a nonlinear filter, one step after another; its attributes are those of a linear one.

    Parameters
    ----------
    model : the functions and the noise.
    fmt : any format, or formats for the blocks of an extended filter. The functions and their derivatives are computed
        in the format of the state.
    form : one of ``NONLINEAR_FORMS``. The factors and roots of Q, R and P0 are computed exactly from the model as
        given, before a format stores them.
    checkpoint_steps : as for :class:`~gpbnb.filters.run.Run`.
    """

    @stays
    def __init__(
        self,
        model: NonlinearModel,
        fmt: FloatFormat | BlockFormats,
        form: Form = Form.INNOVATION,
        checkpoint_steps: Sequence[int] = (),
    ) -> None:
        check_form(model, form, isinstance(fmt, BlockFormats))
        each = [getattr(fmt, name) for name in BLOCKS] if isinstance(fmt, BlockFormats) else [fmt] * len(BLOCKS)
        of_state, of_covariance = each[0], each[2]
        self.model, self.fmt, self.form = model, fmt, form
        self.checkpoint_steps = tuple(int(step) for step in checkpoint_steps)
        self.steps, self.reason = 0, ""
        self.indefinite: int | None = None
        self.stopped: int | None = None
        self._saved: list[tuple[int, Any, Any, Any]] = []
        for block in each:
            identity_in(block, 1)
        stored_in = fmt.model if isinstance(fmt, BlockFormats) else fmt
        sound = model.noise.definite_in(stored_in)
        #: Changes of the covariances, including those of the model.
        self.repairs = list(sound.repairs)
        arrays = sound.arrays(stored_in)
        self._R, self._Q = list(arrays["R"]), list(arrays["Q"])
        P = arrays["P0"]
        if form in FACTORED:
            self._R = [stored_in.store(upper_factors(one)) for one in sound.R]
            self._Q = [self._factors(upper_factors(one), stored_in) for one in sound.Q]
            P = self._factors(upper_factors(sound.P0), stored_in)
        self._stored = of_state.array
        self._weights = [of_state.array(each) for each in model.weights()] if model.method == "unscented" else []
        self._u = _inputs(model, of_state)
        formats = list(dict.fromkeys([*each, stored_in]))
        self._blocks_at = [formats.index(block) for block in each]
        self._present: NDArray[np.bool_] | None = None
        start = of_state.array(arrays["x0"]), of_covariance.array(P)
        self._step = RepeatedStep(self._stepped, formats, start)

    def _factors(self, factors: NDArray[Any], fmt: FloatFormat) -> FloatArray:
        stored = fmt.store(factors)
        return root_of_factors(stored) if self.form in ROOTS else stored

    @property
    def x(self) -> FloatArray:
        """The estimate, (n,)."""
        return self._step.states[0]

    @property
    def P(self) -> FloatArray:
        """The covariance, its factors or its root, (n, n)."""
        return self._step.states[1]

    def take(self, z: Any) -> None:
        """Continue by as many steps as there are measurements, (steps, m); a run that has stopped does not continue."""
        for _ in self.steps_taken(z):
            pass

    def states(self, z: Any) -> NDArray[np.float64]:
        """Continue as :meth:`take` does, and return all estimates, (steps done, n, 2), as double-double."""
        found = [double_doubles_of(self.x) for _ in self.steps_taken(z)]
        return np.array(found, dtype=np.float64).reshape(-1, self.model.n, 2)

    def steps_taken(self, z: Any) -> Iterator[int]:
        """Take one step after the other, and give the number of those done."""
        self.model.noise.check_measurements(z, self.steps)
        for measured in self._stored(z):
            if self.stopped is not None:
                return
            try:
                definite = self._take(self.steps, measured)
            except (ZeroDivisionError, OverflowError, DomainError, WholeNumberError) as error:
                self.stopped = self.steps + 1
                self.reason = f"{_fault(error)} at step {self.stopped}"
                return
            self.steps += 1
            if not definite and self.indefinite is None:
                self.indefinite = self.steps
            at = len(self._saved)
            if at < len(self.checkpoint_steps) and self.checkpoint_steps[at] == self.steps:
                self._saved.append((self.steps, self.x, self._step.gain, self.P))
            yield self.steps

    def checkpoints(self) -> Checkpoints:
        """Return estimate, gain and covariance at the checkpoint steps that were reached."""
        n, m = self.model.n, self.model.m
        x, K, P = np.empty((len(self._saved), n), object), np.empty((len(self._saved), n, m), object), []
        for at, (step, state, K_saved, covariance) in enumerate(self._saved):
            x[at], K[at] = state.to_fractions(), self._whole_gain(step - 1, K_saved)
            P.append(self.covariance(covariance))
        steps = tuple(step for step, *_ in self._saved)
        return Checkpoints(steps, x, K, np.array(P, dtype=object).reshape(-1, n, n))

    def covariance(self, P: FloatArray) -> NDArray[Any]:
        """Return the exact covariance, as Fractions, from a covariance, its factors or its root."""
        given: NDArray[Any] = P.to_fractions()
        return FACTORED[self.form].covariance(given) if self.form in FACTORED else given

    # -- one step ---------------------------------------------------------------------------------------

    @property
    def kept(self) -> list[tuple[int, int]]:
        """The entries of the covariance, its factors or its root that are not always zero."""
        upper = self.form in (Form.UD, Form.CARLSON)
        return [(i, j) for i, j in np.ndindex(self.model.n, self.model.n) if not upper or i <= j]

    def program(self, exact: bool = True) -> tuple[Program, list[NDArray[Any]]]:
        """Return the operations of a step, and its coefficients but 0 and 1, which are the last, each with its cycle.

        States are x (n), then the entries of P that are kept; inputs are the measurements, then the known inputs.

        Parameters
        ----------
        exact : as for :class:`~gpbnb.filters.listing.Listing`.

        Raises
        ------
        ValueError : the step cannot be traced, or has a function that C lacks; the message says why.
        """
        found = self._step.recorded(self._given(0, self._stored(np.zeros(self.model.m))))
        tape, (x, P, z, *places) = found.tape, found.places
        members = [np.stack([each.to_fractions() for each in cycle]) for cycle in (self._Q, self._R)]
        members += [each.reshape(1, -1).to_fractions() for each in self._weights]
        u = [each for array in places[len(members) :] for each in array.tolist()]
        known = [at for array in places[: len(members)] for at in array.ravel().tolist()]
        constants = {at: value for at, value in tape.constants_in(self.fmt).items() if at not in (0, tape.one)}
        members.append(np.array([list(constants.values())], dtype=object))
        order = [*known, *constants, 0, tape.one]
        states = [*x.tolist(), *(int(P[at]) for at in self.kept)]
        zeros = {*P.ravel().tolist()} - {*states}
        coefficients = {at: i for i, at in enumerate(order)} | dict.fromkeys(zeros, len(order) - 2)
        listing = Listing(
            tape,
            states,
            [*z.tolist(), *u],
            coefficients,
            {tape.one, *(at for at, value in constants.items() if value)},
            exact,
        )
        after, covariance = (each.components[0] for each in found.taken.states)
        letter = "U" if self.form is Form.UD else "S" if self.form in ROOTS else "P"
        names = [each for one, cycle in zip("QR", members, strict=False) for each in entries(one, *cycle.shape[1:])]
        names += [f"c{i}" for i in range(len(order) - len(names) - 2)]
        program = listing.program(
            [*after.tolist(), *(int(covariance[at]) for at in self.kept)],
            len(order),
            0,
            [*entries("x", len(x)), *(f"{letter}[{i}][{j}]" for i, j in self.kept)],
            [*names, "zero", "one"],
            found.taken.definite,
        )
        return program, members

    def _given(self, k: int, z: FloatArray) -> list[FloatArray]:
        known = [] if self._u is None else [self._u[k]]
        return [z, self._member(self._Q, k), self._member(self._R, k), *self._weights, *known]

    def _take(self, k: int, z: FloatArray) -> bool:
        self._present = self.model.seen(k)
        kind = None if self._present is None else self._present.tobytes()
        return self._step.take(self._given(k, z), kind)

    def _stepped(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        each = [formats[i] for i in self._blocks_at]
        blocks = block_algebra(each)
        taken = (self._unscented if self.model.method == "unscented" else self._extended)(blocks, *states, *given)
        x, *others = taken.states
        return taken._replace(states=(self.model.normalized(x), *others))

    def _extended(self, blocks: BlockAlgebra, x: Any, P: Any, z: Any, Q: Any, R: Any, u: Any = None) -> StepTaken:
        """Predict, then update once or several times, each time with h and H at the last estimate."""
        model = self.model
        x, F = model.moved(x, u)
        predicted, definite = self._predicted(blocks, F, P, Q)
        ahead, K, positive = _Ahead(x, predicted), None, True
        for _ in range(model.iterations):
            expected, H = model.measured(x, u)
            y = model.difference(z, expected)
            if x is not ahead.x:
                y = y - H @ (ahead.x - x)
            x, P, K, positive = self._updated(blocks, self._seen(H), R, self._seen(y), ahead)
        return StepTaken((x, P), K, definite & positive)

    def _predicted(self, blocks: BlockAlgebra, F: Any, P: Any, Q: Any) -> tuple[Any, Any]:
        if self.form in FACTORED:
            taken = blocks.stored.covariance
            return FACTORED[self.form].predict(taken(F), P, taken(Q))
        return predicted_in(blocks, F, P, Q), True

    def _updated(self, blocks: BlockAlgebra, H: Any, R: Any, y: Any, ahead: _Ahead) -> tuple[Any, Any, Any, Any]:
        """Return estimate, covariance, gain, and whether all variances and pivots are positive."""
        stored = blocks.stored
        if self.form in FACTORED:  # what the measurements correct is zero before them
            observe = FACTORED[self.form].observe
            observe = partial(observe, stored=stored) if self.form is Form.UD else observe
            step = observed(observe, H, R, y, ahead.x * 0, ahead.P, stored)
            return ahead.x + step.x, step.P, (step.gains, H, R), step.definite
        found = measured_in(blocks, self.form, H, R, ahead.P)
        return corrected_by(blocks.state, stored.state(found.K), ahead.x, y), found.P, found.K, found.definite

    def _unscented(
        self, blocks: BlockAlgebra, x: Any, P: Any, z: Any, Q: Any, R: Any, scale: Any, means: Any, covariances: Any,
        u: Any = None,
    ) -> StepTaken:  # fmt: skip
        model = self.model
        step = UnscentedModel(
            lambda x: model.value("f", x, u),
            lambda x: model.value("h", x, u),
            lambda a, b: self._seen(model.difference(a, b)),
            scale,
            means,
            covariances,
            Q,
            R,
        )
        found = unscented_step(blocks.state, step, x, P, z)
        return StepTaken((found.x, found.P), found.K, found.definite)

    def _seen(self, numbers: Any) -> Any:
        """Return numbers (m,) or (m, n) with zeros where a measurement of this step is missing."""
        seen = self._present
        if seen is None or seen.all():
            return numbers
        return np.where(seen.reshape(-1, *(1,) * (numbers.ndim - 1)), numbers, 0)

    @staticmethod
    def _member(cycle: list[FloatArray], k: int) -> FloatArray:
        return cycle[k % len(cycle)]

    def _whole_gain(self, k: int, gain: Any) -> NDArray[Any]:
        if not isinstance(gain, tuple):
            return np.asarray(gain.to_fractions(), dtype=object)
        columns, H, UR = gain
        K = np.stack([each.to_fractions() for each in columns], axis=1)
        return np.asarray(combined_gain(K, H.to_fractions(), UR.to_fractions()))


def _inputs(model: NonlinearModel, fmt: FloatFormat) -> Any:
    return None if model.u is None else fmt.array(model.u)


def _fault(error: Exception) -> str:
    if isinstance(error, OverflowError):
        return "overflow"
    if isinstance(error, NegativeRootError):
        return "the square root of a negative number"
    if isinstance(error, WholeNumberError):
        return "a whole number that the format does not hold exactly"
    return "an argument outside the domain of a function" if isinstance(error, DomainError) else "a division by zero"


def check_form(model: NonlinearModel, form: Form, blocks: bool = False) -> None:
    """Reject a form that a nonlinear filter, or its blocks, do not have."""
    if model.method == "unscented":
        if form is not Form.INNOVATION or blocks:
            raise ValueError(
                f"got {'formats of blocks' if blocks else f'the {form} form'} for an unscented filter; needed the "
                "innovation form in one format: it has no Jacobians to factor its update by"
            )
    elif blocks and form not in BLOCK_FORMS:
        raise ValueError(f"got formats of blocks in the {form} form; needed one of {', '.join(map(str, BLOCK_FORMS))}")
    elif form not in NONLINEAR_FORMS:
        raise ValueError(
            f"got the {form} form for a nonlinear filter; needed one of {', '.join(map(str, NONLINEAR_FORMS))}: closed "
            "loops and compensated estimates need a linear model"
        )


def opened(
    model: AnyModel,
    fmt: FloatFormat | BlockFormats,
    form: Form,
    checkpoint_steps: Sequence[int] = (),
    bounded: bool = False,
    sums: Sums = LEFT_TO_RIGHT,
    compensated: bool = False,
) -> Run | NonlinearRun:
    """Return a run of a filter."""
    if isinstance(model, NonlinearModel):
        if compensated or sums != LEFT_TO_RIGHT:
            raise ValueError("got sums or compensated estimates for a nonlinear model; needed neither: it has no loops")
        return NonlinearRun(model, fmt, form, checkpoint_steps)
    return Run(model, fmt, form, checkpoint_steps, sums, compensated, bounded)


def true_states(model: AnyModel, z: Any) -> NDArray[np.float64]:
    """Return the estimates after every step without rounding, (steps, n, 2), as double-double.

    Those of a nonlinear filter are computed in bits that agree with twice as many.
    """
    if not isinstance(model, NonlinearModel):
        return reference_states(model, z)
    return double_doubles_of(nonlinear_reference(model, z).x)


def nonlinear_reference(model: NonlinearModel, z: Any) -> PreciseSteps:
    """Return estimate, gain and covariance after every step, in bits that agree with a run in fewer bits."""
    measured = exact(z)
    return agreed(model.name, len(measured), lambda bits: _steps(model, measured, bits))


def nonlinear_checkpoints(model: NonlinearModel, z: Any, checkpoint_steps: Sequence[int]) -> Checkpoints:
    """Return some steps of :func:`nonlinear_reference`; `z` may be an array of a format."""
    measured = z.to_fractions() if hasattr(z, "to_fractions") else z
    return nonlinear_reference(model, measured).checkpoints(checkpoint_steps)


def _steps(model: NonlinearModel, z: NDArray[Any], bits: int) -> PreciseSteps | str:
    """Return all steps in some bits, or why the run stops."""
    run = NonlinearRun(model, FloatFormat(2, bits))
    done = [(run.x, run._step.gain, run.P) for _ in run.steps_taken(z)]
    return run.reason or stacked(done)


def simulated(model: AnyModel, steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate measurements (steps, m) of a process that starts at the first estimate.

    Those of a nonlinear process are computed in binary64, with every operation correctly rounded, and are rounded to
    :func:`gpbnb.filters.simulation.fine_resolution`; they are the same on every machine.
    """
    if not isinstance(model, NonlinearModel):
        return simulated_measurements(model, steps, seed)
    model.check_steps(steps)
    noise, fmt, rng = model.noise, FloatFormat(2, 53), np.random.default_rng(seed)
    roots = [[fmt.array(covariance_root(each)) for each in cycle] for cycle in (noise.Q, noise.R)]
    u, unit, z = _inputs(model, fmt), np.asarray(fine_resolution(noise)), np.empty((steps, model.m))

    def take(formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        (x,), (of_Q, w, of_R, v, *u) = states, given
        x = model.value("f", x, *u) + of_Q @ w
        return StepTaken((x,), model.value("h", x, *u) + of_R @ v, True)

    step = RepeatedStep(take, [fmt], (fmt.array(noise.x0),))
    for k in range(steps):
        (of_Q, w), (of_R, v) = ((each[k % len(each)], fmt.array(rng.standard_normal(len(each[0])))) for each in roots)
        step.take([of_Q, w, of_R, v, *([] if u is None else [u[k]])])
        z[k] = step.gain.to_float()
    return np.asarray(np.rint(z / unit) * unit)
