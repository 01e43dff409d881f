"""A check for each ledger entry of hung1982, ch. IV, and of what ch. I says of the two precessions."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import sympy as sp

from gpbnb.display.derivation import Derivation
from gpbnb.geometry import derivation, experiment, theory
from gpbnb.geometry.derivation import ALPHA, BETA, GAMMA, THETA, up_to
from gpbnb.ledger.finding import Finding, Verdict, answer, compare, unverifiable
from gpbnb.ledger.registry import Checks
from gpbnb.measurement import (
    ARCSEC,
    MAS,
    angles_of,
    apply,
    deroll,
    roll,
    rotation,
    spin_in_readout,
    star_in_telescope,
    theta_of,
)

CHECKS = Checks()

CHAPTER = "chapter *Measurement geometry*"
MINUTE = 60 * ARCSEC


# -- ch. I ----------------------------------------------------------------------------------------


@CHECKS.add("hung1982.I.figure-i-1", "hung1982.I.geodetic-motional-geometry")
def two_precessions() -> Finding:
    return compare(
        derivation.precessions().holds,
        "for a star in the plane of a polar orbit: geodetic drift in this plane, motional drift along its normal, "
        "which is across the Earth's axis; their inner product is 0",
        note=f"the picture is lost; drawn again in the {CHAPTER}",
    )


@CHECKS.add("hung1982.I.larger-effect")
def larger_effect() -> Finding:
    ratios = [geodetic / motional for geodetic, motional in map(theory.precession_rates, np.arange(0, 3.6e7, 2e5))]
    geodetic, motional = theory.precession_rates(640e3)
    return compare(
        bool(min(ratios) > 1),
        f"{geodetic / ARCSEC:.2f} and {motional / ARCSEC:.3f} arcseconds a year at 640 km; at least "
        f"{min(ratios):.0f} times larger from the ground to 36000 km",
    )


RIGEL = math.radians(-8.2)
"""Declination of the star, which is not in the documents."""


@CHECKS.add("hung1982.I.approximately-parallel")
def approximately_parallel() -> Finding:
    off = angle_to_axis(RIGEL)
    return compare(
        off < math.radians(10),
        f"the drift of a gyro that points to Rigel makes {math.degrees(off):.1f} degrees with the Earth's axis, as "
        "much as the star is off the equator",
        note="if it is said of the plane: that of a polar orbit contains the axis",
    )


def angle_to_axis(declination: float) -> float:
    """Angle between the Earth's axis and the geodetic drift for a star in the plane of the orbit; radians."""
    star = np.array([math.cos(declination), 0.0, math.sin(declination)])
    drift = np.cross([0.0, 1.0, 0.0], star)  # about the normal of the orbit
    return float(math.acos(abs(drift[2]) / np.hypot(drift[0], drift[2])))


@CHECKS.add("hung1982.I.theories-differ")
def theories_differ() -> Finding:
    omega = sp.Symbol("omega", positive=True)
    ratio = geodetic_of_brans_dicke(omega)
    difference = sp.simplify(1 - ratio)
    return compare(
        difference != 0 and sp.limit(ratio, omega, sp.oo) == 1,
        f"in the Brans-Dicke theory the geodetic drift is ${sp.latex(sp.factor(ratio))}$ of Einstein's, with its "
        f"parameter $\\omega$: {float(difference.subs(omega, 6)):.0%} less for $\\omega=6$, and the same in the limit",
        note="procession is a slip for precession",
    )


def geodetic_of_brans_dicke(omega: sp.Symbol) -> sp.Expr:
    """Geodetic drift over that of general relativity: (1 + 2γ)/3, γ the curvature of space by unit mass."""
    gamma = (1 + omega) / (2 + omega)
    return sp.together((1 + 2 * gamma) / 3)


@CHECKS.add("hung1982.I.progress-report")
def progress_report() -> Finding:
    printed, mended = deroll_errors()
    return answer(
        mended < 1e-12 * ARCSEC < printed,
        f"over a roll (8) as printed is off by up to {printed / ARCSEC:.0f} arcseconds for a pointing of 17, corrected "
        "by none",
        f"here: errors found, and what was announced, worked out; for this chapter in the {CHAPTER}",
    )


