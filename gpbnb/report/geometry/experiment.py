"""Simulate the readings of telescope and gyro over a year, with exact rotations, and derive the drift from them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gpbnb.report.geometry.theory import Effect, Misalignments
from gpbnb.report.measurement import YEAR, apply, deroll, into_spacecraft, rotation

Floats = NDArray[np.float64]
CHUNK = 2**16


def difference(case: Misalignments, years: ArrayLike, phase: ArrayLike) -> Floats:
    """Return the derolled difference of gyro and telescope as φ2 and φ3 (..., 2) in radians, with exact rotations.

    Parameters
    ----------
    case : the angles.
    years, phase : (...), time since the start, and roll phase in radians; broadcast.
    """
    since = np.asarray(years, dtype=float)
    pointing = rotation(case.alpha)
    telescope = into_spacecraft(pointing[..., 0], phase, case.beta)
    gyro = into_spacecraft(apply(pointing, spin_axis(case, since)), phase, case.beta, case.gamma)
    y, z = np.moveaxis(deroll((gyro - telescope)[..., 1:], phase), -1, 0)
    return np.stack([z, -y], axis=-1)


def spin_axis(case: Misalignments, years: ArrayLike) -> Floats:
    """Return the direction (..., 3) of the spin axis in the absolute frame: the first column of the rotation by φ."""
    since = np.asarray(years, dtype=float)
    phi2, phi3 = case.drift[0] * since, case.drift[1] * since
    return np.stack([np.cos(phi2) * np.cos(phi3), -np.sin(phi3), np.sin(phi2) * np.cos(phi3)], axis=-1)


def year(case: Misalignments, roll_period: float = 600.0, step: float = 60.0) -> Effect:
    """Simulate a year of samples; return the errors of a straight line fitted to means of whole rolls.

    Parameters
    ----------
    case : the angles.
    roll_period : seconds, a multiple of 0.1.
    step : seconds between samples, a multiple of 0.1; at least three samples per roll.
    """
    block = _block(roll_period, step)
    count = int(YEAR / step) // block
    rate = 2 * math.pi / roll_period
    # Each block begins at phase zero. In a phase that grows for a year, by 3e5 rolls, float64 loses seven digits.
    phase = rate * step * np.arange(block)
    means, standing = np.empty((count, 2)), np.zeros(2)
    size = max(CHUNK // block, 1)
    for start in range(0, count, size):
        index = np.arange(start * block, min(start + size, count) * block).reshape(-1, block)
        found = difference(case, index * (step / YEAR), phase)
        mean = found.mean(axis=1, keepdims=True)
        means[start : start + size] = mean[:, 0]
        line = found - mean
        yz = np.stack([-line[..., 1], line[..., 0]], axis=-1)
        standing += deroll(yz, -phase).sum(axis=(0, 1))
    time = (np.arange(count) * block + (block - 1) / 2) * (step / YEAR)
    centred = time - time.mean()
    slope = centred @ means / (centred @ centred)
    angle, drift = means.mean(axis=0) - slope * time.mean(), slope - case.drift
    amplitude = float(np.hypot(*standing)) / (count * block)
    return Effect((float(angle[0]), float(angle[1])), (float(drift[0]), float(drift[1])), amplitude)


def small_angle_errors(name: str, sizes: ArrayLike, drift: tuple[float, float]) -> Floats:
    """Simulate the error of φ in a mean over one roll, the length of (Δφ2, Δφ3), for one angle of several `sizes`.

    All angles are in radians; `drift` holds the true φ2 and φ3.
    """
    phases = 32
    turns = 2 * math.pi * np.arange(phases) / phases
    errors = []
    for size in np.atleast_1d(np.asarray(sizes, dtype=float)):
        worst = 0.0
        for signed in (size, -size):
            case = Misalignments(drift=drift).with_angle(name, float(signed))
            truth = rotation((0.0, *drift))[1:, 0]
            mean = difference(case, np.ones(phases), turns).mean(axis=0)
            angles = np.array([math.asin(truth[1] / math.cos(drift[1])), -math.asin(truth[0])])
            worst = max(worst, float(np.hypot(*(mean - angles))))
        errors.append(worst)
    return np.array(errors)


def _block(roll_period: float, step: float) -> int:
    if not (step > 0 and roll_period > 0):
        raise ValueError(f"got a roll period of {roll_period} s and a step of {step} s; needed both above 0")
    if step > YEAR / 100:
        raise ValueError(f"got a step of {step} s; needed at least a hundred samples per year")
    period, between = round(10 * roll_period), round(10 * step)
    if period != 10 * roll_period or between != 10 * step:
        raise ValueError(f"got a roll period of {roll_period} s and a step of {step} s; needed multiples of 0.1 s")
    block = math.lcm(period, between) // between
    if block < 3:
        raise ValueError(
            f"got {block} samples in whole rolls of {roll_period} s; needed 3 or more; use a step "
            "that is not a multiple of half the roll period"
        )
    return block
