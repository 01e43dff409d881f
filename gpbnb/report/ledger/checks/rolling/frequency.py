"""Checks of section 4: a wrong deroll frequency."""

from __future__ import annotations

import math
from fractions import Fraction
from functools import partial
from itertools import pairwise

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import FloatFormat, prints_as
from gpbnb.report.display.tables import scientific
from gpbnb.report.ledger.agreement import hold, prints_side
from gpbnb.report.ledger.checks.rolling.process import fixed, low_frequency, signals
from gpbnb.report.ledger.checks.rolling.registry import ALLOWED, CHECKS, PRINTED, SIX, TEN, entry
from gpbnb.report.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import YEAR
from gpbnb.report.rolling import experiment, theory
from gpbnb.report.rolling.theory import DRIFTS, PERIOD


def half_unit(fmt: FloatFormat) -> Fraction:
    """Return half a unit in the last place of ω_r in rad/s; its first digit is the second decimal."""
    return Fraction(1, 10) * Fraction(1, 2) / Fraction(10) ** fmt.precision


@CHECKS.add(entry("eq10"))
def eq10(printed: Statement) -> Finding:
    agrees = True
    for names in signals():
        derolled = names["m"](0) * sp.cos((names["omega_r"] + names["Deltaomega"]) * names["t"])
        agrees = agrees and hold(printed.links({**names, "s_2": fixed(derolled)}))
    return compare(agrees, "this writes the product of the cosines as a sum")


@CHECKS.add(entry("eq11"))
def eq11(printed: Statement) -> Finding:
    agrees = all(
        hold(printed.links({**names, "s_hat": fixed(low_frequency(names["s"](0), names["Deltaomega"] * names["t"]))}))
        for names in signals()
    )
    return compare(
        agrees,
        "this is the mean of the product of the cosines over the roll phase",
        note="with a pair of signals, the other channel also gains $s\\sin\\Delta\\omega t$",
    )


@CHECKS.add(entry("s4.various-degrees"))
def various_degrees(printed: Statement) -> Finding:
    errors = {t: float(theory.worst_rate_error(PERIOD, FloatFormat(10, t))) for t in range(6, 11)}
    lost = [theory.off_tuned_loss(error) for error in errors.values()]
    ramp = 1 - float(theory.fitted_drift((1.0, 0.0), partial(np.multiply, errors[6]))[0])
    depends = all(a > b for a, b in pairwise(lost))
    return compare(
        (printed.says("effect") == "to various degrees depending on its size") == depends,
        (
            "a constant signal loses these fractions of its value in a year, with six to ten digits: "
            f"{', '.join(f'{part:.1g}' for part in lost)}"
        ),
        note="section 5 assumes that the signal is a ramp: its slope, fitted over the year, loses up to a "
        f"fraction {ramp:.2f} of its value with six digits",
    )


@CHECKS.add(entry("s4.monitored"))
def monitored() -> Finding:
    error = float(theory.worst_rate_error(PERIOD, SIX))
    free = theory.off_tuned_drift(DRIFTS[0], error)
    reset = theory.phase_error_cost((DRIFTS[0], 0.0), error * PERIOD / 2)[1]
    return unverifiable(
        "monitoring would change the sample calculations, which do not reset the phase for a year: "
        f"with a reset at every turn, six digits cause an error of {reset:.2f} mas a year "
        f"perpendicular to the geodetic drift, instead of {free:.0f}",
        (
            "the documents do not say how often and how accurately the sensor is read, nor whether its "
            "readings also reset the phase"
        ),
    )


@CHECKS.add(entry("s4.finite-wordlength"))
def finite_wordlength(printed: Statement) -> Finding:
    errors = [experiment.rounded_rate_error(PERIOD, fmt) for fmt in (SIX, TEN)]
    return compare(
        printed.says("register") == ("will cause" if all(errors) else "will not cause"),
        (
            f"for a roll period of 600 s, the rounding error of ω_r is {scientific(errors[0], 3)} rad/s "
            f"with six digits and {scientific(errors[1], 3)} rad/s with ten"
        ),
    )


# -- sample calculation 1 -------------------------------------------------------------------------


