"""A question about a model: what can be asked of its kind, of which data, within which tolerances.

Each verb asks :func:`admitted` first, and a refusal names the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import all_above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_named
from gpbnb.bounds.gains import check_deterministic
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import LinearModel, in_columns
from gpbnb.filters.named import whole_number
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.answer import Basis, Requirement, digits_of, joined
from gpbnb.wordlength.models import MODELS, SYSTEMS, read_model

AnyFormat = FloatFormat | FixedFormat | WordFormats | BlockFormats
Function = Callable[..., Any]
"""A function ``run(fmt, z)``, or ``run(fmt)`` without z, that returns the outputs of all steps in the format."""


@dataclass(frozen=True)
class Asked:
    """What is asked about a model, apart from the formats to try; a search calls `ran` after each run.

    The measurements or inputs z are (steps, m), or None if they are simulated with the seed, or if there are none.
    """

    model: Any
    z: Any
    steps: int
    tolerance: Any = math.inf
    basis: Basis = "emulation"
    within: FilterLimits | None = None
    form: Form = Form.INNOVATION
    highest: int | None = None
    seed: int = 0
    ran: Callable[[], object] = lambda: None

    @classmethod
    def of(cls, model: Any, z: Any, *tasks: str, form: Any = None, seed: int = 0, **more: Any) -> Asked:
        """Read a model, its data and its form; refuse what a model of its kind cannot do, see :func:`admitted`."""
        basis = checked_basis(more.get("basis", "emulation"))
        given = admitted(model, TASK_OF_BASIS[basis], *tasks, "" if form is None else "have a form")
        chosen = form_named(Form.INNOVATION if form is None else form)
        found = cls(given, *data_of(given, z, seed), form=chosen, seed=int(seed), **more)
        if found.within is not None and not isinstance(found.within, FilterLimits):
            raise TypeError(f"got within={found.within!r}; needed the result of limits(...)")
        if found.within is not None and basis in ("emulation", "bound"):
            raise ValueError(
                f'got limits and basis "{basis}", which takes the measurements as they are; needed no limits; leave '
                'out within=, or ask with basis "guarantee" or "probable"'
            )
        return found

    def answer(
        self, fmt: Any, ratio: float, tried: Any, ends: bool, text: str, why: str, notes: Sequence[str], **more: Any
    ) -> Requirement:
        """Return an answer, with its text before notes; `ends` is whether it holds for the steps of the data only.

        Without a search, nothing was tried but its format.
        """
        notes, for_ever = tuple(filter(None, notes)), self.basis in ("guarantee", "probable") and not ends
        form = self.form if is_filter(self.model) else None
        steps = None if for_ever else self.steps
        tried = tried or ((digits_of(fmt), ratio),)
        return Requirement(fmt, ratio, self.basis, steps, tried, joined(text, notes), why, notes, form, **more)

    def check_sizes(self, like: FloatFormat | FixedFormat) -> None:
        """Reject a filter that compiled loops do not hold, or a rounding that a basis does not cover."""
        if is_filter(self.model):
            if like.limits is None:
                self.model.check_sizes()
            if self.basis in ("guarantee", "probable"):
                check_deterministic(like)


def tolerances_of(tolerance: Any, count: int, what: str) -> NDArray[np.float64]:
    """Return the tolerance of each of `count` states or outputs, rounded down."""
    needed = f"needed an error above 0 for each of the {count} {what}, one finite"
    try:
        given = np.asarray(tolerance)
        if given.dtype.kind not in "iufOU":
            raise ValueError("no real numbers")
        negative = [-exactly(each) for each in given.ravel().tolist()]
        above = np.array([each < 0 for each in negative]).reshape(given.shape)
        tolerances = -all_above(np.array(negative, dtype=object)).reshape(given.shape)
    except (TypeError, ValueError, ArithmeticError):
        raise ValueError(f"got tolerance {tolerance!r}; {needed}") from None
    if tolerances.shape not in ((), (1,), (count,)):
        got = f"tolerance {tolerance}" if tolerances.size <= 2 * count else "a tolerance"
        raise ValueError(f"got {got} of shape {tolerances.shape}; {needed}: one number, or {count} in a row")
    if ((tolerances == 0) & above).any():
        raise ValueError(f"got tolerance {tolerance}; needed at least 2**-1074, which float64 holds; scale the {what}")
    if not (tolerances > 0).all() or not np.isfinite(tolerances).any():
        raise ValueError(f"got tolerance {tolerance}; {needed}")
    return np.broadcast_to(tolerances, (count,))


def checked_format(fmt: Any, *more: type) -> Any:
    """Return a format, or that of a name; classes of formats beside FloatFormat and FixedFormat may be allowed, too."""
    found = format_named(fmt)
    if not isinstance(found, (FloatFormat, FixedFormat, *more)):
        others = "".join(f"{each.__name__}, " for each in more)
        why = "; an answer that is not met has no format" if fmt is None else ""
        raise TypeError(
            f'got the format {fmt!r}; needed a FloatFormat, a FixedFormat, {others}or a name such as "float32" or '
            f'"Q3.12"{why}'
        )
    return found


def exactly(number: Any) -> Any:
    """Return a number as given, and text as a Fraction, or as infinity."""
    if isinstance(number, bool):
        raise ValueError("a truth value is no number")
    if not isinstance(number, str):
        return number
    return math.inf if number.strip().lower() in ("inf", "infinity") else Fraction(number)


def checked_basis(basis: Any) -> Basis:
    """Return a basis, or raise ValueError for another."""
    if not isinstance(basis, str) or basis not in get_args(Basis):
        raise ValueError(f"got basis {basis!r}; needed one of {', '.join(map(repr, get_args(Basis)))}")
    return basis  # type: ignore[return-value]


# -- kinds of model ---------------------------------------------------------------------------------------------------

MOST_STEPS = 100_000_000
"""Largest number of steps to simulate."""

FILTER, DRIVEN, NONLINEAR, SYSTEM, LIMITED, STEP, SMOOTHER, FUNCTION = KINDS = (
    "a Kalman filter",
    "a Kalman filter with known inputs",
    "a nonlinear filter",
    "a linear system",
    "a linear system with limits",
    "a system with a step of its own",
    "a smoother",
    "a function",
)
"""The kinds of model."""

_RUNS = (NONLINEAR, STEP, SMOOTHER, FUNCTION)
_FIXED = "since a bound needs coefficients that do not depend on estimates or inputs"
_UNBOUNDED = dict.fromkeys(_RUNS, _FIXED) | {SMOOTHER: "since no bound covers its pass backwards"}
_OBSERVE = 'ask with basis="emulation", and survey_records for many records'
_OF_SYSTEMS = (FILTER, DRIVEN, NONLINEAR, STEP, SMOOTHER, FUNCTION)
_WORDS = 'kind="fixed", which finds one format for all numbers'
_ONE_FORMAT = 'with one format for all numbers, like="Q3.12" (--format Q3.12 in the command)'

CANNOT: dict[str, Mapping[str, str]] = {
    "be bounded along a run": dict.fromkeys(_RUNS, _OBSERVE),
    "have a guarantee": dict.fromkeys(_RUNS, _OBSERVE) | {DRIVEN: 'ask required_precision with basis="bound"'},
    "have a probable error": dict.fromkeys((*_RUNS, LIMITED), _OBSERVE) | {DRIVEN: 'ask with basis="bound"'},
    "have a guarantee in fixed-point words": {LIMITED: f"ask {_ONE_FORMAT}"},
    "have a probable error in words": {SYSTEM: f'ask with basis="guarantee", or {_ONE_FORMAT}'},
    "have formats for data, coefficients and sums": dict.fromkeys(_OF_SYSTEMS, _WORDS),
    "have formats for blocks": dict.fromkeys((DRIVEN, *KINDS[3:]), 'ask with kind="float"'),
    "be searched for limit cycles": dict.fromkeys(
        _OF_SYSTEMS, "settled_filter(model) of gpbnb.filters.settled for a filter with its constant gain"
    )
    | dict.fromkeys((STEP, SMOOTHER, FUNCTION), "emulate, with a long constant input")
    | {LIMITED: "emulate, with a long constant input"},
    "be written in C": {
        SMOOTHER: "write_code of its filter",
        FUNCTION: "write its step as a NonlinearSystem",
    },
    "have a form": dict.fromkeys(KINDS[3:], "leave out form="),
}
"""For each task, the kinds of model that cannot do it, each with what to use instead."""

WHY: dict[str, Mapping[str, str]] = {
    "be bounded along a run": _UNBOUNDED,
    "have a guarantee": _UNBOUNDED | {DRIVEN: "since no proof covers known inputs"},
    "have a probable error": _UNBOUNDED,
}
"""Why a kind of model cannot do a task, where the names of both do not tell."""

TASK_OF_BASIS = {
    "emulation": "",
    "bound": "be bounded along a run",
    "guarantee": "have a guarantee",
    "probable": "have a probable error",
}
TASK_OF_KIND = {
    "float": "",
    "fixed": "",
    "words": "have formats for data, coefficients and sums",
    "blocks": "have formats for blocks",
}


def kind_of(model: Any) -> str:
    """Return the kind of a model that was read."""
    if isinstance(model, LinearModel):
        return DRIVEN if model.has_inputs else FILTER
    if isinstance(model, LinearSystem):
        return SYSTEM if model.as_filter().program.is_linear else LIMITED
    if isinstance(model, FilterDesign):
        return SYSTEM
    kinds = {NonlinearModel: NONLINEAR, NonlinearSystem: STEP, FixedIntervalSmoother: SMOOTHER}
    return kinds.get(type(model), FUNCTION)


def is_filter(model: Any) -> bool:
    """Whether a model is a Kalman filter, linear or nonlinear."""
    return isinstance(model, LinearModel | NonlinearModel)


def admitted(model: Any, *tasks: str) -> Any:
    """Read a model of any kind, and refuse tasks, keys of :data:`CANNOT`, that it cannot do, with what to use."""
    library = type(model).__module__.partition(".")[0]
    own = isinstance(model, MODELS) or (callable(model) and library not in SYSTEMS)
    own = own or (isinstance(model, FilterDesign) and "be written in C" in tasks)
    found = model if own else read_model(model)
    kind = kind_of(found)
    for task in filter(None, tasks):
        if kind in CANNOT[task]:
            name = getattr(found, "name", getattr(found, "__name__", ""))
            name = f"{name}, {kind}," if name and name != kind else kind
            way = CANNOT[task][kind]
            verb = "" if way.split()[0] in ("ask", "leave", "write") else "use "
            why = f", {WHY[task][kind]}" if kind in WHY.get(task, {}) else ""
            raise ValueError(f"{name} cannot {task}{why}; {verb}{way}")
    return found


def data_of(model: Any, z: Any, seed: int = 0) -> tuple[Any, int]:
    """Return measurements or inputs, (steps, m), and their number, from these, from (steps,), or from a number."""
    if isinstance(z, str | Path) or z is None:
        raise ValueError(f"got {z!r} for z; needed measurements or inputs, (steps, m), or a number of steps")
    simulated = not isinstance(z, list | tuple) and not hasattr(z, "to_fractions") and np.ndim(z) == 0
    if whole_number("seed", seed, 0) and not (simulated and is_filter(model)):
        raise ValueError(
            f"got seed {seed} where nothing is simulated; needed none: a seed is for the measurements of a Kalman "
            "filter that are given as a number of steps"
        )
    if simulated:
        return None, whole_number("steps", z, most=MOST_STEPS)
    given = in_columns(z, getattr(model, "m", 0))
    return given, len(given)
