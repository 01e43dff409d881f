"""gpbnb.arithmetic.exits: no number leaves a function whose precision is searched, except by peek."""

from __future__ import annotations

import array
import copy
import ctypes
import decimal
import fractions
import io
import json
import math
import operator
import pickle
import statistics
import struct
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.linalg
import scipy.ndimage
import scipy.signal
import scipy.special

from gpbnb import BINARY64, FixedFormat, FloatArray, FloatFormat, linalg, peek, required_precision
from gpbnb.arithmetic import rational
from gpbnb.arithmetic.exits import kept_in, lifted

FMT = FloatFormat(2, 11)
NUMBERS = [0.5, 0.75, -1.25, 3.0]
B, A = scipy.signal.butter(2, 0.1)


def stored(move):
    """Let a NumPy array take the numbers."""
    buffer = np.zeros(len(NUMBERS))
    move(buffer)
    return buffer


EXITS = {
    # conversions of our own
    "to_float": lambda x: x.to_float(),
    "to_fractions": lambda x: x.to_fractions(),
    "to_pairs": lambda x: x.to_pairs(),
    "tolist": lambda x: x.tolist(),
    "item": lambda x: x.item(0),
    "astype": lambda x: x.astype(float),
    "astype(object)": lambda x: x.astype(object),
    "exact": lambda x: rational.exact(x),
    "norm": lambda x: rational.max_norm(x),
    "rationals": lambda x: rational.rationals(x.reshape(2, 2)),
    # Python's numbers
    "float": lambda x: float(x[0]),
    "complex": lambda x: complex(x[0]),
    "int": lambda x: int(x[3]),
    "index": lambda x: operator.index(x[3]),
    "range": lambda x: range(x[3]),
    "list index": lambda x: NUMBERS[x[3]],
    "array index": lambda x: np.arange(9)[x[3]],
    "round": lambda x: round(x[0]),
    "round to digits": lambda x: round(x[0], 2),
    "floor": lambda x: math.floor(x[0]),
    "trunc": lambda x: math.trunc(x[0]),
    "divmod": lambda x: divmod(x[0], 1),
    "sqrt": lambda x: math.sqrt(x[0]),
    "fsum": lambda x: math.fsum(x),
    "hypot": lambda x: math.hypot(x[0], x[1]),
    "frexp": lambda x: math.frexp(x[0]),
    "Fraction": lambda x: fractions.Fraction(x[0]),
    "Decimal": lambda x: decimal.Decimal(x[0]),
    "statistics": lambda x: statistics.fmean(x),
    "exact statistics": lambda x: statistics.mean(x),
    "fmt.round": lambda x: FMT.round(x[0]),
    "fmt.split": lambda x: FMT.split(x[0]),
    # text and bytes
    "str": lambda x: str(x[0]),
    "repr": lambda x: repr(x),
    "print": lambda x: print(x, file=io.StringIO()),
    "f-string": lambda x: f"{x[0]}",
    "f-string with places": lambda x: f"{x[0]:.3f}",
    "percent": lambda x: "%.3f" % x[0],  # noqa: UP031
    "percent s": lambda x: "%s" % x[0],  # noqa: UP031
    "percent d": lambda x: "%d" % x[0],  # noqa: UP031
    "array2string": lambda x: np.array2string(x),
    "array_str": lambda x: np.array_str(x),
    "json": lambda x: json.dumps(list(x), default=float),
    "pickle": lambda x: pickle.dumps(x),
    "struct": lambda x: struct.pack("d", x[0]),
    "array.array": lambda x: array.array("d", x),
    "ctypes": lambda x: ctypes.c_double(x[0]),
    "memoryview": lambda x: memoryview(x),
    "bytes": lambda x: bytes(x),
    # NumPy
    "asarray": lambda x: np.asarray(x),
    "array": lambda x: np.array(x),
    "asarray of floats": lambda x: np.asarray(x, dtype=np.float64),
    "asarray of objects": lambda x: np.asarray(x, dtype=object),
    "asanyarray": lambda x: np.asanyarray(x),
    "array of a list": lambda x: np.array(list(x)),
    "array of two": lambda x: np.array([x[0], x[1]]),
    "array of objects": lambda x: np.array([x[0], x[1]], dtype=object),
    "array of rows": lambda x: np.array([[x[0], 1.0], [0.0, x[1]]]),
    "float64": lambda x: np.float64(x[0]),
    "fromiter": lambda x: np.fromiter(x, float),
    "entry": lambda x: stored(lambda buffer: operator.setitem(buffer, 0, x[0])),
    "slice": lambda x: stored(lambda buffer: operator.setitem(buffer, slice(None), x)),
    "out": lambda x: stored(lambda buffer: np.add(x, x, out=buffer)),
    "in place": lambda x: stored(lambda buffer: operator.iadd(buffer, x)),
    "copyto": lambda x: stored(lambda buffer: np.copyto(buffer, x)),
    "objects to floats": lambda x: objects(x).astype(float),
    "floor of objects": lambda x: np.floor(objects(x)),
    "ufunc": lambda x: np.spacing(x),
    "ufunc at": lambda x: stored(lambda buffer: np.add.at(buffer, [0], x[0])),
    "accumulate": lambda x: np.add.accumulate(x),
    "frompyfunc": lambda x: np.frompyfunc(lambda each: each, 1, 1)(x),
    "vectorize": lambda x: np.vectorize(lambda each: each)(x),
    "apply_along_axis": lambda x: np.apply_along_axis(np.sum, 0, x),
    "polyval": lambda x: np.polyval(x, 2.0),
    "median": lambda x: np.median(x),
    "fft": lambda x: np.fft.fft(x),
    "lstsq": lambda x: np.linalg.lstsq(np.eye(4), x),
    "svd": lambda x: np.linalg.svd(x.reshape(2, 2)),
    "nditer": lambda x: [float(each) for each in np.nditer(x)],
    "save": lambda x: np.save(io.BytesIO(), x),
    "savetxt": lambda x: np.savetxt(io.StringIO(), x),
    "format_float": lambda x: np.format_float_positional(x[0]),
    # SciPy
    "lfilter": lambda x: scipy.signal.lfilter(B, A, x),
    "filtfilt": lambda x: scipy.signal.filtfilt([1.0], [1.0, 0.5], x, padlen=0),
    "sosfilt": lambda x: scipy.signal.sosfilt(scipy.signal.tf2sos(B, A), x),
    "dlsim": lambda x: scipy.signal.dlsim((B, A, 1.0), x),
    "scipy convolve": lambda x: scipy.signal.convolve(x, x),
    "expit": lambda x: scipy.special.expit(x),
    "expm": lambda x: scipy.linalg.expm(x.reshape(2, 2)),
    "lu": lambda x: scipy.linalg.lu(x.reshape(2, 2)),
    "cumulative_trapezoid": lambda x: scipy.integrate.cumulative_trapezoid(x),
    "interp1d": lambda x: scipy.interpolate.interp1d(NUMBERS, NUMBERS)(x[0]),
    "uniform_filter": lambda x: scipy.ndimage.uniform_filter1d(x, 3),
    # other formats
    "longer format": lambda x: FloatFormat(2, 300).array(x),
    "shorter format": lambda x: FloatFormat(2, 8).array(x),
    "another base": lambda x: FloatFormat(10, 8).array(x),
    "another rounding": lambda x: FloatFormat(2, 11, "chop").array(x),
    "binary64 of a list": lambda x: BINARY64.array([[x[0], 1], [0, x[1]]]),
    "fixed point": lambda x: FixedFormat(3, 12).array(x),
    "from another format": lambda x: FMT.array(BINARY64.array(NUMBERS)),
    "from another format in a list": lambda x: FMT.array([BINARY64.array(0.5), x[0]]),
}
NEVER_OPEN = {
    "int", "index", "range", "list index", "array index", "round", "round to digits", "trunc", "divmod", "Fraction",
    "Decimal", "exact statistics", "fmt.round", "fmt.split", "percent d", "struct", "memoryview", "bytes", "nditer",
    "out", "in place", "copyto", "ufunc", "ufunc at", "accumulate", "frompyfunc", "apply_along_axis", "interp",
    "polyval", "convolve", "median", "fft", "lstsq", "svd", "array2string", "array_str", "savetxt",
    "floor of objects",
    "expit", "dlsim",
}  # fmt: skip
"""What Python, NumPy or an array refuses in a function that is not searched, too."""


