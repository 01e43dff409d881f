"""The expressions behind the calculators, taken from the chapters' derivations or derived here."""

from __future__ import annotations

from functools import cache
from typing import Any

import sympy as sp
from sympy.codegen.cfunctions import expm1

from gpbnb.report.calculators.javascript import Definition, stable, symbol
from gpbnb.report.display.derivation import Derivation, Step, over
from gpbnb.report.integration import derivation as integration
from gpbnb.report.kalman import derivation as kalman
from gpbnb.report.rolling import derivation as rolling
from gpbnb.report.rounding import derivation as rounding

Definitions = tuple[Definition, ...]

DAY = 86400
"""One day in seconds."""


def step(derivation: Derivation, begins: str) -> Step:
    """Return the one step whose name starts with `begins`.

    Raises
    ------
    ValueError : there is no such step, or more than one.
    """
    found = [each for each in derivation.steps if each.name.startswith(begins)]
    if len(found) != 1:
        raise ValueError(
            f"got {len(found)} steps that begin with {begins!r}; needed exactly one; give more of its beginning"
        )
    return found[0]


def named(expression: Any, **names: str) -> Any:
    """Rename all symbols of an expression to the names of a calculator.

    Raises
    ------
    ValueError : a symbol is not in the expression, or a symbol of the expression gets no new name.
    """
    old = {each.name: each for each in expression.free_symbols}
    if old.keys() != names.keys():
        raise ValueError(
            f"got names for {', '.join(sorted(names))} of {expression}; needed them for {', '.join(sorted(old))}"
        )
    return expression.doit().subs({old[name]: symbol(new) for name, new in names.items()}, simultaneous=True)


def _either(nearest: sp.Expr, chopped: sp.Expr) -> sp.Expr:
    return sp.Piecewise((nearest, sp.Eq(symbol("chop"), 0)), (chopped, True))


# -- the unit roundoff -----------------------------------------------------------------------------


@cache
def unit() -> sp.Expr:
    """Return β of (8) and (13) as a function of b, t and chop."""
    steps = rounding.one_rounding()
    return _either(*(named(step(steps, number).right, b="b", t="t") for number in ("(8)", "(13)")))


def chopped() -> Derivation:
    """Derive the sharper bound for chopping, which drops :math:`v b^{e-t}` with v = 1/(1 + s) < 1."""
    b, t, e, beta, s = sp.symbols("b t e beta s", positive=True)
    v = 1 / (1 + s)
    return Derivation(
        (
            Step(
                "a dropped $vb^{e-t}$ over the least number that had it",
                over(v * b ** (e - t), b ** (e - 1) + v * b ** (e - t)),
                over(v * b ** (1 - t), 1 + v * b ** (1 - t)),
            ),
            Step(
                "which is largest for $v\\to1$",
                over(beta, 1 + beta),
                over(v * beta, 1 + v * beta),
                s * beta / ((1 + beta) * (1 + s + beta)),
            ),
        )
    )


@cache
def rounding_unit() -> Definitions:
    """Define β of one rounding, the sharper bound, and the bounds of n roundings to first and to every order."""
    b, t, beta = symbol("b"), symbol("t"), symbol("beta")
    sharper = named(step(rounding.one_rounding(), "sharper").right, b="b", t="t").subs(b ** (1 - t), 2 * beta)
    steps = rounding.roundings()
    first = named(step(steps, "first order").right, k="n") * beta
    (gamma,) = (named(term, k="n", beta="beta") for term in step(steps, "$1+\\gamma_k$").left.args if term.free_symbols)
    return (
        Definition("beta", unit()),
        Definition("sharper", sharper),
        Definition("total", first),
        Definition("gamma", sp.Piecewise((gamma, symbol("total") < 1), (sp.nan, True)), shown=gamma),
    )


# -- the bound of the Kalman filter ----------------------------------------------------------------


def forgotten() -> Derivation:
    r"""Derive the effect of a closed loop of norm f < 1, :math:`\|T_i\| \le f^{k-i}\|u\|`, and a_0 ≥ a_i."""
    k, f = sp.Symbol("k", integer=True, positive=True), sp.Symbol("f", positive=True)
    j = sp.Symbol("j", integer=True, nonnegative=True)
    start = kalman.count_start(kalman.ONCE[0], kalman.GROWTH)
    later = kalman.count_input(*kalman.ONCE, kalman.GROWTH).subs(kalman.NTH, j + 1)
    return Derivation(
        (
            Step("sum of $f^{k-i}$: one more step", f * over(1 - f**k, 1 - f) + 1, over(1 - f ** (k + 1), 1 - f)),
            Step("$a_0$ is at least $a_i$, with $i = j+1$", start, later, sp.expand(start - later)),
        )
    )


