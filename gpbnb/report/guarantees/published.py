"""Filters with published numbers, taken from the programs and tests of other projects."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from gpbnb.arithmetic.rational import exact
from gpbnb.filters.model import LinearModel

_HERE = Path(__file__).parent


def nile_local_level() -> LinearModel:
    """Yearly flow of the Nile at Aswan, in 10⁸ m³, as a random walk: StateSpaceModels.jl, test/models/locallevel.jl.

    Its first covariance of 1e7 holds before the first update, whereas this package predicts first.
    """
    return LinearModel([[1]], [[1]], [["1469.1"]], [[15099]], [0], [["9998530.9"]], name="Nile, local level")


def elaenia_gold() -> LinearModel:
    """A constant, 990 at first, observed with a standard deviation of 15: sandialabs/elaenia, example 05_kalman."""
    return LinearModel([[1]], [[1]], [[0]], [[225]], [990], [[100]], name="elaenia, gold")


def dyer_mcreynolds() -> LinearModel:
    """Three constants seen by two nearly parallel measurements: an example by Dyer and McReynolds.

    They deviate from parallel by 0.0024. Grewal and Andrews compare filters for ``eps**(2/3) * 10**(10 - k)``; in
    binary32, k = 8 gives about this.

    References
    ----------
    dyer1969; the script ``shootout.m`` of grewal2008.
    """
    e = Fraction("0.0024")
    unit, H = exact(np.eye(3, dtype=np.int64)), exact([[1, 1, 1], [1, 1, 1 + e]])
    R = exact(np.eye(2, dtype=np.int64)) * e**2
    return LinearModel(unit, H, 0 * unit, R, [1, 1, -1], unit, name="Dyer and McReynolds")


def filterpy_velocity() -> LinearModel:
    """Position and velocity by a sensor with a variance of 1e-8: rlabbe/filterpy, tests/test_kf.py."""
    Q = [["0.001", "0"], ["0", "0.001"]]
    return LinearModel([[1, 1], [0, 1]], [[1, 0]], Q, [["1e-8"]], [0, 0], np.eye(2), name="filterpy, velocity")


def filterpy_fusion() -> LinearModel:
    """Position and velocity ten times a second: rlabbe/filterpy, tests/test_sensor_fusion.py, its single sensor."""
    Phi, Q, P0 = [["1", "0.1"], ["0", "1"]], [["1/150000", "1/10000"], ["1/10000", "1/500"]], 100 * np.eye(2)
    return LinearModel(Phi, [[1, 0]], Q, [[4]], [0, 1], P0, name="filterpy, sensor fusion")


def dynamax_tracking() -> LinearModel:
    """A point in the plane, two positions and two velocities: probml/dynamax, notebook kf_tracking."""
    unit = exact(np.eye(4, dtype=np.int64))
    Phi = np.eye(4) + np.eye(4, k=2)
    return LinearModel(Phi, np.eye(4)[:2], unit / 1000, np.eye(2), [8, 10, 1, 0], unit / 10, name="dynamax, tracking")


def px4_landing_target() -> LinearModel:
    """A landing target's position and velocity, 50 times a second: PX4-Autopilot, at a distance of 1 m."""
    Phi, Q = [["1", "0.02"], ["0", "1"]], [["1/2500000", "1/25000"], ["1/25000", "1/250"]]
    P0 = [["0.1", "0"], ["0", "0.1"]]
    return LinearModel(Phi, [[1, 0]], Q, [["0.005"]], [0, 0], P0, name="PX4, landing target")


def fixif_longitudinal() -> dict[str, Any]:
    """A controller of an aircraft's longitudinal motion with ten states: A, B, C, D, and FixIF's printed numbers."""
    return dict(json.loads((_HERE / "fixif_longitudinal.json").read_text(encoding="utf-8")))