def objects(x):
    """Return an object array that holds the numbers themselves."""
    found = np.empty(len(x), object)
    for i, each in enumerate(x):
        found[i] = each
    return found


def attempt(name, fmt):
    """Try an exit; return the messages of the error and of its causes, empty without an error."""
    x = fmt.array(NUMBERS)
    try:
        EXITS[name](x)
    except Exception as error:
        found = [error]
        while (cause := found[-1].__cause__ or found[-1].__context__) is not None:
            found.append(cause)
        return " ".join(map(str, found))
    return ""


@pytest.mark.parametrize("name", EXITS)
def test_every_exit_is_refused(name):
    with kept_in(FMT) as fmt:
        message = attempt(name, fmt)
    assert message
    if name not in NEVER_OPEN:
        assert "in a function whose precision is searched; needed all numbers in FloatFormat(base=2, precis" in message
        assert attempt(name, FMT) == ""


def test_a_message_says_what_to_write():
    with kept_in(FMT) as fmt:
        x = fmt.array(NUMBERS)
        for leave, words in (
            (
                np.asarray,
                r"got a NumPy array of a FloatArray .*write the steps with \+ - .*np.stack; to look at x, write ",
            ),
            (lambda x: math.sqrt(x[0]), r"got float\(\) of a FloatArray .* write np.sqrt\(x\), np.exp\(x\)"),
            (lambda x: int(x[0]), r"got int\(\) of a FloatArray .* choose by comparisons, np.where"),
            (str, r"got text of a FloatArray .*gpbnb.peek\(x, print\)"),
            (BINARY64.array, r"got a conversion from .*precision=11.* to .*precision=53.*linalg.matmul"),
        ):
            with pytest.raises(TypeError, match=words):
                leave(x)


