"""Every term of the guarantee, in exact fractions: none can be dropped unseen.

The allowances for roundings of float64 lie between 1e-27 and 1e-12, too small to show beside other terms. Where they
are constants of the module, the tests use larger ones. Elsewhere the numbers are chosen so that the other terms cancel.
"""

from __future__ import annotations

import math
from fractions import Fraction as F
from typing import Any

import numpy as np
import pytest
from exact_terms import UNIT, UP, fractions, plain, same

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds import enclosure, envelope, reach
from gpbnb.bounds.envelope import Columns, End, FilterLimits, Sizes, Steps, units
from gpbnb.filters.program import (
    ADD,
    MULTIPLY,
    Builder,
    Program,
    effects,
    functionals,
    innovation_program,
    loop_program,
    sequential_program,
)
from gpbnb.filters.system import biquad, controller, state_space

# -- units ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rounding", Rounding.documented())
@pytest.mark.parametrize("base", [2, 10, 16])
def test_units_are_rounded_outwards(base: int, rounding: Rounding) -> None:
    table, digits = units(FloatFormat(base, 5, rounding)), 5
    most = (len(table.powers) - 1) // 2
    assert base**most > 2**840
    share = 2 if rounding is Rounding.NEAREST else 1
    inexact = 0
    for k, power, error, (high, low) in zip(range(-most, most + 1), *table[:3], strict=True):
        true = F(base) ** k
        assert true * (1 - F(1, 2**52)) < F(power) <= true
        size = true / base**digits / share
        assert size <= F(error) < size * (1 + F(1, 2**51))
        assert abs(F(high) + F(low) - true) <= true / 2**105
        inexact += F(power) != true
    assert (inexact > most) is (base == 10)


@pytest.mark.parametrize("rounding", Rounding)
@pytest.mark.parametrize("subnormal", [True, False])
def test_units_of_a_limited_range(rounding: Rounding, subnormal: bool) -> None:
    """No error of any number on a fine grid is larger, and some come near: least numbers, flushed ones, the largest."""
    fmt, fine = FloatFormat(2, 3, rounding, emin=-2, emax=2, subnormal=subnormal), 512
    table, share = units(fmt), 2 if rounding in (Rounding.NEAREST, Rounding.EVEN) else 1
    assert not table.sums_exact
    assert table.exact.tolist() == [[1.0, 0.0]]
    least = F(1, 16) / share if subnormal else F(1, 4)
    most: dict[int, F] = {}
    for k in range(-7 * fine, 7 * fine + 1):
        value = F(k, fine)
        at = int(np.searchsorted(table.powers, float(abs(value))))
        most[at] = max(most.get(at, F(0)), abs(fmt.round(value) - value))
    for at, error in most.items():
        power = F(float(table.powers[at]))
        if power < 7:
            assert F(float(table.errors[at])) == max(power / 8 / share, least)
        assert error <= F(float(table.errors[at]))
        if power / 8 / share > least:
            assert error >= F(float(table.errors[at])) * F(3, 4)
    assert max(error for at, error in most.items() if table.powers[at] <= 0.25) >= least * F(3, 4)
    assert table.powers[-1] == 7
    assert table.errors[-1] == 1 / share
    assert plain(envelope.largest_error)(table, np.nextafter(7.0, 8)) == np.inf


@pytest.mark.parametrize("rounding", Rounding)
def test_units_of_fixed_point(rounding: Rounding) -> None:
    fmt = FixedFormat(3, 4, rounding)
    table, share = units(fmt), 2 if rounding in (Rounding.NEAREST, Rounding.EVEN) else 1
    assert table.sums_exact
    assert table.powers.tolist() == [8 - 1 / 16]
    assert table.errors.tolist() == [1 / 16 / share]
    most = max(abs(fmt.round(F(k, 512)) - F(k, 512)) for k in range(-500, 500))
    assert F(1, 16) / share - F(1, 256) <= most <= F(1, 16) / share


def test_allowances_of_modules_exceed_roundings_of_float64() -> None:
    """A factor for sums of 2**12 terms, and one for the longest sums of an enclosure and its products."""
    u = F(1, 2**53)
    for module in (envelope, reach):
        assert F(module._U) == u
        assert (1 + u) ** (2**12 + 8) < F(module._UP) < 1 + F(1, 2**39)
    assert (1 + u) ** 4 < F(enclosure._UP) < 1 + F(1, 2**49)
    lags = math.ceil(math.log(enclosure._SMALL) / math.log(enclosure._SLOWEST)) + 8
    assert 1 + 4 * lags * u < F(enclosure._SUMS) < 1 + F(1, 10**9)


