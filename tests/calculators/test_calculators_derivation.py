"""The expressions of the calculators against the functions of the chapters, in many digits."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import steps
import sympy as sp
from mpmath import mp

from gpbnb.report.calculators import derivation, forms
from gpbnb.report.calculators.derivation import named, step
from gpbnb.report.calculators.javascript import Definition, symbol
from gpbnb.report.integration import derivation as integration
from gpbnb.report.kalman import report_bounds
from gpbnb.report.rolling import derivation as rolling
from gpbnb.report.rolling import theory
from gpbnb.report.rounding import derivation as rounding

BY_ID = {each.id: each for each in forms.CALCULATORS}

DERIVATIONS = steps.Derivations(derivation.chopped, derivation.forgotten, derivation.lost)
NAMES = {
    "chopped": {
        "a dropped $vb^{e-t}$ over the least number that had it": "b**(1 - t)/(1 + s + b**(1 - t))",
        r"which is largest for $v\to1$": "beta/(1 + s + beta)",
    },
    "forgotten": {
        "sum of $f^{k-i}$: one more step": "(1 - f**(k + 1))/(1 - f)",
        "$a_0$ is at least $a_i$, with $i = j+1$": (
            "(k - j - 1)*(6*n + 3*m + 5) + 4*n + 3*m + 4 + (k*(k - 1)/2 - j*(j - 1)/2)*(3*n + m + 2)"
        ),
    },
    "lost": {
        "the share lost": "2*sin(phase/2)**2",
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


def evaluated(definitions: tuple[Definition, ...], given: dict[str, float]) -> dict[str, mpmath.mpf]:
    """Every definition in 120 digits, but those that search for the smallest number."""
    with mp.workdps(120):
        known = {name: mpmath.mpf(value) for name, value in given.items()}
        for each in definitions:
            if each.smallest is None:
                names = sorted(s.name for s in each.expression.free_symbols)
                function = sp.lambdify([symbol(name) for name in names], each.expression.doit(), "mpmath")
                known[each.name] = mpmath.mpf(function(*(known[name] for name in names)))
        return known


def close(found: mpmath.mpf, wanted: object, tolerance: float) -> bool:
    with mp.workdps(120):
        exact = (
            mpmath.mpf(wanted.numerator) / wanted.denominator if isinstance(wanted, Fraction) else mpmath.mpf(wanted)
        )
        return abs(found - exact) <= tolerance * abs(exact)


# What is exact in Python agrees to the digits of its evaluation; π is known to 60 there. float64 has 16.
@pytest.mark.parametrize(
    ("name", "exact"),
    [
        ("rounding", {"beta", "sharper", "total", "gamma"}),
        ("kalman", {"beta", *(f"{part}{i}" for part in ("a", "b", "size", "bound") for i in range(1, 5))}),
        ("deroll", {"rate", "error"}),
        ("integration", set()),
    ],
)
def test_every_example_is_what_the_chapters_compute(name, exact):
    calculator = BY_ID[name]
    for example in calculator.examples:
        given = calculator.values(example)
        found, wanted = evaluated(calculator.definitions(), given), calculator.reference(given)
        assert wanted.keys() <= {each.name for each in calculator.definitions()}
        for key, value in wanted.items():
            if key in found:
                # float64 functions of float64 arguments; the continued fractions are good to 1e-18 beside them
                assert close(found[key], value, 1e-50 if key in exact else 1e-13), (example, key)


def test_the_derivations_hold():
    assert derivation.chopped().holds
    assert derivation.forgotten().holds
    assert derivation.lost().holds


@pytest.mark.parametrize("name", DERIVATIONS)
def test_the_steps_are_named_for_what_they_derive(name):
    steps.check_names(DERIVATIONS[name], NAMES[name])


def test_the_steps_taken_from_the_chapters_hold():
    taken = (
        (rounding.one_rounding(), ("(8)", "(13)", "sharper")),
        (rounding.roundings(), ("first order", "$1+\\gamma_k$")),
        (rolling.fits(), ("off-tuned",)),
        (rolling.one_dimension(), ("(10)",)),
        (integration.small_mu(), ("(38) to (39)",)),
    )
    assert all(step(steps, begins).holds for steps, every in taken for begins in every)


def test_a_step_is_found_by_its_beginning_or_not_at_all():
    steps = rounding.one_rounding()
    assert step(steps, "(13)").right == step(steps, "(13): the same").right
    with pytest.raises(ValueError, match="got 0 steps that begin with 'nothing'; needed exactly one; give more"):
        step(steps, "nothing")
    with pytest.raises(ValueError, match="got 4 steps"):
        step(steps, "")


def test_all_symbols_need_a_name():
    a, b = sp.symbols("a b")
    assert named(a - b, a="b", b="a") == symbol("b") - symbol("a")
    for names in ({"a": "x"}, {"a": "x", "b": "y", "c": "z"}):
        with pytest.raises(ValueError, match="needed them for a, b"):
            named(a - b, **names)


@pytest.mark.parametrize("phase", [1e-9, 1e-3, 0.5, 2.0, 2.5, 30.0])
def test_the_drift_across_is_that_of_the_chapter(phase):
    expression = derivation.across()
    with mp.workdps(120):
        found = mpmath.mpf(sp.lambdify(symbol("phase"), expression, "mpmath")(mpmath.mpf(phase)))
        by_quadrature = 12 * mpmath.quad(
            lambda x: (x - mpmath.mpf(1) / 2) * x * mpmath.sin(phase * x), np.linspace(0, 1, 12).tolist()
        )
        assert abs(found / by_quadrature - 1) < mpmath.mpf(10) ** -25
    # The chapter sums 400 terms, of sizes that add up to at most 3/2 min(phase, 1): a rounding of each term, its
    # node and its weight, and of 399 sums.
    by_sum = 402 * np.finfo(float).eps * 1.5 * min(phase, 1)
    assert abs(float(found) - theory.off_tuned_drift(1.0, phase, 1.0)) < by_sum


def test_what_is_left_of_a_signal_is_the_cosine_of_11():
    assert derivation.strength() == sp.cos(symbol("phase"))


@pytest.mark.parametrize(("k", "n", "m"), [(1, 1, 1), (3, 2, 1), (40, 4, 3)])
def test_forgotten_inputs_are_bounded_term_by_term(k, n, m):
    """The sum of (a_0 + a_i) f^(k-i), each a_i counted step by step, is not above the coefficient of the last line."""
    c, d, more = (
        report_bounds.transition_count(n, m),
        report_bounds.input_count(n, m),
        report_bounds.covariance_count(n, m),
    )
    loops = [c + j * more for j in range(k)]
    counts = [sum(loops[i:]) + d + (i - 1) * more for i in range(1, k + 1)]
    for f in (0.0, 0.3, 0.97, 1.0):
        given = {"k": k, "n": n, "m": m, "x": 1, "u": 1, "f": f, "b": 10, "t": 9, "chop": 0, "goal": 1}
        found = evaluated(derivation.kalman_bound(), given) if f else None
        last = float(found["b5"]) if found else forms.KALMAN.reference(given)["b5"]
        total = sum((sum(loops) + a) * f ** (k - i) for i, a in enumerate(counts, 1))
        assert total <= last * (1 + 1e-12)
        assert last <= 2.5 * total


def test_a_loop_that_does_not_forget_takes_nothing_off():
    given = forms.KALMAN.values("the closing example")
    reference = forms.KALMAN.reference(given)
    assert reference["b5"] == reference["b4"]
    assert forms.KALMAN.reference({**given, "f": 0.5})["b5"] < reference["b4"] / 1e5


def test_mended_coefficients_have_the_names_of_the_chapter():
    assert [name for name, *_ in derivation.corrected()] == list(report_bounds.CORRECTIONS)
    numbers = {"k": 7, "n": 5, "m": 3}
    for (_, first, second), faults in zip(derivation.corrected(), report_bounds.CORRECTIONS.values(), strict=True):
        found = tuple(int(each.subs({s: numbers[s.name] for s in each.free_symbols})) for each in (first, second))
        assert found == tuple(report_bounds.coefficients(*numbers.values(), **faults))


@pytest.mark.parametrize(("base", "precision"), [(2, 1), (2, 3), (3, 2), (10, 1), (10, 2)])
def test_chopping_never_reaches_the_sharper_bound_but_comes_near(base, precision):
    beta = Fraction(1, base ** (precision - 1))
    low = base ** (precision - 1)
    dense = [Fraction(i, 500) for i in range(500 * low, 500 * base * low)]
    worst = max((x - int(x)) / x for x in dense)
    assert Fraction(9, 10) * beta / (1 + beta) < worst < beta / (1 + beta)