def deroll_errors() -> tuple[float, float]:
    """Largest error of (8) as printed, and of (5), over a roll, for α of 15 and 8 arcseconds; radians."""
    phase = np.linspace(0, 2 * np.pi, 37)
    inertial = np.array([-15.0, 8.0]) * ARCSEC
    readings = deroll(np.broadcast_to(inertial, (37, 2)), -phase)
    back = (theory.printed_deroll(readings, phase), deroll(readings, phase))
    printed, mended = (float(np.hypot(*(each - inertial).T).max()) for each in back)
    return printed, mended


# -- frames ---------------------------------------------------------------------------------------


@CHECKS.add("hung1982.IV.figure-iv-1", "hung1982.IV.figure-iv-2")
def pictures() -> Finding:
    return unverifiable("drawn again from the definitions of the frames", "the picture is lost from the scan")


@CHECKS.add("hung1982.IV.six-frames")
def six_frames() -> Finding:
    count = len(np.unique(frames_of_a_case().round(9), axis=0))
    return compare(count == 6, f"with all angles nonzero the definitions give {count} different frames")


@CHECKS.add("hung1982.IV.absolute-frame")
def absolute_frame() -> Finding:
    year, orbit = theory.aberration(640e3)
    line = theory.line_fit_leak(year, 1)
    return compare(
        year + orbit < MAS,
        f"starlight is aberrated: the line of sight moves by up to {year / ARCSEC:.1f} arcseconds in a year and "
        f"{orbit / ARCSEC:.1f} in an orbit at 640 km; a straight line through a year of (7) would be off by up to "
        f"{line / ARCSEC:.0f} arcseconds a year",
        Verdict.INCONSISTENT,
        otherwise_note="it cannot stand still and follow the line of sight. (1) keeps the star at (1, 0, 0): "
        "(7) gives the drift against the apparent star, and the report does not mention aberration; from the "
        "known velocities it can be taken out",
    )


@CHECKS.add("hung1982.IV.intermediate-frame")
def intermediate_frame() -> Finding:
    phi = np.array([0.0, 5.0, 3.0]) * ARCSEC
    pointings, phases = np.array([[0.0, -2.0, 4.0], [0.0, 7.0, -1.0]]) * ARCSEC, (0.3, 2.1)
    turned = boresight_offset(pointings[1] - pointings[0])
    none = np.zeros(3)
    drifts = [
        deroll(
            (spin_in_readout(theta_of(phi, alpha), none, none, phase) - star_in_telescope(alpha, none, phase))[1:],
            phase,
        )
        for alpha, phase in zip(pointings, phases, strict=True)
    ]
    apart = float(np.abs(np.array(drifts) - [-phi[2], phi[1]]).max())
    return compare(
        turned < 1e-9,
        f"pointings of (−2, 4) and (7, −1) arcseconds turn it by {turned / ARCSEC:.1f}; at both (7) gives the drift to "
        f"{apart / MAS:.0e} milliarcseconds",
        Verdict.MISPRINT if apart < 1e-3 * MAS else Verdict.WRONG,
        otherwise_note="it stands still only as long as the roll axis does; (5) to (7) are of one instant and do not "
        "ask it to",
    )


def frames_of_a_case() -> np.ndarray:
    """Matrices (6, 3, 3) from the absolute to each frame, for angles that are all different and not zero."""
    A, F = rotation([0.01, 0.02, 0.03]), rotation([0.0, 0.04, 0.05])
    R = roll(0.6) @ A
    T = rotation([0.07, 0.08, 0.09]) @ R
    return np.stack([np.eye(3), A, R, T, rotation([0.10, 0.11, 0.12]) @ T, F.T])


def gyro_to_readout(phase: float) -> np.ndarray:
    """The angles δ of a gyro that points along the roll axis, without misalignments; radians."""
    return angles_of(roll(phase) @ rotation([0.0, 0.0, 0.0]))


@CHECKS.add("hung1982.IV.deltas-zero", "hung1982.IV.all-small")
def deltas() -> Finding:
    turned = [abs(gyro_to_readout(phase)[0]) for phase in (0.0, math.pi / 4, math.pi / 2)]
    degrees = ", ".join(f"{math.degrees(angle):.0f}" for angle in turned)
    return compare(
        bool(max(turned) < 0.1),
        f"with no misalignment and no drift $\\delta_1$ is {degrees} degrees after 0, an eighth and a quarter of a "
        "roll",
        Verdict.INCONSISTENT,
        otherwise_note="the readout frame rolls and the gyro frame does not, so that δ holds the roll; no equation "
        "uses δ",
    )


