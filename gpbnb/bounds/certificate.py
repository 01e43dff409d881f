"""Write a guess as a certificate, which :mod:`gpbnb.bounds.check` proves or rejects without the rest of this package.

A certificate asks a question (filter, format, form, limits) and claims an answer: the bound and, for a Kalman filter,
the step from which and the period with which the gain repeats. Further numbers only help the checker: an interval that
the exact covariance does not leave, how many earlier steps to follow one by one, and how many of them to keep apart.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.bounds import above
from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.check import NotProvedError, prove
from gpbnb.bounds.gains import Schedule
from gpbnb.bounds.guess import EXCESS, FilterLimits, Guess, product_of, radius_of
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, matrices
from gpbnb.filters.structures import LinearFilter
from gpbnb.filters.word_formats import WordFormats

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
_TRIES = 6
"""Claims that are tried, until the checker proves one."""
_MORE, _MORE_OF_SLOW, _MORE_OF_ALIKE = 1.03, 1.005, 1.001
"""Factors of a claim: after a failure that does not say what is needed; and at first, for filters that settle slowly,
where the checker adds effects of old errors that are alike, and where it takes phases together."""
_APART_ABOVE = 1.003
"""Share of a bound above which phases are kept apart."""
_LONG, _MANY, _APART = 700, 10_000, 64
"""Steps after which a filter is slow; steps before those of a period, in all, from which the checker takes phases
together; the age at which errors of two steps of a slow filter may be added, in steps."""
_LEFT, _LEFT_SLOW = 2.0**-26, 2.0**-13
"""Share of an error that is left when the checker stops to follow it."""
_ADDED, _ADDED_ALIKE, _ADDED_SLOW = 2.0**-22, 0.5, 2.0**-8
"""Share of a bound that the unsettled exact gain, or phases that are taken together, may add to it, by estimates that
are far too large."""


class Proof(NamedTuple):
    """What was proved: a bound, and its certificate."""

    bound: NDArray[np.float64]
    text: str


def proved(guess: Guess, written: Callable[[Guess], dict[str, Any]]) -> Proof:
    """Let the checker prove a guess or, if it refuses, a larger one, by as much as it says is missing.

    Phases of a period that differ too much to be taken together are then kept apart. ValueError says why nothing is
    proved.
    """
    content, why = written(guess), ""
    slow = "keep" in content and content["keep"] < max(content["back"], content["steps"] or 0)
    together = content.get("phases", 1) < content.get("period", 1)
    if slow or together:
        guess = guess._replace(bound=guess.bound * (_MORE_OF_SLOW if slow else _MORE_OF_ALIKE))
        content = written(guess)
    for _ in range(_TRIES):
        try:
            prove(content)
            return Proof(np.array([above(Fraction(each)) for each in content["bound"]]), json.dumps(content))
        except NotImplementedError as error:
            raise ValueError(f"not covered: {error}") from None
        except NotProvedError as error:
            why, shares = f"not proved: {error}", error.shares
        apart = together and max(shares[0], default=2) > _APART_ABOVE
        if not apart:
            guess = _larger(guess, *shares)
        content = written(guess)
        if apart:
            content["phases"], together = content["period"], False
    raise ValueError(why)


def _larger(guess: Guess, of_bound: Sequence[Fraction], of_limits: Sequence[Fraction]) -> Guess:
    """Return a guess that exceeds what the checker needs, as larger numbers are rounded by more."""
    if not of_bound and not of_limits:
        return guess._replace(bound=guess.bound * _MORE)
    n, m = len(guess.bound), len(guess.innovation)
    more = np.ones(2 * n + m)
    more[: len(of_bound)] = [above(x) for x in of_bound]
    more[n : n + len(of_limits)] = [above(x) for x in of_limits]
    more = np.maximum(more + np.minimum((more - 1) / 2, 1e-3), 1) * EXCESS
    bound, state, innovation = np.split(more, [n, 2 * n])
    return guess._replace(
        bound=guess.bound * bound * min(max(state.max(), innovation.max()), 1.001),  # larger limits round by more
        state=guess.state * state,
        innovation=guess.innovation * innovation,
    )


def _head(name: str, bound: Any, steps: int | None, back: int) -> dict[str, Any]:
    return {"certificate": KIND, "name": name, "order": ORDER, "bound": texts(bound), "steps": steps, "back": back}


def of_operations(
    made: LinearFilter,
    fmt: FloatFormat | FixedFormat | WordFormats,
    measurement: Any,
    guess: Guess,
    steps: int | None,
    exact: str,
) -> dict[str, Any]:
    """Return the certificate of a filter with fixed coefficients.

    Limits of the inputs (m,) are those as given; the states are compared with an exact filter "as stored" or "as
    given".
    """
    program = made.program
    drawn = not isinstance(fmt, WordFormats) and fmt.rounding is Rounding.STOCHASTIC
    stored = made.stored(fmt)
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
    return _head(made.name, guess.bound, steps, guess.lags) | content


def of_filter(
    given: Schedule, asked: FilterLimits, guess: Guess, steps: int | None, F: NDArray[np.float64]
) -> dict[str, Any]:
    """Return the certificate of a Kalman filter, for limits as given and closed loops F (steps, n, n)."""
    model = given.origin
    if not isinstance(model, LinearModel) or given.form is None:
        raise ValueError("got a schedule without a Kalman filter; needed both the model and its form")
    bound, state, innovation = guess.bound, guess.state, guess.innovation
    back, slow = 0, (steps or 0) > _LONG
    repeated = {"repeat": 0, "period": 1, "phases": 1, "first": 0, "below": [], "above": []}
    if steps is None:
        period = F[given.first :]
        decay = 1 - min(radius_of(product_of(period)) ** (1 / len(period)), 1 - 1e-6)
        back = _back(period, _LEFT, bound, state)
        slow = back > _LONG
        back = _back(period, _LEFT_SLOW, bound, state) if slow else back
        stay = _stay(given, innovation, (_ADDED_SLOW if slow else _ADDED) * decay * bound)
        phases = (
            _alike(period, model.cycle, state, _ADDED_ALIKE * decay * bound)
            if len(period) * back > _MANY
            else len(period)
        )
        repeated = {"repeat": given.repeat, "period": given.period, "phases": phases, "first": stay.first}
        repeated |= {"below": texts(stay.below), "above": texts(stay.above)}
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
        "keep": _APART if slow else back or steps,
    } | repeated
    return _head(model.name, bound, steps, back) | content


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


def _back(F: NDArray[np.float64], left: float, *sizes: NDArray[np.float64]) -> int:
    """Return the number of steps after which products of closed loops are negligible, for each phase of the period."""
    period, n, most = len(F), F.shape[1], 0
    for phase in range(period):
        C, lag = np.eye(n), 0
        while lag < most or not all((np.abs(C) @ size <= left * size).all() for size in sizes):
            C = C @ F[(phase - lag) % period]
            lag += 1
        most = lag
    return max(most, 1)


def _alike(F: NDArray[np.float64], cycle: int, state: NDArray[np.float64], each: NDArray[np.float64]) -> int:
    """Return how many steps of a period differ: a cycle of the model, if others move the error by at most `each`."""
    off = np.abs(F - F[np.arange(len(F)) % cycle]) @ state
    return cycle if (off <= each).all() else len(F)


class _Stay(NamedTuple):
    """An interval that the exact covariance does not leave: how far it reaches below and above the one after a step."""

    first: int
    below: NDArray[np.float64]
    above: NDArray[np.float64]


def _stay(given: Schedule, innovation: NDArray[np.float64], each: NDArray[np.float64]) -> _Stay:
    """Return the first such interval whose errors of the gain add at most `each` to the error of a step."""
    assert given.repeat is not None
    first, last = max(given.repeat, 1) - 1, given.steps
    while last - first > 1:
        middle = (first + last) // 2
        enough = (_interval(given, middle, innovation, each)[1] <= each).all()
        first, last = (first, middle) if enough else (middle, last)
    return _interval(given, last, innovation, each)[0]


@np.errstate(over="ignore", invalid="ignore")  # where nothing moves the gain, no share is needed
def _interval(
    given: Schedule, first: int, innovation: NDArray[np.float64], each: NDArray[np.float64]
) -> tuple[_Stay, NDArray[np.float64]]:
    """Return an interval, and what its errors of the gain add to the error of a step.

    The distance from the limit is a sum of what the coming periods add or take away; each moves the others further in.
    """
    assert isinstance(given.origin, LinearModel)
    stored = given.origin.rounded(given.fmt)
    phases = given.first + (first - given.first + np.arange(stored.cycle)) % stored.cycle
    cycles = (stored.Phi, stored.H, stored.Q, stored.R)
    Phi, H, Q, R = (np.array([c[k % len(c)] for k in phases]).astype(np.float64) for c in cycles)
    K = given.exact[phases, ..., 0]
    kept = np.eye(stored.n) - K @ H
    A, noise = kept @ Phi, kept @ Q @ kept.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2)
    added = np.zeros((stored.n, stored.n))
    for a, more in zip(A, noise, strict=True):
        added = a @ added @ a.T + more
    whole = product_of(A)
    P, now = _limit(whole, added), given.covariances[first - 1]
    variances = np.maximum(np.diag(P), 1e-30 * max(np.diag(P).max(), 1e-300))
    unit = np.sqrt(np.outer(variances, variances))
    far = now[..., 0] - P + now[..., 1]
    values, vectors = np.linalg.eigh((far - whole @ far @ whole.T) / unit)
    below, above = (_limit(whole, (vectors * np.maximum(x, 0) @ vectors.T) * unit) for x in (values, -values))
    wide = _limit(whole, np.diag(variances))

    def moved(D: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest error of each state due to a gain of a covariance that is off by at most D."""
        most = np.zeros(stored.n)
        for a, rows in zip(A, np.linalg.solve(R, H), strict=True):
            D = a @ D @ a.T
            seen = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", rows, D, rows), 0))
            most = np.maximum(most, np.sqrt(np.maximum(np.diag(D), 0)) * (seen @ innovation) / 2)
        return most

    off = moved(wide)
    last = first == given.steps
    least = 2.0**-70 if last else 2.0**-46  # float64 does not know the limit better
    share = np.clip(np.min(0.1 * each[off > 0] / off[off > 0], initial=2.0**-20), least, 2.0**-20)
    if last:  # nor how far it is, so wait until that is nothing
        begun = stored.n * float(np.max(np.abs(far) / np.sqrt(np.outer(np.diag(wide), np.diag(wide)))))
        rate = max(radius_of(whole), 1e-9) ** 2
        periods = math.ceil(math.log(max(begun, 1e-300) / (0.1 * share)) / -math.log(rate))
        first, below, above = first + max(periods, 0) * stored.cycle, 0 * below, 0 * above
    below, above = (x + share / 2 * wide for x in (below, above))
    return _Stay(first, below, above), moved(below + above)


def _limit(F: NDArray[np.float64], added: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the covariance X that F X F' + `added` leaves unchanged, for a stable F."""
    X = added
    for _ in range(60):
        X, F = X + F @ X @ F.T, F @ F
    return np.asarray((X + X.T) / 2)
