"""gpbnb.report.rolling.figures: what is drawn is the result, beside theory; axes have quantity and unit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from drawn import colour, names_of
from matplotlib.container import ErrorbarContainer

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display import style
from gpbnb.report.ledger.checks.rolling import material
from gpbnb.report.rolling import experiment, figures, theory


@pytest.fixture
def ax(ax):
    yield ax
    for name in (ax.get_xlabel(), ax.get_ylabel()):
        assert re.search(r"\(.+\)$| / ", name)  # a unit, or a ratio


def xy(artist):
    line = artist[0] if isinstance(artist, ErrorbarContainer) else artist
    return line.get_xdata(), line.get_ydata()


def theory_lines(artists):
    return [a for a in artists if not isinstance(a, ErrorbarContainer) and colour(a) == style.VALID]


def test_density_and_residual(ax):
    found, slope = material.noise_spectrum()
    measured, line = figures.density(found, theory.LEVEL, slope, ax)
    assert np.array_equal(xy(measured), (found.frequency, found.density))
    assert np.array_equal(xy(line)[1], theory.LEVEL / found.frequency)
    bars = [np.ptp(each[:, 1]) / 2 for each in measured[2][0].get_segments()]
    assert bars == pytest.approx(2 * found.error * found.density)
    assert f"slope {slope.value:.3f}".replace("-", "−") in ax.texts[0].get_text()
    ax.clear()
    measured, one = figures.residual(found, theory.LEVEL, 10.0, ax)
    expected = theory.flicker_density(theory.LEVEL, found.frequency, 10.0)
    assert np.array_equal(xy(measured)[1], found.density / expected)
    assert list(one.get_ydata()) == [1, 1]


def test_spectra(ax):
    found = material.spectra()
    noise, drift, *lines, printed = figures.before_rolling(found, ax)
    assert colour(printed) == style.REFUTED
    assert np.array_equal(xy(printed)[1], theory.printed_ramp_density(found.drift, xy(printed)[0]))
    assert names_of(ax) == ["noise", "drift", r"drift as printed, $k^2/\omega^4$"]
    assert np.array_equal(xy(noise), (found.noise.frequency, found.noise.density))
    assert np.array_equal(xy(drift), (found.ramp.frequency, found.ramp.density))
    assert len(theory_lines(lines)) == 2
    for function, points, offset in (
        (figures.after_rolling, found.line_signal, 1),
        (figures.around_roll, found.line_signal, 1),
        (figures.at_base, found.base_signal, 1),
    ):
        ax.clear()
        artists = function(found, ax)
        assert np.array_equal(xy(artists[offset])[1], points)
        assert len(theory_lines(artists)) >= 2
        assert any("drift" in text for text in names_of(ax))


def test_the_lines_pass_through_the_points(ax):
    found = material.spectra()
    _, drift, noise_line, drift_line = figures.at_base(found, ax)
    x, y = xy(drift)
    assert np.interp(x[:4], *xy(drift_line)) == pytest.approx(y[:4], rel=0.02)
    assert np.mean(xy(noise_line)[1]) == pytest.approx(np.mean(found.base_noise), rel=0.4)
    near = np.abs(found.offset) <= 5
    ax.clear()
    *_, drift_line = figures.around_roll(found, ax)
    there = np.interp(found.offset[near], *xy(drift_line))
    assert there == pytest.approx(found.line_signal[near], rel=0.02)
    ax.clear()
    *_, left, right = figures.after_rolling(found, ax)
    for line, side in ((left, -1), (right, 1)):
        x, y = xy(line)
        distance = side * (x - 1 / found.period) * found.duration
        chosen = near & (side * found.offset > 0)
        there = np.interp(np.abs(found.offset[chosen]), distance, y)
        assert there == pytest.approx(found.line_signal[chosen], rel=0.05)  # between the points of the line, too


def test_trace(ax):
    found = material.stages()
    t = np.arange(1200) / 360
    x, line_x, y, line_y = figures.trace(t, found["derolled"], found["signal"], "(7)", ax)
    assert np.array_equal(xy(x)[1], found["derolled"].real)
    assert np.array_equal(xy(y)[1], found["derolled"].imag)
    assert np.array_equal(xy(line_x)[1], found["signal"].real)
    assert np.array_equal(xy(line_y)[1], found["signal"].imag)
    assert ax.get_title(loc="left") == "(7)"


def test_drift_errors(ax):
    study = experiment.survey()
    artists = figures.drift_errors(study, ax)
    assert np.array_equal(xy(artists[0]), (study.periods[1:], study.standard_error()[1:]))
    line = xy(artists[1])
    expected = [theory.drift_error_rolled(study.level, p, theory.YEAR, study.interval) for p in line[0]]
    assert list(line[1]) == expected
    assert list(artists[2].get_ydata()) == [study.standard_error()[0]] * 2
    assert list(artists[3].get_ydata()) == [theory.drift_error_unrolled(study.level, at_rest=True)] * 2


def test_bandwidths(ax):
    study = material.filter_study()
    pole, average, line, lag, noise, _ = figures.bandwidths(study, theory.FLOWN_DENSITY, ax)
    assert ax.get_ylim()[0] == pytest.approx(0.3 * np.sqrt(study.error.min()))
    assert xy(line)[1] == pytest.approx(np.hypot(xy(lag)[1], xy(noise)[1]), rel=1e-13)
    assert np.array_equal(xy(pole), (study.bandwidth[:3], np.sqrt(study.error[:3])))
    assert np.array_equal(xy(average), (study.bandwidth[3:], np.sqrt(study.error[3:])))
    assert xy(line)[1].min() == pytest.approx(
        theory.filtered_error(
            study.drift, theory.FLOWN_DENSITY, theory.best_bandwidth(study.drift, theory.FLOWN_DENSITY)
        )
        ** 0.5,
        rel=1e-3,
    )


def test_resets(ax):
    errors = np.array([[1.0, -2.0, 2.0], [3.0, 3.0, -3.0]])
    points, line, never, free = figures.resets([6000.0, 60000.0], errors, 6600.0, material.WALK, 7.0, ax)
    assert xy(points)[1] == pytest.approx([3**0.5, 3.0])
    x, y = xy(line)
    assert y == pytest.approx([theory.rate_walk_error(6600.0, material.WALK, reset=r) for r in x])
    assert list(never.get_ydata()) == [7.0, 7.0]
    assert list(free.get_ydata()) == [theory.rate_walk_error(6600.0, material.WALK)] * 2


def test_rotations(ax):
    results = [experiment.recursion(FloatFormat(10, t), 77.5, [1, 10, 300]) for t in (6, 8)]
    artists = figures.rotations(results, 6600.0, ax, "recursion")
    for i, result in enumerate(results):
        scale = 6600.0 * result.step * 10 / theory.YEAR
        assert xy(artists[2 * i])[1] == pytest.approx(scale * result.size, rel=1e-12, abs=0)
        assert xy(artists[2 * i + 1])[1] == pytest.approx(scale * result.bound, rel=1e-12, abs=0)
    assert set(names_of(ax)) == {"6 decimal digits", "8 decimal digits", "1 mas"}


def test_phase_costs(ax):
    angle = np.radians([0.01, 1.0])
    found = np.array([theory.phase_error_cost(theory.DRIFTS, a) for a in angle])
    artists = figures.phase_costs(angle, found, theory.DRIFTS, ax)
    assert xy(artists[0])[1] == pytest.approx(abs(found[:, 0]))
    assert xy(artists[2])[1] == pytest.approx(abs(found[:, 1]))
    assert xy(artists[3])[1][-1] == pytest.approx(abs(found[-1, 1]))
