"""gpbnb.arithmetic.exits: no number leaves a function whose precision is searched, except by peek."""

from __future__ import annotations

import copy
import ctypes
import decimal
import fractions
import io
import math
import operator
import pickle
import statistics
import struct
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.linalg
import scipy.ndimage
import scipy.signal
import scipy.special

from gpbnb import BINARY64, FixedFormat, FloatArray, FloatFormat, linalg, peek
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
    "astype": lambda x: x.astype(float),
    "exact": lambda x: rational.exact(x),
    # Python's numbers
    "float": lambda x: float(x[0]),
    "complex": lambda x: complex(x[0]),
    "int": lambda x: int(x[3]),
    "index": lambda x: operator.index(x[3]),
    "array index": lambda x: np.arange(9)[x[3]],
    "round": lambda x: round(x[0]),
    "floor": lambda x: math.floor(x[0]),
    "divmod": lambda x: divmod(x[0], 1),
    "sqrt": lambda x: math.sqrt(x[0]),
    "Fraction": lambda x: fractions.Fraction(x[0]),
    "Decimal": lambda x: decimal.Decimal(x[0]),
    "statistics": lambda x: statistics.fmean(x),
    "exact statistics": lambda x: statistics.mean(x),
    "fmt.round": lambda x: FMT.round(x[0]),
    # text and bytes
    "str": lambda x: str(x[0]),
    "repr": lambda x: repr(x),
    "f-string": lambda x: f"{x[0]}",
    "percent": lambda x: "%.3f" % x[0],  # noqa: UP031
    "array2string": lambda x: np.array2string(x),
    "pickle": lambda x: pickle.dumps(x),
    "struct": lambda x: struct.pack("d", x[0]),
    "ctypes": lambda x: ctypes.c_double(x[0]),
    # NumPy
    "asarray": lambda x: np.asarray(x),
    "array": lambda x: np.array(x),
    "asarray of objects": lambda x: np.asarray(x, dtype=object),
    "array of a list": lambda x: np.array(list(x)),
    "fromiter": lambda x: np.fromiter(x, float),
    "entry": lambda x: stored(lambda buffer: operator.setitem(buffer, 0, x[0])),
    "out": lambda x: stored(lambda buffer: np.add(x, x, out=buffer)),
    "copyto": lambda x: stored(lambda buffer: np.copyto(buffer, x)),
    "objects to floats": lambda x: objects(x).astype(float),
    "ufunc": lambda x: np.spacing(x),
    "frompyfunc": lambda x: np.frompyfunc(lambda each: each, 1, 1)(x),
    "vectorize": lambda x: np.vectorize(lambda each: each)(x),
    "median": lambda x: np.median(x),
    "lstsq": lambda x: np.linalg.lstsq(np.eye(4), x),
    "nditer": lambda x: [float(each) for each in np.nditer(x)],
    "save": lambda x: np.save(io.BytesIO(), x),
    # SciPy
    "lfilter": lambda x: scipy.signal.lfilter(B, A, x),
    "dlsim": lambda x: scipy.signal.dlsim((B, A, 1.0), x),
    "lu": lambda x: scipy.linalg.lu(x.reshape(2, 2)),
    # other formats
    "longer format": lambda x: FloatFormat(2, 300).array(x),
    "shorter format": lambda x: FloatFormat(2, 8).array(x),
    "another rounding": lambda x: FloatFormat(2, 11, "chop").array(x),
    "fixed point": lambda x: FixedFormat(3, 12).array(x),
    "from another format": lambda x: FMT.array(BINARY64.array(NUMBERS)),
}
NEVER_OPEN = {
    "int",
    "index",
    "array index",
    "round",
    "divmod",
    "Fraction",
    "Decimal",
    "exact statistics",
    "fmt.round",
    "struct",
    "nditer",
    "out",
    "copyto",
    "ufunc",
    "frompyfunc",
    "median",
    "lstsq",
    "array2string",
    "dlsim",
}
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


def test_every_exit_is_refused():
    for name in EXITS:
        with kept_in(FMT) as fmt:
            message = attempt(name, fmt)
        assert message
        if name not in NEVER_OPEN:
            assert (
                "in a function whose precision is searched; needed all numbers in FloatFormat(base=2, precis" in message
            )
            assert attempt(name, FMT) == ""


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


def test_what_stays_in_the_format_is_the_same_as_without_a_search():
    for name in STAYS:
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
