"""gpbnb.report.geometry.figures and tables: what is drawn is the result."""

from __future__ import annotations

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from tabulated import by_header

from gpbnb.report.display import style
from gpbnb.report.geometry import experiment, figures, tables, theory
from gpbnb.report.measurement import ARCSEC, MAS, deroll, spin_in_readout, theta_of

CASE = theory.Misalignments().with_angle("gamma1", 20 * ARCSEC).with_angle("gamma2", 10 * ARCSEC)


@pytest.fixture
def axes():
    fig, axes = style.figure(columns=2)
    yield axes
    fig.canvas.draw()
    plt.close("all")


@pytest.fixture(scope="module")
def both():
    return experiment.year(CASE, None, 7200.0), experiment.year(CASE, 36000.0, 7200.0)


def test_frames_are_those_of_the_chain():
    rng = np.random.default_rng(2)
    alpha, beta, gamma, phi = rng.uniform(-0.3, 0.3, (4, 3))
    frames = figures.frames(alpha, beta, gamma, phi, 0.6)
    assert list(frames) == ["a", "i", "φ", "t", "r", "g"]
    for matrix in frames.values():
        assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    seen = frames["r"] @ frames["g"].T[:, 0]  # the spin axis, row 0 of g, in the readout frame
    assert np.allclose(seen, spin_in_readout(theta_of(phi, alpha), beta, gamma, 0.6), atol=1e-14)
    assert np.allclose(frames["g"].T, figures.rotation(phi), atol=1e-14)


def test_triads_and_ring(axes):
    frames = figures.frames([0.1] * 3, [0.1] * 3, [0.2] * 3, [0, 0.1, 0.1], 0.5)
    still, rolling = figures.in_space(axes[0].figure, axes)
    names = [
        text.get_text() for text in figures.triads({k: frames[k] for k in "aig"}, still) if hasattr(text, "get_text")
    ]
    assert "$x_{a}$" in names
    assert "absolute, intermediate, gyro" in names
    artists = figures.triads({"r": frames["r"]}, rolling, ring="r")
    (ring,) = [a for a in artists if hasattr(a, "get_data_3d") and not hasattr(a, "get_text")]
    points = np.array(ring.get_data_3d())
    assert np.allclose(frames["r"][2] @ points, 0, atol=1e-14)  # perpendicular to the normal z_r


def test_chain_names_every_frame_and_angle(axes):
    texts = " ".join(a.get_text() for a in figures.chain(axes[0]) if hasattr(a, "get_text"))
    for name in (*figures.FRAME_NAMES.values(), r"$\theta$", r"$\alpha$", r"$\beta$", r"$\gamma$", r"\delta"):
        assert name in texts


@pytest.mark.parametrize("printed", [False, True])
def test_deroll_of_a_roll(axes, printed):
    phase = np.linspace(0, 2 * np.pi, 9)
    readings = deroll(np.broadcast_to(np.array([-15.0, -8.0]) * ARCSEC, (9, 2)), -phase)
    third, line3, second, line2, *_ = figures.deroll_of_a_roll(readings, phase, axes[0], printed)
    assert line3.get_ydata()[0] == pytest.approx(15)
    assert line2.get_ydata()[0] == pytest.approx(-8)
    assert third.get_color() == (style.REFUTED if printed else style.VALID)
    flat = np.allclose(third.get_ydata(), 15) and np.allclose(second.get_ydata(), -8)
    assert flat is not printed
    if printed:
        assert third.get_ydata()[2] == pytest.approx(15)  # a quarter roll
        assert third.get_ydata()[0] == pytest.approx(-15)


def test_losses(axes):
    sizes = np.array([10, 100]) * ARCSEC
    curves = {"gamma1": (sizes, np.array([2.0, 3.0]) * MAS)}
    points, line, goal, *_ = figures.losses(curves, axes[0])
    assert np.allclose(points.get_xdata(), [10, 100])
    assert np.allclose(points.get_ydata(), [2, 3])
    assert np.allclose(line.get_ydata(), theory.small_angle_loss("gamma1", sizes) / MAS)
    assert list(goal.get_ydata()) == [1, 1]


