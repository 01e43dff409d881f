"""Limits of the gains of many states: roundings of a step, gains of runs, and fifty states with a guarantee."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds import gains
from gpbnb.bounds.gain_limits import FORMS, StepNumbers, chain, contracted, limits_of_gains, parts_of_a_step
from gpbnb.bounds.gains import step_numbers
from gpbnb.bounds.guarantee import guarantee, limits
from gpbnb.filters.factors import covariance_of_factors
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.run import Run, reference_states
from gpbnb.report.kalman.exact_step import exact_step
from gpbnb.wordlength.examples import cyclic

FORMATS = [FloatFormat(2, 16), FloatFormat(2, 24, Rounding.CHOP), FloatFormat(10, 6)]


def coupled() -> LinearModel:
    """Four states and two measurements; factors of Q and R are exact, so that a step has no other errors."""
    above = ["0.9", "0.25", "0", "0"], ["-0.25", "0.875", "0.125", "0.5"]
    return LinearModel(
        Phi=exact([*above, ["0", "0", "0.75", "1"], ["0.5", "0", "0", "-0.5"]]),
        H=exact([["1", "0", "0.5", "0"], ["0", "-1", "0.25", "2"]]),
        Q=exact(np.diag([2, 1, 4, 1])) / 4,
        R=exact(np.diag([1, 2])),
        x0=exact(["0"] * 4),
        P0=exact(3 * np.eye(4, dtype=int)),
    )


def settled(form: Form, fmt: FloatFormat, model: LinearModel, steps: int) -> tuple[LinearModel, Run]:
    stored = model.rounded(fmt)
    run = Run(stored, fmt, form, range(1, steps + 1))
    run.take(np.zeros((steps, model.m)))
    return stored, run


def covariances(run: Run) -> np.ndarray:
    P = run.exactly(run.C)
    return np.array([covariance_of_factors(U) for U in P]) if run.form is Form.UD else P


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
@pytest.mark.parametrize("form", FORMS)
def test_no_step_is_rounded_by_more_than_its_bounds(form: Form, fmt: FloatFormat) -> None:
    """From covariances of a run to the exact step from them; the bounds are not much larger than what is seen."""
    stored, run = settled(form, fmt, coupled(), 300)
    P, K = covariances(run), run.exactly(run.G)
    given, unit = step_numbers(run), float(fmt.unit_roundoff) * (1 + 2.0**-50)
    found = limits_of_gains(form, given, P.astype(np.float64), K.astype(np.float64), unit)
    assert found is not None
    step = chain(given, found.center[0])
    assert step is not None
    # The set that is found contains all covariances of the run.
    s = np.sqrt((step.weights**2).sum(axis=1))
    parts = parts_of_a_step(form, step, float((found.covariance[0] / np.outer(s, s)).max()), unit)
    assert parts is not None
    allowed = parts.covariance[-1]
    later = np.eye(4)
    for T, u in zip(parts.covariance[-2::-1], step.updates[::-1], strict=True):
        later = later @ u.C
        allowed = allowed + np.abs(later) @ T @ np.abs(later.T)
    largest = 0.0
    matrices = [each[0] for each in (stored.Phi, stored.H, stored.Q, stored.R)]
    for k in range(100, 299):
        before = (P[k] + P[k].T) / 2
        if (before != P[k]).any():
            continue  # the oracle takes symmetric covariances
        true = exact_step(*matrices, stored.x0, before, exact(["0", "0"]))
        ratio = np.abs((P[k + 1] - true.P).astype(float)) / (allowed + 3 * parts.second * np.abs(step.center))
        largest = max(largest, float(ratio.max()))
    assert largest <= 1
    assert largest == 0 or largest > 1e-3


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
@pytest.mark.parametrize("form", FORMS)
def test_no_gain_leaves_its_limits(form: Form, fmt: FloatFormat) -> None:
    # With fewer digits, there is no set for twenty states.
    for model, steps in ((coupled(), 600), *([(cyclic(20, 2, 1, 0.7), 250)] if fmt.precision > 20 else [])):
        _, run = settled(form, fmt, model, steps)
        P, K = covariances(run).astype(np.float64), run.exactly(run.G).astype(np.float64)
        unit = float(fmt.unit_roundoff) * (1 + 2.0**-50)
        found = limits_of_gains(form, step_numbers(run), P[:200], K[:200], unit)
        assert found is not None
        for k in range(found.start, steps):
            assert (np.abs(K[k] - K[found.start - 1]) <= found.gain[0]).all()
            assert (np.abs(P[k] - found.center[0]) <= found.covariance[0]).all()
        assert found.gain.max() < 5000 * unit * np.abs(K).max()


@pytest.mark.parametrize("form", FORMS)
def test_fifty_states_have_a_guarantee_for_ever(form: Form) -> None:
    """No run with random, steady or adversarial measurements leaves the bound; few steps are enough."""
    given, fmt, n = cyclic(50, 2, 1, 0.5), FloatFormat(2, 24), 50
    within = limits(n, 2, state=100, innovation=10)
    found = guarantee(given, fmt, within, form)
    assert found.for_ever
    assert found.schedule.enclosed is not None
    assert found.schedule.steps < 100
    stored, rng, steps = given.rounded(fmt), np.random.default_rng(5), 120
    K = found.schedule.exact[-1, :, :, 0]
    F = (np.eye(n) - K @ stored.H[0].astype(float)) @ stored.Phi[0].astype(float)
    worst = 0.0
    for aim in (None, 0, int(found.bound.argmax())):
        # the sign of each innovation by its effect on one state at the end, or random
        course = rng.choice([-1.0, 1.0], (steps, 2))
        row = np.eye(n)[0 if aim is None else aim]
        for k in range(steps - 1, -1, -1):
            if aim is not None:
                course[k] = np.sign(row @ K)
            row = row @ F
        x, z = np.zeros(n), np.zeros((steps, 2))
        for k in range(steps):  # measurements of an exact filter with these innovations
            ahead = stored.Phi[0].astype(float) @ x
            z[k] = stored.H[0].astype(float) @ ahead + 9.9 * course[k]
            x = ahead + K @ (9.9 * course[k])
            assert np.abs(x).max() < 99
        measured, run = fmt.array(z), Run(stored, fmt, form, range(1, steps + 1))
        run.take(measured)
        true = reference_states(stored, measured.to_fractions()).sum(axis=-1)
        errors = np.abs(run.exactly(run.X)[..., 0].astype(float) - true)
        rows = found.history[np.minimum(np.arange(steps), len(found.history) - 1)]
        assert (errors <= rows * (1 + 1e-9)).all()
        worst = max(worst, float((errors / found.bound).max()))
    assert 1e-4 < worst <= 1


def test_numbers_of_a_step_are_next_to_the_exact_ones_even_if_terms_cancel() -> None:
    """Q is nearly of rank one, and H measures in the direction that has hardly any variance."""
    b, small = np.array([1.0, 0.5, 1.75]), 3e-3
    Q, H = np.outer(b, b) + small * np.diag(b * b), np.array([[1.75, 0.0, -1.0]])
    P, R = np.eye(3) / 4, np.array([[small]])
    step = chain(StepNumbers(np.eye(3) / 2, Q, np.zeros((3, 3)), [(H, R)]), P)
    assert step is not None
    (u,) = step.updates
    V = exact(P) / 4 + exact(Q)
    K = V @ exact(H).T / (exact(H) @ V @ exact(H).T + exact(R))[0, 0]
    C = exact(np.eye(3)) - K @ exact(H)
    for near, true in ((u.before, V), (u.K, K), (u.C, C)):
        assert (np.abs(exact(near) - true) <= np.abs(true) / 2**52 + Fraction(1, 2**200)).all()


def test_units_of_the_states_do_not_change_the_size_of_a_set() -> None:
    sizes = []
    for unit in (1.0, 2.0**-14, 2.0**-30):
        scale, P = np.diag([1.0, unit]), np.zeros((2, 2))
        Phi, Q, R = np.diag([0.5, 0.9]), scale @ np.diag([1.0, 1e-3]) @ scale, scale @ scale
        for _ in range(200):
            V = Phi @ P @ Phi.T + Q
            P = V @ np.linalg.inv(V + R) @ R
        given = StepNumbers(Phi, Q, np.zeros((2, 2)), [(np.eye(2), R)])
        found = limits_of_gains(Form.INNOVATION, given, np.array([P]), np.zeros((1, 2, 2)), 2.0**-24)
        assert found is not None
        sizes.append(found.covariance[0, 1, 1] / unit**2)
    assert sizes == pytest.approx([sizes[0]] * 3, rel=1e-6)


def test_where_no_set_is_found() -> None:
    """A covariance that does not settle, a set larger than what contracts, and a precision that is too low."""
    one = np.eye(1)
    given = StepNumbers(2 * one, one, one, [(0 * one, one)])
    K = np.zeros((2, 1, 1))
    assert limits_of_gains(Form.UD, given, np.ones((2, 1, 1)), K, 2.0**-24) is None
    given = StepNumbers(one / 2, one, one, [(one, one)])
    step = chain(given, one * (np.sqrt(65) - 7) / 2)  # where P² + 7 P = 4
    assert step is not None
    for form in FORMS:
        assert contracted(form, step, one * 0, 2.0**-24) is not None
        assert contracted(form, step, one * 0, 2.0**-3) is None
        assert contracted(form, step, one, 2.0**-24) is None
    # Two sensors that see nearly the same: bounds of entries do not tell that a pivot of their covariance is not zero.
    given = StepNumbers(
        np.eye(3) / 2, np.eye(3), np.zeros((3, 3)), [(np.array([[1, 0, 0], [1, 0.25, 0]]), np.eye(2) / 64)]
    )
    step = chain(given, np.eye(3))
    assert step is not None
    assert contracted(Form.INNOVATION, step, np.zeros((3, 3)), 2.0**-10) is None


@pytest.mark.parametrize("form", [Form.INNOVATION, Form.JOSEPH], ids=str)
def test_gains_to_which_no_norm_applies_are_enclosed_entry_by_entry(
    form: Form, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The norm covers no cycle of matrices, however many states there are."""
    model, fmt = cyclic(10, 2, cycle=31, decay=0.8), FloatFormat(2, 24)
    found = gains.schedule(model, fmt, form, most=200)
    monkeypatch.setattr(gains, "ENTRY_BY_ENTRY", 0)
    again = gains.schedule(model, fmt, form, most=200)
    assert found.limits is not None
    assert again.limits is not None
    assert again.enclosed == found.enclosed
    assert np.array_equal(again.limits, found.limits)
