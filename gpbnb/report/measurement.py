r"""Readings of telescope and gyro in a rolling spacecraft: frames, rotations, and the measurement matrix.

As in hung1982, ch. IV, there are six frames with a common origin. A rotation transforms the components of a vector
from one frame to the next along the chain:

======  ============  ==============================================================================
frame   name          how it is reached
======  ============  ==============================================================================
``a``   absolute      fixed; :math:`x_a` points to the guide star
``i``   intermediate  from ``a`` by the pointing α; :math:`x_i` is the roll axis
``φ``   roll          from ``i`` by the roll phase ωt about :math:`x_i`
``t``   telescope     from ``φ`` by the misalignment β; :math:`x_t` is the boresight
``r``   readout       from ``t`` by the misalignment γ; :math:`z_r` is the normal of the readout ring
``g``   gyro          :math:`x_g` is the spin axis; θ leads from ``g`` to ``i``, φ = θ - α to ``a``
======  ============  ==============================================================================

Angles are in radians, and each set of three rotates about the axes 3, 2, 1 in this order. The document does not state
the order, which does not matter to first order. Note the sign of θ and φ: they rotate the gyro frame *into* the others,
so the spin axis points to :math:`(1, -\varphi_3, \varphi_2)` in the absolute frame.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

ARCSEC = math.pi / (180 * 3600)
"""One second of arc, in radians."""
MAS = ARCSEC / 1000
"""One milliarcsecond, in radians."""

YEAR = 365 * 86400.0
"""Seconds in a year, as hung1984 counts them."""

Floats = NDArray[np.float64]
Signal = Literal["gyro", "telescope"]

STATES = (
    "phi2",
    "phi3",
    "phi2_rate",
    "phi3_rate",
    "alpha2",
    "alpha3",
    "beta1",
    "beta2",
    "beta3",
    "gamma1",
    "gamma2",
    "gamma3",
    "bias_y",
    "bias_z",
    "scale",
)
"""All states for which :func:`measurement_matrix` has a column."""

GPB_STATES = (
    "phi2",
    "phi3",
    "phi2_rate",
    "phi3_rate",
    "alpha2",
    "alpha3",
    "gamma1",
    "bias_y",
    "bias_z",
    "scale",
)
"""Ten of these states, for drift and its rate, pointing, misalignment about the roll axis, biases, and scale factor.

