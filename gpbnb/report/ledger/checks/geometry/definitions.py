"""Checks of hung1982, ch. IV: what the frames, the projections and the factors of (1) and (2) are said to be."""

from __future__ import annotations

import ast
import math

import numpy as np
import sympy as sp

from gpbnb.report.ledger.agreement import vanishes
from gpbnb.report.ledger.checks.geometry.equations import PHASE, letters
from gpbnb.report.ledger.checks.geometry.registry import CHECKS, MINUTE
from gpbnb.report.ledger.finding import Finding, compare
from gpbnb.report.ledger.statements import Statement, statement
from gpbnb.report.measurement import ARCSEC, deroll, roll, rotation, spin_in_readout, star_in_telescope

ALPHA, BETA, GAMMA, THETA = np.array([[3.0, -5.0, 7.0], [2.0, 9.0, -4.0], [-8.0, 6.0, 5.0], [4.0, -1.0, 6.0]]) * MINUTE
"""Angles of a case, in radians."""
PHASES = (0.3, 2.1)
"""Roll phases of a case, in radians."""
NONE = np.zeros(3)


# -- the frames -----------------------------------------------------------------------------------


def directions_of_x(phase: float) -> dict[str, np.ndarray]:
    """Return the x axes of the frames in the absolute frame, for a case without zero angles."""
    i = rotation(ALPHA)
    phi = roll(phase) @ i
    t = rotation(BETA) @ phi
    return {"xᵢ": i[0], "x_φ": phi[0], "xₜ": t[0], "xᵣ": (rotation(GAMMA) @ t)[0]}


@CHECKS.add("hung1982.IV.roll-axes-coincide")
def roll_axes(printed: Statement) -> Finding:
    apart = max(float(np.abs(axes["x_φ"] - axes["xᵢ"]).max()) for axes in map(directions_of_x, PHASES))
    return compare(
        printed.says("axes") == ("coincide" if apart < 1e-12 else "do not coincide"),
        f"at two roll phases the two axes {'are the same' if apart < 1e-12 else 'differ'}: a roll about an axis does "
        "not move this axis",
    )


@CHECKS.add("hung1982.IV.lined-up")
def lined_up(printed: Statement) -> Finding:
    def largest(beta: np.ndarray, gamma: np.ndarray) -> float:
        t = rotation(beta)
        return max(float(np.abs(matrix - np.eye(3)).max()) for matrix in (t, rotation(gamma) @ t))

    aligned = largest(NONE, NONE) == 0 < min(largest(BETA, NONE), largest(NONE, GAMMA))
    return compare(
        printed.says("frames") == ("all lined up" if aligned else "not lined up"),
        "with β and γ zero the matrices from the roll frame to the telescope and readout frames are the identity, "
        "and not otherwise",
    )


@CHECKS.add("hung1982.IV.body-fixed")
def body_fixed(printed: Statement) -> Finding:
    def readout(phase: float) -> np.ndarray:
        return np.asarray(rotation(GAMMA) @ rotation(BETA) @ roll(phase))

    first, second = map(readout, PHASES)
    stays = float(np.abs(first @ roll(PHASES[0]).T - second @ roll(PHASES[1]).T).max())
    turned = float(np.abs(first - second).max())
    return compare(
        printed.says("frame") == ("rolls with the spacecraft" if stays < 1e-12 < turned else "does not roll"),
        f"between two roll phases its matrix to the roll frame {'stays the same' if stays < 1e-12 else 'changes'}, "
        f"and an entry of its matrix to the intermediate frame changes by {turned:.1f}",
    )


# -- projections ----------------------------------------------------------------------------------


@CHECKS.add("hung1982.IV.projection-on-telescope")
def projection_on_telescope(printed: Statement) -> Finding:
    phase = PHASES[0]
    to_t = rotation(BETA) @ roll(phase) @ rotation(ALPHA)
    read = star_in_telescope(ALPHA, BETA, phase)
    wanted = {
        "the x axis of the absolute frame": np.eye(3)[0],
        "the x axis of the intermediate frame": rotation(ALPHA)[0],
    }
    projected = to_t @ wanted[printed.says("axis")]
    angle = math.acos(float(to_t[0] @ np.eye(3)[0]))
    across = float(np.hypot(*read[1:]))
    return compare(
        bool(np.abs(projected - read).max() < 1e-12 and math.isclose(math.sin(angle), across, rel_tol=1e-9)),
        f"(1) without approximation is this projection; the line of sight and the boresight are {angle / ARCSEC:.1f} "
        f"arcseconds apart, and $\\sqrt{{y_t^2+z_t^2}}$ is the sine of this angle",
        note="the angle alone is one number; a telescope with two axes reads both $y_t$ and $z_t$",
    )


