"""The same questions answered without the package: exact fractions, each result rounded by its definition.

The functions have the names and arguments of those in :mod:`tests.corpus.package`. A question without an answer here
raises NotImplementedError. Quantities that are missing in a step are not compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from functools import cache
from math import ceil, floor, isqrt, trunc
from typing import Any

import gmpy2
import mpmath
from gmpy2 import mpq

from tests import independent_filter, plain_blocks, plain_nonlinear, plain_structures
from tests.corpus.draw import Fixed, Float, Format, Model
from tests.plain_smoothing import Plain
from tests.plain_structures import exponent, fixed, floating, limited

Steps = Iterator[dict[str, Any]]
Rounding = Callable[[Fraction], Fraction]


def rounds(fmt: Format) -> Rounding:
    """A function that rounds a number to a format; OverflowError beyond the range of one that raises."""
    if fmt.rounding == "stochastic":
        raise NotImplementedError("random numbers of the package")
    if isinstance(fmt, Fixed):
        r, keep = fixed(fmt.fraction, fmt.rounding), limited(fmt.fraction, fmt.integer, fmt.overflow)
        return lambda x: keep(r(x))
    r = floating(fmt.base, fmt.precision, fmt.rounding, fmt.emin, fmt.subnormal)
    if fmt.emax is None:
        return r
    top = fmt.largest
    if top is None:
        top = (fmt.base**fmt.precision - 1) * Fraction(fmt.base) ** (fmt.emax - fmt.precision + 1)

    def in_range(x: Fraction) -> Fraction:
        found = r(x)
        if abs(found) <= top:
            return found
        if fmt.overflow == "saturate":
            return top if found > 0 else -top
        raise OverflowError

    return in_range


# -- filters ----------------------------------------------------------------------------------------------------------


class Numbers(independent_filter.Arithmetic):
    """The arithmetic of the independent filter, in any format."""

    def __init__(self, fmt: Format) -> None:
        super().__init__(fmt.base if isinstance(fmt, Float) else 2, fmt.precision if isinstance(fmt, Float) else 1)
        self.r, self.spacing = rounds(fmt), None
        #: Whether numbers are kept in float64, and whether one has left its range.
        self.by_float64 = isinstance(fmt, Float) and fmt.base != 10 and fmt.emin is None
        self.left = False
        if isinstance(fmt, Fixed):
            self.spacing, self.rounding = fmt.fraction, fmt.rounding
            self.digits = fmt.integer + fmt.fraction
        else:
            self.rounding = fmt.rounding

    def fit(self, p: int, q: int = 1, e: int = 0) -> tuple[int, int]:
        x = self.r(Fraction(p, q) * Fraction(self.base) ** e)
        if not x:
            return 0, 0
        self.left |= self.by_float64 and abs(x) < _LEAST
        e = -self.spacing if self.spacing is not None else exponent(x, self.base) - self.digits + 1
        return int(x / Fraction(self.base) ** e), e


_LEAST, _DECAYED = Fraction(1, 2**960), Fraction(1, 2**700)


class Filter(independent_filter.Filter):
    """The independent filter with the further forms that update a covariance.

    Where a step would leave the range of float64, entries of the estimate below 2**-700 become zero before it.
    """

    def step(self, z: Any) -> list[Fraction]:
        fmt, before = self.fmt, dict(vars(self))
        fmt.left = False
        found = super().step(z)
        if not fmt.left:
            return found
        vars(self).update(before)
        for name in ("x", "carried"):
            kept = zip(getattr(self, name), before["x"], strict=True)
            setattr(self, name, [a if abs(fmt.value(x[0])) >= _DECAYED else [(0, 0)] for a, x in kept])
        return super().step(z)

    def _step(self, k: int, z: Any) -> None:
        fmt = self.fmt
        if self.form == "compensated":
            Phi, before = self.Phi[k % len(self.Phi)], self.x
            super()._step(k, z)
            H, unit = self.H[k % len(self.H)], fmt.values(fmt.unit(len(Phi)))
            exact = self.exact_Phi[k % len(self.exact_Phi)]
            increment = fmt.stored(
                [[a - b for a, b in zip(*rows, strict=True)] for rows in zip(exact, unit, strict=True)]
            )
            d = fmt.product(increment, before)
            innovation = fmt.difference(z, fmt.product(H, fmt.sum(before, d)))
            d = fmt.difference(fmt.sum(d, fmt.product(self.K, innovation)), self.carried)
            self.x = fmt.sum(before, d)
            self.carried = fmt.difference(fmt.difference(self.x, before), d)
            return
        super()._step(k, z)
        if self.form == "symmetrized":
            P, n = self.P, len(self.P)
            self.P = [
                [fmt.divide(fmt.add(P[i][j], P[j][i]), fmt.store(Fraction(2))) for j in range(n)] for i in range(n)
            ]


class Summed(Numbers):
    """Sums of products in another order, with fused multiply-add, or in more digits."""

    def __init__(self, fmt: Float, order: str, fused: bool, block: int, wider: Float | None) -> None:
        super().__init__(fmt)
        self.inner, self.sums = Numbers(wider or fmt), (order, fused, block)

    def dot(self, row: Any, column: Any) -> tuple[int, int]:
        order, fused, block = self.sums
        x, y = ([self.value(each) for each in part] for part in (row, column))
        return self.store(summed(self.inner.r, x, y, order, fused, block))


def summed(r: Any, x: Any, y: Any, order: str, fused: bool, block: int) -> Any:
    """An inner product, each result rounded by r."""

    def in_a_row(first: int, end: int) -> Any:
        total = r(x[first] * y[first])
        for k in range(first + 1, end):
            total = r(x[k] * y[k] + total) if fused else r(total + r(x[k] * y[k]))
        return total

    def halved(first: int, end: int) -> Any:
        middle = (first + end) // 2
        return r(x[first] * y[first]) if end - first == 1 else r(halved(first, middle) + halved(middle, end))

    if order == "pairwise":
        return halved(0, len(x))
    step = block if order == "blocked" else len(x)
    total, *others = (in_a_row(k, min(k + step, len(x))) for k in range(0, len(x), step))
    for each in others:
        total = r(total + each)
    return total


def filtered(model: Model, z: Any, fmt: Format, form: str, **options: Any) -> Steps:
    if options.get("compensated") and form == "innovation":
        form, options = "compensated", {}
    if "blocks" in options:
        yield from _in_blocks(model, z, form, **options["blocks"])
        return
    if options.get("compensated") or model.inputs or form in ("Potter", "Carlson"):
        raise NotImplementedError
    numbers = Summed(fmt, *options["sums"]) if "sums" in options else Numbers(fmt)
    found = Filter(independent_filter.Model(*model[:6]), numbers, form.lower())
    found.exact_Phi, found.carried = model.Phi, [[(0, 0)] for _ in model.x0]
    for row in z:
        try:
            x = found.step(row)
        except (OverflowError, ZeroDivisionError):
            return
        if form == "UD":
            yield {"x": x, "P": _of_factors(numbers.values(found.U))}
        else:
            yield {"x": x, "K": numbers.values(found.K), "P": numbers.values(found.P)}


def _in_blocks(model: Model, z: Any, form: str, sums: Float | None = None, **formats: Float) -> Steps:
    """The model is stored with the digits of the widest block."""
    widest = max(formats.values(), key=lambda each: each.precision)
    stored = definite(model, widest)
    each = {name: plain_blocks.Rounds(rounds(fmt), rounds(sums or fmt)) for name, fmt in formats.items()}
    given = {**dict(zip(("Phi", "H", "Q", "R"), (cycle[0] for cycle in stored[:4]), strict=True)), "x0": stored.x0}
    plain = plain_blocks.Filter({**given, "P0": stored.P0}, form, rounds(widest), each)
    cycles = [[[list(map(plain.model, row)) for row in one] for one in cycle] for cycle in stored[:4]]
    factored = [plain_blocks.factors(plain.model, one) for one in cycles[2]]
    for k, row in enumerate(z):
        plain.Phi, plain.H, plain.Q, plain.R = (cycle[k % len(cycle)] for cycle in cycles)
        plain.UQ = factored[k % len(factored)]
        measured = [[each["state"].store(a)] for a in row]
        step = plain.step_ud if form == "UD" else plain.step_with_covariance
        try:
            K = step(plain.H, plain.R, measured)
        except (OverflowError, ZeroDivisionError):
            return
        x = [row[0] for row in plain.x]
        yield {"x": x, "P": _of_factors(plain.P)} if form == "UD" else {"x": x, "K": K, "P": plain.P}


def recorded(model: Model, records: Any, fmt: Format, form: str) -> Steps:
    each = [filtered(model, [[Fraction(float(a)) for a in row] for row in z], fmt, form) for z in records]
    for steps in zip(*each, strict=True):
        columns = [step["x"] for step in steps]
        yield {"x": [[str(float(a)) for a in row] for row in zip(*columns, strict=True)]}


def _of_factors(U: Any) -> Any:
    """U D U', with D on the diagonal of U."""
    n = len(U)
    unit = [[U[i][j] if i < j else Fraction(i == j) for j in range(n)] for i in range(n)]
    return [[sum(unit[i][k] * U[k][k] * unit[j][k] for k in range(n)) for j in range(n)] for i in range(n)]


