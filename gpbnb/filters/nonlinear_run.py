"""A run of an extended or unscented Kalman filter in any format, and its reference in many bits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray, NegativeRootError, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.blocks import BLOCKS, BlockFormats
from gpbnb.filters.checkpoints import Checkpoints, Progress, without_factors
from gpbnb.filters.factors import upper_factors
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.model import check_one
from gpbnb.filters.nonlinear import AnyModel, NonlinearModel
from gpbnb.filters.opening import double_doubles_of
from gpbnb.filters.program import Program
from gpbnb.filters.recording import block_algebra, filter_program, program_states
from gpbnb.filters.reference import PreciseSteps, agreed, joined
from gpbnb.filters.repeating import RepeatedStep
from gpbnb.filters.run import Run, reference_states
from gpbnb.filters.simulation import covariance_root, fine_resolution, simulated_measurements
from gpbnb.filters.steps import (
    FACTORED,
    BlockAlgebra,
    ExtendedModel,
    StepTaken,
    UnscentedModel,
    extended_step,
    root_of_factors,
    unscented_step,
)

NONLINEAR_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.UD, Form.SYMMETRIZED, *ROOTS)
"""Forms of an extended filter. An unscented one has the innovation form only."""

BLOCK_FORMS = (Form.INNOVATION, Form.JOSEPH, Form.UD)
"""Forms of an extended filter whose blocks may have formats of their own."""


_WEIGHTS = ("scale", "means", "covariances")


class NonlinearRun(Progress):
    """A run of a nonlinear filter.

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
        super().__init__(checkpoint_steps)
        each = [getattr(fmt, name) for name in BLOCKS] if isinstance(fmt, BlockFormats) else [fmt] * len(BLOCKS)
        of_state, of_covariance = each[0], each[2]
        self.model, self.fmt, self.form = model, fmt, form
        for block in each:
            check_one(block)
        stored_in = fmt.model if isinstance(fmt, BlockFormats) else fmt
        sound = model.noise.definite_in(stored_in)
        #: Changes of the covariances, including those of the model.
        self.repairs = list(sound.repairs)
        given = sound.arrays(stored_in)
        P = given["P0"]
        if form in FACTORED:
            given["R"] = stored_in.store(np.stack([upper_factors(one) for one in sound.R]))
            given["Q"] = cast(Any, np.stack)([self._factors(one, stored_in) for one in sound.Q])
            P = self._factors(sound.P0, stored_in)
        #: What a step is given of the model, in cycles, by names.
        self.given = {letter: given[letter] for letter in "QR"}
        if model.method == "unscented":
            weights = zip(_WEIGHTS, model.weights(), strict=True)
            self.given |= {name: of_state.array(np.array([each])) for name, each in weights}
        if model.u is not None:
            self.given["u"] = of_state.array(model.u)
        if len(model.noise.H) > 1:
            self.given["seen"] = of_state.array(model.seen.astype(int))
        formats = list(dict.fromkeys([*each, stored_in]))
        self._stored, self._blocks_at = of_state.array, [formats.index(block) for block in each]
        start = of_state.array(given["x0"]), of_covariance.array(P)
        self._step = RepeatedStep(self._stepped, formats, start, list(self.given.values()))

    def _factors(self, covariance: NDArray[Any], fmt: FloatFormat) -> FloatArray:
        stored = fmt.store(upper_factors(covariance))
        return root_of_factors(stored) if self.form in ROOTS else stored

    @property
    def x(self) -> FloatArray:
        """The estimate, (n,)."""
        return self._step.states[0]

    @property
    def P(self) -> FloatArray:
        """The covariance, its factors or its root, (n, n)."""
        return self._step.states[1]

    def estimates(self, found: StepTaken) -> NDArray[np.float64]:
        """Return the estimates of some steps, (steps, n, 2), as double-double."""
        return double_doubles_of(found.states[0])

    def blocks(self, z: Any) -> Iterator[StepTaken]:
        """Continue as a linear run does.

        The gain is (K,), or with factors or roots the gains of one measurement after the other, H, and factors of R.
        """
        self.model.noise.check_measurements(z, self.steps)
        if self.stopped is not None or not len(z):
            return
        try:
            for found in self._step.take(self._stored(z)):
                self.done(found.definite, *found.states, *found.gain)
                yield found
        except (ZeroDivisionError, OverflowError, DomainError, WholeNumberError) as error:
            self.stop(_fault(error))

    def checkpoints(self) -> Checkpoints:
        """Return estimate, gain and covariance at the checkpoint steps that were reached."""
        steps = tuple(self.checkpoint_steps[: self.saved].tolist())
        if not steps:
            n, m = self.model.n, self.model.m
            return Checkpoints(steps, *(np.zeros((0, *shape), object) for shape in ((n,), (n, m), (n, n))))
        x, P, K, *factors = (each.to_fractions() for each in self.kept())
        return Checkpoints(steps, x, *(without_factors(self.form, K, P, *factors) if factors else (K, P)))

    # -- one step ---------------------------------------------------------------------------------------

    def program(self) -> tuple[Program, list[NDArray[Any]]]:
        """Return the operations of a step, and its coefficients but 1, which is the last, each with its cycle.

        Inputs are the measurements, then the known inputs. ValueError says why a step cannot be traced.
        """
        found = self._step.recorded(self._step.given(self._stored(np.zeros(self.model.m))))
        tape, (x, P) = found.tape, found.states
        constants = {at: value for at, value in tape.constants_in(self.fmt).items() if at not in (0, tape.one)}
        states = program_states(self.form, x[None], P[None])[0]
        constants |= dict.fromkeys({*P.ravel().tolist()} - {*states.tolist()}, Fraction(0))
        program = filter_program(self.form, found, self.given, [*constants])
        cycles = (each.reshape(len(each), -1).to_fractions() for name, each in self.given.items() if name != "u")
        return program, [*cycles, np.array([list(constants.values())], dtype=object)]

    def _stepped(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        blocks = block_algebra([formats[i] for i in self._blocks_at])
        take = self._unscented if self.model.method == "unscented" else self._extended
        x, P = states
        taken = take(blocks, x, P, dict(zip(("z", *self.given), given, strict=True)))
        x, P = taken.states
        return taken._replace(states=(self.model.normalized(x), P))

    def _extended(self, blocks: BlockAlgebra, x: Any, P: Any, given: dict[str, Any]) -> StepTaken:
        model, u = self.model, given.get("u")
        step = ExtendedModel(
            lambda x: model.moved(x, u),
            lambda x: model.measured(x, u),
            model.difference,
            lambda numbers: _seen(given, numbers),
            model.iterations,
            given["Q"],
            given["R"],
        )
        return extended_step(blocks, self.form, step, x, P, given["z"])

    def _unscented(self, blocks: BlockAlgebra, x: Any, P: Any, given: dict[str, Any]) -> StepTaken:
        model, u = self.model, given.get("u")
        step = UnscentedModel(
            lambda x: model.value("f", x, u),
            lambda x: model.value("h", x, u),
            lambda a, b: _seen(given, model.difference(a, b)),
            *(given[name] for name in (*_WEIGHTS, "Q", "R")),
        )
        return unscented_step(blocks.state, step, x, P, given["z"])


def _seen(given: dict[str, Any], numbers: Any) -> Any:
    """Return numbers (m,) or (m, n) with zeros where a measurement of this step is missing."""
    if "seen" not in given:
        return numbers
    return np.where(given["seen"].reshape(-1, *(1,) * (numbers.ndim - 1)) != 0, numbers, 0)


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
) -> Run | NonlinearRun:
    """Return a run of a filter."""
    if isinstance(model, NonlinearModel):
        return NonlinearRun(model, fmt, form, checkpoint_steps)
    return Run(model, fmt, form, checkpoint_steps, bounded=bounded)


