"""Checks of sections 1 and 2: rolling, derolling, and the sources of error."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.display.tables import scientific
from gpbnb.report.ledger.agreement import hold, vanishes
from gpbnb.report.ledger.checks.rolling.material import (
    WALK,
    deviation,
    expected_squares,
    filter_study,
    noise_spectrum,
    spectra,
    stages,
    walk_errors,
)
from gpbnb.report.ledger.checks.rolling.registry import CHAPTER, CHECKS, TEN, entry
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import derivation, experiment, rotations, theory
from gpbnb.report.rolling.theory import DRIFTS, LEVEL, PERIOD, PERIOD_FLOWN

Names = dict[str, Any]


# -- cases ----------------------------------------------------------------------------------------


def fixed(value: Any) -> Any:
    """Return a signal as a function of time, with its value at the time of a case."""
    return lambda time: value


_NUMBERS = (
    ("7/5", "-2/3", "11/4", "3/7", "5/6", "2/9", "4/3"),
    ("-3", "5/2", "1/3", "-6/5", "9/7", "7/4", "3/8"),
)


@cache
def signals() -> tuple[Names, ...]:
    """Return two instants with different signals, noises and angles, and the model's results for them."""
    found = []
    for numbers in _NUMBERS:
        sx, sy, n1, n2, rate, time, theta = (sp.Rational(v) for v in numbers)
        off, phase = sp.Rational(2, 11), rate * time
        rolled = complex_pair(sx, sy, -phase)
        measured = rolled[0] + n1, rolled[1] + n2
        back = complex_pair(*measured, phase)
        carrier, demodulator = sp.cos(phase), sp.cos(phase + theta)
        s, n = sx, n1
        found.append(
            {
                "matrix": sp.Matrix,
                "t": time,
                "omega_r": rate,
                "theta": theta,
                "Deltaomega": off,
                "s": fixed(s),
                "n": fixed(n),
                "c": fixed(carrier),
                "d": fixed(demodulator),
                "s_1": fixed(s * carrier),
                "m": fixed(s * carrier + n),
                "s_x": sx,
                "s_y": sy,
                "n_1": fixed(n1),
                "n_2": fixed(n2),
                "rolled": rolled,
                "m_1": fixed(measured[0]),
                "m_2": fixed(measured[1]),
                "s_3": fixed(back[0]),
                "s_4": fixed(back[1]),
            }
        )
    return tuple(found)


