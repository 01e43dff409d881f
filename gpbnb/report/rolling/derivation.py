"""Derive the algebra of hung1984, ch. III, again, and closed forms for the questions that the report leaves open."""

from __future__ import annotations

import sympy as sp

from gpbnb.report.display.derivation import Derivation, Step, together, unevaluated

T = sp.Symbol("T", positive=True)
TIME, THETA = sp.symbols("t theta", real=True)
ROLL, OFF = sp.symbols("omega_r Delta", positive=True)
SX, SY, N1, N2, SIGNAL, NOISE = sp.symbols("s_x s_y n_1 n_2 s n", real=True)


def roll(angle: sp.Expr) -> sp.Matrix:
    """Return the matrix of (5)."""
    return sp.Matrix([[sp.cos(angle), sp.sin(angle)], [-sp.sin(angle), sp.cos(angle)]])


def deroll(angle: sp.Expr) -> sp.Matrix:
    """Return the matrix of (7)."""
    return sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])


def one_dimension() -> Derivation:
    """Derive (3), (4), (10) and (11): the effect of multiplying signal and noise by a cosine."""
    phi = ROLL * TIME
    rolled = SIGNAL * sp.cos(phi) + NOISE
    return Derivation(
        (
            Step(
                "(3), the first and last lines agree; the middle line lacks $\\cos\\omega_rt$",
                unevaluated(rolled) * unevaluated(sp.cos(phi + THETA)),
                SIGNAL * sp.cos(THETA) / 2 + SIGNAL * sp.cos(2 * phi + THETA) / 2 + NOISE * sp.cos(phi + THETA),
            ),
            Step(
                "(4), the mean of the signal over a turn",
                sp.Integral(SIGNAL * sp.cos(phi) * sp.cos(phi + THETA), (TIME, 0, 2 * sp.pi / ROLL))
                * ROLL
                / (2 * sp.pi),
                SIGNAL * sp.cos(THETA) / 2,
            ),
            Step(
                "(10), from which (11) keeps the first term",
                unevaluated(rolled) * unevaluated(sp.cos(phi + OFF * TIME)),
                SIGNAL * sp.cos(OFF * TIME) / 2
                + SIGNAL * sp.cos(2 * phi + OFF * TIME) / 2
                + NOISE * sp.cos(phi + OFF * TIME),
            ),
        )
    )


def two_dimensions() -> Derivation:
    r"""Derive (5)-(8) component by component, with a phase error ψ between roll and deroll."""
    phi = ROLL * TIME
    rolled = roll(phi) * sp.Matrix([SX, SY])
    measured = rolled + sp.Matrix([N1, N2])
    ideal, off = deroll(phi) * measured, deroll(phi + THETA) * rolled
    e = sp.Symbol("e", real=True)
    unequal = deroll(phi) * sp.diag(1 + e / 2, 1 - e / 2) * rolled
    return Derivation(
        (
            Step(
                "(7), $s_3$: derolling inverts rolling; the noise is rotated",
                ideal[0],
                SX + (deroll(phi) * sp.Matrix([N1, N2]))[0],
            ),
            Step("(7), $s_4$", ideal[1], SY + (deroll(phi) * sp.Matrix([N1, N2]))[1]),
            Step("a phase error, $s_3$: the other drift appears", off[0], SX * sp.cos(THETA) - SY * sp.sin(THETA)),
            Step("the same, $s_4$", off[1], SX * sp.sin(THETA) + SY * sp.cos(THETA)),
            Step(
                "readouts of unequal gain, $1\\pm e/2$: the term at twice the roll frequency returns",
                unequal[0],
                SX + e / 2 * (SX * sp.cos(2 * phi) + SY * sp.sin(2 * phi)),
            ),
        )
    )