The transverse misalignments β2, β3, γ2, γ3 have the same columns as the biases, up to sign, and so are part of them.
"""


# -- rotations ------------------------------------------------------------------------------------


def rotation(angles: ArrayLike) -> Floats:
    r"""Exact matrix (..., 3, 3) that transforms components to a frame rotated by `angles`, (..., 3), in radians.

    .. math:: C = R_1(\alpha_1)\,R_2(\alpha_2)\,R_3(\alpha_3) \approx \begin{bmatrix} 1 & \alpha_3 & -\alpha_2 \\
        -\alpha_3 & 1 & \alpha_1 \\ \alpha_2 & -\alpha_1 & 1 \end{bmatrix}

    The approximation for small angles is that of hung1982, ch. IV, eqs. (1)-(4), and the same for every sequence.
    """
    each = _angles("angles", angles, 3)
    first, second, third = (_turn(axis, each[..., axis - 1]) for axis in (1, 2, 3))
    return np.asarray(first @ (second @ third))


def angles_of(matrix: Floats) -> Floats:
    """The three angles (..., 3) of rotation matrices (..., 3, 3): the inverse of :func:`rotation`."""
    first = np.arctan2(matrix[..., 1, 2], matrix[..., 2, 2])
    second = np.arctan2(-matrix[..., 0, 2], np.hypot(matrix[..., 0, 0], matrix[..., 0, 1]))
    third = np.arctan2(matrix[..., 0, 1], matrix[..., 0, 0])
    return np.stack([first, second, third], axis=-1)


def roll(phase: ArrayLike) -> Floats:
    r"""Matrix (..., 3, 3) from the intermediate to the roll frame, a rotation about x by the phase ωt in radians.

    .. math:: R(\omega t) = \begin{bmatrix} 1 & 0 & 0 \\ 0 & \cos\omega t & \sin\omega t \\
        0 & -\sin\omega t & \cos\omega t \end{bmatrix}
    """
    return _turn(1, _finite("phase", phase))


def deroll(readings: ArrayLike, phase: ArrayLike) -> Floats:
    r"""Transform readings y, z of a rolling frame into readings of the intermediate frame.

    .. math:: \begin{bmatrix} y_i \\ z_i \end{bmatrix} = \begin{bmatrix} \cos\omega t & -\sin\omega t \\
        \sin\omega t & \cos\omega t \end{bmatrix} \begin{bmatrix} y \\ z \end{bmatrix}

    Parameters
    ----------
    readings : (..., 2), in any unit.
    phase : ωt, in radians; broadcast against the leading axes of `readings`.

    Returns
    -------
    derolled : (..., 2); to first order (-α3, α2) for the telescope and (-θ3, θ2) for the gyro.

    References
    ----------
    hung1982, ch. IV, eqs. (5)-(7). Equations (8) and (9) have other signs and do not deroll.
    """
    body, turned = _angles("readings", readings, 2), _finite("phase", phase)
    return _turned_back(body, np.cos(turned), np.sin(turned))


# -- what is measured -----------------------------------------------------------------------------


def into_spacecraft(vector: ArrayLike, phase: ArrayLike, *misalignments: ArrayLike) -> Floats:
    """Transform a vector (..., 3) from the intermediate frame through the roll and then each misalignment, in radians.

    The misalignment β leads to the telescope frame, β and γ lead to the readout frame. All arguments are broadcast.
    """
    given, turned = _angles("vector", vector, 3), _finite("phase", phase)
    yz = deroll(given[..., 1:], -turned)
    components = np.concatenate([np.broadcast_to(given[..., :1], (*yz.shape[:-1], 1)), yz], axis=-1)
    for angles in misalignments:
        components = apply(rotation(angles), components)
    return components


def apply(matrix: Floats, vector: Floats) -> Floats:
    """Multiply matrices (..., 3, 3) and vectors (..., 3), broadcast, without BLAS, whose last digits vary."""
    return np.asarray(np.einsum("...jk,...k->...j", matrix, vector))


def star_in_telescope(alpha: ArrayLike, beta: ArrayLike, phase: ArrayLike) -> Floats:
    r"""Unit vector to the guide star in the telescope frame, :math:`B(\beta)\,R(\omega t)\,A(\alpha)\,(1,0,0)^T`.

    The angles (..., 3) and the phase are in radians and broadcast; hung1982, ch. IV, eq. (1), for any angles.
    """
    return into_spacecraft(rotation(alpha)[..., 0], phase, beta)


def spin_in_readout(theta: ArrayLike, beta: ArrayLike, gamma: ArrayLike, phase: ArrayLike) -> Floats:
    r"""Unit vector along the spin axis in the readout frame, that of the star with Θ(θ) for A(α), and Γ(γ) in front.

    The angles (..., 3) and the phase are in radians and broadcast; hung1982, ch. IV, eq. (2), for any angles.
    """
    return into_spacecraft(rotation(theta)[..., 0], phase, beta, gamma)


def theta_of(phi: ArrayLike, alpha: ArrayLike) -> Floats:
    """Exact angles θ from gyro to intermediate frame for drift φ and pointing α; to first order, φ + α."""
    return angles_of(rotation(alpha) @ rotation(phi))


def measurement_matrix(
    phase: ArrayLike,
    states: Sequence[str] = GPB_STATES,
    *,
    nominal_theta: ArrayLike = (0.0, 0.0, 0.0),
) -> Floats:
    r"""Two derolled readings of the gyro, y and z, as a linear function of the unknowns, at given roll phases.

    Let :math:`\vec\theta = (-\theta_3, \theta_2)^T`, define :math:`\vec\alpha`, :math:`\vec\beta` and
    :math:`\vec\gamma` in the same way, and let :math:`\vec\theta = \vec\varphi + \vec\alpha`. R is the 2×2 block of
    :func:`roll`, :math:`J = \begin{bmatrix} 0 & 1 \\ -1 & 0 \end{bmatrix}`, b is the bias and k the error of the scale
    factor. In the roll frame, to first order in every unknown, the readings, which :func:`deroll` transforms into the
    intermediate frame, and those of the telescope, which :func:`measurement_rows` has too, are

    .. math::

        \text{gyro} &= (1 + k)\bigl[(1 + (\beta_1 + \gamma_1) J)\,R\,\vec\theta
            + \vec\beta + \vec\gamma\bigr] + b \\
        \text{telescope} &= (1 + \beta_1 J)\,R\,\vec\alpha + \vec\beta

    Scale factor and rotations about the roll axis multiply the signal. Their columns are evaluated for the nominal θ,
    and are zero where it is zero, as the nominal α is. A rate has a column of zeros, because it affects the readings
    only through the angle that it changes.

    Parameters
    ----------
    phase : (...), ωt in radians.
    states : names from `STATES`, one for each column, in this order; rates are per any unit of time.
    nominal_theta : (..., 3), in radians; broadcast against `phase`. The first element is not used.

    Returns
    -------
    H : (..., 2, n). Readings and angles share one unit, which is free in all columns but those of ``scale``,
        ``beta1`` and ``gamma1``. These are in radians per unit (scale) or per radian, from the nominal angles.

    References
    ----------
    hung1982, ch. IV, eqs. (1)-(7); bias and scale factor from the classification of ch. II.
    """
    turned, theta = _finite("phase", phase), _angles("nominal_theta", nominal_theta, 3)
    rows = measurement_rows(np.cos(turned), np.sin(turned), states, theta=theta)
    return np.asarray(rows, dtype=np.float64) + 0.0  # no minus sign before a zero


def measurement_rows(
    cosine: ArrayLike,
    sine: ArrayLike,
    states: Sequence[str],
    *,
    signal: Signal = "gyro",
    derolled: bool = True,
    theta: ArrayLike = (0, 0, 0),
) -> NDArray[Any]:
    """Compute :func:`measurement_matrix` from cosine and sine of the roll phase; Fractions stay exact.

    Parameters
    ----------
    cosine, sine : (...), of ωt; floats, or objects such as Fractions for an exact model.
    states : as in :func:`measurement_matrix`.
    signal : which readings to use.
    derolled : whether the readings are transformed into the intermediate frame, as by :func:`deroll`.
    theta : (..., 3), the nominal θ, numbers of the same type or integers.
    """
    if not states or len(set(states)) != len(states) or not set(states) <= set(STATES):
        raise ValueError(f"got states {tuple(states)}; needed different names from {', '.join(STATES)}")
    C, S, nominal = np.asarray(cosine), np.asarray(sine), np.asarray(theta)
    y, z, gyro = np.array([1, 0]), np.array([0, 1]), int(signal == "gyro")
    spin = gyro * _transverse(nominal)
    inertial: dict[str, Any] = {  # columns in the intermediate frame
        "phi2": gyro * z,
        "phi3": -gyro * y,
        "alpha2": z,
        "alpha3": -y,
        "beta1": _quarter(spin),
        "gamma1": _quarter(spin),
        "scale": spin,
    }
    body: dict[str, Any] = {  # columns in the roll frame
        "phi2_rate": 0 * y,
        "phi3_rate": 0 * z,
        "beta2": z,
        "beta3": -y,
        "gamma2": gyro * z,
        "gamma3": -gyro * y,
        "bias_y": gyro * y,
        "bias_z": gyro * z,
    }
    shape = np.broadcast_shapes(C.shape, S.shape, nominal.shape[:-1])
    H = np.empty((*shape, 2, len(states)), dtype=np.result_type(C, S, nominal))
    for column, name in enumerate(states):
        if name in body:
            H[..., column] = _turned_back(body[name], C, S) if derolled else body[name]
        else:
            H[..., column] = inertial[name] if derolled else _turned_back(inertial[name], C, -S)
    return H


# -- helpers --------------------------------------------------------------------------------------


def _turn(axis: int, angle: Floats) -> Floats:
    """Elementary matrix that transforms components to a frame rotated by `angle` about `axis`."""
    j, k = axis % 3, (axis + 1) % 3
    C = np.zeros((*angle.shape, 3, 3))
    C[..., axis - 1, axis - 1] = 1
    C[..., j, j] = C[..., k, k] = np.cos(angle)
    C[..., j, k] = np.sin(angle)
    C[..., k, j] = -C[..., j, k]
    return C


def _turned_back(readings: NDArray[Any], C: NDArray[Any], S: NDArray[Any]) -> NDArray[Any]:
    """The deroll of readings (..., 2), from cosine and sine of the phase."""
    y, z = readings[..., 0], readings[..., 1]
    return np.stack([C * y - S * z, S * y + C * z], axis=-1)


def _transverse(angles: NDArray[Any]) -> NDArray[Any]:
    """(-v3, v2), the y and z components of a frame's x axis after small rotations v."""
    return np.stack([-angles[..., 2], angles[..., 1]], axis=-1)


def _quarter(pair: NDArray[Any]) -> NDArray[Any]:
    """Apply J to pairs (..., 2)."""
    return np.stack([pair[..., 1], -pair[..., 0]], axis=-1)


def _finite(name: str, values: ArrayLike) -> Floats:
    given = np.asarray(values, dtype=np.float64)
    if not np.all(np.isfinite(given)):
        raise ValueError(f"got {name} with NaN or infinity; needed finite numbers; omit missing samples")
    return given


def _angles(name: str, values: ArrayLike, count: int) -> Floats:
    given = _finite(name, values)
    if given.ndim == 0 or given.shape[-1] != count:
        raise ValueError(f"got {name} of shape {given.shape}; needed (..., {count})")
    return given
