"""Every term of the contraction bound, of one state, in exact fractions: none can be dropped unseen.

The bound's allowance for its own roundings is some 1e-14. Here it is 1/64 in its place, so that every term that has it
as a factor is seen. All numbers are such that the weights are rational.
"""

from __future__ import annotations

from fractions import Fraction as F

import numpy as np
import pytest
from exact_terms import plain

from gpbnb.filters import contraction
from gpbnb.filters import contraction as kernels
from gpbnb.filters.contraction import Contraction

SHARE = F(1, 64)
NAMES = ("_add_products", "_bound_norms2", "_is_positive", "_propagate_weights", "_weights")


@pytest.fixture
def kernel(monkeypatch):
    for name in NAMES:
        monkeypatch.setattr(kernels, name, plain(getattr(kernels, name)))
    monkeypatch.setattr(kernels, "_many", lambda n, m: float(SHARE))
    return kernels


def one(value):
    return np.full((1, 1), float(value))


def array(value):
    return np.full(1, float(value))


def same(found, expected):
    assert float(np.asarray(found).ravel()[0]) == pytest.approx(float(expected), rel=1e-13, abs=0)


def test_start(kernel):
    found = kernel.contraction_start(one(F(9, 4)), array(F(1, 3)), one(F(1, 5)))
    delta = SHARE  # of 1/L times L, whose distance from 1 is zero
    weight = F(2, 3)
    same(found.L, F(3, 2))
    same(found.eta, weight * F(1, 3) / (1 - delta) * (1 + SHARE))
    same(found.zeta, weight**2 * F(1, 5) / (1 - delta) ** 2 * (1 + SHARE))


# A = Φ − KHΦ = 3/8, and AL = 3/16; C = 1 − KH = 1/4, K²R + C²Q = 1/16 of 3 · 3/16 + 1/4 …: W = (5/16)² below.
PHI, H, K, L = F(3, 2), F(3, 4), F(1), F(1, 2)
R = F(1, 32)
Q = 16 * (F(5, 16) ** 2 - F(3, 16) ** 2 - R)
S, NU, Q1, T = F(7, 2), F(-5, 3), F(-1, 7), F(1, 11)
DQ, DT, DK, DNU = F(1, 13), F(1, 17), F(1, 19), F(1, 23)
ETA, ZETA = F(1, 3), F(1, 5)


def expected():
    M, up, delta = SHARE, 1 + SHARE, SHARE
    A, Y = PHI - K * H * PHI, F(16, 5)
    spread = (PHI + K * H * PHI) * L * M + DK * H * PHI * L
    spectral = F(float(kernels._norm2(one(Y * A * L))))
    alpha = (spectral + Y * spread) / (1 - delta)
    inverse, dinverse = 1 / S, 2 * M / S
    HL = H * PHI * L
    N, dN = HL * inverse, HL * (dinverse + M * inverse)
    g = N * HL + dN * HL + M * N * HL
    dnu = DNU + M * abs(NU)
    y = abs(N * NU) + dN * (abs(NU) + dnu) + N * dnu
    size_q = (Y * abs(Q1) + Y * (DQ + M * abs(Q1))) / (1 - delta)
    size_T = (Y**2 * T + Y**2 * (DT + M * T)) / (1 - delta) ** 2
    known = 1 - g * ZETA * up
    return {
        "L": F(5, 16),
        "alpha": alpha,
        "eta": (size_q + alpha * (ETA + y * ZETA) / known) * up,
        "zeta": (size_T + alpha**2 * ZETA / known) * up,
        "gain": (N + dN) * alpha * ZETA / known * up,
    }


def test_step(kernel):
    assert F(3, 8) == PHI - K * H * PHI
    before = Contraction(one(L), float(ETA), float(ZETA), 1.0, np.zeros(1))
    found = kernel.contraction_step(
        before,
        (one(PHI), one(H), one(Q), one(R)),
        (one(K), one(S), array(NU), array(Q1), one(T)),
        (array(DQ), one(DT), one(DK), array(DNU)),
    )
    for name, value in expected().items():
        same(getattr(found, name), value)
    # The estimate of the spectral norm is from above.
    assert expected()["alpha"] > F(16, 5) * F(3, 16)