def test_the_error_of_a_result_is_that_of_the_next_power() -> None:
    largest, table = plain(envelope.largest_error), units(FloatFormat(10, 3))
    for size, power in ((0.0999, 0.1), (1.0, 1.0), (1.001, 10.0), (10.0, 10.0), (99.0, 100.0)):
        assert largest(table, size) == pytest.approx(power / 2000, rel=1e-15)
    assert largest(table, 0.0) == 0
    assert largest(table, 1e300) == np.inf
    assert largest(table, 1e-300) == table.errors[0]


def test_products_with_powers_of_the_base_are_exact() -> None:
    is_power, table = plain(envelope._is_power), units(FloatFormat(10, 3))
    third = F(1, 1000)
    low = float(third - F(1e-3))
    for high, rest, expected in (
        (0.0, 0.0, True), (100.0, 0.0, True), (-100.0, 0.0, True), (1e-3, low, True), (-1e-3, -low, True),
        (1e-3, 0.0, False), (1e-3, -low, False), (20.0, 0.0, False), (1e305, 0.0, False),
    ):  # fmt: skip
        assert is_power(table, high, rest) is expected


# -- double-double ----------------------------------------------------------------------------------------------------

PAIRS = [
    (1 / 3, 1 / 7),
    (-1e10 / 3, 1e-9 / 7),
    (2.0**60 / 3, -(2.0**60) / 3 * (1 + 2.0**-50)),
    (0.1, 0.1),
    (1e-3 / 7, 1e5),
]


@pytest.fixture
def certifying(monkeypatch):
    for name in ("effect", "_entries"):
        monkeypatch.setattr(envelope, name, plain(getattr(envelope, name)))


@pytest.fixture
def exactly(monkeypatch):
    for name in ("two_sum", "_two_product"):
        monkeypatch.setattr(envelope, name, plain(getattr(envelope, name)))


@pytest.mark.parametrize(("a", "b"), [*PAIRS, *((b, a) for a, b in PAIRS)])
def test_sums_and_products_have_no_error(a: float, b: float) -> None:
    s, e = plain(envelope.two_sum)(a, b)
    assert s == a + b
    assert F(s) + F(e) == F(a) + F(b)
    p, e = plain(envelope._two_product)(a, b, a * b)
    assert p == a * b
    assert F(p) + F(e) == F(a) * F(b)
    assert e != 0


@pytest.mark.parametrize(("a", "b"), PAIRS)
@pytest.mark.parametrize("sign", [1, -1])
def test_differences_and_products_of_pairs(exactly, a: float, b: float, sign: int) -> None:
    """Low parts of a third of the last digit, so that each enters; errors are far below the allowance of 2**-86."""
    left, right, third = ((x, sign * x * 2.0**-53 / y) for x, y in ((a, 3), (b, 7), (a * b, -5)))
    of = lambda pair: F(pair[0]) + F(pair[1])  # noqa: E731
    high, low = found = plain(envelope._minus)(left, right)
    assert abs(of(found) - (of(left) - of(right))) <= (abs(of(left)) + abs(of(right))) / 2**100
    assert high + low == high
    for start in (third, (-third[0], third[1]), (0.0, 0.0)):
        high, low = found = plain(envelope._plus_product)(start, left, right)
        exact = of(start) + of(left) * of(right)
        assert abs(of(found) - exact) <= (abs(of(start)) + abs(of(left) * of(right))) / 2**100
        assert high + low == high


# -- disturbances of a step -------------------------------------------------------------------------------------------


def steps(program: Program, coefficients: Any, given: Any, *, positive: bool = False, off: int = -1) -> list[F]:
    """All values of a step in exact fractions; with all signs positive, or with an error of 1 in an operation."""
    values = list(given)
    for o, (code, a, b) in enumerate(program.operations.tolist()):
        left = (abs(coefficients[a]) if positive else coefficients[a]) if code == MULTIPLY else values[a]
        right = values[b] if code in (MULTIPLY, ADD) or positive else -values[b]
        values.append((left * right if code == MULTIPLY else left + right) + (o == off))
    return values


def linear(program: Program, coefficients: Any, *, positive: bool = False) -> np.ndarray:
    """The linear function that each value is; row by row, in fractions."""
    first = program.n + program.m
    columns = [steps(program, coefficients, [F(i == j) for i in range(first)], positive=positive) for j in range(first)]
    return np.array(columns, dtype=object).T


def effect(program: Program, coefficients: Any, o: int, *, positive: bool = False) -> np.ndarray:
    """What an error of 1 in an operation does to the results."""
    nothing = [F(0)] * (program.n + program.m)
    values = steps(program, coefficients, nothing, positive=positive, off=o)
    return np.array([values[each] for each in program.outputs], dtype=object)


def as_pairs(values: Any) -> np.ndarray:
    """Double-double."""
    high = np.vectorize(float, otypes=[float])(values)
    return np.stack([high, np.vectorize(lambda v, h: float(v - F(h)), otypes=[float])(values, high)], axis=-1)


