"""Chapter IV and the precessions of ch. I of hung1982: true values of their names, and rotations of a case."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.report.display.derivation import hold
from gpbnb.report.geometry import derivation, experiment, theory
from gpbnb.report.geometry.derivation import PHI, SEQUENCES, H
from gpbnb.report.ledger.first_order import EPSILON, FirstOrder, matrix, quantity
from gpbnb.report.ledger.judge import judge, read, vanishes
from gpbnb.report.ledger.statements import Statement, statement
from gpbnb.report.measurement import (
    ARCSEC,
    MAS,
    Floats,
    angles_of,
    apply,
    deroll,
    roll,
    rotation,
    spin_in_readout,
    star_in_telescope,
    theta_of,
)

Names = Mapping[str, Any]

# -- (1) to (12) ----------------------------------------------------------------------------------

COS, SIN = Fraction(3, 5), Fraction(4, 5)
"""Of the roll angle ωt of the case."""
SIZES = {
    "alpha": (Fraction(3, 2), Fraction(-5, 3), Fraction(7, 4)),
    "beta": (Fraction(2, 7), Fraction(9, 5), Fraction(-4, 3)),
    "gamma": (Fraction(-8, 5), Fraction(5, 6), Fraction(11, 7)),
    "theta": (Fraction(6, 7), Fraction(-9, 4), Fraction(5, 2)),
}
"""Three angles of each set, in units of a small angle."""


def letters(unit: Any) -> dict[str, Any]:
    """Return the angles of the case by their printed names, and cosine and sine of the roll angle."""
    names: dict[str, Any] = {"matrix": matrix, "omega": Fraction(2), "t": Fraction(2, 7)}
    names |= {name: {Fraction(4, 7): value}.__getitem__ for name, value in (("cos", COS), ("sin", SIN))}
    return names | {f"{name}_{k}": unit * size for name, sizes in SIZES.items() for k, size in enumerate(sizes, 1)}


@cache
def turned(name: str, sequence: tuple[int, ...] = SEQUENCES[0]) -> FirstOrder:
    """Return the exact matrix of a set of angles, or of the roll angle, to first order in the small angle."""
    if name == "roll":
        return FirstOrder(_fractions(derivation.turn(1, sp.acos(sp.Rational(COS)))))
    small = derivation.exact([H * sp.Rational(size) for size in SIZES[name]], sequence)
    return FirstOrder(*(_fractions(each.subs(H, 0)) for each in (small, small.diff(H))))


def _fractions(table: sp.Matrix) -> Any:
    return np.array([list(map(Fraction, row)) for row in table.tolist()], dtype=object)


def all_axes(rows: list[list[Any]]) -> FirstOrder:
    """Return a matrix; for the first axis, printed as a column, its place and that of both others after it.

    Thus the reading of the first axis becomes that of all three, and no column of a matrix remains without effect.
    """
    if len(rows[0]) > 1:
        return matrix(rows)
    if isinstance(rows[0][0], FirstOrder):
        cells = [row[0] for row in rows]
        return FirstOrder(np.vstack([each.value for each in cells]), np.vstack([each.slope for each in cells]))
    return matrix([[rows[(i - j) % 3][0] for j in range(3)] for i in range(3)])


def chains(frame: str, *factors: str) -> list[dict[str, Any]]:
    """Return the readings of a chain of exact rotations, from left to right, for each order of the three rotations."""
    found = []
    for sequence in SEQUENCES:
        product = quantity(np.eye(3, dtype=int))
        for name in factors:
            product = product * turned(name, sequence)
        names = letters(EPSILON) | {"matrix": all_axes}
        for k, axis in enumerate("xyz"):
            names[f"{axis}_{frame}"] = FirstOrder(product.value[k : k + 1], product.slope[k : k + 1])
        found.append(names)
    return found


def ideal_chain(k: int, misalignment: Fraction) -> bool:
    """Whether an equation gives the readings without misalignments if its β and γ have a value."""
    frame, angles = ("t", "alpha") if k in (1, 3) else ("r", "theta")
    off = {f"{name}_{i}": misalignment for name in ("beta", "gamma") for i in (1, 2, 3)}
    return judge(statement(f"hung1982.IV.eq{k}"), [names | off for names in chains(frame, "roll", angles)]).holds


def reduction() -> Names:
    values = {"zero": Fraction(0), "one degree": Fraction(1, 57)}
    return {"angles": {said for said, value in values.items() if all(ideal_chain(k, value) for k in (1, 2, 3, 4))}}


@cache
def readings() -> Names:
    """Return the angles, and the readings of telescope and gyro without misalignments, in units of a small angle."""
    names = letters(1)
    for frame, angles in (("t", "alpha"), ("r", "theta")):
        slope = (turned("roll") * turned(angles)).slope[:, 0]
        names |= {f"{axis}_{frame}": slope[k] for k, axis in enumerate("xyz")}
    for k in (1, 2, 3):
        alpha, theta = names[f"alpha_{k}"], names[f"theta_{k}"]
        of_alpha, of_theta = Fraction(k, 11), Fraction(-7, k)  # errors of the estimates in (12)
        names |= {f"phi_{k}": theta - alpha, f"alpha_hat_{k}": alpha, f"theta_hat_{k}": theta}
        names |= {f"Deltaalpha_{k}": of_alpha, f"Deltatheta_{k}": of_theta}
        names[f"Deltaphi_{k}"] = (theta + of_theta) - (alpha + of_alpha) - names[f"phi_{k}"]
    return names


def estimate(printed: Statement) -> str:
    return "alpha" if printed.id.endswith("8") else "theta"


def signs_to_change() -> tuple[int, str]:
    """Return the fewest signs whose change makes (8) a deroll, and what stands behind them."""
    changes = derivation.fewest_signs()
    places = {", ".join("C" if k in (2, 5) else "S" if k in (3, 4) else "left side" for k in s) for s in changes}
    return len(changes[0]), " or ".join(sorted(places))


def undoes_the_roll() -> bool:
    """Whether the matrix in (7) turns the columns of the roll matrix into the axes."""
    seven, rolled = statement("hung1982.IV.eq7").relation(), turned("roll").value
    derolled = [
        seven.value({**readings(), "y_r": rolled[1, k], "z_r": rolled[2, k], "y_t": 0, "z_t": 0}, Fraction)
        for k in (1, 2)
    ]
    return derolled == [matrix([[1], [0]]), matrix([[0], [1]])]


# -- frames and readings of a case ----------------------------------------------------------------

MINUTE = 60 * ARCSEC
ALPHA, BETA, GAMMA, THETA = np.array([[3.0, -5.0, 7.0], [2.0, 9.0, -4.0], [-8.0, 6.0, 5.0], [4.0, -1.0, 6.0]]) * MINUTE
"""Angles of a case, in radians."""
PHASES = (0.3, 2.1)
NONE = np.zeros(3)
POINTING, DRIFT = np.array([[0.0, -2.0, 4.0], [0.0, 5.0, 3.0]]) * ARCSEC


def to_roll(phase: float) -> Floats:
    return np.asarray(roll(phase) @ rotation(ALPHA))


def to_readout(phase: float, beta: Floats = BETA, gamma: Floats = GAMMA) -> Floats:
    """Return the matrix from the intermediate frame to the readout frame."""
    return np.asarray(rotation(gamma) @ rotation(beta) @ roll(phase))


def roll_axes() -> Names:
    apart = max(float(np.abs(to_roll(phase)[0] - rotation(ALPHA)[0]).max()) for phase in PHASES)
    return {"axes": "coincide" if apart < 1e-12 else "do not coincide"}


def lined_up() -> Names:
    off = [np.abs(to_readout(0.0, *pair) - np.eye(3)).max() for pair in ((NONE, NONE), (BETA, NONE), (NONE, GAMMA))]
    return {"frames": "all lined up" if off[0] == 0 < min(off[1:]) else "not lined up"}


def body_fixed() -> Names:
    first, second = map(to_readout, PHASES)
    stays = np.abs(first @ roll(PHASES[0]).T - second @ roll(PHASES[1]).T).max()
    turned = float(np.abs(first - second).max())
    return {"frame": "rolls with the spacecraft" if stays < 1e-12 < turned else "does not roll", "turned": turned}


def projection_on_telescope() -> Names:
    """Which axis, projected on the telescope frame, gives the reading, whose size is the sine of the angle."""
    to_t, read = rotation(BETA) @ to_roll(PHASES[0]), star_in_telescope(ALPHA, BETA, PHASES[0])
    axes = {"the x axis of the absolute frame": NONE, "the x axis of the intermediate frame": ALPHA}
    angle = math.acos(float(to_t[0, 0]))
    right = math.isclose(math.sin(angle), float(np.hypot(*read[1:])), rel_tol=1e-9)
    said = {name for name, off in axes.items() if right and np.abs(to_t @ rotation(off)[0] - read).max() < 1e-12}
    return {"axis": said, "angle": angle}


def projection_on_readout() -> Names:
    read = spin_in_readout(THETA, BETA, GAMMA, PHASES[0])
    axes = {"the gyro spin axis": rotation(THETA)[:, 0], "the roll axis": np.eye(3)[0]}
    return {"axis": {name for name, x in axes.items() if np.abs(to_readout(PHASES[0]) @ x - read).max() < 1e-12}}


_ACCOUNTS = {
    "alpha": "star offset",
    "beta": "misalignments β",
    "gamma": "misalignments γ",
    "omega": "rolling",
    "theta": "gyro drift angles",
}


def sets_of_angles(number: int) -> list[str]:
    """List the letter of the angles in each matrix of an equation, from left to right."""
    found = []
    for node in ast.walk(statement(f"hung1982.IV.eq{number}").relation().tree):
        if isinstance(node, ast.List) and isinstance(node.elts[0], ast.List) and len(node.elts[0].elts) == 3:
            names = {each.id.split("_")[0] for each in ast.walk(node) if isinstance(each, ast.Name)}
            found += [(node.col_offset, name) for name in names & set(_ACCOUNTS)]
    return [name for _, name in sorted(found)]


def factors(number: int) -> Names:
    """Return what each factor of an equation accounts for, and the letters of the factors."""
    read = sets_of_angles(number)
    shown = ", ".join("$\\omega t$" if name == "omega" else f"$\\{name}$" for name in read)
    said = zip(("first", "second", "third", "fourth"), read, strict=False)
    return {"shown": shown, "number": number, **{label: _ACCOUNTS[name] for label, name in said}}


def offsets(frame: str) -> Names:
    """From which axis of a frame the derolled readings are an offset."""
    read = star_in_telescope(ALPHA, NONE, PHASES[1]) if frame == "t" else spin_in_readout(THETA, NONE, NONE, PHASES[1])
    size = float(np.hypot(*deroll(read[1:], PHASES[1])))
    angles = {axis + {"t": "ₜ", "r": "ᵣ"}[frame]: math.acos(float(x)) for axis, x in zip("xyz", read, strict=True)}
    axes = {axis for axis, angle in angles.items() if angle < 1 and math.isclose(math.sin(angle), size, rel_tol=1e-9)}
    return {"axis": axes, "size": size, "frame": frame}


def estimated_by_deroll() -> Names:
    small = 1e-6 * ALPHA
    read = star_in_telescope(small, NONE, PHASES[1])[1:]
    found = {"deroll": deroll(read, PHASES[1]), "roll": deroll(read, -PHASES[1])}
    wanted = [-small[2], small[1]]
    return {"computation": {name for name, each in found.items() if np.allclose(each, wanted, rtol=1e-6, atol=0)}}


def frames_of_a_case() -> Floats:
    """Return the matrices (6, 3, 3) from the absolute frame to each frame, for distinct nonzero angles."""
    turns = (rotation(ALPHA), roll(0.6), rotation(BETA), rotation(GAMMA))
    found = [np.eye(3)]
    for turn in turns:
        found.append(turn @ found[-1])
    return np.stack([*found, rotation([0.0, 0.04, 0.05]).T])


def six_frames() -> Names:
    count = len(np.unique(frames_of_a_case().round(9), axis=0))
    return {"frames": {4: "four", 5: "five", 6: "six", 7: "seven"}.get(count, ""), "count": count}


def absolute_frame() -> Names:
    year, orbit = theory.aberration(640e3)
    return {
        "frame": "stationary in orientation" if year + orbit < MAS else "moving with the aberration",
        "year": year / ARCSEC,
        "orbit": orbit / ARCSEC,
        "line": theory.line_fit_leak(year, 1) / ARCSEC,
    }


def boresight_offset(angles: Floats) -> float:
    """Return the angle between the x axes of two frames separated by these angles; radians."""
    return float(math.asin(min(1.0, np.hypot(*rotation(angles)[1:, 0]))))


def drift_error() -> float:
    """Return the largest error of (7) at two pointings, in milliarcseconds."""
    apart = 0.0
    for alpha, phase in zip((POINTING, np.array([0.0, 7.0, -1.0]) * ARCSEC), PHASES, strict=True):
        read = spin_in_readout(theta_of(DRIFT, alpha), NONE, NONE, phase) - star_in_telescope(alpha, NONE, phase)
        apart = max(apart, float(np.abs(deroll(read[1:], phase) - [-DRIFT[2], DRIFT[1]]).max()))
    return apart / MAS


def intermediate_frame() -> Names:
    turned = boresight_offset(np.array([0.0, 7.0, -1.0]) * ARCSEC - POINTING)
    return {
        "frame": "stationary in orientation" if turned < 1e-9 else "turning with the roll axis",
        "turned": turned / ARCSEC,
    }


def gyro_to_readout(phase: float) -> Floats:
    """Return the angles δ of a gyro that points along the roll axis, without misalignments; radians."""
    return np.asarray(angles_of(roll(phase) @ rotation(NONE)))


def deltas(ideal: bool) -> Names:
    """What is true of δ without misalignment and drift, ideally and with small angles."""
    phases = np.array([0.0, math.pi / 4, math.pi / 2])
    found = np.abs([gyro_to_readout(phase) for phase in phases])
    small = found.max(axis=0) < (1e-9 if ideal else 0.1)
    alone = bool(small[1:].all() and not small[0]) and np.allclose(found[:, 0], phases)
    said = ("zero", "zero except the roll angle $\\delta_1$")
    if not ideal:
        said = ("sufficiently small", "sufficiently small except $\\delta_1$")
    return {
        "angles": {phrase for phrase, true in zip(said, (small.all(), alone), strict=True) if true},
        "degrees": ", ".join(f"{math.degrees(angle):.0f}" for angle in found[:, 0]),
    }


def readout_normal() -> Names:
    spin = spin_in_readout(NONE, NONE, NONE, PHASES[0])
    angles = {"the readout normal zᵣ": spin[2], "the axis xᵣ": spin[0]}
    found = {name: math.degrees(math.acos(min(x, 1.0))) for name, x in angles.items()}
    return {"reference": {name for name, angle in found.items() if angle < 1}, "angles": tuple(found.values())}


def alphas_boresight() -> Names:
    """Whose offset from the star α is, where β, γ and δ are zero, and the offset with a β₂ of an arc minute."""
    ideal, off = (boresight_offset(np.array([0.0, beta, 0.0])) for beta in (0.0, MINUTE))
    axes = {"telescope's boresight": POINTING, "the gyro's spin axis": POINTING + DRIFT}
    right = {name for name, x in axes.items() if ideal == 0 and boresight_offset(x) == boresight_offset(POINTING)}
    return {"axis": right, "off": off / ARCSEC}


def thetas_drift() -> Names:
    theta = theta_of(DRIFT, POINTING)
    meanings = {
        "the relativistic drift angles": DRIFT,
        "the drift angles plus the pointing angles": DRIFT + POINTING,
    }
    return {
        "thetas": {name for name, meant in meanings.items() if np.allclose(theta, meant, atol=MAS)},
        "theta": theta / ARCSEC,
    }


def first_angles() -> Names:
    """Whether one star determines α₁, to first order and with exact equations."""
    _, y, z = derivation.aligned(derivation.star())
    absent = sp.diff(y, derivation.ALPHA[0]) == 0 == sp.diff(z, derivation.ALPHA[0])
    columns = [
        star_in_telescope(ALPHA + step, NONE, 0.4) - star_in_telescope(ALPHA - step, NONE, 0.4)
        for step in 1e-6 * np.eye(3)
    ]
    rank = int(np.linalg.matrix_rank(np.array(columns) / 1e-6, tol=1e-6))
    return {"angles": "cannot be determined" if absent and rank == 2 else "can be determined", "rank": rank}


def colinear() -> Names:
    apart = [boresight_offset(np.array([0.0, size, size])) / ARCSEC for size in (0.0, MINUTE)]
    return {"axes": "colinear" if apart[0] == 0 < apart[1] else "perpendicular", "apart": apart}


def identity() -> Names:
    """Whether drift angles have the same components in both frames to first order, and what the next order adds."""
    drift = H * sp.Matrix(PHI)
    turned = derivation.exact([H * angle for angle in derivation.ALPHA]).T * drift
    first, second = ((turned - drift).diff(H, order).subs(H, 0) for order in (1, 2))
    error = experiment.small_angle_errors("alpha1", MINUTE, (theory.GEODETIC, theory.MOTIONAL))[0]
    alike = vanishes(first) and not vanishes(second)
    return {"matrix": "an identity matrix" if alike else "a matrix that is not the identity", "error": error / MAS}


def phi_frame() -> Names:
    turns = {"intermediate": rotation(POINTING), "roll": roll(0.3) @ rotation(POINTING)}
    moved = {name: float(np.abs(turn @ DRIFT - DRIFT).max()) for name, turn in turns.items()}
    return {"frame": {name for name, size in moved.items() if size < MAS}, "moved": moved}


def compensated() -> float:
    """Return the largest error, in radians, of the spin axis after rotating back by known angles."""
    phase = np.linspace(0, 6, 11)
    back = apply(roll(-phase) @ rotation(BETA).T @ rotation(GAMMA).T, spin_in_readout(THETA, BETA, GAMMA, phase))
    return float(np.abs(back - rotation(THETA)[:, 0]).max())


# -- the use of the model -------------------------------------------------------------------------

THIRD_ORDER = 4.0
"""Bound of the third-order coefficients for two angles of the same size and a drift smaller than them."""


@cache
def year_of(name: str) -> tuple[bool, float]:
    """Whether the analysis agrees with a simulated year, and the error of the drift in milliarcseconds.

    The only angles that are not zero are those named, of 20 arcseconds.
    """
    size, case = 20 * ARCSEC, theory.Misalignments()
    for angle in name.split():
        case = case.with_angle(angle, size)
    found, analysed = experiment.year(case, step=200.0), theory.effect(case)
    gap = float(np.hypot(*(np.array(found.drift) - analysed.drift)))
    right = gap < THIRD_ORDER * size**2 * theory.GEODETIC and math.isclose(found.line, analysed.line, abs_tol=0.1 * MAS)
    return right, float(np.hypot(*found.drift)) / MAS


def model_is_right() -> bool:
    cases = ("alpha1", "beta1", "beta3", "gamma1", "gamma3", "gamma1 alpha2")
    derived = hold(derivation.first_order_effects()) and hold(derivation.second_order_effects())
    return all(year_of(case)[0] for case in cases) and derived


# -- the two precessions --------------------------------------------------------------------------

RIGEL = math.radians(-8.2)
"""Declination of Rigel, which is not in the documents."""
ALTITUDES = (0.0, 640e3, 3.6e7)


def two_precessions() -> Names:
    if not hold(derivation.precessions()):
        return {"geodetic": "", "motional": ""}
    return {"geodetic": "in a plane of orbit", "motional": "perpendicular to"}


def larger_effect() -> Names:
    ratio = min(np.divide(*theory.precession_rates(altitude)) for altitude in np.arange(0, 3.6e7, 2e5))
    geodetic, motional = np.array(theory.precession_rates(640e3)) / ARCSEC
    return {"larger": "geodetic" if ratio > 1 else "motional", "drifts": (geodetic, motional), "ratio": ratio}


def approximately_parallel() -> Names:
    """The angle between the Earth's axis and the geodetic drift, if the orbit contains the star Rigel."""
    drift = np.cross([0.0, 1.0, 0.0], [math.cos(RIGEL), 0.0, math.sin(RIGEL)])  # about the normal of the orbit
    off = math.degrees(math.acos(abs(drift[2]) / np.hypot(drift[0], drift[2])))
    said = "approximately parallel to" if off < 10 else "perpendicular to" if off > 80 else "oblique to"
    return {"direction": said, "off": off}


