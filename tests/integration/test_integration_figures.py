"""gpbnb.report.integration.figures and tables: what is shown is the result; axes say what it is and in which unit."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import GREY, named
from matplotlib.patches import Circle, Rectangle
from tabulated import by_header

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display import style
from gpbnb.report.integration import experiment, figures, tables, theory


def line(ax, label):
    (found,) = [each for each in ax.lines if each.get_label() == label]
    return found


def check_labels(ax, x, y):
    assert x in ax.get_xlabel()
    assert y in ax.get_ylabel()


def test_block_diagram(ax):
    artists = figures.block_diagram(ax)
    words = " ".join(text.get_text() for text in ax.texts)
    for part in ("n_{p1}", "omega_{bw}", "exact integral", "trapezoidal", "$x_2$", "$e_n$", "−", "+"):
        assert part in words
    boxes = [a for a in artists if isinstance(a, Rectangle)]
    sums = [a for a in artists if isinstance(a, Circle)]
    assert (len(boxes), len(sums)) == (4, 2)
    # Every text is within its box, or beside all of them.
    ax.figure.canvas.draw()
    inside = [
        text
        for text in ax.texts
        for box in boxes
        if box.contains_point(text.get_transform().transform(text.get_position()))
    ]
    assert len(inside) == 4
    for text, box in zip(inside, boxes, strict=True):
        extent, frame = text.get_window_extent(), box.get_window_extent()
        assert frame.x0 < extent.x0 < extent.x1 < frame.x1


def test_accuracy(ax):
    mu = [1e-9, 1e-2, 10.0]
    results = {"printed": experiment.accuracy("walk", mu, True), "stable": experiment.accuracy("walk", mu)}
    figures.accuracy(results, ax)
    for name, result in results.items():
        assert line(ax, name).get_xdata().tolist() == mu
        assert line(ax, name).get_ydata().tolist() == np.clip(result.ulp, 1e-2, 2.0**53).tolist()
    assert [text.get_text() for text in ax.texts] == ["printed", "stable", "no digit correct"]
    check_labels(ax, "rad", "units in the last place")


def test_the_line_without_digits_is_named_at_the_end_of_the_longer_curve(ax):
    results = {"printed": experiment.accuracy("walk", [1e-9, 1.0], True), "stable": experiment.accuracy("walk", [10.0])}
    figures.accuracy(results, ax)
    assert named(ax)["no digit correct"] == (GREY, (10, 2**53))


def test_approximations(ax):
    figures.approximations(3, ax)
    shown = line(ax, "(39)")
    mu = shown.get_xdata()
    assert shown.get_ydata() == pytest.approx(theory.approximation_ratio(mu) - 1, rel=1e-9, abs=1e-11)
    three = np.sqrt((mu / 6 - mu**3 / 360 + mu**5 / 15120) / theory.walk_factor(mu)) - 1
    drawn = line(ax, "3 terms").get_ydata()
    seen = np.isfinite(drawn)
    assert drawn[seen] == pytest.approx(abs(three)[seen], rel=1e-6, abs=1e-11)
    assert seen[mu < 10].any()
    assert not seen[abs(three) >= 10].any()  # beyond the axis
    assert np.isnan(line(ax, "2 terms").get_ydata()[-1])  # its variance is negative there
    check_labels(ax, "rad", "relative error")


def test_powers(ax):
    figures.powers(ax)
    shown = line(ax, "iteration rate")
    assert shown.get_ydata() == pytest.approx(theory.exponents(shown.get_xdata())[1])
    assert "power of the bandwidth" in [text.get_text() for text in ax.texts]
    flat = sorted(each.get_ydata()[0] for each in ax.lines if each.get_linestyle() == "--")
    assert flat == [-1.0, 0.5]
    check_labels(ax, "rad", "power")


@pytest.fixture(scope="module")
def swept():
    return experiment.sweep([0.01, 1.0, 50.0], 100, 500, np.random.default_rng(1))


def test_random_walk(ax, swept):
    figures.random_walk(swept, ax)
    assert line(ax, "simulation").get_ydata().tolist() == np.sqrt(swept.walk).tolist()
    exact = line(ax, "(35)")
    assert exact.get_ydata() == pytest.approx(np.sqrt(theory.walk_factor(exact.get_xdata())))
    ends = swept.mu.min() / 1.5, swept.mu.max() * 1.5
    assert exact.get_xdata()[[0, -1]] == pytest.approx(ends)
    printed = line(ax, "(39)")
    assert printed.get_ydata() == pytest.approx(np.sqrt(printed.get_xdata() / 6))
    low, high = ax.get_ylim()
    assert low < exact.get_ydata().min()
    assert high > printed.get_ydata().max()
    check_labels(ax, "rad", "sigma_x T")


def test_deviations(ax, swept):
    figures.deviations(swept, ax)
    shown = line(ax, "from (35)")
    assert shown.get_ydata().tolist() == swept.deviations().tolist()
    low, high = ax.get_ylim()
    assert low < min(shown.get_ydata())
    assert max(shown.get_ydata()) < high
    assert 50.0 not in line(ax, "from (39)").get_xdata()
    check_labels(ax, "rad", "standard errors")


def test_build_up(ax):
    n, mu = [1, 10, 100], 0.2
    runs = [
        experiment.simulate(theory.first_order(3.0, 0.4), 2.0, n, np.random.default_rng(2), 50, theory.RULES[name])
        for name in ("trapezoidal", "rectangular, new sample")
    ]
    figures.build_up(runs, mu, ax)
    for run in runs:
        assert line(ax, run.rule.name.split(",")[0]).get_ydata() == pytest.approx(np.sqrt(run.variance) / 1.5)
    exact = line(ax, "exact, trapezoidal")
    assert exact.get_ydata() == pytest.approx(np.sqrt(theory.error_variance(exact.get_xdata(), mu)))
    walk = line(ax, "random walk (35)")
    assert walk.get_ydata()[-1] == pytest.approx(math.sqrt(100 * float(theory.walk_factor(mu))))
    check_labels(ax, "cycles $n$", "sigma_xT")


def test_rules(ax):
    figures.rules_first_order(("trapezoidal", "Simpson"), ax)
    assert line(ax, "trapezoidal").get_ydata() == pytest.approx(np.ones(60))
    mu = line(ax, "Simpson").get_xdata()
    assert line(ax, "Simpson").get_ydata() == pytest.approx(np.sqrt(1 + np.tanh(mu / 2) / 9 / theory.walk_factor(mu)))
    assert np.all(line(ax, "scaled samples (lower bound)").get_ydata() < 1)
    check_labels(ax, "rad", "relative")


def test_rules_resonant(ax):
    figures.rules_resonant(("trapezoidal",), 0.05, ax)
    shown = line(ax, "trapezoidal")
    rate, walk = shown.get_xdata(), shown.get_ydata()
    assert walk[0] ** 2 == pytest.approx(theory.walk_rate(theory.resonant(1.0, 2 * np.pi, 0.05), rate[0]))
    peak = rate[(rate > 0.8) & (rate < 1.2)][np.argmax(walk[(rate > 0.8) & (rate < 1.2)])]
    assert peak == pytest.approx(1, abs=0.02)


@pytest.fixture(scope="module")
def met():
    formats = (FloatFormat(2, 8), FloatFormat(2, 12, Rounding.CHOP))
    return experiment.sweep_rates(64.0, 2.0, formats, [32.0, 128.0], np.random.default_rng(3), 20)


def test_meeting(ax, met):
    figures.errors_over_rate(met, ax)
    assert line(ax, "discretization").get_ydata().tolist() == met.discretization[0].tolist()
    assert line(ax, "rounding, 12 bits, chopped").get_ydata().tolist() == met.rounding[1].tolist()
    theories = [each for each in ax.lines if len(each.get_xdata()) == 40]
    assert len(theories) == 3
    expected = theory.two_errors(1.0, 64.0, 32.0, 2.0, met.formats[0])
    assert theories[0].get_ydata()[0] == pytest.approx(expected.discretization)
    assert theories[1].get_ydata()[0] == pytest.approx(expected.rounding)
    check_labels(ax, "Hz", "unit of $x_1$")


def test_totals(ax, met):
    figures.totals(met, ax)
    assert line(ax, "8 bits").get_ydata().tolist() == met.total[0].tolist()
    best = theory.best_rate(64.0, 2.0, met.formats[0])
    triangles = [each.get_xdata()[0] for each in ax.lines if len(each.get_xdata()) == 1]
    assert (best in triangles) == (32.0 <= best <= 128.0)
    check_labels(ax, "Hz", "total error")


def test_design_figures():
    _, axes = style.figure(columns=2)
    durations = {"1 minute": 60.0, "1 hour": 3600.0}
    figures.best_rates(628.0, durations, [16, 24], axes[0])
    assert line(axes[0], "1 hour").get_ydata()[1] == theory.best_rate(628.0, 3600.0, FloatFormat(2, 24))
    chopped = [each for each in axes[0].lines if each.get_linestyle() == ":"]
    assert math.isnan(chopped[1].get_ydata()[0])  # no rate saves 16 chopped bits for an hour
    check_labels(axes[0], "bits", "Hz")
    figures.needed_bits(628.0, durations, [100.0, 1000.0], axes[1])
    assert line(axes[1], "1 minute").get_ydata()[1] == theory.needed_precision(628.0, 1000.0, 60.0)
    check_labels(axes[1], "Hz", "bits")
    axes[0].figure.canvas.draw()
    plt.close("all")


# -- tables ---------------------------------------------------------------------------------------


def test_sensor_table():
    table = tables.sensor(2.0, 50.0, "m/s", [400.0])
    f_c, mu, exact, printed, excess, hour = table.body[0]
    omega = 2 * math.pi * 50
    assert f_c == "400"
    assert float(mu) == pytest.approx(omega / 400, rel=1e-2)
    assert float(exact) == pytest.approx(theory.random_walk(2.0, omega, 400.0), rel=1e-2)
    assert float(printed) == pytest.approx(theory.printed_random_walk(2.0, omega, 400.0), rel=1e-2)
    assert float(excess) == pytest.approx(float(theory.approximation_ratio(omega / 400)) - 1, rel=0.1)
    assert float(hour) == pytest.approx(60 * theory.random_walk(2.0, omega, 400.0), rel=1e-2)
    assert "m/s/√h" in table.header[-1]


def test_each_walk_of_a_sensor_has_its_column():
    table = tables.sensor(2.0, 50.0, "m/s", [1234.5, 123.4])
    assert table.title == "random walk at 2 rates"
    assert [row["$f_c$, Hz"] for row in by_header(table)] == ["1234.5", "123.4"]
    assert by_header(table)[1] == {
        "$f_c$, Hz": "123.4",
        "$\\mu$, rad": "2.55",
        "(35), m/s/√s": "0.112",
        "(39), m/s/√s": "0.117",
        "(39)/(35) − 1": "0.05",
        "(35), m/s/√h": "6.7",
    }


def test_rules_table():
    process = theory.first_order(1.0, 1.0)
    table = tables.rules([(process, 2.0)])
    ratio = {row[0]: float(row[3]) for row in table.body}
    assert {row[0]: row[2] for row in table.body}["Simpson"] == "2/3, 4/3"
    assert ratio["trapezoidal"] == 1
    walk = theory.walk_rate(process, 2.0, theory.RULES["Boole"]) / theory.walk_rate(process, 2.0)
    assert ratio["Boole"] == pytest.approx(math.sqrt(walk), rel=1e-3)
    assert {row[0]: row[1] for row in table.body}["Boole"] == "4"


def test_each_input_of_the_table_of_rules_has_its_column():
    table = tables.rules([(theory.first_order(1.0, 1.0), 2.0), (theory.resonant(1.0, 2.3456, 0.05), 10.0)])
    assert table.title == "9 rules"
    rows = {row["rule"]: row for row in by_header(table)}
    assert rows["Boole"] == {
        "rule": "Boole",
        "period (cycles)": "4",
        "weights of the samples": "8/15, 28/45, 64/45, 64/45",
        "first order, $|p|T = 0.5$": "1.238",
        "resonant, ζ = 0.05, $|p|T = 0.235$": "1.955",
    }
    assert rows["two speeds, 4 samples"]["weights of the samples"] == "1"


def test_slips_table():
    table = tables.misprints(0.3125, 0.02)
    rows = {row[0]: row for row in table.body}
    assert table.title == "5 misprints"
    assert by_header(table)[0] == {
        "misprint in": "(12)",
        "result as printed / ($\\sigma_x^2T$), at $\\mu = 0.3125$": "-6.348",
        "correct": "0.051999",
        "affects (35)": "yes",
    }
    assert rows["(25)"][-1] == "no"
    assert [place for place, row in rows.items() if row[-1] == "yes"] == ["(12)", "(18)", "(34)", "(37)"]
    assert float(rows["(12)"][1]) == pytest.approx(float(theory.walk_factor(0.3125)) - 2 / 0.3125, rel=1e-3)


def test_design_table():
    table = tables.design(628.0, 3600.0, [16])
    rows = table.body
    assert table.title == "2 formats"
    assert by_header(table)[0] == {
        "format": "16 bits",
        "rounding": "rounded to nearest",
        "best $f_c$, Hz": "7.46e+03",
        "best $f_c$ by closed form, Hz": "9.55e+03",
        "discretization error, s": "0.082",
        "rounding error, s": "0.091",
    }
    assert rows[1] == ("16 bits", "chopped", "none", "", "", "")
    fmt = FloatFormat(2, 16)
    best = theory.best_rate(628.0, 3600.0, fmt)
    assert float(rows[0][2].replace(",", "")) == pytest.approx(best, rel=1e-2)
    assert float(rows[0][5]) == pytest.approx(theory.two_errors(1.0, 628.0, best, 3600.0, fmt).rounding, rel=0.05)


def test_derivative_rules_table():
    table = tables.derivative_rules(2, [2, 3])
    assert table.title == "3 rules with derivatives"
    mu = theory.largest_useful_mu(theory.hermite(2), 3)
    names = ("derivatives", "weights of $T$, $T^2$, …", "2 lags", "3 lags")
    assert by_header(table) == [
        dict(zip(names, ("none (trapezoidal)", "1/2", "1", "1"), strict=True)),
        dict(zip(names, ("1", "1/2, 1/12", "1", "1"), strict=True)),
        dict(zip(names, ("2", "1/2, 1/10, 1/120", "", f"0.55, $\\mu<{mu:.2g}$"), strict=True)),
    ]


def test_least_errors_table():
    table = tables.least_errors([1, 1000], [0.5, 8.0])
    assert table.title == "2 lengths"
    # For one cycle the best weights are those of the trapezoidal rule, by symmetry.
    assert by_header(table)[0] == {"cycles $n$": "1", r"at $\mu = 0.5$": "1.000", r"at $\mu = 8$": "1.000"}
    ratio = [math.sqrt(theory.error_variance(1000, mu) / theory.least_variance(1000, mu)) for mu in (0.5, 8.0)]
    assert by_header(table)[1] == {
        "cycles $n$": "1,000",
        r"at $\mu = 0.5$": f"{ratio[0]:.3f}",
        r"at $\mu = 8$": f"{ratio[1]:.3f}",
    }