@CHECKS.add(entry("s4.sample-1-omega-r"))
def omega_r(printed: Statement) -> Finding:
    rate = theory.roll_rate(PERIOD)
    names = {"omega_r": float(rate), "T": PERIOD, "pi": math.pi}
    (link,) = printed.links(names, float)
    return compare(
        printed.equates
        and math.isclose(link.left, link.right)
        and prints_as(rate, printed.number("omega_r").literal, *PRINTED),
        f"${float(rate) * 10:.7f}\\times10^{{-1}}$",
    )


@CHECKS.add(entry("s4.sample-1-delta-omega"))
def delta_omega_1(printed: Statement) -> Finding:
    worst = half_unit(SIX)
    first, second = printed.links({"Deltaomega": worst}, Fraction)
    real = experiment.rounded_rate_error(PERIOD, SIX)
    return compare(
        printed.equates
        and first.left == first.right == second.right == second.left
        and math.isclose(worst, theory.worst_rate_error(PERIOD, SIX)),
        f"half a unit of the sixth place is {scientific(float(worst), 2)} rad/s",
        note=f"this is the worst case; the actual rounding error of ω_r is {scientific(real, 4)} rad/s",
    )


@CHECKS.add(entry("s4.sample-1-period"))
def period_1(printed: Statement) -> Finding:
    offset = float(half_unit(SIX))
    period = 2 * math.pi / offset
    (link,) = printed.links({"T_Deltaomega": period, "Deltaomega": offset, "pi": math.pi}, float)
    return compare(
        printed.equates
        and math.isclose(link.left, link.right)
        and prints_as(period, printed.number("period").literal, *PRINTED),
        f"{scientific(period, 5)} s",
    )


@CHECKS.add(entry("s4.sample-1-4-years"))
def four_years(printed: Statement) -> Finding:
    years = 2 * math.pi / float(half_unit(SIX)) / YEAR
    return compare(round(years) == printed.number("period").value, f"{years:.2f} years")


@CHECKS.add(entry("s4.sample-1-pi-2"))
def quarter_turn(printed: Statement) -> Finding:
    offset = float(half_unit(SIX))
    phase = offset * YEAR
    real = abs(experiment.rounded_rate_error(PERIOD, SIX)) * YEAR
    (link,) = printed.links({"Deltaomega": offset, "t": YEAR, "pi": math.pi}, float)
    return compare(
        abs(link.left / link.right - 1) < 0.01 and offset * 0 == float(printed.says("start")),
        f"the phase is {phase:.4f} rad, compared with $\\pi/2={math.pi / 2:.4f}$",
        note=f"this is the worst case; with the actual rounding error of ω_r, the phase is {real:.3f} rad",
    )


@CHECKS.add(entry("s4.sample-1-s-to-0"))
def s_to_zero(printed: Statement) -> Finding:
    start, end = (float(low_frequency(sp.S.One, sp.Float(float(half_unit(SIX)) * t))) for t in (0.0, YEAR))
    first, _ = printed.links({"t": 0.0, "s": lambda t: 1.0, "s_hat": lambda t: start}, float)
    _, second = printed.links({"t": YEAR, "s": lambda t: 1.0, "s_hat": lambda t: end}, float)
    return compare(
        printed.equates
        and printed.number("cosine at the start").value == 2 * start
        and math.isclose(first.left, first.right)
        and abs(second.left - second.right) < 0.01,
        f"by (11), the signal falls from {start:g} s to {end:.3f} s",
        Verdict.MISPRINT if math.isclose(start, 0.5) and abs(end) < 0.01 else Verdict.WRONG,
        otherwise_note="the factor ½ of (11) is missing; it only scales the signal",
    )


@CHECKS.add(entry("s4.sample-1-severe"))
def severe(printed: Statement) -> Finding:
    real = abs(experiment.rounded_rate_error(PERIOD, SIX))
    across = theory.off_tuned_drift(DRIFTS[0], real)
    lost = theory.off_tuned_loss(real)
    judged = "very severe" if lost > 0.01 else "negligible"
    return compare(
        printed.says("errors") == judged,
        f"with the actual rounding error of ω_r, {100 * lost:.0f} % of the signal is lost at the end of the year",
        note=f"with a pair of signals, the geodetic drift also causes an error of {across:.0f} mas a year in the "
        "perpendicular direction",
    )


# -- sample calculation 2 -------------------------------------------------------------------------