def true_states(model: AnyModel, z: Any) -> NDArray[np.float64]:
    """Return the estimates after every step without rounding, (steps, n, 2), as double-double.

    Those of a nonlinear filter are computed as :func:`nonlinear_reference` does.
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
    found = [(each.states[0], each.gain[0], each.states[1]) for each in run.blocks(z)]
    return run.reason or joined(found)


def simulated(model: AnyModel, steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate measurements (steps, m) of a process that starts at the first estimate.

    Those of a nonlinear process are computed in binary64, with every operation correctly rounded, and are rounded to
    :func:`gpbnb.filters.simulation.fine_resolution`; they are the same on every machine.
    """
    if not isinstance(model, NonlinearModel):
        return simulated_measurements(model, steps, seed)
    model.check_steps(steps)
    noise, fmt, rng = model.noise, FloatFormat(2, 53), np.random.default_rng(seed)
    roots = [fmt.array(np.stack([covariance_root(each) for each in cycle])) for cycle in (noise.Q, noise.R)]
    unit = np.asarray(fine_resolution(noise))
    cycles = roots if model.u is None else [*roots, fmt.array(model.u)]

    def take(formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        (x,), (w, v, of_Q, of_R, *u) = states, given
        x = model.value("f", x, *u) + of_Q @ w
        return StepTaken((x,), model.value("h", x, *u) + of_R @ v, True)

    step = RepeatedStep(take, [fmt], (fmt.array(noise.x0),), cycles)
    w, v = np.split(rng.standard_normal((steps, model.n + model.m)), [model.n], axis=1)
    z = np.concatenate([each.gain.to_float() for each in step.take(fmt.array(w), fmt.array(v))])
    return np.asarray(np.rint(z / unit) * unit)
