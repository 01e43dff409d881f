"""gpbnb.report.inversion.theory: each bound as printed or derived, and whether it is one."""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np

from gpbnb.arithmetic.bounds import gamma
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import column_sum_norm, exact, inverse_of
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.inversion import procedure, theory
from gpbnb.report.inversion.theory import Reduction

BETA = Fraction(1, 2000)

# Made up, not computed: 3 stages of a 3 × 3 matrix and two right-hand sides, no entry of them 0 or 1 by chance.
STAGES = [
    [[2, 3, -5], [4, 7, 9], [-6, 8, 11]],
    [[2, 3, -5], [0, 13, 17], [0, -26, 19]],
    [[2, 3, -5], [0, 13, 17], [0, 0, 23]],
]
RIGHTS = [[[3, 5], [7, 2], [9, -4]], [[3, 5], [-8, 6], [12, 21]], [[3, 5], [-8, 6], [-25, 31]]]
SOLUTION = [[2, -3], [5, 7], [-4, 9]]
EXACT_STAGES, EXACT_RIGHTS = [exact(s) for s in STAGES], [exact(r) for r in RIGHTS]
MADE_UP = Reduction(EXACT_STAGES, EXACT_RIGHTS, exact(SOLUTION))


def rows(a):
    return [list(row) for row in a]


# -- as printed, by hand --------------------------------------------------------------------------


def test_first_approach_as_printed():
    inverse = exact([[2, -3], [5, 7]])
    residual = exact([[Fraction(1, 100), 0], [0, Fraction(-3, 100)]])
    assert theory.printed_first_bound(inverse, residual) == 10 * Fraction(3, 100)
    assert theory.residual(inverse, exact([[1, 2], [3, 4]])).tolist() == [[-8, -8], [26, 37]]


def test_the_total_as_printed_and_corrected():
    printed = theory.perturbation(MADE_UP, BETA)
    delta_a = [[0, 12, -15], [0, 25, 33 + 51], [0, -94, 35 + 31]]
    assert rows(printed.matrix / BETA) == delta_a
    delta_b = [[9, 15], [-38 - 16, 14 + 12], [18 - 99 - 25, 71 + 51 + 31]]
    assert rows(printed.right / BETA) == delta_b
    bracket = exact(delta_b) - exact(delta_a) @ exact(SOLUTION)
    assert rows(theory.bracket(MADE_UP, printed) / BETA) == rows(bracket)
    lower = exact([[1, 0, 0], [2, 1, 0], [3, 2, 1]])
    whole = theory.perturbation(MADE_UP, BETA, signed=False, transfer=True)
    bare = theory.perturbation(MADE_UP, BETA, signed=False)
    tilde = theory.triangularization_error(EXACT_STAGES, BETA, True, signed=False)
    back = exact([[0, 12, 15], [0, 0, 51], [0, 0, 0]]) * BETA
    assert rows(whole.matrix) == rows(tilde + lower @ back)
    assert rows(bare.matrix) == rows(tilde + back)
    tilde = theory.triangularization_error(EXACT_RIGHTS, BETA, False, signed=False)
    back = exact([[9, 15], [16, 12], [25, 31]]) * BETA
    assert rows(whole.right) == rows(tilde + lower @ back)
    assert rows(bare.right) == rows(tilde + back)
    sizes = theory.bracket(MADE_UP, whole, signed=False)
    assert rows(sizes) == rows(whole.right + whole.matrix @ abs(exact(SOLUTION)))
    assert theory.bound(MADE_UP, BETA) == 19 * column_sum_norm(sizes)


# -- is it a bound? -------------------------------------------------------------------------------


class Case:
    """One inversion: its format's β, what was computed, and the true inverse of the matrix as it was eliminated."""

    def __init__(self, fmt, a, pivot):
        self.beta = fmt.unit_roundoff
        self.reduction = procedure.as_fractions(procedure.reduce(fmt.array(a), pivot))
        self.inverse = inverse_of(self.reduction.stages[0])
        self.true = self.inverse @ self.reduction.rights[0]
        self.error = column_sum_norm(self.reduction.solution - self.true)


