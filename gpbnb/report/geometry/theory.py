"""Closed forms for the effect of misalignments and small angles on the measured drift; radians and years."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.measurement import ARCSEC, YEAR, apply, deroll, rotation

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

GEODETIC = 6.6 * ARCSEC
"""Drift in the plane of the orbit, close to the prediction for Gravity Probe B; radians per year."""
MOTIONAL = 0.04 * ARCSEC
"""Drift out of the plane of the orbit; radians per year."""
ZERO: Triple = (0.0, 0.0, 0.0)

GM = 3.986004e14
"""Gravitational parameter of the Earth, m³/s²."""
LIGHT = 299792458.0
"""Speed of light, m/s."""
SUN_GM = 1.32712440e20
"""Gravitational parameter of the Sun, m³/s²."""
SUN_DISTANCE = 1.495978707e11
"""Mean distance of the Earth from the Sun, m."""
RADIUS = 6.378137e6
"""Equatorial radius of the Earth, m."""
INERTIA = 0.3307
"""Moment of inertia of the Earth about its axis, divided by its mass and the square of `RADIUS`."""
SPIN = 7.292115e-5
"""Rotation rate of the Earth, rad/s."""


def precession_rates(altitude: float, spin: float = SPIN) -> tuple[float, float]:
    r"""Return the geodetic and frame-dragging drift in a circular polar orbit, for a star on the equator; rad/yr.

    .. math:: \Omega_G = \frac32\,\frac{(GM)^{3/2}}{c^2 r^{5/2}}, \qquad \Omega_M = \frac{G I \omega}{2 c^2 r^3}

    Parameters
    ----------
    altitude : height above the equatorial radius, m; 0 or above.
    spin : rotation rate of the Earth, rad/s.

    References
    ----------
    Schiff 1960.
    """
    if not altitude >= 0:
        raise ValueError(f"got an altitude of {altitude} m; needed 0 or above")
    r = RADIUS + altitude
    geodetic = 1.5 * GM**1.5 / (LIGHT**2 * r**2.5)
    motional = GM * INERTIA * RADIUS**2 * spin / (2 * LIGHT**2 * r**3)
    return geodetic * YEAR, motional * YEAR


def aberration(altitude: float) -> tuple[float, float]:
    r"""Return the largest aberration due to the speed of the Earth and of a spacecraft on a circular orbit; radians.

    .. math:: v/c, \qquad v = \sqrt{GM/r}

    The orbit of the Earth around the Sun is taken as a circle.

    Parameters
    ----------
    altitude : height above the equatorial radius, m; 0 or above.
    """
    if not altitude >= 0:
        raise ValueError(f"got an altitude of {altitude} m; needed 0 or above")
    return math.sqrt(SUN_GM / SUN_DISTANCE) / LIGHT, math.sqrt(GM / (RADIUS + altitude)) / LIGHT


@dataclass(frozen=True)
class Misalignments:
    """Angles of an experiment that lasts one year.

    Parameters
    ----------
    alpha, beta, gamma : pointing, and misalignments of telescope and readout; radians.
    drift : rates of φ2 and φ3; radians per year. The z axis lies in the plane of the orbit, so φ2 is geodetic.
    """

    alpha: Triple = ZERO
    beta: Triple = ZERO
    gamma: Triple = ZERO
    drift: tuple[float, float] = (GEODETIC, MOTIONAL)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            needed = 2 if name == "drift" else 3
            if len(value) != needed or not all(math.isfinite(v) for v in value):
                raise ValueError(f"got {name} = {value}; needed {needed} finite numbers, in radians")

    def with_angle(self, name: str, size: float) -> Misalignments:
        """Return a copy with one angle changed, as in ``case.with_angle("gamma1", size)``."""
        which, axis = str(name)[:-1], str(name)[-1:]
        if which == "drift" or which not in vars(self) or axis not in ("1", "2", "3"):
            raise ValueError(f"got angle {name!r}; needed alpha, beta or gamma and 1, 2 or 3: 'gamma1'")
        values = list(getattr(self, which))
        values[int(axis) - 1] = size
        return replace(self, **{which: tuple(values)})


@dataclass(frozen=True)
class Effect:
    """Errors of φ2 and φ3 in radians: in the angle at the start, and in the drift over a year.

    `line` is the amplitude at the roll frequency in the derolled difference.
    """

    angle: tuple[float, float]
    drift: tuple[float, float]
    line: float


def printed_deroll(readings: ArrayLike, phase: ArrayLike) -> Floats:
    r"""Evaluate (8) and (9) as printed; returns (-α3, α2) or (-θ3, θ2), like :func:`gpbnb.report.measurement.deroll`.

    .. math:: \begin{bmatrix} \hat\alpha_3 \\ -\hat\alpha_2 \end{bmatrix} = \begin{bmatrix} C & S \\ -S & C
        \end{bmatrix} \begin{bmatrix} y_t \\ z_t \end{bmatrix}
    """
    return -deroll(readings, -np.asarray(phase, dtype=float))


def measured(case: Misalignments, years: ArrayLike = 0.0) -> Floats:
    r"""Return the errors of the measured φ2, φ3 to second order, in the mean over a roll; (..., 2), in radians.

    .. math:: \Delta\varphi_2 &= (\alpha_1 + \beta_1 + \gamma_1)\varphi_3 + \gamma_1\alpha_3 \\
        \Delta\varphi_3 &= -(\alpha_1 + \beta_1 + \gamma_1)\varphi_2 - \gamma_1\alpha_2

    The mean effect of the transverse misalignments, to first order γ2 and γ3, is zero. `years` (...) is the time since
    the start.
    """
    since = np.asarray(years, dtype=float)
    phi2, phi3 = case.drift[0] * since, case.drift[1] * since
    (alpha1, alpha2, alpha3), gamma1 = case.alpha, case.gamma[0]
    twist = alpha1 + case.beta[0] + gamma1
    second = twist * phi3 + gamma1 * alpha3
    third = -twist * phi2 - gamma1 * alpha2
    return np.stack([second, third], axis=-1)


def standing(beta: ArrayLike, gamma: ArrayLike) -> Floats:
    """Return the exact readings y, z of gyro minus telescope for the roll axis, which are fixed in the spacecraft."""
    boresight = rotation(beta)[..., 0]
    return np.asarray((apply(rotation(gamma), boresight) - boresight)[..., 1:])


def effect(case: Misalignments) -> Effect:
    """Return the errors of angle and drift to second order, from the values at the start and after a year."""
    start, end = measured(case, np.array([0.0, 1.0]))
    line = float(np.hypot(*standing(case.beta, case.gamma)))
    drift = end - start
    return Effect((float(start[0]), float(start[1])), (float(drift[0]), float(drift[1])), line)


def line_fit_leak(amplitude: float, rolls: float) -> float:
    r"""Return the drift error of a line fitted to all samples, due to an offset fixed in the spacecraft.

    .. math:: |\Delta\text{drift}| = \frac{6}{\pi N}\,\text{amplitude}

    for N whole rolls of many samples, to first order in 1/N. It vanishes if the line is fitted to means of whole rolls.

    Parameters
    ----------
    amplitude : amplitude at the roll frequency, in any unit.
    rolls : N, above 0.

    Returns
    -------
    leak : length of the vector of both drift errors, in the unit of `amplitude` per length of the record.
    """
    if not rolls > 0:
        raise ValueError(f"got {rolls} rolls; needed more than 0")
    return 6 / (rolls * math.pi) * abs(amplitude)


def twist_limit(allowed: float) -> float:
    """Return the rotation about the roll axis that moves `allowed` from one drift to the other; both in radians."""
    if not allowed > 0:
        raise ValueError(f"got allowed = {allowed}; needed an angle above 0, in radians")
    return allowed / GEODETIC
