"""gpbnb.display.style: the one figure style."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb

from gpbnb.display import style


@pytest.fixture(autouse=True)
def _close():
    yield
    plt.close("all")


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_panels_side_by_side_in_the_width_of_the_page(columns):
    fig, axes = style.figure(columns, height=4.2)
    assert axes.shape == (columns,)
    assert fig.axes == list(axes)
    assert tuple(fig.get_size_inches()) == (8.0, 4.2)


def test_the_style_is_that_of_the_figure_only():
    before = dict(plt.rcParams)
    fig, axes = style.figure()
    assert dict(plt.rcParams) == before
    assert fig.get_layout_engine() is not None
    assert to_rgb(fig.get_facecolor()) == (1, 1, 1)
    assert not axes[0].spines["top"].get_visible()
    assert not axes[0].spines["right"].get_visible()
    assert axes[0].get_axisbelow()
    assert axes[0].xaxis.get_gridlines()[0].get_visible()


def test_axes_are_named():
    _, (ax,) = style.figure()
    style.label(ax, "time (s)", "length (m)")
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title(loc="left")) == ("time (s)", "length (m)", "")
    style.label(ax, "time (s)", "length (m)", "a title")
    assert ax.get_title(loc="left") == "a title"


def test_the_legend_has_no_frame():
    _, (ax,) = style.figure()
    ax.plot([1, 2], label="a line")
    style.legend(ax, loc="upper left")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a line"]
    assert not ax.get_legend().get_frame_on()


def test_no_two_colours_are_alike_and_all_stand_out_from_white():
    colours = [style.OBSERVED, *style.OBSERVED_OTHERS, style.BOUND, style.STRICT, style.REFERENCE]
    rgb = np.array([to_rgb(colour) for colour in colours])
    distance = np.abs(rgb[:, None] - rgb).sum(axis=2)[np.triu_indices(len(rgb), 1)]
    assert distance.min() > 0.25
    assert (np.abs(rgb - 1).max(axis=1) > 0.5).all()


def test_every_curve_has_a_colour_and_a_marker_of_its_own():
    looks = style.line_styles(5)
    assert looks[0] == ("o", style.OBSERVED)
    assert len({marker for marker, _ in looks}) == len({colour for _, colour in looks}) == 5
    assert style.line_styles(2, "sD") == [("s", style.OBSERVED), ("D", style.OBSERVED_OTHERS[0])]
    assert style.colours(2, ("red", "blue", "green")) == ("red", "blue")
    with pytest.raises(ValueError, match="got 6 curves; needed at most 5, or colours repeat; draw two figures"):
        style.line_styles(6)


def test_both_axes_become_logarithmic():
    _, (ax,) = style.figure()
    style.loglog(ax)
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
