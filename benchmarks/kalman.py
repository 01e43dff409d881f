"""One step of a Kalman filter, n = 10, m = 2, each of its seven thousand operations rounded; and whole emulations."""

from __future__ import annotations

import ctypes
import decimal
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.timing import Row, medians, rows
from gpbnb.arithmetic import named
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.loop import Loop
from gpbnb.arithmetic.tape import Tape
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.emulation import emulate
from gpbnb.filters.forms import Form
from gpbnb.filters.model import LinearModel
from gpbnb.filters.nonlinear_run import opened

N, M = 10, 2
STEPS = 20  # in one call
C_SOURCE = Path(__file__).parent / "kalman.c"


def step(Phi: Any, PhiT: Any, Q: Any, H: Any, HT: Any, R: Any, z: Any, identity: Any, x0: Any, P0: Any) -> Any:
    """The step on arrays of a format, which is recorded."""
    V = Phi @ P0 @ PhiT + Q
    PHt = V @ HT
    (a, b), (c, d) = H @ PHt + R
    determinant = a * d - b * c
    first, second = np.stack([d / determinant, -(b / determinant)]), np.stack([-(c / determinant), a / determinant])
    K = PHt @ np.stack([first, second])
    u = Phi @ x0
    return u + K @ (z - H @ u), (identity - K @ H) @ V


def numpy_step(model: Any, x0: Any, P0: Any) -> tuple[Any, Any]:
    """The same in float64, unrounded, as one writes it in NumPy."""
    Phi, PhiT, Q, H, HT, R, z, identity = model
    V = Phi @ P0 @ PhiT + Q
    PHt = V @ HT
    S = H @ PHt + R
    (a, b), (c, d) = S.tolist()
    K = PHt @ (np.array([[d, -b], [-c, a]]) / (a * d - b * c))
    u = Phi @ x0
    return u + K @ (z - H @ u), (identity - K @ H) @ V


def plain_step(model: Any, x0: Any, P0: Any) -> tuple[Any, Any]:
    """The same on nested lists of any numbers with operators, in the same order."""
    Phi, PhiT, Q, H, HT, R, z, identity = model

    def product(A: Any, B: Any) -> Any:
        columns = list(zip(*B, strict=True))
        result = []
        for row in A:
            line = []
            for column in columns:
                s = row[0] * column[0]
                for p, q in zip(row[1:], column[1:], strict=True):
                    s = s + p * q
                line.append(s)
            result.append(line)
        return result

    def total(A: Any, B: Any) -> Any:
        return [[p + q for p, q in zip(r, s, strict=True)] for r, s in zip(A, B, strict=True)]

    def difference(A: Any, B: Any) -> Any:
        return [[p - q for p, q in zip(r, s, strict=True)] for r, s in zip(A, B, strict=True)]

    V = total(product(product(Phi, P0), PhiT), Q)
    PHt = product(V, HT)
    (a, b), (c, d) = total(product(H, PHt), R)
    determinant = a * d - b * c
    K = product(PHt, [[d / determinant, -(b / determinant)], [-(c / determinant), a / determinant]])
    u = product(Phi, x0)
    x = total(u, product(K, difference(z, product(H, u))))
    return x, product(difference(identity, product(K, H)), V)


def model(n: int = N) -> tuple[Any, ...]:
    """A stable model with no zeros in it, and where to start."""
    rng = np.random.default_rng(10)
    Phi = 0.9 * np.eye(n) + 0.3 / n * rng.standard_normal((n, n))
    H = rng.standard_normal((M, n))
    A = rng.standard_normal((n, n))
    Q, R = 0.01 * np.eye(n) + 1e-3, np.array([[1.0, 0.1], [0.1, 1.0]])
    parts = (Phi, Phi.T, Q, H, H.T, R, rng.standard_normal((M, 1)), np.eye(n))
    return parts, rng.standard_normal((n, 1)), A @ A.T / n + np.eye(n)


def compiled(fmt: FloatFormat) -> tuple[Callable[[int], Any], Any]:
    """A call that takes steps on the machine in a format, and the step's operands as nested lists of Fractions."""
    given, x0, P0 = model()
    arrays = [fmt.array(a) for a in (*given, x0, P0)]
    ends = np.cumsum([1, *(a.size for a in arrays)])
    places = [np.arange(begin, begin + a.size).reshape(a.shape) for a, begin in zip(arrays, ends, strict=False)]
    tape = Tape(int(ends[-1]) - 1)
    after = [each.components[0].ravel() for each in step(*map(TracedFormat(tape).made, places))]
    rows, states = tape.instructions.astype(np.int64), np.concatenate([each.ravel() for each in places[-2:]])
    loop = Loop([fmt], rows, np.zeros(len(rows), np.int64), tape.sizes, states, np.concatenate(after))
    loop.hold_constants(tape.all_constants)
    packed = [a.backend.pack(a.components) for a in arrays]
    for each, numbers in zip(places, packed, strict=True):
        loop.hold(each.ravel(), numbers.reshape(each.size, *numbers.shape[2:]))
    start = loop.states

    def run(steps: int) -> Any:
        loop.states = start
        loop.take(0, steps)
        numbers = FloatArray.from_packed(loop.states.reshape(-1, *packed[0].shape[2:]), fmt).to_fractions()
        return numbers[:N, np.newaxis], numbers[N:].reshape(N, N)

    return run, [a.to_fractions().tolist() for a in arrays]


