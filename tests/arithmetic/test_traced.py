"""Traced functions: the digits of the function itself, in every arithmetic; what cannot be traced runs as it is."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import BINARY32, FixedFormat, FloatFormat, peek
from gpbnb.arithmetic import linalg, tape
from gpbnb.arithmetic.machine import CODES
from gpbnb.arithmetic.traced import TracedFunction

FORMATS = {
    "24 bits, away": FloatFormat(2, 24),
    "24 bits, even": FloatFormat(2, 24, "even"),
    "24 bits, floor": FloatFormat(2, 24, "down"),
    "53 bits": FloatFormat(2, 53, "chop"),
    "8 bits, small range": FloatFormat(2, 8, "even", emin=-14, emax=15),
    "binary32": BINARY32,
    "8 decimal digits": FloatFormat(10, 8),
    "16 decimal digits": FloatFormat(10, 16),
    "7 decimal digits, range": FloatFormat(10, 7, "even", emin=-95, emax=96),
    "6 hexadecimal digits": FloatFormat(16, 6, "chop"),
    "100 bits": FloatFormat(2, 100),
    "fixed, saturating": FixedFormat(4, 19, "down", "saturate"),
    "fixed, wrapping": FixedFormat(4, 19, "nearest", "wrap"),
    "fixed": FixedFormat(4, 27, "even"),
    "stochastic": FloatFormat(2, 20, "stochastic", seed=5),
}
FEW = ("24 bits, even", "binary32", "8 decimal digits", "fixed, saturating", "fixed, wrapping")
"""Formats of some kinds of numbers; elimination takes long to compile for one more."""
Z = np.round(2 * np.sin(np.arange(100) / 5), 3)


def pi_controller(fmt, z):
    kp, ki, low, high = fmt.array("0.8"), fmt.array("0.05"), fmt.array(-1), fmt.array(1)
    a, b, i, y, found = fmt.array("0.95"), fmt.array("0.05"), fmt.array(0), fmt.array(0), []
    for r in z:
        e = r - y
        i = np.clip(i + ki * e, low, high)
        y = a * y + b * np.clip(kp * e + i, low, high)
        found.append(y)
    return np.stack(found)


def limiter(fmt, z):
    gain, found = fmt.array(1), []
    for x in z:
        loud = (abs(x) > 1) & ~(gain < fmt.array("0.25"))
        gain = np.where(loud, gain * fmt.array("0.7"), np.where(gain >= 1, 1, gain + fmt.array("0.01")))
        found.append(gain * x)
    return found


def angles(fmt, z):
    """Elementary functions are calls between compiled operations."""
    angle, found = fmt.array(0), []
    for x in z[:30]:
        angle = np.fmod(angle + x, 3)
        found.append(np.sin(angle) * np.arctan2(x, 2) + np.floor(x).multiply_add(x / 4, angle / 4))
    return np.stack(found)


def many_functions(fmt, z):
    """Functions that move, choose and reduce."""
    m = z[:12].reshape(3, 4) / 2
    small = np.logical_or(m < 0, m == m[0]) ^ (m != 1)
    chosen = np.select([m > 1, small], [m, -m], 0) + np.triu(m) / 2
    some = np.where(np.any(m > 1, axis=0), np.max(m, axis=0), np.min(m, axis=0))
    held = np.where(
        np.all(m[0] < 1) & True & np.all(m[:0] < 1) & ~np.any(m[:0] < 1), np.sign(m[0]), np.copysign(m[1], m[2])
    )
    return np.concatenate(
        [chosen.ravel(), some, held, np.diff(m, axis=0)[0], fmt.array([m[0, 1], 1]), np.tile(m[1], 2)]
    )


def kalman(fmt, z):
    """A Kalman filter with a covariance, two measurements and elimination."""
    Phi, H, x, P = fmt.array([[1, "0.25"], [0, "0.875"]]), fmt.eye(2), fmt.array([0, 1]), fmt.eye(2)
    Q, R, found = fmt.eye(2) / 8, fmt.array([["0.5", "0.125"], ["0.125", "0.25"]]), []
    for value in z[:12]:
        x, P = Phi @ x, Phi @ P @ Phi.T + Q
        K = P @ H.T @ linalg.inv(H @ P @ H.T + R)
        x, P = x + K @ (np.stack([value, value / 2]) - H @ x), P - K @ (H @ P)
        found.append(x)
    return np.stack([*found, linalg.lu(P).upper[1]])


FUNCTIONS = [pi_controller, limiter, angles, many_functions, kalman]


def numbers(found):
    """Exact numbers of what a function returns."""
    return list(map(numbers, found)) if isinstance(found, list) else np.asarray(found.to_fractions()).tolist()


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda each: each.__name__)
def test_traced_functions_have_the_digits_of_the_function(function, monkeypatch):
    for name in FEW if function is kalman else FORMATS:
        fmt, traced = FORMATS[name], TracedFunction(function)
        expected = numbers((fmt.restart(), function(fmt, fmt.array(Z[:24])))[1])
        for few in (0, 10**9):  # in compiled code where the format has it, and in integers of Python
            monkeypatch.setattr(tape, "FEW_OPERATIONS", few)
            assert numbers((fmt.restart(), traced(fmt, Z[:24]))[1]) == expected, name
            assert traced.refusal == ""
            assert bool(traced.reason) == (name == "stochastic")


OPERATIONS = [
    lambda a, b, c: a + b,
    lambda a, b, c: a - b * c,
    lambda a, b, c: a * b,
    lambda a, b, c: a / (abs(b) + 1),
    lambda a, b, c: np.sqrt(abs(a)),
    lambda a, b, c: np.where(a < b, c, -a),
    lambda a, b, c: np.where((a <= b) ^ (b > c), a, b),
    lambda a, b, c: np.clip(a, -1, 2),
    lambda a, b, c: np.maximum(a, b) + 1,
    lambda a, b, c: np.where(~(a == b) | (c != a), abs(c), 0),
    lambda a, b, c: np.where((a < b) == (b < c), a, b),
    lambda a, b, c: np.where(((a > b) != (b > c)) & (a > c), c, -b),
]


def drawn(random):
    """A function of random operations on the entries and rows of a matrix."""
    steps = random.integers(0, 100, (30, 4)).tolist()

    def function(fmt, z):
        known = [*z, z[0] * z[1], fmt.array("0.7"), z[2, 1]]
        for kind, *choice in steps:
            operands = (known[each % len(known)] for each in choice)
            known.append(OPERATIONS[kind % len(OPERATIONS)](*operands))
        return known[6:]

    return function


def test_random_functions(monkeypatch):
    for seed in range(8):
        random = np.random.default_rng(seed)
        function, z = drawn(random), np.round(random.standard_normal((3, 4)), 2)
        for name in FEW:
            fmt, traced = FORMATS[name], TracedFunction(function)
            for few in (0, 10**9):
                monkeypatch.setattr(tape, "FEW_OPERATIONS", few)
                assert numbers(traced(fmt, z)) == numbers(function(fmt, fmt.array(z)))
                assert traced.reason == ""


@pytest.mark.parametrize("few", [0, 10**9])
@pytest.mark.parametrize(
    ("function", "fmt", "kind"),
    [
        (lambda fmt, z: z[1] / (z[0] - 2), BINARY32, ZeroDivisionError),
        (lambda fmt, z: np.sqrt(z - 3), FloatFormat(10, 5), ValueError),
        (lambda fmt, z: np.fmod(z[1], z[0] - 2), FloatFormat(2, 24), ZeroDivisionError),
        (lambda fmt, z: z * z * z, FixedFormat(3, 10), OverflowError),
        (lambda fmt, z: np.exp(z * 40), BINARY32, OverflowError),
        (lambda fmt, z: z + fmt.array("9"), FixedFormat(3, 10), OverflowError),
        (lambda fmt, z: z + fmt.array("nine"), BINARY32, ValueError),
        (lambda fmt, z: z[3], BINARY32, IndexError),
        (lambda fmt, z: linalg.lu(z - z.reshape(2, 1)).upper, BINARY32, np.linalg.LinAlgError),
        (lambda fmt, z: linalg.lu(fmt.array([[1, 1], [1, 1]]) * z[0]).upper, BINARY32, np.linalg.LinAlgError),
    ],
)
def test_errors_are_those_of_the_function(function, fmt, kind, few, monkeypatch):
    monkeypatch.setattr(tape, "FEW_OPERATIONS", few)
    with pytest.raises(kind) as expected:
        function(fmt, fmt.array([2, 5]))
    with pytest.raises(kind) as found:
        TracedFunction(function)(fmt, [2, 5])
    assert str(found.value) == str(expected.value)


REFUSED = [
    (lambda fmt, z: z + 1 if z[0] > 0 else z, "it branches on a comparison"),
    (lambda fmt, z: z + 1 if z[0] else z, "it branches on a number"),
    (lambda fmt, z: z[np.argsort(z)], "it asks for fmt.kernel"),
    (lambda fmt, z: z + int(np.argmax(z)), "it branches on a comparison, or counts or converts it"),
    (lambda fmt, z: z * np.sum(z > 0), "it branches on a comparison, or counts or converts it"),
    (lambda fmt, z: z * 2 if fmt.precision > 9 else z, "it asks for fmt.precision"),
    (lambda fmt, z: z * 2 if fmt == BINARY32 else z, "it asks for its format"),
    (lambda fmt, z: z * 2 if isinstance(fmt, FloatFormat) else z, "it asks for its format"),
    (lambda fmt, z: z * 2 if "24" in f"{fmt}" else z, "it asks for its format"),
    (lambda fmt, z: (peek(z, lambda x: None), z)[1], "it shows values with peek"),
    (lambda fmt, z: linalg.matmul(z, z, sums=FloatFormat(2, 53)), "it asks for fmt.base"),
    (lambda fmt, z: linalg.solve(fmt.eye(8), z, pivot=True), "it branches on a comparison"),
    (lambda fmt, z: {"z": z}, "it returns a dict"),
    (lambda fmt, z: z + np.where(z > 0, 1, 2) * 0, "it chooses between plain numbers"),
    (lambda fmt, z: z + len([x for x in z if x in z[:3]]), "it branches on a comparison"),
    (lambda fmt, z: (z > 0) * z, "it takes arrays of another format, or truth values, as numbers"),
]


@pytest.mark.parametrize(("function", "reason"), REFUSED)
def test_what_cannot_be_traced_runs_as_it_is_and_says_why(function, reason):
    traced = TracedFunction(function)
    fmt = FloatFormat(2, 24)

    def shown(run):
        try:
            found = run()
        except TypeError as error:
            return str(error)
        return numbers(found["z"] if isinstance(found, dict) else found)

    assert shown(lambda: traced(fmt, Z[:8])) == shown(lambda: function(fmt, fmt.array(Z[:8])))
    assert traced.reason.startswith(reason)
    assert traced.refusal == traced.reason
    assert "in line" in traced.reason or "peek" in reason or "returns" in reason


@pytest.mark.parametrize("function", [lambda _, x, y: np.remainder(x, y), TracedFunction(lambda _, x, y: x % y)])
def test_a_remainder_that_is_flushed_on_its_way_is_rounded_once(function):
    """The remainder with the sign of x is below the least number; with the sign of y, it is a number."""
    unit, fmt = Fraction(1, 1024), FloatFormat(2, 5, "nearest", -6, 10, subnormal=False)
    x, y = fmt.array([-25 * unit, 25 * unit]), fmt.array([24 * unit, -24 * unit])
    assert np.fmod(x, y).tolist() == [0, 0]
    assert function(fmt, x, y).tolist() == [23 * unit, -23 * unit]
    assert not getattr(function, "reason", "")


def test_what_a_changing_choice_may_leave_out_changes_with_it():
    """A product of constants runs only if x < 0, so it stands with the operations that depend on x."""
    found = tape.Tape(3)
    truth = found.record("compare", np.array(1), np.array(0), 1)
    product = found.only_if(truth, lambda: found.record("multiply", np.array(2), np.array(3)))
    alone = found.record("add", np.array(2), np.array(3))
    found.record("choose", truth, product, alone)
    once, each = found.once_and_each(np.array([1]))
    assert [row[0] for row in once[0].rows] == [CODES["add"]]
    assert [row[0] for row in each[0].rows] == [CODES[name] for name in ("compare", "skip", "multiply", "choose")]
