"""Every name, label and reference line in the figures of roll and deroll belongs to the data it stands at.

The results are made up and the densities are computed here from their formulas, so that no curve agrees by chance.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawn import BLUE, GREEN, GREY, ORANGE, PURPLE, at, legend_of, look, named, near, points_of, spans_of

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.style import bits_colour
from gpbnb.report.rolling import experiment, figures
from gpbnb.report.rolling.experiment import LowPass
from gpbnb.report.rolling.spectra import Slope, Spectra, Spectrum

YEAR = 365 * 86400


def flicker(level, f, interval):
    return np.pi * level * interval / abs(np.sin(np.pi * np.abs(f) * interval))


def ramp(drift, duration, f):
    """Of the jump at the end of the record and of its slope: k²T³/2 (j0² + j1²)."""
    z = np.pi * np.abs(np.where(f == 0, 1e-30, f)) * duration
    j0 = np.sin(z) / z
    j1 = np.where(z < 1e-3, z / 3, np.sin(z) / z**2 - np.cos(z) / z)
    return (drift / YEAR) ** 2 * duration**3 / 2 * (j0**2 + j1**2)


@pytest.fixture
def found():
    offset = np.arange(-6, 7)
    rng = np.random.default_rng(7)
    return Spectra(
        drift=6600.0,
        level=500.0,
        period=80.0,
        duration=2.0e7,
        interval=8.0,
        ramp=Spectrum(np.array([1e-6, 1e-4, 1e-2]), np.array([3e9, 3e5, 31.0]), np.array([4.0, 9, 16])),
        noise=Spectrum(np.array([2e-6, 2e-4, 2e-2]), np.array([5e8, 5e6, 5e4]), np.array([4.0, 9, 16])),
        derolled=Spectrum(np.array([3e-6, 3e-4, 3e-2]), np.array([1.0, 2, 3]), np.array([4.0, 9, 16])),
        offset=offset,
        line_signal=rng.uniform(1e9, 2e9, 13),
        line_noise=rng.uniform(1e4, 2e4, 13),
        base_signal=np.array([9e9, 8e9, 7e9]),
        base_noise=np.array([3e4, 4e4, 5e4]),
    )


def test_density(ax):
    spectrum = Spectrum(np.array([1e-3, 1e-2, 1e-1]), np.array([7.0, 5.0, 3.0]), np.array([4.0, 16.0, 25.0]))
    measured, line = figures.density(spectrum, 0.02, Slope(-1.2345, 0.0678, 2.0), ax)
    assert points_of(measured) == [(1e-3, 7.0), (1e-2, 5.0), (1e-1, 3.0)]
    assert spans_of(measured) == pytest.approx([2 / 2 * 7, 2 / 4 * 5, 2 / 5 * 3])
    assert (look(measured)[0], look(line)) == (BLUE, (GREEN, "-", ""))
    assert at(line, (1e-3, 20.0), (1e-2, 2.0), (1e-1, 0.2))
    ((text, beside),) = named(ax).items()
    assert text == "$A/f$; measured slope −1.234 ± 0.068"  # the value and its standard error, in this order
    assert near(beside, GREEN, (1e-2, 2.0))
    assert (measured.get_label(), line.get_label()) == ("measured", "$A/f$")


def test_residual(ax):
    spectrum = Spectrum(np.array([1e-3, 1e-2, 4e-2]), np.array([70.0, 5.0, 3.0]), np.array([4.0, 16.0, 25.0]))
    measured, one = figures.residual(spectrum, 0.02, 10.0, ax)
    assert [y for _, y in points_of(measured)] == pytest.approx(
        spectrum.density / flicker(0.02, spectrum.frequency, 10.0)
    )
    assert spans_of(measured) == pytest.approx([1, 0.5, 0.4])
    assert (look(measured)[0], look(one)[0], set(one.get_ydata())) == (BLUE, GREEN, {1})
    assert [measured.get_label(), one.get_label()] == ["measured", "expected for the samples"]


def test_before_rolling(ax, found):
    noise, drift, noise_line, drift_line, printed = figures.before_rolling(found, ax)
    assert (look(noise), points_of(noise)[1]) == ((BLUE, "", "o"), (2e-4, 5e6))
    assert (look(drift), points_of(drift)[1]) == ((PURPLE, "", "s"), (1e-4, 3e5))
    assert (noise.get_label(), drift.get_label()) == ("noise", "drift")
    f = np.array(noise_line.get_xdata())
    assert (f[0], f[-1]) == pytest.approx((1 / 2.0e7, 0.5 / 8.0))
    assert noise_line.get_ydata() == pytest.approx(flicker(500.0, f, 8.0))
    assert drift_line.get_ydata() == pytest.approx(ramp(6600.0, 2.0e7, f), rel=1e-6)
    assert (look(noise_line), look(drift_line)) == ((GREEN, "-", ""), (GREEN, "-", ""))
    low = np.array(printed.get_xdata())
    assert low[-1] < 30 / 2.0e7 < low[-1] * 1.1
    assert printed.get_ydata() == pytest.approx((6600.0 / YEAR) ** 2 / (2 * np.pi * low) ** 4)
    assert (look(printed), printed.get_label()) == ((ORANGE, "--", ""), "drift as printed")
    names = named(ax)
    middle = float(f[150])
    assert near(names.pop("noise"), BLUE, (middle, flicker(500.0, middle, 8.0)))
    assert near(names.pop("drift"), PURPLE, (middle, float(drift_line.get_ydata()[150])))
    assert near(names.pop(r"drift as printed, $k^2/\omega^4$"), ORANGE, points_of(printed)[-1])
    assert not names


def test_after_rolling(ax, found):
    noise, drift, noise_line, left, right = figures.after_rolling(found, ax)
    assert (look(noise), points_of(noise)[2]) == ((BLUE, "", "o"), (2e-2, 5e4))
    assert look(drift) == (PURPLE, "", "s")
    assert drift.get_xdata() == pytest.approx(1 / 80 + np.arange(-6, 7) / 2.0e7)
    assert np.array_equal(drift.get_ydata(), found.line_signal)
    f = np.array(noise_line.get_xdata())
    assert noise_line.get_ydata() == pytest.approx(flicker(500.0, f, 8.0))
    for line, side in ((left, -1), (right, 1)):
        distance = side * (np.array(line.get_xdata()) - 1 / 80)
        assert (distance > 0).all()
        assert line.get_ydata()[:50] == pytest.approx(ramp(6600.0, 2.0e7, distance[:50]) / 4, rel=1e-4)
        assert look(line) == (GREEN, "-", "")
    names = named(ax)
    assert near(names.pop("noise"), BLUE, (float(f[100]), flicker(500.0, f[100], 8.0)))
    assert near(names.pop("drift, rolled"), PURPLE, (1 / 80, float(found.line_signal.max())))
    assert not names


def test_around_roll(ax, found):
    noise, drift, noise_line, drift_line = figures.around_roll(found, ax)
    assert (look(noise), look(drift)) == ((BLUE, "", "o"), (PURPLE, "", "s"))
    assert points_of(noise) == list(zip(found.offset, found.line_noise, strict=True))
    assert points_of(drift) == list(zip(found.offset, found.line_signal, strict=True))
    assert (noise.get_label(), drift.get_label()) == ("noise", "drift, rolled")
    x = np.array(noise_line.get_xdata())
    assert (x[0], x[-1]) == (-6, 6)
    assert noise_line.get_ydata() == pytest.approx(flicker(500.0, 1 / 80 + x / 2.0e7, 8.0))
    assert drift_line.get_ydata() == pytest.approx(ramp(6600.0, 2.0e7, x / 2.0e7) / 4, rel=1e-6)
    names = named(ax)
    assert near(names.pop("drift, rolled"), PURPLE, (0, float(found.line_signal.max())))
    assert near(names.pop("noise"), BLUE, (0, float(found.line_noise.mean())))
    assert not names


def test_at_base(ax, found):
    noise, drift, noise_line, drift_line = figures.at_base(found, ax)
    assert (look(noise), points_of(noise)) == ((BLUE, "", "o"), [(1, 3e4), (2, 4e4), (3, 5e4)])
    assert (look(drift), points_of(drift)) == ((PURPLE, "", "s"), [(1, 9e9), (2, 8e9), (3, 7e9)])
    x = np.array(noise_line.get_xdata())
    expected = (flicker(500.0, 1 / 80 - x / 2.0e7, 8.0) + flicker(500.0, 1 / 80 + x / 2.0e7, 8.0)) / 2
    assert noise_line.get_ydata() == pytest.approx(expected)
    assert drift_line.get_ydata() == pytest.approx(ramp(6600.0, 2.0e7, x / 2.0e7), rel=1e-6)
    names = named(ax)
    assert near(names.pop("drift, derolled"), PURPLE, (1, 9e9))
    assert near(names.pop("noise, derolled"), BLUE, (3, 3e4))
    assert not names


def test_trace(ax):
    pair, clean = np.array([1 + 5j, 2 + 6j]), np.array([1.5 + 5.5j, 2.5 + 6.5j])
    x, x_line, y, y_line = figures.trace(np.array([0.0, 3.0]), pair, clean, "(5)", ax)
    assert (x.get_label(), look(x)[0], points_of(x)) == ("x", BLUE, [(0, 1), (3, 2)])
    assert (y.get_label(), look(y)[0], points_of(y)) == ("y", PURPLE, [(0, 5), (3, 6)])
    assert [points_of(line) for line in (x_line, y_line)] == [[(0, 1.5), (3, 2.5)], [(0, 5.5), (3, 6.5)]]
    assert {look(line) for line in (x_line, y_line)} == {(GREEN, "-", "")}
    ax.clear()
    assert len(figures.trace(np.array([0.0, 3.0]), pair, None, "(5)", ax)) == 2


def test_drift_errors(ax):
    errors = np.stack([np.full((3, 2), size) for size in (9.0, 0.5, 0.25)])
    study = experiment.DriftStudy((None, 60.0, 240.0), 500.0, 4_000_000, 8.0, errors)
    simulated, line, unrolled, level, frame = figures.drift_errors(study, ax)
    assert (look(simulated)[0], points_of(simulated)) == (BLUE, [(60, 0.5), (240, 0.25)])
    assert spans_of(simulated) == pytest.approx([2 * 0.5 / math.sqrt(12), 2 * 0.25 / math.sqrt(12)])
    periods, duration = np.array(line.get_xdata()), 3.2e7
    assert (periods[0], periods[-1]) == pytest.approx((40, 360))
    expected = [math.sqrt(6 * flicker(500.0, 1 / p, 8.0) / duration**3) * YEAR for p in periods]
    assert line.get_ydata() == pytest.approx(expected)
    assert (look(line), look(unrolled)[:2], look(level)[:2], look(frame)[:2]) == (
        (GREEN, "-", ""),
        (BLUE, ":"),
        (GREEN, "-"),
        (GREY, ":"),
    )
    rest = math.sqrt(8 * 500.0) / duration * YEAR
    assert [each.get_ydata()[0] for each in (unrolled, level, frame)] == pytest.approx([9.0, rest, 40.0])
    assert [each.get_label() for each in (simulated, line, unrolled, level, frame)] == [
        "simulated, rolled",
        r"$\sqrt{6S(f_r)/T^3}$",
        "simulated, not rolled",
        r"$\sqrt{8A}/T$",
        "frame dragging",
    ]
    names = named(ax)
    assert near(names.pop(r"theory, $\sqrt{6S(f_r)/T^3}$"), GREEN, points_of(line)[60])
    assert near(names.pop("simulated"), BLUE, (60, 0.5))
    assert near(names.pop("frame dragging itself, 40 mas a year"), GREY, (60, 40))
    assert near(names.pop(r"not rolled: simulated (dotted), and $\sqrt{8A}/T$"), GREEN, (60, rest))
    assert not names


def test_bandwidths(ax):
    squares = np.array([[1.0, 3.0], [4.0, 6.0], [9.0, 11.0], [16.0, 20.0]])
    study = experiment.FilterStudy(
        6600.0,
        80.0,
        (LowPass.SINGLE_POLE, LowPass.MOVING_AVERAGE) * 2,
        np.ones(4),
        np.array([1e-5, 2e-5, 3e-5, 4e-5]),
        squares,
    )
    pole, average, both, lag, noise, optimum = figures.bandwidths(study, 1e5, ax)
    assert points_of(pole) == [(1e-5, pytest.approx(math.sqrt(2))), (3e-5, pytest.approx(math.sqrt(10)))]
    assert points_of(average) == [(2e-5, pytest.approx(math.sqrt(5))), (4e-5, pytest.approx(math.sqrt(18)))]
    assert (look(pole), look(average)) == ((BLUE, "", "o"), (PURPLE, "", "s"))
    assert (pole[0].get_markerfacecolor(), average[0].get_markerfacecolor()) == (BLUE, "none")
    # Two standard errors of a mean square, halved for its root: of 1 and 3, 1 / √2.
    assert spans_of(pole)[0] == pytest.approx(1 / math.sqrt(2))
    b, slope = np.array(lag.get_xdata()), 6600.0 / YEAR
    assert (b[0], b[-1]) == pytest.approx((1e-5 / 1.5, 6e-5))
    assert lag.get_ydata() == pytest.approx(slope / (4 * b))
    assert noise.get_ydata() == pytest.approx(np.sqrt(1e5 * b))
    assert both.get_ydata() == pytest.approx(np.hypot(slope / (4 * b), np.sqrt(1e5 * b)))
    assert optimum.get_xdata()[0] == pytest.approx((slope**2 / 8e5) ** (1 / 3))
    assert [look(each)[:2] for each in (both, lag, noise, optimum)] == [
        (GREEN, "-"),
        (GREY, "-"),
        (GREY, "-"),
        (GREY, ":"),
    ]
    assert [each.get_label() for each in (pole, average, both, lag, noise, optimum)] == [
        "single pole",
        "moving average",
        "lag and noise",
        "lag",
        "noise in band",
        "optimum",
    ]
    names, high = named(ax), ax.get_ylim()[1]
    assert near(names.pop("best $B$"), GREY, (optimum.get_xdata()[0], high))
    best = optimum.get_xdata()[0]
    assert near(names.pop("lag"), GREY, (best, slope / (4 * best)))
    assert near(names.pop("noise in band"), GREY, (best, math.sqrt(1e5 * best)))
    assert near(names.pop("theory"), GREEN, points_of(both)[30])
    assert legend_of(ax) == ["single pole", "moving average"]
    assert not names


def test_resets(ax):
    errors = np.array([[1.0, -2.0, 2.0], [3.0, 3.0, -3.0]])
    points, line, never, free = figures.resets([6000.0, 60000.0], errors, 6600.0, 1e-22, 7.0, ax)
    assert points_of(points) == [(6000, pytest.approx(math.sqrt(3))), (60000, pytest.approx(3))]
    assert spans_of(points) == pytest.approx([2 * math.sqrt(3 / 6), 2 * 3 / math.sqrt(6)])
    x = np.array(line.get_xdata())
    assert (x[0], x[-1]) == pytest.approx((4000, 90000))
    assert line.get_ydata() == pytest.approx(6600.0 * x / 2 * math.sqrt(38 / 35 * 1e-22 * YEAR))
    without = 6600.0 * math.sqrt(383 / 1260 * 1e-22 * YEAR**3)
    assert (never.get_ydata()[0], free.get_ydata()[0]) == pytest.approx((7.0, without))
    assert [look(each)[:2] for each in (line, never, free)] == [(GREEN, "-"), (BLUE, ":"), (GREEN, "-")]
    assert [each.get_label() for each in (points, line, never, free)] == [
        "simulated",
        "theory",
        "simulated, never reset",
        "theory, never reset",
    ]
    names = named(ax)
    assert near(names.pop("theory"), GREEN, points_of(line)[25])
    assert near(names.pop("simulated"), BLUE, (6000, math.sqrt(3)))
    assert near(names.pop("never reset: simulated (dotted) and theory"), GREEN, (4000, min(7.0, without)))
    assert not names


def test_rotations(ax):
    def result(digits, size, bound):
        step = np.array([1, 1000, 100_000])
        return experiment.Rotation(
            FloatFormat(10, digits), 80.0, 8.0, "direct", step, np.ones(3), np.ones(3), np.array(size), np.array(bound)
        )

    results = [result(5, [1e-5, 0.0, 2e-4], [1e-4, 1e-3, 3.0]), result(9, [1e-9, 2e-9, 3e-9], [1e-8, 1e-7, 1e-6])]
    points, bound, others, other_bound, one = figures.rotations(results, 6600.0, ax, "title")
    few, many = (bits_colour(each.fmt) for each in results)
    mas = 6600.0 * 8.0 / YEAR  # a step
    days = 8.0 / 86400
    assert at(points, (days, mas * 1e-5), (1e5 * days, 1e5 * mas * 2e-4))  # none at zero
    assert at(bound, (days, mas * 1e-4), (1e3 * days, 1e3 * mas * 1e-3))  # none above two
    assert [x for x, _ in points_of(others)] == pytest.approx([days, 1e3 * days, 1e5 * days])
    assert [look(each)[0] for each in (points, bound, others, other_bound, one)] == [few, GREEN, many, GREEN, GREY]
    assert [points.get_label(), others.get_label()] == ["5 decimal digits", "9 decimal digits"]
    assert set(one.get_ydata()) == {1}
    names = named(ax)
    assert near(names.pop("5 decimal digits"), few, (1, 1e5 * mas * 2e-4))
    assert near(names.pop("9 decimal digits"), many, (1, 1e5 * mas * 3e-9))
    assert near(names.pop("1 mas"), GREY, (1, 1))
    assert not names


def test_phase_costs(ax):
    angle, found = np.radians([0.01, 1.0]), np.array([[3.0, -5.0], [-7.0, 11.0]])
    geodetic, theory_x, frame, theory_y, one = figures.phase_costs(angle, found, (6600.0, 40.0), ax)
    assert at(geodetic, (0.01, 3), (1, 7))
    assert at(frame, (0.01, 5), (1, 11))
    a = np.radians(theory_x.get_xdata())
    expected = (6600 + 40j) * (np.exp(1j * a) - 1)
    assert theory_x.get_ydata() == pytest.approx(abs(expected.real))
    assert theory_y.get_ydata() == pytest.approx(abs(expected.imag))
    assert [look(each) for each in (geodetic, theory_x, frame, theory_y)] == [
        (BLUE, "", "o"),
        (GREEN, "-", ""),
        (PURPLE, "", "o"),
        (GREEN, "-", ""),
    ]
    assert (set(one.get_ydata()), look(one)[:2]) == ({1}, (GREY, ":"))
    assert [geodetic.get_label(), frame.get_label()] == ["geodetic\ndrift", "frame\ndragging"]
    names = named(ax)
    assert near(names.pop("geodetic\ndrift"), BLUE, (1, abs(expected[-1].real)))
    assert near(names.pop("frame\ndragging"), PURPLE, (1, abs(expected[-1].imag)))
    assert near(names.pop("1 mas a year"), GREY, (1, 1))
    assert not names
