"""A filter run with array operations: every form, known inputs and offsets, with or without its contraction bound.

It supports what the compiled loops of :mod:`gpbnb.filters.run` do not: the forms of
:class:`~gpbnb.filters.array_forms.ArrayForm`, and models with known inputs. Without inputs, a form that both support
gives the same digits.
"""

from __future__ import annotations

import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Algebra
from gpbnb.arithmetic.array import FloatArray, NegativeRootError, WholeNumberError
from gpbnb.arithmetic.elementary import DomainError
from gpbnb.arithmetic.exits import stays
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.kernels.backends import double_doubles
from gpbnb.filters import array_steps
from gpbnb.filters.array_forms import AnyForm, ArrayForm
from gpbnb.filters.array_steps import ONE_FORMAT, BlockStorage
from gpbnb.filters.bounded_steps import CarriedBound, Taken
from gpbnb.filters.checkpoints import Checkpoints
from gpbnb.filters.factors import combined_gain, covariance_of_factors
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import HUNG_FORMS, BlockAlgebra
from gpbnb.filters.model import LinearModel, identity_in
from gpbnb.filters.opening import double_doubles_of, opening
from gpbnb.filters.recording import FACTORED, LinearStep
from gpbnb.filters.repeating import RepeatedStep, StepTaken

ROOTS = (ArrayForm.POTTER, ArrayForm.CARLSON)


class SteppedRun(ABC):
    """A run that takes one step after another in array operations, and keeps what a search asks of it.

    Parameters
    ----------
    n, m : numbers of states and measurements.
    stored : function that rounds measurements into the format of the state.
    form : form of the update.
    checkpoint_steps : as for :class:`~gpbnb.filters.run.Run`.
    """

    _step: RepeatedStep
    _bound: _BoundTaker | None = None

    def __init__(
        self, n: int, m: int, stored: Callable[[Any], FloatArray], form: AnyForm, checkpoint_steps: Sequence[int]
    ) -> None:
        self._size, self._stored, self.form = (n, m), stored, form
        self.checkpoint_steps = tuple(int(step) for step in checkpoint_steps)
        self.steps, self.reason = 0, ""
        self.indefinite: int | None = None
        self.stopped: int | None = None
        self._saved: list[tuple[int, Any, Any, Any]] = []

    @property
    def x(self) -> FloatArray:
        """The estimate, (n,)."""
        return self._step.states[0]

    @property
    def P(self) -> FloatArray:
        """The covariance, its factors or its root, (n, n)."""
        return self._step.states[1]

    @abstractmethod
    def _take(self, k: int, z: FloatArray) -> bool:
        """Take step k + 1, and return whether all is definite."""

    @abstractmethod
    def _check(self, z: Any) -> None:
        """Reject measurements of another shape, or of more steps than the model describes."""

    @abstractmethod
    def _whole_gain(self, k: int, gain: Any) -> NDArray[Any]:
        """Return the exact gain of step k + 1 for all measurements together."""

    def take(self, z: Any) -> None:
        """Continue by as many steps as there are measurements, (steps, m); a run that has stopped does not continue."""
        for _ in self._steps_taken(z):
            pass

    def states(self, z: Any) -> NDArray[np.float64]:
        """Continue as :meth:`take` does, and return all estimates, (steps done, n, 2), as double-double."""
        found = [double_doubles_of(self.x) for _ in self._steps_taken(z)]
        return np.array(found, dtype=np.float64).reshape(-1, self._size[0], 2)

    def _steps_taken(self, z: Any) -> Iterator[int]:
        """Take one step after the other, and give the number of those done."""
        self._check(z)
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
            saved = at < len(self.checkpoint_steps) and self.checkpoint_steps[at] == self.steps
            if saved:
                self._saved.append((self.steps, self.x, self._step.gain, self.P))
            if self._bound is not None:
                self._bound.take(measured)
            yield self.steps

    def checkpoints(self) -> Checkpoints:
        """Return estimate, gain and covariance at the checkpoint steps that were reached."""
        n, m = self._size
        x, K, P = np.empty((len(self._saved), n), object), np.empty((len(self._saved), n, m), object), []
        for at, (step, state, K_saved, covariance) in enumerate(self._saved):
            x[at], K[at] = state.to_fractions(), self._whole_gain(step - 1, K_saved)
            P.append(self.covariance(covariance))
        steps = tuple(step for step, *_ in self._saved)
        return Checkpoints(steps, x, K, np.array(P, dtype=object).reshape(-1, n, n))

    def covariance(self, P: FloatArray) -> NDArray[Any]:
        """Return the exact covariance, as Fractions, from a covariance, its factors or its root."""
        given: NDArray[Any] = P.to_fractions()
        if self.form in ROOTS:
            return np.asarray(given @ given.T)
        if self.form is Form.UD:
            return covariance_of_factors(given)
        return given