def fits() -> Derivation:
    r"""Derive least-squares drift rates due to a constant frequency error, and due to noise with and without rolling.

    The fit weights the record by :math:`c(t) = 12(t-T/2)/T^3`.
    """
    a, k, z, f, w = sp.symbols("A k z f w", positive=True)
    c = 12 * (TIME - T / 2) / T**3
    j0, j1 = sp.sin(z) / z, sp.sin(z) / z**2 - sp.cos(z) / z
    # Noise that begins with the record has the response 1/sqrt(pi t) to white noise of density pi A.
    v = sp.Symbol("v", positive=True)
    on_white = sp.Integral(12 * ((1 - v) + w - sp.Rational(1, 2)) / sp.sqrt(sp.pi * w), (w, 0, v))
    return Derivation(
        (
            Step("a fitted ramp $kt$ has the slope $k$", sp.Integral(c * k * TIME, (TIME, 0, T)), k),
            Step(
                "off-tuned by $\\Delta$, the drift across is $kt\\cdot\\Delta t$ to first order",
                sp.Integral(c * k * OFF * TIME**2, (TIME, 0, T)),
                k * OFF * T,
            ),
            Step(
                "white noise of one-sided density $A/f_r$",
                a / f / 2 * sp.Integral(c**2, (TIME, 0, T)),
                6 * a / (f * T**3),
            ),
            Step(
                "the fit's response to a frequency, $z=\\pi fT$",
                sp.Integral(c * sp.sin(2 * z / T * (TIME - T / 2)), (TIME, 0, T)),
                6 / T * j1,
            ),
            Step(
                "so $\\int j_1^2/z\\,dz = \\frac14$, from $j_0^2 + j_1^2 = 1$ at zero",
                sp.Derivative(-(j0**2 + j1**2) / 4, z),
                j1**2 / z,
            ),
            Step(
                "noise that begins with the record, with $T=1$: $8A/T^2$",
                sp.pi * a * sp.Integral(on_white.doit() ** 2, (v, 0, 1)),
                8 * a,
            ),
        )
    )


def varying_phase() -> Derivation:
    r"""Derive how much a phase error that varies counts in the drift fitted across, to first order, for T = k = 1.

    The fit weights the record by :math:`12(t-\frac12)`, and the drift across is :math:`t\,\theta(t)`.
    """
    w, n = 12 * TIME * (TIME - sp.Rational(1, 2)), sp.Symbol("n", integer=True, positive=True)
    half = sp.Rational(1, 2)
    first, second = sp.Integral(w, (TIME, 0, half)), sp.Integral(w, (TIME, half, 1))
    turn = 2 * sp.pi * n * TIME
    return Derivation(
        (
            Step("a constant error of 1", sp.Integral(w, (TIME, 0, 1)), sp.S.One),
            Step("a ramp from −1 to 1, whose mean is zero", sp.Integral(w * (2 * TIME - 1), (TIME, 0, 1)), sp.S.One),
            Step("an error of 1 in the first half alone", first, -sp.Rational(1, 4)),
            Step("in the second half alone", second, sp.Rational(5, 4)),
            Step(
                "−1, then 1: these are the signs of the weight, so no error costs more",
                together(second, -first),
                sp.Rational(3, 2),
            ),
            Step("independent errors: the square of the weight", sp.Integral(w**2, (TIME, 0, 1)), sp.Rational(24, 5)),
            Step("$n$ cycles of a cosine", sp.Integral(w * sp.cos(turn), (TIME, 0, 1)), 6 / (sp.pi * n) ** 2),
            Step("$n$ cycles of a sine", sp.Integral(w * sp.sin(turn), (TIME, 0, 1)), -3 / (sp.pi * n)),
        )
    )


def filters() -> Derivation:
    """Derive the error of a ramp after a low-pass filter of noise bandwidth B, and the smallest error."""
    b, k, n0, tau, length = sp.symbols("B k N_0 tau L", positive=True)
    s = sp.Symbol("s", positive=True)
    pole = sp.exp(-s / tau) / tau
    error = k**2 / (16 * b**2) + n0 * b
    least = sp.Symbol("B_0", positive=True)
    return Derivation(
        (
            Step("single pole: it lags by τ", sp.Integral(s * pole, (s, 0, sp.oo)), tau),
            Step("single pole: noise bandwidth", sp.Integral(pole**2, (s, 0, sp.oo)) / 2, 1 / (4 * tau)),
            Step("moving average: it lags by half its length", sp.Integral(s / length, (s, 0, length)), length / 2),
            Step("moving average: noise bandwidth", sp.Integral(1 / length**2, (s, 0, length)) / 2, 1 / (2 * length)),
            Step(
                "single pole: lag and noise against its bandwidth",
                (k * tau) ** 2 + n0 / (4 * tau),
                error.subs(b, unevaluated(1 / (4 * tau))),
            ),
            Step(
                "moving average: the same function",
                (k * length / 2) ** 2 + n0 / (2 * length),
                error.subs(b, unevaluated(1 / (2 * length))),
            ),
            Step(
                "never smaller than at $B=B_0$, where $k^2 = 8N_0B_0^3$",
                error.subs(k, sp.sqrt(8 * n0 * least**3)),
                sp.Rational(3, 2) * n0 * least,
                n0 * (b - least) ** 2 * (2 * b + least) / (2 * b**2),
            ),
            Step(
                "the least mean square error",
                sp.Rational(3, 2) * n0 * unevaluated(sp.cbrt(k**2 / (8 * n0))),
                sp.Rational(3, 4) * sp.cbrt(k * n0) ** 2,
            ),
        )
    )


