"""Vehicles that measure a beacon, and random steps of systems: on arrays of a format, and on fractions.

Each is written twice, the second time with an explicit rounding after each operation, without the package.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil, floor

import numpy as np

from tests.oracles import elementary, root, unit


class Ranges:
    """A vehicle that measures range and bearing of a beacon, with its Jacobians written out."""

    def __init__(self, beacon):
        self.beacon = beacon

    def emulated(self, x, u=None):
        a, b = (x.format.array(each) - x[i] for i, each in enumerate(self.beacon))
        return np.stack([np.hypot(a, b), np.arctan2(b, a)])

    def plain(self, r, x, u):
        a, b = self.ahead(r, x)
        (c, bearing), s = self.value(r, x), r(r(a * a) + r(b * b))
        rest = [Fraction(0)] * (len(x) - 2)
        H = [[r(-a / c), r(-b / c), *rest], [r(b / s), r(-a / s), *rest]]
        return [c, bearing], H

    def value(self, r, x):
        a, b = self.ahead(r, x)
        return [r(elementary("hypot", a, b)), r(elementary("arctan2", b, a))]

    def ahead(self, r, x):
        return [r(r(Fraction(each)) - x[i]) for i, each in enumerate(self.beacon)]


class Moving:
    """States x and y, moved by known velocities u."""

    n = 2

    def emulated(self, x, u):
        return x + u

    def plain(self, r, x, u):
        return [r(a + b) for a, b in zip(x, u, strict=True)], unit(2)


class Turning:
    """States x, y and heading, moved by a distance and a turn."""

    n = 3

    def emulated(self, x, u):
        return np.stack([x[0] + u[0] * np.cos(x[2]), x[1] + u[0] * np.sin(x[2]), x[2] + u[1]])

    def plain(self, r, x, u):
        c, s = r(elementary("cos", x[2])), r(elementary("sin", x[2]))
        F = unit(3)
        F[0][2], F[1][2] = r(u[0] * -s), r(u[0] * c)
        return [r(x[0] + r(u[0] * c)), r(x[1] + r(u[0] * s)), r(x[2] + u[1])], F


class Coasting:
    """States x, y and two velocities, for steps of 0.1 s; the inputs are not used."""

    n = 4

    def emulated(self, x, u):
        dt = x.format.array("0.1")
        return np.stack([x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3]])

    def plain(self, r, x, u):
        dt = r(Fraction(1, 10))
        F = unit(4)
        F[0][2] = F[1][3] = dt
        return [r(x[0] + r(dt * x[2])), r(x[1] + r(dt * x[3])), x[2], x[3]], F


# -- steps of systems -------------------------------------------------------------------------------------------------


def of_sign(x, sign):
    return abs(x) if sign >= 0 else -abs(x)


def limits(x, low, high):
    return min(max(x, Fraction(low)), Fraction(high))


OPERATIONS = [
    (lambda a, b, c: a + b, lambda r, a, b, c: r(a + b)),
    (lambda a, b, c: a - b * c, lambda r, a, b, c: r(a - r(b * c))),
    (lambda a, b, c: a / (abs(b) + 1), lambda r, a, b, c: r(a / r(r(abs(b)) + 1))),
    (lambda a, b, c: np.sqrt(abs(a)), lambda r, a, b, c: r(root(r(abs(a))))),
    (
        lambda a, b, c: np.fmod(a, b * b + 1),
        lambda r, a, b, c: r(of_sign(abs(a) % r(r(b * b) + 1), a)),
    ),
    (lambda a, b, c: a % 2, lambda r, a, b, c: r(a - 2 * floor(a / 2))),
    (lambda a, b, c: np.where(a < b, c, -a), lambda r, a, b, c: c if a < b else r(-a)),
    (lambda a, b, c: np.where((a <= b) ^ (b > c), a, b), lambda r, a, b, c: a if (a <= b) != (b > c) else b),
    (
        lambda a, b, c: np.where(~((a == b) | (c != a)) & (c >= 0), abs(c), 0),
        lambda r, a, b, c: r(abs(c)) if a != b and c == a and c >= 0 else Fraction(0),
    ),
    (lambda a, b, c: np.where((a > 0) == (b > 0), b, c), lambda r, a, b, c: b if (a > 0) == (b > 0) else c),
    (lambda a, b, c: np.clip(a, -1, 2), lambda r, a, b, c: limits(a, -1, 2)),
    (lambda a, b, c: np.minimum(np.maximum(a, b), 1), lambda r, a, b, c: min(max(a, b), Fraction(1))),
    (lambda a, b, c: np.maximum(-1, np.minimum(2, a)) + c, lambda r, a, b, c: r(limits(a, -1, 2) + c)),
    (
        lambda a, b, c: np.floor(a) / 2 + np.ceil(b) / 4,
        lambda r, a, b, c: r(r(r(Fraction(floor(a))) / 2) + r(r(Fraction(ceil(b))) / 4)),
    ),
    (lambda a, b, c: np.rint(a) - np.trunc(b), lambda r, a, b, c: r(r(Fraction(round(a))) - r(Fraction(int(b))))),
    (
        lambda a, b, c: np.sign(a) * np.copysign(b, c),
        lambda r, a, b, c: r(((a > 0) - (a < 0)) * r(of_sign(b, c))),
    ),
]
"""Operations on arrays of a format, and on fractions with a rounding."""


def drawn(seed):
    """A step with random operations on states, inputs and constants, and the same step in fractions."""
    steps = np.random.default_rng(seed).integers(0, 1000, (25, 4)).tolist()

    def step(fmt, x, u):
        known = [*x, *u, *fmt.array(["0.7", "-1.5", 0, 1])]
        for kind, *choice in steps:
            operands = (known[each % len(known)] for each in choice)
            known.append(OPERATIONS[kind % len(OPERATIONS)][0](*operands))
        return [np.clip(each, -4, 4) for each in known[-3:]], known[-8:-3]

    def plain(r, x, u):
        known = [*x, *u, *map(r, (Fraction(7, 10), Fraction(-3, 2), Fraction(0), Fraction(1)))]
        for kind, *choice in steps:
            operands = (known[each % len(known)] for each in choice)
            known.append(OPERATIONS[kind % len(OPERATIONS)][1](r, *operands))
        return [limits(each, -4, 4) for each in known[-3:]], known[-8:-3]

    return step, plain
