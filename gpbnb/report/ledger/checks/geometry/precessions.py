"""Checks of hung1982, ch. I: the two precessions, and the progress that the report announces."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from gpbnb.report.geometry import derivation, theory
from gpbnb.report.ledger.checks.geometry.registry import CHAPTER, CHECKS
from gpbnb.report.ledger.finding import Finding, answer, compare
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import ARCSEC, deroll


@CHECKS.add("hung1982.I.geodetic-motional-geometry")
def two_precessions(printed: Statement) -> Finding:
    holds = derivation.precessions().holds
    return compare(
        holds and printed.says("geodetic") == "in a plane of orbit" and printed.says("motional") == "perpendicular to",
        "for a star in the plane of a polar orbit, the geodetic drift lies in this plane and the "
        "motional drift along its normal, which is perpendicular to the Earth's axis; the inner "
        "product of the two drifts is 0",
    )


@CHECKS.add("hung1982.I.larger-effect")
def larger_effect(printed: Statement) -> Finding:
    ratios = [geodetic / motional for geodetic, motional in map(theory.precession_rates, np.arange(0, 3.6e7, 2e5))]
    geodetic, motional = theory.precession_rates(640e3)
    larger = "geodetic" if min(ratios) > 1 else "motional"
    return compare(
        printed.says("larger") == larger,
        f"the drifts are {geodetic / ARCSEC:.2f} and {motional / ARCSEC:.3f} arcseconds a year at 640 "
        f"km; from the ground to 36000 km, the geodetic drift is at least {min(ratios):.0f} times the "
        "motional drift",
    )


RIGEL = math.radians(-8.2)
"""Declination of Rigel, which is not in the documents."""


@CHECKS.add("hung1982.I.approximately-parallel")
def approximately_parallel(printed: Statement) -> Finding:
    off = math.degrees(angle_to_axis(RIGEL))
    direction = "approximately parallel to" if off < 10 else "perpendicular to" if off > 80 else "oblique to"
    return compare(
        printed.says("direction") == direction,
        f"the drift of a gyro that points to Rigel makes an angle of {off:.1f} degrees with the "
        "Earth's axis, which is the declination of the star",
        note=(
            "the claim is right only if it means the plane of the orbit: the plane of a polar orbit contains the axis"
        ),
    )


def angle_to_axis(declination: float) -> float:
    """Return the angle between the Earth's axis and the geodetic drift for a star in the orbit plane; radians."""
    star = np.array([math.cos(declination), 0.0, math.sin(declination)])
    drift = np.cross([0.0, 1.0, 0.0], star)  # about the normal of the orbit
    return float(math.acos(abs(drift[2]) / np.hypot(drift[0], drift[2])))


@CHECKS.add("hung1982.I.theories-differ")
def theories_differ(printed: Statement) -> Finding:
    omega = sp.Symbol("omega", positive=True)
    ratio = geodetic_of_brans_dicke(omega)
    difference = sp.simplify(1 - ratio)
    differ = difference != 0 and sp.limit(ratio, omega, sp.oo) == 1
    return compare(
        printed.says("magnitudes") == ("vary from theory to theory" if differ else "are the same in every theory"),
        "in the Brans-Dicke theory with parameter $\\omega$ the geodetic drift is "
        f"${sp.latex(sp.factor(ratio))}$ times that of Einstein's theory: "
        f"{float(difference.subs(omega, 6)):.0%} less for $\\omega=6$, and the same in the limit of "
        "large $\\omega$",
        note="'procession' is a misprint for 'precession'",
    )


def geodetic_of_brans_dicke(omega: sp.Symbol) -> sp.Expr:
    """Return geodetic drift / drift by general relativity, (1 + 2γ)/3, where γ is the space curvature by unit mass."""
    gamma = (1 + omega) / (2 + omega)
    return sp.together((1 + 2 * gamma) / 3)


@CHECKS.add("hung1982.I.progress-report")
def progress_report() -> Finding:
    as_printed, corrected = deroll_errors()
    return answer(
        corrected < 1e-12 * ARCSEC < as_printed,
        f"over a roll, equation (8) as printed is wrong by up to {as_printed / ARCSEC:.0f} arcseconds "
        "for a pointing angle of 17 arcseconds; the corrected equation is exact",
        f"this book corrects the errors and does the announced work; for this chapter, see the {CHAPTER}",
    )


def deroll_errors() -> tuple[float, float]:
    """Return the largest error of (8) as printed and of (5) over a roll, for α of 15 and 8 arcseconds; radians."""
    phase = np.linspace(0, 2 * np.pi, 37)
    inertial = np.array([-15.0, 8.0]) * ARCSEC
    readings = deroll(np.broadcast_to(inertial, (37, 2)), -phase)
    back = (theory.printed_deroll(readings, phase), deroll(readings, phase))
    as_printed, corrected = (float(np.hypot(*(each - inertial).T).max()) for each in back)
    return as_printed, corrected


@CHECKS.add("hung1982.I.precession-in-orbit")
def precession_in_orbit(printed: Statement) -> Finding:
    rates = [math.hypot(*theory.precession_rates(altitude)) / ARCSEC for altitude in (0.0, 640e3, 3.6e7)]
    return compare(
        printed.says("gyroscope") == ("undergoes" if min(rates) > 0 else "does not undergo"),
        "Schiff's formulas give a precession of "
        f"{', '.join(f'{rate:.2g}' for rate in rates)} arcseconds a year at the ground, at 640 km and at 36000 km",
        note="they hold in the frame of the fixed stars; a gyro in empty space at rest does not precess",
    )


@CHECKS.add("hung1982.I.two-effects")
def two_effects(printed: Statement) -> Finding:
    star_in_the_plane = {sp.Symbol("epsilon", real=True): 0}
    product = next(step for step in derivation.precessions().steps if step.name.startswith("inner product"))
    apart = bool(sp.simplify(product.left.subs(star_in_the_plane)) == 0)
    tilted = sp.simplify(product.left) != 0
    return compare(
        printed.says("effects") == ("perpendicular to one another" if apart else "oblique to one another"),
        "for a star in the plane of a polar orbit the inner product of the two drifts is 0",
        note="for a star outside the plane it is not zero" if tilted else "",
    )


@CHECKS.add("hung1982.I.spin-spin")
def spin_spin(printed: Statement) -> Finding:
    turning = theory.precession_rates(640e3)
    still = theory.precession_rates(640e3, 0.0)
    lost = [
        name for name, before, after in zip(("geodetic", "motional"), turning, still, strict=True) if before != after
    ]
    gone = lost == ["motional"] and still[1] == 0
    return compare(
        printed.says("coupling")
        == ("between the gyroscope and the Earth's rotation" if gone else "between the gyroscope and the orbit"),
        f"if the Earth did not rotate, the drifts at 640 km would be {still[0] / ARCSEC:.2f} and "
        f"{still[1] / ARCSEC:.3f} arcseconds a year, instead of {turning[0] / ARCSEC:.2f} and "
        f"{turning[1] / ARCSEC:.3f}: only the motional effect depends on the Earth's rotation",
    )
