"""Checks of section 3: a phase between roll and deroll."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import prints_as
from gpbnb.ledger.agreement import hold, prints_side
from gpbnb.ledger.checks.rolling.registry import ALLOWED, CHECKS, ONE_DIMENSION, PRINTED, entry
from gpbnb.ledger.finding import Finding, Verdict, compare, unverifiable
from gpbnb.ledger.statements import Statement
from gpbnb.rolling import experiment, theory
from gpbnb.rolling.theory import DRIFTS, LEVEL, PERIOD


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
        f"{cost[0]:.2f}; for an error of one milliarcsecond a year, the roll angle must be known to "
        f"{limit:.0f} arcseconds",
        otherwise_note=(
            "the claim is true for the signal strength in one dimension; in two dimensions a phase error "
            "mixes the drifts"
        ),
        root=ONE_DIMENSION,
    )


@CHECKS.add(entry("s3.signal-to-noise"))
def signal_to_noise(printed: Statement) -> Finding:
    """Return signal / noise of a drift fitted in one dimension over 100 turns; signal by (4), exact noise."""
    slope = theory.slope_weights(6000)
    phase = theory.roll_phase(np.arange(6000), PERIOD)
    angles = np.radians([0, 1, 60])
    noise = [theory.variance_of_sum(slope * np.cos(phase + angle), LEVEL) for angle in angles]
    kept = [float(np.cos(a) ** 2 * noise[0] / variance) for a, variance in zip(angles, noise, strict=True)]
    pair = theory.rotation(math.radians(60)) @ np.array(DRIFTS)
    predicted = abs(kept[1] - math.cos(angles[1]) ** 2) < 1e-3 and abs(kept[2] / math.cos(angles[2]) ** 2 - 1) < 0.05
    return compare(
        bool(predicted and printed.says("ratio") == ("a reduction" if kept[2] < 1 else "an increase")),
        f"in one dimension, a fraction {kept[1]:.4f} of the ratio remains at one degree and "
        f"{kept[2]:.3f} at sixty: $\\cos^2\\theta$, since the noise does not change",
        note="the claim holds in one dimension. In two dimensions nothing is lost: at sixty degrees the "
        f"combined strength of both drifts is {math.hypot(*pair) / math.hypot(*DRIFTS):.3f} times its "
        "original value; only their direction is wrong",
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
        otherwise_note="5° stands for 1°, due to the author or the scan: .9998 is the cosine of one degree",
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
    lost = 100 * math.sin(math.radians(1)) ** 2
    limit = printed.number("limit").value
    rounded = sp.Rational(round((1 - sp.Rational(9998, 10**4) ** 2) * 10**4), 10**2)  # .0004, in percent
    return compare(bool(lost < limit == rounded), f"the loss is {lost:.4f} % of the power", note="in one dimension")


@CHECKS.add(entry("s3.synchronisation-claim"))
def synchronisation() -> Finding:
    limit = math.degrees(theory.largest_phase(DRIFTS, 1.0)) * 3600
    return unverifiable(
        f"one degree is not enough: an error below one milliarcsecond a year requires {limit:.0f} arcseconds",
        "the documents do not give the accuracy of the star sensor",
    )
