"""What can be asked of which kind of model: each verb asks here first, and a refusal names the way."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb.filters.design import FilterDesign
from gpbnb.filters.model import LinearModel, in_columns
from gpbnb.filters.named import whole_number
from gpbnb.filters.nonlinear import NonlinearModel
from gpbnb.filters.nonlinear_system import NonlinearSystem
from gpbnb.filters.smoothing import FixedIntervalSmoother
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.asked import Data
from gpbnb.wordlength.models import SYSTEMS, read_model

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
    """Read a model of any kind, and refuse what it cannot do.

    Raises
    ------
    ValueError : it cannot do one of the tasks, keys of :data:`CANNOT`; the message says what to use.
    ValueError, TypeError, OSError : as for :func:`gpbnb.read_model`.
    """
    library = type(model).__module__.partition(".")[0]
    own = isinstance(model, NonlinearModel | FilterDesign) or (callable(model) and library not in SYSTEMS)
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


def data_of(model: Any, z: Any, seed: int = 0) -> Data:
    """Return what a model is run with: (steps, m), (steps,) for one measurement or input, or a number of steps.

    Raises
    ------
    ValueError : another shape, a number of steps below 1, or a seed where nothing is simulated.
    """
    if isinstance(z, str | Path) or z is None:
        raise ValueError(f"got {z!r} for z; needed measurements or inputs, (steps, m), or a number of steps")
    simulated = not isinstance(z, list | tuple) and not hasattr(z, "to_fractions") and np.ndim(z) == 0
    if (seed := whole_number("seed", seed, 0)) and not (simulated and isinstance(model, LinearModel | NonlinearModel)):
        raise ValueError(
            f"got seed {seed} where nothing is simulated; needed none: a seed is for the measurements of a Kalman "
            "filter that are given as a number of steps"
        )
    if simulated:
        return Data(None, whole_number("steps", z, most=MOST_STEPS), seed)
    given = in_columns(z, getattr(model, "m", 0))
    return Data(given, len(given))