def largest_error(fmt: FloatFormat, size: F) -> F:
    """Half a unit in the last place below the next power, or a unit for chopping."""
    if size == 0:
        return F(0)
    power = F(1)
    while power < size:
        power *= fmt.base
    while power / fmt.base >= size:
        power /= fmt.base
    return power / fmt.base**fmt.precision / (2 if fmt.rounding is Rounding.NEAREST else 1)


def expected(program, fmt, C, offsets, Phi, HPhi, K, dK, limits, b, caps, unit, up):
    """The formula of a step, from the recursion of the error."""
    n, m = program.n, program.m
    X, V, Z = (fractions(each) for each in limits)
    rows, sizes = linear(program, C), linear(program, C, positive=True)
    tiny = F(1, 2**90)
    of_state, of_input = rows[:, :n], rows[:, n:]
    off, drift, none = [F(0)] * (n + m), [F(0)] * (n + m), [False] * (n + m)
    largest = [(X[j] + b[j]) * up for j in range(n)]
    largest += [min(Z[i], (V[i] + sum(abs(HPhi[i, j]) * X[j] for j in range(n))) * up) for i in range(m)]
    h_of = []
    outputs = program.outputs.tolist()
    for o, (code, a, c) in enumerate(program.operations.tolist()):
        v = n + m + o
        nonzero = [(abs(of_state[v, j]) + tiny * sizes[v, j]) * (of_state[v, j] != 0) for j in range(n)]
        inputs = [abs(of_input[v, i]) + tiny * sizes[v, n + i] for i in range(m)]
        moved = [
            abs(of_state[v, j] + sum(of_input[v, i] * HPhi[i, j] for i in range(m)))
            + (m + 8) * unit * (sizes[v, j] + sum(abs(of_input[v, i] * HPhi[i, j]) for i in range(m)))
            for j in range(n)
        ]
        seen = sum(s * x for s, x in zip(nonzero, X, strict=True)) + sum(s * z for s, z in zip(inputs, Z, strict=True))
        known = sum(s * x for s, x in zip(moved, X, strict=True)) + sum(s * e for s, e in zip(inputs, V, strict=True))
        size = min(seen, known, caps[o])
        size += sum((abs(of_state[v, j]) + tiny * sizes[v, j]) * b[j] for j in range(n))
        if code == MULTIPLY:
            before = abs(C[a]) * off[c]
            moving = abs(C[a]) * drift[c] + offsets[a] * largest[c]
            none.append(none[c] or (C[a] == 0 and offsets[a] == 0))
            power = C[a] == 0 or abs(C[a]) == F(fmt.base) ** round(math.log(abs(C[a]), fmt.base))
            exact = none[v] or (offsets[a] == 0 and power)
        else:
            before, moving = off[a] + off[c], drift[a] + drift[c]
            none.append(none[a] and none[c])
            exact = none[a] or none[c]
        drift.append(moving * up)
        size = (size + before + drift[v]) * up
        if v in outputs:
            i = outputs.index(v)
            size = min(size, (X[i] + b[i]) * up)
        h = F(0) if exact else largest_error(fmt, size)
        h_of.append(h)
        off.append((before + h) * up)
        largest.append((size + h) * up)
    groups = [
        sum(h for h, group in zip(h_of, program.groups.tolist(), strict=True) if group == g) * up
        for g in range(len(program.roots))
    ]
    G = np.array([effect(program, C, int(root)) for root in program.roots], dtype=object).T
    count = 6 * len(h_of) + 2 * n + 16
    effects = [effect(program, C, int(root), positive=True) for root in program.roots]
    slack = [sum(count * unit * each[i] * h for each, h in zip(effects, groups, strict=True)) for i in range(n)]
    closed, spread, loop, gain = (np.zeros(shape, dtype=object) for shape in ((n, n), (n, n), (n, n), (n, m)))
    for i, v in enumerate(outputs):
        slack[i] += drift[v]
        for j in range(n):
            closed[i, j] = of_state[v, j]
            spread[i, j] = (n + 4) * unit * abs(closed[i, j]) + F(1, 2**89) * sizes[v, j]
            loop[i, j] = closed[i, j] - Phi[i, j] + sum(of_input[v, r] * HPhi[r, j] for r in range(m))
            size = sizes[v, j] + abs(Phi[i, j]) + 2 * sum(sizes[v, n + r] * abs(HPhi[r, j]) for r in range(m))
            slack[i] += ((n + 4) * unit * abs(loop[i, j]) + F(1, 2**86) * size) * X[j]
        for r in range(m):
            gain[i, r] = of_input[v, r] - K[i, r]
            size = sizes[v, n + r] + abs(K[i, r])
            slack[i] += ((n + 4) * unit * abs(gain[i, r]) + F(1, 2**86) * size + dK[i, r]) * V[r]
    return {
        "F": closed,
        "spread": spread,
        "G": np.hstack([G, loop, gain]),
        "limits": np.array([*groups, *X, *V], dtype=object),
        "slack": np.array(slack, dtype=object) * up,
        "K": of_input[outputs],
        "loop": loop,
        "gain": gain,
    }