@CHECKS.add("hung1982.IV.readout-normal")
def readout_normal() -> Finding:
    spin = spin_in_readout(np.zeros(3), np.zeros(3), np.zeros(3), 0.3)
    to_normal, to_axis = (math.degrees(math.acos(min(spin[k], 1.0))) for k in (2, 0))
    alone = derivation.one_ring().holds
    return compare(
        abs(to_normal - to_axis) < 1e-9,
        f"aligned, the spin axis is {to_normal:.0f} degrees from the normal $z_r$ and {to_axis:.0f} from $x_r$",
        Verdict.INCONSISTENT,
        otherwise_note="(6) is about $x_r$. A ring with the normal $z_r$ reads the component $z_r$ alone, while (6) "
        "and (9) also need $y_r$: a second ring"
        + (", or the mean over a roll, which tells both angles" if alone else ""),
    )


@CHECKS.add("hung1982.IV.alphas-boresight")
def boresight() -> Finding:
    off = boresight_offset(np.array([0.0, MINUTE, 0.0]))
    return compare(
        off < 1e-9,
        f"with $\\beta_2$ of 60 arcseconds boresight and roll axis are {off / ARCSEC:.0f} arcseconds apart",
        Verdict.INCONSISTENT,
        otherwise_note="α belongs to the roll axis, by the definition of the intermediate frame; of the boresight only "
        "where β is zero",
    )


def boresight_offset(angles: np.ndarray) -> float:
    """Angle between the x axes of two frames that these angles separate, as boresight and roll axis; radians."""
    return float(math.asin(min(1.0, np.hypot(*rotation(angles)[1:, 0]))))


@CHECKS.add("hung1982.IV.thetas-drift")
def thetas() -> Finding:
    phi, alpha = np.array([0.0, 5.0, 3.0]) * ARCSEC, np.array([0.0, -2.0, 4.0]) * ARCSEC
    theta = theta_of(phi, alpha)
    return compare(
        bool(np.allclose(theta, phi, atol=MAS)),
        "for drift angles (5, 3) and pointing (−2, 4) arcseconds θ is "
        f"({theta[1] / ARCSEC:.0f}, {theta[2] / ARCSEC:.0f})",
        Verdict.INCONSISTENT,
        otherwise_note="θ is drift and pointing together; the drift is $\\varphi=\\theta-\\alpha$, as (7) says",
    )


# -- equations ------------------------------------------------------------------------------------


def same(printed: sp.Matrix, found: sp.Matrix) -> bool:
    """Whether two vectors are equal, entry by entry."""
    return all(sp.simplify(sp.expand(a - b)) == 0 for a, b in zip(printed, found, strict=True))


def first_order(vector: sp.Matrix) -> sp.Matrix:
    return vector.applyfunc(lambda entry: up_to(1, entry, (*ALPHA, *BETA, *GAMMA, *THETA)))


def from_exact(vector: str, misaligned: bool) -> Finding:
    """Whether a printed chain is the first order of the exact one, for every order of the three turns."""
    chain = getattr(derivation, vector)
    printed, exact = (first_order(chain(small)) for small in (True, False))
    if not misaligned:
        printed, exact = derivation.aligned(printed), derivation.aligned(exact)
    return compare(
        same(printed, exact) and derivation.orders_agree(),
        f"first order of the exact chain: $y={sp.latex(sp.expand(exact[1]))}$",
        note="for each of the six orders in which three angles can be turned; the report does not name one",
    )


@CHECKS.add("hung1982.IV.eq1")
def equation_1() -> Finding:
    return from_exact("star", True)


@CHECKS.add("hung1982.IV.eq2")
def equation_2() -> Finding:
    return from_exact("spin", True)


@CHECKS.add("hung1982.IV.eq3")
def equation_3() -> Finding:
    return from_exact("star", False)


@CHECKS.add("hung1982.IV.eq4")
def equation_4() -> Finding:
    return from_exact("spin", False)


