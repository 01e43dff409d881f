"""The names of (102)-(125) with the largest errors that roundings can cause.

Each rounding multiplies a result by 1 + ε with an ε of its own. To first order, an error is a sum of these ε with known
factors, so the largest error is β times the sum of their sizes. Errors of filters in four digits are further instances,
which say so by ``emulated``; ``tight`` are those in which every rounding error of the left side can add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.algebra import EXACT, Algebra, rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, gain, predicted, reduction, second_gain, updated
from gpbnb.report.kalman import report_bounds, smallest
from gpbnb.report.ledger.first_order import FirstOrder
from gpbnb.report.ledger.tracked import Matrix, largest, rounded, tracked

Names = dict[str, Any]


FOUR = FloatFormat(10, 4)


# -- one step with a rounding of every operation --------------------------------------------------


@dataclass
class ComputedStep:
    """The computed quantities of one step, in one kind of number."""

    P_kp: Matrix
    K: Matrix
    P: Matrix
    K_2: Matrix
    F: Matrix
    u: Matrix
    x: Matrix


def take(
    algebra: Algebra,
    number: Callable[[Any], Matrix],
    case: smallest.FilterCase,
    x: Matrix,
    P: Matrix,
    second: bool = True,
) -> ComputedStep:
    """Take one step, (100)-(111), of a filter; the estimate uses the second or the first form of (99)."""
    model = StepModel(*map(number, (case.Phi, case.H, case.Q, case.R)))
    P_kp = predicted(algebra, model.Phi, P, model.Q)
    K = gain(algebra, model.H, model.R, P_kp).K
    P_new = updated(algebra, Form.HUNG, model, P_kp, K)
    K_2 = second_gain(algebra, model.H, model.R, P_new)
    used = K_2 if second else K
    F, u = reduce(algebra, used, model.H, model.Phi), algebra.times(used, number(case.z[:, None]))
    return ComputedStep(P_kp, K, P_new, K_2, F, u, update(algebra, F, x, u))


def reduce(algebra: Algebra, K: Matrix, H: Matrix, right: Matrix) -> Matrix:
    """Return the rounded (I - KH) times a matrix, as in (101) and (109)."""
    return np.asarray(algebra.times(reduction(algebra, K, H), right))


def update(algebra: Algebra, F: Matrix, x: Matrix, u: Matrix) -> Matrix:
    """Return the rounded (111)."""
    return np.asarray(algebra.rounded(algebra.times(F, x) + u))


# -- instances ------------------------------------------------------------------------------------


def exact_errors(*groups: Iterable[Names]) -> list[Names]:
    """Return the instances with first-order errors, without those in four digits."""
    return [names for group in groups for names in group if not names.get("emulated")]


def hat(value: Any, error: Any) -> FirstOrder:
    """Return a quantity with its largest error over β."""
    return FirstOrder(exact(value), exact(error))


def tilde(error: Any) -> FirstOrder:
    """Return an error, given over β."""
    return FirstOrder(exact(error) * 0, exact(error))


def at(index: int, value: Any, others: dict[int, Any] | None = None) -> Callable[[Any], FirstOrder]:
    """Return a letter that has a value only at some indices."""
    known = {index: value} | (others or {})

    def letter(i: Any) -> FirstOrder:
        value = known[int(i)]
        return value if isinstance(value, FirstOrder) else FirstOrder(exact(value))

    return letter


def letters(n: int, m: int) -> Names:
    """Return what every instance names; in each, k is 3."""
    return {
        "n": Fraction(n), "m": Fraction(m), "k": Fraction(3), "I": FirstOrder(exact(np.eye(n, dtype=int))),
        "norm": lambda x: x.norm(), "matrix": None,
    }  # fmt: skip


SCALARS = tuple(
    smallest.scalar(FOUR, r, h, z) for r, h, z in ((None, 1, 1), (None, 1, 0), (".004", "7.5", 1), ("1/2", "3/2", 2))
)


def _mixed(seed: int, n: int) -> smallest.FilterCase:
    """Return a random filter with one measurement and numbers of either sign."""
    rng = np.random.default_rng(seed)

    def numbers(*shape: int) -> Matrix:
        return exact(rng.choice([-1, 1], shape) * rng.integers(1, 20, shape)) / 10

    half, noise = numbers(n, n), numbers(n, n)
    one = exact(np.eye(n, dtype=int))
    Q, P = (factor @ factor.T + one / 50 for factor in (noise, half))
    return smallest.FilterCase(numbers(n, n), numbers(1, n), Q, exact([["1/4"]]), numbers(n), P, numbers(1))


@cache
def cases() -> tuple[smallest.FilterCase, ...]:
    """Return filters with one measurement: scalar ones whose gain almost cancels the state, and random ones."""
    cancelling = smallest.correlated()
    product = cancelling._replace(Phi=exact([["1.001", 1], [1, 0]]))
    return (*SCALARS, cancelling, product, *(_mixed(i, n) for i, n in ((1, 2), (2, 3))))


@cache
def one_step(gain: str = "K_2") -> tuple[Names, ...]:
    """Return one step of each case, with first-order errors and in four digits; `gain` gives K_tilde_k its error."""
    found = []
    for case in cases():
        true, *others = _steps(case)
        for errors, emulated in zip(others, (False, True), strict=True):
            names = _names_of_a_step(case, true, errors | {"K_2": errors[gain]})
            found.append(names | {"emulated": emulated})
    return tuple(found)


@cache
def local_gain() -> tuple[Names, ...]:
    """Return one step of each case, where the covariance and the inverse of R have no error before the gain."""
    found = []
    for case in cases():
        true, *_ = _steps(case)
        for algebra, number, emulated in KINDS:
            of_state = algebra.times(number(true.P), number(case.H).T)
            computed: Any = algebra.times(of_state, number(inverse_of(case.R)))
            error = abs(computed - true.K) / FOUR.unit_roundoff if emulated else largest(computed)
            none = {name: abs(each) * 0 for name, each in vars(true).items()}
            names = _names_of_a_step(case, true, none | {"K_2": error})
            found.append(names | {"R_hat_k": FirstOrder(case.R), "emulated": emulated})
    return tuple(found)


def _errors(computed: ComputedStep, true: ComputedStep, emulated: bool) -> dict[str, Matrix]:
    """Return the errors of a step over β: the largest, or those in four digits."""
    if emulated:
        return {name: abs(each - getattr(true, name)) / FOUR.unit_roundoff for name, each in vars(computed).items()}
    return {name: largest(each) for name, each in vars(computed).items()}


_FOUR = rounded_algebra(exact, np.vectorize(FOUR.round, otypes=[object]))
_TRACKED = rounded_algebra(tracked, rounded)
KINDS: tuple[tuple[Algebra, Callable[[Any], Matrix], bool], ...] = ((_TRACKED, tracked, False), (_FOUR, exact, True))
"""How to compute, how to make numbers, and whether the errors are those in four digits instead of the largest ones."""


@cache
def _steps_of(place: int) -> tuple[ComputedStep, dict[str, Matrix], dict[str, Matrix]]:
    case = cases()[place]
    x, P = case.x[:, None], case.P
    true = take(EXACT, exact, case, exact(x), exact(P))
    moved = take(_TRACKED, tracked, case, tracked(x), tracked(P))
    computed = take(_FOUR, exact, case, exact(x), exact(P))
    return true, _errors(moved, true, False), _errors(computed, true, True)


def _steps(case: smallest.FilterCase) -> tuple[ComputedStep, dict[str, Matrix], dict[str, Matrix]]:
    """Return the exact step of a case, the largest errors, and those in four digits."""
    return _steps_of(next(i for i, each in enumerate(cases()) if each is case))


def _names_of_a_step(case: smallest.FilterCase, true: ComputedStep, errors: dict[str, Matrix]) -> Names:
    return letters(len(case.Phi), len(case.H)) | {
        "phi": at(2, case.Phi), "P": at(2, case.P), "Q": at(2, case.Q), "x": at(2, case.x[:, None]),
        "H_k": FirstOrder(case.H), "R_k": FirstOrder(case.R), "z_k": FirstOrder(case.z[:, None]),
        "P_kp": FirstOrder(true.P_kp), "P_hat_kp": hat(true.P_kp, errors["P_kp"]), "P_tilde_kp": tilde(errors["P_kp"]),
        "P_k": FirstOrder(true.P), "P_hat_k": hat(true.P, errors["P"]), "P_tilde_k": tilde(errors["P"]),
        "K_k": FirstOrder(true.K), "K_hat_k": hat(true.K, errors["K_2"]), "K_tilde_k": tilde(errors["K_2"]),
        "F_k": FirstOrder(true.F), "F_hat_k": hat(true.F, errors["F"]), "F_tilde_k": tilde(errors["F"]),
        "u_k": FirstOrder(true.u), "u_hat_k": hat(true.u, errors["u"]), "u_tilde_k": tilde(errors["u"]),
        "x_hat_k": hat(true.x, errors["x"]), "x_k": FirstOrder(true.x),
    }  # fmt: skip


# -- instances in which all errors add up: each group of equations has its own -------------------

SIZES = tuple(itertools.product((1, 2), (1, 2)))
"""Numbers of states and measurements for which a count of roundings in an inner product is exact."""


def _positive(seed: int, *shape: int) -> Matrix:
    rng = np.random.default_rng(seed)
    return exact(rng.integers(1, 20, shape)) / 10


def _alternating(seed: int, n: int) -> Matrix:
    """Return a symmetric matrix with negative entries off the diagonal, as I - KH has them for small K and H."""
    half = _positive(seed, n, n)
    return (half + half.T) * (2 * exact(np.eye(n, dtype=int)) - 1)


def _tight(n: int, m: int, **names: Any) -> Names:
    return letters(n, m) | names | {"tight": True}


@cache
def second_prediction() -> tuple[Names, ...]:
    """Return the prediction in the second step of each case, which starts from a covariance with an error."""
    found = []
    for case in cases():
        true, *others = _steps(case)
        value = case.Phi @ true.P @ case.Phi.T + case.Q
        for (algebra, number, emulated), errors in zip(KINDS, others, strict=True):
            P = take(algebra, number, case, number(case.x[:, None]), number(case.P)).P
            computed: Any = predicted(algebra, number(case.Phi), P, number(case.Q))
            error = abs(computed - value) / FOUR.unit_roundoff if emulated else largest(computed)
            names = letters(len(case.Phi), len(case.H)) | {
                "phi": at(2, case.Phi), "P": at(2, true.P), "P_tilde": at(2, tilde(errors["P"])), "Q": at(2, case.Q),
                "P_kp": FirstOrder(value), "P_hat_kp": hat(value, error), "P_tilde_kp": tilde(error),
            }  # fmt: skip
            found.append(names | {"emulated": emulated})
    return tuple(found)


@cache
def tight_prediction() -> tuple[Names, ...]:
    """Return positive matrices for (102) and (103), with errors of P_{k-1} of any size."""
    found = []
    for n, m in SIZES:
        Phi, half, Q, of_covariance = _positive(1, n, n), _positive(2, n, n), _positive(3, n, n), _positive(19, n, n)
        P = half + half.T
        error = largest(predicted(_TRACKED, tracked(Phi), tracked(P, of_covariance), tracked(Q)))
        value = Phi @ P @ Phi.T + Q
        found.append(
            _tight(
                n,
                m,
                phi=at(2, Phi),
                P=at(2, P),
                P_tilde=at(2, tilde(of_covariance)),
                Q=at(2, Q),
                P_kp=FirstOrder(value),
                P_hat_kp=hat(value, error),
                P_tilde_kp=tilde(error),
            )
        )
    return tuple(found)


@cache
def tight_covariance() -> tuple[Names, ...]:
    """Return matrices for (104), (105) and the line before (107), with errors of K_k and P_kp of any size."""
    found = []
    for n, m in SIZES:
        K, H, P_kp, unit = _positive(4, n, m) / 20, _positive(5, m, n), _alternating(6, n), EXACT.identity(n)
        of_gain, of_prediction = _positive(7, n, m), _positive(8, n, n)
        error = largest(reduce(_TRACKED, tracked(K, of_gain), tracked(H), tracked(P_kp, of_prediction)))
        value = (unit - K @ H) @ P_kp
        found.append(
            _tight(
                n,
                m,
                K_k=FirstOrder(K),
                H_k=FirstOrder(H),
                P_kp=FirstOrder(P_kp),
                P_k=FirstOrder(value),
                K_hat_k=hat(K, of_gain),
                K_tilde_k=tilde(of_gain),
                P_hat_kp=hat(P_kp, of_prediction),
                P_tilde_kp=tilde(of_prediction),
                P_hat_k=hat(value, error),
                P_tilde_k=tilde(error),
            )
        )
    return tuple(found)


@cache
def tight_gain(local: bool = False) -> tuple[Names, ...]:
    """Return positive matrices for (106)-(108); without errors of P_k and of the inverse of R if `local`."""
    found = []
    for n, m in SIZES:
        P, H = _positive(9, n, n), _positive(10, m, n)
        R_inverse = _positive(11, m, m) + 2 * exact(np.eye(m, dtype=int))
        of_covariance = _positive(12, n, n) * (not local)
        inverse = tracked(R_inverse) if local else rounded(tracked(R_inverse))
        of_state = _TRACKED.times(tracked(P, of_covariance), tracked(H).T)
        error = largest(_TRACKED.times(of_state, inverse))
        K, R = P @ H.T @ R_inverse, FirstOrder(inverse_of(R_inverse))
        found.append(
            _tight(
                n,
                m,
                P_k=FirstOrder(P),
                P_kp=FirstOrder(P),
                H_k=FirstOrder(H),
                R_k=R,
                R_hat_k=R,
                K_k=FirstOrder(K),
                P_hat_k=hat(P, of_covariance),
                P_tilde_k=tilde(of_covariance),
                K_hat_k=hat(K, error),
                K_tilde_k=tilde(error),
            )
        )
    return tuple(found)


@cache
def tight_loop() -> tuple[Names, ...]:
    """Return matrices for (112)-(114), with errors of K_k of any size, and of F_k and u_k for (114)."""
    found = []
    for n, m in SIZES:
        K, H, Phi, unit = (
            _positive(13, n, m) / 20,
            _positive(14, m, n),
            _alternating(15, n),
            exact(np.eye(n, dtype=int)),
        )
        z, of_gain = _positive(16, m, 1), _positive(17, n, m)
        of_loop = largest(reduce(_TRACKED, tracked(K, of_gain), tracked(H), tracked(Phi)))
        of_input = largest(_TRACKED.times(tracked(K, of_gain), tracked(z)))
        F, u = (unit - K @ H) @ Phi, K @ z
        x = np.sign(F[:1].T.astype(float)).astype(int) * _positive(18, n, 1)
        error = largest(update(_TRACKED, tracked(F, of_loop), tracked(x), tracked(u, of_input)))
        found.append(
            _tight(
                n,
                m,
                phi=at(2, Phi),
                x=at(2, x),
                K_k=FirstOrder(K),
                H_k=FirstOrder(H),
                z_k=FirstOrder(z),
                K_hat_k=hat(K, of_gain),
                K_tilde_k=tilde(of_gain),
                F_k=FirstOrder(F),
                F_hat_k=hat(F, of_loop),
                F_tilde_k=tilde(of_loop),
                u_k=FirstOrder(u),
                u_hat_k=hat(u, of_input),
                u_tilde_k=tilde(of_input),
                x_k=FirstOrder(F @ x + u),
                x_hat_k=hat(F @ x + u, error),
            )
        )
    return tuple(found)


# -- several steps, (119)-(125) -------------------------------------------------------------------

LAST = 5
"""Steps of the longest run."""


@cache
def _runs() -> tuple[tuple[smallest.FilterCase, list[ComputedStep], list[list[Matrix]], list[list[Matrix]]], ...]:
    """Return exact runs, and for both kinds of errors in each step: of x, of F, of u, and of x from this step alone."""
    found = []
    for case in cases()[:-1]:
        exact_steps: list[ComputedStep] = []
        kinds: list[list[list[Matrix]]] = []
        x, P = exact(case.x)[:, None], exact(case.P)
        for _ in range(LAST):
            exact_steps.append(take(EXACT, exact, case, x, P, second=False))
            x, P = exact_steps[-1].x, exact_steps[-1].P
        for algebra, number, emulated in KINDS:
            x, P, errors = number(case.x[:, None]), number(case.P), []
            for true in exact_steps:
                step = take(algebra, number, case, x, P, second=False)
                alone = step.x - (number(true.F) @ x + number(true.u))
                size = (lambda each: abs(each) / FOUR.unit_roundoff) if emulated else largest
                pairs = ((step.x, true.x), (step.F, true.F), (step.u, true.u))
                errors.append([*(size(a - number(b)) for a, b in pairs), size(alone)])
                x, P = step.x, step.P
            kinds.append(errors)
        found.append((case, exact_steps, kinds[0], kinds[1]))
    return tuple(found)


def row_sum_norm(a: Matrix) -> Fraction:
    """Return the largest row sum of sizes, the norm of matrices that is compatible with (21)."""
    return column_sum_norm(a.T)


def _named(letter: str, values_of: Iterable[Any], first: int = 1) -> Names:
    return {f"{letter}_{i}": each for i, each in enumerate(values_of, start=first)}


def _names_of_a_run(
    m: int, k: int, x_0: Matrix, loops: list[Matrix], inputs: list[Matrix], of_loops: list[Matrix],
    of_inputs: list[Matrix], states: list[Matrix], of_states: list[Matrix], e: Fraction,
) -> Names:  # fmt: skip
    """Return the names of (119)-(125); the lists have an entry for each step."""
    return (
        letters(len(x_0), m)
        | _named("F", map(FirstOrder, loops)) | _named("u", map(FirstOrder, inputs))
        | _named("F_tilde", map(tilde, of_loops)) | _named("u_tilde", map(tilde, of_inputs))
        | _named("x", map(FirstOrder, [x_0, *states]), 0) | _named("x_tilde", map(tilde, of_states))
        | _named("x_hat", map(hat, states, of_states))
        | {
            "k": Fraction(k), "x_k": FirstOrder(states[k - 1]), "x_tilde_k": tilde(of_states[k - 1]),
            "F": max(map(row_sum_norm, loops)), "e": FirstOrder(Fraction(0), e),
            "B": report_bounds.printed_input_bound(loops, [u[:, 0] for u in inputs]),
        }
    )  # fmt: skip


@cache
def several_steps() -> tuple[Names, ...]:
    """Return runs of five steps of each case; k is the first or the last step."""
    found = []
    for case, steps, *kinds in _runs():
        n, m = len(case.Phi), len(case.H)
        for errors, emulated in zip(kinds, (False, True), strict=True):
            of_states, of_loops, of_inputs, alone = zip(*errors, strict=True)
            loops, inputs = [step.F for step in steps], [step.u for step in steps]
            for k in (1, LAST):
                names = _names_of_a_run(
                    m, k, exact(case.x)[:, None], loops, inputs,
                    [error + (n + 1) * abs(F) for error, F in zip(of_loops, loops, strict=True)],
                    [error + abs(u) for error, u in zip(of_inputs, inputs, strict=True)],
                    [step.x for step in steps], list(of_states), max(abs(each).max() for each in alone),
                )  # fmt: skip
                found.append(names | {"emulated": emulated})
    return tuple(found)


@cache
def tight_steps() -> tuple[Names, ...]:
    """Return products of given closed loops and inputs, whose errors have any size; norms of all steps are equal."""
    found = []
    for n, k in itertools.product((1, 2), (1, LAST)):
        share = _positive(20, n, n)
        loop = exact(np.array([row / sum(row) for row in share])) * Fraction(3, 2)
        loops = [loop] * LAST
        inputs = [_positive(30 + i, n, 1) * (-1) ** i for i in range(LAST)]
        of_loops, of_inputs = ([_positive(40 + 9 * j + i, n, c) for i in range(LAST)] for j, c in ((0, n), (1, 1)))
        e = Fraction(7, 3)
        x_0 = exact_x = _positive(60, n, 1)
        x, same = tracked(x_0), tracked(x_0)
        states, of_states, of_norms = [], [], []
        for F, u, of_loop, of_input in zip(loops, inputs, of_loops, of_inputs, strict=True):
            x = tracked(F, of_loop) @ x + tracked(u, of_input)
            same = tracked(F) @ same + tracked(u, exact(np.full((n, 1), e)))
            exact_x = F @ exact_x + u
            states.append(exact_x)
            of_states.append(largest(x))
            of_norms.append(largest(same))
        names = _names_of_a_run(1, k, x_0, loops, inputs, of_loops, of_inputs, states, of_states, e)
        alone = _named("x_tilde", map(tilde, of_norms)) | {"x_tilde_k": tilde(of_norms[k - 1])}
        found.append(names | {"norm": lambda each, alone=alone, names=names: _norm(each, names, alone), "tight": True})
    return tuple(found)


def _norm(x: FirstOrder, names: Names, alone: Names) -> FirstOrder:
    """Return the norm of a state, or of the error that steps with equal errors give it."""
    for name, error in alone.items():
        if x is names[name]:
            return error.norm()
    return x.norm()
