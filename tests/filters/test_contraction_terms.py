"""Every term of the contraction bound, of one state, in exact fractions: none can be dropped unseen.

The bound's allowance for its own roundings is some 1e-14. Here it is 1/64 in its place, so that every term that has it
as a factor is seen. All numbers are such that the weights are rational.
"""

from __future__ import annotations

from fractions import Fraction as F

import numpy as np
import pytest
from exact_terms import plain

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


PLUS, FIRST, SECOND, MINUS = np.diag([1.0, 1.0]), np.diag([-1.0, 1.0]), np.diag([1.0, -1.0]), np.diag([-1.0, -1.0])
