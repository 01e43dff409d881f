"""A check for each ledger entry of savage2016."""

from __future__ import annotations

from functools import cache

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.integration import derivation, experiment, theory
from gpbnb.integration.derivation import (
    DECAY,
    MU,
    OMEGA,
    P11,
    P12,
    P22,
    P31,
    PHI11,
    PHI21,
    Q1,
    Q2,
    TAU,
    TIME,
    X1,
    X2,
    X3,
    P,
    T,
)
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Checks

CHECKS = Checks()
CHAPTER = "chapter *Digital integration error*"
MAIN = "savage2016.main."
CLOSE = 1e-10
"""Share by which the recursion (18) may miss the closed form: it subtracts numbers that are 12/μ² times the result."""


def eq(*numbers: str) -> tuple[str, ...]:
    """Ids of equations."""
    return tuple(f"{MAIN}eq{number}" for number in numbers)


def same(*expressions: sp.Expr) -> bool:
    """Whether expressions, or matrices, are equal."""
    first, *others = (sp.Matrix([[e]]) if not isinstance(e, sp.MatrixBase) else e for e in expressions)
    return all(all(sp.simplify(entry.rewrite(sp.exp).expand()) == 0 for entry in first - other) for other in others)


@cache
def slips() -> dict[str, sp.Expr]:
    """What the slips would have made of the rate; see :func:`gpbnb.integration.derivation.slips`."""
    return derivation.slips()


def spoiled(place: str) -> str:
    """What a slip would have led to, in words and numbers, for μ = 0.1 and T = 0.01 s."""
    values = {MU: sp.Rational(1, 10), T: sp.Rational(1, 100)}
    found, right = (float(e.subs(values)) for e in (slips()[place], derivation.walk()))
    return f"used, it would make the rate at $\\mu=0.1$, $T=0.01$ s {found:.4g} instead of {right:.4g}"


@cache
def mended() -> tuple[float, float]:
    """Largest relative error of P_ee by the recursion (18), (25), mended and as printed, over some μ and n."""
    errors = {True: 0.0, False: 0.0}
    for mu in (0.5, 2.0, 10.0):
        exact = theory.error_variance(np.arange(1, 41), mu)
        for right in errors:
            found = theory.savage_recursion(40, mu) if right else theory.savage_recursion(40, mu, 1.0, True)
            errors[right] = max(errors[right], float(np.max(abs(found.pee[1:] / exact - 1))))
    return errors[True], errors[False]


@cache
def simulated() -> experiment.Sweep:
    """A small simulation of the random walk."""
    return experiment.sweep([0.01, 0.1, 1.0, 10.0], 300, 4000, np.random.default_rng(35))


def worst(found: experiment.Sweep) -> float:
    """Largest deviation from the exact variance, in standard errors."""
    return float(np.max(np.abs(found.deviations())))


def summed(mu: float) -> float:
    """(35) squared from the spectrum, over σ_x² T: its values at the multiples of f_c, the far ones by an integral."""
    k = np.arange(1, 20_001)
    near = float(np.sum(theory.first_order(1.0, mu).psd(2 * np.pi * k)))
    return 2 * (near + float(np.arctan(mu / (2 * np.pi * (len(k) + 0.5)))) / np.pi)


def edged(edge: float, n: int) -> float:
    """Error variance after n cycles, over σ_x² T², of an input whose spectrum is flat and ends at `edge` times f_c."""
    f = np.pi * edge * (np.arange(20_000) + 0.5) / 20_000
    one = np.cos(f) - np.sin(f) / f  # of a cycle: trapezoid less integral
    return float(np.mean((one * np.sin(n * f) / np.sin(f)) ** 2))


# -- title, abstract, figure ----------------------------------------------------------------------


@CHECKS.add(MAIN + "stitle.date")
def date() -> Finding:
    return unverifiable("", "a date and a report number, which nothing else in the documents repeats")


@CHECKS.add(MAIN + "sreference.reference")
def reference() -> Finding:
    return unverifiable(
        "", "the book is not among the documents; what is taken from it, (3), (5) and (19), is derived here"
    )


@CHECKS.add(MAIN + "sfig-1.fig-1")
def figure() -> Finding:
    return unverifiable(
        "redrawn from (1), (2) and (11)", f"the picture is not in the scan, only its caption and the text; {CHAPTER}"
    )


@CHECKS.add(MAIN + "sabstract.abstract-claim")
def abstract() -> Finding:
    mu = np.array([1e-3, 0.1, 1.0, 10.0, 100.0])
    width, rate = theory.exponents(mu)
    in_rms = theory.random_walk(6.0, 5.0, 7.0) / theory.random_walk(2.0, 5.0, 7.0)
    everywhere = bool(np.all(abs(width - 0.5) < 0.01) and np.all(abs(rate + 1) < 0.01) and abs(in_rms - 3) < 1e-12)
    small = bool(abs(width[0] - 0.5) < 1e-6 and abs(rate[0] + 1) < 1e-6)
    return compare(
        everywhere,
        f"powers of bandwidth and frequency {width[0]:.2f} and {rate[0]:.2f} at $\\mu=10^{{-3}}$, {width[2]:.2f} and "
        f"{rate[2]:.2f} at $\\mu=1$, {width[-1]:.2f} and {rate[-1]:.2f} at $\\mu=100$; power of the rms "
        f"{np.log(in_rms) / np.log(3):.2f} always",
        Verdict.INCONSISTENT if small else Verdict.WRONG,
        otherwise_note=f"true of (39) for small $\\mu$ only, against (35); (39) is 1 % too large at "
        f"$\\mu={theory.validity(0.01):.2f}$, 10 % at {theory.validity(0.1):.2f}",
    )


