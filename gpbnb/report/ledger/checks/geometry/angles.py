"""Checks of hung1982, ch. IV: claims about angles after (6), and the use of the model."""

from __future__ import annotations

import math

import numpy as np
import sympy as sp

from gpbnb.report.geometry import derivation, experiment, theory
from gpbnb.report.geometry.derivation import ALPHA, PHI
from gpbnb.report.ledger.agreement import vanishes
from gpbnb.report.ledger.checks.geometry.frames import boresight_offset
from gpbnb.report.ledger.checks.geometry.registry import CHAPTER, CHECKS, MINUTE
from gpbnb.report.ledger.finding import Finding, answer, compare
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import ARCSEC, MAS, apply, roll, rotation, spin_in_readout, star_in_telescope


@CHECKS.add("hung1982.IV.theta1-alpha1")
def first_angles(printed: Statement) -> Finding:
    _, y, z = derivation.aligned(derivation.star())
    absent = sp.diff(y, ALPHA[0]) == 0 and sp.diff(z, ALPHA[0]) == 0
    h = 1e-6
    base = np.array([0.1, 0.2, 0.3])
    columns = [
        star_in_telescope(base + step, np.zeros(3), 0.4) - star_in_telescope(base - step, np.zeros(3), 0.4)
        for step in h * np.eye(3)
    ]
    rank = int(np.linalg.matrix_rank(np.array(columns) / h, tol=1e-6))
    return compare(
        printed.says("angles") == ("cannot be determined" if absent and rank == 2 else "can be determined"),
        (
            "to first order, $\\alpha_1$ has no effect on the reading; even with exact equations, the "
            f"direction of one star determines only {rank} of the three angles"
        ),
        note="determining the third angle takes a second star, as for the roll phase; exact equations do not help",
    )


@CHECKS.add("hung1982.IV.axes-colinear")
def colinear(printed: Statement) -> Finding:
    apart = [boresight_offset(np.array([0.0, size, size])) for size in (0.0, MINUTE)]
    return compare(
        printed.says("axes") == ("colinear" if apart[0] == 0 < apart[1] else "perpendicular"),
        "$x_t$ and $x_r$ are "
        + " and ".join(
            f"{offset / ARCSEC:.0f} arcseconds apart with $\\gamma_2=\\gamma_3={size}$"
            for size, offset in zip(("0", "60''"), apart, strict=True)
        ),
        note="the axes are colinear only under the ideal condition that (3) to (7) assume",
    )


@CHECKS.add("hung1982.IV.identity-transformation")
def identity(printed: Statement) -> Finding:
    h = sp.Symbol("h")
    drift = h * sp.Matrix(PHI)
    turned = derivation.exact([h * angle for angle in ALPHA]).T * drift
    first, second = ((turned - drift).diff(h, order).subs(h, 0) for order in (1, 2))
    error = experiment.small_angle_errors("alpha1", MINUTE, (theory.GEODETIC, theory.MOTIONAL))[0]
    limit = theory.twist_limit(MAS)
    return compare(
        printed.says("matrix")
        == ("an identity matrix" if vanishes(first) and not vanishes(second) else "a matrix that is not the identity"),
        "for angles of any size $h$ between the two frames, drift angles of the size $h$ have the same components in "
        f"both, to first order in $h$; the next order matters here: an $\\alpha_1$ of 60 arcseconds turns "
        f"{error / MAS:.2f} milliarcseconds of a drift of 6.6 arcseconds a year into the perpendicular direction",
        note="the identity is right to first order, as small angles are assumed. It follows from the small angles, "
        "not from the absence of $\\alpha_1$, which is unknown rather than zero and must be known to "
        f"{limit / ARCSEC:.0f} arcseconds for an error of one milliarcsecond",
    )


@CHECKS.add("hung1982.IV.phi-frame")
def phi_frame(printed: Statement) -> Finding:
    phi, alpha = np.array([0.0, 5.0, 3.0]) * ARCSEC, np.array([0.0, -2.0, 4.0]) * ARCSEC
    turns = {"intermediate": rotation(alpha), "roll": roll(np.array([0.3]))[0] @ rotation(alpha)}
    moved = {name: float(np.abs(turn @ phi - phi).max()) for name, turn in turns.items()}
    return compare(
        moved[printed.says("frame")] < MAS,
        "for drift angles of (5, 3) and pointing angles of (−2, 4) arcseconds, the components of the drift in the "
        f"intermediate frame differ from φ by {moved['intermediate'] / MAS:.2g} milliarcseconds, and in the roll frame "
        f"by {moved['roll'] / ARCSEC:.1f} arcseconds at a roll angle of 0.3",
        note="the components of φ are the same in the intermediate and in the absolute frame, to first order; the "
        "angle between the gyro and the axis of the intermediate frame is θ, not φ",
    )


@CHECKS.add("hung1982.IV.known-misalignments")
def known(printed: Statement) -> Finding:
    left = compensated()
    return compare(
        printed.says("effect") == ("can be compensated" if left < 1e-6 * MAS else "cannot be compensated"),
        "turning the readings back through the known angles β and γ leaves no error in the drift",
        note="this holds if the telescope and the gyro both measure y and z",
    )


def compensated() -> float:
    """Return the largest error, in radians, of the spin axis after rotating back by known angles."""
    theta, beta, gamma = np.array([[0, 9.0, 4.0], [30.0, 20.0, -10.0], [-25.0, 15.0, 5.0]]) * MINUTE
    phase = np.linspace(0, 6, 11)
    read = spin_in_readout(theta, beta, gamma, phase)
    back = apply(roll(-phase) @ rotation(beta).T @ rotation(gamma).T, read)
    return float(np.abs(back - rotation(theta)[:, 0]).max())


@CHECKS.add("hung1982.IV.use-of-model")
def use_of_model() -> Finding:
    size = 20 * ARCSEC
    cases = {
        name: theory.Misalignments().with_angle(name, size) for name in ("alpha1", "beta1", "beta3", "gamma1", "gamma3")
    }
    cases["gamma1, alpha2"] = cases["gamma1"].with_angle("alpha2", size)
    holds, shown = True, []
    for name, case in cases.items():
        found, analysed = experiment.year(case, step=200.0).error, theory.effect(case, True)
        gap = float(np.hypot(*(np.array(found.drift) - analysed.drift)))
        holds = (
            holds
            and gap < THIRD_ORDER * size**2 * theory.GEODETIC
            and math.isclose(found.line, analysed.line, abs_tol=0.1 * MAS)
        )
        if name in ("beta3", "gamma1"):
            shown.append(f"{name[:-1]}{name[-1]} {np.hypot(*found.drift) / MAS:.2f}")
    first = derivation.first_order_effects().holds and derivation.second_order_effects().holds
    return answer(
        holds and first,
        "error of a year's drift, in milliarcseconds, with rolling and angles of 20 arcseconds: " + ", ".join(shown),
        f"see the {CHAPTER}: an analysis to second order agrees with a simulated year with exact rotations",
    )


THIRD_ORDER = 4.0
"""Bound of the third-order coefficients for two angles of the same size and a drift smaller than them."""
