"""An aircraft's height, of which a computed variance becomes negative in single precision."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.derivatives import jacobian
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.model import LinearModel

_WIDE = FloatFormat(2, 53)


LEVEL_HEADING = 0.7
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
    step, c, s = 2.0**-7, np.cos(LEVEL_HEADING / 2), np.sin(LEVEL_HEADING / 2)

    def moved(x: FloatArray) -> Any:
        w, i, j, k, speed, height, bias = x
        gravity = x.format.array("9.80665")
        down = 1 - 2 * (i * i + j * j) if constrained else w * w - i * i - j * j + k * k
        faster = speed + (gravity - down * (gravity + bias)) * step
        return np.stack([w, i, j, k, faster, height + speed * step, bias])

    start = np.array([c, 0, 0, s, 0, 0, 0])
    Phi = jacobian(moved, _WIDE.array(start))[1].to_float()
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
