"""Structures of digital filters as plain loops over fractions.

Nothing is taken from the package. Each loop is written from the textbook equations of its structure; an
:class:`Arithmetic` rounds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from tests.oracles import ZERO, fixed, limited


class Arithmetic(NamedTuple):
    """Functions that round coefficients, data, products, sums, and sums that are stored."""

    coefficient: Callable
    data: Callable
    product: Callable
    sum: Callable
    store: Callable


def uniform(r):
    """One rounding for each product and each sum."""
    return Arithmetic(r, r, r, r, lambda x: x)


def words(coefficient, data, sums):
    """Fixed-point words; data and sums are (integer bits, fraction bits, rounding, overflow), sums may be None."""

    def kept(integer_bits, bits, mode, overflow):
        r, keep = fixed(bits, mode), limited(bits, integer_bits, overflow)
        return lambda x: keep(r(x))

    in_data = kept(*data)
    if sums is None:
        return Arithmetic(coefficient, in_data, in_data, in_data, lambda x: x)
    in_sums = kept(*sums)
    return Arithmetic(coefficient, in_data, in_sums, in_sums, in_data)


def direct_1(b, a, u, f):
    b, a = list(map(f.coefficient, b)), list(map(f.coefficient, a))
    past_u, past_y, found = [ZERO] * len(b), [ZERO] * len(a), []
    for value in u:
        past_u = [f.data(value), *past_u[:-1]]
        y = f.product(b[0] * past_u[0])
        for i in range(1, len(b)):
            y = f.sum(y + f.product(b[i] * past_u[i]))
        for i in range(len(a)):
            y = f.sum(y - f.product(a[i] * past_y[i]))
        y = f.store(y)
        past_y = [y, *past_y][: len(a)]
        found.append(y)
    return found


def direct_2(b, a, u, f):
    b, a = list(map(f.coefficient, b)), list(map(f.coefficient, a))
    size = max(len(b) - 1, len(a))
    past, found = [ZERO] * size, []
    for value in u:
        w = f.data(value)
        for i in range(len(a)):
            w = f.sum(w - f.product(a[i] * past[i]))
        w = f.store(w)
        chain = [w, *past]
        y = f.product(b[0] * w)
        for i in range(1, len(b)):
            y = f.sum(y + f.product(b[i] * chain[i]))
        past = chain[:size]
        found.append(f.store(y))
    return found


def transposed_1(b, a, u, f):
    b, a = list(map(f.coefficient, b)), list(map(f.coefficient, a))
    t, s, found = [ZERO] * (len(a) + 1), [ZERO] * len(b), []
    for value in u:
        v = f.store(f.sum(f.data(value) - t[0])) if a else f.data(value)
        found.append(f.store(f.sum(f.product(b[0] * v) + s[0])))
        t = [f.store(f.sum(t[i + 1] + f.product(a[i] * v))) for i in range(len(a))] + [ZERO]
        s = [f.store(f.sum(s[i] + f.product(b[i] * v))) for i in range(1, len(b))] + [ZERO]
    return found


def transposed_2(b, a, u, f):
    size = max(len(b) - 1, len(a))
    b = [*map(f.coefficient, b), *[ZERO] * (size + 1 - len(b))]
    a = [*map(f.coefficient, a), *[ZERO] * (size - len(a))]
    s, found = [ZERO] * (size + 1), []
    for value in u:
        x = f.data(value)
        y = f.store(f.sum(f.product(b[0] * x) + s[0]))
        sums = [f.sum(f.product(b[i] * x) + s[i]) for i in range(1, size + 1)]
        s = [f.store(f.sum(each - f.product(a[i] * y))) for i, each in enumerate(sums)] + [ZERO]
        found.append(y)
    return found


FORMS = {
    "direct form I": direct_1,
    "direct form II": direct_2,
    "direct form I transposed": transposed_1,
    "direct form II transposed": transposed_2,
}


def cascade(sections, form, u, f):
    for b, a in sections:
        u = FORMS[form](b, a, u, f)
    return u


def lattice(k, v, u, f):
    k, v = list(map(f.coefficient, k)), list(map(f.coefficient, v))
    g, found = [ZERO] * len(v), []
    for value in u:
        forward, new = f.data(value), [ZERO] * len(v)
        for i in range(len(k), 0, -1):
            forward = f.store(f.sum(forward - f.product(k[i - 1] * g[i - 1])))
            new[i] = f.store(f.sum(g[i - 1] + f.product(k[i - 1] * forward)))
        new[0] = forward
        y = f.product(v[0] * new[0])
        for i in range(1, len(v)):
            y = f.sum(y + f.product(v[i] * new[i]))
        g = new
        found.append(f.store(y))
    return found


def state_space(A, B, C, D, u, f):
    A, B, C, D = ([[f.coefficient(x) for x in row] for row in each] for each in (A, B, C, D))

    def total(row, values):
        s = f.product(row[0] * values[0])
        for c, x in zip(row[1:], values[1:], strict=True):
            s = f.sum(s + f.product(c * x))
        return f.store(s)

    x, found = [ZERO] * len(A), []
    for value in u:
        z = [f.data(value)]
        found.append(total([*C[0], *D[0]], [*x, *z]))
        x = [total([*A[i], *B[i]], [*x, *z]) for i in range(len(A))]
    return found


def smoother(alpha, u, f):
    alpha, y, found = f.coefficient(alpha), ZERO, []
    for value in u:
        off = f.store(f.sum(f.data(value) - y))
        y = f.store(f.sum(y + f.product(alpha * off)))
        found.append(y)
    return found


def pid(given, e, f):
    """A controller with the settings Kp, Ki, Kd, leak, limits, integral_limits and back, None where absent."""
    Kp, Ki, leak = (f.coefficient(given[name]) for name in ("Kp", "Ki", "leak"))
    integral = last = excess = ZERO
    found = []
    for value in e:
        error = f.data(value)
        integral = f.sum(f.product(leak * integral) + f.product(Ki * error))
        if given["back"] is not None:
            integral = f.sum(integral + f.product(f.coefficient(given["back"]) * excess))
        integral = f.store(integral)
        if given["integral_limits"] is not None:
            low, high = map(f.data, given["integral_limits"])
            integral = min(max(integral, low), high)
        v = f.sum(f.product(Kp * error) + integral)
        if given["Kd"] is not None:
            v = f.sum(v + f.product(f.coefficient(given["Kd"]) * f.store(f.sum(error - last))))
        v = f.store(v)
        y = v
        if given["limits"] is not None:
            low, high = map(f.data, given["limits"])
            y = min(max(v, low), high)
        excess, last = f.store(f.sum(y - v)), error
        found.append(y)
    return found