def small_program() -> Program:
    """Two states and two measurements; one result is used again, and one sum is with zero."""
    build = Builder(2, 2)
    x, y = build.states
    z, other = build.inputs
    u = build.subtract(build.multiply(0, x), build.multiply(1, y))
    v = build.subtract(build.add(build.multiply(2, u), build.multiply(3, z)), build.multiply(7, other))
    w = build.add(build.multiply(4, u), build.multiply(5, x))  # the coefficient 5 is zero
    return build.finish([u, build.subtract(build.add(u, v), build.multiply(6, w))], 8)


GENERIC = (  # the first measurement has a limit of its own, the second that of the state and the innovation
    small_program(),
    [F(3, 4), F(-5, 8), F(7, 16), F(3, 8), F(-5, 4), F(0), F(2), F(-9, 8)],
    [F(0), F(1, 64), F(1, 32), F(1, 32), F(0), F(0), F(1, 128), F(1, 16)],
    [[F(1, 2), F(-1, 4)], [F(1, 8), F(3, 4)]],
    [[F(5, 8), F(-3, 8)], [F(1, 4), F(1, 2)]],
    [[F(1, 4), F(-7, 8)], [F(5, 16), F(3, 4)]],
    [[F(1, 128), F(1, 64)], [F(3, 256), F(5, 512)]],
    ([3.0, 5.0], [0.75, 0.5], [2.5, 9.0]),
    [F(1, 16), F(3, 32)],
)
TINY, LITTLE = F(1, 2**70), F(1, 2**30)


def difference_program() -> Program:
    """A state of which two multiples nearly cancel, times a coefficient."""
    build = Builder(1, 1)
    (x,), (z,) = build.states, build.inputs
    d = build.subtract(build.multiply(0, x), build.multiply(1, x))
    return build.finish([build.add(build.multiply(2, d), build.multiply(3, z))], 4)


def innovation_of_two() -> Program:
    """A sum of two measurements, less what is expected of it, times a coefficient."""
    build = Builder(1, 2)
    (x,), (z, other) = build.states, build.inputs
    u = build.multiply(0, x)
    seen = build.add(build.multiply(1, z), build.multiply(2, other))
    d = build.subtract(seen, build.multiply(3, u))
    return build.finish([build.add(u, build.multiply(4, d))], 5)


def differences_of_measurements() -> Program:
    build = Builder(1, 2)
    (x,), (z, other) = build.states, build.inputs
    d = build.subtract(build.multiply(0, z), build.multiply(1, z))
    e = build.subtract(build.multiply(2, other), build.multiply(3, other))
    total = build.add(build.multiply(4, d), build.multiply(5, e))
    return build.finish([build.add(total, build.multiply(6, x))], 7)


# Coefficients known within LITTLE show the size of what they multiply to the last digit, not only to the next power.
INNOVATION = (  # 1 - KH of the program is 2**-70, and K and Φ are those of the exact filter to the last digit
    innovation_program(1, 1),
    [F(3), F(1, 2), 2 - 2 * TINY],
    [F(0), F(0), LITTLE],
    [[F(3)]],
    [[F(3, 2)]],
    [[2 - 2 * TINY]],
    [[F(0)]],
)
MIRRORED = (  # the same with other signs of Φ, H and K
    innovation_program(1, 1),
    [F(-3), F(-1, 2), -(2 - 2 * TINY)],
    [F(0), F(0), LITTLE],
    [[F(-3)]],
    [[F(3, 2)]],
    [[-(2 - 2 * TINY)]],
    [[F(0)]],
)
DIFFERENCE = (
    difference_program(),
    [F(3), 3 - 3 * TINY, F(5, 4), F(1, 2)],
    [F(0), F(0), LITTLE, LITTLE],
    [[F(15, 4) * TINY]],
    [[F(0)]],
    [[F(1, 2)]],
    [[F(0)]],
)


TWO = (  # 5/4 · 3/2 - 3/8 = 1/2 · 3: by the innovations, nothing is left of the state
    innovation_of_two(),
    [F(3), F(5, 4), F(3, 8), F(1, 2), F(7, 8) * (1 - TINY)],
    [F(0), F(0), F(0), F(0), LITTLE],
    [[F(3)]],
    [[F(3, 2)], [F(-1)]],
    [[F(35, 32) * (1 - TINY), F(21, 64) * (1 - TINY)]],
    [[F(0), F(0)]],
)
MEASUREMENTS = (
    differences_of_measurements(),
    [F(3), 3 - 3 * TINY, F(5), 5 - 5 * TINY, F(5, 4), F(3, 8), F(1, 2)],
    [F(0), F(0), F(0), F(0), LITTLE, LITTLE, F(0)],
    [[F(1, 2)]],
    [[F(0)], [F(0)]],
    [[F(15, 4) * TINY, F(15, 8) * TINY]],
    [[F(0), F(0)]],
)


