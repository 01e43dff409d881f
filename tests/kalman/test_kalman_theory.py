"""gpbnb.kalman.report_bounds and contraction: counts, the closing example, a bound that no trajectory exceeds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat, Rounding, prints_as
from gpbnb.arithmetic.rational import exact
from gpbnb.kalman import contraction, derivation, exact_step, report_bounds, smallest
from gpbnb.kalman.kernels import contraction as kernels_contraction

UNIT = 2.0**-102


def floats(entries):
    return np.asarray(entries, dtype=object).astype(np.float64)


# -- counts ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("faults", report_bounds.CORRECTIONS.values())
@pytest.mark.parametrize(("k", "n", "m"), [(1, 1, 1), (3, 2, 1), (4, 3, 5), (17, 10, 2), (3_153_600, 10, 2)])
def test_coefficients_are_those_derived(faults, k, n, m):
    c, d = derivation.ONCE if faults.get("once") else derivation.TWICE
    g = derivation.GROWTH if faults.get("carried") else sp.S.Zero
    first = derivation.count_start(c, g)
    second = derivation.second_coefficient(c, d, g, 1 if faults.get("free_signs") else -1)
    values = {derivation.K: k, derivation.N: n, derivation.M: m}
    assert report_bounds.coefficients(k, n, m, **faults) == (first.subs(values), second.subs(values))


@pytest.mark.parametrize(
    "faults", [{}, {"once": True}, {"free_signs": True}, {"carried": True}, {"once": True, "carried": True}]
)
def test_coefficients_are_sums_over_steps(faults):
    k, n, m = 7, 3, 2
    grow = 3 * n + m + 2 if faults.get("carried") else 0
    extra = 0 if faults.get("once") else 1
    c = [6 * n + 3 * m + 5 + extra * (n + 1) + grow * j for j in range(k)]
    d = [4 * n + 3 * m + 4 + extra + grow * j for j in range(k)]
    a0 = sum(c)
    a = [sum(c[i + 1 :]) + d[i] for i in range(k)]
    sign = 1 if faults.get("free_signs") else -1
    assert report_bounds.coefficients(k, n, m, **faults) == (a0, sum(a0 + sign * each for each in a))


def test_the_printed_cases():
    n, m = 4, 3
    assert report_bounds.coefficients(3, n, m) == (3 * (7 * n + 3 * m + 6), 30 * n + 9 * m + 21)
    assert report_bounds.coefficients(4, n, m).second == 4 * (3 * n + 1) + 6 * (7 * n + 3 * m + 6)
    assert (
        report_bounds.prediction_count(n),
        report_bounds.covariance_count(n, m),
        report_bounds.gain_count(n, m),
    ) == (9, 17, 25)
    assert (report_bounds.transition_count(n, m), report_bounds.input_count(n, m)) == (38, 29)


@pytest.mark.parametrize("numbers", [(0, 1, 1), (1, 0, 1), (1, 1, 0)])
def test_coefficients_refuse_nothing(numbers):
    with pytest.raises(ValueError, match="needed each at least 1"):
        report_bounds.coefficients(*numbers)


def test_printed_bounds_of_covariance_and_gain():
    beta = Fraction(1, 1000)
    assert report_bounds.printed_covariance_bound([[2, -1], [-1, 3]], 1, beta).tolist() == [
        [Fraction(18, 1000), Fraction(9, 1000)],
        [Fraction(9, 1000), Fraction(27, 1000)],
    ]
    assert report_bounds.printed_gain_bound([[2], [-1]], beta).tolist() == [[Fraction(26, 1000)], [Fraction(13, 1000)]]


def test_the_least_b():
    F = [exact([["1/2", 0], ["1/2", 2]]), exact([[0, 0], [0, 1]])]
    u = [exact([3, -5]), exact([0, 1])]
    assert report_bounds.printed_input_bound(F, u) == 5 * 2
    assert report_bounds.printed_input_bound([f / 4 for f in F], u) == 5
    assert report_bounds.state_bound(
        Fraction(3), Fraction(2), Fraction(1, 10), report_bounds.Coefficients(5, 7)
    ) == Fraction(29, 10)
    with pytest.raises(ValueError, match="got 2 transitions and 1 inputs"):
        report_bounds.printed_input_bound(F, u[:1])
    with pytest.raises(ValueError, match="at least one"):
        report_bounds.printed_input_bound([], [])


# -- the closing example --------------------------------------------------------------------------


@pytest.mark.parametrize(("base", "rounding"), [(2, Rounding.NEAREST), (10, Rounding.NEAREST), (10, Rounding.CHOP)])
@pytest.mark.parametrize("coefficient", [1, 82, 999_999, 10**9, Fraction(1, 7)])
def test_required_precision_is_enough_and_the_least(base, rounding, coefficient):
    t = report_bounds.precision_for_coefficient(coefficient, Fraction(1, 3), base, rounding)
    assert coefficient * FloatFormat(base, t, rounding).unit_roundoff <= Fraction(1, 3)
    assert t == 1 or coefficient * FloatFormat(base, t - 1, rounding).unit_roundoff > Fraction(1, 3)


@pytest.mark.parametrize(("coefficient", "tolerance"), [(0, 1), (1, 0), (-1, 1)])
def test_required_precision_needs_positive_numbers(coefficient, tolerance):
    with pytest.raises(ValueError, match="needed both positive"):
        report_bounds.precision_for_coefficient(coefficient, tolerance)


def test_the_closing_example():
    first, second = report_bounds.coefficients(*report_bounds.EXAMPLE)
    assert (first, second) == (258_595_200, 407_752_879_824_000)
    assert (report_bounds.precision_for_coefficient(first), report_bounds.precision_for_coefficient(second)) == (10, 16)
    assert report_bounds.precision_for_coefficient(second, base=2) == 49  # IEEE double has 53


def test_which_misprint_leads_to_which_printed_number():
    k, n, m = report_bounds.EXAMPLE
    printed = report_bounds.PRINTED
    assert not prints_as(report_bounds.coefficients(k, n, m).first, printed["first coefficient"])
    assert report_bounds.one_digit_misprints(k, n, m, printed["first coefficient"]) == [(7, 4, 6), (7, 3, 8)]
    assert prints_as(report_bounds.read_as_product(k, n, m, 84), printed["second coefficient"])
    assert not prints_as(report_bounds.read_as_product(k, n, m), printed["second coefficient"])
    for name in ("first", "second"):
        assert prints_as(1 / Fraction(printed[f"{name} coefficient"]), printed[f"{name} beta"])


def test_the_order_of_the_equations():
    found = report_bounds.order(second=False)
    for equation, needs in report_bounds.dependencies(second=False).items():
        assert all(found.index(need) < found.index(equation) for need in needs)
    assert report_bounds.order(second=True) is None


# -- one exact step -------------------------------------------------------------------------------


def test_a_step_worked_by_hand():
    step = exact_step.exact_step([[2]], [[1]], [[1]], [[4]], [3], [["3/4"]], [10])
    assert step.predicted.tolist() == [[4]]  # 2 · 3/4 · 2 + 1
    assert step.gain.tolist() == [[Fraction(1, 2)]]
    assert (step.P.tolist(), step.x.tolist(), step.innovation.tolist()) == ([[2]], [8], [4])
    assert (step.transition.tolist(), step.innovation_covariance.tolist()) == ([[1]], [[8]])


def test_a_step_is_singular():
    with pytest.raises(np.linalg.LinAlgError, match="singular"):
        exact_step.exact_step([[1]], [[1]], [[0]], [[0]], [0], [[0]], [0])


# -- the contraction bound ------------------------------------------------------------------------


def model(rng, n, m):
    """A random model in few digits, its closed loop neither slow nor fast, of various scales."""
    scale = exact(np.diag([Fraction(10) ** int(e) for e in rng.integers(-3, 4, n)]))
    inverse = exact(np.diag([1 / scale[i, i] for i in range(n)]))
    Phi = scale @ (exact(rng.integers(-9, 10, (n, n))) / (5 * n) + Fraction(1, 2) * np.eye(n, dtype=int)) @ inverse
    H = exact(rng.integers(-9, 10, (m, n))) @ inverse
    Q = scale @ exact(np.diag(rng.integers(0, 3, n))) @ scale / 100
    R = exact(np.diag(10 ** rng.integers(0, 3, m))) / 10
    root = exact(rng.integers(-3, 4, (n, n)))
    P = scale @ (root @ root.T + 1 * np.eye(n, dtype=int)) @ scale
    return Phi, H, Q, R, scale[np.arange(n), np.arange(n)] * rng.integers(-9, 10, n), P


def shortened(entries, digits=240):
    """Fractions near these that do not grow: far below all that is bounded here."""
    flat = [Fraction(round(x * 2**digits), 2**digits) for x in np.asarray(entries, dtype=object).flat]
    return np.array(flat, dtype=object).reshape(np.shape(entries))


def trajectory(rng, n, m, size, steps=8, disturb="random"):
    """Errors and bounds of a filter disturbed at each step by about `size`, at random or so that it adds up."""
    *given, x, P = model(rng, n, m)
    plain = [floats(each) for each in given]
    x0 = x + exact(floats(x) * size * rng.uniform(-1, 1, n))
    dE = exact(np.diag(floats(P).diagonal() * size))
    bound = contraction.contraction_start(floats(P), np.abs(floats(x0 - x)), np.abs(floats(dE)))
    run, truth = (x0, P + dE), (x, P)
    for _ in range(steps):
        z = exact(rng.integers(-99, 100, m))
        here, true = exact_step.exact_step(*given, *run, z), exact_step.exact_step(*given, *truth, z)
        spread = np.sqrt(floats(here.P).diagonal())
        if disturb == "random":
            q, T = rng.uniform(-1, 1, n) * spread, rng.uniform(-1, 1, (n, n)) * np.outer(spread, spread)
        else:
            q, T = np.sign(floats(here.x - true.x) + 1e-300) * spread, np.outer(spread, spread)
        x = shortened(here.x + exact(q * size))
        P = shortened(here.P + exact((T + T.T) * size / 2))
        K, S = floats(here.gain), floats(here.innovation_covariance)
        d = contraction.evaluation_errors(*plain, floats(run[0]), floats(run[1]), floats(z), K, S, UNIT)
        dq, dT, dK, dv = d
        bound = contraction.contraction_step(
            bound, *plain, K, S, floats(here.innovation), floats(x - here.x), floats(P - here.P), dq, dT, dK, dv
        )
        used = shortened(here.gain * (1 + exact(size)))
        yield (
            (floats(x - true.x), contraction.state_error_bound(bound)),
            (floats(P - true.P), contraction.covariance_error_bound(bound)),
            (floats(used - true.gain), contraction.gain_error_bound(bound, K, floats(used), dK)),
        )
        run, truth = (x, P), (shortened(true.x), shortened((true.P + true.P.T) / 2))


@pytest.mark.parametrize("disturb", ["random", "adding up"])
@pytest.mark.parametrize("size", [1e-2, 1e-4, 1e-8, 1e-14])
@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 1), (3, 2)])
def test_no_trajectory_exceeds_the_bound_and_some_come_near(n, m, size, disturb):
    rng = np.random.default_rng([n, m, int(-np.log10(size))])
    ratios = []
    for _ in range(3):
        for pairs in trajectory(rng, n, m, size, disturb=disturb):
            for error, bound in pairs:
                assert np.all(np.abs(error) <= bound)
            error, bound = pairs[0]
            ratios.append((np.abs(error) / bound).max())
    # Within a factor of 50, but where the covariance is so disturbed that the gain is hardly known.
    assert max(ratios) > (1 / 50 if size < 1e-2 else 1 / 1000)


def test_without_disturbance_the_bound_is_what_the_evaluation_may_err():
    rng = np.random.default_rng(5)
    for pairs in trajectory(rng, 2, 1, 0.0):
        for error, bound in pairs[:2]:
            assert np.all(error == 0) or np.all(np.abs(error) <= bound)
            assert bound.max() < 1e-20 * 1e8  # the scales of the model reach 1e3, squared 1e6


def scalar_step(bound, q=0.0, T=0.0, d=0.0, P=1.0, R=1.0):
    one = np.ones((1, 1))
    S = one * (P + R)
    K = one * P / S if S[0, 0] else one
    return contraction.contraction_step(
        bound,
        one,
        one,
        one * 0,
        one * R,
        K,
        S,
        np.ones(1),
        np.full(1, q),
        one * T,
        np.full(1, d),
        one * d,
        one * 0,
        np.zeros(1),
    )


def test_the_recursion_of_one_state():
    # P = 1, R = 1: S = 2, K = A = 1/2, P after = 1/2, in units of the standard deviations sqrt(1) and sqrt(1/2).
    start = contraction.contraction_start(np.ones((1, 1)), np.full(1, 1e-6), np.full((1, 1), 1e-7))
    assert (start.eta, start.zeta) == pytest.approx((1e-6, 1e-7), rel=1e-12)
    after = scalar_step(start, q=3e-6, T=5e-7)
    alpha = 0.5 / 0.5**0.5
    assert after.L[0, 0] == pytest.approx(0.5**0.5, rel=1e-14)
    assert after.alpha == pytest.approx(alpha, rel=1e-3)
    g = y = 0.5
    assert after.zeta == pytest.approx(5e-7 / 0.5 + after.alpha**2 * 1e-7 / (1 - g * 1e-7), rel=1e-12)
    assert after.eta == pytest.approx(3e-6 / 0.5**0.5 + after.alpha * (1e-6 + y * 1e-7) / (1 - g * 1e-7), rel=1e-12)
    assert after.gain[0] == pytest.approx(after.alpha * 1e-7 * 0.5, rel=1e-6)
    assert contraction.state_error_bound(after)[0] == pytest.approx(after.eta * 0.5**0.5, rel=1e-12)
    assert contraction.covariance_error_bound(after)[0, 0] == pytest.approx(after.zeta * 0.5, rel=1e-12)


def test_errors_of_the_evaluation_enter():
    start = contraction.contraction_start(np.ones((1, 1)), np.zeros(1), np.zeros((1, 1)))
    after = scalar_step(start, d=1e-9)
    assert after.eta == pytest.approx(1e-9 / 0.5**0.5, rel=1e-6)
    assert after.zeta == pytest.approx(1e-9 / 0.5, rel=1e-6)


@pytest.mark.parametrize("change", [{"q": np.nan}, {"T": np.inf}, {"d": np.nan}, {"R": -1.0}, {"P": np.nan}], ids=str)
def test_nothing_known_is_infinite_and_stays_so(change):
    start = contraction.contraction_start(np.ones((1, 1)), np.zeros(1), np.zeros((1, 1)))
    after = scalar_step(start, **change)
    assert after.eta == after.zeta == np.inf
    later = scalar_step(after)
    assert later.eta == later.zeta == np.inf
    assert np.all(contraction.state_error_bound(later) == np.inf)


def test_a_covariance_that_is_far_off_gives_no_bound():
    start = contraction.contraction_start(np.ones((1, 1)), np.zeros(1), np.full((1, 1), 2.5))
    assert scalar_step(start).eta == np.inf
    nearer = contraction.contraction_start(np.ones((1, 1)), np.zeros(1), np.full((1, 1), 1.5))
    assert scalar_step(nearer).eta < np.inf


def test_a_singular_start_is_weighted_all_the_same():
    P = np.array([[1.0, 1.0], [1.0, 1.0]])
    start = contraction.contraction_start(P, np.full(2, 1e-6), np.zeros((2, 2)))
    assert start.eta < np.inf
    assert np.all(contraction.state_error_bound(start) >= 1e-6)
    assert np.all(np.linalg.matrix_rank(start.L) == 2)


def test_evaluation_errors_cover_what_float64_does():
    rng = np.random.default_rng(6)
    for _ in range(40):
        *given, x, P = model(rng, 3, 2)
        z = exact(rng.integers(-99, 100, 2))
        Phi, H, Q, R, x1, P1, z1 = map(floats, (*given, x, P, z))
        stored = [exact(each) for each in (Phi, H, Q, R, x1, P1, z1)]
        true = exact_step.exact_step(*stored)
        Pp = Phi @ P1 @ Phi.T + Q
        S = H @ Pp @ H.T + R
        L = np.linalg.cholesky((S + S.T) / 2)
        K = np.linalg.solve(L.T, np.linalg.solve(L, H @ Pp)).T
        v = z1 - H @ (Phi @ x1)
        x2, P2 = Phi @ x1 + K @ v, Pp - K @ (H @ Pp)
        dq, dT, dK, dv = contraction.evaluation_errors(Phi, H, Q, R, x1, P1, z1, floats(true.gain), S, 2.0**-53)
        for computed, right, allowed in (
            (x2, true.x, dq),
            ((P2 + P2.T) / 2, true.P, dT),
            (K, true.gain, dK),
            (v, true.innovation, dv),
        ):
            assert np.all(abs(exact(computed) - right) <= exact(allowed))


@pytest.mark.parametrize("n", [1, 2, 5, 10])
def test_the_spectral_norm_is_bounded_from_above_and_sharply(n):
    rng = np.random.default_rng(n)
    for _ in range(10):
        Z = rng.standard_normal((n, n))
        for scale in (0.5, 0.999999, 1.0, 3.0):
            X = Z / np.linalg.svd(Z)[1][0] * scale
            top = np.linalg.svd(X)[1][0]
            found = kernels_contraction._norm2(X)
            # Its square is sharp to a thousandth of its distance from 1, relatively; numpy's own error is below 1e-13.
            assert top * (1 - 1e-13) <= found <= top * (1 + 0.6e-3 * abs(1 - top**2)) + 1e-11


def test_a_companion_bounds_by_the_triangle():
    assert np.all(contraction.companion_bound([-3.0, 0.0], [1.0, 2.0]) >= [4.0, 2.0])
    assert contraction.companion_bound(np.array([-3.0]), np.array([1.0]))[0] == pytest.approx(4)


# -- the smallest filters -------------------------------------------------------------------------

FORMATS = [
    FloatFormat(b, t, rounding)
    for b in (2, 3, 10, 16)
    for t in (2, 4, 9, 17)
    for rounding in Rounding.documented()
    if b**t > 40
]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_the_smallest_filter_breaks_the_bounds_by_the_derived_factors_in_every_format(fmt):
    case, beta = smallest.scalar(fmt), fmt.unit_roundoff
    x, K, P = smallest.rounded_step(fmt, case)
    assert (x[0], K[0, 0], P[0, 0]) == (0, 1, 0)
    x, K, P = smallest.rounded_step(fmt, case, second=True)
    assert (x[0], K[0, 0], P[0, 0]) == (1, 0, 0)
    first, second = smallest.ratios(fmt, case), smallest.ratios(fmt, case, second=True)
    assert first.covariance == second.covariance == float(1 / (6 * beta))
    assert second.gain == float(1 / (9 * beta))
    assert first.state == float(1 / (16 * beta))
    assert second.state == float(1 / (16 * beta * case.R[0, 0]))
    assert first.gain < 1


def test_more_steps_and_more_states():
    four = FloatFormat(10, 4)
    later = smallest.ratios(four, smallest.scalar(four), steps=2)
    assert later.gain == float(1 / (9 * four.unit_roundoff))
    assert smallest.ratios(four, smallest.scalar(four), steps=3).state == float(1 / (48 * four.unit_roundoff))
    # (4n + 2m + 3) β = 13 β, and the first entry of the gain is lost.
    assert smallest.ratios(four, smallest.correlated()).gain == float(1 / (13 * four.unit_roundoff))


def test_nothing_is_broken_where_nothing_cancels():
    four = FloatFormat(10, 4)
    for second in (False, True):
        assert max(smallest.ratios(four, smallest.scalar(four, r=9), second)) < 1


@pytest.mark.parametrize("second", [False, True])
@pytest.mark.parametrize("fmt", [FloatFormat(10, 2), FloatFormat(2, 6)], ids=str)
def test_the_largest_violating_noise_is_the_largest(fmt, second):
    found = smallest.largest_violating_noise(fmt, second)
    numbers = {Fraction(d, fmt.base ** (fmt.precision - 1 + e)) for e in range(3) for d in range(1, 100)}
    for name, largest in found.items():
        assert getattr(smallest.ratios(fmt, smallest.scalar(fmt, largest), second), name) > 1
        for r in numbers:
            if largest < r <= 1 and fmt.round(r) == r:
                assert getattr(smallest.ratios(fmt, smallest.scalar(fmt, r), second), name) <= 1


def test_a_step_of_more_measurements_is_refused():
    case = smallest.scalar(FloatFormat(10, 4))._replace(H=exact([[1], [1]]))
    with pytest.raises(ValueError, match="got 2 measurements; needed one"):
        smallest.rounded_step(FloatFormat(10, 4), case)