@cache
def deroll_steps() -> Derivation:
    return derivation.deroll()


def steps_hold(name: str, text: str) -> Finding:
    steps = [step for step in deroll_steps().steps if step.name.startswith(name)]
    return compare(len(steps) == 2 and all(step.holds for step in steps), text)


@CHECKS.add("hung1982.IV.eq5")
def equation_5() -> Finding:
    return steps_hold("(5)", "both rows follow from (3)")


@CHECKS.add("hung1982.IV.eq6")
def equation_6() -> Finding:
    return steps_hold("(6)", "both rows follow from (4)")


@CHECKS.add("hung1982.IV.eq7")
def equation_7() -> Finding:
    return steps_hold("(7)", "both rows: (6) less (5)")


def printed_estimates(vector: str) -> Finding:
    """(8) and (9): whether the printed matrix undoes the roll."""
    _, y, z = derivation.aligned(getattr(derivation, vector)())
    third, second = derivation.printed_estimates(y, z)
    angles = ALPHA if vector == "star" else THETA
    agrees = all(sp.simplify(e) == 0 for e in (third - angles[2], second - angles[1]))
    signs = {", ".join("C" if k in (2, 5) else "S" if k in (3, 4) else "left side" for k in s) for s in mending()}
    name = r"\alpha" if vector == "star" else r"\theta"
    return compare(
        agrees,
        f"the right side is $[-{name}_3\\cos2\\omega t+{name}_2\\sin2\\omega t;\\ "
        f"{name}_3\\sin2\\omega t+{name}_2\\cos2\\omega t]$, with mean 0 over a roll; "
        f"the fewest signs to change: {len(mending()[0])}, before {' or '.join(sorted(signs))}",
        otherwise_note="it rolls once more where it should deroll; the inverse of (3), as in (5), is "
        f"$[-\\hat{name}_3;\\hat{name}_2]=[[C,-S],[S,C]][y;z]$",
    )


@cache
def mending() -> tuple[tuple[int, ...], ...]:
    return derivation.fewest_signs()


@CHECKS.add("hung1982.IV.eq8")
def equation_8() -> Finding:
    return printed_estimates("star")


@CHECKS.add("hung1982.IV.eq9")
def equation_9() -> Finding:
    return printed_estimates("spin")


@CHECKS.add("hung1982.IV.eq10", "hung1982.IV.eq11", "hung1982.IV.eq12")
def errors_of_estimates() -> Finding:
    a2, a3, t2, t3 = sp.symbols("a_2 a_3 t_2 t_3", real=True)  # the estimates
    gap = [
        (t - a) - (theta - alpha) - drift_error(error_of(t, theta), error_of(a, alpha))
        for t, a, theta, alpha in ((t2, a2, THETA[1], ALPHA[1]), (t3, a3, THETA[2], ALPHA[2]))
    ]
    return compare(
        all(sp.expand(each) == 0 for each in gap),
        "$\\hat\\varphi-\\varphi=(\\hat\\theta-\\theta)-(\\hat\\alpha-\\alpha)$ for both angles",
        note="definitions, good for any estimates; with those of (8) and (9) as printed the errors are as large as the "
        "angles. Of (10) and (11) the scan keeps fragments",
    )


def error_of(estimate: sp.Expr, true: sp.Expr) -> sp.Expr:
    """One row of (10) or (11), as printed."""
    return estimate - true


def drift_error(theta: sp.Expr, alpha: sp.Expr) -> sp.Expr:
    """One row of (12), as printed."""
    return theta - alpha


@CHECKS.add("hung1982.IV.deroll-matrix")
def deroll_matrix() -> Finding:
    psi = derivation.P
    matrix = sp.Matrix([[sp.cos(psi), -sp.sin(psi)], [sp.sin(psi), sp.cos(psi)]])
    product = sp.simplify(matrix * derivation.turn(1, psi)[1:, 1:])
    return compare(product == sp.eye(2), "the matrix of (7) times the roll is the identity")


# -- claims about angles --------------------------------------------------------------------------


@CHECKS.add("hung1982.IV.theta1-alpha1")
def first_angles() -> Finding:
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
        bool(absent) and rank == 2,
        f"no trace of $\\alpha_1$ to first order; exactly, the direction of one star fixes {rank} of three angles",
        note="so exact equations would not help: it takes a second star, as for the roll phase",
    )


