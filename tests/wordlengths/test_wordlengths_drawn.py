"""Every label, marker and reference line in the figures of wordlength belongs to the data it stands at."""

from __future__ import annotations

import math

import numpy as np
from drawn import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, at, labelled, legend_of, look, named, near
from matplotlib.colors import to_hex

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.display.style import bits_colour
from gpbnb.report.wordlengths import figures

#: Bits of the significand in IEEE 754, the hidden one included.
STANDARD = {"binary16": 11, "binary32": 24, "binary64": 53}


def lines_of(ax):
    found = {line.get_label(): line for line in ax.lines if not line.get_label().startswith("_")}
    return found


def standards_of(ax, upright):
    """Precision and name of each reference line of a format."""
    lines = [line for line in ax.lines if look(line)[:2] == (GREY, ":")]
    places = [float((line.get_xdata() if upright else line.get_ydata())[0]) for line in lines]
    if upright:
        texts = {text.get_text(): float(text.get_position()[0]) for text in ax.texts}
    else:
        texts = {text: place[1][1] for text, place in named(ax).items() if text.startswith("binary")}
    assert sorted(texts.values()) == sorted(places)
    return texts


def test_formats_at_the_ends_of_an_axis_have_their_lines(ax):
    ax.set_xlim(11, 24)
    figures.standards(ax)
    assert set(standards_of(ax, True)) == {"binary16", "binary32"}


def test_growth(ax):
    points = {"UD": [(10, 9), (1000, 24)], "Joseph": [(10, 11), (1000, 53)]}
    lines = {"bound": [(10, 20), (1000, 60)], "(125), corrected": [(10, 30), (1000, 50)], "law": [(10, 1), (100, 2)]}
    figures.growth(points, lines, ax)
    found = lines_of(ax)
    for name, expected in (points | lines).items():
        assert at(found[name], *expected)
    expected = {
        "UD": (BLUE, "", "o"),
        "Joseph": (PURPLE, "", "s"),
        "bound": (GREEN, "-", ""),
        "(125), corrected": (ORANGE, "--", ""),
        "law": (GREEN, "-", ""),
    }
    assert labelled(ax) == {name: expected[name] for name in points}
    names = named(ax)
    assert near(names.pop("bound"), GREEN, (1, 60))
    assert near(names.pop("(125),\ncorrected"), ORANGE, (1, 50))
    assert near(names.pop("law"), GREEN, (100, 2))  # it ends within the panel
    assert set(names) == set(STANDARD)
    assert {name: look(line) for name, line in found.items()} == expected
    assert standards_of(ax, False) == STANDARD


def test_overview(ax):
    found = {
        "tilt": {"emulation": 17, "bound": 32, "theory": 15, "printed": 40, "corrected": 44},
        "gyro": {"theory": 18, "emulation": 12},
        "mass": {"bound": 5},
    }
    figures.overview(found, ax)
    lines = {name.removeprefix("(125), "): line for name, line in lines_of(ax).items()}
    for kind in ("emulation", "bound", "theory", "printed", "corrected"):
        places = [(each[kind], y) for y, each in enumerate(found.values()) if kind in each]
        assert at(lines[kind], *places)
    shown = {
        name: (line.get_marker(), to_hex(line.get_markeredgecolor()).upper(), line.get_markerfacecolor())
        for name, line in lines.items()
    }
    assert shown == {
        "emulation": ("o", BLUE, BLUE),
        "bound": ("|", GREEN, GREEN),
        "theory": ("D", BLACK, BLACK),
        "printed": ("o", ORANGE, "none"),
        "corrected": ("s", ORANGE, "none"),
    }
    assert legend_of(ax) == ["emulation", "bound", "theory", "(125), printed", "(125), corrected"]
    spans = [line for line in ax.lines if look(line)[0] == "#D0D0D0"]
    assert [list(line.get_xdata()) for line in spans] == [[15, 44], [12, 18], [5, 5]]
    assert [list(line.get_ydata()) for line in spans] == [[0, 0], [1, 1], [2, 2]]
    assert standards_of(ax, True) == {name: STANDARD[name] for name in ("binary16", "binary32")}


def test_changes(ax):
    inf = math.inf
    figures.changes(
        ["as it is", "scaled", "shifted"], {("tilt", 8): [2.0, inf, 1.0], ("gyro", 24): [4.0, 12.0, 2.0]}, ax
    )
    tilt, gyro, one = ax.lines
    assert at(tilt, (1, 0), (0.5, 2))
    assert at(gyro, (1, 0), (3, 1), (0.5, 2))
    few, many = (bits_colour(FloatFormat(2, bits)) for bits in (8, 24))
    assert labelled(ax) == {"tilt, 8 bits": (few, "", "o"), "gyro, 24 bits": (many, "", "s")}
    assert [line.get_label() for line in (tilt, gyro)] == ["tilt, 8 bits", "gyro, 24 bits"]
    assert (set(one.get_xdata()), look(one)[:2]) == ({1}, (GREY, "-"))
    assert [tick.get_text() for tick in ax.get_yticklabels()] == ["as it is", "scaled", "shifted"]
    assert ax.yaxis_inverted()


def test_bands(ax):
    records = np.arange(1.0, 12.0)
    found = {"UD": [(11, 10 * records), (12, records)], "Joseph": [(13, records / 10)]}
    figures.bands(found, ax, share=0.8)
    middle, most, other, other_most, tolerance = ax.lines
    assert at(middle, (11, 60), (12, 6))
    assert at(most, (11, 110), (12, 11))
    assert at(other, (13, 0.6))
    assert at(other_most, (13, 1.1))
    # Four fifths of eleven records: from the second to the tenth.
    corners = {tuple(float(round(x, 9)) for x in place) for place in ax.collections[0].get_paths()[0].vertices}
    assert corners == {(11, 20), (12, 2), (11, 100), (12, 10)}
    assert [line.get_label() for line in (middle, most, other, other_most)] == [
        "UD: median",
        "the worst record",
        "Joseph: median",
        "the worst record",
    ]
    assert [look(line)[:2] for line in (middle, most, other, other_most)] == [
        (BLUE, "-"),
        (BLUE, ":"),
        (PURPLE, "-"),
        (PURPLE, ":"),
    ]
    assert [to_hex(each.get_facecolor()[0]).upper() for each in ax.collections] == [BLUE, PURPLE]
    assert [each.get_label() for each in ax.collections] == ["80 % of records"] * 2
    assert (set(tolerance.get_ydata()), look(tolerance)[:2]) == ({1}, (GREY, ":"))
    (text,) = ax.texts
    assert (text.get_text(), text.xy) == ("tolerance", (1, 1))
    assert to_hex(text.get_color()).upper() == GREY