@cache
def cases():
    """Random, graded and nearly singular matrices of two to five rows, two bases, rounded and chopped."""
    rng = np.random.default_rng(84)
    found = []
    for base, precision in ((10, 3), (10, 6), (2, 11)):
        for rounding in Rounding.documented():
            for n in (2, 3, 5):
                for kind in range(6):
                    a = rng.integers(-999, 1000, (n, n)).astype(object)
                    if kind == 4:
                        a = a * 10 ** rng.integers(0, 5, (n, 1)).astype(object)
                    if kind == 5:
                        a[-1] = a[0]
                        a[-1, -1] += 1
                    try:
                        found.append(Case(FloatFormat(base, precision, rounding), exact(a), pivot=kind % 2 == 0))
                    except np.linalg.LinAlgError:  # a pivot is zero
                        continue
    assert len(found) > 95
    return found


def ratios(observed, bound):
    """Largest observed over bound; a bound of zero allows zero only."""
    pairs = list(zip(np.ravel(observed), np.ravel(bound), strict=True))
    assert all(abs(x) <= y for x, y in pairs)
    return max((abs(x) / y for x, y in pairs if y), default=0)


def test_the_errors_of_elimination_are_a_change_of_the_given_matrix_within_their_bounds():
    closest = {"matrix": 0, "right": 0}
    for case in cases():
        stages, rights, _ = case.reduction
        lower = theory.lower_factor(stages)
        change, right = lower @ stages[-1] - stages[0], lower @ rights[-1] - rights[0]
        for name, observed, bound in (
            ("matrix", change, theory.triangularization_error(stages, case.beta, True, False)),
            ("right", right, theory.triangularization_error(rights, case.beta, False, False)),
        ):
            closest[name] = max(closest[name], ratios(observed, bound))
        assert column_sum_norm(change) <= theory.printed_triangularization_norm(stages, case.beta)
    assert min(closest.values()) > 0.4  # none of them is vacuous


def test_printed_59_and_60_are_no_bounds():
    """Already an entry with 3 a(1) = 2 a(0): the printed error is zero."""
    exceeded = [0, 0]
    for case in cases():
        stages, rights, _ = case.reduction
        lower = theory.lower_factor(stages)
        change, right = lower @ stages[-1] - stages[0], lower @ rights[-1] - rights[0]
        exceeded[0] += bool((abs(change) > abs(theory.triangularization_error(stages, case.beta, True, True))).any())
        exceeded[1] += bool((abs(right) > abs(theory.triangularization_error(rights, case.beta, False, True))).any())
    assert min(exceeded) >= 3


def test_back_substitution_solves_a_system_within_the_weights():
    """(A_T + ΔA) x̂ = b_T + Δb is possible if and only if |b_T - A_T x̂| is at most |ΔA||x̂| + |Δb| (Oettli, Prager)."""
    closest = 0
    for case in cases():
        stages, rights, x = case.reduction
        n = len(x)
        residual = rights[-1] - stages[-1] @ x
        weights = np.array([[gamma(w, case.beta) for w in row] for row in theory.back_substitution_weights(n).tolist()])
        right = np.array([[gamma(w, case.beta)] for (w,) in theory.right_side_weights(n).tolist()])
        allowed = (weights * abs(stages[-1])) @ abs(x) + right * abs(rights[-1])
        closest = max(closest, ratios(residual, allowed))
    assert closest > 0.3


def test_corrected_bounds_hold_in_these_cases():
    closest = 0
    for case in cases():
        bound = theory.bound(case.reduction, case.beta)
        assert case.error <= bound
        closest = max(closest, case.error / bound)
    assert closest > 0.05


def test_the_solution_is_that_of_the_perturbed_system_of_91_with_l():
    """δb - δA x̂ of some changes within the bounds: again by Oettli and Prager, of the given system."""
    without = 0
    for case in cases():
        stages, rights, x = case.reduction
        residual = rights[0] - stages[0] @ x
        whole = theory.perturbation(case.reduction, case.beta, signed=False, transfer=True)
        ratios(residual, theory.bracket(case.reduction, whole, signed=False))
        change = theory.perturbation(case.reduction, case.beta, signed=False)
        bare = theory.bracket(case.reduction, change, signed=False)
        without += bool((abs(residual) > bare).any())
    assert without == 0  # what L adds is never needed here: the bounds are pessimistic elsewhere
