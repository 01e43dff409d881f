"""The same questions answered without the package: exact fractions, each result rounded by its definition.

The functions have the names and arguments of those in :mod:`tests.corpus.package`. A question without an answer here
raises NotImplementedError. Quantities that are missing in a step are not compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from math import ceil, floor, trunc
from typing import Any

from gmpy2 import mpq

from tests import oracles, plain_filters, plain_steps, plain_structures
from tests.corpus.draw import Fixed, Float, Format, Model
from tests.oracles import Numbers, elementary, exactly, floating, of_factors, root

Steps = Iterator[dict[str, Any]]
Rounding = Callable[[Any], Any]


def rounds(fmt: Format) -> Callable[[Any], Fraction]:
    """A function that rounds to a format, and gives Python's fractions."""
    r = oracles.rounds(fmt)
    return lambda x: exactly(r(x))


# -- filters ----------------------------------------------------------------------------------------------------------


_LEAST, _DECAYED = Fraction(1, 2**960), Fraction(1, 2**700)


class Fading(plain_filters.Filter):
    """A filter whose numbers are kept in float64.

    Where a step would leave its range, entries of the estimate below 2**-700 become zero before it.
    """

    def __init__(self, model: Model, numbers: Numbers, *others: Any) -> None:
        r = numbers.r

        def watched(x: Any) -> Any:
            found = r(x)
            self.left |= 0 < abs(found) < _LEAST
            return found

        self.left, numbers.r = False, watched
        numbers.sums = watched if numbers.sums is r else numbers.sums
        super().__init__(model, numbers, *others)

    def step(self, z: Any) -> list[Any]:
        self.left = False
        before = dict(vars(self))
        found = super().step(z)
        if not self.left:
            return found
        vars(self).update(before)
        for name in ("x", "carried"):
            if getattr(self, name) is not None:
                kept = zip(getattr(self, name), before["x"], strict=True)
                setattr(self, name, [a if abs(x[0]) >= _DECAYED else [mpq(0)] for a, x in kept])
        return super().step(z)


def filtered(model: Model, z: Any, fmt: Format, form: str, **options: Any) -> Steps:
    numbers, each = in_blocks(fmt, options.get("blocks"))
    if "sums" in options:
        order, fused, block, wider = options["sums"]
        numbers = Numbers.of(fmt, wider, order=order, fused=fused, block=block)
    compensated = form == "compensated"
    kind = plain_filters.Filter
    if isinstance(fmt, Float) and fmt.base != 10 and fmt.emin is None and each is None:
        kind = Fading
    found = kind(model, numbers, "innovation" if compensated else form, each, compensated)
    for row in z:
        try:
            x = found.step(row)
        except (OverflowError, ZeroDivisionError):
            return
        yield {"x": x, "P": _covariance(found.P, form)} | ({} if form in FACTORED else {"K": found.K})


def in_blocks(fmt: Format, blocks: Any) -> tuple[Numbers, dict[str, Numbers] | None]:
    """Numbers that store a model, those of the widest block if there are any, and the numbers of each block."""
    if not blocks:
        return Numbers.of(fmt), None
    formats = {name: given for name, given in blocks.items() if name != "sums"}
    each = {name: Numbers.of(given, blocks.get("sums")) for name, given in formats.items()}
    return Numbers.of(max(formats.values(), key=lambda given: given.precision)), each


FACTORED = ("UD", "Potter", "Carlson")


def _covariance(P: Any, form: str) -> Any:
    if form not in FACTORED:
        return P
    return of_factors(P) if form == "UD" else oracles.EXACT.times(P, oracles.transposed(P))


def recorded(model: Model, records: Any, fmt: Format, form: str) -> Steps:
    each = [filtered(model, [[Fraction(float(a)) for a in row] for row in z], fmt, form) for z in records]
    for steps in zip(*each, strict=True):
        columns = [step["x"] for step in steps]
        yield {"x": [[str(float(exactly(a))) for a in row] for row in zip(*columns, strict=True)]}


