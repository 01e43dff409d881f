"""Long runs: covariances that come back, estimates that decay to zero, and random numbers that are drawn once."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY32, BINARY64, FloatFormat, LinearModel, emulate, required_precision
from gpbnb.arithmetic.kernels import tags
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run
from gpbnb.filters.stepping import RunningStep

STEPS = 400


def model(n, seed, repeated=False):
    rng = np.random.default_rng([n, seed])
    Phi = np.eye(n) + 0.1 / np.sqrt(n) * rng.standard_normal((n, n))
    Phi /= 1.3 * abs(np.linalg.eigvals(Phi)).max()
    H, A = rng.standard_normal((2, n)), rng.standard_normal((n, n))
    if repeated:
        Phi, H = np.stack([Phi, Phi / 2]), np.stack([H, 2 * H, -H])
    P0 = A @ A.T / n + np.eye(n)
    return LinearModel(
        Phi=Phi, H=H, Q=0.01 * np.eye(n) + 1e-3, R=[[1, 0.1], [0.1, 1]], x0=rng.standard_normal(n), P0=(P0 + P0.T) / 2
    )


def measurements(steps):
    return np.random.default_rng(8).standard_normal((steps, 2))


def step_by_step(given, fmt, form, z):
    """The same run, each step by a call of its own, which cannot know that a covariance came back."""
    run = Run(given, fmt, form, range(1, len(z) + 1))
    packed = run.pack_measurements(z if fmt is None else fmt.array(z))
    for each in packed:
        assert sum(len(found.x) for found in run.advance(each[None])) == 1
    return run


@pytest.mark.parametrize("repeated", [False, True])
@pytest.mark.parametrize(
    ("fmt", "form"),
    [
        (None, Form.INNOVATION),
        (BINARY32, Form.INNOVATION),
        (BINARY32, Form.COMPENSATED),
        (BINARY64, Form.HUNG),
        (FloatFormat(2, 12), Form.JOSEPH),
        (FloatFormat(10, 5), Form.INNOVATION),
        (FloatFormat(2, 12, "stochastic"), Form.INNOVATION),
    ],
)
def test_a_covariance_that_comes_back_changes_no_digit(fmt, form, repeated):
    given, z = model(3, 1, repeated), measurements(STEPS)
    expected = step_by_step(given, fmt, form, z)
    run = Run(given, fmt, form, range(1, STEPS + 1))
    run.take(z if fmt is None else fmt.array(z))
    for name in ("x", "P", "X", "G", "C", "steps", "saved", "indefinite"):
        found, each = getattr(run, name), getattr(expected, name)
        assert np.array_equal(found, each)
    if form is not Form.HUNG and (fmt is None or fmt.rounding.value != "stochastic"):
        # the covariance does come back within the run
        cycle = given.cycle
        assert any(np.array_equal(run.C[-1], earlier) for earlier in run.C[-1 - cycle : 0 : -cycle][:300])


def test_a_covariance_that_came_back_is_not_computed_again(monkeypatch):
    run, z = Run(model(3, 1), FloatFormat(2, 12), Form.INNOVATION, ()), measurements(STEPS)
    run.take(z)
    monkeypatch.setattr(RunningStep, "_early_alone", None)
    run.take(z)


DECAYING = LinearModel([["0.9"]], [["1"]], [["0.01"]], [["1"]], ["0"], [["1"]])
MANY = 5000


def impulse(steps):
    z = np.zeros((steps, 1))
    z[0] = 1
    return z


@pytest.mark.parametrize("options", [{}, {"base": 10}, {"basis": "bound", "base": 10}], ids=str)
def test_silence_after_a_record_changes_no_answer(options):
    """The errors are largest while the estimate is large, so that a short record has the same answer."""
    long, short = (required_precision(DECAYING, impulse(steps), 1e-3, highest=12, **options) for steps in (MANY, 100))
    assert long.met
    assert long.format == short.format
    assert dict(long.tried)[long.digits] == pytest.approx(dict(short.tried)[long.digits], rel=1e-9)


def test_an_estimate_has_its_digits_until_it_becomes_zero():
    fmt = FloatFormat(2, 20)
    run = Run(DECAYING, fmt, "innovation", range(1, MANY + 1))
    run.take(impulse(MANY))
    x, K = (run.checkpoints().to_float(letter).reshape(-1) for letter in "xK")
    ended = int(np.argmax(x == 0))
    assert 2.0**-962 < x[ended - 1] < 2.0**-700
    assert not x[ended:].any()
    for k in range(1, ended):
        ahead = fmt.round(fmt.round("0.9") * Fraction(x[k - 1]))
        assert Fraction(x[k]) == fmt.round(ahead - fmt.round(Fraction(K[k]) * ahead))


def test_covariances_go_on_where_an_estimate_becomes_zero_before_they_repeat():
    """The gain is computed ahead of the estimates, here until it repeats."""
    model = LinearModel(
        [["0.001", 0], [0, "0.999"]], np.eye(2), [["0.001", 0], [0, "0.001"]], np.eye(2), [1, 1], [[1, 0], [0, 100]]
    )
    z = np.zeros((200, 2))
    z[:, 1] = np.arange(200) % 7
    together, alone = (Run(model, FloatFormat(2, 12), "innovation", range(1, 201)) for _ in range(2))
    together.take(z)
    for k in range(len(z)):
        alone.take(z[k : k + 1])
    estimates, gains = together.X[:, 0, 0], together.G
    assert int(np.argmax(estimates == 0)) < int(np.argmax((gains == gains[-1]).all(axis=(1, 2))))
    for one, other in zip((together.X, gains, together.C), (alone.X, alone.G, alone.C), strict=True):
        assert (one == other).all()


@pytest.mark.parametrize("subnormal", [True, False])
def test_a_decimal_estimate_decays_through_subnormal_numbers_to_zero(subnormal):
    fmt = FloatFormat(10, 7, emin=-95, emax=96, subnormal=subnormal)
    run = emulate(DECAYING, impulse(3000), fmt)
    x = run.x.to_fractions().ravel().tolist()
    assert not run.reason
    assert len(x) == 3000
    assert x[-1] < 10 * fmt.smallest  # times 0.82, five units are five again
    assert any(0 < v < fmt.smallest_normal for v in x) == subnormal
    assert required_precision(DECAYING, impulse(3000), 1e-3, base=10, range=(-95, 96)).met


def test_no_random_number_is_drawn_twice_in_a_run():
    """Factors, gain and estimate draw from one sequence; shared numbers would correlate their roundings."""
    tracker = LinearModel(
        [["1", "0.1"], ["0", "0.9"]], np.eye(2), [["0.3", 0], [0, "0.2"]], [["0.7", "0.3"], ["0.3", "1.1"]], [0, 0],
        [["0.6", "0.1"], ["0.1", "0.6"]],
    )  # fmt: skip
    run = Run(tracker, FloatFormat(2, 9, "stochastic"), "UD", ())
    state = tags.random_state(run.tag)
    opened = int(state[1])
    assert opened > 2**63  # arrays draw the first half
    run.take(np.full((20, 2), 0.3))
    once = int(state[1])
    run.take(np.full((20, 2), 0.7))
    assert int(state[1]) - once == once - opened > 0
