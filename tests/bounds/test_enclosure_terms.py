"""Every term of the bounds that enclose gains, and of what a guarantee adds up, in exact fractions."""

from __future__ import annotations

from fractions import Fraction as F
from operator import add, mul, sub, truediv
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from exact_terms import Distance, fractions
from flint import arb, arb_mat, ctx

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact, inverse_of
from gpbnb.bounds import enclosure, gains
from gpbnb.bounds import guarantee as bound
from gpbnb.bounds.enclosure import Enclosed
from gpbnb.bounds.envelope import Certificate, Disturbances, FilterLimits
from gpbnb.bounds.linear import filter_schedule
from gpbnb.filters.bounded_steps import Bounds
from gpbnb.filters.forms import Form
from gpbnb.filters.system import state_space

UNIT, UP = F(1, 64), F(33, 32)


def same(found: Any, expected: Any, rel: float = 1e-14) -> None:
    assert float(found) == pytest.approx(float(expected), rel=rel, abs=0)


# -- numbers with a bound for their roundings -------------------------------------------------------------------------


@pytest.fixture
def numbers(monkeypatch: pytest.MonkeyPatch) -> tuple[Enclosed, Enclosed]:
    monkeypatch.setattr(enclosure, "_UP", float(UP))
    return Enclosed(arb(3), float(UNIT), 1 / 8), Enclosed(arb(-5), float(UNIT), 1 / 16)


A, B = F(1, 8), F(1, 16)


def rounded(size: F, error: F) -> F:
    return (error + UNIT * (size * UP + error)) * UP


def test_the_errors_of_one_operation(numbers: tuple[Enclosed, Enclosed]) -> None:
    a, b = numbers
    product = (3 * UP * B + 5 * UP * A + A * B) * UP
    quotient = (A + F(3, 5) * B) * UP / (5 / UP - B * UP) * UP**2
    for found, exactly, error in (
        (a + b, -2, rounded(F(2), A + B)),
        (a - b, 8, rounded(F(8), A + B)),
        (a * b, -15, rounded(F(15), product)),
        (a / b, F(-3, 5), rounded(F(3, 5), quotient)),
    ):
        same(found.exactly.mid(), exactly)
        same(found.error, error)
    same(a.size, 3 * UP)
    assert (-a).error == a.error
    exact_three = Enclosed(arb(3), float(UNIT))
    same((exact_three * exact_three).error, rounded(F(9), F(0)))


def test_the_errors_cover_the_worst_operands() -> None:
    """Without the factors for float64, at the ends of both intervals and with the largest rounding."""
    for x, y in ((3.0, 5.0), (-7.0, 0.5), (0.125, -9.0)):
        a, b = Enclosed(arb(x), float(UNIT), 1 / 8), Enclosed(arb(y), float(UNIT), 1 / 16)
        for found, operation in ((a + b, add), (a - b, sub), (a * b, mul), (a / b, truediv)):
            true = operation(F(x), F(y))
            worst = max(
                abs(operation(F(x) + s * A, F(y) + t * B) * (1 + r * UNIT) - true)
                for s in (-1, 1)
                for t in (-1, 1)
                for r in (-1, 1)
            )
            assert worst <= F(found.error)
            assert F(found.error) <= worst * F(3, 2)


# -- one step from a set of covariances -------------------------------------------------------------------------------


PHI, H, Q, R, P = F(3, 4), F(2), F(1, 2), F(1, 4), F(5, 4)


def phase() -> enclosure._Phase:
    """One state: the step from its center, in fractions."""
    V = PHI * P * PHI + Q
    HS = H / (H * V * H + R)
    C = 1 - V * HS * H
    one = lambda x: np.array([[float(x)]])  # noqa: E731
    exact = lambda x: arb_mat([[arb(x.numerator) / arb(x.denominator)]])  # noqa: E731
    return enclosure._Phase(
        (), one(P), exact(C * PHI), exact(V * HS), one(HS), one(PHI * HS * H * PHI), exact(C * V)
    )  # fmt: skip


def given(unit: float) -> list[np.ndarray]:
    return [enclosure.enclosed_numbers(np.array([[x]], dtype=object), unit) for x in (PHI, H, Q, R)]