class Linear:
    """Products of a matrix with a state, as functions of a plain filter."""

    def __init__(self, matrix: Any) -> None:
        self.matrix = matrix

    def plain(self, r: Rounding, x: Any, u: Any) -> Any:
        given = [[r(each) for each in row] for row in self.matrix]
        return [row[0] for row in plain_nonlinear.PlainMatrices(r).times(given, [[each] for each in x])], given


class Extended(plain_nonlinear.PlainFilter):
    """An extended filter, whose last measurement is an angle or not."""

    angle = True

    def step(self, z: Any, u: Any) -> None:
        if self.angle:
            super().step(z, u)
            return
        r = self.r
        z = [r(Fraction(each)) for each in z]
        ahead, F = self.motion.plain(r, self.x, u)
        V = self.predicted(self.covariance.take(F))
        expected, H = self.sight.plain(r, ahead, u)
        self.x, self.P = self.updated(ahead, V, H, [r(a - b) for a, b in zip(z, expected, strict=True)])


PLAIN_FORMS = ("innovation", "Joseph", "UD")


def as_functions(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    if form in ("Potter", "Carlson", "symmetrized"):
        raise NotImplementedError
    parts = (Linear(model.Phi[0]), Linear(model.H[0]))
    plain, *others = (Extended(*parts, (Q, R, model.x0, model.P0), form, rounds(fmt)) for Q in model.Q for R in model.R)
    plain.angle, noise = False, [(each.Q, each.R) for each in (plain, *others)]
    for k, row in enumerate(z):
        plain.Q = noise[k % len(model.Q) * len(model.R)][0]
        plain.R = noise[k % len(model.R)][1]
        try:
            plain.step(row, [])
        except (OverflowError, ZeroDivisionError, ValueError):
            return
        yield {"x": list(plain.x), "P": _of_factors(plain.P) if form == "UD" else plain.P}


def tracked(motion: str, given: Any, z: Any, u: Any, fmt: Format, form: str, **options: Any) -> Steps:
    sight = plain_nonlinear.Ranges([Fraction(3, 10), Fraction(1, 5)])
    moved = {"moving": plain_nonlinear.Moving, "turning": plain_nonlinear.Turning, "coasting": plain_nonlinear.Coasting}
    blocks = options.get("blocks")
    if form not in PLAIN_FORMS:
        raise NotImplementedError
    if blocks:  # the model is stored in the widest format first
        raise NotImplementedError
    r = rounds(fmt)
    if options.get("method") == "unscented":
        plain: Any = plain_nonlinear.PlainUnscented(moved[motion](), sight, given, form, r)
    else:
        plain = Extended(moved[motion](), sight, given, form, r, iterations=options["iterations"])
    yield from _followed(plain, z, u, form)


def _followed(plain: Any, z: Any, u: Any, form: str) -> Steps:
    for measured, known in zip(z, u, strict=True):
        try:
            plain.step(measured, known)
        except (OverflowError, ZeroDivisionError, ValueError):
            return
        yield {"x": list(plain.x), "P": _of_factors(plain.P) if form == "UD" else plain.P}


class Rounded(Plain):
    """Loops over matrices in any format."""

    def __init__(self, fmt: Format) -> None:
        self.r = rounds(fmt)
        self.fl = lambda x: mpq(self.r(exactly(x)))
        self.root = lambda x: mpq(self.r(root(exactly(x))))


class Smoother(Rounded):
    """The same, with an inverse that subtracts products in place of adding negative ones."""

    def inv(self, a: Any, pivot: bool) -> Any:
        return plain_nonlinear.inverse(self.fl, a)


def exactly(x: Any) -> Fraction:
    return Fraction(int(x.numerator), int(x.denominator))


def root(x: Fraction) -> Fraction:
    """The square root, or a number that rounds as it does."""
    p, q = isqrt(x.numerator), isqrt(x.denominator)
    if p * p == x.numerator and q * q == x.denominator:
        return Fraction(p, q)
    shift = 900 - (x.numerator.bit_length() - x.denominator.bit_length()) // 2
    scale = Fraction(2) ** shift
    return Fraction(2 * isqrt(floor(x * scale**2)) + 1, 2) / scale


def smoothed(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    plain = Smoother(fmt)
    try:
        if form == "square root":
            found = plain.by_roots(model, z)
        else:
            found = plain.by_covariances(definite(model, fmt), z, form == "Joseph")
    except (OverflowError, ZeroDivisionError) as error:
        yield {"end": ended(error)}
        return
    for x, P in found:
        yield {"x": [exactly(row[0]) for row in x], "P": [[exactly(each) for each in row] for row in P]}


def definite(model: Model, fmt: Format) -> Model:
    """The model whose covariances stay definite when the format stores them."""
    numbers, to = Numbers(fmt), independent_filter.storable
    Q, R = [to(numbers, each, False) for each in model.Q], [to(numbers, each, True) for each in model.R]
    return model._replace(Q=Q, R=R, P0=to(numbers, model.P0, False))


def ended(error: Exception) -> str:
    return "overflow" if isinstance(error, OverflowError) else "division by zero"


# -- systems ----------------------------------------------------------------------------------------------------------


def responded(kind: str, settings: dict[str, Any], u: Any, fmt: Format) -> Steps:
    yield from _outputs(kind, settings, u, plain_structures.uniform(rounds(fmt)))


def in_words(kind: str, settings: dict[str, Any], u: Any, data: Fixed, coefficients: Any, sums: Fixed | None) -> Steps:
    if isinstance(coefficients, int):
        coefficient = floating(2, coefficients, "nearest")
    else:
        coefficient = rounds(coefficients or data)
    yield from _outputs(kind, settings, u, plain_structures.words(coefficient, data, sums))


def _outputs(kind: str, settings: dict[str, Any], u: Any, f: Any) -> Steps:
    try:
        for y in _response(kind, settings, u, f):
            yield {"y": [y]}
    except OverflowError:
        yield {"end": "overflow"}


def _response(kind: str, settings: dict[str, Any], u: Any, f: Any) -> list[Fraction]:
    first = [row[0] for row in u]
    if kind == "smoother":
        return plain_structures.smoother(settings["alpha"], first, f)
    if kind == "from_coefficients":
        return plain_structures.direct_1(settings["b"], [], first, f)
    if kind == "pid":
        given = dict.fromkeys(("Kd", "limits", "integral_limits", "back"))
        numbers = {name: Fraction(value) for name, value in settings.items() if not isinstance(value, tuple)}
        limits = {name: tuple(map(Fraction, value)) for name, value in settings.items() if isinstance(value, tuple)}
        return plain_structures.pid({**given, **numbers, **limits}, first, f)
    if kind != "from_sections" or settings["structure"].startswith("balanced"):
        raise NotImplementedError
    sections, structure = [(row[:3], row[4:]) for row in settings["sos"]], settings["structure"]
    if "direct" in structure:
        return plain_structures.cascade(sections, structure.removeprefix("cascade of "), first, f)
    b, a = [Fraction(1)], [Fraction(1)]
    for top, bottom in sections:
        b, a = _product(b, top), _product(a, [Fraction(1), *bottom])
    if structure == "lattice":
        return plain_structures.lattice(*_reflections(b, a), first, f)
    n = len(a) - 1
    A = [[-each for each in a[1:]], *([Fraction(i == j) for j in range(n)] for i in range(n - 1))]
    C = [[x - b[0] * y for x, y in zip(b[1:], a[1:], strict=True)]]
    return plain_structures.state_space(A, [[Fraction(i == 0)] for i in range(n)], C, [[b[0]]], first, f)


def _product(p: Any, q: Any) -> list[Fraction]:
    found = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            found[i + j] += a * b
    return found


def _reflections(b: Any, a: Any) -> tuple[list[Fraction], list[Fraction]]:
    """Reflection coefficients and taps, by stepping down the order."""
    k, v = [], []
    while len(a) > 1:
        k, v = [a[-1], *k], [b[-1], *v]
        b = [x - b[-1] * y for x, y in zip(b[:-1], a[:0:-1], strict=True)]
        a = [(x - a[-1] * y) / (1 - a[-1] ** 2) for x, y in zip(a[:-1], a[:0:-1], strict=True)]
    return k, [b[0], *v]


def stepped(index: int, u: Any, fmt: Format) -> Steps:
    if index < 4:
        raise NotImplementedError
    step, r = plain_nonlinear.drawn(index)[1], rounds(fmt)
    try:
        x, rows = [r(Fraction(each)) for each in ("0.3", "-0.2", "0")], []
        for row in u:
            x, y = step(r, x, [r(each) for each in row])
            rows.append({"x": [*x, *y]})
    except (OverflowError, ZeroDivisionError) as error:
        rows = [{"end": ended(error)}]
    yield from rows


# -- arrays -----------------------------------------------------------------------------------------------------------


def _whole(x: list[Fraction], r: Rounding, combine: Callable[[Fraction, Fraction], Fraction]) -> list[Fraction]:
    found = [x[0]]
    for each in x[1:]:
        found.append(r(combine(found[-1], each)))
    return found


EACH: dict[str, Callable[..., Fraction]] = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "fused": lambda x, y, z: x * y + z,
    "sqrt": root,
    "floor": lambda x: Fraction(floor(x)),
    "ceil": lambda x: Fraction(ceil(x)),
    "trunc": lambda x: Fraction(trunc(x)),
    "rint": lambda x: Fraction(round(x)),
    "fmod": lambda x, y: x - y * trunc(x / y),
    "remainder": lambda x, y: x - y * floor(x / y),
    "maximum": max,
}
"""Operations on each entry; a result is rounded once."""

ALL: dict[str, Callable[[list[Fraction], Rounding], list[Fraction]]] = {
    "sort": lambda x, r: sorted(x),
    "sum": lambda x, r: _whole(x, r, lambda a, b: a + b)[-1:],
    "cumsum": lambda x, r: _whole(x, r, lambda a, b: a + b),
    "prod": lambda x, r: _whole(x, r, lambda a, b: a * b)[-1:],
    "mean": lambda x, r: [r(_whole(x, r, lambda a, b: a + b)[-1] / r(Fraction(len(x))))],
    "square": lambda x, r: [r(a * a) for a in x],
    "cube": lambda x, r: [r(r(a * a) * a) for a in x],
}
"""Operations on an array."""


def applied(fmt: Format, operation: str, operands: Any) -> list[Fraction] | str:
    r = rounds(fmt)
    try:
        if operation in ALL:
            return ALL[operation]([each[0] for each in operands], r)
        function = EACH.get(operation) or (lambda *x: elementary(operation, *x))
        return [r(function(*each)) for each in operands]
    except (OverflowError, ZeroDivisionError) as error:
        return ended(error)


MPMATH = {
    "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh", "arccosh": "acosh", "arctanh": "atanh",
    "arctan2": "atan2", "deg2rad": "radians", "rad2deg": "degrees",
}  # fmt: skip


@cache
def _precise() -> Any:
    context = mpmath.mp.clone()
    context.prec = 1000
    return context


def elementary(name: str, *arguments: Fraction) -> Fraction:
    """The value of a function with 900 bits; exactly, where it has fewer than 600."""
    mp = _precise()
    x = [mp.mpf(each.numerator) / each.denominator for each in arguments]
    if name == "exp2":
        found = mp.power(2, x[0])
    elif name == "log2":
        found = mp.log(x[0]) / mp.log(2)
    elif name == "cbrt":
        found = mp.sign(x[0]) * mp.root(abs(x[0]), 3)
    elif name == "float_power":
        found = mp.power(*x)
    else:
        found = getattr(mp, MPMATH.get(name, name))(*x)
    value = exactly(gmpy2.mpq(Fraction(*_ratio(found))))
    short = floating(2, 600, "even")(value)
    return short if short and abs(value / short - 1) < Fraction(1, 2**900) else value


def _ratio(value: Any) -> tuple[int, int]:
    sign, mantissa, e, _ = value._mpf_
    whole = (-1) ** sign * int(mantissa)
    return (whole << e, 1) if e >= 0 else (whole, 1 << -e)


def converted(fmt: Format, numbers: Any, kind: str) -> list[Any] | str:
    r = rounds(fmt)
    try:
        found = [r(Fraction(float(each)) if kind == "float64" else each) for each in numbers]
    except OverflowError:
        return "overflow"
    return [float(each).hex() for each in found] if kind == "to float64" else found


def computed(fmt: Format, operation: str, matrices: Any, **options: Any) -> list[Any] | str:
    plain = Rounded(fmt)
    try:
        given = [[[plain.fl(mpq(a)) for a in row] if isinstance(row, list) else plain.fl(mpq(row)) for row in each]
                 for each in matrices]  # fmt: skip
        return [_plainly(each) for each in COMPUTED[operation](plain, *given, **options)]
    except ZeroDivisionError:
        return "singular"
    except OverflowError:
        return "overflow"


def _plainly(x: Any) -> Any:
    return [_plainly(each) for each in x] if isinstance(x, list) else exactly(mpq(x))


def _matmul(
    plain: Rounded, a: Any, b: Any, order: str = "left", fused: bool = False, block: int = 32, sums: Any = None
) -> Any:
    inner = Rounded(sums) if sums is not None else plain
    if not isinstance(a[0], list):
        return [plain.fl(summed(inner.fl, a, b, order, fused, block))]
    columns = list(zip(*b, strict=True))
    return [[[plain.fl(summed(inner.fl, row, each, order, fused, block)) for each in columns] for row in a]]


def _lu(plain: Rounded, a: Any, pivot: bool) -> Any:
    lower, upper, _, order = plain.eliminate(a, [[] for _ in a], pivot)
    return [lower, upper, order]


def _det(plain: Rounded, a: Any) -> Any:
    try:
        _, upper, _, order = plain.eliminate(a, [[] for _ in a], True)
    except ZeroDivisionError:
        return [mpq(0)]
    found = upper[0][0]
    for k in range(1, len(a)):
        found = plain.fl(found * upper[k][k])
    swaps = sum(order[j] > order[i] for i in range(len(a)) for j in range(i))
    return [plain.fl(-found) if swaps % 2 else found]


def _cholesky(plain: Rounded, a: Any) -> Any:
    n, fl = len(a), plain.fl
    L = [[mpq(0)] * n for _ in a]
    for k in range(n):
        column = []
        for i in range(k, n):
            s = a[i][k]
            for j in range(k):
                s = fl(s - fl(L[i][j] * L[k][j]))
            column.append(s)
        if column[0] <= 0:
            raise ZeroDivisionError
        L[k][k] = plain.root(column[0])
        for i in range(k + 1, n):
            L[i][k] = fl(column[i - k] / L[k][k])
    return [L]


COMPUTED: dict[str, Callable[..., Any]] = {
    "matmul": _matmul,
    "lu": _lu,
    "inv": lambda plain, a, pivot: [plain.inv(a, pivot)],
    "solve": lambda plain, a, b, pivot: [plain.solve(a, b, pivot)],
    "det": _det,
    "cholesky": _cholesky,
}
