"""The precision of recursions written as functions."""

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import FloatFormat, required_precision
from gpbnb.filters.simulation import simulated_measurements
from gpbnb.report import examples
from tests.surveying import survey


def test_a_kalman_filter_written_as_a_function_gets_the_answer_of_its_model():
    tracker = examples.tracker()
    z = simulated_measurements(tracker, 60)

    def written(fmt, z):
        return _tracked(fmt, z, tracker)

    asked = {"z": z, "tolerance": 0.01}
    a, b = (required_precision(each, **asked) for each in (written, tracker))
    assert a.digits == b.digits
    # the reference of the model has the digits of double-double
    assert [digits for digits, _ in a.tried] == [digits for digits, _ in b.tried]
    assert np.allclose([x for _, x in a.tried], [y for _, y in b.tried], rtol=1e-9)


def _tracked(fmt, z, model):
    Phi, H, Q, R = (fmt.array(getattr(model, letter)[0]) for letter in ("Phi", "H", "Q", "R"))
    x, P, found = fmt.array(model.x0), fmt.array(model.P0), []
    for value in z:
        V = Phi @ P @ Phi.T + Q
        VH = V @ H.T
        K = VH @ (1 / (H @ VH + R))
        P = (fmt.eye(model.n) - K @ H) @ V
        ahead = Phi @ x
        x = ahead + K @ (value - H @ ahead)
        found.append(x)
    return np.stack(found)


def muller(steps):
    """A recurrence that tends to 5 in exact arithmetic; a rounding error grows twentyfold a step and leads to 100."""

    def run(fmt):
        x = [fmt.array(4), fmt.array("4.25")]
        while len(x) < steps:
            x.append(108 - (815 - 1500 / x[-2]) / x[-1])
        return x

    return run


def muller_error(fmt, steps):
    """The largest error of the recurrence, with each operation rounded on its own, against its closed form."""
    x = [fmt.round(4), fmt.round("4.25")]
    while len(x) < steps:
        ahead = fmt.round(815 - fmt.round(1500 / x[-2]))
        x.append(fmt.round(108 - fmt.round(ahead / x[-1])))
    exact = [Fraction(3 ** (k + 1) + 5 ** (k + 1), 3**k + 5**k) for k in range(steps)]
    return max(abs(a - b) for a, b in zip(x, exact, strict=True))


@pytest.mark.parametrize(("base", "answer"), [(10, 44), (2, 140), (16, 36)])
def test_mullers_recurrence_needs_more_digits_than_compiled_loops_have(base, answer):
    """Digits that a limit of 53 bits or 18 decimal digits would deny."""
    found = required_precision(muller(32), 32, 1e-3, base=base)
    assert found.digits == answer
    tried = dict(found.tried)
    for digits in (answer - 1, answer, answer + 1):
        error = muller_error(FloatFormat(base, digits), 32)
        assert (error <= Fraction(1, 1000)) == (digits >= answer)
        assert tried[digits] == pytest.approx(float(error * 1000), rel=1e-9)
    assert survey(muller(32), 32, 1e-3, [answer - 1, answer], base=base) == tuple(
        (digits, tried[digits]) for digits in (answer - 1, answer)
    )


def test_the_answer_names_the_limit_that_ended_the_search():
    found = required_precision(muller(32), 32, 1e-3, base=10, highest=40)
    assert found.digits is None
    assert str(found) == (
        "no precision up to 40 decimal digits, where highest=40 ends the search, "
        "meets the tolerance in a run of 32 steps"
    )
    assert str(required_precision(muller(46), 46, 1e-3, base=10)).startswith(
        "no precision up to 60 decimal digits, where highest=60"
    )
    met = {digits: muller_error(FloatFormat(10, digits), 46) <= Fraction(1, 1000) for digits in range(58, 66)}
    least = min(digits for digits in range(58, 65) if met[digits] and met[digits + 1])
    assert required_precision(muller(46), 46, 1e-3, base=10, highest=70).digits == least > 60


def running_mean(fmt, values):
    mean, found = fmt.array(0), []
    for count, value in enumerate(values, 1):
        mean = mean + (value - mean) / count
        found.append(mean)
    return np.stack(found)


@pytest.mark.parametrize(
    ("function", "z", "tolerances", "least"),
    [
        (running_mean, np.sin(0.01 * np.arange(300)), (1e-1, 1e-3, 1e-5), 8),
        (lambda fmt, z: z / 10, [1, 2], (1, 0.05), 3),
    ],
)
def test_a_precision_that_cannot_hold_a_whole_number_is_not_enough(function, z, tolerances, least):
    """The answer holds every whole number that the function takes, whatever precisions the search tries on its way."""
    for tolerance in tolerances:
        found = required_precision(function, z, tolerance)
        assert found.digits >= least
        assert all(ratio == np.inf for digits, ratio in found.tried if digits < least)
    (_, short), (_, long) = survey(function, z, 1, [2, 24])
    assert short == np.inf
    assert long < 1
    with pytest.raises(ValueError, match="got the operand 10; needed a number that"):
        FloatFormat(2, 2).array(1) / 10