def chain(form: Form) -> dict[str, F]:
    """Errors of each operation of a step of one state, to first order in an error and with its own rounding."""
    u = UNIT

    def after(size: F, error: F) -> F:
        return error + u * (abs(size) + error)

    V = PHI * P * PHI + Q
    x = after(PHI * P, F(0))
    x = after(PHI * P * PHI, PHI * x)
    error_V = after(V, x)
    HV = after(H * V, F(0))  # V is taken as exact from here on
    S = H * V * H + R
    s = after(S, after(H * V * H, H * HV))
    inverse = after(1 / S, (1 / S) * s / (S - s))
    K = V * H / S
    error_K = after(K, HV / S + H * V * inverse + HV * inverse)
    KH = after(K * H, F(0))
    C = 1 - K * H
    w = after(C, KH)
    if form is Form.INNOVATION:
        return {"V": error_V, "K": error_K, "rounded": after(C * V, w * V)}
    wv = after(C * V, w * V)
    joseph = after(C * V * C, wv * C + C * V * w + wv * w)
    kr = after(K * R, F(0))
    krk = after(K * R * K, kr * K)
    return {"V": error_V, "K": error_K, "rounded": after(C * V * C + K * R * K, joseph + krk)}


@pytest.mark.parametrize("form", enclosure.FORMS)
def test_the_roundings_of_a_step(form: Form, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a single covariance: the balls have the radii of the roundings only, which widen them by a few percent."""
    monkeypatch.setattr(enclosure, "_SUMS", 4.0)
    small = F(1, 2**30)
    monkeypatch.setitem(globals(), "UNIT", small)
    found = enclosure._disturbed(form, phase(), given(float(small)), np.zeros((1, 1)), float(small))
    errors = chain(form)
    V = PHI * P * PHI + Q
    S = H * V * H + R
    C = 1 - V * H * H / S
    of_gain = errors["K"] ** 2 * S if form is Form.JOSEPH else errors["K"] * H * V
    total = errors["rounded"] + of_gain + C * errors["V"] * C
    assert float(total * 4) <= found.covariance[0, 0] * (1 + 1e-6)
    assert found.covariance[0, 0] <= float(total * 4) * (1 + 1e-6) + (1e-15 if form is Form.JOSEPH else 0)
    same(found.gain[0, 0], (C * errors["V"] * H / S + errors["K"]) * 4, 1e-6)


def test_what_a_set_of_covariances_adds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without roundings: the second-order term, and the distance of the gain, for a set so small that balls stay so."""
    monkeypatch.setattr(enclosure, "_SUMS", 4.0)
    radius = F(1, 2**20)
    found = enclosure._disturbed(Form.INNOVATION, phase(), given(0.0), np.array([[float(radius)]]), 0.0)
    V = PHI * P * PHI + Q
    S = H * V * H + R
    C = 1 - V * H * H / S
    second = C * PHI * radius * (PHI * H / S * H * PHI) * radius * C * PHI
    same(found.covariance[0, 0], 4 * second, 1e-3)
    same(found.gain[0, 0], 4 * C * PHI * radius * PHI * H / S, 1e-3)


# -- the set that is never left ---------------------------------------------------------------------------------------


def test_the_set_that_is_never_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """One state: the second trial is the first sum, enlarged by a tenth; each of its terms is seen in it."""
    sums = F(9, 8)
    products, residuals = [F(1), F(1, 2), F(3, 16)], [F(1, 32), F(1, 64)]
    center, after, start, disturbed = F(64), F(65), F(63), F(3)
    array = lambda x: np.array([[float(x)]])  # noqa: E731
    ball = lambda x: arb_mat([[arb(float(x))]])  # noqa: E731
    one = enclosure._Phase((), array(center), ball(F(1, 2)), ball(F(2)), array(1), array(1), ball(after))
    powers = enclosure._Powers([array(x) for x in products], [array(x) for x in residuals])
    monkeypatch.setattr(enclosure, "_SUMS", float(sums))
    monkeypatch.setattr(enclosure, "_phases", lambda *_: [one])
    monkeypatch.setattr(enclosure, "_powers", lambda _: [powers])
    known = enclosure._Disturbed(array(disturbed), array(F(5)))
    monkeypatch.setattr(enclosure, "_disturbed", lambda *_: known)
    run = SimpleNamespace(C=[None, array(start)], G=[array(0), array(F(7, 4))])
    run.exactly = lambda x: np.vectorize(F, otypes=[object])(np.asarray(x))
    stored: Any = SimpleNamespace(cycle=1)
    found = enclosure._enclose(stored, run, 0.0, Form.INNOVATION, 2)
    begun = sums * max(x * abs(start - center) * x for x in products)
    W = disturbed + abs(after - center)

    def step(B: F) -> F:
        total = begun + products[-1] * B * products[-1]
        for M, following, off in zip(products, products[1:], residuals, strict=False):
            total += M * W * M + 2 * off * B * (following + off)
        return total * sums

    trial = 2 * begun
    while step(trial) > trial:
        trial = F(11, 10) * step(trial)
    assert trial > 2 * begun
    assert found is not None
    same(found.covariance[0, 0, 0], trial)
    same(found.gain[0, 0, 0], 5 + abs(F(2) - F(7, 4)) * sums)
    assert found.start == 2


def test_each_phase_of_the_set_takes_up_what_the_phases_before_it_add(monkeypatch: pytest.MonkeyPatch) -> None:
    """One state, two phases, and products of three loops: which phase each of them came from is written out."""
    array = lambda x: np.array([[float(x)]])  # noqa: E731
    ball = lambda x: arb_mat([[arb(float(x))]])  # noqa: E731
    centers, after, disturbed, start = (F(640), F(576)), (F(578), F(643)), (F(5), F(11)), F(639)
    products = [F(1), F(1, 2), F(1, 4), F(3, 16)], [F(1), F(1, 4), F(1, 8), F(1, 32)]
    residuals = [F(1, 32), F(1, 64), F(1, 128)], [F(1, 16), F(1, 128), F(1, 256)]
    phases = [
        enclosure._Phase((), array(c), ball(F(1, 2)), ball(F(2)), array(1), array(1), ball(a))
        for c, a in zip(centers, after, strict=True)
    ]
    powers = [
        enclosure._Powers([array(x) for x in M], [array(x) for x in off])
        for M, off in zip(products, residuals, strict=True)
    ]
    monkeypatch.setattr(enclosure, "_SUMS", 1.0)
    monkeypatch.setattr(enclosure, "_phases", lambda *_: phases)
    monkeypatch.setattr(enclosure, "_powers", lambda _: powers)
    known = [enclosure._Disturbed(array(w), array(gain)) for w, gain in zip(disturbed, (F(5), F(7)), strict=True)]
    monkeypatch.setattr(enclosure, "_disturbed", lambda form, phase, *_: known[phases.index(phase)])
    run = SimpleNamespace(C=[None, None, array(start)], G=[None, array(F(7, 4)), array(F(3))])
    run.exactly = lambda x: np.vectorize(F, otypes=[object])(np.asarray(x))
    stored: Any = SimpleNamespace(cycle=2)
    found = enclosure._enclose(stored, run, 0.0, Form.INNOVATION, 3)
    begun = abs(start - centers[0])
    # A step from phase 0 leads to the center of phase 1, and a step from phase 1 to that of phase 0.
    w0, w1 = 5 + abs(F(578) - 576), 11 + abs(F(643) - 640)

    def step(b0: F, b1: F) -> tuple[F, F]:
        new0 = begun + F(3, 16) ** 2 * b1 + w1 + F(1, 2) ** 2 * w0 + F(1, 4) ** 2 * w1
        new0 += 2 * F(1, 32) * b1 * (F(1, 2) + F(1, 32)) + 2 * F(1, 64) * b0 * (F(1, 4) + F(1, 64))
        new0 += 2 * F(1, 128) * b1 * (F(3, 16) + F(1, 128))
        new1 = begun + F(1, 32) ** 2 * b0 + w0 + F(1, 4) ** 2 * w1 + F(1, 8) ** 2 * w0
        new1 += 2 * F(1, 16) * b0 * (F(1, 4) + F(1, 16)) + 2 * F(1, 128) * b1 * (F(1, 8) + F(1, 128))
        new1 += 2 * F(1, 256) * b0 * (F(1, 32) + F(1, 256))
        return new0, new1

    trial = 2 * begun, 2 * begun
    while any(new > b for new, b in zip(step(*trial), trial, strict=True)):
        trial = tuple(max(F(11, 10) * new, b) for new, b in zip(step(*trial), trial, strict=True))
    assert found is not None
    for j in range(2):
        same(found.covariance[j, 0, 0], trial[j])
    same(found.gain[0, 0, 0], 5 + abs(F(2) - F(7, 4)))
    same(found.gain[1, 0, 0], 7 + abs(F(2) - 3))


# -- a gain that repeats ----------------------------------------------------------------------------------------------


def test_distances_are_rounded_upwards() -> None:
    inverse = arb_mat([[arb(2), arb(0)], [arb(1), arb(3)]])
    change = np.array([[F(1, 3), F(1, 7)], [F(1, 7), F(2)]], dtype=object)
    W = np.array([[F(2), F(0)], [F(1), F(3)]], dtype=object)
    exactly = sum(x * x for x in (W @ change @ W.T).ravel())
    found = F(gains._distance(inverse, change))
    assert exactly < found**2 < exactly * (1 + F(1, 2**47))
    ball = gains._frobenius_to_identity(arb_mat([[arb(2), arb(2)], [arb(-1), arb(5)]]))
    same(ball.mid(), np.sqrt(1 + 4 + 1 + 16), 1e-15)
    assert gains._upper(arb(3, 0.5)) >= 3.5
    assert F(gains._upper(arb(1))) == 1 + F(1, 2**50)


@pytest.mark.parametrize(
    ("end", "weight", "moved", "closes"),
    [
        (2.0, 2.0, 0.0, True), (3.9, 2.0, 0.0, True), (4.1, 2.0, 0.0, False),  # the distance at the end
        (2.0, 2.5, 0.0, True), (2.0, 3.0, 0.0, False),  # in other weights: (1 + 1/2)² of it
        (2.0, 2.0, 7.9, True), (2.0, 2.0, 8.1, False),  # and what the period moved, in units of 2² = 4
        (np.inf, 2.0, 0.0, False),
    ],
)  # fmt: skip
def test_a_distance_closes_with_the_period(
    end: float, weight: float, moved: float, closes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Weights of 2 and a trial of 4 at the beginning of the period."""

    class Run:
        steps, C, bounds = 3, np.full((3, 1, 1), 10.0), Bounds("", "dK", "")

        def __init__(self, *_: Any, bounded: bool = False) -> None:
            self.P, self.taken = np.array([[10.0]]), 0
            self.bound = Distance(np.array([[2.0]]), 1.0)

        def take(self, z: Any) -> None:
            self.taken += 1
            if self.taken == 2:
                assert self.bound.zeta == 4.0
                self.P, self.bound = np.array([[10.0 + moved]]), Distance(np.array([[weight]]), end)

        def exactly(self, x: Any) -> Any:
            return np.vectorize(F, otypes=[object])(x)

    monkeypatch.setattr(gains, "Run", Run)
    stored: Any = SimpleNamespace(m=1)
    run: Any = Run()
    found = gains._closes(stored, run, 0, 2, 4.0, 100)
    assert (found is not None) is closes
    if found is not None:
        kappa = abs(F(weight) / 2 - 1)
        shrinks = 1 - (1 + kappa) ** 2 * F(end) / 4
        same(found.needed, F(11, 10) * max(F(moved) / 4, 0) / shrinks / 1, 1e-12)
        assert found.dK == "dK"


# -- what a guarantee adds up -----------------------------------------------------------------------------------------


def test_sums_of_a_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """One state that repeats every step: the disturbances, and the residuals and the tail times the largest bound."""
    schedule = filter_schedule(state_space([["1/2"]], [["1"]]), FloatFormat(2, 24))
    sums, residual, tail = [F(3), F(1, 2), F(1, 4), F(0)], F(1, 8), F(1, 16)
    one = np.ones((1, 1))
    found = Disturbances(one[None] / 2, one[None] * 0, np.ones((1, 1, 4)), np.ones((1, 4)), one, one, one, one)
    certificate = Certificate(
        np.array([[float(x) for x in sums]]), one * float(residual), one * float(tail), one * 0, 9
    )
    monkeypatch.setattr(bound, "certify", lambda *_: certificate)
    monkeypatch.setattr(bound, "_parts_of", lambda _: np.zeros(4, dtype=np.int64))
    history, parts, lags = bound._sums(schedule, found, np.array([8.0]), 50, 0.5, 10, 1e6)
    carried = (residual + tail) * 8
    same(parts[0, 0, 3], carried, 1e-16)
    exactly = (sum(sums) + carried) * (1 + F(1, 2**48))
    assert abs(F(float(history[0, 0])) / exactly - 1) < F(1, 2**51)
    assert lags == 9
    # A bound that does not bound itself is raised until it does.
    raised, _, _ = bound._sums(schedule, found, np.array([1.0]), 50, 0.5, 10, 1e6)
    limit = sum(sums) / (1 - residual - tail)
    assert limit < F(float(raised[0, 0])) < limit * (1 + F(1, 2**30))


@pytest.mark.parametrize("which", ["K", "gain", "dK", "loop", "spread", "all"])
def test_limits_from_measurements_allow_for_each_rounding(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    schedule = filter_schedule(state_space([["1/2"]], [["1"]]), FloatFormat(2, 24))
    value = {
        name: float(F(n, 8)) if which in (name, "all") else 0.0
        for n, name in enumerate(("K", "gain", "dK", "loop", "spread"), 3)
    }
    one = np.ones((1, 1, 1))
    empty = np.zeros((1, 1))
    found = Disturbances(
        one / 2, one * value["spread"], one, empty, empty, one * value["K"], one * value["loop"], one * value["gain"]
    )
    monkeypatch.setattr(bound, "_disturbances", lambda *_: found)
    schedule.dK[:] = value["dK"]
    seen = []

    def peaks(*arguments: Any) -> Any:
        seen.append(arguments[0].slack.copy())
        return np.array([5.0]), np.array([7.0])

    monkeypatch.setattr(bound, "peaks", peaks)
    limits = bound._from_measurements(
        schedule, FilterLimits(np.array([np.inf]), np.array([np.inf]), np.array([2.0])), 9, True, 5
    )
    X, V = (F(5) * (1 + F(1, 2**30)), F(7) * (1 + F(1, 2**30)))
    same(limits.state[0], X)
    same(limits.innovation[0], V)
    tiny = F(1, 2**48)
    exactly = tiny * (F(value["K"]) * 2 + F(value["gain"]) * V) + F(value["dK"]) * V
    exactly += (tiny * F(value["loop"]) + F(value["spread"])) * X
    same(seen[-1][0, 0], exactly)


# -- balls that contain what a set adds --------------------------------------------------------------------------------


@pytest.fixture
def bits():
    before, ctx.prec = ctx.prec, enclosure._BITS
    yield
    ctx.prec = before


def test_balls_have_the_radii_of_the_set_and_of_errors(bits: None) -> None:
    spread = np.array([[0.25, 0.0]])
    found = enclosure.enclosed_numbers(np.array([[F(3), F(1, 3)]], dtype=object), 0.5, spread)
    same(found[0, 0].exactly.rad(), 0.25, 1e-8)
    assert found[0, 1].exactly.rad() < 1e-40
    found[0, 1].error = 0.125
    balls, errors = enclosure._restarted(found)
    assert errors.tolist() == [[0.0, 0.125]]
    assert [each.error for each in balls[0]] == [0, 0]
    assert all(each.unit == 0.5 for each in balls[0])
    same(balls[0, 0].exactly.rad(), 0.25, 1e-8)
    same(balls[0, 1].exactly.rad(), 0.125, 1e-8)
    assert balls[0, 1].exactly.contains(arb(1) / 3)


def test_limits_of_balls_are_rounded_upwards(bits: None) -> None:
    third = arb(1) / 3
    found = enclosure._abs(arb_mat([[third, -third, arb(1, 0.5)]]))
    assert F(float(third)) < F(1, 3)
    assert all(F(1, 3) < F(each) < F(1, 3) * (1 + F(1, 2**49)) for each in found[0, :2])
    assert 1.5 < found[0, 2] < 1.5 + 1e-8


@pytest.mark.parametrize("fmt", [FloatFormat(10, 6), FloatFormat(2, 24)])
def test_the_unit_of_an_enclosure_is_rounded_upwards(fmt: FloatFormat, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(enclosure, "_settled", lambda *_: 64)
    monkeypatch.setattr(enclosure, "_enclose", lambda *arguments: seen.append((arguments[2], ctx.prec)))
    assert enclosure.enclose(SimpleNamespace(), SimpleNamespace(steps=1), fmt, Form.JOSEPH) is None  # type: ignore[arg-type]
    assert fmt.unit_roundoff * (1 + F(1, 2**51)) < F(seen[0][0]) < fmt.unit_roundoff * (1 + F(1, 2**49))
    assert seen[0][1] == enclosure._BITS != ctx.prec


def test_products_of_closed_loops_have_their_roundings(bits: None) -> None:
    """Two phases of one cycle, with 60 bits in each entry, so that every product is rounded; all entries positive."""
    tiny = F(1, 2**60)
    loops = [
        np.array([[F(1, 2) + tiny, F(1, 8)], [F(1, 16), F(3, 8) + tiny]]),
        np.array([[F(3, 8), F(1, 4) + tiny], [F(1, 8) + tiny, F(1, 2)]]),
    ]
    none = np.zeros((2, 2))
    as_balls = lambda A: arb_mat([[arb(int(x * 2**60)) / 2**60 for x in row] for row in A])  # noqa: E731
    phases = [enclosure._Phase((), none, as_balls(A), none, none, none, none) for A in loops]
    found = enclosure._powers(phases)
    assert found is not None
    for j, (products, residuals) in enumerate(found):
        assert np.array_equal(products[0], np.eye(2))
        assert len(products) == len(residuals) + 1
        inexact = 0
        for lag, (M, after, off) in enumerate(zip(products, products[1:], residuals, strict=False)):
            made = fractions(M) @ loops[(j - 1 - lag) % 2] - fractions(after)
            assert (abs(made) <= fractions(off)).all()
            assert (fractions(off) <= abs(made) * (1 + F(1, 2**40)) + F(1, 2**120)).all()
            inexact += int((made != 0).any())
        assert inexact == len(residuals)
        assert products[-1].max() < enclosure._SMALL


def test_closed_loops_of_a_cascade_are_stable_if_their_sections_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twelve sections with poles of size 0.98: eigenvalues of the whole matrix in float64 are larger than one."""
    turn = 0.98 * np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    loop = np.kron(np.eye(12), turn) + np.kron(np.eye(12, k=-1), np.ones((2, 2)))
    assert np.abs(np.linalg.eigvals(loop)).max() > 1
    none = np.zeros((24, 24))
    as_balls = arb_mat([[arb(float(x)) for x in row] for row in loop])
    monkeypatch.setattr(enclosure, "_SMALL", 0.5)
    found = enclosure._powers([enclosure._Phase((), none, as_balls, none, none, none, none)])
    assert found is not None
    assert len(found[0].products) == int(np.ceil(np.log(0.5) / np.log(0.98))) + 9
    section = np.abs(np.linalg.matrix_power(turn, 3))
    assert found[0].products[3][:2, :2] == pytest.approx(section, rel=1e-12)
    assert enclosure._powers([enclosure._Phase((), none, as_balls * arb(1.03), none, none, none, none)]) is None


@pytest.mark.parametrize(("error", "radius"), [(F(1, 2), F(0)), (F(1, 2**10), F(1, 8))])
def test_the_gain_s_error_in_joseph_s_form(error: F, radius: F, monkeypatch: pytest.MonkeyPatch, bits: None) -> None:
    """By S times the square of a large error, and by the asymmetry of V times a small one."""
    monkeypatch.setattr(enclosure, "_SUMS", 4.0)
    restarted = enclosure._restarted

    def with_error(values: Any) -> Any:
        balls, errors = restarted(values)
        calls.append(1)
        return balls, errors if len(calls) == 1 else errors * 0 + float(error)

    found = []
    for added in (F(0), error):
        calls: list[int] = []
        monkeypatch.setattr(enclosure, "_restarted", with_error)
        error = added
        at = enclosure._disturbed(Form.JOSEPH, phase(), given(0.0), np.array([[float(radius)]]), 0.0)
        found.append(F(at.covariance[0, 0]))
    V = PHI * P * PHI + Q
    wide = PHI * radius * PHI  # V may be off by this much
    S, r = H * V * H + R, H * wide * H
    turned = 2 * r / (S - r)  # the radius of S/S
    askew = H * wide + (H * wide + H * V * turned + H * wide * turned)
    exactly = 4 * (error * (S + r) * error + error * askew)
    same(found[1] - found[0], exactly, 1e-6)


def exact_covariance(V: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(I - KH)V for any V, symmetric or not."""
    S = H @ V @ H.T + R
    return V - V @ H.T @ inverse_of(S) @ H @ V


def set_of_covariances(seed: int) -> tuple[list[np.ndarray], np.ndarray, np.ndarray, np.ndarray]:
    """A model, the center of a set of covariances, its limits B without symmetry, and errors of the predicted one."""
    if seed == 0:  # one entry of B moves the right factor, and leaves the left one as it is
        one, none = np.eye(2), np.zeros((2, 2))
        model = [exact(each) for each in (one, [[1, 0]], none, [[1]])]
        return model, one, np.array([[0, 0.25], [0, 0]]), np.array([[2.0**-20, 0], [0, 0]])
    rng = np.random.default_rng([5, seed])
    n, m = 3, int(rng.integers(1, 3))
    G, L = rng.uniform(-1, 1, (n, n)), rng.uniform(-0.3, 0.3, (m, m))
    numbers = rng.uniform(-0.9, 0.9, (n, n)), rng.uniform(-1, 1, (m, n)), G @ G.T / 8, np.eye(m) + L @ L.T
    model = [exact(np.round(each * 64) / 64) for each in numbers]
    center = np.eye(n) + np.round((G + G.T) * 8) / 64
    return model, center, rng.choice([0, 2.0**-14], (n, n)), rng.choice([0, 2.0**-12], (n, n))


@pytest.mark.parametrize("form", enclosure.FORMS)
@pytest.mark.parametrize("seed", range(12))
def test_a_set_that_is_not_symmetric_holds_what_a_step_adds(
    seed: int, form: Form, monkeypatch: pytest.MonkeyPatch, bits: None
) -> None:
    """Exactly, for covariances at the corners of the set and of the errors of the predicted one."""
    (Phi, H, Q, R), center, B, error_V = set_of_covariances(seed)
    V = Phi @ fractions(center) @ Phi.T + Q
    HS = H.T @ inverse_of(H @ V @ H.T + R)
    C = exact(np.eye(len(V))) - V @ HS @ H
    balls = enclosure._to_matrix
    size = lambda a: abs(a).astype(float)  # noqa: E731
    step = enclosure._Phase(
        (), center, balls(C @ Phi), balls(V @ HS), size(HS), size(Phi.T @ HS @ H @ Phi), balls(C @ V)
    )
    restarted, calls = enclosure._restarted, []

    def with_errors(values: Any) -> Any:
        calls.append(1)
        if len(calls) == 1:
            for at in np.ndindex(values.shape):
                values[at].error = float(error_V[at])
        return restarted(values)

    monkeypatch.setattr(enclosure, "_restarted", with_errors)
    model = [enclosure.enclosed_numbers(each, 0.0) for each in (Phi, H, Q, R)]
    found = enclosure._disturbed(form, step, model, B, 0.0)
    rng, tightest = np.random.default_rng(seed), 0.0
    for _ in range(20):
        E, dV = (fractions(each * rng.choice([-1, 1], each.shape)) for each in (B, error_V))
        after = exact_covariance(Phi @ (fractions(center) + E) @ Phi.T + Q + dV, H, R)
        added = size(after - exact_covariance(V, H, R) - C @ Phi @ E @ Phi.T @ C.T)
        assert (added <= found.covariance).all()
        tightest = max(tightest, float((added[found.covariance > 0] / found.covariance[found.covariance > 0]).max()))
    assert tightest > 0.3


def test_errors_of_powers_are_carried_on_by_covariances_without_symmetry() -> None:
    rng = np.random.default_rng(8)
    for _ in range(50):
        M, B = rng.uniform(-1, 1, (3, 3)), rng.choice([0.0, 1.0], (3, 3))
        off = rng.choice([0.0, 2.0**-8], (3, 3))
        most = enclosure._carried(off, B, np.abs(M)) * (1 + 1e-12)
        for _ in range(10):
            E, D = B * rng.choice([-1, 1], B.shape), off * rng.choice([-1, 1], off.shape)
            assert (np.abs((M + D) @ E @ (M + D).T - M @ E @ M.T) <= most + 1e-15).all()