@pytest.mark.parametrize(("zeta", "lost"), [(F(3, 2), False), (F(19, 10), True)])
def test_the_gain_is_known_as_long_as_the_roundings_allow(kernel, zeta, lost):
    """Without its roundings, g ζ is below 1 with both: only with them the second bound is lost."""
    before = Contraction(one(L), float(ETA), float(zeta), 1.0, np.zeros(1))
    zero, nothing = array(0), one(0)
    S = 2 * (H * PHI * L) ** 2
    model, step = (one(PHI), one(H), one(Q), one(R)), (one(K), one(S), array(NU), zero, nothing)
    found = kernel.contraction_step(before, model, step, (zero, nothing, nothing, zero))
    exact = (H * PHI * L) ** 2 / S * zeta
    assert exact < 1
    assert (exact * (1 + 4 * SHARE) * (1 + SHARE) >= 1) is lost
    assert (found.eta == np.inf) is lost
    assert (found.zeta == np.inf) is lost
    assert np.isinf(found.gain).tolist() == [lost]


def test_evaluation_errors(kernel):
    unit = F(1, 4096)
    x, P, z = F(-3, 5), F(2, 7), F(4, 9)
    found = kernel.evaluation_errors(
        (one(-PHI), one(-H), one(Q), one(R)), array(x), one(P), array(z), one(-K), one(S), float(unit)
    )
    many = (16 * 2 + 64) * unit * (1 + SHARE)
    predicted = PHI * P * PHI + Q
    PH = predicted * H
    size = H * PH + R
    aS = (1 + 2 * SHARE) / S
    dK = many * (PH + PH * aS * size) * aS
    left = 1 + K * H
    dT = many * (left * predicted * left + K * R * K) + 2 * dK * PH * left + 2 * left * PH * dK
    seen = abs(z) + H * PHI * abs(x)
    dq = many * (PHI * abs(x) + K * seen) + dK * seen
    for value, exact in zip(found, (dq, dT, dK, many * seen), strict=True):
        same(value, exact)


def test_errors_in_units(kernel):
    bound = Contraction(one(L), float(ETA), float(ZETA), 1.0, array(F(1, 7)))
    same(kernel.state_error_bound(bound), L * ETA * (1 + SHARE))
    same(kernel.covariance_error_bound(bound), ZETA * (L * (1 + SHARE)) ** 2)


def test_errors_of_two_states_go_with_the_rows_of_the_weights(kernel):
    bound = Contraction(np.array([[2.0, 0.0], [3.0, 4.0]]), float(ETA), float(ZETA), 1.0, np.zeros(1))
    up = float(1 + SHARE)
    state = kernel.state_error_bound(bound)
    assert state == pytest.approx([2 * float(ETA) * up, 5 * float(ETA) * up], rel=1e-13)
    square = float(ZETA) * up**2
    found = kernel.covariance_error_bound(bound)
    assert found == pytest.approx(square * np.array([[4.0, 10.0], [10.0, 25.0]]), rel=1e-13)


def test_error_of_the_gain(kernel, monkeypatch):
    monkeypatch.setattr(kernels, "_U", 1 / 32)
    bound = Contraction(one(L), float(ETA), float(ZETA), 1.0, array(F(1, 7)))
    used = F(4, 3)
    found = kernel.gain_error_bound(bound, one(K), one(used), one(DK))
    same(found, (abs(used - K) + DK + F(1, 32) * (used + K) + L * F(1, 7)) * (1 + SHARE))


def test_allowance_for_roundings():
    assert kernels._many(3, 2) == (16 * 5 + 64) * 2.0**-53
    assert kernels._U == 2.0**-53


