"""Every name, arrow and reference line in the figures of measurement geometry belongs to what it stands at."""

from __future__ import annotations

from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from drawn import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    NAVY,
    ORANGE,
    PINK,
    PURPLE,
    VIOLET,
    at,
    look,
    named,
    near,
    points_of,
)
from matplotlib.colors import to_hex
from matplotlib.text import Annotation

from gpbnb.report.display import style
from gpbnb.report.geometry import figures, theory

ARCSEC = np.pi / 180 / 3600
MAS = ARCSEC / 1000


@pytest.fixture
def solid():
    fig, axes = style.figure()
    yield figures.in_space(fig, axes)[0]
    fig.canvas.draw()
    plt.close("all")


def arrows(artists):
    """Start and end of each arrow in space, with its colour."""
    found = []
    for each in artists:
        if hasattr(each, "_segments3d"):
            shaft, barb, *_ = np.array(each._segments3d)
            (end,) = [place for place in shaft if any(np.allclose(place, other) for other in barb)]
            (start,) = [place for place in shaft if not np.allclose(place, end)]
            found.append((start, end, to_hex(np.array(each.get_edgecolor())[0]).upper()))
    return found


def texts(artists):
    return {each.get_text(): each for each in artists if hasattr(each, "get_text")}


def test_triads(solid):
    matrices = {
        "a": np.eye(3),
        "i": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
        "φ": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    }
    artists = figures.triads(matrices, solid)
    colours = {"a": GREY, "i": BLACK, "φ": BLUE}
    drawn, words = arrows(artists), texts(artists)
    assert len(drawn) == 9
    for k, (name, matrix) in enumerate(matrices.items()):
        for row, axis in enumerate("xyz"):
            start, end, paint = drawn[3 * k + row]
            assert np.allclose(start, 0)
            assert np.allclose(end, matrix[row] * (1 + 0.18 * k))
            text = words[f"${axis}_{{{chr(92) + 'varphi' if name == 'φ' else name}}}$"]
            assert np.allclose(text.get_position_3d(), end * 1.1)
            assert paint == to_hex(text.get_color()).upper() == colours[name]
    assert "absolute, intermediate, roll" in words


def test_colours_and_names_of_all_frames(solid):
    artists = figures.triads(dict.fromkeys("trg", np.eye(3)), solid)
    assert [paint for _, _, paint in arrows(artists)[::3]] == [PINK, NAVY, VIOLET]
    assert "telescope, readout, gyro" in texts(artists)
    (ring,) = [each for each in figures.triads({"r": np.eye(3)}, solid, ring="r") if hasattr(each, "get_data_3d")]
    x, y, z = np.array(ring.get_data_3d())
    assert np.allclose(np.hypot(x, y), 0.55)
    assert np.allclose(z, 0)
    assert to_hex(ring.get_color()).upper() == NAVY


#: Figure IV-2 of hung1984: the angle between two frames.
LINKS = {
    ("g", "i"): r"$\theta$",
    ("a", "i"): r"$\alpha$",
    ("g", "a"): r"$\varphi=\theta-\alpha$",
    ("i", "φ"): r"$\omega t$",
    ("φ", "t"): r"$\beta$",
    ("t", "r"): r"$\gamma$",
    ("g", "r"): r"$\delta$, grows with the roll",
}
FRAMES = {
    "a": ("$a$\nabsolute", GREY),
    "i": ("$i$\nintermediate", BLACK),
    "φ": ("$\\varphi$\nroll", BLUE),
    "t": ("$t$\ntelescope", PINK),
    "r": ("$r$\nreadout", NAVY),
    "g": ("$g$\ngyro", VIOLET),
}


def test_chain(ax):
    artists = figures.chain(ax)
    links = [each for each in artists if isinstance(each, Annotation)]
    words = {each.get_text(): each for each in artists if hasattr(each, "get_text") and each.get_text()}
    places = {}
    for frame, (text, paint) in FRAMES.items():
        places[frame] = words[text].get_position()
        assert to_hex(words[text].get_bbox_patch().get_edgecolor()).upper() == paint
    found = {}
    for link in links:
        start = next(name for name, place in places.items() if place == tuple(link.xyann))
        end = next(name for name, place in places.items() if place == tuple(link.xy))
        found[start, end] = link
        assert link.arrowprops["arrowstyle"] == "->"
        # An arrow begins and ends outside the names of its frames, which are wide and flat.
        upright = link.xyann[0] == link.xy[0]
        assert (link.arrowprops["shrinkA"] == link.arrowprops["shrinkB"] == 22) == upright
    assert set(found) == set(LINKS)
    for ends, word in LINKS.items():
        text, (one, other) = words[word], (np.array(places[name]) for name in ends)
        # No other link is nearer to the word than its own, as far as words of straight links go.
        if ends != ("g", "r"):
            distance = {each: gap(text.get_position(), *(places[name] for name in each)) for each in LINKS}
            del distance["g", "r"]
            assert min(distance, key=distance.__getitem__) == ends
        else:
            assert found[ends].arrowprops["ls"] == "--"
            assert text.get_position()[1] > (one[1] + other[1]) / 2
    assert [found[ends].arrowprops["ls"] for ends in LINKS if ends != ("g", "r")] == ["-"] * 6
    assert len(words) == len(FRAMES) + len(LINKS)