@CHECKS.add("hung1982.IV.axes-colinear")
def colinear() -> Finding:
    apart = [boresight_offset(np.array([0.0, size, size])) for size in (0.0, MINUTE)]
    return compare(
        apart[0] == 0 < apart[1],
        "$x_t$ and $x_r$ are "
        + " and ".join(
            f"{offset / ARCSEC:.0f} arcseconds apart with $\\gamma_2=\\gamma_3={size}$"
            for size, offset in zip(("0", "60''"), apart, strict=True)
        ),
        note="so under the ideal condition that (3) to (7) rest on, and not otherwise",
    )


@CHECKS.add("hung1982.IV.identity-transformation")
def identity() -> Finding:
    block = derivation.printed_small(ALPHA)[1:, 1:]
    without = block.subs(ALPHA[0], 0) == sp.eye(2)
    error = experiment.small_angle_errors("alpha1", MINUTE, (theory.GEODETIC, theory.MOTIONAL))[0]
    limit = theory.twist_limit(MAS)
    return compare(
        without and bool(error < MAS),
        f"$\\alpha_1$ of 60 arcseconds moves {error / MAS:.2f} milliarcseconds of a year's drift of 6.6 arcseconds "
        "across",
        otherwise_note="that $\\alpha_1$ cannot be determined does not make it zero; it must be known to "
        f"{limit / ARCSEC:.0f} arcseconds for one milliarcsecond",
    )


@CHECKS.add("hung1982.IV.phi-frame")
def phi_frame() -> Finding:
    phi = np.array([0.0, 5.0, 0.0]) * ARCSEC
    against = {name: abs(theta_of(phi, np.array([0.0, a, 0.0]) * ARCSEC)[1]) for name, a in (("a", 0.0), ("i", 4.0))}
    # right-handed: a positive turn of the gyro about y carries its x axis towards -z
    stands = float(rotation(phi)[2, 0])
    return compare(
        bool(abs(against["i"] - phi[1]) < MAS and stands < 0),
        f"$\\varphi_2$ of 5 arcseconds at a pointing of 4: the gyro is turned by {against['i'] / ARCSEC:.0f} against "
        f"the intermediate frame and by {against['a'] / ARCSEC:.0f} against the absolute one, and its axis stands at "
        f"$z={'+' if stands > 0 else '-'}{abs(stands) / ARCSEC:.0f}$",
        Verdict.INCONSISTENT,
        otherwise_note="φ is the drift against the absolute frame, with the sign reversed: as (2) is set up it turns "
        "the gyro frame into the absolute one",
    )


@CHECKS.add("hung1982.IV.known-misalignments")
def known() -> Finding:
    left = compensated()
    return compare(
        left < 1e-6 * MAS,
        "the readings turned back through known β and γ leave the drift without error",
        note="for a telescope and a gyro that both give y and z",
    )


def compensated() -> float:
    """Largest error of the spin axis in the intermediate frame after turning back through known angles; radians."""
    theta, beta, gamma = np.array([[0, 9.0, 4.0], [30.0, 20.0, -10.0], [-25.0, 15.0, 5.0]]) * MINUTE
    phase = np.linspace(0, 6, 11)
    read = spin_in_readout(theta, beta, gamma, phase)
    back = apply(roll(-phase) @ rotation(beta).T @ rotation(gamma).T, read)
    return float(np.abs(back - rotation(theta)[:, 0]).max())


# -- what the report announced --------------------------------------------------------------------


@CHECKS.add("hung1982.IV.use-of-model")
def use_of_model() -> Finding:
    size = 20 * ARCSEC
    cases = {name: theory.Case().with_angle(name, size) for name in ("alpha1", "beta1", "beta3", "gamma1", "gamma3")}
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
        "error of a year's drift for 20 arcseconds, rolling, in milliarcseconds: " + ", ".join(shown),
        f"{CHAPTER}: analysis to second order, and a simulated year with exact rotations that agrees",
    )


THIRD_ORDER = 4.0
"""Bound of the third-order coefficients of a case with two angles of one size, for drift smaller than they."""
