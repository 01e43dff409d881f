"""Write a guess as a certificate, which :mod:`gpbnb.bounds.check` proves or rejects without the rest of this package.

A certificate asks a question (filter, format, form, limits) and claims an answer: the bound and, for a Kalman filter,
the step from which and the period with which the gain repeats. Further numbers only help the checker: an interval that
the exact covariance does not leave, how many earlier steps to follow one by one, and how many of them to keep apart.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.check import BEYOND, DERIVED, NotProvedError, prove
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guess import EXCESS, FilterLimits, Guess, radius_of
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, matrices
from gpbnb.filters.system import LinearFilter
from gpbnb.filters.words import WordFormats, integer_program

KIND = "rounding guarantee 2"
ORDER = "each product and sum rounded once, sums from left to right"
FORMS = {
    Form.HUNG: "hung",
    Form.HUNG_SECOND_GAIN: "hung second gain",
    Form.INNOVATION: "innovation",
    Form.JOSEPH: "joseph",
    Form.UD: "ud",
}
_KINDS = {MULTIPLY: "multiply", ADD: "add", SUBTRACT: "subtract"}
RAISED = (1.0, 1.001, 1.003, 1.01, 1.03, 1.1)
"""Factors of a guess that are tried, until the checker proves one."""
SLOW = (1.005, 1.03, 1.1, 1.5)
"""The same for filters that settle slowly, where the checker adds effects of old errors that are alike."""
_NEGLIGIBLE = 2.0**-26
_LONG, _APART = 700, 64
"""Steps after which a filter is slow; the age at which errors of two steps of a slow filter may be added, in steps."""


class Proof(NamedTuple):
    """What was proved: a bound, and its certificate; or why nothing was."""

    bound: NDArray[np.float64]
    text: str
    why: str = ""


def first_proved(guess: Guess, written: Callable[[Guess], str]) -> Proof:
    """Ask the checker for a guess, and for somewhat larger ones if it rejects that.

    For fixed coefficients, the checker says how much larger; otherwise some factors are tried.
    """
    why, content, larger = "", json.loads(written(guess)), np.ones(len(guess.bound))
    slow = "keep" in content and max(content["back"], content["steps"] or 0) > _LONG
    for factor in SLOW if slow else RAISED:
        claim = guess._replace(bound=guess.bound * larger * factor)
        text = written(claim)
        try:
            prove(json.loads(text))
        except NotProvedError as error:
            why, needed = f"not proved: {error}", np.array([above(each) for each in error.shares]) * EXCESS
            if len(needed) and str(error) == BEYOND:
                guess = guess._replace(state=guess.state * np.maximum(needed, 1))
            elif len(needed):
                larger = larger * np.maximum(needed, 1)
            elif str(error).startswith(DERIVED):
                wider = 2 * factor - 1
                guess = guess._replace(state=guess.state * wider, innovation=guess.innovation * wider)
        except NotImplementedError as error:
            return Proof(guess.bound, "", f"not covered: {error}")
        else:
            return Proof(np.array([above(Fraction(each)) for each in json.loads(text)["bound"]]), text)
    return Proof(guess.bound, "", why)


def _head(name: str, bound: Any, steps: int | None, back: int) -> dict[str, Any]:
    return {"certificate": KIND, "name": name, "order": ORDER, "bound": texts(bound), "steps": steps, "back": back}


def of_operations(
    made: LinearFilter,
    fmt: FloatFormat | FixedFormat | WordFormats,
    measurement: Any,
    guess: Guess,
    steps: int | None,
    exact: str = "as stored",
) -> str:
    """Return the certificate of a filter with fixed coefficients as JSON.

    Parameters
    ----------
    measurement : (m,), limits on the inputs as given.
    exact : what its states are compared with, "as stored" or "as given".
    """
    program = made.program
    if not {*program.operations[:, 0].tolist()} <= {*_KINDS}:
        raise ValueError(f"got {made.name}, which limits its values; needed products, sums and differences only")
    drawn = not isinstance(fmt, WordFormats) and fmt.rounding is Rounding.STOCHASTIC
    stored = integer_program(made, fmt).coefficients if isinstance(fmt, WordFormats) else made.stored(fmt)
    A, B = matrices(program, stored if exact == "as stored" else made.coefficients)
    content = {
        "filter": {
            "kind": "linear",
            "states": program.n,
            "inputs": program.m,
            "operations": [[_KINDS[code], a, b] for code, a, b in program.operations.tolist()],
            "wide": program.wide.tolist(),
            "outputs": program.outputs.tolist(),
            "coefficients": texts(made.coefficients),
            "stored": texts(stored) if drawn else [],
            "exact": exact,
            "A": texts(A),
            "B": texts(B),
        },
        "format": _words(fmt) if isinstance(fmt, WordFormats) else _format(fmt),
        "limits": {"measurement": texts(measurement)},
        "derived": {"state": texts(guess.state)},
    }
    return _text(_head(made.name, guess.bound, steps, guess.lags) | content)


def of_filter(given: Schedule, asked: FilterLimits, guess: Guess, steps: int | None, F: NDArray[np.float64]) -> str:
    """Return the certificate of a Kalman filter as JSON.

    Parameters
    ----------
    given : its coefficients.
    asked : limits as given.
    F : (steps, n, n), closed loops.
    """
    model = given.origin
    if not isinstance(model, LinearModel) or given.form is None:
        raise ValueError("got a schedule without a Kalman filter; needed both the model and its form")
    first, period = given.first, given.steps - given.first
    bound, state = guess.bound, guess.state
    innovation = guess.innovation
    width, more = (None, 0) if steps is not None else _width(given, innovation, bound)
    back = 0 if steps is not None else _back(F[first:], bound, state)
    content = {
        "filter": {
            "kind": "kalman",
            "form": FORMS[given.form],
            "repair": model.repair is not False,
            "repaired": [str(each) for each in model.repairs],
        }
        | {letter: texts(getattr(model, letter)) for letter in ("Phi", "H", "Q", "R", "x0", "P0")},
        "format": _format(given.fmt),
        "limits": {name: texts(each) for name, each in asked._asdict().items()},
        "derived": {"state": texts(state), "innovation": texts(innovation)},
        "repeat": given.repeat or 0,
        "period": max(period, 1),
        "first": first + more,
        "keep": _APART if max(back, steps or 0) > _LONG else steps or back,
        "width": [] if width is None else texts(width),
    }
    return _text(_head(model.name, bound, steps, back) | content)


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=None, separators=(", ", ": "))


def texts(values: Any) -> Any:
    """Return exact numbers as text in nested lists, None for infinity."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, (list, tuple)):
        return [texts(each) for each in values]
    return None if isinstance(values, float) and math.isinf(values) else str(Fraction(values))


