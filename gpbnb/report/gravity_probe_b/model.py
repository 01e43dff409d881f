"""The Gravity Probe B study: a filter for one gyroscope, and the simulated truth of its year."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
from flint import fmpq
from numpy.typing import NDArray

from gpbnb.arithmetic.conversion import exact_fraction
from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import Simulation
from gpbnb.report.measurement import measurement_rows

#: The states of :func:`gravity_probe_b`, and their units.
STATES = (
    ("drift φ2", "mas"),
    ("drift φ3", "mas"),
    ("drift rate 2", "mas/yr"),
    ("drift rate 3", "mas/yr"),
    ("pointing α2", "mas"),
    ("pointing α3", "mas"),
    ("misalignment β2", "mas"),
    ("misalignment γ2", "mas"),
    ("readout bias", "mas"),
    ("readout scale", "10⁻³"),
)

_COLUMNS = ("phi2", "phi3", "phi2_rate", "phi3_rate", "alpha2", "alpha3", "beta2", "gamma2", "bias_z", "scale")

#: Steps of 10 s in 365 days; hung1984, ch. II, section 12, example.
YEAR = 3_153_600

#: Seed of the noise of the simulated year.
SEED = 1984

#: The truth at the start of a simulated year, with the drift rates that relativity predicts, 6606 and 39 mas/yr.
TRUTH = (30.0, -20.0, 6606.0, 39.0, 0.0, 0.0, 60.0, -80.0, 0.0, 4.0)


def gravity_probe_b(roll: str = "600", process_noise: bool = True) -> LinearModel:
    r"""A filter for one gyroscope of Gravity Probe B, with n = 10, m = 2 and a step every 10 s.

    To first order in the angles, (1) and (2) of hung1982, ch. IV, give the readings of gyro and telescope
    along the z axis of the rolling spacecraft,

    .. math:: z_r = \beta_2 + \gamma_2 + (\varphi_2 + \alpha_2)\cos\omega t + (\varphi_3 + \alpha_3)\sin\omega t,
        \qquad z_t = \beta_2 + \alpha_2\cos\omega t + \alpha_3\sin\omega t,

    with :math:`\varphi = \theta - \alpha`, (7). To z_r the model adds a bias and, for the readout's scale factor, the
    known aberration of starlight by the orbit, 5.2 arcseconds in 97.5 minutes, which calibrated it in flight. The
    reports do not give noise and time constants, which are our choice. Directions are tabulated to six decimals.

    Parameters
    ----------
    roll : period in seconds, "600" (as in the reports) or "77.5" (as flown); or another multiple of half a second.
    process_noise : whether drift, misalignments and scale perform a random walk; without it, gains decrease for ever.

    References
    ----------
    hung1982, ch. IV, eqs. (1)-(7); hung1984, ch. II, section 12, example.
    """
    half_seconds = exact_fraction(roll) * 2
    if half_seconds.denominator != 1 or half_seconds <= 20:
        raise ValueError(f"got roll = {roll!r}; needed a period in seconds above 10, a multiple of 0.5, as in '77.5'")
    # A step is 20 half seconds, an orbit 11700.
    turn, orbit = int(half_seconds), 11_700
    cycle = math.lcm(turn // math.gcd(turn, 20), orbit // 20)
    times = [20 * (k + 1) for k in range(cycle)]
    C, S = (np.array([wave(t, turn) for t in times], dtype=object) for wave in (_cosine, _sine))
    size = fmpq(26, 5)
    known = np.array([[0, size * _cosine(t, orbit), size * _sine(t, orbit)] for t in times], dtype=object)
    gyro = measurement_rows(C, S, _COLUMNS, derolled=False, theta=known)[:, 1]
    telescope = measurement_rows(C, S, _COLUMNS, signal="telescope", derolled=False)[:, 1]
    H = np.stack([gyro, telescope], axis=1)
    Phi = _diagonal("1 1 1 1 0.9 0.9 1 1 0.999 1")
    Phi[0, 2] = Phi[1, 3] = Fraction(1, YEAR)
    random_walk = "1e-8 1e-8 1e-8 1e-8 76 76 1e-6 1e-6 0.01 1e-10"
    noiseless = "0 0 0 0 76 76 0 0 0.01 0"
    return LinearModel(
        Phi=Phi,
        H=H,
        Q=_diagonal(random_walk if process_noise else noiseless),
        R=_diagonal("2500 25"),
        x0=np.array([Fraction(0)] * 10, dtype=object),
        P0=_diagonal("1e4 1e4 1e8 1e8 400 400 1e4 1e4 5 100"),
        name=f"GP-B, roll {roll} s" + ("" if process_noise else ", without process noise"),
    )


def gravity_probe_b_year(model: LinearModel) -> Simulation:
    """Return simulated measurements in whole milliarcseconds for the model of :func:`gravity_probe_b`."""
    return Simulation(model, TRUTH, seed=SEED, resolution=1.0)


def _diagonal(entries: str) -> NDArray[Any]:
    values = [Fraction(entry) for entry in entries.split()]
    matrix = np.full((len(values), len(values)), Fraction(0), dtype=object)
    for i, value in enumerate(values):
        matrix[i, i] = value
    return matrix


def _cosine(part: int, whole: int) -> fmpq:
    # The last digits of a cosine depend on the machine; six decimals do not.
    return fmpq(round(1_000_000 * math.cos(2 * math.pi * (part % whole) / whole)), 1_000_000)


def _sine(part: int, whole: int) -> fmpq:
    return fmpq(round(1_000_000 * math.sin(2 * math.pi * (part % whole) / whole)), 1_000_000)