def found_disturbances(monkeypatch, fmt, case, caps, unit, up):
    program, C, offsets, Phi, HPhi, K, dK, within, b = case
    for name in (
        "largest_error", "_is_power", "_minus", "_plus_product", "two_sum", "_two_product", "effects",
        "_operands", "_size", "_results", "_differences",
    ):  # fmt: skip
        monkeypatch.setattr(envelope, name, plain(getattr(envelope, name)))

    def functionals(_operations, _coefficients, _first, rows, sizes):
        rows[:], sizes[:] = as_pairs(linear(program, C)), linear(program, C, positive=True)

    monkeypatch.setattr(envelope, "functionals", functionals)
    monkeypatch.setattr(envelope, "_U", float(unit))
    monkeypatch.setattr(envelope, "_UP", float(up))
    Phi, HPhi, K, dK = (np.array(each, dtype=object) for each in (Phi, HPhi, K, dK))
    limits = FilterLimits(*(np.array(each) for each in within))
    pairs = (as_pairs(each)[None] for each in (Phi, HPhi, K))
    given = Steps(as_pairs(np.array(C))[None], np.array([offsets], dtype=float), *pairs, np.array([dK], dtype=float))
    found = plain(envelope.disturbances)(
        program.compiled, given, units(fmt), limits, np.array(b, dtype=float), np.array(caps, dtype=float)
    )
    exactly = expected(
        program, fmt, C, offsets, Phi, HPhi, K, dK, limits, b, [F(c) if c < 1e9 else F(10**9) for c in caps], unit, up
    )
    return found, exactly


@pytest.mark.parametrize("cap", [np.inf, 0.5])
@pytest.mark.parametrize("fmt", [FloatFormat(2, 7), FloatFormat(2, 5, Rounding.CHOP), FloatFormat(10, 3)], ids=str)
def test_disturbances(monkeypatch, fmt: FloatFormat, cap: float) -> None:
    found, exactly = found_disturbances(monkeypatch, fmt, GENERIC, [cap] * len(GENERIC[0].operations), UNIT, UP)
    for name, value in exactly.items():
        same(getattr(found, name)[0], value)


@pytest.mark.parametrize(
    ("case", "within", "b"),
    [
        (INNOVATION, ([1.0], [2.0**-60], [2.0**-75]), 0.0),
        (INNOVATION, ([1.0], [4.0], [2.0**-75]), 0.0),
        (MIRRORED, ([1.0], [2.0**-60], [2.0**-75]), 0.0),
        (MIRRORED, ([1.0], [2.0**-60], [8.0]), 0.0),
        ((*MIRRORED[:2], [F(0)] * 3, *MIRRORED[3:]), ([2.0**-90], [1.0], [2.0**-75]), 0.0),
        (MIRRORED, ([2.0**-30], [2.0**-75], [2.0**-75]), 1.0),
        ((*INNOVATION[:2], [F(0)] * 3, *INNOVATION[3:]), ([1.0], [4.0], [2.0**-75]), 0.0),
        (INNOVATION, ([1.0], [2.0**-60], [8.0]), 0.0),
        (DIFFERENCE, ([1.0], [2.0**-75], [2.0**-75]), 0.0),
        (DIFFERENCE, ([2.0**-30], [2.0**-75], [2.0**-75]), 1.0),
        (TWO, ([1.0], [2.0**-60, 2.0**-58], [8.0, 9.0]), 0.0),
        (MEASUREMENTS, ([2.0**-90], [2.0, 3.0], [0.5, 0.25]), 0.0),
        (MEASUREMENTS, ([2.0**-90], [0.5, 0.25], [2.0, 3.0]), 0.0),
    ],
)
def test_disturbances_where_everything_cancels(monkeypatch, case: Any, within: Any, b: float) -> None:
    """Nothing is left of what separates the program from the filter, and 2**-70 of a result or of an operand."""
    caps, fmt = [np.inf] * len(case[0].operations), FloatFormat(2, 300)
    found, exactly = found_disturbances(monkeypatch, fmt, (*case, within, [F(b)]), caps, F(1, 2**120), 1 + F(1, 2**30))
    for name in exactly.keys() - {"G"}:  # effects are float64; the slack makes up for their roundings
        same(getattr(found, name)[0], exactly[name])
    assert (exactly["loop"] == 0).all()
    assert (exactly["gain"] == 0).all()


