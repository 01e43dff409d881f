"""gpbnb.report.display.vector: figures as SVG."""

from __future__ import annotations

import base64
import io
import re
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image

from gpbnb.report.display import style
from gpbnb.report.display.vector import DECIMALS, MOST_MARKERS, element, svg

SVG = "{http://www.w3.org/2000/svg}"


def drawn(points=50):
    fig, (ax,) = style.figure()
    x = np.linspace(1, 3, points)
    ax.plot(x, x**2, "o-", color=style.OBSERVED)
    ax.set_yscale("log")
    style.label(ax, "time $t_k$ (s)", "length (m)", "a title")
    fig.canvas.draw()
    return fig, x


def test_two_runs_write_the_same_bytes():
    first, second = (svg(drawn()[0], style.TEXT) for _ in range(2))
    assert first == second
    assert svg(drawn()[0], style.TEXT) == first


def test_the_curve_goes_through_the_data():
    fig, x = drawn()
    root = ElementTree.fromstring(svg(fig, style.TEXT))
    paths = [each.get("d", "") for each in root.iter(f"{SVG}path")]
    (curve,) = [path for path in paths if path.count("L") >= len(x) - 1 and "C" not in path]
    points = np.array([each.split() for each in re.split("[ML]", curve)[1:]], dtype=float)
    assert len(points) == len(x)
    for found, given in ((points[:, 0], x), (points[:, 1], np.log(x**2))):
        slope, start = np.polyfit(given, found, 1)
        assert found == pytest.approx(slope * given + start, abs=0.006)  # half a hundredth, and as much in the fit


def test_what_matplotlib_writes_besides_the_figure_is_left_out():
    fig, _ = drawn()
    plain = io.StringIO()
    fig.savefig(plain, format="svg")
    text = svg(fig, style.TEXT)
    assert len(text) < len(plain.getvalue()) / 3
    assert not re.search(r"<metadata|matplotlib|<!--|DOCTYPE|20\d\d-\d\d-\d\d", text)
    coordinates = re.findall(r'\b(?:d|x|y|points)="([^"]*)"', text)
    assert coordinates
    assert not re.search(rf"\.\d{{{DECIMALS + 1}}}", " ".join(coordinates))


def test_every_name_that_is_referred_to_exists():
    text = svg(drawn()[0], style.TEXT)
    names = re.findall(r'\bid="([^"]+)"', text)
    assert set(re.findall(r"#(g\d+)", text)) == set(names)
    assert len(names) == len(set(names))


def test_words_stay_words():
    root = ElementTree.fromstring(svg(drawn()[0], style.TEXT))
    words = ["".join(each.itertext()) for each in root.iter(f"{SVG}text")]
    assert {"length (m)", "a title"} <= set(words)
    assert any(sorted(each.replace("\xa0", "")) == sorted("timetk(s)") for each in words)  # grouped by their style
    assert root.get("font-size") == "11px"
    assert all(float(size) >= 7 for size in re.findall(r"font-size:([\d.]+)px", "".join(root.itertext())))


def test_the_picture_is_as_wide_as_the_figure():
    fig, _ = drawn()
    root = ElementTree.fromstring(svg(fig, style.TEXT))
    _, _, width, height = map(float, root.get("viewBox").split())
    assert float(root.get("width")) == pytest.approx(width / 72 * fig.dpi, abs=0.5)
    assert float(root.get("height")) == pytest.approx(height / 72 * fig.dpi, abs=0.5)
    assert abs(float(root.get("width")) - style.WIDTH * fig.dpi) < 0.1 * style.WIDTH * fig.dpi


def test_an_element_has_its_description_and_caption_and_leaves_no_figure_open():
    fig, _ = drawn()
    html = element(fig, style.TEXT, 'a "curve"', "m < n")
    assert not plt.fignum_exists(fig.number)
    assert html.startswith('<figure><img alt="a &quot;curve&quot;" src="data:image/svg+xml,')
    assert html.endswith('"><figcaption>m &lt; n</figcaption></figure>')


def test_thousands_of_markers_become_pixels():
    assert "<image" not in svg(drawn(MOST_MARKERS)[0], style.TEXT)
    text = svg(drawn(20 * MOST_MARKERS)[0], style.TEXT)
    assert text.count("<image") == 1
    assert len(text) < 100_000


def test_a_notebook_shows_svg_and_png(monkeypatch):
    shown = []
    monkeypatch.setattr(style, "show", lambda data, raw: shown.append(data))
    fig, _ = drawn()
    fig._ipython_display_()
    (data,) = shown
    assert sorted(data) == ["image/png", "image/svg+xml", "text/plain"]
    with Image.open(io.BytesIO(base64.b64decode(data["image/png"]))) as picture:
        assert picture.size == tuple(round(each * fig.dpi) for each in fig.get_size_inches())
        assert min(picture.convert("RGBA").getpixel((0, 0))) >= 254  # white, of a palette
