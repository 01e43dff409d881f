"""Checks of hung1982, ch. IV: statements about frames and angles before (1)."""

from __future__ import annotations

import math

import numpy as np

from gpbnb.report.geometry import derivation, theory
from gpbnb.report.ledger.checks.geometry.registry import CHECKS, MINUTE
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.statements import Statement
from gpbnb.report.measurement import (
    ARCSEC,
    MAS,
    angles_of,
    deroll,
    roll,
    rotation,
    spin_in_readout,
    star_in_telescope,
    theta_of,
)

_COUNTS = {"four": 4, "five": 5, "six": 6, "seven": 7}


@CHECKS.add("hung1982.IV.six-frames")
def six_frames(printed: Statement) -> Finding:
    count = len(np.unique(frames_of_a_case().round(9), axis=0))
    return compare(
        count == _COUNTS[printed.says("frames")],
        f"if no angle is zero, the definitions give {count} different frames",
    )


@CHECKS.add("hung1982.IV.absolute-frame")
def absolute_frame(printed: Statement) -> Finding:
    year, orbit = theory.aberration(640e3)
    line = theory.line_fit_leak(year, 1)
    return compare(
        printed.says("frame") == ("stationary in orientation" if year + orbit < MAS else "moving with the aberration"),
        f"due to aberration, the line of sight moves by up to {year / ARCSEC:.1f} arcseconds in a "
        f"year and {orbit / ARCSEC:.1f} in an orbit at 640 km; the slope of a straight line fitted to "
        f"a year of drift angles from (7) would be wrong by up to {line / ARCSEC:.0f} arcseconds a "
        "year",
        Verdict.INCONSISTENT,
        otherwise_note="the frame cannot be stationary and also follow the line of sight. Because (1) keeps the "
        "star at (1, 0, 0), (7) gives the drift relative to the apparent direction of the star. The "
        "report does not mention aberration, which can be corrected from the known velocities",
    )


@CHECKS.add("hung1982.IV.intermediate-frame")
def intermediate_frame(printed: Statement) -> Finding:
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
        printed.says("frame") == ("stationary in orientation" if turned < 1e-9 else "turning with the roll axis"),
        "between pointings of (−2, 4) and (7, −1) arcseconds the frame turns by "
        f"{turned / ARCSEC:.1f} arcseconds; at both pointings (7) gives the drift to within "
        f"{apart / MAS:.0e} milliarcseconds",
        Verdict.MISPRINT if apart < 1e-3 * MAS else Verdict.WRONG,
        otherwise_note="the intermediate frame is stationary only while the roll axis is; equations (5) to (7) "
        "describe a single instant and do not require a stationary frame",
    )


def frames_of_a_case() -> np.ndarray:
    """Return the matrices (6, 3, 3) from the absolute frame to each frame, for distinct nonzero angles."""
    A, F = rotation([0.01, 0.02, 0.03]), rotation([0.0, 0.04, 0.05])
    R = roll(0.6) @ A
    T = rotation([0.07, 0.08, 0.09]) @ R
    return np.stack([np.eye(3), A, R, T, rotation([0.10, 0.11, 0.12]) @ T, F.T])


def gyro_to_readout(phase: float) -> np.ndarray:
    """Return the angles δ of a gyro that points along the roll axis, without misalignments; radians."""
    return angles_of(roll(phase) @ rotation([0.0, 0.0, 0.0]))


@CHECKS.add("hung1982.IV.deltas-zero")
def deltas(printed: Statement) -> Finding:
    return turning_delta(printed.says("angles"), 1e-9)


@CHECKS.add("hung1982.IV.all-small")
def all_small(printed: Statement) -> Finding:
    return turning_delta(printed.says("angles"), 0.1)