def geodetic_of_brans_dicke(omega: sp.Symbol) -> sp.Expr:
    """Return geodetic drift / drift by general relativity, (1 + 2γ)/3, where γ is the space curvature by unit mass."""
    return sp.together((1 + 2 * (1 + omega) / (2 + omega)) / 3)


def theories_differ() -> Names:
    omega = sp.Symbol("omega", positive=True)
    ratio = geodetic_of_brans_dicke(omega)
    differ = sp.simplify(1 - ratio) != 0 and sp.limit(ratio, omega, sp.oo) == 1
    return {
        "magnitudes": "vary from theory to theory" if differ else "are the same in every theory",
        "ratio": sp.latex(sp.factor(ratio)),
        "less": 1 - float(ratio.subs(omega, 6)),
    }


def deroll_errors() -> tuple[float, float]:
    """Return the largest error of (8) as printed and of (5) over a roll, for α of 15 and 8 arcseconds; arcseconds."""
    phase = np.linspace(0, 2 * np.pi, 37)
    inertial = np.array([-15.0, 8.0])
    readings = deroll(np.broadcast_to(inertial, (37, 2)), -phase)
    back = (theory.printed_deroll(readings, phase), deroll(readings, phase))
    as_printed, corrected = (float(np.hypot(*(each - inertial).T).max()) for each in back)
    return as_printed, corrected


def precession_in_orbit() -> Names:
    rates = [math.hypot(*theory.precession_rates(altitude)) / ARCSEC for altitude in ALTITUDES]
    return {"gyroscope": "undergoes" if min(rates) > 0 else "does not undergo", "rates": rates}


def two_effects() -> Names:
    """The inner product of the two drifts, which is zero only for a star in the plane of the orbit."""
    (product,) = (step.left for step in derivation.precessions() if step.name.startswith("inner product"))
    apart = sp.simplify(product) != 0 == sp.simplify(product.subs({sp.Symbol("epsilon", real=True): 0}))
    return {"effects": "perpendicular to one another" if apart else "oblique to one another"}


def spin_spin() -> Names:
    turning, still = (np.array(theory.precession_rates(640e3, *spin)) / ARCSEC for spin in ((), (0.0,)))
    gone = turning[0] == still[0] and turning[1] != still[1] == 0
    said = "between the gyroscope and the Earth's rotation" if gone else "between the gyroscope and the orbit"
    return {"coupling": said, "turning": turning, "still": still}


CHECKS = read(__name__, globals())
