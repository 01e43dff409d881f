r"""Derive the algebra of hung1982, ch. IV, again: exact rotations first, then small angles.

A set of three angles rotates about the axes 3, 2, 1 in this order, :math:`C = R_1 R_2 R_3`. The document does not state
its order. Where the order matters, all six are examined.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from gpbnb.report.display.derivation import Step

P = sp.Symbol("psi", real=True)
"""The roll phase ωt."""
H = sp.Symbol("h", positive=True)
ALPHA, BETA, GAMMA, DELTA, THETA, PHI = (
    sp.symbols(f"{name}_1:4", real=True) for name in ("alpha", "beta", "gamma", "delta", "theta", "varphi")
)
C, S = sp.cos(P), sp.sin(P)
SEQUENCES = tuple(itertools.permutations((1, 2, 3)))
E1 = sp.Matrix([1, 0, 0])


# -- rotations ------------------------------------------------------------------------------------


def turn(axis: int, angle: sp.Expr) -> sp.Matrix:
    """Return the matrix to a frame rotated by `angle` about `axis`, from Rodrigues' formula."""
    e = sp.zeros(3, 1)
    e[axis - 1] = 1
    cross = sp.Matrix([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
    return sp.cos(angle) * sp.eye(3) + (1 - sp.cos(angle)) * e * e.T - sp.sin(angle) * cross


def exact(angles: Sequence[sp.Expr], sequence: Sequence[int] = (3, 2, 1)) -> sp.Matrix:
    """Return the matrix to a frame rotated by three angles; the rightmost factor is the first rotation."""
    matrix = sp.eye(3)
    for axis in sequence:
        matrix = turn(axis, angles[axis - 1]) * matrix
    return matrix


def printed_small(angles: Sequence[sp.Expr]) -> sp.Matrix:
    """Return the small-angle matrix as printed in (1) to (4)."""
    a1, a2, a3 = angles
    return sp.Matrix([[1, a3, -a2], [-a3, 1, a1], [a2, -a1, 1]])


def up_to(order: int, expression: sp.Expr, small: Iterable[sp.Symbol]) -> sp.Expr:
    """Expand `expression` and keep products of at most `order` of the `small` symbols."""
    small = tuple(small)
    polynomial = expression.replace(
        lambda part: isinstance(part, sp.sin | sp.cos) and part.args[0] in small,
        lambda part: sum(part.taylor_term(k, part.args[0]) for k in range(order + 1)),
    )
    terms = sp.Poly(polynomial, *small).terms()
    kept = (factor * sp.prod(map(sp.Pow, small, powers)) for powers, factor in terms if sum(powers) <= order)
    return sp.expand(sum(kept, start=sp.Integer(0)))


# -- what is read ---------------------------------------------------------------------------------


def star() -> sp.Matrix:
    """Return the star in the telescope frame, (1), with small-angle matrices."""
    return printed_small(BETA) * turn(1, P) * printed_small(ALPHA) * E1


def spin() -> sp.Matrix:
    """Return the spin axis in the readout frame, (2), with small-angle matrices."""
    return printed_small(GAMMA) * printed_small(BETA) * turn(1, P) * printed_small(THETA) * E1


def aligned(vector: sp.Matrix) -> sp.Matrix:
    """Set the misalignments to zero: (1) becomes (3), and (2) becomes (4)."""
    return vector.subs(dict.fromkeys((*BETA, *GAMMA), 0)).applyfunc(sp.expand)


def derolled(y: sp.Expr, z: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return the left sides of (5) and (6)."""
    return C * y - S * z, S * y + C * z


# -- (8) and (9) as printed -----------------------------------------------------------------------


def mean(expression: sp.Expr) -> sp.Expr:
    """Return the mean over a roll, unevaluated."""
    return sp.Integral(expression, (P, 0, 2 * sp.pi)) / (2 * sp.pi)


def fewest_signs() -> tuple[tuple[int, ...], ...]:
    r"""Find all smallest sets of the six signs in (8) whose change turns it into a deroll.

    The signs are counted as printed: 0, 1 before :math:`\hat\alpha_3, \hat\alpha_2` on the left; 2 to 5 before the
    C, S, S, C of the matrix, row by row.
    """
    _, y, z = aligned(star())
    found: list[tuple[int, ...]] = []
    for count in range(7):
        for changed in itertools.combinations(range(6), count):
            left3, left2, c1, s1, s2, c2 = (-1 if k in changed else 1 for k in range(6))
            third = left3 * (c1 * C * y + s1 * S * z)
            second = -left2 * (-s2 * S * y + c2 * C * z)
            if all(sp.expand(e).subs(S**2, 1 - C**2).expand() == 0 for e in (third - ALPHA[2], second - ALPHA[1])):
                found.append(changed)
        if found:
            break
    return tuple(found)


# -- misalignments --------------------------------------------------------------------------------


def drift_errors(order: int) -> tuple[sp.Expr, sp.Expr]:
    """Return the errors y, z of the derolled difference up to `order`, for exact rotations, without the true drift.

    The gyro is rotated by φ (φ1 = 0) against the absolute frame, so the matrix of θ is the product of those of α and φ.
    """
    small = (*ALPHA, *BETA, *GAMMA, *PHI)
    ring, *_, s, c = sp.ring((*small, S, C), sp.QQ)  # sympy expands polynomials much faster than expressions

    def cut(vector: NDArray[Any]) -> NDArray[Any]:
        """Drop products of more than `order` small angles."""
        kept = ({k: f for k, f in entry.items() if sum(k[: len(small)]) <= order} for entry in vector)
        return np.array([ring.from_dict(terms) for terms in kept], dtype=object)

    def matrix(angles: Sequence[sp.Expr]) -> NDArray[Any]:
        entries = exact(angles).applyfunc(lambda entry: up_to(order, entry, small))
        return np.array([[ring.from_expr(entry) for entry in row] for row in entries.tolist()], dtype=object)

    A, B, G, F = map(matrix, (ALPHA, BETA, GAMMA, (sp.Integer(0), PHI[1], PHI[2])))
    roll = np.array([[1, 0, 0], [0, c, s], [0, -s, c]], dtype=object) * ring.one
    telescope = cut(B @ cut(roll @ A[:, 0]))
    readout = F[:, 0]
    for following in (A, roll, B, G):
        readout = cut(following @ readout)
    y, z = readout[1] - telescope[1], readout[2] - telescope[2]
    phi2, phi3 = map(ring.from_expr, PHI[1:])
    errors = (c * y - s * z + phi3, s * y + c * z - phi2)
    first, second = (error.rem(s**2 + c**2 - 1).as_expr() for error in errors)
    return first, second


def first_order_effects() -> tuple[Step, ...]:
    """Derive the effect of misalignments to first order: (1) and (2) with β and γ, derolled as in (5)-(7)."""
    small = (*ALPHA, *BETA, *GAMMA, *THETA)
    t, r = (vector.applyfunc(lambda e: up_to(1, e, small)) for vector in (star(), spin()))
    drift = {theta: phi + alpha for theta, phi, alpha in zip(THETA, PHI, ALPHA, strict=True)}
    y, z = (sp.expand((r[k] - t[k]).subs(drift)) for k in (1, 2))
    turned = derolled(-GAMMA[2], GAMMA[1])
    both = derolled(-BETA[2] - GAMMA[2], BETA[1] + GAMMA[1])[0]
    return (
        Step(
            "telescope, first row: β is fixed in the spacecraft, so the deroll rotates it",
            C * t[1] - S * t[2],
            -ALPHA[2] + derolled(-BETA[2], BETA[1])[0],
        ),
        Step(
            "gyro, first row: β and γ appear",
            C * r[1] - S * r[2],
            -THETA[2] + both,
        ),
        Step(
            "gyro less telescope, with $\\varphi=\\theta-\\alpha$, first row: β cancels, γ does not",
            C * y - S * z,
            -PHI[2] + turned[0],
        ),
        Step(
            "gyro less telescope, second row",
            S * y + C * z,
            PHI[1] + turned[1],
        ),
        Step("mean over a roll of the remaining γ, first row", mean(turned[0]), sp.S.Zero),
        Step("the same for the second row", mean(turned[1]), sp.S.Zero),
    )


def second_order_effects() -> tuple[Step, ...]:
    """Derive the effect of misalignments that survives the mean over a roll, to second order, with exact rotations."""
    errors = drift_errors(2)
    twist = ALPHA[0] + BETA[0] + GAMMA[0]
    rows = (("first", errors[0], PHI[1], ALPHA[1]), ("second", errors[1], PHI[2], ALPHA[2]))
    return tuple(
        Step(f"mean error of the difference, {name} row", mean(error), twist * phi + GAMMA[0] * alpha)
        for name, error, phi, alpha in rows
    )


# -- chapter I: the two precessions ---------------------------------------------------------------


def precessions() -> tuple[Step, ...]:
    r"""Derive the directions of the two drifts for a polar orbit (Figure I-1).

    The Earth rotates about z, and the orbit lies in the x-z plane. The star has the declination δ and lies at an angle
    ε from this plane. Both precessions are those of Schiff. The geodetic one is about the normal n of the orbit, the
    motional one about the mean over an orbit of :math:`3\hat r(\hat r\cdot\omega) - \omega`.
    """
    u, d, e = sp.symbols("u delta epsilon", real=True)
    w = sp.Symbol("omega_E", positive=True)
    r = sp.Matrix([sp.cos(u), 0, sp.sin(u)])
    earth, normal = sp.Matrix([0, 0, w]), sp.Matrix([0, 1, 0])
    star = sp.Matrix([sp.cos(e) * sp.cos(d), sp.sin(e), sp.cos(e) * sp.sin(d)])
    field = 3 * r * r.dot(earth) - earth
    average = [sp.Integral(sp.expand(f), (u, 0, 2 * sp.pi)) / (2 * sp.pi) for f in field]
    geodetic, motional = normal.cross(star), (earth / 2).cross(star)
    return (
        Step("mean field along the axis of the Earth", average[2], w / 2),
        Step("mean field across it, in the plane of the orbit", average[0], sp.S.Zero),
        Step(
            "inner product of the two drifts; it vanishes for a star in the plane of the orbit, $\\epsilon=0$",
            geodetic.dot(motional),
            -w * sp.sin(2 * e) * sp.sin(d) / 4,
        ),
        Step(
            "for such a star: frame dragging along the normal of the orbit",
            sp.Limit(motional.dot(normal), e, 0),
            w * sp.cos(d) / 2,
        ),
        Step("for such a star: frame dragging in the plane of the orbit", sp.Limit(motional[0], e, 0), sp.S.Zero),
    )