@pytest.mark.parametrize("case", [INNOVATION, MIRRORED, TWO])
def test_sizes_by_innovations_allow_for_their_sums(monkeypatch, case: Any) -> None:
    """By the innovations, nothing is left of the state, but for roundings of float64; the measurements are large."""
    m, unit = len(case[4]), F(1, 2**53)
    within = ([1.0], [2.0**-70] * m, [8.0] * m)
    found, exactly = found_disturbances(
        monkeypatch,
        FloatFormat(2, 300),
        (*case, within, [F(0)]),
        [np.inf] * len(case[0].operations),
        unit,
        1 + F(1, 2**40),
    )
    same(found.slack[0], exactly["slack"], 1e-13)
    same(found.limits[0], exactly["limits"])


def output_that_is_used_again() -> Program:
    """A result that is a term of a sum, too: its rounding error has an effect of its own."""
    build = Builder(2, 1)
    (x, y), (z,) = build.states, build.inputs
    a = build.add(build.multiply(0, x), build.multiply(1, z))
    return build.finish([a, build.subtract(a, build.multiply(2, y))], 3)


def sum_that_is_used_twice() -> Program:
    build = Builder(2, 1)
    (x, y), (z,) = build.states, build.inputs
    a = build.add(build.multiply(0, x), build.multiply(1, z))
    return build.finish([build.subtract(a, build.multiply(2, y)), build.add(build.multiply(3, y), a)], 4)


@pytest.mark.parametrize(
    "program",
    [
        sum_that_is_used_twice(),
        small_program(), difference_program(), innovation_of_two(), differences_of_measurements(),
        output_that_is_used_again(), loop_program(2, 2), innovation_program(3, 2), sequential_program(3, 2),
        state_space(np.eye(2), np.ones((2, 1))).program, biquad(1, 2, 3, 4, 5).program, controller(1, 2, 3, 4).program,
    ],
)  # fmt: skip
def test_operations_of_a_group_have_the_effect_of_its_root(program: Program) -> None:
    """Up to the sign; coefficients that have no factor in common, so that no two products agree by chance."""
    coefficients = [F(2 * k + 3, 64 + k) for k in range(program.coefficients)]
    each = [effect(program, coefficients, o) for o in range(len(program.operations))]
    for o, group in enumerate(program.groups.tolist()):
        root = each[program.roots[group]]
        assert (each[o] == root).all() or (each[o] == -root).all()
    assert len(program.roots) < len(program.operations)


@pytest.mark.parametrize("program", [small_program(), sum_that_is_used_twice(), innovation_program(3, 2)])
def test_functions_and_effects_of_a_program(program: Program) -> None:
    """Coefficients of 106 bits; what all signs made positive would give is the size of each function."""
    coefficients = [F(2 * k + 3, 64 + k) * (-1) ** k for k in range(program.coefficients)]
    pairs = as_pairs(np.array(coefficients))
    stored = [F(high) + F(low) for high, low in pairs.tolist()]
    first, values = program.n + program.m, program.n + program.m + len(program.operations)
    rows, sizes = np.empty((values, first, 2)), np.empty((values, first))
    functionals(program.operations, pairs, first, rows, sizes)
    exact_rows, exact_sizes = linear(program, stored), linear(program, stored, positive=True)
    assert (abs(fractions(rows).sum(axis=2) - exact_rows) <= exact_sizes / 2**90).all()
    same(sizes, exact_sizes, 1e-14)
    G, reached = np.empty((values, program.n)), np.empty((values, program.n))
    plain(effects)(program.operations, program.outputs, pairs[:, 0].copy(), first, G, reached)
    for o in range(len(program.operations)):
        whole = effect(program, stored, o, positive=True)
        same(reached[first + o], whole, 1e-14)
        error = abs(fractions(G[first + o]) - effect(program, stored, o))
        assert (error <= (3 * len(program.operations) + 3) * whole / 2**53).all()


# -- sums over all earlier steps --------------------------------------------------------------------------------------


PERIODIC = Columns(
    *(np.array(each)
    for each in (
        [[[0.5, -0.25], [0.0, 0.75]], [[0.25, 0.5], [-0.5, 0.5]], [[0.75, 0.0], [0.125, -0.5]]],
        [[[2**-6, 2**-8], [2**-7, 2**-6]], [[2**-9, 2**-6], [0.0, 2**-7]], [[2**-8, 2**-7], [2**-5, 2**-9]]],
        [[[1.0, 0.5, 2.0], [-1.5, 0.25, 1.0]], [[0.5, -1.0, 1.0], [2.0, 1.0, 0.0]], [[1, 1, -1.0], [0.5, -0.5, 3.0]]],
        [[0.5, 0.25, 1.0], [0.0, 1.0, 0.75], [1.5, 0.5, 0.25]],
        [[0.25, 0.125], [0.0625, 0.5], [0.125, 0.375]],
        [envelope.GAIN, envelope.ROUNDING, envelope.LOOP],
    ))
)  # fmt: skip


