"""Figures as SVG: sharp at any size, lighter than a picture of pixels, and the same at every run on one machine."""

from __future__ import annotations

import base64
import io
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from html import escape
from urllib.parse import quote
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

MOST_MARKERS = 300
"""A series with more markers is drawn as pixels within the SVG, because each marker takes some 40 bytes."""
DECIMALS = 2
"""Decimals of a coordinate, in typographic points. A hundredth of a point cannot be seen."""
COLOURS = 32
"""Colours of the pixels within the SVG, which are shades of transparency of the few colours of a figure."""
FONTS = "DejaVu Sans, Verdana, sans-serif"
"""The font that lays the text out, and one with the same widths on machines that lack it."""
_SVG = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"
_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
_PART = re.compile(r"[MLQCZz]|-?\d*\.?\d+(?:e-?\d+)?")
_PNG = "data:image/png;base64,"


def svg(fig: Figure, size: float) -> str:
    """Return a figure as SVG, without metadata, names of groups, and digits beyond a hundredth of a point.

    Parameters
    ----------
    fig : the figure. Its series of more than :data:`MOST_MARKERS` markers become pixels.
    size : the size of most of its text in points.
    """
    for line in fig.findobj(Line2D):
        if line.get_marker() not in ("None", "", None) and np.size(line.get_xdata()) > MOST_MARKERS:
            line.set_rasterized(True)
    drawn = io.StringIO()
    with plt.rc_context({"svg.hashsalt": "gpbnb", "svg.fonttype": "none"}):
        fig.savefig(drawn, format="svg", facecolor="none", bbox_inches="tight", dpi=220, metadata={"Date": None})
    root = ElementTree.fromstring(drawn.getvalue())
    for each in [*root.iter(f"{_SVG}metadata")]:
        root.remove(each)
    _shorten_names(root)
    for each in [*root.iter()]:
        _shorten(each, size)
        _join_letters(each)
    for each in root.iter(f"{_SVG}image"):
        each.set(_LINK, _with_palette(each.get(_LINK, "")))
    _flatten(root)
    _drop_unused(root)
    _share_styles(root)
    root.set("font-family", FONTS)
    root.set("font-size", f"{size:g}px")
    for side, inches in zip(("width", "height"), root.get("viewBox", "").split()[2:], strict=True):
        root.set(side, f"{float(inches) / 72 * fig.dpi:.0f}")
    root.attrib.pop("version", None)
    ElementTree.register_namespace("", _SVG[1:-1])
    ElementTree.register_namespace("xlink", _LINK[1:].partition("}")[0])
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def png(fig: Figure) -> str:
    """Return a figure that :func:`svg` laid out as PNG in base 64, which JupyterLab shows before it trusts SVG.

    The figure has no layout engine afterwards: another layout would take half of the time.
    """
    made = io.BytesIO()
    fig.set_layout_engine("none")
    FigureCanvasAgg(fig).print_png(made)
    return _with_palette(base64.b64encode(made.getvalue()).decode()).removeprefix(_PNG)


def address(fig: Figure, size: float) -> str:
    """Return a figure as an address that holds it, for the picture of an HTML page; see :func:`svg`."""
    return "data:image/svg+xml," + quote(svg(fig, size).replace('"', "'"), safe=" =:/,;'()+*<>")


def element(fig: Figure, size: float, alt: str, caption: str) -> str:
    """Return a figure as an HTML element with its description and its caption, and close it; see :func:`svg`."""
    picture = f'<img alt="{escape(alt)}" src="{address(fig, size)}">'
    plt.close(fig)
    return f"<figure>{picture}<figcaption>{escape(caption, quote=False)}</figcaption></figure>"


def _shorten_names(root: ElementTree.Element) -> None:
    """Name what is referred to a, b, c, …, and nothing else."""
    text = " ".join(value for each in root.iter() for key, value in each.attrib.items() if key != "id")
    used = dict.fromkeys(re.findall(r"#([\w-]+)", text))
    names = {
        old: f"g{k}" for k, old in enumerate(name for name in used if any(e.get("id") == name for e in root.iter()))
    }
    for each in root.iter():
        if (old := each.attrib.pop("id", None)) in names:
            each.set("id", names[old])
        for key, value in each.attrib.items():
            if "#" in value:
                each.set(key, re.sub(r"#([\w-]+)", lambda found: f"#{names.get(found[1], found[1])}", value))


def _shorten(each: ElementTree.Element, size: float) -> None:
    """Round the numbers of an element, and leave out what it inherits."""
    if each.tag != f"{_SVG}tspan" and not (each.text or "").strip():
        each.text = None
    each.tail = None
    for key, value in each.attrib.items():
        if key == "d":
            each.set(key, _path(value))
        elif key == "transform":
            each.set(key, _transform(value))
        elif key != _LINK and key != "style":
            each.set(key, _NUMBER.sub(lambda found: _rounded(found[0]), value))
    if not each.get("transform", "x"):
        del each.attrib["transform"]
    if style := each.get("style"):
        given = dict(part.strip().split(": ", 1) for part in style.rstrip("; ").split(";"))
        if given.get("font-size") == f"{size:g}px" or given.get("font-size") == f"{size:.1f}px":
            del given["font-size"]
        given.pop("font-family", None)
        if "font" in given:  # style and size before the names of the fonts
            given["font"] = re.sub(r"'.*", FONTS, given["font"])
        given = {key: _NUMBER.sub(lambda found: f"{float(found[0]):.4g}", value) for key, value in given.items()}
        each.attrib.pop("style")
        if given:
            each.set("style", ";".join(f"{key}:{value}" for key, value in given.items()))