class Linear:
    """Products of a matrix with a state, as functions of a plain filter."""

    def __init__(self, matrix: Any) -> None:
        self.matrix = matrix

    def plain(self, r: Rounding, x: Any, u: Any) -> Any:
        numbers = Numbers(r)
        given = numbers.store(self.matrix)
        return [row[0] for row in numbers.times(given, [[each] for each in x])], given


def as_functions(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    parts, given = (Linear(model.Phi[0]), Linear(model.H[0])), (model.Q, model.R, model.x0, model.P0)
    plain = plain_filters.Extended(*parts, given, form, Numbers.of(fmt), angle=False)
    yield from _followed(plain, z, [[] for _ in z], form)


def tracked(motion: str, given: Any, z: Any, u: Any, fmt: Format, form: str, **options: Any) -> Steps:
    parts = getattr(plain_steps, motion.title())(), plain_steps.Ranges([Fraction(3, 10), Fraction(1, 5)])
    kind = plain_filters.Unscented if options.get("method") == "unscented" else plain_filters.Extended
    Q, R, x0, P0 = given
    numbers = in_blocks(fmt, options.get("blocks"))
    plain = kind(*parts, ([Q], [R], x0, P0), form, *numbers, iterations=options.get("iterations", 1))
    yield from _followed(plain, z, u, form)


def _followed(plain: Any, z: Any, u: Any, form: str) -> Steps:
    for measured, known in zip(z, u, strict=True):
        try:
            plain.step(measured, known)
        except (OverflowError, ZeroDivisionError, ValueError):
            return
        yield {"x": list(plain.x), "P": _covariance(plain.P, form)}


def smoothed(model: Model, z: Any, fmt: Format, form: str) -> Steps:
    try:
        found = plain_filters.smoothed(model, Numbers.of(fmt), z, form)
    except (OverflowError, ZeroDivisionError) as error:
        yield {"end": ended(error)}
        return
    for x, P in found:
        yield {"x": [row[0] for row in x], "P": P}


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
    step, r = plain_steps.drawn(index)[1], rounds(fmt)
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


def converted(fmt: Format, numbers: Any, kind: str) -> list[Any] | str:
    r = rounds(fmt)
    try:
        found = [r(Fraction(float(each)) if kind == "float64" else each) for each in numbers]
    except OverflowError:
        return "overflow"
    return [float(each).hex() for each in found] if kind == "to float64" else found


def computed(fmt: Format, operation: str, matrices: Any, **options: Any) -> list[Any] | str:
    plain = Numbers.of(fmt)
    try:
        given = [plain.store(each) if isinstance(each[0], list) else plain.store([each])[0] for each in matrices]
        return list(COMPUTED[operation](plain, *given, **options))
    except ZeroDivisionError:
        return "singular"
    except OverflowError:
        return "overflow"


def _matmul(plain: Numbers, a: Any, b: Any, sums: Any = None, **order: Any) -> Any:
    plain = Numbers(plain.r, sums=rounds(sums) if sums is not None else None, **order)
    return [plain.times(a, b)] if isinstance(a[0], list) else [plain.dot(a, b)]


def _lu(plain: Numbers, a: Any, pivot: bool) -> Any:
    lower, upper, _, order = plain.eliminate(a, [[] for _ in a], pivot)
    return [lower, upper, order]


def _det(plain: Numbers, a: Any) -> Any:
    try:
        _, upper, _, order = plain.eliminate(a, [[] for _ in a], True)
    except ZeroDivisionError:
        return [mpq(0)]
    found = upper[0][0]
    for k in range(1, len(a)):
        found = plain.r(found * upper[k][k])
    swaps = sum(order[j] > order[i] for i in range(len(a)) for j in range(i))
    return [plain.r(-found) if swaps % 2 else found]


def _cholesky(plain: Numbers, a: Any) -> Any:
    L = plain.cholesky(a, ZeroDivisionError)
    if any(L[k][k] == 0 for k in range(len(L))):
        raise ZeroDivisionError
    return [L]


COMPUTED: dict[str, Callable[..., Any]] = {
    "matmul": _matmul,
    "lu": _lu,
    "inv": lambda plain, a, pivot: [plain.inv(a, pivot)],
    "solve": lambda plain, a, b, pivot: [plain.solve(a, b, pivot)],
    "det": _det,
    "cholesky": _cholesky,
}