def certificate(starts, k, first, steady, most):
    """The sums of a certificate in fractions, with the allowance for their roundings."""
    loops, spread, G, limits, slack, part = (fractions(each) for each in PERIODIC)
    rows = len(loops)
    out = []
    for start in fractions(starts):
        c, sums, residual, lags, begun = start, [F(0)] * 4, fractions(np.zeros(2)), 0, fractions(np.zeros(2))
        for lag in range(most):
            if not steady and k - lag <= 0:
                break
            at = first + (k - lag - 1) % (rows - first) if steady else k - lag - 1
            at = at if at < rows else first + (at - first) % (rows - first)
            sums[envelope.ROUNDING] += abs(c) @ slack[at]
            for g in range(3):
                sums[part[g].numerator] += abs(c @ G[at, :, g]) * limits[at, g]
            residual = residual + abs(c) @ spread[at]
            c, lags = c @ loops[at], lag + 1
        if not steady and lags == k:
            begun, c = abs(c), c * 0
        allowance = 1 + (lags + 2 + 3 + 64) * 4 * UNIT  # two states and three columns
        out.append(([s * allowance for s in sums], residual * allowance, abs(c), begun))
    return out, lags


@pytest.mark.parametrize(
    ("k", "first", "steady", "most"),
    [(1, 1, True, 5), (2, 1, True, 4), (3, 0, True, 7), (6, 1, False, 9), (5, 1, False, 3)],
)
def test_certificate(certifying, monkeypatch, k: int, first: int, steady: bool, most: int) -> None:
    monkeypatch.setattr(envelope, "_U", float(UNIT))
    starts = np.array([[1.0, 0.0], [0.5, -2.0]])
    found = plain(envelope.certify)(PERIODIC, starts, k, first, steady, End(most, np.ones(2), 0.0))
    exactly, lags = certificate(starts, k, first, steady, most)
    for i, (sums, residual, tail, begun) in enumerate(exactly):
        same(found.sums[i], sums, 1e-15)
        same(found.residual[i], residual, 1e-15)
        same(found.tail[i], tail, 1e-15)
        same(found.start[i], begun, 1e-15)
    assert found.lags == lags
    assert (found.start.any(), found.tail.any()) == ((True, False) if not steady and most > k else (False, True))


def test_a_certificate_has_the_lags_of_its_longest_row(certifying) -> None:
    """The second state forgets everything at once, and its row ends first."""
    loop, none = np.array([[[0.5, 0.0], [0.0, 0.0]]]), np.zeros((1, 2, 2))
    given = (loop, none, np.ones((1, 2, 1)), np.ones((1, 1)), np.zeros((1, 2)), np.zeros(1, np.int64))
    for starts in (np.eye(2), np.eye(2)[::-1]):
        found = plain(envelope.certify)(Columns(*given), starts, 1, 0, True, End(50, np.ones(2), 0.01))
        assert found.lags == 7
        assert sorted(found.tail[:, 0]) == [0, 2.0**-7]


def half_units(steps: int, columns: int) -> tuple[np.ndarray, ...]:
    """One state that keeps what it has: 1 in the last step, and half a unit of 1 from each column of every step."""
    loops, none = np.ones((steps, 1, 1)), np.zeros((steps, 1, 1))
    slack = np.zeros((steps, 1))
    slack[-1] = 1.0
    return loops, none, np.ones((steps, 1, columns)), np.full((steps, columns), 2.0**-53), slack


def test_a_certificate_allows_for_each_addition(certifying) -> None:
    """Added one by one to 1, half units are lost to rounding; the allowance must exceed all of them."""
    assert 1.0 + 2.0**-53 == 1.0
    steps, columns = 50, 64
    given = (*half_units(steps, columns), np.full(columns, envelope.ROUNDING))
    found = plain(envelope.certify)(Columns(*given), np.eye(1), steps, steps, False, End(steps, np.ones(1), 0.0))
    assert found.lags == steps
    assert F(float(found.sums.sum())) >= 1 + steps * columns * F(1, 2**53)


def test_a_certificate_ends_once_its_rows_are_small(certifying) -> None:
    """Half of it each step, in units of 4: below 0.3 after the fourth, whose disturbance is not in the sum any more."""
    loop, none = np.array([[[0.5]]]), np.zeros((1, 1))
    given = (loop, none[None], np.ones((1, 1, 1)), np.ones((1, 1)), none, np.zeros(1, np.int64))
    found = plain(envelope.certify)(Columns(*given), np.eye(1), 1, 0, True, End(50, np.full(1, 4.0), 0.3))
    assert found.lags == 4
    assert found.tail == 0.0625
    assert found.sums[0, 0] == pytest.approx(1.875, rel=1e-13)