def turning_delta(said: str, limit: float) -> Finding:
    """Judge what is said of δ, without misalignment and drift, where a small angle is below a limit in radians."""
    phases = np.array([0.0, math.pi / 4, math.pi / 2])
    deltas = np.abs([gyro_to_readout(phase) for phase in phases])
    degrees = ", ".join(f"{math.degrees(angle):.0f}" for angle in deltas[:, 0])
    small = deltas.max(axis=0) < limit
    first_alone = bool(small[1:].all() and not small[0])
    meanings = {
        "zero": bool(small.all()),
        "zero except the roll angle $\\delta_1$": first_alone and bool(np.allclose(deltas[:, 0], phases)),
        "sufficiently small": bool(small.all()),
        "sufficiently small except $\\delta_1$": first_alone,
    }
    return compare(
        meanings.get(said, False),
        f"without misalignment and drift, $\\delta_1$ is {degrees} degrees after 0, an eighth and a quarter of a roll",
        Verdict.INCONSISTENT,
        otherwise_note="the readout frame rolls but the gyro frame does not, so δ contains the roll angle; no "
        "equation uses δ",
    )


@CHECKS.add("hung1982.IV.readout-normal")
def readout_normal(printed: Statement) -> Finding:
    spin = spin_in_readout(np.zeros(3), np.zeros(3), np.zeros(3), 0.3)
    to_normal, to_axis = (math.degrees(math.acos(min(spin[k], 1.0))) for k in (2, 0))
    alone = derivation.one_ring().holds
    return compare(
        to_normal < 1 if printed.says("reference") == "the readout normal zᵣ" else to_axis < 1,
        (
            f"without misalignments, the spin axis is {to_normal:.0f} degrees from the normal $z_r$ and "
            f"{to_axis:.0f} degrees from $x_r$"
        ),
        Verdict.INCONSISTENT,
        otherwise_note="equation (6) gives the offset from $x_r$. A ring with the normal $z_r$ measures only the "
        "component $z_r$, while (6) and (9) also need $y_r$, which takes a second ring"
        + (" or the mean over a roll, which gives both angles" if alone else ""),
    )


@CHECKS.add("hung1982.IV.alphas-boresight")
def boresight(printed: Statement) -> Finding:
    alpha, phi = np.array([0.0, -2.0, 4.0]) * ARCSEC, np.array([0.0, 5.0, 3.0]) * ARCSEC
    axes = {"telescope's boresight": alpha, "the gyro's spin axis": alpha + phi}  # where β, γ and δ are zero
    ideal, off = (boresight_offset(np.array([0.0, beta, 0.0])) for beta in (0.0, MINUTE))
    return compare(
        ideal == 0 and boresight_offset(axes[printed.says("axis")]) == boresight_offset(alpha),
        "in the ideal case, with $\\beta=0$, the boresight and the roll axis coincide; with $\\beta_2$ of 60 "
        f"arcseconds, they are {off / ARCSEC:.0f} arcseconds apart",
        note="by the definition of the intermediate frame, α is the deviation of the roll axis; it is the deviation "
        "of the boresight only where β is zero, which the sentence before calls the ideal case",
    )


def boresight_offset(angles: np.ndarray) -> float:
    """Return the angle between the x axes of two frames separated by these angles; radians."""
    return float(math.asin(min(1.0, np.hypot(*rotation(angles)[1:, 0]))))


@CHECKS.add("hung1982.IV.thetas-drift")
def thetas(printed: Statement) -> Finding:
    phi, alpha = np.array([0.0, 5.0, 3.0]) * ARCSEC, np.array([0.0, -2.0, 4.0]) * ARCSEC
    theta = theta_of(phi, alpha)
    meant = phi if printed.says("thetas") == "the relativistic drift angles" else phi + alpha
    return compare(
        bool(np.allclose(theta, meant, atol=MAS)),
        "for drift angles of (5, 3) and pointing angles of (−2, 4) arcseconds, θ is "
        f"({theta[1] / ARCSEC:.0f}, {theta[2] / ARCSEC:.0f}) arcseconds",
        Verdict.INCONSISTENT,
        otherwise_note=(
            "θ is the sum of the drift and pointing angles; the drift angle is $\\varphi=\\theta-\\alpha$, as (7) says"
        ),
    )