def complex_pair(x: sp.Expr, y: sp.Expr, angle: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return real and imaginary part of (x + iy) e^{i angle}."""
    return x * sp.cos(angle) - y * sp.sin(angle), x * sp.sin(angle) + y * sp.cos(angle)


def low_frequency(signal: sp.Expr, offset: sp.Expr) -> sp.Expr:
    """Return the mean over the roll phase, which a filter keeps of a signal rolled and derolled with a phase offset."""
    angle = sp.Symbol("angle", real=True)
    product = sp.expand(sp.cos(angle) * sp.cos(angle + offset), trig=True)
    return sp.integrate(product, (angle, 0, 2 * sp.pi)) / (2 * sp.pi) * signal


# -- section 1: signal and noise ------------------------------------------------------------------

_SLOPES = {
    "inversely proportional to the frequency": -1,
    "independent of the frequency": 0,
    "proportional to the frequency": 1,
}


@CHECKS.add(entry("s1.phi-nn"))
def density_of_noise(printed: Statement) -> Finding:
    found, slope = noise_spectrum()
    heaviest = int(np.argmax(found.density)) == 0 == int(np.argmax(spectra().ramp.density))
    place = "near the zero frequency" if heaviest else "elsewhere"
    return compare(
        bool(abs(slope.value - _SLOPES[printed.says("density")]) < 3 * slope.error and printed.says("place") == place),
        f"the generated noise has a slope of ${slope.value:.3f}\\pm{slope.error:.3f}$ over "
        f"{slope.decades:.1f} decades; both the noise and the signal are strongest at the lowest "
        "frequency",
        note="the $1/f$ law itself is assumed; no document gives its strength",
    )


@CHECKS.add(entry("s1.hard-to-extract"))
def hard_to_extract() -> Finding:
    error = theory.drift_error_unrolled(LEVEL)
    return unverifiable(
        f"without rolling the standard error of a year's drift is $3\\sqrt{{A}}/T={error:.0f}$ mas a "
        f"year, for noise of {math.sqrt(LEVEL * PERIOD_FLOWN):.0f} mas/√Hz at a period of "
        f"{PERIOD_FLOWN} s; frame dragging is {DRIFTS[1]:.0f} mas a year, and the geodetic drift is "
        f"{DRIFTS[0]:.0f}",
        "the documents do not give the strength of the noise; the error scales with its amplitude",
    )


@CHECKS.add(entry("s1.before-noise"))
def before_noise() -> Finding:
    early, late = theory.drift_error_unrolled(LEVEL), theory.drift_error_rolled(LEVEL, PERIOD)
    return unverifiable(
        "the gain from rolling depends on this assumption: noise that rolls with the signal is "
        f"derolled with it and would leave a standard error of {early:.0f} mas a year in our example; "
        f"noise that is added to the rolled signal leaves {late:.2f}",
        "the documents do not say where in the readout the noise arises",
    )


@CHECKS.add(entry("s1.much-less"))
def much_less(printed: Statement) -> Finding:
    found = spectra()
    simulated = float(found.noise.density[0] / np.mean(found.line_noise))
    year = float(theory.flicker_density(LEVEL, 1 / YEAR) / theory.flicker_density(LEVEL, 1 / PERIOD))
    ratio = min(simulated, year)
    judged = "much less" if ratio > 100 else "much more" if ratio < 0.01 else "the same"
    return compare(
        printed.says("density") == judged,
        f"the density at one cycle a year is {year:.0f} times that at the roll frequency for a period "
        f"of {PERIOD:g} s; in the lowest band of a simulated record of {found.duration / PERIOD:.0f} "
        f"turns it is {simulated:.0f} times as large",
        note=(
            "the ratio equals the number of turns in a year, if the noise follows the $1/f$ law down to "
            "one cycle a year"
        ),
    )


@CHECKS.add(entry("s1.equivalent-modulation"))
def equivalent(printed: Statement) -> Finding:
    found = stages()
    turn = np.exp(1j * theory.roll_phase(np.arange(1200), PERIOD))
    error = [float(np.max(abs(found["rolled"] * factor - found["signal"]))) for factor in (turn, 1 / turn)]
    # Rolling moves the spectrum of the signal to the roll frequency, and derolling moves it back.
    peak = abs(np.fft.fftfreq(1200)[np.argmax(abs(np.fft.fft(found["rolled"])))] * 1200)
    moved = "modulation" if 18 <= peak <= 22 else "demodulation"
    undone = "demodulation" if error[0] < 1e-12 * np.max(abs(found["signal"])) < error[1] else "modulation"
    return compare(
        bool(printed.says("rolling") == moved and printed.says("derolling") == undone),
        "rolling is $z\\to ze^{-i\\omega_rt}$ and moves the spectrum of a record of 20 turns to "
        f"{peak:.0f} cycles; derolling moves it back, to twelve digits",
    )


@CHECKS.add(entry("eq2"))
def measured_signal(printed: Statement) -> Finding:
    agrees = all(hold(printed.links(names)) for names in signals())
    return compare(agrees, "the measured signal is the rolled signal of (1) plus the noise")


@CHECKS.add(entry("eq3"))
def eq3(printed: Statement) -> Finding:
    links = [printed.links({**names, "s_2": fixed(names["m"](0) * names["d"](0))}) for names in signals()]
    ends = all(vanishes(group[0].left - group[-1].right) for group in links)
    return compare(
        all(hold(group) for group in links),
        ("the first and the last line are equal; the middle line lacks the factor $\\cos\\omega_rt$ of the signal"),
        Verdict.MISPRINT if ends else Verdict.WRONG,
        otherwise_note="the last line, which is used later, is right",
    )


@CHECKS.add(entry("eq4"))
def eq4(printed: Statement) -> Finding:
    agrees = all(
        hold(printed.links({**names, "s_hat": low_frequency(names["s"](0), names["theta"])})) for names in signals()
    )
    return compare(
        agrees,
        "this is the mean of the signal over a turn",
        note="the equation holds for the signal; noise near $\\omega_r$ passes the same filter, as section 5 says",
    )


_ANGLES = {"θ = 0": 0, "θ = π/2": 90, "θ = π": 180}


@CHECKS.add(entry("s1.theta-0-optimum"))
def best_phase(printed: Statement) -> Finding:
    angles = range(-90, 181, 45)
    best = max(angles, key=lambda angle: low_frequency(sp.S.One, sp.pi * angle / 180))
    name = "synchronous" if best == 0 else "asynchronous"
    return compare(
        _ANGLES[printed.says("angle")] == best and printed.says("demodulation") == name,
        "$\\cos\\theta$ is largest at $\\theta=0$",
        note="the statement concerns the single signal of (1) to (4); for a pair of signals, it holds in each channel",
    )


@CHECKS.add(entry("eq5"))
def eq5(printed: Statement) -> Finding:
    agrees = all(
        hold(
            printed.links(
                {
                    **names,
                    "s_x": fixed(names["s_x"]),
                    "s_y": fixed(names["s_y"]),
                    "s_1": fixed(names["rolled"][0]),
                    "s_2": fixed(names["rolled"][1]),
                }
            )
        )
        for names in signals()
    )
    return compare(agrees, "the operation multiplies the pair, as a complex number, by $e^{-i\\omega_rt}$")


@CHECKS.add(entry("eq7"))
def eq7(printed: Statement) -> Finding:
    return compare(
        all(hold(printed.links(names)) for names in signals()),
        "the operation multiplies the measured pair, as a complex number, by $e^{i\\omega_rt}$",
        note="if the readouts have unequal gains, a term at $2\\omega_r$ remains in the signal",
    )


@cache
def recursion() -> tuple[rotations.Rotation, bool]:
    """Return a product of rounded rotations, and whether each rotation is the previous one times a fixed one."""
    n, step = sp.symbols("n delta", real=True)
    one_more = derivation.deroll(step) * derivation.deroll(n * step) - derivation.deroll((n + 1) * step)
    found = rotations.recursion(TEN, PERIOD, (60, 3600))
    return found, bool(sp.simplify(one_more) == sp.zeros(2, 2) and np.all(found.size <= found.bound))


@CHECKS.add(entry("s1.recursively-computed"))
def recursively(printed: Statement) -> Finding:
    found, recursive = recursion()
    return compare(
        recursive and printed.says("deroll") == "a recursively computed",
        "each matrix is the matrix of the previous sample times a fixed matrix; in ten digits the "
        f"error of the product is {scientific(found.size[0], 2)} after a turn of {PERIOD:g} s and "
        f"{scientific(found.size[1], 2)} after 60 turns",
        note=f"(7) itself shows no recursion and can be computed without it; the {CHAPTER} compares the two ways",
    )


@CHECKS.add(entry("eq8"))
def eq8(printed: Statement) -> Finding:
    record = experiment.derolled_record((2e6, 1e6), 0.0, PERIOD, np.random.default_rng(0), 1200)
    rates = experiment.fit_drift(record["derolled"])
    kept = "low frequency" if np.allclose(rates, (2e6, 1e6), rtol=1e-9) else "high frequency"
    band = float(np.mean(spectra().base_noise))
    agrees = all(
        hold(printed.links({**names, "s_hat_x": names["s_x"], "s_hat_y": names["s_y"]})) for names in signals()
    )
    return compare(
        bool(agrees and printed.says("kept") == kept),
        f"drifts of $2\\times10^6$ and $10^6$ mas a year are recovered as {scientific(rates[0], 7)} "
        f"and {scientific(rates[1], 7)}",
        note=(
            f"the claim holds for the signal; a noise density of {scientific(band, 2)} mas²/Hz, $S(f_r)$, "
            "remains in the band"
        ),
    )


# -- section 2: the five sources ------------------------------------------------------------------


@CHECKS.add(entry("s2.five-error-sources"))
def five_sources(printed: Statement) -> Finding:
    filters = filter_study()
    found = {
        "phase of 1°": theory.phase_error_cost(DRIFTS, math.radians(1))[1],
        "frequency, ten digits": theory.off_tuned_drift(DRIFTS[0], 5e-12),
        "noise at the roll frequency": theory.drift_error_rolled(LEVEL, PERIOD),
        "filter at its best (mas)": math.sqrt(filters.error.min()),
        "roll rate": theory.rate_walk_error(DRIFTS[0], WALK),
    }
    judged = "potential error sources" if min(map(abs, found.values())) > 0 else "harmless variations"
    return compare(
        printed.says("sources") == judged,
        "; ".join(f"{name}: {value:.3g}" for name, value in found.items()) + " (mas a year)",
        note="the $1/T$ in the third source means $1/f$; unequal gains of the readouts are a sixth source",
    )


@CHECKS.add(entry("s2.1-over-t"))
def one_over_t(printed: Statement) -> Finding:
    long, short = (float(theory.flicker_density(LEVEL, 1 / period)) for period in (PERIOD, PERIOD / 2))
    _, slope = noise_spectrum()
    falls = math.isclose(long / short, 2) and abs(slope.value + 1) < 3 * slope.error
    return compare(
        printed.says("law") == ("1/f" if falls else "1/T"),
        "halving the roll period divides the density of $1/f$ noise at the roll frequency by "
        f"{long / short:g}; noise with a $1/T$ law would double",
        Verdict.MISPRINT,
        otherwise_note="T stands for f; all other places have $1/f$",
    )


@CHECKS.add(entry("s2.error-sources-4-and-5"))
def sources_4_and_5() -> Finding:
    study = filter_study()
    expected = expected_squares(study)
    filters = float(np.max(abs(study.error - expected) / study.uncertainty))
    sizes = np.sqrt(np.mean(walk_errors() ** 2, axis=1))
    theory_sizes = [theory.rate_walk_error(DRIFTS[0], WALK, reset=reset) for reset in (None, 60000.0)]
    walks = max(abs(deviation(s, e, e / math.sqrt(400))) for s, e in zip(sizes, theory_sizes, strict=True))
    return answer(
        bool(filters < 4 and walks < 4),
        f"simulation and theory differ by at most {filters:.1f} standard errors for filters and "
        f"{walks:.1f} for a roll rate that is a random walk; for the random walk, resetting the phase "
        f"every 60000 s reduces the error by a factor of {theory_sizes[0] / theory_sizes[1]:.0f}",
        f"see the {CHAPTER}, sections on filters and on an uneven roll rate",
    )