@CHECKS.add(MAIN + "sabstract.random-walk")
def walk_type() -> Finding:
    f_c, uneven = 2.0, 0.0
    for process in (theory.first_order(1.0, 1.0), theory.resonant(1.0, 3.0, 0.2)):
        variance = theory.rule_variance(process, f_c, theory.RULES["trapezoidal"], 400)
        grown = (variance[400] - variance[200]) * f_c / 200
        uneven = max(uneven, abs(float(grown) / theory.walk_rate(process, f_c) - 1))
    edge = 0.4
    early, late = edged(edge, 100), edged(edge, 1000)
    return compare(
        uneven < 1e-9,
        "in the end the variance grows evenly, for the input of (1) and for a resonant one, as the spectrum at the "
        "multiples of $f_c$ says",
        note=f"of noise limited by a filter; a flat spectrum that ends at ${edge:g}f_c$ makes no random walk: its "
        f"variance is ${early:.2g}\\sigma_x^2T^2$ after 100 cycles and ${late:.2g}\\sigma_x^2T^2$ after 1000",
    )


@CHECKS.add(MAIN + "sanalysis.aim")
def aim() -> Finding:
    d32, d33, d22 = derivation.steady_changes()
    letters = sp.simplify((d33 + d22 - 2 * d32) / T).free_symbols
    return compare(
        letters == {P, OMEGA, T},
        "$\\dot P_{ee}$ depends on $P_{11\\infty}=\\sigma_x^2$, $\\omega_{bw}$ and $T$ alone",
        note="for large $n$; and it is the growth of the error, which itself depends on the time too",
    )


# -- (1)-(11) -------------------------------------------------------------------------------------


@CHECKS.add(*eq("1", "3", "4"), MAIN + "sanalysis.symbols-3")
def model() -> Finding:
    noise_1 = sp.Symbol("n_p1")
    state, rate = sp.Matrix([X1, X2]), sp.Matrix([-OMEGA * X1 + noise_1, X1])
    a = rate.jacobian(state)
    process = theory.first_order(2.0, 3.0)
    lags = np.array([0.0, 0.5, 2.0])
    agrees = (
        same(a, sp.Matrix([[-OMEGA, 0], [1, 0]]))
        and same(rate - a * state, sp.Matrix([noise_1, 0]))
        and bool(np.allclose(process.autocovariance(lags), 4 * np.exp(-3 * lags), rtol=1e-14))
    )
    return compare(
        agrees,
        "the derivatives of (1) by $\\underline x$ are the printed $\\underline A$, the rest is $\\underline n_p$",
        note="a definition",
    )


@CHECKS.add(MAIN + "sanalysis.band-limited")
def band_limited() -> Finding:
    sigma, omega = 2.0, 3.0
    process = theory.first_order(sigma, omega)
    both, one, other, none = process.autocovariance(np.array([1.1, 0.3, 0.8, 0.0]))
    # Shares of the variance below ω tan θ: the density per dθ is even.
    angle = np.pi / 2 * (np.arange(1000) + 0.5) / 1000
    density = process.psd(omega * np.tan(angle)) * omega / np.cos(angle) ** 2 / (2000 * sigma**2)
    inside, whole = float(np.sum(density[:500])), float(np.sum(density))
    return compare(
        bool(abs(both * none / (one * other) - 1) < 1e-14 and abs(whole - 1) < 1e-12),
        "$R(\\tau_1+\\tau_2)R(0)=R(\\tau_1)R(\\tau_2)$, as of a first order Markov process",
        note=f"a band without an edge: {inside:.0%} of the variance lies below $\\omega_{{bw}}$, the rest above",
    )


