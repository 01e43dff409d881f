"""Write a guarantee as a certificate, which :mod:`gpbnb.bounds.check` verifies without the rest of this package.

A certificate asks a question (filter, format, form, limits) and claims an answer: the bound, the step from which and
the period with which the gain repeats, and the number of earlier steps in the condition of
:mod:`gpbnb.bounds.envelope`. The checker computes the rows of this condition itself. Further numbers only help it: an
interval that the exact covariance does not leave, and how many steps of errors to keep apart. The checker rounds
outwards, so the bound claimed exceeds that of the guarantee by a millionth. If a filter takes thousands of steps to
settle, it exceeds it by a thousandth, so that fewer of them suffice.
"""

from __future__ import annotations

import json
import math
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.bounds.envelope import FilterLimits
from gpbnb.bounds.gains import Schedule
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.poles import eigenvalues
from gpbnb.filters.program import ADD, MULTIPLY, SUBTRACT, matrices
from gpbnb.filters.system import LinearFilter

KIND = "rounding guarantee 1"
ORDER = "each product and sum rounded once, sums from left to right"
FORMS = {
    Form.HUNG: "hung",
    Form.HUNG_SECOND_GAIN: "hung second gain",
    Form.INNOVATION: "innovation",
    Form.JOSEPH: "joseph",
    Form.UD: "ud",
}
_KINDS = {MULTIPLY: "multiply", ADD: "add", SUBTRACT: "subtract"}
_NEGLIGIBLE = 2.0**-26
_NEARER = 16.0
_WHOLE = 700
"""If errors are negligible after this many steps, the checker keeps them apart until then."""


class _Care(NamedTuple):
    """How much a claim exceeds the guarantee, and what is left of a mode that has decayed."""

    excess: float
    left: float


_USUAL, _SLOW, _MANY = _Care(2.0**-20, 1e-2), _Care(2.0**-10, 1e-3), 5_000


def written(
    given: Schedule,
    asked: FilterLimits,
    known: FilterLimits,
    bound: NDArray[np.float64],
    steps: int | None,
    F: NDArray[np.float64],
) -> str:
    """Return a guarantee as JSON.

    Parameters
    ----------
    given : the filter's coefficients.
    asked : limits as given.
    known : those that follow from them.
    bound : (n,), bound of the errors.
    steps : number of steps for which it holds, None for ever.
    F : (steps, n, n), closed loops.

    Raises
    ------
    ValueError : there is no bound, or nothing to write a certificate from.
    """
    if given.origin is None or not np.isfinite(bound).all():
        raise ValueError(
            f"got a guarantee {bound} without {'a filter' if given.origin is None else 'a bound'}; needed both"
        )
    if given.enclosed is not None:
        raise ValueError("got a gain that never repeats; needed one that repeats: certificates do not cover others")
    first, period = given.first, given.steps - given.first
    care = _SLOW if first > _MANY else _USUAL
    claimed = _claimed(bound, care)
    back = _back(F[first:], claimed, known.state) if steps is None else 0
    content = {
        "certificate": KIND,
        "name": given.origin.name,
        "filter": _filter(given),
        "format": _format(given.fmt),
        "order": ORDER,
        "limits": {name: _texts(each) for name, each in asked._asdict().items()},
        "derived": {
            "state": _texts(_claimed(known.state, care)),
            "innovation": _texts(_claimed(known.innovation, care)),
        },
        "bound": _texts(claimed),
        "steps": steps,
        "repeat": given.repeat or 0,
        "period": max(period, 1),
        "first": first + (_extra(F[first:]) if steps is None and given.form is not None else 0),
        "keep": _keep(F[first:], back, care) if steps is None else steps,
        "back": back,
        "width": _texts(_width(given, known.innovation)) if steps is None and given.form is not None else [],
    }
    return json.dumps(content, indent=None, separators=(", ", ": "))


def _claimed(bound: NDArray[np.float64], care: _Care) -> NDArray[np.float64]:
    """Return larger bounds, and tiny ones for zero, so that the checker may round outwards, too."""
    least = float(bound[bound > 0].min(initial=1.0))
    return np.asarray(np.maximum(bound * (1 + care.excess), 2.0**-40 * least))


def _texts(values: Any) -> Any:
    """Return exact numbers as text in nested lists, None for infinity."""
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if isinstance(values, (list, tuple)):
        return [_texts(each) for each in values]
    return None if isinstance(values, float) and math.isinf(values) else str(Fraction(values))


