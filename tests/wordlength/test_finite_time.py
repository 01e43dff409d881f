"""Bounds over a number of steps, for systems that keep their errors, against emulations that share no code with them.

The emulations are plain loops over fractions, rounded by :mod:`tests.oracles`.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from gpbnb import FloatFormat, LinearSystem
from gpbnb.bounds.system import output_errors
from tests.oracles import floating

TENTH = Fraction(1, 10)
CLOCK = LinearSystem.sum(running=True, name="clock")
TWICE = LinearSystem([[1, 1], [0, 1]], [[0], ["0.3"]], [[1, 0]], name="position from acceleration")
LOOSE = LinearSystem.pid(2, "0.3", "0.7", limits=(-3, 3), name="PI that keeps its errors")


def clock(round_, inputs):
    """Largest error of t += u, for rounded inputs."""
    t, true, worst = Fraction(0), Fraction(0), Fraction(0)
    for u in inputs:
        t, true = round_(t + round_(u)), true + u
        worst = max(worst, abs(t - true))
    return worst


def twice(round_, inputs):
    """Largest error of p += v; v += 0.3 u, with the output p before the step."""
    scale, p, v, exact_p, exact_v, worst = round_(Fraction(3, 10)), *[Fraction(0)] * 5
    for u in inputs:
        worst = max(worst, abs(p - exact_p))
        p, v = round_(p + v), round_(v + round_(scale * round_(u)))
        exact_p, exact_v = exact_p + exact_v, exact_v + Fraction(3, 10) * u
    return worst


def loose(round_, inputs):
    """Largest error of a limited PID whose integral has no leak."""
    Kp, Ki, Kd = (round_(Fraction(each)) for each in ("2", "0.3", "0.7"))

    def run(r, kp, ki, kd):
        i = last = Fraction(0)
        for u in inputs:
            e = r(u)
            i = r(i + r(ki * e))
            v = r(r(r(kp * e) + i) + r(kd * r(e - last)))
            last = e
            yield min(max(v, Fraction(-3)), Fraction(3))

    exactly = run(lambda x: x, Fraction(2), Fraction(3, 10), Fraction(7, 10))
    return max(abs(a - b) for a, b in zip(run(round_, Kp, Ki, Kd), exactly, strict=True))


def inputs_of(rng, steps, kind):
    """Inputs of size 1 at most, exact, that push rounding errors in one direction or in many."""
    if kind == "constant":
        return [TENTH * 9] * steps
    if kind == "random":
        return [Fraction(float(each)) for each in rng.uniform(-1, 1, steps)]
    return [Fraction(float(each)) for each in rng.uniform(0.5, 1, steps)]


# Directed roundings of positive numbers have one sign and average half a unit (2). The bound takes each number as
# large as the largest of all steps (3 for a position) and up to the next power of two (2), and inputs as 1 (1.1).
# Roundings to nearest partly cancel: among 80, about one in the root of 80 is left (9).
LEAST_SHARE = {True: 1 / (2 * 3 * 2 * 1.2), False: 1 / (3 * 2 * 9 * 1.2)}


def test_no_emulation_exceeds_the_bound_over_its_steps():
    for mode, digits in [("nearest", 8), ("nearest", 24), ("even", 8), ("chop", 24), ("up", 8), ("down", 24)]:
        for system, emulated in [(CLOCK, clock), (TWICE, twice), (LOOSE, loose)]:
            rng, round_, shares = np.random.default_rng(5), floating(2, digits, mode), []
            for steps in (1, 2, 30, 80):
                bound = output_errors(system, FloatFormat(2, digits, mode), 1.0, steps)[0]
                for kind in ("constant", "random", "positive"):
                    observed = float(emulated(round_, inputs_of(rng, steps, kind)))
                    assert observed <= bound
                    if bound:
                        shares.append(observed / bound)
            assert max(shares) > LEAST_SHARE[mode in ("chop", "up", "down")]


# -- sums ------------------------------------------------------------------------------------------------------------


def test_a_tree_of_1024_numbers_stays_below_the_published_bound():
    """SATIRE prints 11 · 1024 · 2**-53 for numbers within 1: ten levels, and storing as if a number lost a whole unit.

    A number within 1 loses half a unit when it is stored, and so does a sum of two within 2, so 10 remain.
    """
    published = 1.2505552149377763e-12
    assert published == 11 * 1024 * 2.0**-53
    bound = output_errors(LinearSystem.sum(1024, "tree"), FloatFormat(2, 53), 1.0)[0]
    assert bound == pytest.approx(10 * 1024 * 2.0**-53, rel=2e-6)
    assert bound < published
    tree, halves = (
        output_errors(LinearSystem.sum(64, each), FloatFormat(2, 53), 1.0)[0] for each in ("tree", "pairwise")
    )
    assert halves == pytest.approx(tree)