def as_decimal(x: Fraction) -> decimal.Decimal:
    """Exact; the number has a decimal expansion."""
    with decimal.localcontext(prec=200):
        return decimal.Decimal(x.numerator) / decimal.Decimal(x.denominator)


def c_steps() -> Callable[[Any, Any, Any, Any, Any, int], None] | None:
    """Compile ``kalman.c``, the same loop written by hand for float, with gcc -O2; None without gcc."""
    if shutil.which("gcc") is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "kalman.so"
        command = ["gcc", "-std=c99", "-O2", "-shared", "-fPIC", f"-DN={N}", f"-DM={M}", "-o", library, C_SOURCE]
        subprocess.run(command, check=True)
        function = ctypes.CDLL(str(library)).steps
    function.restype = None

    def run(model: Any, x0: Any, P0: Any, x: Any, P: Any, steps: int) -> None:
        function(*(ctypes.c_void_p(a.ctypes.data) for a in (*model, x0, P0, x, P)), ctypes.c_int(steps))

    return run


def measure_binary32() -> list[Row]:
    """Beside NumPy in float32 and C, in the same arithmetic."""
    single, _ = compiled(named.BINARY32)
    *given, x0, P0 = (np.ascontiguousarray(a, np.float32) for a in (*model()[0], *model()[1:]))
    times = medians({"gpbnb": partial(single, 10 * STEPS), "empty": partial(single, 0)}, 200)
    step = {"gpbnb": (times["gpbnb"] - times["empty"]) / (10 * STEPS)}
    step |= medians({"numpy float32": lambda: numpy_step(given, x0, P0)}, 2000)
    if (in_c := c_steps()) is not None:
        x, P = np.empty_like(x0), np.empty_like(P0)
        in_c(given, x0, P0, x, P, 1)
        if any(not np.array_equal(a.astype(float), b) for a, b in zip(single(1), (x, P), strict=True)):
            raise RuntimeError("gpbnb and C differ")
        times = medians({"c": partial(in_c, given, x0, P0, x, P, 10 * STEPS)}, 200)
        step["C, gcc -O2"] = times["c"] / (10 * STEPS)
    return rows("Kalman step, binary32", step, "gpbnb", {"numpy float32": 1 / 0.15, "C, gcc -O2": 1 / 2})


def measure() -> list[Row]:
    """Base 2 at 24 bits beside NumPy unrounded, base 10 beside ``decimal`` in the same order."""
    given, x0, P0 = model()
    run, _ = compiled(FloatFormat(2, 24))
    times = medians({"gpbnb": partial(run, STEPS), "empty": partial(run, 0)}, 200)
    step = {"gpbnb": (times["gpbnb"] - times["empty"]) / STEPS}
    step |= medians({"numpy, unrounded": lambda: numpy_step(given, x0, P0)}, 2000)
    table = rows("Kalman step, 24 bits", step, "gpbnb", {"numpy, unrounded": 1})
    ranged, _ = compiled(named.BINARY32)
    times = medians(
        {
            "gpbnb": partial(ranged, 10 * STEPS),
            "empty": partial(ranged, 0),
            "gpbnb, 24 bits, no range": partial(run, 10 * STEPS),
        },
        200,
    )
    step = {name: (times[name] - times["empty"]) / (10 * STEPS) for name in times if name != "empty"}
    table += rows("Kalman step, binary32, ties to even", step, "gpbnb", {"gpbnb, 24 bits, no range": 1 / 1.2})
    for precision, least in ((8, 30), (17, 10)):
        run, operands = compiled(FloatFormat(10, precision))
        exact = [[[as_decimal(x) for x in row] for row in a] for a in operands]
        context = decimal.Context(prec=precision, rounding=decimal.ROUND_HALF_UP)

        def with_decimal(context: Any = context, exact: Any = exact) -> Any:
            with decimal.localcontext(context):
                return plain_step(exact[:-2], exact[-2], exact[-1])

        for computed, expected in zip(run(1), with_decimal(), strict=True):
            if computed.tolist() != [[Fraction(x) for x in row] for row in expected]:
                raise RuntimeError("gpbnb and decimal differ")
        times = medians({"gpbnb": partial(run, STEPS), "empty": partial(run, 0), "decimal": with_decimal}, 100)
        step = {"gpbnb": (times["gpbnb"] - times["empty"]) / STEPS, "decimal": times["decimal"]}
        table += rows(f"Kalman step, {precision} decimal digits", step, "gpbnb", {"decimal": least})
    return table + measure_binary32() + measure_emulation()


def measure_emulation() -> list[Row]:
    """``emulate``, whose reference and errors may take twice the time of its run, beside the run alone."""
    table: list[Row] = []
    for n, steps, turns in ((10, 1000, 20), (50, 100, 5)):
        (Phi, _, Q, H, _, R, *_), x0, P0 = model(n)
        given = LinearModel(Phi=Phi, H=H, Q=Q, R=R, x0=x0[:, 0], P0=(P0 + P0.T) / 2)
        z = np.random.default_rng(n).standard_normal((steps, M))
        runs = iter([opened(given, named.BINARY32, Form.INNOVATION) for _ in range(turns + 1)])

        def alone(runs: Iterator[Any] = runs, z: Any = z) -> None:
            next(runs).take(z)

        works: dict[str, Callable[[], object]] = {
            "gpbnb": partial(emulate, given, z, named.BINARY32),
            "its run": alone,
        }
        times = medians(works, turns)
        table += rows(f"emulate {steps} steps, n = {n}, binary32", times, "gpbnb", {"its run": 1 / 3})
    return table