def gap(point, start, end):
    """Distance of a point from a segment."""
    p, a, b = (np.array(each, dtype=float) for each in (point, start, end))
    share = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
    return float(np.linalg.norm(p - a - share * (b - a)))


@pytest.mark.parametrize("printed", [False, True], ids=["derived", "printed"])
def test_deroll_of_a_roll(ax, printed):
    phase = np.linspace(0, 2 * np.pi, 5)
    true = np.array([-15.0, -8.0])  # −α3 and α2, arcseconds
    c, s = np.cos(phase), np.sin(phase)
    readings = np.stack([c * true[0] + s * true[1], -s * true[0] + c * true[1]], axis=1) * ARCSEC
    third, line3, second, line2, name3, name2 = figures.deroll_of_a_roll(readings, phase, ax, printed)
    assert [x for x, _ in points_of(third)] == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert (line3.get_ydata()[0], line2.get_ydata()[0]) == pytest.approx((15, -8))
    assert [look(each)[0] for each in (line3, line2)] == [BLACK, BLACK]
    paint = ORANGE if printed else GREEN
    assert [look(each)[::2] for each in (third, second)] == [(paint, "o"), (paint, "s")]
    assert (third.get_markerfacecolor(), second.get_markerfacecolor()) == (paint, "none")
    if not printed:
        assert [y for _, y in points_of(third)] == pytest.approx([15] * 5)
        assert [y for _, y in points_of(second)] == pytest.approx([-8] * 5)
    assert (name3.get_text(), name2.get_text()) == (r"true $\alpha_3$", r"true $\alpha_2$")
    names = named(ax)
    assert near(names[r"true $\alpha_3$"], BLACK, (1, 15))
    assert near(names[r"true $\alpha_2$"], BLACK, (1, -8))
    assert ax.get_ylim() == pytest.approx((-1.2 * 17, 1.35 * 17))  # of the first reading, 17 arcseconds long
    equation = "(8)" if printed else "(5)"
    assert ax.get_title(loc="left") == rf"equation {equation}: circles $\hat\alpha_3$, squares $\hat\alpha_2$"


def test_losses(ax):
    sizes = np.array([10.0, 100.0]) * ARCSEC
    curves = {
        "gamma1": (sizes, np.array([2.0, 3.0]) * MAS),
        "alpha2": (sizes / 2, np.array([5.0, 7.0]) * MAS),
        "beta3": (sizes * 2, np.array([11.0, 13.0]) * MAS),
    }
    *drawn, tolerance, _ = figures.losses(curves, ax)[:8]
    names = named(ax)
    for i, (angle, marker, scale, text) in enumerate(
        (
            ("gamma1", "o", 1, r"$\gamma_1$"),
            ("alpha2", "s", 0.5, r"$\alpha_2$"),
            ("beta3", "D", 2, r"$\beta_3$"),
        )
    ):
        points, line = drawn[2 * i : 2 * i + 2]
        errors = curves[angle][1] / MAS
        assert at(points, (10 * scale, errors[0]), (100 * scale, errors[1]))
        assert (look(points), look(line)[:2]) == ((BLUE, "", marker), (GREEN, "-"))
        expected = theory.small_angle_loss(angle, sizes * scale) / MAS
        assert at(line, (10 * scale, expected[0]), (100 * scale, expected[1]))
        assert near(names.pop(text), GREEN, (1, expected[1]))
    assert (set(tolerance.get_ydata()), look(tolerance)[:2]) == ({1}, (GREY, ":"))
    assert near(names.pop("tolerance, 1 mas"), GREY, (5, 1))
    assert not names