STAYS = {
    "arithmetic": lambda x: (x + 1) * x - x / 2,
    "power": lambda x: np.power(x, 2) + x**3,
    "matrices": lambda x: np.array([[1, 0], [2, 1]]) @ x.reshape(2, 2),
    "comparisons": lambda x: x[0] if x[0] > 0 and max(list(x)) == x[3] and bool(x[1]) and 3.0 in x else None,
    "iteration": lambda x: sum(x) + sorted(x)[0],
    "stack": lambda x: np.stack([each + 1 for each in x]),
    "array of entries": lambda x: FMT.array([[x[0], 0], [1, x[1]]]),
    "array of an array": lambda x: FMT.array(x) + FMT.array(x[0]),
    "where": lambda x: np.where(np.isclose(x, 0.5) | (x < 0), x, 0),
    "order": lambda x: np.sort(x) + x[np.argsort(x)] + x[int(np.argmax(x))],
    "elementary": lambda x: np.exp(x) + np.sin(x) + np.sqrt(abs(x)),
    "pairs": lambda x: np.arctan2(x, x[::-1]) + np.hypot(x, 2) + abs(x) ** 0.5 + x**2 + np.cbrt(x) + 2**x,
    "whole": lambda x: np.floor(x) + np.round(x) + np.round(x, 1) + x % 2 + x // x[0] + np.fmod(x, x[0]),
    "choices": lambda x: np.copysign(np.select([x > 1], [x]), x) + np.append(np.cross(x[:3], x[1:]), 1),
    "copies": lambda x: copy.copy(x) + copy.deepcopy([x])[0] + x.copy(),
    "solution": lambda x: linalg.solve(x.reshape(2, 2), x[:2], pivot=True) + linalg.inv(x.reshape(2, 2))[0],
    "accumulator": lambda x: linalg.dot(x, x, sums=FloatFormat(2, 22)),
    "objects": lambda x: np.sum(objects(x)),
    "einsum": lambda x: np.einsum("i,i->", x, x) + np.mean(x) + np.linalg.norm(x),
}


@pytest.mark.parametrize("name", STAYS)
def test_what_stays_in_the_format_is_the_same_as_without_a_search(name):
    outside = STAYS[name](FMT.array(NUMBERS))
    with kept_in(FMT) as fmt:
        inside = STAYS[name](fmt.array(NUMBERS))
    assert isinstance(inside, FloatArray)
    assert np.all(inside == outside)
    assert inside.to_fractions().tolist() == outside.to_fractions().tolist() if inside.ndim else True


def test_exits_open_again_after_the_run_and_for_code_of_the_library():
    x = FMT.array(NUMBERS)
    with kept_in(FMT):
        with pytest.raises(TypeError, match="got to_float"):
            x.to_float()
        with lifted():
            assert x.to_float().tolist() == NUMBERS
        with pytest.raises(TypeError, match="got to_float"):
            x.to_float()
    assert x.to_float().tolist() == NUMBERS
    with pytest.raises(ZeroDivisionError), kept_in(FMT):
        1 / FMT.array(0)
    assert x.to_float().tolist() == NUMBERS


def test_runs_nest():
    with kept_in(FMT) as outer:
        x = outer.array(NUMBERS)
        with kept_in(replace(FMT, precision=20)) as inner, pytest.raises(TypeError, match=r"needed all .*precision=20"):
            float(inner.array(1))
        with pytest.raises(TypeError, match=r"needed all .*precision=11"):
            float(x[0])


