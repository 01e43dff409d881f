"""gpbnb.report.rolling.derivation: every step holds, and a wrong one would be found out."""

from __future__ import annotations

import pytest
import steps
import sympy as sp

from gpbnb.report.rolling import derivation

DERIVATIONS = steps.Derivations(
    derivation.one_dimension,
    derivation.two_dimensions,
    derivation.fits,
    derivation.varying_phase,
    derivation.filters,
    derivation.ramp_spectrum,
    derivation.roll_rate,
    derivation.response,
)

NAMES = {
    "one_dimension": {
        r"(3), the first and last lines agree; the middle line lacks $\cos\omega_rt$": (
            "s*cos(theta)/2 + s*cos(2*omega_r*t + theta)/2 + n*cos(omega_r*t + theta)"
        ),
        "(4), the mean of the signal over a turn": "s*cos(theta)/2",
        "(10), from which (11) keeps the first term": (
            "s*cos(Delta*t)/2 + s*cos((2*omega_r + Delta)*t)/2 + n*cos((omega_r + Delta)*t)"
        ),
    },
    "two_dimensions": {
        "(7), $s_3$: derolling inverts rolling; the noise is rotated": (
            "s_x + n_1*cos(omega_r*t) - n_2*sin(omega_r*t)"
        ),
        "(7), $s_4$": "s_y + n_1*sin(omega_r*t) + n_2*cos(omega_r*t)",
        "a phase error, $s_3$: the other drift appears": "s_x*cos(theta) - s_y*sin(theta)",
        "the same, $s_4$": "s_x*sin(theta) + s_y*cos(theta)",
        r"readouts of unequal gain, $1\pm e/2$: the term at twice the roll frequency returns": (
            "s_x + e/2*(s_x*cos(2*omega_r*t) + s_y*sin(2*omega_r*t))"
        ),
    },
    "fits": {
        "a fitted ramp $kt$ has the slope $k$": "k",
        r"off-tuned by $\Delta$, the drift across is $kt\cdot\Delta t$ to first order": "k*Delta*T",
        "white noise of one-sided density $A/f_r$": "6*A/(f*T**3)",
        r"the fit's response to a frequency, $z=\pi fT$": "6/T*(sin(z)/z**2 - cos(z)/z)",
        r"so $\int j_1^2/z\,dz = \frac14$, from $j_0^2 + j_1^2 = 1$ at zero": "(sin(z)/z**2 - cos(z)/z)**2/z",
        "noise that begins with the record, with $T=1$: $8A/T^2$": "8*A",
    },
    "varying_phase": {
        "a constant error of 1": "1",
        "a ramp from −1 to 1, whose mean is zero": "1",
        "an error of 1 in the first half alone": "-1/4",
        "in the second half alone": "5/4",
        "−1, then 1: these are the signs of the weight, so no error costs more": "3/2",
        "independent errors: the square of the weight": "24/5",
        "$n$ cycles of a cosine": "6/(pi*n)**2",
        "$n$ cycles of a sine": "-3/(pi*n)",
    },
    "filters": {
        "single pole: it lags by τ": "tau",
        "single pole: noise bandwidth": "1/(4*tau)",
        "moving average: it lags by half its length": "L/2",
        "moving average: noise bandwidth": "1/(2*L)",
        "single pole: lag and noise against its bandwidth": "(k*tau)**2 + N_0/(4*tau)",
        "moving average: the same function": "(k*L/2)**2 + N_0/(2*L)",
        "never smaller than at $B=B_0$, where $k^2 = 8N_0B_0^3$": "3*N_0*B_0/2",
        "the least mean square error": "3/4*(k*N_0)**(2/3)",
    },
    "ramp_spectrum": {
        r"the ramp damped by $e^{-st}$; with $s\to i\omega$ it is $-k/\omega^2$": "k/s**2",
        r"its sign at $s = i\omega$": "-k/omega**2",
        r"a record of length $T$, with $z=\omega T/2$": ("T**4/4*(sin(z)**2/z**2 + (sin(z)/z**2 - cos(z)/z)**2)"),
        r"at a whole number $m$ of cycles, $z=\pi m$: it falls as $\omega^{-2}$": "T**4/(2*pi*m)**2",
    },
    "roll_rate": {
        "effect of a step of the rate at $u$ on the fit": "(1 - u)*(1 - u**3)",
        "without resets": "383*k**2*q/1260",
        "the same with resets, apart from a factor $P/2$": "1 + 3*u**2 - 4*u**3",
        "with resets": "38*k**2*q/35*(P/2)**2",
        "a sinusoidal rate: the mean of the phase over a cycle": "-a/Omega*sin(beta)",
    },
    "response": {
        "the decay of a lag": "sin(phi)**2",
        r"the weight, $dy/(2\cosh(y/2))$": "-2",
        r"so that lag 1 has $\binom{2k}{k}/4^k$": "1/2",
        r"so that lag 2 has $\binom{2k}{k}/4^k$": "3/8",
        r"so that lag 3 has $\binom{2k}{k}/4^k$": "5/16",
    },
}
"""What each step derives, beside its name; see `steps.check_names`."""


@pytest.mark.parametrize("name", DERIVATIONS)
def test_each_step_holds_and_is_named_for_what_it_derives(name):
    steps.check_each(DERIVATIONS[name], NAMES[name])


def test_the_derivations_are_those_of_the_chapter():
    assert sum(steps.lengths(DERIVATIONS).values()) == 44


def test_the_matrices_are_inverse():
    phi = sp.Symbol("phi", real=True)
    assert sp.simplify(derivation.deroll(phi) * derivation.roll(phi)) == sp.eye(2)
    assert derivation.roll(phi) == sp.Matrix([[sp.cos(phi), sp.sin(phi)], [-sp.sin(phi), sp.cos(phi)]])