def test_first_rolls_and_year(axes, both):
    still, rolled = both
    samples, means, flat, *_ = figures.first_rolls(still, rolled, axes[0])
    assert np.array_equal(samples.get_ydata(), rolled.first[:, 0] / ARCSEC)
    assert np.array_equal(means.get_ydata(), rolled.phi[: len(rolled.first) // rolled.block, 0] / ARCSEC)
    assert len(flat.get_ydata()) == len(samples.get_ydata())
    points, line, _ = figures.year_errors({"case": rolled}, axes[1], component=1)
    assert np.allclose(points.get_ydata(), line.get_ydata(), atol=1e-3)
    assert line.get_ydata()[-1] == pytest.approx(-0.64, abs=0.01)


def test_precessions_are_perpendicular(axes):
    (solid, _) = figures.in_space(axes[0].figure, axes)
    names = [a.get_text() for a in figures.precessions(solid, -0.14) if hasattr(a, "get_text")]
    assert {"geodetic", "frame dragging", "Earth's axis"} <= set(names)


def test_the_earth_is_a_sphere_within_a_circular_orbit(axes, monkeypatch):
    (solid, _) = figures.in_space(axes[0].figure, axes)
    drawn = []
    monkeypatch.setattr(solid, "plot_surface", lambda *surface, **_: drawn.append(surface))
    _, orbit, *_ = figures.precessions(solid, -0.14)
    ((x, y, z),) = drawn
    assert np.allclose(np.hypot(np.hypot(x, y), z), 0.45)
    assert (z.min(), z.max()) == pytest.approx((-0.45, 0.45))
    x, y, z = orbit.get_data_3d()
    assert np.allclose(np.hypot(x, z), 1)
    assert not y.any()
    angle = np.unwrap(np.arctan2(z, x))
    assert angle[-1] - angle[0] == pytest.approx(2 * np.pi)


def test_table_of_misalignments(both):
    table = tables.misalignments({"gamma1 and gamma2": both})
    (row,) = table.body
    still, rolled = theory.effect(CASE, False), theory.effect(CASE, True)
    assert row[0] == r"$\gamma_1$ and $\gamma_2$"
    assert row[1:6] == (
        tables.pair(still.angle),
        tables.pair(still.drift),
        tables.number(rolled.line),
        "0",
        tables.pair(rolled.drift),
    )
    assert row[6] == tables.pair(both[1].error.drift)
    assert row[5] == "0.004; −0.640"


def test_each_effect_of_a_misalignment_has_its_column(both):
    still, rolled = both
    moved = replace(rolled, drift=rolled.drift + np.array([1, 2]) * MAS)
    table = tables.misalignments({"gamma1 and gamma2": (still, moved)})
    assert table.title == "errors due to misalignments, in milliarcseconds"
    (line,) = by_header(table)
    assert line == {
        "angle": r"$\gamma_1$ and $\gamma_2$",
        "no roll: angle": "10,000; −0.970",
        "no roll: drift": "0.004; −0.640",
        "rolling: at roll frequency": "10,000",
        "rolling: angle": "0",
        "rolling: drift": "0.004; −0.640",
        "drift, simulated": "1.004; 1.360",
    }


def test_table_of_fates():
    size = 20 * ARCSEC
    names = ("alpha1", "alpha2", "beta1", "beta3", "gamma1", "gamma2")
    table = tables.fates({name: experiment.parts(theory.Misalignments().with_angle(name, size)) for name in names})
    assert table.header == ("angle", "telescope", "gyro", "difference", "outcome")
    assert [row[-1] for row in table.body] == [
        "stays",
        "is measured",
        "stays",
        "cancels",
        "stays",
        "averages out",
    ]
    assert table.body[2][1:4] == ("0", "0.640; 0", "0.640; 0")
    assert table.body[3][1:4] == ("0; 20,000", "0; 20,000", "0")
    assert table.body[5][1:4] == ("0", "0; 20,000", "0; 20,000")
    assert table.title == "6 angles, errors in milliarcseconds: mean; oscillation at the roll frequency"


def test_an_error_that_only_oscillates_in_both_readings_cancels():
    oscillation = experiment.Part(0.0, ARCSEC)
    parts = {"telescope": oscillation, "gyro": oscillation, "difference": experiment.Part(0.0, 0.0)}
    assert tables.fate(parts) == "cancels"


def test_numbers_in_cells():
    assert [tables.number(x * MAS) for x in (0, -1e-5, 1.23456, 10, -12.3456, 20000.4, 123456.7)] == [
        "0",
        "0",
        "1.235",
        "10.00",
        "−12.35",
        "20,000",
        "123,457",
    ]
    assert tables._symbols("gamma1 and alpha_rate2") == r"$\gamma_1$ and $\dot\alpha_2$"
    assert tables._symbols("no angle") == "no angle"
    assert tables.reach([("beta2", ARCSEC * 3649)], MAS).body == ((r"$\beta_2$", "3,600", "1"),)
    table = tables.reach([("beta2", ARCSEC * 3649)], 0.25 * MAS)
    assert table.title == "angles that cause an error of 0.25 mas"
    assert by_header(table) == [{"angle": r"$\beta_2$", "in arcseconds": "3,600", "in degrees": "1"}]
