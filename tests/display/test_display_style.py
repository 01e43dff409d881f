"""gpbnb.report.display.style: the one figure style."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.text import Text

from gpbnb.report.display import style


@pytest.mark.parametrize("columns", [1, 2, 3])
def test_panels_side_by_side_in_the_width_of_the_page(columns):
    fig, axes = style.figure(columns, height=4.2)
    assert axes.shape == (columns,)
    assert fig.axes == list(axes)
    assert tuple(fig.get_size_inches()) == (style.WIDTH, 4.2)


def test_panels_one_below_the_other():
    _, axes = style.figure(rows=3)
    assert axes.shape == (3,)
    tops = [ax.get_position().y1 for ax in axes]
    assert tops == sorted(tops, reverse=True)
    assert len({ax.get_position().x0 for ax in axes}) == 1


def test_text_can_be_read_on_a_phone():
    """A phone 390 pixels wide shows a figure 342 pixels wide."""
    fig, (ax,) = style.figure()
    style.label(ax, "x", "y (no unit)", "a title")
    ax.plot([1, 2], label="a line")
    style.legend(ax)
    named = style.name(ax, "a line", (1, 1), style.OBSERVED)
    fig.canvas.draw()
    texts = [ax.xaxis.label, ax.yaxis.label, ax.title, named, *ax.get_legend().get_texts()]
    texts += [*ax.get_xticklabels(), *ax.get_yticklabels()]
    assert min(text.get_fontsize() for text in texts) * 342 / (72 * fig.get_size_inches()[0]) >= 8


@pytest.mark.parametrize(
    ("shift", "alignment"),
    [((6, 0), ("left", "center")), ((-6, 3), ("right", "bottom")), ((0, -4), ("center", "top"))],
)
def test_a_name_grows_away_from_its_curve(shift, alignment):
    _, (ax,) = style.figure()
    text = style.name(ax, "valid", (0.5, 0.5), style.VALID, shift)
    assert (text.get_ha(), text.get_va()) == alignment
    assert text.get_color() == style.VALID
    assert (text.xy, text.get_position()) == ((0.5, 0.5), shift)


def test_the_style_is_that_of_the_figure_only():
    before = dict(plt.rcParams)
    fig, axes = style.figure()
    assert dict(plt.rcParams) == before
    assert fig.get_layout_engine() is not None
    assert to_rgba(fig.get_facecolor())[3] == to_rgba(axes[0].get_facecolor())[3] == 0
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


def test_names_at_the_right_edge_do_not_collide():
    fig, (ax,) = style.figure()
    style.loglog(ax)
    ax.plot([1, 10], [1, 1000])
    style.label(ax, "x", "y (no unit)")
    ends = {"low": (1.0, style.VALID), "same": (30.0, style.REFUTED), "also\nsame": (30.0, style.OBSERVED)}
    names = style.name_ends(ax, ends)
    fig.canvas.draw()
    boxes = [Text.get_window_extent(each) for each in names]
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    assert all(box.x0 > ax.get_window_extent().x1 and box.x1 <= fig.bbox.x1 for box in boxes)
    assert {each.get_text(): each.get_color() for each in names} == {k: colour for k, (_, colour) in ends.items()}
    # Two names have moved: lines lead from all names to the ends of the curves.
    assert all(each.arrow_patch.get_visible() for each in names)
    assert names[0].get_position() == (18, 0)


def test_names_in_their_places_need_no_lines():
    fig, (ax,) = style.figure()
    ax.plot([1, 10], [1, 1000])
    style.label(ax, "x", "y (no unit)")
    names = style.name_ends(ax, {"low": (1.0, style.VALID), "high": (1000.0, style.REFUTED)})
    fig.canvas.draw()
    assert [each.get_position() for each in names] == [(6, 0), (6, 0)]
    assert not any(each.arrow_patch.get_visible() for each in names)


def test_texts_move_apart_no_further_than_they_must():
    assert style.apart([5.0, 1.0], [1, 1], 2.0) == [5.0, 1.0]
    assert style.apart([1.0, 0.0], [1, 1], 2.0) == [1.5, -0.5]
    found = style.apart([0.0, 0.5, 9.0, 0.2], [1, 2, 1, 1], 1.0)
    assert found[2] == 9.0
    gaps = found[3] - found[0], found[1] - found[3]  # the order stays
    assert gaps == pytest.approx((1.0, 1.5), abs=1e-6)  # 200 rounds halve what is left each time


def test_the_legend_has_no_frame():
    _, (ax,) = style.figure()
    ax.plot([1, 2], label="a line")
    style.legend(ax, loc="upper left")
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a line"]
    assert not ax.get_legend().get_frame_on()


def test_no_two_colours_are_alike_and_all_stand_out_from_white():
    colours = [style.OBSERVED, *style.OBSERVED_OTHERS, style.VALID, style.REFUTED, style.BLACK, style.REFERENCE]
    rgb = np.array([to_rgb(colour) for colour in colours])
    distance = np.abs(rgb[:, None] - rgb).sum(axis=2)[np.triu_indices(len(rgb), 1)]
    assert distance.min() > 0.25
    assert (np.abs(rgb - 1).max(axis=1) > 0.5).all()


@pytest.mark.parametrize("colour", [style.OBSERVED, style.VALID, style.REFUTED, style.REFERENCE])
def test_words_in_the_main_colours_have_the_contrast_that_wcag_asks_for(colour):
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    assert 1.05 / (linear @ [0.2126, 0.7152, 0.0722] + 0.05) >= 4.5


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