@CHECKS.add(entry("s4.sample-2-delta-omega"))
def delta_omega_2(printed: Statement) -> Finding:
    worst = half_unit(TEN)
    links = printed.links({"Deltaomega": worst}, Fraction)
    left, right = links[0].right, links[-1].right
    return compare(
        printed.equates and left == worst == right and math.isclose(worst, theory.worst_rate_error(PERIOD, TEN)),
        f"{scientific(float(worst), 2)} rad/s; the left side is {scientific(float(left), 2)}, the right side "
        f"{scientific(float(right), 2)}",
        Verdict.MISPRINT if right == worst else Verdict.WRONG,
        otherwise_note=(
            "a zero is missing in the number on the left side; the right side, which is used later, is correct"
        ),
    )


_PLAIN = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


@CHECKS.add(entry("s4.sample-2-period"))
def period_2(printed: Statement) -> Finding:
    period = 2 * math.pi / float(half_unit(TEN))
    significand, power = printed.says("period").translate(_PLAIN).split(" × 10")
    return compare(
        math.isclose(period, float(significand.replace(",", "")) * 10.0 ** int(power), rel_tol=1e-4),
        f"{scientific(period, 5)} s",
        Verdict.MISPRINT,
        otherwise_note="a comma stands where the decimal point must be",
    )


@CHECKS.add(entry("s4.sample-2-40-000-years"))
def forty_thousand(printed: Statement) -> Finding:
    years = 2 * math.pi / float(half_unit(TEN)) / YEAR
    return compare(round(years, -4) == printed.number("period").value, f"{years:.0f} years")


@CHECKS.add(entry("s4.sample-2-cosine"))
def cosine_2(printed: Statement) -> Finding:
    (link,) = printed.links({"cos": math.cos, "pi": math.pi}, float)
    (bare,) = printed.links({"cos": float, "pi": math.pi}, float)
    years = round(2 * math.pi / float(half_unit(TEN)) / YEAR, -4)
    return compare(
        printed.equates
        and math.isclose(2 * math.pi / bare.left, years)
        and prints_side(link.left, printed.relation(), *PRINTED),
        f"{math.cos(2 * math.pi / years):.11f}",
        note="the printed number is chopped to nine digits",
    )


@CHECKS.add(entry("s4.sample-2-1-234e-6"))
def percent_2(printed: Statement) -> Finding:
    value = 100 * 2 * math.sin(math.pi / 40000) ** 2
    return compare(prints_as(value, printed.number("error").literal, *PRINTED), f"{scientific(value, 5)} %")


@CHECKS.add(entry("s4.sample-2-negligible"))
def negligible(printed: Statement) -> Finding:
    worst = float(theory.worst_rate_error(PERIOD, TEN))
    real = abs(experiment.rounded_rate_error(PERIOD, TEN))
    across = [experiment.clean_drift_error((DRIFTS[0], 0.0), partial(np.multiply, e))[1] for e in (worst, real)]
    lost = theory.off_tuned_loss(worst) * DRIFTS[0]
    return compare(
        printed.says("effect") == ("negligible" if lost < ALLOWED else "not negligible"),
        f"the one signal that section 4 considers loses at most {lost:.0e} mas of a geodetic drift of {DRIFTS[0]:.0f} "
        f"mas by the end of the year, and hung1982 allows {ALLOWED} mas for a single error",
        note="it does not hold for the pair of signals: there the geodetic drift causes an error of "
        f"{across[0]:.2f} mas a year in the perpendicular direction in the worst case, and {across[1]:.2f} with the "
        "actual rounding error of ω_r",
    )


@CHECKS.add(entry("s4.conclusion"))
def conclusion(printed: Statement) -> Finding:
    across = {
        t: abs(theory.off_tuned_drift(DRIFTS[0], float(theory.worst_rate_error(PERIOD, FloatFormat(10, t)))))
        for t in range(8, 15)
    }
    enough = min((t for t, error in across.items() if error < ALLOWED), default=max(across))
    judged = "can be eliminated" if across[enough] < ALLOWED else "cannot be eliminated"
    return compare(
        printed.says("problem") == judged,
        f"even for the pair of signals, the worst case with {enough} or more digits is below {ALLOWED} mas a "
        f"year: {across[enough]:.2f}",
        note="ten digits, as in sample calculation 2, are enough for a single signal only",
    )