@CHECKS.add("hung1982.IV.projection-on-readout")
def projection_on_readout(printed: Statement) -> Finding:
    phase = PHASES[0]
    to_r = rotation(GAMMA) @ rotation(BETA) @ roll(phase)
    spin = rotation(THETA)[:, 0]  # the x axis of the gyro in the intermediate frame
    read = spin_in_readout(THETA, BETA, GAMMA, phase)
    wanted = {"the gyro spin axis": spin, "the roll axis": np.eye(3)[0]}
    projected = to_r @ wanted[printed.says("axis")]
    return compare(
        bool(np.abs(projected - read).max() < 1e-12),
        "(2) without approximation is this projection",
        note="one ring with the normal $z_r$ measures only the component along $z_r$",
    )


# -- the factors of (1) and (2) -------------------------------------------------------------------

_LETTERS = {
    "star offset": "alpha",
    "misalignments β": "beta",
    "misalignments γ": "gamma",
    "rolling": "omega",
    "gyro drift angles": "theta",
}


def sets_of_angles(printed: Statement) -> list[str]:
    """List the letter of the angles in each matrix of a printed chain, from left to right."""
    found = []
    for node in ast.walk(printed.relation().tree):
        if isinstance(node, ast.List) and isinstance(node.elts[0], ast.List) and len(node.elts[0].elts) == 3:
            names = {each.id.split("_")[0] for each in ast.walk(node) if isinstance(each, ast.Name)} - {
                "cos",
                "sin",
                "t",
            }
            found.append((node.col_offset, "".join(sorted(names))))
    return [name for _, name in sorted(found)]


@CHECKS.add("hung1982.IV.factors-of-1", "hung1982.IV.factors-of-2")
def factors(printed: Statement) -> Finding:
    number = printed.id[-1]
    read = sets_of_angles(statement(f"hung1982.IV.eq{number}"))
    labels = ("first", "second", "third", "fourth")[: len(read)]
    said = [_LETTERS[printed.says(label)] for label in labels]
    shown = ", ".join("$\\omega t$" if name == "omega" else f"$\\{name}$" for name in read)
    return compare(
        said == read,
        f"the matrices of ({number}) contain {shown}, from left to right",
        note="the first factor applied is the rightmost; each label names the frame to which its factor leads",
    )


# -- reduction and solution -----------------------------------------------------------------------


@CHECKS.add("hung1982.IV.reduction")
def reduction(printed: Statement) -> Finding:
    value = {"zero": sp.S.Zero, "one degree": sp.pi / 180}[printed.says("angles")]
    names = letters(sp.Rational(1, 1000))
    names |= {name: value for name in names if name.startswith(("beta", "gamma"))}
    pairs = [[statement(f"hung1982.IV.eq{k}").relation().value(names) for k in pair] for pair in ((1, 3), (2, 4))]
    return compare(
        all(vanishes(general - ideal) for general, ideal in pairs),
        "the printed equations (1) and (2) become (3) and (4) if β and γ are zero, for the angles of a case",
    )


@CHECKS.add("hung1982.IV.label-of-5", "hung1982.IV.label-of-6")
def offsets(printed: Statement) -> Finding:
    star = printed.id.endswith("5")
    frame = "t" if star else "r"
    phase = PHASES[1]
    read = star_in_telescope(ALPHA, NONE, phase) if star else spin_in_readout(THETA, NONE, NONE, phase)
    angle = math.acos(float(read["xyz".index(printed.says("axis")[0])]))
    derolled = float(np.hypot(*deroll(read[1:], phase)))
    return compare(
        math.isclose(math.sin(angle), derolled, rel_tol=1e-9) and angle < 1,
        f"the two derolled readings of a case have the size {derolled / ARCSEC:.1f} arcseconds, which is the sine of "
        f"the angle from $x_{frame}$",
        note="to first order, and without misalignments",
    )


@CHECKS.add("hung1982.IV.estimated-by-deroll")
def estimated_by_deroll(printed: Statement) -> Finding:
    phase = float(PHASE)
    small = 1e-6 * ALPHA
    read = star_in_telescope(small, NONE, phase)[1:]
    kept = {"deroll": deroll(read, phase), "roll": deroll(read, -phase)}
    right = [name for name, each in kept.items() if np.allclose(each, [-small[2], small[1]], rtol=1e-6, atol=0)]
    return compare(
        right == [printed.says("computation")],
        "the deroll matrix of (5) and (7) turns the readings of a case into $[-\\alpha_3;\\alpha_2]$, the roll matrix "
        "does not",
        note="(8) and (9), which should show this computation, have the roll matrix",
    )
