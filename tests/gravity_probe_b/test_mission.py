"""gravity_probe_b.mission: the known signal against the sky, and a filter that finds out what the signal shows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.filters.forms import Form
from gpbnb.filters.run import Run
from gpbnb.filters.simulation import BLOCK
from gpbnb.report.gravity_probe_b import mission, threshold
from gpbnb.report.gravity_probe_b.mission import STATES, Mission

YEAR = np.linspace(0, 3_153_600, 2001).astype(np.int64)


def test_noises_keep_the_variances_of_pointing_and_of_flicker():
    """A Gauss-Markov process of variance v has noise v (1 - phi²) per step; numbers are stored in four digits."""
    model = Mission().model(10)
    variances = dict.fromkeys((4, 5), mission._VALUE["pointing, standard deviation"] ** 2)
    variances |= dict.fromkeys((10, 11, 12), mission._VALUE["1/f readout noise per decade of time constants"] ** 2)
    Phi, Q = model.Phi[0], model.Q[0]
    for state, variance in variances.items():
        assert 0 < Phi[state, state] < 1
        kept = float(Phi[state, state]) ** 2 * variance + float(Q[state, state])
        assert kept == pytest.approx(variance, rel=2e-4)


def test_annual_aberration_is_the_ellipse_of_the_star_s_latitude():
    both, orbit = (Mission(annual=annual).known_signal(YEAR) for annual in (True, False))
    ellipse = (both - orbit) / 20.5
    axes = np.sqrt(np.linalg.eigvalsh(np.cov(ellipse.T)) * 2)
    ra, dec, tilt = (math.radians(each) for each in (343.259, 16.841, 23.44))
    latitude = math.asin(math.sin(dec) * math.cos(tilt) - math.cos(dec) * math.sin(tilt) * math.sin(ra))
    # Two thousand samples of a year.
    assert axes == pytest.approx([math.sin(latitude), 1], rel=2e-3)


@pytest.mark.parametrize(
    ("quarter", "apex"),
    [(0, (90, 23.44)), (1, (180, 0)), (2, (270, -23.44)), (3, (0, 0))],
    ids=["September", "December", "March", "June"],
)
def test_the_earth_flies_to_where_the_sun_was_three_months_ago(quarter, apex):
    """The model's year starts at the September equinox: the Sun is at 12 h, the Earth flies toward 6 h."""
    ra, dec, star_ra, star_dec = (math.radians(each) for each in (*apex, 343.259, 16.841))
    north = math.sin(dec) * math.cos(star_dec) - math.cos(dec) * math.sin(star_dec) * math.cos(ra - star_ra)
    east = math.cos(dec) * math.sin(ra - star_ra)
    steps = np.array([round(quarter / 4 * 365 * 86400 / 10)])
    moved = Mission().known_signal(steps) - Mission(annual=False).known_signal(steps)
    assert moved[0] == pytest.approx([20.5 * north, 20.5 * east], abs=1e-3)


def test_the_orbit_moves_the_star_north_and_south_only():
    steps = np.arange(1, 2000)
    signal = Mission(annual=False).known_signal(steps)
    drift = np.outer(steps * 10 / (365 * 86400), [6.6061, 0.0392])
    assert np.abs(signal[:, 0] - drift[:, 0]).max() == pytest.approx(5.2, rel=1e-4)
    assert signal[:, 1] == pytest.approx(drift[:, 1], abs=1e-15)


def test_the_earth_hides_the_star_for_a_third_of_each_orbit():
    mission = Mission()
    _, orbit = mission.phases(np.arange(1, 5860))  # ten orbits
    hidden = 1 - mission.visible(orbit).mean()
    assert hidden == pytest.approx(2 * math.asin(6378 / 7020) / (2 * math.pi), abs=2e-3)
    H = mission.matrices(0, 2)
    assert (H[:, 0].any(axis=1) == mission.visible(mission.phases(np.arange(1, BLOCK + 1))[1])).all()
    assert Mission(occultation=False).matrices(0, 2).any(axis=(1, 2)).all()