def test_inverses(kernel):
    Y, delta = kernel._inverse(one(F(3, 2)))
    same(Y, F(2, 3))
    # The product is 1 to a rounding; what is left is the allowance times |Y| |L|.
    assert delta == pytest.approx(float(SHARE), rel=1e-12)
    lower = np.array([[2.0, 0.0], [6.0, 4.0]])
    Y, delta = kernel._inverse(lower)
    assert np.array_equal(Y, [[0.5, 0.0], [-0.75, 0.25]])
    assert delta == pytest.approx(float(SHARE) * np.linalg.norm([[1.0, 0.0], [3.0, 1.0]]), rel=1e-13)
    S = np.array([[0.5, 4.0], [2.0, 0.0]])  # rows are exchanged
    Y, error = kernel._inverse_general(S)
    assert np.array_equal(Y, [[0.0, 0.5], [0.25, -0.0625]])
    # |Y| |S| is 1 and 0, 0.25 and 1: the largest row sum times the allowance, twice.
    assert error == pytest.approx(2 * 1.25 * float(SHARE) * np.abs(Y).sum(axis=0) * np.ones((2, 2)), rel=1e-13)


def test_the_spectral_norm_allows_for_its_elimination(monkeypatch):
    monkeypatch.setattr(kernels, "_U", 1e-6)
    for name in ("_bound_norms2", "_is_positive"):
        monkeypatch.setattr(kernels, name, plain(getattr(kernels, name)))
    found = kernels._norm2(np.diag([1.0, 0.25]))
    high = 1 + 1e-11
    least = np.sqrt(1 * (1 + 4 * 2 * 4 * 1e-6) + 4 * 4 * 1e-6 * 1.0625) * (1 + 4e-6)
    most = np.sqrt(high * (1 + 4 * 2 * 4 * 1e-6) + 4 * 4 * 1e-6 * 1.0625) * (1 + 4e-6)
    assert least <= found <= most * (1 + 1e-12)


def test_a_companion_takes_its_roundings_in(monkeypatch):
    found = contraction.companion_bound([1.0], [2.0**-53])[0]
    assert F(found) > 1 + F(1, 2**53)  # 1 + 2**-53 rounds to 1
    monkeypatch.setattr(contraction, "_U", 1 / 64)
    same(contraction.companion_bound([-3.0], [0.25]), F(13, 4) * (1 + F(4, 64)))


def test_evaluation_errors_of_two_states_and_measurements(kernel):
    """As for one; an asymmetric covariance counts with the larger of two entries, and sizes of S with all pivots."""
    unit = F(1, 4096)
    Phi = [[F(3, 2), F(-1, 4)], [F(1, 8), F(1, 2)]]
    H = [[F(3, 4), F(1, 2)], [F(-1, 4), F(2)]]
    K = [[F(1, 2), F(-1, 8)], [F(1, 4), F(3, 8)]]
    Q, R, P = ([[F(a), F(b)], [F(c), F(d)]] for a, b, c, d in ((2, -1, -1, 3), (1, 0, 0, 4), (5, 1, -2, 6)))
    S = [[F(8), F(0)], [F(0), F(-4)]]
    x, z = [F(-3, 5), F(7, 8)], [F(4, 9), F(-2)]
    floats = [np.array(each, dtype=object).astype(float) for each in (Phi, H, Q, R, x, P, z, K, S)]
    found = kernel.evaluation_errors(floats[:4], *floats[4:], float(unit))
    aPhi, aH, aK, aQ, aR, ax, az = (abs(np.array(each, dtype=object)) for each in (Phi, H, K, Q, R, x, z))
    many = (16 * (2 + 2) + 64) * unit * (1 + SHARE)
    predicted = aPhi @ np.array([[F(5), F(2)], [F(2), F(6)]]) @ aPhi.T + aQ
    PH = predicted @ aH.T
    sizes = aH @ PH + aR
    pivots = np.array([[np.sqrt(float(sizes[i, i] * sizes[j, j])) for j in range(2)] for i in range(2)])
    # |Y| |S| is the identity: the largest row sum of the allowance is one share.
    aS = np.array([[F(1, 8), F(0)], [F(0), F(1, 4)]]) + 2 * SHARE * np.array([[F(1, 8), F(1, 4)]] * 2)
    dK = many * (PH + 2 * PH @ aS @ pivots) @ aS
    left = np.eye(2, dtype=int) + aK @ aH
    dT = many * (left @ predicted @ left.T + aK @ aR @ aK.T) + 2 * dK @ PH.T @ left.T + 2 * left @ PH @ dK.T
    seen = az + aH @ aPhi @ ax
    dq = many * (aPhi @ ax + aK @ seen) + dK @ seen
    for value, exact in zip(found, (dq, dT, dK, many * seen), strict=True):
        assert value == pytest.approx(np.asarray(exact, dtype=float), rel=1e-12)
    turned = [floats[:4], floats[4], floats[5].T, *floats[6:]]
    for value, other in zip(found, kernel.evaluation_errors(*turned, float(unit)), strict=True):
        assert np.array_equal(value, other)