@CHECKS.add(MAIN + "sanalysis.bandwidth")
def bandwidth() -> Finding:
    process = theory.first_order(2.0, 3.0)
    low, edge = (float(process.psd(s)) for s in (0.0, 3.0))
    noise_width = process.sigma**2 / (2 * low) * 2 * np.pi / 3.0
    return compare(
        bool(abs(edge / low - 0.5) < 1e-14) and -process.drift[0][0] == 3.0,
        f"the density at $\\omega_{{bw}}$ is {edge / low:.2f} of that at zero; the gain in (1) is $-\\omega_{{bw}}$",
        note=f"in rad/s, to half the density; of a band with an edge and the same variance, {noise_width:.3f} as wide",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-1-2")
def integrals() -> Finding:
    process = theory.first_order(2.0, 3.0)
    at = np.array([0.0, 1.0, 10.0, 1e3])
    flat = process.psd(at) * (9.0 + at**2)
    phi = derivation.transition_matrix()
    silent = {Q1: 0, Q2: 0, PHI11: phi[0, 0], PHI21: phi[1, 0]}
    _, x2, x3 = (state.subs(silent) for state in derivation.after())
    gained = sp.integrate(X1 * sp.exp(-OMEGA * TAU), (TAU, 0, T))
    excess = sp.limit((x3 - X3 - gained) / T**3, T, 0)
    in_f, in_t = theory.random_walk(1.0, 3.0, 8.0) ** 2, derivation.walk().subs(MU, sp.Rational(3, 8)) / 8
    return compare(
        bool(np.ptp(flat) < 1e-12 * flat[0])
        and same(x2 - X2, gained)
        and same(excess, OMEGA**2 * X1 / 12)
        and abs(in_f / float(in_t) - 1) < 1e-13,
        "without noise $x_2$ gains the integral of $x_1$ and $x_3$ exceeds it by $\\frac1{12}\\omega_{bw}^2T^3x_1$ to "
        "lowest order, as of a trapezoid; the spectrum of $n_{p1}$ is flat; $T=1/f_c$ takes (33) to (35)",
    )


@CHECKS.add(*eq("2"))
def trapezoidal() -> Finding:
    x = np.array([[1.0], [3.0], [-2.0], [5.5]])
    running = experiment.Accumulator(FloatFormat(2, 40), 0.25, 1)
    running.feed(x)
    expected = 0.25 * (0.5 * 1 + 3 - 2 + 0.5 * 5.5)
    rule = theory.RULES["trapezoidal"]
    return compare(
        float(running.value[0]) == expected and [float(w) for w in rule.weights[0]] == [0.5, 0.5],
        f"{expected:g} for the samples 1, 3, −2, 5.5 and $T=\\frac14$",
        note="a definition",
    )


@CHECKS.add(*eq("5"))
def discrete() -> Finding:
    phi = derivation.transition_matrix()
    before, after = (
        sp.Matrix([[P, derivation.p12(t)], [derivation.p12(t), derivation.p22(t)]]) for t in (TIME, TIME + T)
    )
    return compare(
        same(phi * before * phi.T + derivation.noise(), after),
        "$\\Phi P\\Phi^T+E(\\underline q\\,\\underline q^T)$ takes (23) from $t$ to $t+T$",
    )


@CHECKS.add(*eq("6-phi"))
def transition_integral() -> Finding:
    as_printed, with_identity = (derivation.transition_residual(identity) for identity in (False, True))
    zero = sp.zeros(2)
    return compare(
        same(as_printed, zero),
        "$\\Phi(\\tau)=I+\\int_0^\\tau A\\Phi\\,d\\tau_1$; (7) exceeds the printed integral by "
        f"${sp.latex(as_printed)}$",
        Verdict.MISPRINT if same(with_identity, zero) else Verdict.WRONG,
        otherwise_note="the $I$ is missing, against $\\Phi(0)=I$ beside it, and the limits are those of $t$, not of "
        "$\\tau$; as printed only $\\Phi=0$ solves it; (7) is right. The limits are the author's, since both integrals "
        "have them; the $I$ may be the scan's loss",
    )


@CHECKS.add(*eq("6-q-n"))
def noise_integral() -> Finding:
    right, as_printed, turned = (derivation.noise(kernel) for kernel in ("right", "printed", "reversed"))
    variance = float(as_printed[0, 0].subs({P: 1, OMEGA: 1, T: 1, TIME: 5}))
    expected = float(right[0, 0].subs({P: 1, OMEGA: 1, T: 1}))
    return compare(
        same(right, as_printed),
        "$\\underline q_n=\\int\\Phi(t_n-\\tau)\\,\\underline n_p(\\tau)\\,d\\tau$; as printed, $E(q_1^2)$ would fall "
        f"to {variance:.2g} of $\\sigma_x^2$ after five correlation times, where it is {expected:.2g}",
        Verdict.MISPRINT if same(right, turned) else Verdict.WRONG,
        otherwise_note="$\\Phi(\\tau-t_{n-1})$ would do for the covariance, time being reversed; the document "
        "never uses $\\underline q_n$ but for being new; $P$ for $p$ is a slip of type",
    )


@CHECKS.add(*eq("7", "8", "9"), MAIN + "sanalysis.easily-shown")
def transition() -> Finding:
    ours = derivation.transition_matrix()
    return compare(
        same(ours, derivation.printed_transition())
        and same(derivation.transition_residual(identity=True), sp.zeros(2))
        and derivation.transition().holds,
        f"$\\exp(AT)={sp.latex(ours)}$",
        note="with the identity that (6) lacks",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-6")
def transitions() -> Finding:
    phi, q = derivation.transition_matrix(), derivation.noise()
    return compare(
        same(phi.subs(T, 2 * T), phi * phi)
        and same(phi.subs(T, 0), sp.eye(2))
        and same(q.subs(T, 2 * T), phi * q * phi.T + q),
        "$\\Phi(2T)=\\Phi(T)^2$, $\\Phi(0)=I$; the noise of two cycles is that of the first, carried on, and that of "
        "the second",
    )


@CHECKS.add(*eq("10"))
def components() -> Finding:
    phi = sp.Matrix([[PHI11, 0], [PHI21, 1]])
    first_two = phi * sp.Matrix([X1, X2]) + sp.Matrix([Q1, Q2])
    x1, x2, x3 = derivation.after()
    return compare(
        same(sp.Matrix([x1, x2]), first_two) and same(x3, X3 + (x1 + X1) * T / 2), "the rows of (5), and (2)"
    )


# -- the error and its variance, (11)-(15), (29) --------------------------------------------------


@CHECKS.add(*eq("11", "13", "15", "29"))
def error_variance() -> Finding:
    right, _ = mended()
    return compare(
        right < CLOSE,
        f"$P_{{33}}+P_{{22}}-2P_{{32}}$ by the mended (18) is the closed form to {CLOSE:.0e}",
        note="definitions",
    )


@CHECKS.add(*eq("12"))
def squared_mean() -> Finding:
    agrees, holds = same(slips()["(12)"], derivation.walk()), mended()[0] < CLOSE
    return compare(
        agrees,
        "$E(x_{2n}^2)$; the print is the square of a mean, which is zero",
        Verdict.MISPRINT if holds else Verdict.WRONG,
        otherwise_note=f"(13) has $P_{{22}}$ again, and the term before has its square inside; author or scan, either "
        f"may have moved it; {spoiled('(12)')}",
    )


@CHECKS.add(*eq("14"))
def rate() -> Finding:
    d32, d33, d22 = derivation.steady_changes()
    wanted = d33 + d22 - 2 * d32
    candidates = (d32, d33, d22, sp.Integer(0))
    mends = same((wanted / (P * T**2)).subs(OMEGA, MU / T), derivation.walk())
    return compare(
        any(same(candidate, wanted) for candidate in candidates),
        "$\\Delta P_{ee_n}/T$; none of $\\Delta P_{11}$, $\\Delta P_{22}$, $\\Delta P_{32}$, $\\Delta P_{33}$ is it",
        Verdict.MISPRINT if mends else Verdict.WRONG,
        otherwise_note="$ij$ for $ee$, as in (15) below it, so by the author rather than the scan; the last member is "
        "right",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-12")
def means() -> Finding:
    zero = dict.fromkeys((X1, X2, X3, Q1, Q2), 0)
    kept = all(state.subs(zero) == 0 for state in derivation.after())
    errors = experiment.simulate(theory.first_order(1.0, 3.0), 1.0, [20], np.random.default_rng(12), 4000).errors[0]
    away = abs(float(np.mean(errors))) / (float(np.std(errors)) / np.sqrt(len(errors)))
    return compare(
        bool(kept and away < 4),
        f"(10) has no constant, so means that begin at zero stay there; in {len(errors)} simulations the mean error is "
        f"{away:.1f} standard errors from it",
        note="expected squares and products are variances and covariances since all means are zero",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-14")
def rate_of_a_cycle() -> Finding:
    mu = 2.0
    by_18 = np.diff(theory.savage_recursion(40, mu).pee)
    closed = np.diff(theory.error_variance(np.arange(41), mu))
    return compare(
        bool(np.max(abs(by_18 / closed - 1)) < 1e-10),
        "$T\\dot P_{ee_n}$ by the mended (18) is what a cycle adds to the closed form, for each of 40 cycles",
        note=f"a difference over $T$, not a derivative; from cycle to cycle it goes from {closed[0]:.3g} to "
        f"{closed[-1]:.3g} $\\sigma_x^2T^2$ at $\\mu={mu:g}$",
    )


# -- (16)-(18) ------------------------------------------------------------------------------------


@CHECKS.add(*eq("16"))
def products() -> Finding:
    (x1, x2, new), x3 = derivation.after(), X3
    printed = (
        (new * x1, x3 * x1 + x1**2 * T / 2 + X1 * x1 * T / 2),
        (new * x2, x3 * x2 + x1 * x2 * T / 2 + X1 * x2 * T / 2),
        (new**2, x3**2 + x3 * (x1 + X1) * T + (x1**2 + 2 * x1 * X1 + X1**2) * T**2 / 4),
        (
            new**2,
            x3**2 + x3 * X1 * T + x1**2 * T**2 / 4 + X1**2 * T**2 / 4 + x3 * x1 * T + x1 * X1 * T**2 / 2,
        ),
    )
    right = sum(same(ours, theirs) for ours, theirs in printed)
    return compare(right == len(printed), f"{right} of {len(printed)} expansions are right")


@CHECKS.add(*eq("17"))
def mixed_products() -> Finding:
    x1, x2, _ = derivation.after()
    printed = (
        (X3 * x1, PHI11 * X3 * X1 + X3 * Q1),
        (X1 * x1, PHI11 * X1**2 + X1 * Q1),
        (X3 * x2, X3 * X2 + PHI21 * X3 * X1 + X3 * Q2),
        (X1 * x2, X1 * X2 + PHI21 * X1**2 + X1 * Q2),
    )
    right = sum(same(ours, theirs) for ours, theirs in printed)
    return compare(right == len(printed), f"{right} of {len(printed)} expansions are right")


@CHECKS.add(MAIN + "sanalysis.uncorrelated-q")
def uncorrelated() -> Finding:
    # What x_{n-1} has in common with x_n, and with the integral, less what (5) makes of it.
    # t is how long before t_{n-1}: all of the past, from which x_2 and x_3 are made, is covered.
    phi, together = derivation.transition_matrix(), P * sp.exp(-OMEGA * (TIME + TAU))
    past = together.subs(TAU, T) - phi[0, 0] * together.subs(TAU, 0)
    integral = sp.integrate(together, (TAU, 0, T)) - phi[1, 0] * together.subs(TAU, 0)
    step_1, second = theory.exact_step(theory.resonant(1.0, 3.0, 0.2), 2.0)
    kept = np.eye(2) - step_1[:2] @ step_1[:2].T
    return compare(
        same(past, sp.Integer(0))
        and same(integral, sp.Integer(0))
        and bool(np.allclose(kept, second[:2] @ second[:2].T, atol=1e-14)),
        "$E(q_1x_1)=E(q_2x_1)=0$ for $x_1$ at $t_{n-1}$ and any time before, of which $x_2$ and $x_3$ are made, from "
        "$E(x_1x_1')=\\sigma_x^2e^{-\\omega_{bw}|\\tau|}$",
    )


def _covariance(place: int) -> tuple[bool, bool]:
    """Whether a line of (18) is right as printed, and with the half that the second one lacks."""
    after = derivation.after()
    ours = derivation.expected(after[2] * after[place])
    return same(ours, derivation.printed_18(half=False)[place]), same(ours, derivation.printed_18(half=True)[place])


@CHECKS.add(*eq("18-p31"))
def p31() -> Finding:
    return compare(_covariance(0)[0], "the same, by expected values of (16)")


@CHECKS.add(*eq("18-p32"))
def p32() -> Finding:
    agrees, holds = _covariance(1)
    return compare(
        agrees,
        "the last term is $\\frac12\\phi_{21}P_{11_{n-1}}T$",
        Verdict.MISPRINT if holds else Verdict.WRONG,
        otherwise_note=f"the factor $\\frac12$ is back in (32), as (16) and (17) have it, so that author or scan "
        f"dropped it here alone; {spoiled('(18)')}, a negative variance",
    )


@CHECKS.add(*eq("18-p33"))
def p33() -> Finding:
    return compare(_covariance(2)[0], "the same, by expected values of (16)")


# -- (19)-(28) ------------------------------------------------------------------------------------


@CHECKS.add(*eq("19", "20"))
def covariance_equation() -> Finding:
    a = sp.Matrix([[-OMEGA, 0], [1, 0]])
    phi, before = derivation.printed_transition(), sp.Matrix([[P11, P12], [P12, P22]])
    p = phi * before * phi.T + derivation.noise()
    density = sp.Matrix([[2 * OMEGA * P, 0], [0, 0]])
    return compare(
        same(p.diff(T), a * p + p * a.T + density),
        "$\\Phi P\\Phi^T+E(\\underline q\\,\\underline q^T)$ solves it, with $N_{P_{11}}=2\\omega_{bw}P_{11\\infty}$",
    )


@CHECKS.add(*eq("21"))
def covariance_components() -> Finding:
    second, printed = derivation.continuous().steps[1].right, P11 - sp.Symbol("omega_BW") * P12
    holds = derivation.continuous().holds_at(0, 1, 2)
    return compare(
        holds and same(second, printed),
        f"$\\dot P_{{12}}={sp.latex(second.subs(OMEGA, sp.Symbol('omega_bw')))}$; the others as printed",
        Verdict.MISPRINT if holds and same(second, printed.subs("omega_BW", OMEGA)) else Verdict.WRONG,
        otherwise_note="capitals in the subscript, by author or scan, here alone; $A$ is that of (4), not of (3)",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-20")
def density() -> Finding:
    sigma, omega = 2.0, 3.0
    process, at = theory.first_order(sigma, omega), np.array([0.0, 1.0, 10.0, 1e3])
    found = process.psd(at) * (omega**2 + at**2)
    steady = -2 * OMEGA * P + sp.Symbol("N_P11")  # (21)
    needed = float(sp.solve(steady, "N_P11")[0].subs({OMEGA: 3, P: 4}))
    return compare(
        bool(np.max(abs(found / needed - 1)) < 1e-12) and derivation.continuous().holds_at(0),
        f"the density of $n_{{p1}}$ is {found[0]:g} at every frequency for $\\sigma_x=2$, $\\omega_{{bw}}=3$, and so "
        f"is $N_{{P_{{11}}}}=2\\omega_{{bw}}\\sigma_x^2$, which keeps $P_{{11}}$ steady",
        note="two-sided and a hertz: over positive frequencies alone it is twice as much",
    )


@CHECKS.add(*eq("22", "23"), MAIN + "sanalysis.steady-start")
def continuous_solution() -> Finding:
    steady = sp.solve(sp.Eq(-2 * OMEGA * P11 + 2 * OMEGA * P, 0), P11)
    rate, other = (float(np.diff(theory.error_variance([5000, 5001], 0.5, start))[0]) for start in (1.0, 0.0))
    return compare(
        derivation.continuous().holds_at(3, 4, 5) and steady == [P],
        "(23) solves (22) from zero",
        note="" if abs(rate / other - 1) > 1e-9 else "the rate in the end does not depend on how $P_{11}$ starts",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-22-23")
def steady_input() -> Finding:
    start = {TIME: sp.Integer(0)}
    silent = derivation.p12(TIME).subs(start) == 0 == derivation.p22(TIME).subs(start)
    carried = DECAY**2 * P11 + derivation.noise()[0, 0]
    ends = sp.solve(sp.Eq(carried, P11), P11)
    return compare(
        silent and len(ends) == 1 and same(ends[0], P),
        "$P_{11\\infty}$ is the only variance that a cycle returns; (23) is zero at $t=0$",
    )


@CHECKS.add(*eq("24", "26"))
def p22_at_cycles() -> Finding:
    later = 2 * P / OMEGA * (TIME + T - (1 - DECAY * sp.exp(-OMEGA * TIME)) / OMEGA)
    return compare(same(derivation.p22(TIME + T), later), "(23) at $t_{n-1}$ and at $t_n=t_{n-1}+T$")


@CHECKS.add(*eq("25"))
def p22_recursion() -> Finding:
    change = derivation.p22(TIME + T) - derivation.p22(TIME)
    holds = same(change, derivation.p22_change(printed=False))
    harmless = same(slips()["(25)"], derivation.walk())
    values = {P: 1, OMEGA: 10, T: sp.Rational(1, 100), TIME: 0}
    found, right = (float(e.subs(values)) for e in (derivation.p22_change(printed=True), change))
    return compare(
        same(change, derivation.p22_change(printed=True)),
        "$\\frac2{\\omega_{bw}}[T-\\frac1{\\omega_{bw}}(1-e^{-\\omega_{bw}T})e^{-\\omega_{bw}t_{n-1}}]P_{11\\infty}$",
        Verdict.MISPRINT if holds and harmless else Verdict.WRONG,
        otherwise_note="a time less a number, where (24) has $\\frac1{\\omega_{bw}}$; dropped by author or scan; no "
        "more than a slip, since for large $n$ the term dies away; but it spoils the "
        f"build-up: the first change of $P_{{22}}$ for $\\omega_{{bw}}=10$, $T=0.01$ is {found:.3g}, not {right:.3g}",
    )


@CHECKS.add(*eq("27"))
def p12_at_cycles() -> Finding:
    before, q = derivation.p12(TIME), derivation.noise()
    carried = DECAY * (before + (1 - DECAY) / OMEGA * P) + q[0, 1]
    return compare(same(carried, derivation.p12(TIME + T)), "the same from cycle to cycle by (10)")


@CHECKS.add(*eq("28"))
def p11_at_cycles() -> Finding:
    return compare(same(DECAY**2 * P + derivation.noise()[0, 0], P), "$\\phi_{11}^2P_{11}+E(q_1^2)=P_{11}$")


@CHECKS.add(MAIN + "sanalysis.complete-set")
def complete_set() -> Finding:
    right, printed = mended()
    fit = f"right to {CLOSE:.0e}" if right < CLOSE else f"off by {right:.1e}"
    return compare(
        printed < CLOSE,
        f"with (18) and (25) mended, and zero $P_{{31}}$, $P_{{32}}$, $P_{{33}}$ to begin with, $P_{{ee_n}}$ is {fit}; "
        f"as printed it is wrong by up to {printed:.2g} times itself",
        Verdict.WRONG,
        otherwise_note="complete but for the slips of (18) and (25), which whoever evaluates the set runs into",
    )


# -- (30)-(35) ------------------------------------------------------------------------------------


@CHECKS.add(*eq("30", "31"))
def steady_p31() -> Finding:
    ours = sp.solve(sp.Eq(P31, DECAY * P31 + (1 + DECAY) * P * T / 2), P31)
    printed = (1 + DECAY) / (1 - DECAY) * P * T / 2
    return compare(
        len(ours) == 1
        and same(ours[0], printed)
        and derivation.steady_state().holds_at(0)
        and same(sp.limit(derivation.p12(TIME), TIME, sp.oo), P / OMEGA),
        "the same; $P_{12\\infty}=P_{11\\infty}/\\omega_{bw}$",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-30")
def steady_covariances() -> Finding:
    away = 0.0
    for mu in (0.5, 2.0, 10.0):
        found, phi = theory.savage_recursion(400, mu), float(np.exp(-mu))
        away = max(away, abs(float(found.p31[-1]) * 2 * (1 - phi) / (1 + phi) - 1))
    return compare(
        away < 1e-12 and same(sp.limit(derivation.p12(TIME), TIME, sp.oo), P / OMEGA),
        "$P_{31}$ of (18), from zero, is that of (31) after 400 cycles; $P_{12}$ of (23) tends to "
        "$P_{11\\infty}/\\omega_{bw}$",
    )


@CHECKS.add(*eq("32"))
def steady_changes() -> Finding:
    quotient, phi21 = (1 + DECAY) / (1 - DECAY), (1 - DECAY) / OMEGA
    p31 = P * T / 2 * quotient
    d32, d33, d22 = derivation.steady_changes()
    lines = (
        same(
            d32,
            phi21 * p31 + P / OMEGA * T + phi21 * P * T / 2,
            (phi21 * quotient / 2 + phi21 / 2 + 1 / OMEGA) * P * T,
            (phi21 / (1 - DECAY) + 1 / OMEGA) * P * T,
        ),
        same(
            d33,
            (1 + DECAY) * p31 * T + (1 + DECAY) * P * T**2 / 2,
            (1 + DECAY) / 2 * (quotient + 1) * P * T**2,
            quotient * P * T**2,
        ),
        same(sp.limit(derivation.p22_change(printed=False), TIME, sp.oo), d22, 2 / OMEGA * P * T),
    )
    return compare(all(lines), f"{sum(lines)} of {len(lines)} lines are right")


@CHECKS.add(*eq("33"))
def steady_rate() -> Finding:
    quotient, phi21 = (1 + DECAY) / (1 - DECAY), (1 - DECAY) / OMEGA
    middle = quotient * T + 2 / OMEGA - 2 * (phi21 / (1 - DECAY) + 1 / OMEGA)
    last = ((1 + DECAY) * T - 2 * phi21) / (1 - DECAY)
    return compare(derivation.steady_state().holds_at(3) and same(middle, last), "the same, from (32)")


@CHECKS.add(*eq("34"))
def rate_in_mu() -> Finding:
    quotient, phi21 = (1 + DECAY) / (1 - DECAY), (1 - DECAY) / OMEGA
    first = ((1 + DECAY) * T - 2 * phi21) / (1 - DECAY)
    second = (1 + DECAY - 2 / OMEGA * (1 - DECAY)) / (1 - DECAY)
    third, fourth = quotient * T - 2 / OMEGA, (quotient - 2 / (OMEGA * T)) * T
    return compare(
        same(first, second, third, fourth),
        "$(1+\\phi_{11})T-\\frac2{\\omega_{bw}}(1-\\phi_{11})$ over $1-\\phi_{11}$ in the second member",
        Verdict.MISPRINT if same(first, third, fourth) else Verdict.WRONG,
        otherwise_note=f"its $T$ is lost, by author or scan, and back in the third; {spoiled('(34)')}; with $T=1$ "
        "nobody would see it",
    )


@CHECKS.add(*eq("35"))
def random_walk() -> Finding:
    sigma, omega, f = 1.7, 3.0, 7.0
    printed = sigma * np.sqrt(theory.printed_walk_factor(omega / f) / f)
    ours = theory.random_walk(sigma, omega, f)
    return compare(
        derivation.steady_state().holds_at(4, 5, 6) and bool(abs(ours / printed - 1) < 1e-13),
        "$\\sigma_x\\sqrt{L(\\mu/2)/f_c}$, with Langevin's function $L(x)=\\coth x-1/x$",
    )


@CHECKS.add(MAIN + "sanalysis.symbols-35")
def deviations() -> Finding:
    sigma, omega, f_c = 1.7, 3.0, 7.0
    rms = float(np.sqrt(theory.first_order(sigma, omega).autocovariance(0.0)))
    cycle = float(np.diff(theory.error_variance([5000, 5001], omega / f_c))[0]) * (sigma / f_c) ** 2
    return compare(
        bool(
            abs(rms / sigma - 1) < 1e-14 and abs(theory.random_walk(sigma, omega, f_c) ** 2 / (cycle * f_c) - 1) < 1e-9
        ),
        "(35) squared is the variance that a late cycle adds, over $T$; $\\sigma_x$ is the rms of $x_1$",
    )


@CHECKS.add(MAIN + "sanalysis.35-exact")
def exact() -> Finding:
    found, limit = simulated(), 1e-12
    folded = max(abs(summed(mu) / float(theory.walk_factor(mu)) - 1) for mu in (1e-4, 0.1, 1.0, 30.0))
    return compare(
        derivation.independent().holds and folded < limit and worst(found) < 4,
        f"again from the errors of single cycles, and from the spectrum summed over the multiples of $f_c$ to "
        f"{limit:.0e}; in {found.paths} simulations at each of {len(found.mu)} $\\mu$, {worst(found):.1f} standard "
        "errors at most",
        note="the variance itself is less by $\\frac12\\sigma_x^2T^2L^2$ in the end",
    )


@CHECKS.add(MAIN + "sanalysis.large-n")
def large_n() -> Finding:
    late = max(
        abs(float(theory.error_variance(n := theory.takeover(mu, 1e-6), mu)) / (n * float(theory.walk_factor(mu))) - 1)
        for mu in (0.01, 1.0, 100.0)
    )
    begins = {mu: theory.takeover(mu, 0.01) for mu in (0.1, 1.0, 100.0)}
    return compare(
        late < 1.01e-6,
        "the variance is the random walk's within 1 % from cycle "
        + ", ".join(f"{np.ceil(k):.0f} on at $\\mu={mu:g}$" for mu, k in begins.items()),
        note="$n$ need not be very large: the share that is missing is $L(1-e^{-n\\mu})/2n$",
    )


@CHECKS.add(MAIN + "sanalysis.unit-of-35")
def units() -> Finding:
    base = theory.random_walk(2.0, 3.0, 7.0)
    per_minute = theory.random_walk(2.0 * 60, 3.0 * 60, 7.0 * 60)
    return compare(
        bool(abs(per_minute / base / np.sqrt(60) - 1) < 1e-12),
        f"with minutes for seconds throughout, {per_minute / base:.4f} times the number, which is $\\sqrt{{60}}$",
        note="the unit of the integral, per √s",
    )


# -- (36)-(39) ------------------------------------------------------------------------------------


@CHECKS.add(*eq("36"))
def exponential() -> Finding:
    ours = sp.series(sp.exp(-MU), MU, 0, 4).removeO()
    printed = 1 - MU + MU**2 / 2 - MU**3 / 6
    return compare(same(ours, printed) and derivation.small_mu().holds_at(0), f"${sp.latex(ours, order='rev-lex')}$")


@CHECKS.add(*eq("37"))
def series() -> Finding:
    steps, half, quarter, sixth = derivation.small_mu(), sp.Rational(1, 2), sp.Rational(1, 4), sp.Rational(1, 6)
    cubic = 1 - MU + half * MU**2 - sixth * MU**3
    numerator, denominator = 2 - MU + half * MU**2 - sixth * MU**3, MU - half * MU**2 + sixth * MU**3
    printed = 2 * (1 - half * MU + quarter * MU**2 - sixth * MU**3)
    others = (
        same(numerator, 1 + cubic)
        and same(denominator, 1 - cubic, MU * (1 - half * MU + sixth * MU**2))
        and same(1 - half * MU + quarter * MU**2 - 1 + half * MU - sixth * MU**2, (quarter - sixth) * MU**2)
        and same(2 / MU * (quarter - sixth) * MU**2, sixth * MU)
        and steps.holds_at(1, 2)
    )
    return compare(
        same(numerator, printed) and others,
        "the cubic term of the numerator is $\\frac1{12}\\mu^3$; all else, and the result $\\frac16\\mu$, is right",
        Verdict.MISPRINT if others else Verdict.WRONG,
        otherwise_note="the quadratic term is halved with the 2 in front, the cubic one not, by author or scan; "
        f"dropped in the next line; kept, it would add a term ${sp.latex(slips()['(37)'] - MU / 6)}$ to what is an odd "
        "function of $\\mu$",
    )


@CHECKS.add(*eq("38", "39"), MAIN + "sanalysis.small-mu")
def approximation() -> Finding:
    mu = np.array([0.01, 0.03, 0.1])
    excess = theory.approximation_ratio(mu) - 1
    printed = theory.printed_random_walk(1.7, 0.03, 3.0) / theory.random_walk(1.7, 0.03, 3.0) - 1
    next_term = bool(np.all(abs(excess / (mu**2 / 120) - 1) < 0.01)) and bool(abs(printed / excess[0] - 1) < 1e-6)
    return compare(
        derivation.small_mu().holds_at(2, 3, 4) and next_term,
        f"too large by $\\mu^2/120$; by 1 % at $\\mu={theory.validity(0.01):.2f}$, by 10 % at "
        f"$\\mu={theory.validity(0.1):.2f}$",
        note="for small $\\mu$, as the document says",
    )


# -- left undone ----------------------------------------------------------------------------------


@CHECKS.add(MAIN + "sanalysis.transient")
def transient() -> Finding:
    mu, n = 3.0, [1, 2, 5, 20]
    closed = theory.error_variance(np.arange(41), mu)
    again = float(np.max(abs(theory.error_variance_recursion(40, mu) - closed)))
    run = experiment.simulate(theory.first_order(1.0, mu), 1.0, n, np.random.default_rng(14), 4000)
    away = float(np.max(np.abs(run.deviations(closed[n]))))
    return answer(
        derivation.transient().holds and again < 1e-12 and away < 4,
        "$P_{ee_n}=\\sigma_x^2T^2[nL-\\frac12L^2(1-e^{-n\\mu})]$, $L=L(\\mu/2)$; in simulations of 1 to 20 cycles "
        f"{away:.1f} standard errors at most",
        f"{CHAPTER}, section on the build-up",
    )


@CHECKS.add(MAIN + "sanalysis.numerical-example")
def numerical_example() -> Finding:
    omega, f_c = 2 * np.pi * 100, 1000.0
    ours = theory.random_walk(1.0, omega, f_c)
    again = np.sqrt(theory.walk_rate(theory.first_order(1.0, omega), f_c))
    rate = theory.required_rate(1.0, omega, ours)
    away = worst(simulated())
    return answer(
        bool(abs(ours / again - 1) < 1e-12 and abs(rate / f_c - 1) < 1e-9 and away < 4),
        f"1 °/s rms in 100 Hz at 1 kHz: {ours:.3g} °/√s, {60 * ours:.2g} °/√h; simulation within {away:.1f} standard "
        "errors",
        f"{CHAPTER}, sections on the simulation and on a sensor",
    )
