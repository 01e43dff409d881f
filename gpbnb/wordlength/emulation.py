"""One run of a model of any kind, with every operation rounded, and its errors."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.conversion import Numbers
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import stored_measurements
from gpbnb.filters.nonlinear_run import opened, true_states
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.filters.system import LinearSystem, SystemRun, system_inputs
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.answer import format_in_words
from gpbnb.wordlength.asked import AnyFormat, Asked, checked_format, is_filter
from gpbnb.wordlength.functions import STOPS, exact_outputs, outputs_of, referenced
from gpbnb.wordlength.judges import measured
from gpbnb.wordlength.models import ModelSource


@dataclass(frozen=True, eq=False, repr=False)
class EmulatedRun:
    """A run in a format, with the error of each number.

    Parameters
    ----------
    format : the format or formats.
    x : (steps, n), estimates or states after each step, in the format; None for a function.
    y : (steps, p), outputs in the format; None for a Kalman filter.
    errors : (steps, n or p), computed estimates or outputs minus those of the reference.
    reason : what ended the run early, such as "overflow in the gain at step 812"; otherwise empty. Only the steps
        before are there.
    indefinite : the first step at which a computed variance was not positive; None if there is none.
    form : form of a Kalman filter.
    repairs : changes of covariances that would otherwise be indefinite, each as text.
    """

    format: AnyFormat
    x: FloatArray | None
    y: FloatArray | None
    errors: NDArray[np.float64]
    reason: str = ""
    indefinite: int | None = None
    form: Form | None = None
    repairs: tuple[str, ...] = ()

    @property
    def steps(self) -> int:
        """Number of steps done."""
        return len(self.errors)

    @property
    def largest(self) -> NDArray[np.float64]:
        """Largest size of the error of each state or output."""
        return np.asarray(np.abs(self.errors).max(axis=0, initial=0.0))

    def __repr__(self) -> str:
        fmt = self.format if isinstance(self.format, BlockFormats) else format_in_words(self.format)
        form = "" if self.form is None else f"{self.form}, "
        what = "output" if self.form is None else "state"
        numbers = ", ".join(f"{error:.2g}" for error in self.largest)
        ended = f"; {self.reason}" if self.reason else ""
        count = f"{self.steps} step{'s' * (self.steps != 1)}"
        return f"{form}{fmt}, {count}: largest error of each {what} {numbers}{ended}"


def emulate(
    model: ModelSource,
    z: Numbers | int,
    fmt: AnyFormat | str,
    *,
    form: Form | str | None = None,
    seed: int = 0,
) -> EmulatedRun:
    """Run a model with every operation rounded, and compare each step with the model as given, without rounding.

    Parameters
    ----------
    model, z, form, seed : as for :func:`gpbnb.required_precision`.
    fmt : a floating-point or fixed-point format, or its name, such as "float32" or "Q3.12"; for a linear system also
        :class:`gpbnb.WordFormats`, and for a Kalman filter :class:`gpbnb.BlockFormats`.

    Raises
    ------
    ValueError, TypeError : as for :func:`gpbnb.required_precision`.

    Examples
    --------
    >>> from gpbnb import LinearSystem
    >>> run = emulate(LinearSystem.smoother("1/8"), [1, 1, 1], "Q3.4")
    >>> run.y.to_float().ravel().tolist(), run
    ([0.125, 0.25, 0.375], 8-bit fixed point (4 fraction bits), 3 steps: largest error of each output 0.045)
    """
    fmt = checked_format(fmt, WordFormats, BlockFormats)
    words = "have formats for data, coefficients and sums" if isinstance(fmt, WordFormats) else ""
    blocks = "have formats for blocks" if isinstance(fmt, BlockFormats) else ""
    asked = Asked.of(model, z, words, blocks, form=form, seed=seed)
    if is_filter(asked.model):
        return _filter(asked, fmt)
    return (_system if isinstance(asked.model, LinearSystem) else _function)(asked, fmt)


def _in_format(pairs: NDArray[np.float64], fmt: Any) -> FloatArray:
    """Return numbers of a format that are given as sums of two float64, which in base 10 are only near them."""
    sums = pairs[..., 0] if not pairs[..., 1].any() else exact(pairs[..., 0]) + exact(pairs[..., 1])
    if fmt.base == 10:
        sums = replace(fmt, rounding=Rounding.EVEN).array(sums).to_fractions()
    found: FloatArray = fmt.array(sums)
    return found


def _filter(asked: Asked, fmt: Any) -> EmulatedRun:
    sound, z = measured(asked)
    run = opened(sound, fmt, asked.form)
    states, true = run.states(stored_measurements(z, fmt)), true_states(sound, z)
    x = _in_format(states, fmt.state if isinstance(fmt, BlockFormats) else fmt)
    errors = np.asarray((states - true[: len(states)]).sum(axis=2))
    repairs = tuple(str(each) for each in run.repairs)
    return EmulatedRun(fmt, x, None, errors, run.reason, run.indefinite, asked.form, repairs)


def _system(asked: Asked, fmt: Any) -> EmulatedRun:
    system = asked.model
    if asked.z is None:
        raise ValueError(f"got a number of steps for {system.name}; needed its inputs, of shape (steps, {system.m})")
    u, n = system_inputs(system, asked.z), system.n
    run, true = SystemRun(system, fmt), system.outputs(u)
    pairs = run.states(u)
    numbers = _in_format(pairs, fmt.data if isinstance(fmt, WordFormats) else fmt)
    errors = np.asarray((pairs[:, n:] - true[: len(pairs)]).sum(axis=2))
    return EmulatedRun(fmt, numbers[:, :n], numbers[:, n:], errors, run.reason)


def _function(asked: Asked, fmt: Any) -> EmulatedRun:
    made, z, true, _ = referenced(replace(asked, tolerance=1.0), fmt.base, fmt.precision)
    try:
        found = outputs_of(made, fmt, z, None)
    except STOPS as fault:
        return EmulatedRun(fmt, None, None, np.zeros((0, true.shape[1])), f"the function stops: {fault}")
    errors = (exact_outputs(found) - true).astype(np.float64)
    if isinstance(made, FixedIntervalSmoother):
        return EmulatedRun(fmt, found, None, errors, form=form_named(made.form))
    return EmulatedRun(fmt, None, found, errors)