def test_distances_of_inverses_from_exact_ones(kernel, monkeypatch):
    """1/49 times 49 is not 1 in float64; without other allowances, this is left."""
    monkeypatch.setattr(kernel, "_many", lambda n, m: 0.0)
    assert (1 / 49) * 49 == 1 - 2.0**-53
    assert kernel._inverse(one(49))[1] == 2.0**-53
    Y, error = kernel._inverse_general(one(49))
    assert error == 2 * 2.0**-53 * (1 / 49)
    assert abs(F(Y[0, 0]) - F(1, 49)) <= F(error[0, 0])


def test_the_largest_row_counts_in_an_inverse(kernel):
    S = np.array([[0.0, 2.0], [4.0, 0.5]])
    Y, error = kernel._inverse_general(S)
    assert np.array_equal(Y, [[-0.0625, 0.25], [0.5, 0.0]])
    # |Y| |S| is 1 and 0.25, 0 and 1: here the first row sum is the largest.
    assert error == pytest.approx(2 * 1.25 * float(SHARE) * np.abs(Y).sum(axis=0) * np.ones((2, 2)), rel=1e-13)


def test_an_inverse_of_three_rows(kernel, monkeypatch):
    """Two eliminations below and above each pivot; 67 times the inverse is integer."""
    monkeypatch.setattr(kernel, "_many", lambda n, m: 2.0**-46)
    S = np.array([[4.0, 2.0, 1.0], [2.0, 5.0, 3.0], [1.0, 3.0, 6.0]])
    exact = [[F(21, 67), F(-9, 67), F(1, 67)], [F(-9, 67), F(23, 67), F(-10, 67)], [F(1, 67), F(-10, 67), F(16, 67)]]
    Y, error = kernel._inverse_general(S)
    for i in range(3):
        for j in range(3):
            assert sum(exact[i][k] * F(S[k, j]) for k in range(3)) == (i == j)
            assert abs(F(Y[i, j]) - exact[i][j]) <= F(error[i, j]) < 1e-12


@pytest.mark.parametrize("S", [[[6, 1], [9, 2]], [[9, 2], [6, 1]], [[3, 1], [9, 4]], [[7, 10], [7, 11]]])
def test_the_inverse_counts_as_one_from_the_left(kernel, monkeypatch, S):
    """Here SY is the identity in float64 although Y is not the inverse, so that only YS tells of the error."""
    monkeypatch.setattr(kernel, "_many", lambda n, m: 0.0)
    (a, b), (c, d) = S
    Y, error = kernel._inverse_general(np.array(S, dtype=float))
    assert np.array_equal(np.array(S) @ Y, np.eye(2))
    exact = [[F(d, a * d - b * c), F(-b, a * d - b * c)], [F(-c, a * d - b * c), F(a, a * d - b * c)]]
    off = [[abs(F(Y[i, j]) - exact[i][j]) for j in range(2)] for i in range(2)]
    assert max(max(row) for row in off) > 0
    assert all(off[i][j] <= F(error[i, j]) for i in range(2) for j in range(2))


def test_only_a_positive_matrix_counts_as_one(kernel):
    """The eigenvalues of B are 3.5 and 0.5, its diagonal is 2."""
    B = np.array([[2.0, 1.5], [1.5, 2.0]])
    space = np.empty((2, 2))
    assert [kernel._is_positive(mu, B, space) for mu in (3.4, 3.5, 3.6)] == [False, False, True]
    assert not kernel._is_positive(2.0, B, space)
    root = np.array([[1.0, 1.0], [0.0, 1.0]])
    golden = (1 + np.sqrt(5)) / 2
    assert golden <= kernel._norm2(root) < golden * (1 + 1e-3)