def test_the_scale_factor_and_the_roll_phase_multiply_the_rolled_signal():
    """For a signal (N, E) of up to 26 arcsec: Nc + Es and Ec - Ns, where c and s have errors of 2**-13."""
    mission = Mission(occultation=False)
    H, (north, east) = mission.matrices(300, 2)[:, 0], mission.known_signal(300 * BLOCK + 1 + np.arange(BLOCK)).T
    c, s = H[:, 0], H[:, 1]
    assert np.ptp(c) == np.ptp(s) == 2
    assert H[:, 6] == pytest.approx(north * c + east * s, abs=52 * 2.0**-13)
    assert H[:, 7] == pytest.approx((east * c - north * s) * mission.roll_phase, abs=52 * 2.0**-13)


def test_the_telescope_measures_pointing_and_the_gyro_the_drift_as_well():
    """With the cosine and sine of the roll phase, and a bias each; the telescope knows nothing of drift and signal."""
    mission = Mission(occultation=False)
    H = mission.matrices(5, 2)
    turn, _ = mission.phases(5 * BLOCK + 1 + np.arange(BLOCK))
    states = [state for state, _ in STATES]
    c, s, one = np.cos(turn), np.sin(turn), np.ones(BLOCK)
    gyro = {0: c, 1: s, 4: c, 5: s, 8: one, 9: one}
    telescope = {4: c, 5: s, 9: one}
    for row, columns in ((0, gyro), (1, telescope)):
        for at in [*range(6), 8, 9, *(range(6, len(states)) if row else ())]:
            assert H[:, row, at] == pytest.approx(columns.get(at, 0 * one), abs=2.0**-13), (row, states[at])


def test_while_the_star_is_hidden_no_estimate_learns():
    mission = replace(Mission(), flicker=False)
    run = Run(mission.model(2), FloatFormat(2, 30), Form.INNOVATION, ())
    H = mission.matrices(0, 2)
    hidden = H[~H.any(axis=(1, 2))][:20]
    run.use_measurement_matrices(hidden)
    assert (run.carry(np.zeros((20, 2, 1)), 4) == 0).all()


def test_the_filter_finds_scale_and_roll_phase_by_the_aberration():
    mission = Mission(deviations=True, quiet=10.0)
    cell = threshold.YearCell("a tenth of the readout noise", "deviation", 2, "nearest", "hung", (40,), count=4)
    lockstep = threshold.Lockstep(cell, 2 * BLOCK)
    for block in range(2):
        lockstep.advance(block)
    reference = lockstep.reference
    deviation = np.sqrt(np.diagonal(reference.P))
    start = np.sqrt(mission.model(2).P0.diagonal().astype(float))
    for name in ("scale factor k", "roll-phase offset δ"):
        at = [state for state, _ in STATES].index(name)
        assert (
            deviation[at] < start[at] / 5
        )  # within a day, beside 1/f noise that is eight times the white one at 600 s
        # Four records: a difference of five standard deviations is a fault.
        assert np.abs(reference.x[at] - lockstep.truth[:, at]).max() < 5 * deviation[at]
    assert lockstep.largest.max() < 0.1


def test_measurements_are_whole_multiples_of_their_resolution(monkeypatch):
    given = Mission()
    H, truth = given.matrices(0, 2), np.array(given.start)
    fine, _ = given.measurements(0, 0, truth, H, 200)
    assert mission._VALUE["resolution of measurements"] == 1
    monkeypatch.setitem(mission._VALUE, "resolution of measurements", 0.25)
    coarse, _ = given.measurements(0, 0, truth, H, 200)
    assert np.array_equal(coarse * 4, np.rint(coarse * 4))
    assert not np.array_equal(coarse, np.rint(coarse))
    assert np.abs(coarse - fine).max() == 0.5
