r"""A model of Gravity Probe B as it flew: aberration, occultation, roll-phase offset and 1/f noise.

Along one axis of the rolling spacecraft, the gyro reads the direction of its spin axis relative to the apparent
direction of the star, and the telescope reads the pointing. To first order,

.. math:: z_r &= (1 + k)\,\bigl[(s_2 + \varphi_2 + \alpha_2)\cos(\omega t + \delta)
        + (s_3 + \varphi_3 + \alpha_3)\sin(\omega t + \delta)\bigr] + b + \beta + \sum_j f_j, \\
    z_t &= \alpha_2\cos\omega t + \alpha_3\sin\omega t + \beta,

where :math:`s` is known: the aberration of starlight due to the motions of the spacecraft and of the Earth, and the
predicted drift. It calibrates the scale factor error k and the roll-phase offset δ. The known part of :math:`z_r` is
subtracted before the filter, which evaluates :math:`\partial z_r/\partial k` and :math:`\partial z_r/\partial\delta` at
:math:`s`. While the Earth hides the star, both rows of H are zero, so nothing is measured and no digit changes.

Every number is in :data:`PARAMETERS`, with its source or the word "ours".

:mod:`gpbnb.report.gravity_probe_b.threshold` runs the year of this model in several formats, with one modelling choice
changed at a time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.filters.model import LinearModel
from gpbnb.filters.simulation import BLOCK, covariance_root, measured
from gpbnb.report.display.tables import Table
from gpbnb.report.gravity_probe_b.year import STORED

STATES = (
    ("drift φ2", "mas"),
    ("drift φ3", "mas"),
    ("drift rate 2", "mas/yr"),
    ("drift rate 3", "mas/yr"),
    ("pointing α2", "mas"),
    ("pointing α3", "mas"),
    ("scale factor k", "10⁻³"),
    ("roll-phase offset δ", "mrad"),
    ("readout bias b", "mas"),
    ("misalignment β", "mas"),
    ("1/f noise, 10 s", "mas"),
    ("1/f noise, 100 s", "mas"),
    ("1/f noise, 1000 s", "mas"),
)
"""The states, and their units."""

_N = len(STATES)
YEAR_SECONDS = 365 * 86400


class Parameter(NamedTuple):
    """A number of the model, and its source."""

    name: str
    value: float
    unit: str
    source: str


_REPORT = "hung1984, ch. II, section 12"
_PRL = "Everitt et al., Phys. Rev. Lett. 106, 221101 (2011)"
_MUHLFELDER = "Muhlfelder et al., APS April Meeting 2007, L1.16"
_KEISER = "Keiser, APS April Meeting 2007, H7.3"
_FINAL = "GP-B Post-Flight Analysis, Final Report (2007), 7.3.2"
_CQG = "Class. Quantum Grav. 32(22), 2015, data system"

PARAMETERS = (
    Parameter("geodetic drift, predicted", 6606.1, "mas/yr", _PRL),
    Parameter("frame dragging, predicted", 39.2, "mas/yr", _PRL),
    Parameter("geodetic drift, true less predicted", 4.3, "mas/yr", f"measured less predicted, {_PRL}"),
    Parameter("frame dragging, true less predicted", 2.0, "mas/yr", f"measured less predicted, {_PRL}"),
    Parameter("aberration due to the orbit", 5.2, "arcsec", "7.5 km/s over the speed of light; " + _KEISER),
    Parameter("aberration due to the Earth's motion", 20.5, "arcsec", "constant of aberration; " + _KEISER),
    Parameter("period of the orbit", 5859.0, "s", _KEISER),
    Parameter("right ascension of IM Pegasi", 343.259, "deg", "star catalogues, J2000"),
    Parameter("declination of IM Pegasi", 16.841, "deg", "star catalogues, J2000"),
    Parameter("obliquity of the ecliptic", 23.44, "deg", "IAU"),
    Parameter("height of the orbit", 642.0, "km", "ours, from the period"),
    Parameter("radius of the Earth", 6378.0, "km", "IAU"),
    Parameter("roll period, report", 600.0, "s", _REPORT),
    Parameter("roll period, flown", 77.5, "s", _KEISER),
    Parameter("time between measurements, report", 10.0, "s", _REPORT),
    Parameter("time between measurements, flown", 2.0, "s", _CQG),
    Parameter("white readout noise, mean of 10 hours", 1.0, "mas", _MUHLFELDER),
    Parameter(
        "1/f readout noise per decade of time constants", 33.0, "mas", "ours: at 77.5 s as dense as the white noise"
    ),
    Parameter("telescope noise in 10 s", 5.0, "mas", "ours"),
    Parameter("pointing, standard deviation", 20.0, "mas", "ours"),
    Parameter("pointing, time constant", 95.0, "s", "ours"),
    Parameter("roll-phase offset", 0.145, "mrad", f"30 arcsec, {_FINAL}"),
    Parameter("random walk of drift in a year", 0.18, "mas", "ours"),
    Parameter("random walk of drift rates in a year", 0.18, "mas/yr", "ours"),
    Parameter("random walk of the scale factor in a year", 0.018, "10⁻³", "ours"),
    Parameter("random walk of the roll-phase offset in a year", 0.018, "mrad", "ours"),
    Parameter("random walk of biases in a year", 1.8, "mas", "ours"),
    Parameter("first standard deviation of drift", 100.0, "mas", "ours"),
    Parameter("first standard deviation of drift rates", 10_000.0, "mas/yr", "ours"),
    Parameter("first standard deviation of the scale factor", 10.0, "10⁻³", "ours"),
    Parameter("first standard deviation of the roll-phase offset", 1.0, "mrad", "ours"),
    Parameter("first standard deviation of biases", 100.0, "mas", "ours"),
    Parameter("resolution of measurements", 1.0, "mas", "ours"),
)
"""The numbers of the model, with their sources."""

_VALUE = {each.name: each.value for each in PARAMETERS}


def parameters() -> Table:
    """Tabulate the numbers of the model with their sources."""
    rows = tuple((each.name, f"{each.value:g}", each.unit, each.source) for each in PARAMETERS)
    return Table("parameters of the mission model", ("parameter", "value", "unit", "source"), rows)


@dataclass(frozen=True)
class Mission:
    """One setting of the model.

    Parameters
    ----------
    flown : whether a step takes 2 s and a roll 77.5 s, as flown; otherwise 10 s and 600 s as in the report.
    deviations : whether the filter estimates deviations from the predicted drift, or the drift itself.
    occultation : whether the Earth hides the star for a part of each orbit.
    annual : whether the aberration due to the Earth's motion is part of the known signal.
    flicker : whether there is 1/f noise, and three states for it.
    roll_phase : whether the roll-phase offset is estimated; otherwise it is known.
    quiet : divisor of both standard deviations of the readout noise.
    """

    flown: bool = False
    deviations: bool = False
    occultation: bool = True
    annual: bool = True
    flicker: bool = True
    roll_phase: bool = True
    quiet: float = 1.0

    @property
    def interval(self) -> int:
        """Seconds between measurements."""
        return int(_VALUE[f"time between measurements, {self._which}"])

    @property
    def steps(self) -> int:
        """Steps of a year."""
        return YEAR_SECONDS // self.interval

    @property
    def _which(self) -> str:
        return "flown" if self.flown else "report"

    # -- the known signal -------------------------------------------------------------------------------

    def phases(self, steps: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Phases of roll and orbit after some steps, (k,), in radians; zero at the start of the year."""
        roll, orbit = round(2 * _VALUE[f"roll period, {self._which}"]), round(2 * _VALUE["period of the orbit"])
        half_seconds = 2 * self.interval * steps
        return 2 * math.pi * (half_seconds % roll) / roll, 2 * math.pi * (half_seconds % orbit) / orbit

    def visible(self, orbit: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the star is visible at an orbital phase; the star lies in the plane of the orbit, at phase zero."""
        if not self.occultation:
            return np.ones(len(orbit), dtype=bool)
        radius = _VALUE["radius of the Earth"]
        half = math.asin(radius / (radius + _VALUE["height of the orbit"]))
        return np.asarray(np.abs(orbit - math.pi) >= half)

    def known_signal(self, steps: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the known direction of the gyro relative to the apparent star, (k, 2), north and east, in arcsec.

        Aberration shifts the star along the velocity. The orbital velocity lies in the plane of the orbit, which
        contains the pole and the star. The Earth is assumed to move on a circle in the ecliptic.
        """
        _, orbit = self.phases(steps)
        years = self.interval * steps / YEAR_SECONDS
        predicted = np.array([_VALUE["geodetic drift, predicted"], _VALUE["frame dragging, predicted"]]) / 1000
        signal = np.outer(years, predicted)
        signal[:, 0] += _VALUE["aberration due to the orbit"] * np.cos(orbit)
        if self.annual:
            signal += _VALUE["aberration due to the Earth's motion"] * _earth_velocity(years)
        return signal

    # -- the filter's model -----------------------------------------------------------------------------

    def model(self, base: int) -> LinearModel:
        """Return the model without its measurement matrices, which :meth:`matrices` returns block by block.

        Numbers are stored in 14 bits or 4 decimal digits, so that all formats of a base use the same model.
        """
        each = 1 / self.steps
        pointing = math.exp(-self.interval / _VALUE["pointing, time constant"])
        memory = [math.exp(-self.interval / tau) for tau in (10, 100, 1000)]
        Phi = np.diag([1.0, 1, 1, 1, pointing, pointing, 1, 1, 1, 1, *memory])
        Phi[0, 2] = Phi[1, 3] = each
        flicker = (_VALUE["1/f readout noise per decade of time constants"] / self.quiet) ** 2 * self.flicker
        alpha = _VALUE["pointing, standard deviation"] ** 2
        walks = [
            _VALUE[f"random walk of {name} in a year"] ** 2 * each
            for name in ("drift", "drift rates", "the scale factor", "the roll-phase offset", "biases")
        ]
        walks[3] *= self.roll_phase
        Q = [
            *(walks[0],) * 2,
            *(walks[1],) * 2,
            *(alpha * (1 - pointing**2),) * 2,
            *walks[2:4],
            *(walks[4],) * 2,
            *(flicker * (1 - each_memory**2) for each_memory in memory),
        ]
        # The mean of a rolling signal over 10 hours has twice the variance of the mean of a constant.
        white = _VALUE["white readout noise, mean of 10 hours"] ** 2 / 2 * 36_000 / self.interval / self.quiet**2
        telescope = _VALUE["telescope noise in 10 s"] ** 2 * 10 / self.interval
        first = [
            _VALUE[f"first standard deviation of {name}"] ** 2
            for name in ("drift", "drift rates", "the scale factor", "the roll-phase offset", "biases")
        ]
        first[3] *= self.roll_phase
        P0 = [*(first[0],) * 2, *(first[1],) * 2, alpha, alpha, first[2], first[3], first[4], first[4], *(flicker,) * 3]
        return LinearModel(
            Phi=_short(Phi, base),
            H=np.zeros((2, _N)),
            Q=_short(np.diag(Q), base),
            R=_short(np.diag([white, telescope]), base),
            x0=np.zeros(_N),
            P0=_short(np.diag(P0), base),
            name=str(self),
        )

    def matrices(self, block: int, base: int) -> NDArray[np.float64]:
        """Return measurement matrices of a block of steps, (4096, 2, 13).

        Entries are multiples of 2⁻¹² or 10⁻⁴, with up to 17 bits or 6 digits. They are the same on every machine and
        for every format of the base with at least as many digits.
        """
        steps = np.arange(block * BLOCK, (block + 1) * BLOCK, dtype=np.int64) + 1
        turn, orbit = self.phases(steps)
        c, s = np.cos(turn), np.sin(turn)
        signal = self.known_signal(steps)
        H = np.zeros((BLOCK, 2, _N))
        H[:, 0, 0] = H[:, 0, 4] = H[:, 1, 4] = c
        H[:, 0, 1] = H[:, 0, 5] = H[:, 1, 5] = s
        H[:, 0, 6] = signal[:, 0] * c + signal[:, 1] * s
        H[:, 0, 7] = (signal[:, 1] * c - signal[:, 0] * s) * self.roll_phase
        H[:, 0, 8] = H[:, 0, 9] = H[:, 1, 9] = 1
        H[:, 0, 10:] = self.flicker
        H[~self.visible(orbit)] = 0
        grid = 10.0**4 if base == 10 else 2.0**12
        return np.asarray(np.rint(H * grid) / grid)

    @property
    def start(self) -> tuple[float, ...]:
        """Return the true initial state, which the filter must find."""
        rates = [_VALUE[f"{name}, true less predicted"] for name in ("geodetic drift", "frame dragging")]
        if not self.deviations:
            rates[0] += _VALUE["geodetic drift, predicted"]
            rates[1] += _VALUE["frame dragging, predicted"]
        offset = _VALUE["roll-phase offset"] * self.roll_phase
        return (30.0, -20.0, *rates, 0.0, 0.0, 4.0, offset, -80.0, 60.0, 0.0, 0.0, 0.0)

    # -- measurements -----------------------------------------------------------------------------------

    @cached_property
    def _truth_model(self) -> tuple[NDArray[np.float64], ...]:
        given = self.model(2)
        process, noise = (covariance_root(covariance)[np.newaxis] for covariance in (given.Q[0], given.R[0]))
        return given.Phi.astype(np.float64), process, noise

    def measurements(
        self, record: int, block: int, truth: NDArray[np.float64], H: NDArray[np.float64] | None, steps: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return measurements of a block, (steps, 2), in whole mas, and the truth after them.

        Parameters
        ----------
        record : number that selects the noise, ``default_rng([2004, record, block])``.
        truth : (13,), the truth at the beginning of the block.
        H : the result of :meth:`matrices` in base 2.
        """
        if H is None:
            raise ValueError("got no measurement matrices; needed those of matrices(block, 2)")
        rng = np.random.default_rng([2004, record, block])
        w, v = rng.standard_normal((BLOCK, _N)), rng.standard_normal((BLOCK, 2))
        Phi, process, noise = self._truth_model
        x, z = np.array(truth, dtype=np.float64), np.empty((steps, 2))
        measured((Phi, process, H, noise), block * BLOCK, w, v, x, z)
        z[~H[:steps].any(axis=(1, 2))] = 0
        resolution = _VALUE["resolution of measurements"]
        return np.rint(z / resolution) * resolution, x


def _earth_velocity(years: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Earth's velocity on a circle, (k, 2), north and east as seen at IM Pegasi, over its mean."""
    ra, dec, tilt = (
        math.radians(_VALUE[name])
        for name in ("right ascension of IM Pegasi", "declination of IM Pegasi", "obliquity of the ecliptic")
    )
    longitude = 2 * math.pi * (years % 1)
    x, y = -np.sin(longitude), np.cos(longitude)
    velocity = np.stack([x, y * math.cos(tilt), y * math.sin(tilt)], axis=1)
    north = np.array([-math.sin(dec) * math.cos(ra), -math.sin(dec) * math.sin(ra), math.cos(dec)])
    east = np.array([-math.sin(ra), math.cos(ra), 0.0])
    return np.asarray(np.einsum("kj,ij->ki", velocity, np.stack([north, east])))


def _short(values: NDArray[np.float64], base: int) -> NDArray[Any]:
    """Return the nearest numbers of 14 bits or 4 decimal digits, via 9 digits that are the same on every machine."""
    found = [STORED[base].round(f"{value:.9g}") for value in values.flat]
    return np.array(found, dtype=object).reshape(values.shape)


# -- the settings of the study, and what a year tells --------------------------------------------------

#: The settings of the sweep, the model with the report's timing, and with one choice changed.
SETTINGS = {
    "mission": Mission(),
    "no occultation": Mission(occultation=False),
    "no annual aberration": Mission(annual=False),
    "white noise only": Mission(flicker=False),
    "known roll phase": Mission(roll_phase=False),
    "a tenth of the readout noise": Mission(quiet=10.0),
    "steps and roll as flown": Mission(flown=True),
}
