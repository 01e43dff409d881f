"""Nonlinear filters that others published: a robot among landmarks, and an attitude from a recorded sensor."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.derivatives import jacobian
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.nonlinear import NonlinearModel

LANDMARKS = ((5, 10), (10, 5), (15, 15))
"""Positions of the landmarks in the first run of the robot, in metres."""

DIP = ("8/17", "-15/17")
"""The horizontal and the upward part of the direction of the magnetic field at the sensor, a dip of about 62°."""

RECORD = Path(__file__).parent / "ngimu.csv"
"""Two seconds of an inertial sensor that rests and is then moved. The file ngimu_licence.txt names its origin."""

_DOUBLE = FloatFormat(2, 53)


# -- a robot among landmarks ------------------------------------------------------------------------------------------


def driven(x: FloatArray, u: FloatArray) -> Any:
    """Drive east, north and heading x[:3] along an arc, by speed u[0] and steering angle u[1] for u[2] seconds.

    The states x[3:] are the errors of speed and steering angle of the last step. The next ones are independent.
    """
    speed, steering, wheelbase = u[0] + x[3], u[1] + x[4], x.format.array("0.5")
    turn, radius = speed * u[2] / wheelbase * np.tan(steering), wheelbase / np.tan(steering)
    east = radius * np.sin(x[2] + turn) - radius * np.sin(x[2])
    north = radius * np.cos(x[2]) - radius * np.cos(x[2] + turn)
    return np.stack([x[0] + east, x[1] + north, x[2] + turn, x[3] * 0, x[4] * 0])


def sighted(x: FloatArray, u: FloatArray) -> Any:
    """Return range and bearing of the landmark at u[3:] from a robot at x[:2] with heading x[2]."""
    east, north = u[3] - x[0], u[4] - x[1]
    return np.stack([np.hypot(east, north), np.arctan2(north, east) - x[2]])


def robot(landmarks: Sequence[Sequence[int]] = LANDMARKS, seed: int = 0) -> tuple[NonlinearModel, NDArray[np.float64]]:
    """A robot that drives for 20 s and sees landmarks by range, to 0.3 m, and bearing, to 0.1 rad; n = 5 and m = 2.

    Each second, the robot moves and then sees one landmark after the other. A step of the model is one landmark; the
    steps after the first of a second take no time. Labbe's noise of speed and steering angle goes through the motion;
    here, these errors are two more states, which gives the same filter.

    Returns
    -------
    model : with 20 steps for each landmark.
    z : (steps, 2), in m and rad, simulated along the robot's path without process noise, as Labbe does.

    References
    ----------
    labbe2020, ch. 11; the variance of the speed is that of the code there.
    """
    steering = (np.pi / 180) ** 2
    errors = np.diag([0, 0, 0, 0.1 * 1.1**2, steering])
    rows = [[1.1, 0.01, float(i == 0), *each] for _ in range(20) for i, each in enumerate(landmarks)]
    model = NonlinearModel(
        driven,
        None,
        sighted,
        None,
        Q=errors,
        R=np.diag([0.3**2, 0.1**2]),
        x0=["2", "6", "0.3", 0, 0],
        P0=np.diag([0.1, 0.1, 0.1, 0, 0]) + errors,
        u=rows,
        angles=["bearing (rad)"],
        state_names=["east (m)", "north (m)", "heading (rad)", "error of speed (m/s)", "error of steering (rad)"],
        measurement_names=["range (m)", "bearing (rad)"],
        name="robot among landmarks",
    )
    return model, _sights(landmarks, seed)


def _sights(landmarks: Sequence[Sequence[int]], seed: int) -> NDArray[np.float64]:
    """Measure along a path of tenths of a second, at the first tenth of each second, in correctly rounded binary64."""
    rng, x, z = np.random.default_rng(seed), _DOUBLE.array(["2", "6", "0.3", 0, 0]), []
    for tenth in range(191):
        x = driven(x, _DOUBLE.array(["1.1", "0.01", "0.1"]))
        if tenth % 10 == 0:
            z += [sighted(x, _DOUBLE.array([0, 0, 0, *each])).to_float() for each in landmarks]
    noise = rng.standard_normal((len(z), 2)) * [0.3, 0.1]
    return np.asarray(np.stack(z) + noise)


# -- the attitude of a sensor -----------------------------------------------------------------------------------------


def turned(x: FloatArray, u: FloatArray) -> Any:
    """Turn a quaternion x[:4] by the rates u[:3] (rad/s) for u[3] seconds, to first order.

    The states x[4:] are the errors of the rates in the last step. The next ones are independent.
    """
    (w, i, j, k), (a, b, c) = x[:4], (u[:3] + x[4:]) * u[3] / 2
    return np.stack(
        [
            w - i * a - j * b - k * c,
            i + w * a - k * b + j * c,
            j + k * a + w * b - i * c,
            k - j * a + i * b + w * c,
            *(x[4:] * 0),
        ]
    )


def seen_directions(x: FloatArray, u: FloatArray) -> Any:
    """Return upward and magnetic directions as the body sees them, each scaled by the squared length of x[:4]."""
    w, i, j, k = x[:4]
    level, upward = x.format.array(DIP)
    up = np.stack([2 * (i * k - w * j), 2 * (w * i + j * k), w * w - i * i - j * j + k * k])
    north = np.stack([w * w + i * i - j * j - k * k, 2 * (i * j - w * k), 2 * (i * k + w * j)])
    return np.concatenate([up, level * north + upward * up])


def unit(x: FloatArray) -> Any:
    """Scale the quaternion x[:4] to length one."""
    return np.concatenate([x[:4] / np.linalg.norm(x[:4]), x[4:]])


def attitude(steps: int = 100) -> tuple[NonlinearModel, NDArray[np.float64]]:
    """An attitude quaternion from a recorded gyroscope, accelerometer and magnetometer, n = 7 and m = 6.

    The filter is the extended Kalman filter of AHRS with its default noises. It takes the measured directions from the
    scaled quaternion, and their Jacobian from the quaternion before it is scaled. The noise of the gyroscopes goes
    through the turn; here, their errors are three more states, which gives the same filter. The direction of the field,
    ``DIP``, and the first quaternion are ours; AHRS takes the first quaternion from the first sample. The sensor, an
    NGIMU, was sampled about 50 times a second.

    Returns
    -------
    model : with the rates and the time since the last sample as known inputs.
    z : (steps, 6), directions of acceleration and of the magnetic field.

    References
    ----------
    ahrs, EKF; the record is of skinematics.
    """
    record = np.loadtxt(RECORD, delimiter=",", skiprows=1)[: steps + 1]
    rates, acceleration, field = record[1:, 1:4], record[1:, 4:7], record[1:, 7:10]
    model = NonlinearModel(
        turned,
        None,
        lambda x, u: seen_directions(unit(x), u),
        lambda x, u: jacobian(lambda state: seen_directions(state, u), x)[1],
        Q=np.diag([0] * 4 + [0.3**2] * 3),
        R=np.diag([0.5**2] * 3 + [0.8**2] * 3),
        x0=[1, 0, 0, 0, 0, 0, 0],
        P0=np.diag([1] * 4 + [0.3**2] * 3),
        u=np.column_stack([rates * (np.pi / 180), np.diff(record[:, 0])]),
        normalize=unit,
        name="attitude of a recorded sensor",
    )
    return model, np.column_stack([_directions(acceleration), _directions(field)])


def _directions(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale vectors (steps, 3) to length one, by operations that IEEE 754 rounds alike everywhere."""
    x, y, z = vectors.T
    return vectors / np.sqrt(x * x + y * y + z * z)[:, None]
