"""The precision of recursions written as functions."""

import numpy as np
import pytest

from gpbnb import FloatFormat, LinearSystem, required_precision
from gpbnb.kalman.array_run import ArrayRun
from gpbnb.kalman.forms import Form
from gpbnb.kalman.guarantee.bound import limits
from gpbnb.kalman.inputs import simulated_measurements
from gpbnb.kalman.precision import survey
from gpbnb.wordlength import examples

Z = np.random.default_rng(3).standard_normal(200)


def smoother(fmt, z):
    old, new, x, estimates = fmt.array("0.9"), fmt.array("0.1"), fmt.array(0), []
    for value in z:
        estimates.append(x)
        x = old * x + new * value
    return estimates


@pytest.mark.parametrize("base", [2, 10, 16])
def test_a_function_gets_the_answer_of_the_same_linear_system(base):
    system = LinearSystem([["0.9"]], [["0.1"]])
    by_function = required_precision(smoother, 200, 1e-3, base=base, z=Z)
    by_system = required_precision(system, 200, 1e-3, base=base, z=Z.reshape(-1, 1))
    assert [digits for digits, _ in by_function.tried] == [digits for digits, _ in by_system.tried]
    ratios = [[ratio for _, ratio in each.tried] for each in (by_function, by_system)]
    assert np.allclose(*ratios, rtol=1e-9, atol=1e-9)
    assert by_function.precision == by_system.precision
    assert by_function.basis == "emulation"


def test_a_kalman_filter_written_as_a_function_gets_the_answer_of_its_model():
    tracker = examples.tracker()
    z = simulated_measurements(tracker, 60)

    def written(fmt, z):
        if fmt.precision > 53:  # the array run has no loops for the reference
            return _tracked(fmt, z, tracker)
        run = ArrayRun(tracker, fmt, Form.INNOVATION, range(1, 61))
        run.take(z)
        return fmt.array(run.checkpoints().x)

    asked = {"steps": 60, "tolerance": 0.01, "z": z}
    a, b = (required_precision(each, **asked) for each in (written, tracker))
    assert a.precision == b.precision
    # the model is compared at some of the steps only
    assert all(x >= y * (1 - 1e-9) for (_, x), (_, y) in zip(a.tried, b.tried, strict=True))


def _tracked(fmt, z, model):
    Phi, H, Q, R = (fmt.array(getattr(model, letter)[0]) for letter in ("Phi", "H", "Q", "R"))
    x, P, found = fmt.array(model.x0), fmt.array(model.P0), []
    for value in z:
        P = Phi @ P @ Phi.T + Q
        K = P @ H.T / (H @ P @ H.T + R)
        P = P - K @ (H @ P)
        ahead = Phi @ x
        x = ahead + K @ (value - H @ ahead)
        found.append(x)
    return np.stack(found)


def test_the_survey_has_the_ratios_of_the_search():
    found = required_precision(smoother, 200, 1e-3, z=Z)
    precisions = [digits for digits, _ in found.tried]
    assert survey(smoother, Z, 1e-3, precisions) == found.tried


def test_a_function_without_inputs_and_several_outputs():
    def rotation(fmt):
        c, s, one = fmt.array("0.8"), fmt.array("0.6"), fmt.array([1, 0])
        found = [one]
        for _ in range(99):
            x, y = found[-1]
            found.append(np.stack([c * x - s * y, s * x + c * y]))
        return np.stack(found)

    both = required_precision(rotation, 100, 1e-3)
    first = required_precision(rotation, 100, [1e-3, np.inf])
    assert both.precision >= first.precision > 10


def test_a_function_that_stops_in_few_digits():
    """In three bits 0.57 and 0.42 round to 0.625 and 0.4375."""

    def rest(fmt, z):
        return [np.sqrt((1 - x) - y) for x, y in z]

    assert survey(rest, [["0.57", "0.42"]], 1e-2, [3])[0][1] == np.inf
    found = required_precision(rest, 1, 1e-2, z=[["0.57", "0.42"]])
    assert dict(found.tried)[found.precision] <= 1
    assert found.precision > 3


REFUSED = [
    (lambda fmt, z: z.to_float(), TypeError, "got a ndarray from the function; needed arrays of the format"),
    (lambda fmt, z: [1.0] * 200, TypeError, "got a list from the function"),
    (lambda fmt, z: FloatFormat(2, 300).array(z), TypeError, "got a FloatArray in .*300"),
    (lambda fmt, z: z[:50], ValueError, r"got outputs of shape \(50, 1\) from the function; needed \(200,\)"),
    (lambda fmt, z: [x * 0.1 for x in z], ValueError, "got the operand 0.1; needed a number that .* holds exactly"),
    (lambda fmt, z: z * (1 if fmt.precision < 300 else 2), ValueError, "got a function whose reference in 237 digits"),
]


@pytest.mark.parametrize(("run", "kind", "message"), REFUSED)
def test_functions_that_leave_the_format_are_refused(run, kind, message):
    with pytest.raises(kind, match=message):
        required_precision(run, 200, 1e-3, z=Z)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"basis": "bound"}, 'got basis "bound" of a function'),
        ({"form": "UD"}, "got the UD form; needed none"),
        ({"within": limits(1, 1, state=1, innovation=1)}, "got limits for a function"),
        ({"z": Z[:5]}, r"got inputs of shape \(5,\); needed one row for each of the 200 steps"),
        ({"tolerance": [1, 1]}, "got tolerance"),
        ({"base": 3}, "got base 3"),
    ],
)
def test_options_that_a_function_cannot_have_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        required_precision(**{"model": smoother, "steps": 200, "tolerance": 1e-3, "z": Z} | options)


def test_a_linear_system_has_no_forms():
    with pytest.raises(ValueError, match="got the UD form; needed none"):
        required_precision(LinearSystem([["0.9"]], [["0.1"]]), 200, 1e-3, form="UD", z=Z.reshape(-1, 1))