def _fault(error: Exception) -> str:
    if isinstance(error, OverflowError):
        return "overflow"
    if isinstance(error, NegativeRootError):
        return "the square root of a negative number"
    if isinstance(error, WholeNumberError):
        return "a whole number that the format does not hold exactly"
    return "an argument outside the domain of a function" if isinstance(error, DomainError) else "a division by zero"


class ArrayRun(SteppedRun):
    """A run in array operations; its attributes are those of :class:`~gpbnb.filters.run.Run`.

    Parameters
    ----------
    model, fmt, checkpoint_steps : as for :class:`~gpbnb.filters.run.Run`.
    form : any form; Hung's forms only without known inputs, which the report does not have.
    bounded : whether to compute the contraction bound of the estimate, too.
    """

    @stays
    def __init__(
        self,
        model: LinearModel,
        fmt: FloatFormat,
        form: AnyForm,
        checkpoint_steps: Sequence[int],
        bounded: bool = False,
    ) -> None:
        if model.has_inputs and form in HUNG_FORMS:
            raise ValueError(
                f"got known inputs in the {form} form, which is not defined with them; needed another "
                'form, such as "innovation"'
            )
        fmt.check_compiled()
        super().__init__(model.n, model.m, fmt.array, form, checkpoint_steps)
        self.model, self.fmt = model, fmt
        sound = model.definite_in(fmt)
        #: Changes of the covariances, including those of the model.
        self.repairs = list(sound.repairs)
        stored = sound.arrays(fmt)
        x, P = stored.pop("x0"), stored.pop("P0")
        self._given: dict[str, list[FloatArray]] = {letter: [] for letter in ("B", "u", "b", "d")}
        for letter, each in stored.items():
            self._given[letter] = list(each[np.newaxis] if each.ndim == 1 else each)
        identity_in(fmt, 1)
        if form is ArrayForm.COMPENSATED:
            self._given["increment"] = [fmt.array(each - np.eye(model.n, dtype=int)) for each in model.Phi]
        if form in FACTORED:
            P = self._factored()
        self._letters = [letter for letter, members in self._given.items() if members]
        self._step = RepeatedStep(self._stepped, [fmt], (x, P, x * 0))
        self._bound = _BoundTaker(self) if bounded else None

    @property
    def bounded(self) -> bool:
        """Whether the run also computes the contraction bound of its estimate."""
        return self._bound is not None

    @property
    def bounds(self) -> tuple[NDArray[np.float64]]:
        """Bounds of the errors of the state at the checkpoint steps, (c, n); infinite if there is none."""
        if self._bound is None:
            raise ValueError("got a run without its bound; needed bounded=True")
        return (self._bound.carried.saved.state,)

    def _check(self, z: Any) -> None:
        self.model.check_measurements(z, self.steps)

    def known_state(self, k: int) -> NDArray[Any] | None:
        """Return the exact input to the states in step k + 1, as the format stores it; None without inputs."""
        known = [self._at("B", k).to_fractions() @ self._at("u", k).to_fractions()] if self._given["B"] else []
        if self._given["b"]:
            known.append(self._at("b", k).to_fractions())
        return sum(known[1:], known[0]) if known else None

    # -- one step ---------------------------------------------------------------------------------------

    def _take(self, k: int, z: FloatArray) -> bool:
        return self._step.take([z, *(self._at(letter, k) for letter in self._letters)])

    def _stepped(self, formats: Sequence[Any], states: tuple[Any, ...], given: Sequence[Any]) -> StepTaken:
        x, P, carried = states
        z, *matrices = given
        step = LinearStep(self.form, block_algebra([*formats] * 4), dict(zip(self._letters, matrices, strict=True)))
        found = step.taken(x, P, carried, z)
        return StepTaken((found.x, found.P, found.carried), found.K, found.definite)

    # -- what it needs ----------------------------------------------------------------------------------

    def _at(self, letter: str, k: int) -> FloatArray:
        members = self._given[letter]
        return members[k % len(members)]

    def _factored(self) -> FloatArray:
        """Compute factors of P0, Q and R as the compiled UD form does, and return those of P0."""
        start = opening(self.model.without_inputs(), self.fmt, Form.UD, self.fmt.run_tag())
        self.repairs += start.raised
        first, Q, R = (FloatArray.from_packed(each, self.fmt) for each in (start.U0, start.UQ, start.UR))
        self._given["UR"] = list(R)
        self._given["UQ"] = [array_steps.root_of_factors(each) for each in Q] if self.form in ROOTS else list(Q)
        return array_steps.root_of_factors(first) if self.form in ROOTS else first

    def _whole_gain(self, k: int, gain: Any) -> NDArray[Any]:
        """Return the gain for all measurements together, from those of the decorrelated measurements one by one."""
        K = np.asarray(gain.to_fractions(), dtype=object)
        if self.form not in FACTORED:
            return K
        UR, H = (self._at(letter, k).to_fractions() for letter in ("UR", "H"))
        return combined_gain(list(K.T), UR, H)