def test_other_threads_are_free_and_those_of_the_function_are_not():
    begun, ended = threading.Event(), threading.Event()
    found = []

    def elsewhere():
        begun.wait(60)
        found.append(float(FMT.array("0.5") * 3))
        ended.set()

    thread = threading.Thread(target=elsewhere)
    thread.start()
    with kept_in(FMT) as fmt:
        x = fmt.array(NUMBERS)
        begun.set()
        assert ended.wait(60)
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(lambda: fmt.array([x[0] + 1, 2])[0]).result(60) == 1.5
            for leave in (lambda: float(x[0] * 2 + 1), lambda: np.asarray(x), lambda: BINARY64.array(x)):
                with pytest.raises(TypeError, match="in a function whose precision is searched"):
                    pool.submit(leave).result(60)
    thread.join()
    assert found == [1.5]


def test_peeked_numbers_arrive_after_the_run_unless_nothing_is_searched():
    seen = []
    peek(FMT.array(0.5), seen.append)
    assert seen[0] == 0.5
    with kept_in(FMT) as fmt:
        x = fmt.array(NUMBERS)
        peek(x / 3, lambda each: seen.append(each.to_float().tolist()))
        with kept_in(fmt):
            peek(("inner", x[0]), lambda pair: seen.append(f"{pair[0]} {pair[1]}"))
        with ThreadPoolExecutor(1) as pool:
            pool.submit(lambda: peek(x[1], lambda each: seen.append(float(each)))).result(60)
        assert len(seen) == 1
    assert seen[1:] == [(FMT.array(NUMBERS) / 3).to_float().tolist(), "inner 0.5", 0.75]


def test_peeked_numbers_of_a_run_that_fails_arrive_too():
    seen = []

    def fails(fmt):
        peek("before the end", seen.append)
        return 1 / fmt.array(0)

    with kept_in(FMT) as fmt, pytest.raises(ZeroDivisionError):
        fails(fmt)
    assert seen == ["before the end"]


# -- questions -------------------------------------------------------------------------------------------------------


Z = np.random.default_rng(0).standard_normal(400)


def filtered(fmt, z):
    """Filter in transposed direct form II, as lfilter does."""
    b, a, s, out = list(map(fmt.array, B)), list(map(fmt.array, A)), [fmt.array(0)] * 2, []
    for value in z:
        y = b[0] * value + s[0]
        s = [b[1] * value - a[1] * y + s[1], b[2] * value - a[2] * y]
        out.append(y)
    return out


def test_a_filter_of_scipy_is_refused_and_its_recursion_needs_more_bits_than_its_rounded_output():
    with pytest.raises(TypeError, match="got a NumPy array of a FloatArray in a function whose precision is searched"):
        required_precision(lambda fmt, z: fmt.array(scipy.signal.lfilter(B, A, z)), Z, 1e-4)
    # Half a unit of the last place of the outputs, below 1, is within the tolerance in 13 bits and more.
    assert required_precision(filtered, Z, 1e-4).digits > 16


def test_a_running_sum_needs_24_bits_and_is_refused_in_numpy():
    def in_format(fmt, z):
        s, out = fmt.array(0), []
        for value in z:
            s = s + value
            out.append(s)
        return out

    for leave in (
        lambda fmt, z: fmt.array(np.cumsum(np.asarray(z))),
        lambda fmt, z: fmt.array(np.cumsum([float(value) for value in z])),
        lambda fmt, z: fmt.array(np.cumsum(z.to_float())),
        lambda fmt, z: FloatFormat(fmt.base, fmt.precision).array(np.cumsum(z.to_fractions())),
    ):
        with pytest.raises(TypeError, match="in a function whose precision is searched"):
            required_precision(leave, [0.1] * 1000, 1e-3)
    assert required_precision(in_format, [0.1] * 1000, 1e-3).digits == 24


def test_a_function_that_peeks_gets_the_answer_of_the_function_itself():
    seen = []

    def with_peek(fmt, z):
        found = filtered(fmt, z)
        peek(found[-1], lambda x: seen.append((x.format.precision, float(x.to_float()))))
        return found

    answer = required_precision(with_peek, Z, 1e-4)
    assert answer.tried == required_precision(filtered, Z, 1e-4).tried
    last = dict(seen)
    processors = 1 if answer.processor_format == "binary32" else 2
    assert len(seen) == len(answer.tried) + processors + 2  # and two references
    assert abs(last[answer.digits] - last[max(last)]) <= 1e-4
