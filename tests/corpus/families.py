"""The families of runs: each is a function that draws the inputs of its i-th run, and asks an engine for its steps.

An engine is :mod:`tests.corpus.package` or :mod:`tests.corpus.oracle`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

from tests.corpus.draw import LONG, PRECISIONS, PROCESSORS, ROUNDINGS, Draw, Fixed, Float, Format, Model
from tests.corpus.oracle import rounds

Steps = Iterator[dict[str, Any]]

FORMS = ("Hung", "Hung second gain", "innovation", "Joseph", "UD", "symmetrized", "compensated", "Potter", "Carlson")
LOOPS = FORMS[:5]
FREE = ("innovation", "Joseph", "UD", "symmetrized", "Potter", "Carlson")
"""Forms that take functions in place of matrices."""

DIRECT = ("direct form I", "direct form II", "direct form I transposed", "direct form II transposed")
STRUCTURES = (*DIRECT, *(f"cascade of {each}" for each in DIRECT), "lattice", "state space", "balanced state space")


class Case(NamedTuple):
    """A run: what it is in words, a function of the engine, and its arguments."""

    title: str
    function: str
    arguments: tuple[Any, ...]
    options: dict[str, Any] = {}  # noqa: RUF012

    def steps(self, engine: Any) -> Steps:
        yield from getattr(engine, self.function)(*self.arguments, **self.options)


def _sized(draw: Draw, most: int = 10) -> tuple[Model, int, int]:
    n, m = draw.pick([each for each in (1, 2, 2, 3, 3, 4, 5, 6, 8, 10) if each <= most]), draw.between(1, 3)
    return draw.model(n, m), n, m


def _steps(n: int) -> int:
    return 40 if n < 5 else 16


def kalman(draw: Draw, i: int) -> Case:
    form, fmt = FORMS[i % 9], draw.floating(i // 9 + i % 9)
    model, n, m = _sized(draw, 5 if i % 9 > 4 else 10)
    return Case(f"{form}, {fmt}, n {n}, m {m}", "filtered", (model, draw.signal(_steps(n), m), fmt, form))


def odd_sizes(draw: Draw, i: int) -> Case:
    """Seven and nine states, which no other family has."""
    form, fmt = LOOPS[i % 5], draw.floating(i)
    n, m = (7, 9)[i % 2], draw.between(1, 3)
    return Case(f"{form}, {fmt}, n {n}, m {m}", "filtered", (draw.model(n, m), draw.signal(16, m), fmt, form))


def stochastic(draw: Draw, i: int) -> Case:
    form, fmt = FORMS[i % 9], Float(*((2, 11), (10, 6), (16, 6), (2, 24))[i % 4], "stochastic")
    model, n, m = _sized(draw, 4)
    return Case(f"{form}, {fmt}, n {n}, m {m}", "filtered", (model, draw.signal(30, m), fmt, form))


def fixed_kalman(draw: Draw, i: int) -> Case:
    form, fmt = FORMS[i % 9], draw.fixed(i // 9 + i % 9, draw.between(5, 9))
    model, n, m = _sized(draw, 4)
    if fmt.overflow != "wrap":
        return Case(f"{form}, {fmt}, n {n}, m {m}", "filtered", (model, draw.signal(24, m), fmt, form))
    model, form = model._replace(Phi=model.Phi[:1], H=model.H[:1]), FREE[i % 6]
    return Case(f"{form} as functions, {fmt}, n {n}, m {m}", "as_functions", (model, draw.signal(8, m), fmt, form))


def decayed(draw: Draw, i: int) -> Case:
    """An estimate whose first entry fades below the range of float64 while the gain still changes."""
    form, base = FORMS[i % 7], (2, 16, 10)[i // 7 % 3]
    digits = draw.pick({2: (24, 25, 33), 16: (6, 9), 10: (7, 8, 12)}[base])
    fmt = draw.ranged(Float(base, digits, ROUNDINGS[i % 6]), 0.25)
    fades = Fraction(draw.between(1, 4), 1000)
    Phi, H = [[fades, 0], [0, Fraction(999, 1000)]], [[1, 0], [0, 1]]
    Q = [[Fraction(1, 1000), 0], [0, Fraction(draw.between(1, 4), 1000)]]
    given = [[list(map(Fraction, row)) for row in each] for each in (Phi, H, Q, H, [[1, 0], [0, 100]])]
    model = Model(*([each] for each in given[:4]), [draw.number(5) + 6, draw.number()], given[4])
    z = [[Fraction(0), draw.number(4)] for _ in range(200)]
    return Case(f"{form}, {fmt}, fading by {fades}", "filtered", (model, z, fmt, form))


def named_kalman(draw: Draw, i: int) -> Case:
    names = ("BINARY16", "BINARY32", "BINARY64", "BFLOAT16", "TF32", "FP8_E5M2", "DECIMAL32", "DECIMAL64", "IBM_HEX32")
    name, form = names[i % 9], LOOPS[(i + i // 9) % 5]
    model, n, m = _sized(draw, 6)
    return Case(f"{form}, {name}, n {n}, m {m}", "filtered", (model, draw.signal(30, m), PROCESSORS[name], form))


def long_kalman(draw: Draw, i: int) -> Case:
    form, fmt = FREE[i % 6], draw.floating(i // 6 + i % 6, (3, 2, 10, 16), LONG)
    model, n, m = _sized(draw, 3)
    model = model._replace(Phi=model.Phi[:1], H=model.H[:1])
    return Case(f"{form} as functions, {fmt}, n {n}, m {m}", "as_functions", (model, draw.signal(8, m), fmt, form))


def known_inputs(draw: Draw, i: int) -> Case:
    form, fmt = FORMS[2:][i % 7], draw.floating(i)
    n, m = draw.between(1, 4), draw.between(1, 3)
    model = draw.model(n, m, inputs=True)
    return Case(f"{form} with inputs, {fmt}, n {n}, m {m}", "filtered", (model, draw.signal(24, m), fmt, form))


def sums(draw: Draw, i: int) -> Case:
    order, fused = (("left", True), ("pairwise", False), ("blocked", False), ("blocked", True))[i % 4]
    fmt = Float((2, 16)[i // 4 % 2], (24, 6, 11, 12)[i % 4] if i // 4 % 2 == 0 else (6, 4)[i % 2], ROUNDINGS[i % 6])
    wider = fmt._replace(precision=fmt.precision + 5) if i % 3 == 0 else None
    form = LOOPS[i % 4]
    model, n, m = _sized(draw, 8)
    options = {"sums": (order, fused, 3, wider)}
    title = f"{form}, sums {order}{' fused' if fused else ''}{' wider' if wider else ''}, {fmt}, n {n}, m {m}"
    return Case(title, "filtered", (model, draw.signal(20, m), fmt, form), options)


def records(draw: Draw, i: int) -> Case:
    form, fmt = LOOPS[i % 4], draw.floating(i)
    model, n, m = _sized(draw, 6)
    count = (2, 7, 33)[i % 3]
    signals = [draw.signal(12, m) for _ in range(count)]
    return Case(f"{form}, {count} records, {fmt}, n {n}, m {m}", "recorded", (model, signals, fmt, form))


def _blocks(draw: Draw, i: int) -> dict[str, Float]:
    base = (2, 10, 16)[i % 3]
    widths = [each for each in PRECISIONS[base] if each > (4 if base == 2 else 2)]
    # Loops of another rounding take ten seconds to compile.
    rounding = ("nearest", "chop", "even")[(i + i // 3) % 3]
    return {name: Float(base, draw.pick(widths), rounding) for name in ("state", "gain", "covariance", "innovation")}


def blocks(draw: Draw, i: int) -> Case:
    form, each = LOOPS[i % 5], _blocks(draw, i)
    if each["state"].base != 10 and i % 4 == 0:
        each["sums"] = Float(each["state"].base, 53 if each["state"].base == 2 else 13, each["state"].rounding)
    model, n, m = _sized(draw, 5)
    digits = " ".join(f"{fmt.precision}" for fmt in each.values())
    title = f"{form} in blocks of base {each['state'].base}, {digits}, n {n}, m {m}"
    return Case(title, "filtered", (model, draw.signal(24, m), each["state"], form), {"blocks": each})


def _passage(draw: Draw, motion: str, steps: int) -> tuple[Any, Any, Any]:
    """Noise and first estimate, measurements and inputs of a vehicle that passes a beacon."""
    n = {"moving": 2, "turning": 3, "coasting": 4}[motion]
    Q, R = draw.covariance(n, 0.05, Fraction(1, 256)), draw.covariance(2, 0.05, Fraction(1, 128))
    P0 = draw.covariance(n, 0.5, Fraction(1, 2))
    u = [[draw.number(0.2) - Fraction(1, 5), draw.number(0.1) + Fraction(1, 20)] for _ in range(steps)]
    x, y, z = 4.0, -1.5, []
    for each in u:
        x, y = x + float(each[0]), y + float(each[1])
        distance = math.hypot(0.3 - x, 0.2 - y) + float(draw.number(0.1))
        bearing = math.atan2(0.2 - y, 0.3 - x) + float(draw.number(0.05))
        z.append([Fraction(round(1000 * distance), 1000), Fraction(round(1000 * bearing), 1000)])
    return (Q, R, [Fraction(4), Fraction(-3, 2), Fraction(2), Fraction(1, 4)][:n], P0), z, u


ENDS = ("raise", "saturate")
"""What a fixed-point system does beyond its range, unless it is one of words, which also wraps."""

NONLINEAR: tuple[Format, ...] = (
    Float(2, 8, "even"), Float(2, 24, "chop"), Float(10, 7), Float(16, 6, "chop"), Float(2, 53, "even"), Fixed(9, 30),
    Float(2, 13, "up"), Float(3, 12), Float(10, 12, "down"), Float(2, 60, "odd"), PROCESSORS["BINARY32"],
)  # fmt: skip


def extended(draw: Draw, i: int) -> Case:
    motion, form, fmt = ("moving", "turning", "coasting")[(i + i // 6) % 3], FREE[i % 6], NONLINEAR[(i + i // 6) % 11]
    given, z, u = _passage(draw, motion, 14)
    options: dict[str, Any] = {"iterations": draw.pick((1, 1, 2, 3))}
    if i % 5 == 4 and form in FREE[:3] and not isinstance(fmt, Fixed):
        options["blocks"] = _blocks(draw, i)
    title = f"extended {form}, {motion}, {'in blocks' if 'blocks' in options else fmt}"
    return Case(title, "tracked", (motion, given, z, u, fmt, form), options)


def unscented(draw: Draw, i: int) -> Case:
    motion, fmt = ("moving", "turning", "coasting")[i % 3], NONLINEAR[i % 11]
    given, z, u = _passage(draw, motion, 10)
    options = {"method": "unscented", "points": (Fraction(1, 2), 2, 1)}
    return Case(f"unscented, {motion}, {fmt}", "tracked", (motion, given, z, u, fmt, "innovation"), options)


def smoother(draw: Draw, i: int) -> Case:
    form = ("innovation", "Joseph", "square root")[i % 3]
    fmt: Format = draw.floating(i // 3, (2, 10, 16, 3), {**PRECISIONS, 3: LONG[3]})
    if i % 7 == 6:
        fmt = draw.fixed(i, 8)
    model, n, m = _sized(draw, 3)
    return Case(f"smoother {form}, {fmt}, n {n}, m {m}", "smoothed", (model, draw.signal(12, m), fmt, form))


def _sections(draw: Draw, count: int) -> list[list[Fraction]]:
    """Stable sections of second order: b, and a from a pole of a radius below one."""
    found = []
    for _ in range(count):
        a2, b = draw.between(5, 90), [draw.number(0.5, 3) + Fraction(1, 2), draw.number(), draw.number(0.5, 3)]
        a1 = Fraction(draw.between(-(100 + a2) * 9 // 10, (100 + a2) * 9 // 10), 100)
        found.append([*b, Fraction(1), a1, Fraction(a2, 100)])
    return found


def _system(draw: Draw, i: int) -> tuple[str, str, dict[str, Any], int]:
    """Title, kind, settings and number of inputs of a system."""
    kind = i % 16
    if kind < 11:
        found = STRUCTURES[kind]
        return found, "from_sections", {"sos": _sections(draw, draw.between(1, 2)), "structure": found}, 1
    if kind == 11:
        b = [draw.number(1, 3) or Fraction(1) for _ in range(5)]
        return "FIR", "from_coefficients", {"b": b, "a": [1], "structure": "FIR"}, 1
    if kind == 12:
        return "smoother", "smoother", {"alpha": Fraction(draw.between(1, 900), 1000)}, 1
    if kind == 13:
        limits = {"limits": ("-0.8", "0.9")} if i // 16 % 2 else {"integral_limits": ("-0.25", "0.3"), "Kd": "0.7"}
        return "controller", "pid", {"Kp": "0.8", "Ki": "0.1", "leak": "0.98", **limits}, 1
    if kind == 14:
        order = ("left", "pairwise", "blocked", "tree")[i // 16 % 4]
        block = {"block": 4} if order == "blocked" else {}
        return f"sum {order}", "sum", {"count": 9, "order": order, **block, "running": True}, 9
    A = draw.matrix(3, 3, 0.4, 3, 0.2)
    settings = {"A": A, "B": draw.matrix(3, 2), "C": draw.matrix(2, 3), "D": draw.matrix(2, 2, 1, 2, 0.5)}
    return "matrices", "matrices", {**settings, "x0": [draw.number() for _ in range(3)]}, 2


def systems(draw: Draw, i: int) -> Case:
    title, kind, settings, m = _system(draw, i)
    fmt: Format = (
        draw.floating(i // 16 + i % 16) if i // 16 % 2 == 0 else draw.fixed(i // 16 + i, draw.between(3, 7), ENDS)
    )
    return Case(f"{title}, {fmt}", "responded", (kind, settings, draw.signal(60, m, 1), fmt))


def words(draw: Draw, i: int) -> Case:
    title, kind, settings, m = _system(draw, i * 5 + i // 16)
    rounding, overflow = ROUNDINGS[i % 6], ("saturate", "wrap", "raise")[i % 3]
    data = Fixed(4, (11, 27, 43)[i % 3], rounding, overflow)
    coefficients = (Fixed(4, 11, rounding), 24, None, 12)[i // 2 % 4]
    total = (Fixed(9, 22, rounding, "wrap"), Fixed(12, 51, rounding, "saturate"), None)[i % 3 if i % 4 else 2]
    if total is not None and total.fraction < data.fraction:
        total = Fixed(8, 55, rounding, "wrap")
    arguments = (kind, settings, draw.signal(60, m, 2), data, coefficients, total)
    return Case(f"{title}, data {data}, coefficients {coefficients}, sums {total}", "in_words", arguments)


def functions(draw: Draw, i: int) -> Case:
    index, fmt = i % 4 if i < 8 else i, NONLINEAR[i % 11]
    count = (1, 1, 3, 2)[index] if index < 4 else 2
    return Case(f"system {index} of functions, {fmt}", "stepped", (index, draw.signal(40, count, 1), fmt))


class Questions(NamedTuple):
    """A run whose steps are answers to questions about arrays."""

    title: str
    questions: list[tuple[str, str, tuple[Any, ...], dict[str, Any]]]

    def steps(self, engine: Any) -> Steps:
        for label, function, arguments, options in self.questions:
            yield {label: getattr(engine, function)(*arguments, **options)}


ANY: tuple[Format, ...] = (
    *(Float(base, digits, rounding) for base, digits, rounding in (
        (2, 3, "even"), (2, 11, "nearest"), (2, 24, "even"), (2, 24, "chop"), (2, 25, "odd"), (2, 33, "down"),
        (2, 52, "up"), (2, 53, "even"), (2, 53, "nearest"), (2, 64, "even"), (2, 113, "chop"), (3, 9, "even"),
        (3, 40, "nearest"), (10, 4, "nearest"), (10, 8, "even"), (10, 16, "up"), (10, 17, "chop"), (10, 18, "nearest"),
        (10, 34, "down"), (16, 6, "chop"), (16, 12, "nearest"), (16, 13, "even"), (16, 28, "odd"))),
    Float(2, 5, "down", -6, 7), Float(2, 24, "up", -20, 20, False), Float(2, 11, "chop", -9, 9, True, "saturate"),
    Float(2, 53, "even", -60, 60), Float(10, 7, "even", -9, 9), Float(10, 16, "odd", -20, 20, False),
    Float(16, 6, "chop", -10, 10, False), Float(2, 60, "nearest", -40, 40),
    *PROCESSORS.values(),
    Fixed(3, 4, "nearest"), Fixed(0, 15, "even", "saturate"), Fixed(7, 8, "chop", "wrap"), Fixed(3, 28, "up"),
    Fixed(10, 21, "down", "saturate"), Fixed(5, 40, "odd", "wrap"), Fixed(4, 59, "nearest", "saturate"),
)  # fmt: skip
"""One format of each kind of storage, rounding and range."""

ARITHMETIC = ("add", "subtract", "multiply", "divide", "sqrt", "fused")
WHOLE = ("floor", "ceil", "trunc", "rint", "fmod", "remainder", "maximum", "sort", "sum", "cumsum", "prod", "mean")
WHOLE_NUMBERS = (*WHOLE, "square", "cube")


def elements(draw: Draw, i: int) -> Questions:
    fmt, found = ANY[i % len(ANY)], []
    r = rounds(fmt)
    for operation in (*ARITHMETIC, *WHOLE_NUMBERS):
        batches = 4 if operation in ARITHMETIC else 1
        for _ in range(batches):
            given = draw.operands(fmt, operation, 12, r)
            # A result beyond the range ends an operation on a whole array.
            parts = [given] if getattr(fmt, "emin", None) is None and isinstance(fmt, Float) else _parts(given, 3)
            found += [(operation, "applied", (fmt, operation, part), {}) for part in parts]
    numbers = [draw.number(3, draw.pick((2, 9, 20))) for _ in range(12)]
    found += [(kind, "converted", (fmt, numbers, kind), {}) for kind in ("fractions", "float64", "to float64")]
    return Questions(str(fmt), found)


def _parts(given: list[Any], size: int) -> list[list[Any]]:
    return [given[k : k + size] for k in range(0, len(given), size)]


ELEMENTARY = {
    "exp": 3, "expm1": 1, "exp2": 5, "log": 3, "log1p": 1, "log2": 5, "log10": 50, "cbrt": 9, "sin": 9, "cos": 9,
    "tan": 3, "arcsin": 1, "arccos": 1, "arctan": 5, "sinh": 2, "cosh": 2, "tanh": 2, "arcsinh": 9, "arccosh": 9,
    "arctanh": 1, "deg2rad": 90, "rad2deg": 3, "arctan2": 4, "hypot": 4, "float_power": 3,
}  # fmt: skip
"""Functions, and the size of their arguments."""


def elementary(draw: Draw, i: int) -> Questions:
    fmt = ANY[(i * 5) % 35]
    r, found = rounds(fmt), []
    for name, size in ELEMENTARY.items():
        numbers = []
        while len(numbers) < 6:
            given = [r(draw.number(size, 4)) for _ in range(2 if name in ("arctan2", "hypot", "float_power") else 1)]
            x = given[0]
            if name in ("log", "log2", "log10", "float_power", "hypot") and x <= 0:
                continue
            if (name in ("log1p", "arctanh", "arctan2") and abs(x) >= 1) or (name == "arccosh" and x < 1) or not x:
                continue
            numbers.append(given)
        found.append((name, "applied", (fmt, name, numbers), {}))
    return Questions(str(fmt), found)


def matrices(draw: Draw, i: int) -> Questions:
    fmt = ANY[i % len(ANY)]
    size = 0.4 if isinstance(fmt, Fixed) and fmt.integer < 2 else 1
    n, found = draw.between(3, 6), []

    def ask(label: str, operation: str, *given: Any, **options: Any) -> None:
        found.append((label, "computed", (fmt, operation, given), options))

    def scaled(rows: Any, power: int) -> Any:
        """Entries at an end of the range, where products underflow, or sums overflow."""
        unit = Fraction(2 if isinstance(fmt, Fixed) else fmt.base) ** power
        return [[a * unit for a in row] for row in rows]

    a, b = draw.matrix(n, 11, size), draw.matrix(11, 3, size)
    if isinstance(fmt, Float):
        low, high = (fmt.emin, fmt.emax) if fmt.emin is not None and fmt.emax is not None else (-240, 240)
        for power in (low // 2 - 1, low // 2 + 3, high // 2 - 2, high // 2):
            ask(f"product at {power}", "matmul", scaled(a, power), scaled(b, power))
            ask(f"far product at {power}", "matmul", scaled(a, power), b)
    for order, fused in (("left", False), ("left", True), ("pairwise", False), ("blocked", False), ("blocked", True)):
        ask(f"{order}{' fused' if fused else ''}", "matmul", a, b, order=order, fused=fused, block=4)
    if isinstance(fmt, Float) and fmt.emin is None:
        ask("wider sums", "matmul", a, b, sums=fmt._replace(precision=fmt.precision + 3))
    ask("inner product", "matmul", a[0], [row[0] for row in b])
    square = draw.matrix(n, n, size)
    for k in range(n):
        square[k][k] += square[k][k].numerator and Fraction(2 if size == 1 else 1, 2)
    holds_one = isinstance(fmt, Float) or fmt.integer > 0
    for pivot in (False, True):
        if holds_one:
            ask("lu", "lu", square, pivot=pivot)
            ask("inverse", "inv", square, pivot=pivot)
        ask("solution", "solve", square, [row[:2] for row in square[::-1]], pivot=pivot)
    ask("determinant", "det", square)
    ask("Cholesky", "cholesky", draw.covariance(n, size / 2, Fraction(1, 8)))
    return Questions(f"{fmt}, n {n}", found)


def code(draw: Draw, i: int) -> Case:
    """Systems, filters and functions in C, in floats, words of one format and words of three."""
    short = Fixed(6, 9, ROUNDINGS[i % 6], ("saturate", "wrap", "raise")[i % 3])
    fmt: Any = (
        PROCESSORS["BINARY32"], PROCESSORS["BINARY64"], short,
        Fixed(8, 23, ROUNDINGS[i // 2 % 6], ("saturate", "raise")[i % 2]), Fixed(12, 51, ROUNDINGS[i % 6], "saturate"),
    )[i % 5]  # fmt: skip
    if i % 3 == 0:
        title, kind, settings, m = _system(draw, i // 3 * 7)
        if i % 2 and isinstance(fmt, Fixed):
            fmt = (Fixed(6, 9, "even", "saturate"), Fixed(4, 11), Fixed(11, 20, "chop", "wrap"))
        return _coded(draw, f"{title}, {fmt}", (kind, settings), fmt, None, m)
    if i % 3 == 1:
        form = (*LOOPS, "constant gain")[i // 3 % 6]
        model, n, m = _sized(draw, 4)
        if form == "constant gain":
            model = model._replace(Phi=model.Phi[:1], H=draw.model(n, m).H[:1], Q=model.Q[:1], R=model.R[:1])
        elif isinstance(fmt, Fixed) and (form == "UD" or fmt.fraction > 40 or fmt.overflow == "wrap"):
            fmt = Fixed(8, 23, "even", "saturate")
        return _coded(draw, f"{form}, {fmt}, n {n}, m {m}", ("model", model), fmt, form, m)
    index = i // 3 % 4
    return _coded(draw, f"system {index} of functions, {fmt}", ("steps", index), fmt, None, (1, 1, 3, 2)[index])


def _coded(draw: Draw, title: str, given: Any, fmt: Any, form: str | None, m: int) -> Case:
    return Case(title, "coded", (given, fmt, form, draw.signal(100, m, 1)))


def search(draw: Draw, i: int) -> Case:
    base, rounding = (2, 2, 10, 16)[i % 4], ROUNDINGS[i % 3]
    given: tuple[str, Any]
    if i % 3 == 2:
        title, kind, settings, m = _system(draw, i)
        given, title = (kind, settings), f"precision of {title}, base {base} {rounding}"
        form: dict[str, Any] = {}
    else:
        model, n, m = _sized(draw, 4)
        name = FORMS[i % 9]
        given, form, title = ("model", model), {"form": name}, f"precision of {name}, base {base} {rounding}, n {n}"
    options = {"base": base, "rounding": rounding, **form}
    if i % 6 == 1 and i % 9 < 5:
        options["basis"], title = "bound", f"{title}, bound"
    return Case(title, "searched", ("precision", given, draw.signal(50, m, 2), "0.001"), options)


def fixed_search(draw: Draw, i: int) -> Case:
    if i % 4 == 3:
        model, _, m = _sized(draw, 3)
        options = {"form": LOOPS[i // 4 % 4]}
        return Case(
            "block precisions", "searched", ("blocks", ("model", model), draw.signal(40, m, 2), "0.01"), options
        )
    title, kind, settings, m = _system(draw, i)
    what = "word formats" if i % 4 == 2 else "fraction bits"
    z = draw.signal(60, m, 1)
    return Case(f"{what} of {title}", "searched", (what, (kind, settings), z, "0.01"), {"rounding": ROUNDINGS[i % 6]})


def survey(draw: Draw, i: int) -> Case:
    model, n, m = _sized(draw, 3)
    formats = [Float((2, 10, 16)[i % 3], digits, ROUNDINGS[i % 6]) for digits in (4, 7, 11)]
    signals = [draw.signal(30, m) for _ in range(4)]
    return Case(f"survey, {formats[0]} and more, n {n}", "surveyed", (model, signals, "0.01", formats))


def bound(draw: Draw, i: int) -> Case:
    form, fmt = LOOPS[i % 5], Float(*((2, 24), (2, 16), (10, 8), (16, 6), (2, 40))[i % 5], ROUNDINGS[i % 3])
    n, m = draw.between(1, 3), draw.between(1, 2)
    model = draw.model(n, m)
    Phi = [[[each * Fraction(9, 10) for each in row] for row in model.Phi[0]]]
    model = model._replace(
        Phi=Phi, H=[draw.matrix(m, n, 2)], Q=[draw.covariance(n, 0.3, Fraction(1, 10))], R=model.R[:1]
    )
    return Case(f"guarantee, {form}, {fmt}, n {n}, m {m}", "guaranteed", (model, fmt, 10, form))


class Family(NamedTuple):
    """How many runs a family has, and the function that draws them."""

    count: int
    drawn: Callable[[Draw, int], Case | Questions]


FAMILIES = {
    "kalman": Family(90, kalman), "odd sizes": Family(10, odd_sizes), "stochastic": Family(9, stochastic),
    "fixed kalman": Family(27, fixed_kalman), "decayed": Family(21, decayed), "named kalman": Family(18, named_kalman),
    "long kalman": Family(24, long_kalman), "known inputs": Family(14, known_inputs), "sums": Family(8, sums),
    "records": Family(12, records), "blocks": Family(18, blocks),
    "extended": Family(24, extended), "unscented": Family(11, unscented), "smoother": Family(16, smoother),
    "systems": Family(64, systems), "words": Family(32, words), "functions": Family(16, functions),
    "elements": Family(len(ANY), elements), "elementary": Family(7, elementary), "matrices": Family(len(ANY), matrices),
    "code": Family(30, code), "search": Family(18, search), "fixed search": Family(12, fixed_search),
    "survey": Family(4, survey), "guarantee": Family(15, bound),
}  # fmt: skip
