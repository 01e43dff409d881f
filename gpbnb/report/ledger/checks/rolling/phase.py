"""Checks of section 3: a phase between roll and deroll."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import prints_as
from gpbnb.report.ledger.agreement import hold, prints_side
from gpbnb.report.ledger.checks.rolling.registry import ALLOWED, CHECKS, ONE_DIMENSION, PRINTED, entry
from gpbnb.report.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.rolling import experiment, theory
from gpbnb.report.rolling.theory import DRIFTS, LEVEL, PERIOD


@CHECKS.add(entry("s3.no-direct-error"))
def no_direct_error(printed: Statement) -> Finding:
    cost = experiment.clean_drift_error(DRIFTS, lambda t: np.full(t.shape, math.radians(1)))
    limit = math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600
    harmless = bool(np.max(abs(cost)) < ALLOWED)
    return compare(
        printed.says("error")
        == ("does not directly introduce any error" if harmless else "directly introduces an error"),
        f"in two dimensions, a phase error of one degree turns {cost[1]:.1f} mas a year of the "
        "geodetic drift into apparent frame dragging and changes the geodetic drift by "
        f"{cost[0]:.2f}; for an error of one milliarcsecond a year, a constant error of the roll "
        f"angle must stay below {limit:.0f} arcseconds",
        otherwise_note="the claim would be true if there were one signal. The experiment has a pair, which a phase "
        "error mixes: $\\hat s_x=s_x\\cos\\theta-s_y\\sin\\theta$ and $\\hat s_y=s_y\\cos\\theta+s_x\\sin\\theta$",
        root=ONE_DIMENSION,
    )


@CHECKS.add(entry("s3.signal-to-noise"))
def signal_to_noise(printed: Statement) -> Finding:
    """Judge the ratio of each signal in its own channel, for drifts fitted over 100 turns and exact noise."""
    slope = theory.slope_weights(6000)
    phase = theory.roll_phase(np.arange(6000), PERIOD)
    angles = np.radians([0, 1, 60])
    # a channel is n_1 cos - n_2 sin, and the two noises are independent
    noise = [sum(theory.variance_of_sum(slope * f(phase + a), LEVEL) for f in (np.cos, np.sin)) for a in angles]
    own = [float(theory.rotation(angle)[0, 0]) ** 2 for angle in angles]
    kept = [part * noise[0] / variance for part, variance in zip(own, noise, strict=True)]
    pair = theory.rotation(math.radians(60)) @ np.array(DRIFTS)
    predicted = all(abs(ratio / math.cos(angle) ** 2 - 1) < 1e-3 for ratio, angle in zip(kept, angles, strict=True))
    return compare(
        bool(predicted and printed.says("ratio") == ("a reduction" if kept[2] < 1 else "an increase")),
        f"in its own channel, each of the two signals keeps a fraction {kept[1]:.4f} of the ratio at one degree and "
        f"{kept[2]:.3f} at sixty: $\\cos^2\\theta$, since the noise does not change",
        note="the part that a signal loses appears in the other channel: at sixty degrees the combined strength of "
        f"both drifts is {math.hypot(*pair) / math.hypot(*DRIFTS):.3f} times its original value",
    )


_DEGREES = {"one degrees": 1, "two degrees": 2, "five degrees": 5, "ten degrees": 10}


@CHECKS.add(entry("s3.one-degree"))
def one_degree(printed: Statement) -> Finding:
    lost = math.sin(math.radians(_DEGREES[printed.says("angle")])) ** 2
    return compare(
        lost < 0.0004,
        (f"at one degree, $1-\\cos^21°={math.sin(math.radians(1)) ** 2:.6f}$, below the value .0004 in the next line"),
    )


def four_digits(angle: sp.Expr) -> sp.Rational:
    """Return a cosine to four decimals, as in the report."""
    return sp.Rational(round(sp.N(sp.cos(angle), 30) * 10**4), 10**4)


@CHECKS.add(entry("s3.cos-5-deg"))
def cos_5(printed: Statement) -> Finding:
    agrees = hold(printed.links({"cos": four_digits, "degree": sp.pi / 180}))
    five, one = (1 - math.cos(math.radians(a)) ** 2 for a in (5, 1))
    return compare(
        agrees,
        f"$1-\\cos^25°={five:.4f}$; $1-\\cos^21°={one:.4f}$",
        Verdict.MISPRINT if one < 0.0004 < five else Verdict.WRONG,
        otherwise_note="5° stands for 1°: .9998 is the cosine of one degree",
    )


@CHECKS.add(entry("s3.9998"))
def printed_cosine(printed: Statement) -> Finding:
    (link,) = printed.links()
    cosine = math.cos(math.radians(1))
    return compare(
        printed.equates
        and prints_side(float(link.left), printed.relation(), *PRINTED)
        and prints_as(cosine, ".9998", *PRINTED),
        f"$1-.9998^2={1 - 0.9998**2:.8f}$; $\\cos1°={cosine:.6f}$",
        note=f"the unrounded cosine gives {1 - cosine**2:.4f}",
    )


@CHECKS.add(entry("s3.less-than-04"))
def less_than(printed: Statement) -> Finding:
    lost = 100 * (1 - float(theory.rotation(math.radians(1))[0, 0]) ** 2)
    limit = printed.number("limit").value
    rounded = sp.Rational(round((1 - sp.Rational(9998, 10**4) ** 2) * 10**4), 10**2)  # .0004, in percent
    return compare(
        bool(lost < limit == rounded),
        f"each signal loses {lost:.4f} % of its power in its own channel",
        note="the other channel gains this power, which is the error that section 3 leaves out",
    )


@CHECKS.add(entry("s3.synchronisation-claim"))
def synchronisation() -> Finding:
    limit = math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600
    return unverifiable(
        "one degree is not enough: an error below one milliarcsecond a year requires a constant error of the roll "
        f"angle below {limit:.0f} arcseconds",
        "the documents do not give the accuracy of the star sensor",
    )
