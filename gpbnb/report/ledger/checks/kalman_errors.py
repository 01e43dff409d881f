"""The names of (102)-(125) with the largest errors that roundings can cause.

Each rounding multiplies a result by 1 + ε with an ε of its own. To first order, an error is a sum of these ε with known
factors, so the largest error is β times the sum of their sizes. Errors of filters in four digits are further instances,
which say so by ``emulated``; ``tight`` are those in which every rounding error of the left side can add up.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from gpbnb.arithmetic.algebra import EXACT, Algebra, rounded_algebra
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact, inverse_of, row_sum_norm
from gpbnb.filters.forms import Form
from gpbnb.filters.steps import StepModel, gain, predicted, reduction, updated
from gpbnb.report.kalman import report_bounds, smallest
from gpbnb.report.kalman.smallest import FilterCase
from gpbnb.report.ledger.first_order import FirstOrder
from gpbnb.report.ledger.tracked import Matrix, largest, rounded, tracked, without_errors

Names = dict[str, Any]
Number = Callable[[Any], Matrix]


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


def take(algebra: Algebra, number: Number, case: FilterCase, x: Matrix, P: Matrix, second: bool = True) -> ComputedStep:
    """Take one step, (100)-(111), of a filter; the estimate uses the second or the first form of (99)."""
    model = StepModel(*map(number, (case.Phi, case.H, case.Q, case.R)))
    P_kp = predicted(algebra, model.Phi, P, model.Q)
    K, _ = gain(algebra, model.H, model.R, P_kp)
    P_new = updated(algebra, Form.HUNG, model, P_kp, K)
    inverse = algebra.invert(model.R, algebra.identity(len(model.R))).matrix
    K_2 = algebra.times(algebra.times(P_new, model.H.T), inverse)
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


def with_errors(**quantities: tuple[Any, Any]) -> Names:
    """Return quantities, their rounded values and their errors, given over β, by the names of the documents."""
    found: Names = {}
    for name, (value, error) in quantities.items():
        letter, index = name.split("_")
        found |= {name: FirstOrder(exact(value)), f"{letter}_hat_{index}": hat(value, error)}
        found[f"{letter}_tilde_{index}"] = tilde(error)
    return found


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


def _mixed(seed: int, n: int) -> FilterCase:
    """Return a random filter with one measurement and numbers of either sign."""
    rng = np.random.default_rng(seed)

    def numbers(*shape: int) -> Matrix:
        return exact(rng.choice([-1, 1], shape) * rng.integers(1, 20, shape)) / 10

    half, noise = numbers(n, n), numbers(n, n)
    one = exact(np.eye(n, dtype=int))
    Q, P = (factor @ factor.T + one / 50 for factor in (noise, half))
    return FilterCase(numbers(n, n), numbers(1, n), Q, exact([["1/4"]]), numbers(n), P, numbers(1))


@cache
def cases() -> tuple[FilterCase, ...]:
    """Return filters with one measurement: scalar ones whose gain almost cancels the state, and random ones."""
    cancelling = smallest.correlated()
    product = cancelling._replace(Phi=exact([["1.001", 1], [1, 0]]))
    return (*SCALARS, cancelling, product, *(_mixed(i, n) for i, n in ((1, 2), (2, 3))))


@dataclass(frozen=True)
class Roundings:
    """How to compute, how to make numbers, and which errors to take."""

    algebra: Algebra
    number: Number
    emulated: bool

    def take(self, case: FilterCase) -> ComputedStep:
        """Take the first step of a case."""
        return take(self.algebra, self.number, case, self.number(case.x[:, None]), self.number(case.P))

    def error(self, computed: Any, true: Any = 0) -> Matrix:
        """Return the error over β in four digits, or the largest one."""
        return np.asarray(abs(computed - true) / FOUR.unit_roundoff if self.emulated else largest(computed))


_TRACKED = rounded_algebra(tracked, rounded)
KINDS = (
    Roundings(_TRACKED, tracked, False),
    Roundings(rounded_algebra(exact, np.vectorize(FOUR.round, otypes=[object])), exact, True),
)


@cache
def _steps() -> tuple[tuple[FilterCase, ComputedStep, Roundings, dict[str, Matrix]], ...]:
    """Return for each case and kind the exact step and the errors of its quantities."""
    found = []
    for case in cases():
        true = take(EXACT, exact, case, exact(case.x[:, None]), exact(case.P))
        for kind in KINDS:
            errors = {name: kind.error(each, getattr(true, name)) for name, each in vars(kind.take(case)).items()}
            found.append((case, true, kind, errors))
    return tuple(found)


@cache
def one_step(gain: str = "K_2") -> list[Names]:
    """Return one step of each case, with first-order errors and in four digits; `gain` gives K_tilde_k its error."""
    return [
        _names_of_a_step(case, true, errors | {"K_2": errors[gain]}) | {"emulated": kind.emulated}
        for case, true, kind, errors in _steps()
    ]


@cache
def local_gain() -> list[Names]:
    """Return one step of each case, where the covariance and the inverse of R have no error before the gain."""
    found = []
    for case, true, kind, errors in _steps():
        of_state = kind.algebra.times(kind.number(true.P), kind.number(case.H).T)
        computed: Any = kind.algebra.times(of_state, kind.number(inverse_of(case.R)))
        none = {name: error * 0 for name, error in errors.items()}
        names = _names_of_a_step(case, true, none | {"K_2": kind.error(computed, true.K)})
        found.append(names | {"R_hat_k": FirstOrder(case.R), "emulated": kind.emulated})
    return found


def _names_of_a_step(case: FilterCase, true: ComputedStep, errors: dict[str, Matrix]) -> Names:
    given = {
        "phi": at(2, case.Phi), "P": at(2, case.P), "Q": at(2, case.Q), "x": at(2, case.x[:, None]),
        "H_k": FirstOrder(case.H), "R_k": FirstOrder(case.R), "z_k": FirstOrder(case.z[:, None]),
    }  # fmt: skip
    rounded = with_errors(
        P_kp=(true.P_kp, errors["P_kp"]), P_k=(true.P, errors["P"]), K_k=(true.K, errors["K_2"]),
        F_k=(true.F, errors["F"]), u_k=(true.u, errors["u"]), x_k=(true.x, errors["x"]),
    )  # fmt: skip
    return letters(len(case.Phi), len(case.H)) | given | rounded


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


@cache
def tight(instance: Callable[..., Names], *arguments: Any) -> tuple[Names, ...]:
    """Return an instance of each size, in which all errors add up."""
    return tuple(letters(n, m) | instance(n, m, *arguments) | {"tight": True} for n, m in SIZES)


@cache
def second_prediction() -> list[Names]:
    """Return the prediction in the second step of each case, which starts from a covariance with an error."""
    found = []
    for case, true, kind, errors in _steps():
        value = case.Phi @ true.P @ case.Phi.T + case.Q
        computed = predicted(kind.algebra, kind.number(case.Phi), kind.take(case).P, kind.number(case.Q))
        before = {"phi": at(2, case.Phi), "P": at(2, true.P), "P_tilde": at(2, tilde(errors["P"])), "Q": at(2, case.Q)}
        after = with_errors(P_kp=(value, kind.error(computed, value)))
        found.append(letters(len(case.Phi), len(case.H)) | before | after | {"emulated": kind.emulated})
    return found


def prediction_alone(n: int, m: int) -> Names:
    """Return positive matrices for (102) and (103), with errors of P_{k-1} of any size."""
    Phi, half, Q, of_covariance = _positive(1, n, n), _positive(2, n, n), _positive(3, n, n), _positive(19, n, n)
    P = half + half.T
    error = largest(predicted(_TRACKED, tracked(Phi), tracked(P, of_covariance), tracked(Q)))
    before = {"phi": at(2, Phi), "P": at(2, P), "P_tilde": at(2, tilde(of_covariance)), "Q": at(2, Q)}
    return before | with_errors(P_kp=(Phi @ P @ Phi.T + Q, error))


def covariance_alone(n: int, m: int) -> Names:
    """Return matrices for (104), (105) and the line before (107), with errors of K_k and P_kp of any size."""
    K, H, P_kp, unit = _positive(4, n, m) / 20, _positive(5, m, n), _alternating(6, n), EXACT.identity(n)
    of_gain, of_prediction = _positive(7, n, m), _positive(8, n, n)
    error = largest(reduce(_TRACKED, tracked(K, of_gain), tracked(H), tracked(P_kp, of_prediction)))
    rounded = with_errors(K_k=(K, of_gain), P_kp=(P_kp, of_prediction), P_k=((unit - K @ H) @ P_kp, error))
    return {"H_k": FirstOrder(H)} | rounded


def gain_alone(n: int, m: int, local: bool = False) -> Names:
    """Return positive matrices for (106)-(108); without errors of P_k and of the inverse of R if `local`."""
    P, H = _positive(9, n, n), _positive(10, m, n)
    R_inverse = _positive(11, m, m) + 2 * exact(np.eye(m, dtype=int))
    of_covariance = _positive(12, n, n) * (not local)
    inverse = tracked(R_inverse) if local else rounded(tracked(R_inverse))
    of_state = _TRACKED.times(tracked(P, of_covariance), tracked(H).T)
    error, R = largest(_TRACKED.times(of_state, inverse)), FirstOrder(inverse_of(R_inverse))
    given = {"P_kp": FirstOrder(P), "H_k": FirstOrder(H), "R_k": R, "R_hat_k": R}
    return given | with_errors(P_k=(P, of_covariance), K_k=(P @ H.T @ R_inverse, error))


def loop_alone(n: int, m: int) -> Names:
    """Return matrices for (112)-(114), with errors of K_k of any size, and of F_k and u_k for (114)."""
    K, H, Phi, unit = _positive(13, n, m) / 20, _positive(14, m, n), _alternating(15, n), EXACT.identity(n)
    z, of_gain = _positive(16, m, 1), _positive(17, n, m)
    of_loop = largest(reduce(_TRACKED, tracked(K, of_gain), tracked(H), tracked(Phi)))
    of_input = largest(_TRACKED.times(tracked(K, of_gain), tracked(z)))
    F, u = (unit - K @ H) @ Phi, K @ z
    x = np.sign(F[:1].T.astype(float)).astype(int) * _positive(18, n, 1)
    error = largest(update(_TRACKED, tracked(F, of_loop), tracked(x), tracked(u, of_input)))
    given = {"phi": at(2, Phi), "x": at(2, x), "H_k": FirstOrder(H), "z_k": FirstOrder(z)}
    return given | with_errors(K_k=(K, of_gain), F_k=(F, of_loop), u_k=(u, of_input), x_k=(F @ x + u, error))


# -- several steps, (119)-(125) -------------------------------------------------------------------

LAST = 5
"""Steps of the longest run."""


def _exact_run(case: FilterCase) -> list[ComputedStep]:
    found: list[ComputedStep] = []
    x, P = exact(case.x)[:, None], exact(case.P)
    for _ in range(LAST):
        found.append(take(EXACT, exact, case, x, P, second=False))
        x, P = found[-1].x, found[-1].P
    return found


def _errors_of_a_run(case: FilterCase, run: list[ComputedStep], kind: Roundings) -> list[list[Matrix]]:
    """Return for each step the errors of x, of F, of u, and of x from this step alone."""
    x, P, errors = kind.number(case.x[:, None]), kind.number(case.P), []
    for true in run:
        step = take(kind.algebra, kind.number, case, x, P, second=False)
        alone = step.x - (kind.number(true.F) @ x + kind.number(true.u))
        pairs = ((step.x, true.x), (step.F, true.F), (step.u, true.u))
        errors.append([*(kind.error(found, each) for found, each in pairs), kind.error(alone)])
        x, P = step.x, step.P
    return errors


def _names_of_a_run(
    m: int, k: int, x_0: Matrix, loops: list[Matrix], inputs: list[Matrix], of_loops: list[Matrix],
    of_inputs: list[Matrix], states: list[Matrix], of_states: Sequence[Matrix], e: Fraction,
) -> Names:  # fmt: skip
    """Return the names of (119)-(125); the lists have an entry for each step."""
    names = letters(len(x_0), m) | {
        "k": Fraction(k), "x_0": FirstOrder(x_0), "x_k": FirstOrder(states[k - 1]),
        "x_tilde_k": tilde(of_states[k - 1]),
        "F": max(map(row_sum_norm, loops)), "e": FirstOrder(Fraction(0), e),
        "B": report_bounds.printed_input_bound(loops, [u[:, 0] for u in inputs]),
    }  # fmt: skip
    for letter, values, errors in (("F", loops, of_loops), ("u", inputs, of_inputs), ("x", states, of_states)):
        pairs = zip(values, errors, strict=True)
        names |= with_errors(**{f"{letter}_{i}": pair for i, pair in enumerate(pairs, start=1)})
    return names


@cache
def several_steps() -> list[Names]:
    """Return runs of five steps of each case; k is the first or the last step."""
    found = []
    for case, kind in itertools.product(cases()[:-1], KINDS):
        n, m, steps = len(case.Phi), len(case.H), _exact_run(case)
        of_states, of_F, of_u, alone = zip(*_errors_of_a_run(case, steps, kind), strict=True)
        loops, inputs = [step.F for step in steps], [step.u for step in steps]
        of_loops = [error + (n + 1) * abs(F) for error, F in zip(of_F, loops, strict=True)]
        of_inputs = [error + abs(u) for error, u in zip(of_u, inputs, strict=True)]
        x_0, states, e = exact(case.x)[:, None], [step.x for step in steps], max(abs(each).max() for each in alone)
        for k in (1, LAST):
            names = _names_of_a_run(m, k, x_0, loops, inputs, of_loops, of_inputs, states, of_states, e)
            found.append(names | {"emulated": kind.emulated})
    return found


def _run_with_errors(x: Matrix, *steps: Sequence[Matrix]) -> list[Matrix]:
    """Return the states of a run with given closed loops, inputs and errors of both."""
    found = [tracked(x)]
    for F, u, of_loop, of_input in zip(*steps, strict=True):
        found.append(tracked(F, of_loop) @ found[-1] + tracked(u, of_input))
    return found[1:]


def _steps_alone(n: int, k: int) -> Names:
    share, x_0, e = _positive(20, n, n), _positive(60, n, 1), Fraction(7, 3)
    loops = [exact(np.array([row / sum(row) for row in share])) * Fraction(3, 2)] * LAST
    inputs = [_positive(30 + i, n, 1) * (-1) ** i for i in range(LAST)]
    of_loops, of_inputs = ([_positive(40 + 9 * j + i, n, c) for i in range(LAST)] for j, c in ((0, n), (1, 1)))
    run = _run_with_errors(x_0, loops, inputs, of_loops, of_inputs)
    states, of_states = list(map(without_errors, run)), list(map(largest, run))
    names = _names_of_a_run(1, k, x_0, loops, inputs, of_loops, of_inputs, states, of_states, e)
    equal = _run_with_errors(x_0, loops, inputs, [loops[0] * 0] * LAST, [exact(np.full((n, 1), e))] * LAST)
    norms = {id(names[f"x_tilde_{i}"]): tilde(largest(x)).norm() for i, x in enumerate(equal, start=1)}
    norms[id(names["x_tilde_k"])] = norms[id(names[f"x_tilde_{k}"])]
    return names | {"norm": lambda x: norms.get(id(x)) or x.norm(), "tight": True}


@cache
def tight_steps() -> list[Names]:
    """Return runs with errors of any size; the norm of an error is that which steps with equal errors give."""
    return [_steps_alone(n, k) for n, k in itertools.product((1, 2), (1, LAST))]