def test_peaks(certifying, monkeypatch) -> None:
    """State and innovation before the first step, in the first steps, and in a period."""
    monkeypatch.setattr(envelope, "_U", 0.0)
    monkeypatch.setattr(envelope, "_UP", float(UP))
    monkeypatch.setattr(envelope, "certify", plain(envelope.certify))
    HPhi = np.array([[[0.5, -2.0]], [[1.0, 0.25]], [[-0.75, 1.5]]])
    X, Z, x0 = np.array([2.0, 3.0]), np.array([0.125]), np.array([0.25, 0.5])
    peak_x, peak_v = plain(envelope.peaks)(PERIODIC, HPhi, Sizes(X, Z, x0), 1, 4, True, End(3, np.ones(2), 0.0))
    monkeypatch.setitem(globals(), "UNIT", F(0))
    most_x, most_v = fractions(x0), [(fractions(Z)[0] + abs(fractions(HPhi[0, 0])) @ fractions(x0)) * UP]
    for k, first, steady, following in ((1, 1, False, 1), (2, 1, False, 2), (3, 1, False, 1), (4, 1, False, 2),
                                        (1, 1, True, 2), (2, 1, True, 1)):  # fmt: skip
        starts = np.vstack([np.eye(2), HPhi[following]])
        totals = [
            sum(sums) + (residual + tail) @ fractions(X) + begun @ fractions(x0)
            for sums, residual, tail, begun in certificate(starts, k, first, steady, 3)[0]
        ]
        most_x = np.maximum(most_x, np.array(totals[:2]) * UP)
        seen = totals[2] + F(1, 2**50) * abs(fractions(HPhi[following, 0])) @ fractions(X)
        most_v.append((fractions(Z)[0] + seen) * UP)
    same(peak_x, most_x)
    same(peak_v, [max(most_v)], 1e-15)


STEPS = [(1, False, 1), (2, False, 2), (3, False, 1), (4, False, 2), (1, True, 2), (2, True, 1)]
"""Of the peaks below: the step, whether the past is infinite, and the row of the step after it."""


@pytest.mark.parametrize("largest", range(6))
def test_the_peak_of_each_step_counts(certifying, monkeypatch, largest: int) -> None:
    """Certificates of 1 but for one step, whose terms are all seen."""
    monkeypatch.setattr(envelope, "_UP", float(UP))
    HPhi = np.array([[[0.5, -2.0]], [[1.0, 0.25]], [[-0.75, 1.5]]])
    X, Z, x0 = np.array([2.0, 3.0]), np.array([0.125]), np.array([0.25, 0.5])
    rng, asked = np.random.default_rng(5), []
    sums, residual, tail, start = (rng.integers(8, 64, (3, size)) / 4 for size in (4, 2, 2, 2))
    one, none = np.full((3, 4), 0.25), np.zeros((3, 2))

    def certify(*given: Any) -> Any:
        asked.append((given[2], given[4], given[1].copy()))
        there = len(asked) == largest + 1
        return envelope.Certificate(*((sums, residual, tail, start) if there else (one, none, none, none)), 1)

    monkeypatch.setattr(envelope, "certify", certify)
    peak_x, peak_v = plain(envelope.peaks)(PERIODIC, HPhi, Sizes(X, Z, x0), 1, 4, True, End(3, np.ones(2), 0.0))
    for (k, steady, starts), (step, settled, following) in zip(asked, STEPS, strict=True):
        assert (k, steady) == (step, settled)
        assert np.array_equal(starts, np.vstack([np.eye(2), HPhi[following]]))
    totals = [
        sum(fractions(sums[i])) + (fractions(residual[i]) + fractions(tail[i])) @ fractions(X)
        + fractions(start[i]) @ fractions(x0)
        for i in range(3)
    ]  # fmt: skip
    same(peak_x, [totals[0] * UP, totals[1] * UP], 1e-15)
    same(peak_v, [(totals[2] + F(1, 8)) * UP], 1e-14)


def test_peaks_make_up_for_the_low_parts_of_rows(monkeypatch) -> None:
    """Where all other terms vanish, 2**-50 of the row is left; and the first estimate is a peak."""
    monkeypatch.setattr(envelope, "_UP", float(UP))
    none = np.zeros((3, 4))
    found = envelope.Certificate(none, none[:, :2], none[:, :2], none[:, :2], 1)
    monkeypatch.setattr(envelope, "certify", lambda *_: found)
    HPhi, X = np.array([[[0.5, -2.0]]] * 3), np.array([2.0, 3.0])
    for x0 in (np.zeros(2), np.array([0.25, 0.5])):
        given = HPhi, Sizes(X, np.zeros(1), x0), 1, 4, True, End(3, np.ones(2), 0.0)
        peak_x, peak_v = plain(envelope.peaks)(PERIODIC, *given)
        assert np.array_equal(peak_x, x0)
        same(peak_v, [F(9, 8) * UP if x0.any() else 7 * F(1, 2**50) * UP], 1e-15)