def test_weights_are_a_factor(kernel):
    L = np.array([[2.0, 0.0, 0.0], [3.0, 4.0, 0.0], [-1.0, 2.0, 5.0]])
    found = np.empty((3, 3))
    kernel._weights(L @ L.T, found)
    assert np.array_equal(found, L)


PLUS, FIRST, SECOND, MINUS = np.diag([1.0, 1.0]), np.diag([-1.0, 1.0]), np.diag([1.0, -1.0]), np.diag([-1.0, -1.0])


@pytest.mark.parametrize(
    ("D0", "D1", "E", "sign"),
    [
        (FIRST, PLUS, PLUS, 1),
        (PLUS, SECOND, PLUS, 1),
        (PLUS, PLUS, FIRST, 1),
        (SECOND, FIRST, MINUS, 1),
        (MINUS, SECOND, SECOND, -1),
        (PLUS, PLUS, PLUS, -1),
    ],
)
def test_no_bound_depends_on_the_sign_of_a_state_or_measurement(kernel, D0, D1, E, sign):
    """States before and after the step with other signs, other signs of measurements, and of all residuals."""
    L = np.array([[0.5, 0.0], [0.25, 0.75]])
    Phi, H = np.array([[1.5, -0.25], [0.125, 0.5]]), np.array([[0.75, 0.5], [-0.25, 2.0]])
    Q, R = np.array([[1.0, 0.5], [0.5, 2.0]]), np.array([[2.0, -0.75], [-0.75, 1.0]])
    K, S = np.array([[0.5, -0.125], [0.25, 0.375]]), np.array([[80.0, 12.0], [12.0, -40.0]])
    nu, q, T = np.array([3.0, -2.0]), np.array([-0.5, 0.125]), np.array([[-0.25, 0.125], [0.125, 0.5]])
    errors = np.array([0.01, 0.02]), np.full((2, 2), 0.03), np.full((2, 2), 0.004), np.array([0.05, 0.06])
    x, P, z = np.array([0.5, -3.0]), np.array([[2.0, -0.5], [-0.5, 1.0]]), np.array([4.0, -1.0])
    used = K + np.array([[0.25, -0.5], [-0.125, 0.0625]])
    found = []
    for before, after, seen, s in ((PLUS, PLUS, PLUS, 1), (D0, D1, E, sign)):
        model = after @ Phi @ before, seen @ H @ after, after @ Q @ after, seen @ R @ seen
        gain, known = after @ K @ seen, seen @ S @ seen
        start = Contraction(before @ L @ before, float(ETA), 0.02, 1.0, np.zeros(2))
        residuals = s * seen @ nu, s * after @ q, s * after @ T @ after
        bound = kernel.contraction_step(start, model, (gain, known, *residuals), errors)
        evaluated = kernel.evaluation_errors(
            model, s * before @ x, before @ P @ before, s * seen @ z, gain, known, 2.0**-12
        )
        of_gain = kernel.gain_error_bound(bound, gain, after @ used @ seen, errors[2])
        begun = kernel.contraction_start(before @ P @ before, *errors[:2])
        found.append([bound.eta, bound.zeta, bound.alpha, bound.gain, *evaluated, of_gain, begun.eta, begun.zeta])
    for one_way, other in zip(*found, strict=True):
        assert np.isfinite(one_way).all()
        assert other == pytest.approx(one_way, rel=1e-11)


def test_error_of_a_gain_of_either_sign(kernel, monkeypatch):
    monkeypatch.setattr(kernels, "_U", 1 / 32)
    bound = Contraction(one(L), float(ETA), float(ZETA), 1.0, array(F(1, 7)))
    for true, used in ((F(1), F(-4, 3)), (F(-1), F(4, 3)), (F(-4, 3), F(-1))):
        found = kernel.gain_error_bound(bound, one(true), one(used), one(DK))
        same(found, (abs(used - true) + DK + F(1, 32) * (abs(used) + abs(true)) + L * F(1, 7)) * (1 + SHARE))