@cache
def corrected() -> tuple[tuple[str, sp.Expr, sp.Expr], ...]:
    """Return each name in ``gpbnb.report.kalman.report_bounds.CORRECTIONS``, with the coefficients of ‖x‖ and of B."""
    return tuple(
        (name, sp.factor(kalman.count_start(c, g)), sp.factor(kalman.second_coefficient(c, d, g, sign)))
        for name, (c, d), g, sign in (
            ("as printed", kalman.TWICE, sp.S.Zero, -1),
            ("roundings counted once", kalman.ONCE, sp.S.Zero, -1),
            ("and errors of either sign", kalman.ONCE, sp.S.Zero, 1),
            ("and covariance errors carried on", kalman.ONCE, kalman.GROWTH, 1),
        )
    )


@cache
def kalman_bound() -> Definitions:
    """Define (125) as printed, corrected, and with forgotten inputs: coefficients, bound, digits for a tolerance."""
    f, k, x, u, beta, digits = map(symbol, ("f", "k", "x", "u", "beta", "digits"))
    result = [Definition("beta", unit())]
    pairs = [(named(a, k="k", n="n", m="m"), named(b, k="k", n="n", m="m")) for _, a, b in corrected()]
    memory = sp.Piecewise((-expm1(k * sp.log(f)) / (1 - f), f < 1), (k, True))
    result.append(Definition("memory", memory, shown=(1 - f**k) / (1 - f)))
    pairs.append((pairs[-1][0], sp.Min(symbol("b4"), 2 * symbol("a5") * symbol("memory"))))
    for i, (first, second) in enumerate(pairs, 1):
        a, b, size = symbol(f"a{i}"), symbol(f"b{i}"), symbol(f"size{i}")
        result += [
            Definition(f"a{i}", first),
            Definition(f"b{i}", second),
            Definition(f"size{i}", a * x + b * u),
            Definition(f"bound{i}", beta * size, shown=beta * (a * x + b * u)),
            Definition(f"digits{i}", size * unit().subs(symbol("t"), digits) <= symbol("goal"), digits),
        ]
    return tuple(result)


# -- off-tuned deroll ------------------------------------------------------------------------------


@cache
def across() -> sp.Expr:
    r"""Return the cross drift that a least-squares fit finds for a drift of 1, as a function of the final phase error.

    This is the step of the chapter, with :math:`\sin\Delta t` in place of its first order :math:`\Delta t`.
    """
    fit = step(rolling.fits(), "off-tuned").left
    (k,) = (each for each in fit.function.free_symbols if each.name == "k")
    moved = fit.function / k / (rolling.OFF * rolling.TIME) * sp.sin(rolling.OFF * rolling.TIME)
    at = {rolling.T: sp.S.One, rolling.OFF: symbol("phase")}
    return sp.simplify(sp.integrate(sp.expand(moved.subs(at)), (rolling.TIME, 0, 1), conds="none"))


@cache
def strength() -> sp.Expr:
    """Return the fraction of a signal in one dimension, (11), that is left at the end."""
    low = sp.Add(*(term for term in step(rolling.one_dimension(), "(10)").right.args if not term.has(rolling.ROLL)))
    return (low / low.subs(rolling.OFF, 0)).subs(rolling.OFF * rolling.TIME, symbol("phase"))


def lost() -> Derivation:
    """Derive the lost share in a form that does not subtract nearly equal numbers."""
    return Derivation((Step("the share lost", 1 - strength(), 2 * sp.sin(symbol("phase") / 2) ** 2),))


@cache
def off_tuned() -> Definitions:
    """Define the worst error of a roll rate stored in t digits, and its effect on a derolled record."""
    period, duration, drift, b, rate, error, phase = map(
        symbol, ("period", "duration", "drift", "b", "rate", "error", "phase")
    )
    steps = rounding.one_rounding()
    dropped = _either(*(named(step(steps, number).left.args[0], b="b", t="t", e="e") for number in ("(8)", "(13)")))
    return (
        Definition("rate", 2 * sp.pi / period),
        Definition("e", sp.floor(sp.log(rate) / sp.log(b)) + 1),
        Definition("error", dropped),
        Definition("beat", 2 * sp.pi / error / (365 * DAY)),
        Definition("phase", error * duration * DAY),
        Definition("lost", lost().steps[0].right, shown=1 - strength()),
        Definition("across", drift * stable(across(), phase, 2), shown=drift * across()),
    )


# -- digital integration ---------------------------------------------------------------------------


@cache
def random_walk() -> Definitions:
    """Define (35), (39) and their quotient."""
    sigma, omega, rate, mu, walk, exact, printed = map(
        symbol, ("sigma", "omega", "rate", "mu", "walk", "exact", "printed")
    )
    small = step(integration.small_mu(), "(38) to (39)").right
    plain = named(integration.walk(), mu="mu")
    return (
        Definition("mu", omega / rate),
        Definition("walk", stable(plain, mu, 4), shown=plain),
        Definition("exact", sigma * sp.sqrt(walk / rate)),
        Definition("printed", named(small, omega="omega", f_c="rate", sigma_x="sigma")),
        Definition("ratio", printed / exact),
    )