def test_first_rolls(ax):
    seconds = np.arange(6.0)
    rolled = SimpleNamespace(
        step=120.0,
        block=3,
        first=np.stack([10 + seconds, 99 + seconds], axis=1) * ARCSEC,
        phi=np.array([[30.0, 1.0], [40.0, 2.0], [50.0, 3.0]]) * ARCSEC,
    )
    still = SimpleNamespace(step=120.0, first=np.stack([60 + seconds, 80 + seconds], axis=1) * ARCSEC)
    samples, means, without, *_ = figures.first_rolls(still, rolled, ax)
    assert at(samples, *((2 * k, 10 + k) for k in range(6)))
    assert at(means, (2, 30), (8, 40))  # in the middle of three samples
    assert at(without, *((2 * k, 60 + k) for k in range(6)))
    assert [look(each) for each in (samples, means, without)] == [
        (PURPLE, "-", "."),
        (BLUE, "", "D"),
        (PINK, "-", ""),
    ]
    names = named(ax)
    assert near(names.pop("rolling"), PURPLE, (1, 15))
    assert near(names.pop("mean over\na roll"), BLUE, (1, 40))
    assert near(names.pop("no roll"), PINK, (1, 65))
    assert not names


@pytest.mark.parametrize("component", [0, 1], ids=["second", "third"])
def test_year_errors(ax, component):
    time = np.linspace(0.02, 0.98, 25)
    results = {}
    for i, roll_period in enumerate((None, 77.5, 77.5)):
        case = theory.Misalignments().with_angle("gamma1", (20 + i) * ARCSEC).with_angle("gamma2", 10 * ARCSEC)
        error = MAS * (100 * (i + 1) + np.stack([time, 10 * time], axis=1))
        phi = np.array(case.drift) * time[:, None] + error
        results[f"case {i}"] = SimpleNamespace(case=case, roll_period=roll_period, time=time, phi=phi)
    artists = figures.year_errors(results, ax, component)
    names = named(ax)
    for i, (paint, marker) in enumerate(((BLUE, "o"), (PINK, "s"), (NAVY, "D"))):
        points, line = artists[2 * i : 2 * i + 2]
        assert np.array(points_of(points))[:, 1] == pytest.approx(
            100 * (i + 1) + (1, 10)[component] * time[::2], abs=1e-4
        )
        assert [x for x, _ in points_of(points)] == pytest.approx(list(time[::2]))
        expected = theory.measured(results[f"case {i}"].case, i > 0, time[::2])[:, component] / MAS
        assert [y for _, y in points_of(line)] == pytest.approx(list(expected))
        assert (look(points), look(line)[:2]) == ((paint, "", marker), (GREEN, "-"))
        assert near(names.pop(f"case {i}"), paint, (1, expected[-1]))
    assert not names
    assert set(ax.lines[-1].get_ydata()) == {0}


def test_precessions(solid):
    declination = 0.29
    artists = figures.precessions(solid, declination)
    star = np.array([np.cos(declination), 0, np.sin(declination)])
    north, normal = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])
    words = texts(artists)
    drawn = {paint: (start, end) for start, end, paint in arrows(artists)}
    assert len(drawn) == 4
    axis = drawn[BLACK]
    assert np.allclose(np.cross(axis[1] - axis[0], north), 0)
    assert (axis[1] - axis[0])[2] > 0
    spin = drawn[GREY]
    assert np.allclose(np.cross(spin[1] - spin[0], star), 0)
    assert (spin[1] - spin[0]) @ star > 0
    # The geodetic drift turns about the normal of the orbit, frame dragging about the Earth's axis.
    for paint, about in ((BLUE, normal), (PINK, north)):
        start, end = drawn[paint]
        assert np.allclose(start, spin[1])
        assert np.allclose(np.cross(end - start, np.cross(about, star)), 0)
        assert (end - start) @ np.cross(about, star) > 0
    expected = {"Earth's axis": BLACK, "spin axis, to the star": GREY, "geodetic": BLUE, "frame dragging": PINK}
    for word, paint in expected.items():
        assert to_hex(words[word].get_color()).upper() == paint
    for word, paint in (("geodetic", BLUE), ("frame dragging", PINK)):
        place = np.array(words[word].get_position_3d())
        distance = {each: np.linalg.norm(place - end) for each, (_, end) in drawn.items()}
        assert min(distance, key=distance.__getitem__) == paint
    (orbit,) = [each for each in artists if hasattr(each, "get_data_3d") and not hasattr(each, "get_text")]
    x, y, z = np.array(orbit.get_data_3d())
    assert np.allclose(np.hypot(x, z), 1)
    assert np.allclose(y, 0)
    assert "polar orbit" in words