def _join_letters(text: ElementTree.Element) -> None:
    """Join the letters of a formula that stand on one line in one style."""
    last: ElementTree.Element | None = None
    for each in [*text] if text.tag == f"{_SVG}text" else []:
        if last is not None and all(last.get(key) == each.get(key) for key in ("y", "style")):
            last.text = (last.text or "") + (each.text or "")
            last.set("x", f"{last.get('x')} {each.get('x')}")
            text.remove(each)
        else:
            last = each


def _with_palette(address: str) -> str:
    """Return the pixels of a series with a palette of few colours, which takes a third of the bytes."""
    with Image.open(io.BytesIO(base64.b64decode(address.removeprefix(_PNG)))) as opened:
        light = opened.convert("RGBA").quantize(COLOURS, method=Image.Quantize.FASTOCTREE)
    made = io.BytesIO()
    light.save(made, "png", optimize=True)
    return _PNG + base64.b64encode(made.getvalue()).decode()


def _share_styles(root: ElementTree.Element) -> None:
    """Write a style that several elements have once, as a class."""
    counts = Counter(each.get("style") for each in root.iter() if each.get("style"))
    names = {style: f"s{k}" for k, style in enumerate(style for style, count in counts.items() if count > 1)}
    for each in root.iter():
        if (style := each.get("style")) in names:
            del each.attrib["style"]
            each.set("class", names[style])
    (sheet,) = root.iter(f"{_SVG}style")
    sheet.text = "*{stroke-linejoin:round;stroke-linecap:butt}" + "".join(
        f".{name}{{{style}}}" for style, name in names.items()
    )
    sheet.attrib.clear()


def _rounded(number: str) -> str:
    text = f"{float(number):.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _path(path: str) -> str:
    parts = (part if part.isalpha() else _rounded(part) for part in _PART.findall(path))
    return re.sub(r" ?([MLQCZz]) ?", r"\1", " ".join(parts))


def _transform(transform: str) -> str:
    """Round shifts and turns, and keep five digits of a scale."""
    parts = []
    for name, inner in re.findall(r"(\w+)\(([^)]*)\)", transform):
        numbers = re.split(r"[ ,]+", inner.strip())
        if name == "rotate" and float(numbers[0]) == 0:
            continue
        short = [f"{float(n):.5g}" if name in ("scale", "matrix") else _rounded(n) for n in numbers]
        parts.append(f"{name}({' '.join(short)})")
    return "".join(parts)


def _flatten(root: ElementTree.Element) -> None:
    """Put the children of groups without attributes in their place, and drop what is neither filled nor stroked."""
    strokes = {f"#{e.get('id')}": e.get("d", "") for e in root.iter(f"{_SVG}path") if e.get("id")}
    for parent in [root, *root.iter(f"{_SVG}g")]:
        parent[:] = _ticks_joined([*_children(parent)], strokes)


def _drop_unused(root: ElementTree.Element) -> None:
    """Drop the marks to which nothing refers any more."""
    used = " ".join(value for each in root.iter() for value in each.attrib.values())
    for group in root.iter(f"{_SVG}defs"):
        group[:] = [each for each in group if each.get("id") is None or re.search(rf"#{each.get('id')}\b", used)]
    for parent in [*root.iter()]:
        parent[:] = [each for each in parent if each.tag != f"{_SVG}defs" or len(each)]


def _ticks_joined(children: list[ElementTree.Element], strokes: Mapping[str, str]) -> list[ElementTree.Element]:
    """Write marks of one line each that follow each other, such as ticks, as one path."""
    found: list[ElementTree.Element] = []
    before = ("", "")
    for each in children:
        stroke = re.fullmatch(r"M0 0L(\S+) (\S+)", strokes.get(each.get(_LINK, ""), ""))
        alike = (each.get(_LINK, ""), each.get("style", "")) if stroke and each.tag == f"{_SVG}use" else ("", "")
        if stroke and alike[0]:
            line = f"M{each.get('x')} {each.get('y')}l{stroke[1]} {stroke[2]}"
            if alike == before:
                found[-1].set("d", found[-1].get("d", "") + line)
            else:
                found.append(ElementTree.Element(f"{_SVG}path", {"d": line, "style": each.get("style", "")}))
        else:
            found.append(each)
        before = alike
    return found


def _children(parent: ElementTree.Element) -> Iterator[ElementTree.Element]:
    for each in [*parent]:
        if each.tag == f"{_SVG}g" and not each.attrib:
            yield from _children(each)
        elif not (each.tag == f"{_SVG}path" and each.get("style") == "fill:none"):
            yield each
