"""Example problems from other fields, which the chapters share."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.derivatives import jacobian
from gpbnb.arithmetic.named import BFLOAT16, BINARY16, BINARY32, BINARY64, TF32
from gpbnb.arithmetic.rational import exact
from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import Simulation

#: The states of :func:`tilt`, and their units.
TILT_STATES = (("tilt", "°"), ("rate", "°/s"), ("gyro bias", "°/s"))

#: Smallest and largest powers of two among the normal numbers of each format, by its name.
NORMAL_RANGE = {
    name: cast(tuple[int, int], (fmt.emin, fmt.emax))
    for name, fmt in {
        "binary16": BINARY16,
        "binary32": BINARY32,
        "binary64": BINARY64,
        "bfloat16": BFLOAT16,
        "TF32": TF32,
    }.items()
}


def tilt(bias_walk: str = "1e-10") -> LinearModel:
    """A tilt filter for a balancing robot or a camera, with 100 steps a second, n = 3 and m = 2.

    It combines a gyroscope, which measures rate plus bias with a noise of 0.05 °/s rms, and an accelerometer, which
    measures the tilt with a noise of 2° rms.

    Parameters
    ----------
    bias_walk : variance of the change of the bias in one step, (°/s)².
    """
    return LinearModel(
        Phi=exact([["1", "0.01", "0"], ["0", "0.98", "0"], ["0", "0", "1"]]),
        H=exact([["0", "1", "1"], ["1", "0", "0"]]),
        Q=exact([["0", "0", "0"], ["0", "4", "0"], ["0", "0", bias_walk]]),
        R=exact([["0.0025", "0"], ["0", "4"]]),
        x0=exact(["0", "0", "0"]),
        P0=exact([["100", "0", "0"], ["0", "400", "0"], ["0", "0", "1"]]),
        name="tilt filter",
    )


def tilt_measurements(steps: int, seed: int = 0) -> NDArray[np.float64]:
    """Simulate measurements (steps, 2), multiples of 1/4096, for a tilt filter that starts 3° and 0.5 °/s off."""
    return Simulation(tilt(), (3.0, -5.0, 0.5), seed, resolution=2.0**-12).measurements(steps)


def altimeter(more: str = "0") -> LinearModel:
    """An altimeter for height (m), speed (m/s) and accelerometer bias (m/s²), with 50 steps a second, n = 3 and m = 1.

    A barometer measures the height. The states are the errors of the accelerometer's solution, so the accelerometer is
    not an input. Its noise of 0.35 m/s² acts on height and speed together in each step, as in textbooks, so that part
    of Q has rank one.

    Parameters
    ----------
    more : number added to the diagonal of Q.
    """
    step, push = Fraction(1, 50), exact(["1/5000", "1/50", "0"])
    Q = np.multiply.outer(push, push) * Fraction("0.35") ** 2
    for i, random_walk in enumerate(("0", "0", "1e-8")):
        Q[i, i] += Fraction(random_walk) + Fraction(more)
    return LinearModel(
        Phi=exact([["1", step, -step * step / 2], ["0", "1", -step], ["0", "0", "1"]]),
        H=exact([["1", "0", "0"]]),
        Q=Q,
        R=exact([["0.25"]]),
        x0=exact(["0", "0", "0"]),
        P0=exact([["100", "0", "0"], ["0", "1", "0"], ["0", "0", "0.04"]]),
        name="altimeter",
    )


def tracker(origin: str = "0") -> LinearModel:
    """A tracker of position (m) and velocity (m/s), with ten measurements a second, n = 2 and m = 1.

    Parameters
    ----------
    origin : distance in m of the starting point from the origin of the coordinates.
    """
    return LinearModel(
        Phi=exact([["1", "0.1"], ["0", "1"]]),
        H=exact([["1", "0"]]),
        Q=exact([["1/30000", "1/2000"], ["1/2000", "1/100"]]),
        R=exact([["4"]]),
        x0=exact([origin, "0"]),
        P0=exact([["100", "0"], ["0", "100"]]),
        name=f"tracker, {origin} m from its origin",
    )


def precise_tracker() -> LinearModel:
    """A tracker whose sensor is far more precise than the prior: variances of 1e-12 and 1e4; n = 2, m = 1."""
    return LinearModel(
        Phi=exact([["1", "0.1"], ["0", "1"]]),
        H=exact([["1", "0.5"]]),
        Q=exact([["1/30000", "1/2000"], ["1/2000", "1/100"]]),
        R=exact([["1e-12"]]),
        x0=exact(["0", "0"]),
        P0=exact([["1e4", "0"], ["0", "1e4"]]),
        name="precise sensor",
    )


def turns(steps: int) -> NDArray[np.float64]:
    """Return what three gyroscopes add to an attitude quaternion, (steps, 4, 4), in steps of 10 ms.

    Each matrix holds half of the measured angles, rounded to 2**-20 rad, and multiplies the quaternion; the product is
    added to the quaternion. The vehicle turns at 0.3 rad/s about one axis and swings about the other two.
    """
    t = np.arange(steps) * 0.01
    rates = np.stack([0.2 * np.sin(t), 0.1 * np.cos(0.7 * t), np.full(steps, 0.3)])
    x, y, z = np.rint(rates * 0.01 * 2**20) / 2**21
    o = np.zeros(steps)
    rows = (o, -x, -y, -z), (x, o, z, -y), (y, -z, o, x), (z, y, -x, o)
    return np.array(rows).transpose(2, 0, 1)


def normal_matrix(degree: int, times: Sequence[int]) -> NDArray[Any]:
    r"""Exact normal matrix :math:`A^TA`, :math:`A_{ij} = t_i^j`, of a polynomial fit; (degree + 1, degree + 1)."""
    if degree < 0 or len(set(times)) <= degree:
        raise ValueError(
            f"got degree {degree} and {len(set(times))} different times; needed at least {degree + 1} different times "
            "and a degree of 0 or more"
        )
    powers = np.array([[Fraction(t) ** j for j in range(degree + 1)] for t in times], dtype=object)
    return np.asarray(powers.T @ powers)


def cyclic(n: int, m: int, cycle: int = 1, decay: float = 0.95, seed: int = 7) -> LinearModel:
    """Random stable states that decay slowly, seen by a measurement matrix that goes through a cycle.

    Parameters
    ----------
    n, m : numbers of states and of measurements.
    cycle : steps after which the measurement matrix is the same again.
    decay : approximate factor by which each state decays in a step.
    """
    rng = np.random.default_rng([seed, n, m])
    Phi = decay * np.eye(n) + 0.03 * rng.standard_normal((n, n))
    H = rng.standard_normal((m, n))
    turned = [H * np.cos(2 * np.pi * k / cycle + np.arange(n)) for k in range(cycle)]
    unit = exact(np.eye(n, dtype=np.int64))
    return LinearModel(
        Phi=np.round(Phi * 2**20) / 2**20,
        H=np.round(np.array(turned) * 2**20) / 2**20,
        Q=unit / 10,
        R=exact(np.eye(m, dtype=np.int64)),
        x0=np.array([Fraction(0)] * n, dtype=object),
        P0=unit,
        name=f"n = {n}, m = {m}, cycle {cycle}, decay {decay}",
    )


_LEVEL_HEADING = 0.7
"""Heading of the aircraft in :func:`height_channel`, rad."""


def height_channel(constrained: bool = False) -> LinearModel:
    """The covariance of an autopilot's attitude, vertical speed, height and accelerometer bias; n = 7 and m = 2.

    It is a reduced model of the filters that ArduPilot's pull request 18008 and PX4-ECL's 1026 correct. The aircraft
    flies level and straight without a magnetometer. The accelerometer, at 100 Hz, is turned into the vertical by the
    quaternion; every fifth step has a height and a vertical speed from the satellite receiver. Phi is the Jacobian of
    these equations at the level attitude. All numbers but the structure are ours.

    Parameters
    ----------
    constrained : whether the rotation takes the length of the quaternion as one before it is differentiated, as the
        corrected filters do.
    """
    step, c, s = 2.0**-7, np.cos(_LEVEL_HEADING / 2), np.sin(_LEVEL_HEADING / 2)

    def moved(x: FloatArray) -> Any:
        w, i, j, k, speed, height, bias = x
        gravity = x.format.array("9.80665")
        down = 1 - 2 * (i * i + j * j) if constrained else w * w - i * i - j * j + k * k
        faster = speed + (gravity - down * (gravity + bias)) * step
        return np.stack([w, i, j, k, faster, height + speed * step, bias])

    start = np.array([c, 0, 0, s, 0, 0, 0])
    Phi = jacobian(moved, BINARY64.array(start))[1].to_float()
    turns = np.array([[0, 0, -s], [c, -s, 0], [s, c, 0], [0, 0, c]]) / 2
    P0, Q = np.diag([0, 0, 0, 0, 0.25, 4, 0.04]), np.diag([0, 0, 0, 0, (0.35 * step) ** 2, 0, (0.003 * step) ** 2])
    P0[:4, :4] += _outer(turns, np.array([0.05, 0.05, 0.5]))
    Q[:4, :4] += _outer(turns, np.full(3, 0.015 * step))
    H = np.zeros((5, 2, 7))
    H[0, 0, 4] = H[0, 1, 5] = 1
    return LinearModel(Phi, H, Q, np.diag([0.09, 4]), np.zeros(7), P0, name="height channel")


def _outer(turns: NDArray[np.float64], deviations: NDArray[np.float64]) -> NDArray[Any]:
    """Return the covariance of a quaternion, for standard deviations of three angles, in plain loops of float64."""
    found = np.zeros((4, 4))
    for turn, deviation in zip(turns.T, deviations.tolist(), strict=True):
        found = found + np.multiply.outer(turn * deviation, turn * deviation)
    return found