def ramp_spectrum() -> Derivation:
    """Derive the transform of a ramp that is switched on, and of a record of it with length T."""
    w, k, z = sp.symbols("omega k z", positive=True)
    s = sp.Symbol("s", positive=True)
    m = sp.Symbol("m", integer=True, positive=True)
    real = sp.Integral(TIME * sp.cos(2 * z / T * TIME), (TIME, 0, T))
    imaginary = sp.Integral(TIME * sp.sin(2 * z / T * TIME), (TIME, 0, T))
    j0, j1 = sp.sin(z) / z, sp.sin(z) / z**2 - sp.cos(z) / z
    return Derivation(
        (
            Step(
                "the ramp damped by $e^{-st}$; with $s\\to i\\omega$ it is $-k/\\omega^2$",
                sp.Integral(k * TIME * sp.exp(-s * TIME), (TIME, 0, sp.oo)),
                k / s**2,
            ),
            Step("its sign at $s = i\\omega$", k / unevaluated(sp.I * w) ** 2, -k / w**2),
            Step(
                "a record of length $T$, with $z=\\omega T/2$",
                unevaluated(real) ** 2 + unevaluated(imaginary) ** 2,
                T**4 / 4 * (j0**2 + j1**2),
            ),
            Step(
                "at a whole number $m$ of cycles, $z=\\pi m$: it falls as $\\omega^{-2}$",
                (T**4 / 4 * (j0**2 + j1**2)).subs(z, unevaluated(sp.pi * m)),
                T**4 / (4 * sp.pi**2 * m**2),
            ),
        )
    )


def roll_rate() -> Derivation:
    r"""Derive the false cross drift due to a roll rate that is a random walk of intensity q, for T = 1.

    A step of the rate at time u moves the phase by t - u from then on. With resets every P, it moves it by P/2 on
    average.
    """
    u, q, k, p = sp.symbols("u q k P", positive=True)
    c = 12 * (TIME - sp.Rational(1, 2))
    free, after_reset = sp.Integral(c * TIME * (TIME - u), (TIME, u, 1)), sp.Integral(c * TIME, (TIME, u, 1))
    a, w, b = sp.symbols("a Omega beta", positive=True)
    return Derivation(
        (
            Step("effect of a step of the rate at $u$ on the fit", free, (1 - u) * (1 - u**3)),
            Step(
                "without resets",
                k**2 * q * sp.Integral(sp.expand(free.doit() ** 2), (u, 0, 1)),
                sp.Rational(383, 1260) * k**2 * q,
            ),
            Step("the same with resets, apart from a factor $P/2$", after_reset, 1 + 3 * u**2 - 4 * u**3),
            Step(
                "with resets",
                k**2 * q * p**2 / 4 * sp.Integral(sp.expand(after_reset.doit() ** 2), (u, 0, 1)),
                sp.Rational(38, 35) * k**2 * q * p**2 / 4,
            ),
            Step(
                "a sinusoidal rate: the mean of the phase over a cycle",
                w / (2 * sp.pi) * sp.Integral(a / w * (sp.sin(w * TIME + b) - sp.sin(b)), (TIME, 0, 2 * sp.pi / w)),
                -a / w * sp.sin(b),
            ),
        )
    )


def response() -> Derivation:
    r"""Derive the noise response as an integral over decays; :math:`e^{y/2} = \cot\varphi` gives Wallis's integral."""
    phi = sp.Symbol("phi", positive=True)
    half = sp.cot(phi)
    steps = [
        Step("the decay of a lag", 1 / (1 + half**2), sp.sin(phi) ** 2),
        Step(
            "the weight, $dy/(2\\cosh(y/2))$",
            sp.Derivative(2 * sp.log(half), phi) / (half + 1 / half),
            sp.Integer(-2),
        ),
    ]
    for lag in (1, 2, 3):
        integral = 2 / sp.pi * sp.Integral(sp.sin(phi) ** (2 * lag), (phi, 0, sp.pi / 2))
        steps.append(
            Step(
                f"so that lag {lag} has $\\binom{{2k}}{{k}}/4^k$",
                integral,
                sp.Rational(sp.binomial(2 * lag, lag), 4**lag),
            )
        )
    return Derivation(tuple(steps))