class _BoundTaker:
    """What the contraction bound of an array run needs of each step; see :mod:`gpbnb.filters.contraction`.

    A known input c can be moved out of a step: the exact filter goes from x to :math:`E(x, z - Hc) + c`,
    with the step E of the filter without inputs. So the residual of a step is that of a filter without inputs, whose
    estimate is less by c and which measures z - d - Hc. Both differences are exact, then rounded to double-double,
    2**-106 of them: less than the errors of the evaluation that the bound includes.
    """

    def __init__(self, run: ArrayRun) -> None:
        self.run = run
        self.stored = run.model.rounded(run.fmt).without_inputs()
        self.offset = [each.to_fractions() for each in run._given["d"]]
        first = run.covariance(run.P) if run.form in FACTORED else None
        self.carried = CarriedBound(self.stored, Form.INNOVATION, first, np.array(run.checkpoint_steps, dtype=np.int64))
        n, m = run.model.n, run.model.m
        self._gains, self._UR = np.zeros((1, n, m, 2)), np.zeros((1, m, m, 2))  # only the state's bound is asked for
        self.x, self.P = self._wide_state(None), self._wide_covariance()

    def take(self, measured: FloatArray) -> None:
        """Take the bound over the step that the run has just done."""
        k, run = self.run.steps - 1, self.run
        known = run.known_state(k)
        z = measured.to_fractions()
        if self.offset:
            z = z - self.offset[k % len(self.offset)]
        if known is not None:
            z = z - self.stored.H[k % len(self.stored.H)] @ known
        try:
            x, P = self._wide_state(known), self._wide_covariance()
            measurements = double_doubles(z.reshape(1, -1, 1))
            taken = Taken(measurements, np.stack([self.x, x]), np.stack([self.P, P]), self._gains, self._UR)
            self.carried.take(k, taken)
            self.x, self.P = x if known is None else self._wide_state(None), P
        except (OverflowError, ZeroDivisionError):  # beyond double-double
            self.carried.end()

    def _wide_state(self, known: NDArray[Any] | None) -> NDArray[np.float64]:
        """Return the estimate minus a known input as double-double, (n, 1, 2)."""
        if known is None:
            return double_doubles_of(self.run.x.reshape(-1, 1))
        return double_doubles((self.run.x.to_fractions() - known).reshape(-1, 1))

    def _wide_covariance(self) -> NDArray[np.float64]:
        if self.run.form in FACTORED:
            return double_doubles(self.run.covariance(self.run.P))
        return double_doubles_of(self.run.P)


def block_algebra(formats: Sequence[Any], stored: BlockStorage = ONE_FORMAT) -> BlockAlgebra:
    """Return how matrices of the formats of state, gain, covariance and innovation covariance are computed."""
    state, gain, covariance, innovation = map(_algebra, formats)
    return BlockAlgebra(state, gain, covariance, innovation, stored)


def _algebra(fmt: Any) -> Algebra:
    return Algebra(lambda n: fmt.array(np.eye(n, dtype=int)), operator.matmul)