def _filter(given: Schedule) -> dict[str, Any]:
    made = given.origin
    if isinstance(made, LinearModel):
        if given.form is None:
            raise ValueError("got a Kalman filter without a form")
        model = {letter: _texts(getattr(made, letter)) for letter in ("Phi", "H", "Q", "R", "x0", "P0")}
        repaired = [str(each) for each in made.repairs]
        return {
            "kind": "kalman",
            "form": FORMS[given.form],
            "repair": made.repair is not False,
            "repaired": repaired,
        } | model
    assert isinstance(made, LinearFilter)
    program = made.program
    if not {*program.operations[:, 0].tolist()} <= {*_KINDS}:
        raise ValueError(f"got {made.name}, which limits its values; needed products, sums and differences only")
    A, B = matrices(program, made.stored(given.fmt))
    return {
        "kind": "linear",
        "states": program.n,
        "inputs": program.m,
        "operations": [[_KINDS[code], a, b] for code, a, b in program.operations.tolist()],
        "outputs": program.outputs.tolist(),
        "coefficients": _texts(made.coefficients),
        "A": _texts(A),
        "B": _texts(B),
    }


def _format(fmt: FloatFormat | FixedFormat) -> dict[str, Any]:
    found: dict[str, Any] = {"base": fmt.base, "precision": fmt.precision, "rounding": fmt.rounding.value}
    if isinstance(fmt, FixedFormat):
        return found | {"fraction_bits": fmt.fraction_bits, "overflow": fmt.overflow}
    largest = None if fmt.given_largest is None else str(fmt.given_largest)
    return found | {"emin": fmt.emin, "emax": fmt.emax, "subnormal": fmt.subnormal, "largest": largest}


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


def _extra(F: NDArray[np.float64]) -> int:
    """Return a number of steps, whole periods, after which the exact covariance is far nearer to its limit."""
    rate = -2 * math.log(max(float(np.abs(eigenvalues(_product(F))).max()), 1e-9))
    return math.ceil(math.log(_NEARER) / rate) * len(F)


def _keep(F: NDArray[np.float64], back: int, care: _Care) -> int:
    """Return the number of last steps whose errors the checker keeps apart; an ellipsoid contains all older ones.

    It contains them without much loss if they are negligible, or once the fast modes of the filter have decayed.
    """
    if back <= _WHOLE:
        return back
    modes = np.sort(np.abs(eigenvalues(_product(F)))) ** (1 / len(F))
    fast = modes[modes < modes[-1] ** 2]
    return 4 + math.ceil(math.log(care.left) / math.log(max(float(fast.max(initial=0.0)), 1e-9)))


def _width(given: Schedule, innovation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the width of an interval of covariances that the exact filter does not leave.

    It has a shape that each period shrinks. The limits of the gain that follow from it are about those with which the
    guarantee computes.
    """
    assert isinstance(given.origin, LinearModel)
    stored, K, dK = given.origin.rounded(given.fmt), given.exact[given.first :, ..., 0], given.dK[given.first :]
    phases = np.arange(given.first, given.steps)
    cycles = (stored.Phi, stored.H, stored.Q, stored.R)
    Phi, H, Q, R = (np.array([each[k % len(each)] for k in phases]).astype(np.float64) for each in cycles)
    kept = np.eye(stored.n) - K @ H
    A, noise = kept @ Phi, kept @ Q @ kept.swapaxes(1, 2) + K @ R @ K.swapaxes(1, 2)
    added = np.zeros((stored.n, stored.n))
    for a, more in zip(A, noise, strict=True):
        added = a @ added @ a.T + more
    P = _limit(_product(A), added)
    W = _limit(_product(A), np.diag(np.diag(P)))
    D, least = W, math.inf
    for k, a in enumerate(A):
        V, far = Phi[k] @ P @ Phi[k].T + Q[k], H[k] @ Phi[k]
        inverse = np.sqrt(np.diag(np.linalg.inv(H[k] @ V @ H[k].T + R[k])))
        by = (np.sqrt(np.diag(far @ D @ far.T)) @ inverse) * (inverse @ innovation)
        D, P = a @ D @ a.T, a @ P @ a.T + noise[k]
        far_off = by * np.sqrt(np.diag(D))
        least = min(least, float(np.min((dK[k] @ innovation)[far_off > 0] / far_off[far_off > 0], initial=math.inf)))
    return np.asarray(W * min(max(least, 2.0**-60), 2.0**-20))


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