def _format(fmt: FloatFormat | FixedFormat) -> dict[str, Any]:
    found: dict[str, Any] = {"base": fmt.base, "precision": fmt.precision, "rounding": fmt.rounding.value}
    if isinstance(fmt, FixedFormat):
        return found | {"fraction_bits": fmt.fraction_bits, "overflow": fmt.overflow}
    largest = None if fmt.given_largest is None else str(fmt.given_largest)
    return found | {"emin": fmt.emin, "emax": fmt.emax, "subnormal": fmt.subnormal, "largest": largest}


def _words(words: WordFormats) -> dict[str, Any]:
    given = words.data if words.coefficients is None else words.coefficients
    kept = FloatFormat(2, given) if isinstance(given, int) else given
    formats = {"data": words.data, "sums": words.accumulator, "coefficients": kept}
    return {name: _format(fmt) for name, fmt in formats.items()}


def _back(F: NDArray[np.float64], *sizes: NDArray[np.float64]) -> int:
    """Return the number of steps after which products of closed loops are negligible, for each phase of the period."""
    period, n, most = len(F), F.shape[1], 0
    for phase in range(period):
        C, lag = np.eye(n), 0
        while lag < most or not all((np.abs(C) @ size <= _NEGLIGIBLE * size).all() for size in sizes):
            C = C @ F[(phase - lag) % period]
            lag += 1
        most = lag
    return max(most, 1)


@np.errstate(over="ignore", invalid="ignore")  # where nothing moves the gain, no share is needed
def _width(
    given: Schedule, innovation: NDArray[np.float64], bound: NDArray[np.float64]
) -> tuple[NDArray[np.float64], int]:
    """Return the width of an interval of covariances that the exact filter does not leave, and after how many steps.

    It has a shape that each period shrinks. The errors of the gain that follow from it are far below those of a step.
    """
    assert isinstance(given.origin, LinearModel)
    stored, K = given.origin.rounded(given.fmt), given.exact[given.first :, ..., 0]
    phases = np.arange(given.first, given.steps)
    cycles = (stored.Phi, stored.H, stored.Q, stored.R)
    Phi, H, Q, R = (np.array([each[k % len(each)] for k in phases]).astype(np.float64) for each in cycles)
    kept = np.eye(stored.n) - K @ H
    A, noise = kept @ Phi, kept @ Q @ kept.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2)
    added = np.zeros((stored.n, stored.n))
    for a, more in zip(A, noise, strict=True):
        added = a @ added @ a.T + more
    whole = _product(A)
    P = _limit(whole, added)
    W = _limit(whole, np.diag(np.maximum(np.diag(P), 1e-30 * max(np.diag(P).max(), 1e-300))))
    D, share = W, 2.0**-20
    for k, a in enumerate(A):
        V, far = Phi[k] @ P @ Phi[k].T + Q[k], H[k] @ Phi[k]
        inverse = np.sqrt(np.diag(np.linalg.inv(H[k] @ V @ H[k].T + R[k])))
        by = (np.sqrt(np.diag(far @ D @ far.T)) @ inverse) * (inverse @ innovation)
        D, P = a @ D @ a.T, a @ P @ a.T + noise[k]
        off = by * np.sqrt(np.diag(D))
        # what a step may add to the bound, so that all steps together add a millionth
        step = 1e-6 * bound * (1 - min(radius_of(whole) ** (1 / len(A)), 1 - 1e-6))
        share = min(share, float(np.min(step[off > 0] / off[off > 0], initial=math.inf)))
    share = max(share, 2.0**-70)
    rate = max(radius_of(whole), 1e-9) ** 2
    begun = stored.n * float(np.max(np.abs(_difference(given, P)) / np.sqrt(np.outer(np.diag(W), np.diag(W)))))
    periods = max(math.ceil(math.log(max(begun, 1e-300) / (0.1 * share)) / -math.log(rate)), 1)
    return np.asarray(W * share), (1 + periods) * len(A)  # from the end of the schedule


def _difference(given: Schedule, P: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of the exact covariance at the end of the schedule from its limit."""
    found = given.covariance
    if found is None:
        raise ValueError("got a schedule without a covariance; needed that of a Kalman filter")
    return np.asarray(found[..., 0] - P + found[..., 1])


def _limit(F: NDArray[np.float64], added: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance X that F X F' + `added` leaves unchanged, for a stable F."""
    X = added
    for _ in range(60):
        X, F = X + F @ X @ F.T, F @ F
    return np.asarray((X + X.T) / 2)


def _product(F: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of all closed loops of a period."""
    whole = np.eye(F.shape[1])
    for each in F:
        whole = each @ whole
    return whole
