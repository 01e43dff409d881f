"""A poster of one page, A1: the story from the report's digits to a certificate, from the book's own numbers."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from fractions import Fraction
from html import escape
from typing import NamedTuple

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.adversary import attack, random_errors
from gpbnb.filters.forms import Form
from gpbnb.report.display import style
from gpbnb.report.display.vector import FONTS, address
from gpbnb.report.gravity_probe_b import answers, horizon, summary, threshold
from gpbnb.report.gravity_probe_b import figures as years
from gpbnb.report.guarantees import certificates
from gpbnb.report.guarantees import figures as guarantees
from gpbnb.report.kalman import figures as kalman
from gpbnb.report.ledger import rows
from gpbnb.report.ledger.argument import figure as argument
from gpbnb.report.ledger.argument import inherited, stages
from gpbnb.report.pictures.operations import STEP

WIDTH, HEIGHT = 594, 841
"""Size of A1, mm."""
_EDGE, _GAP = 26, 22
_COLUMN = (WIDTH - 2 * _EDGE - _GAP) / 2
_TITLE, _HEADING, _TEXT, _SMALL = 20.5, 10.0, 7.0, 5.0  # sizes of letters, mm
_WRAP = 68
"""Letters in a line of text of a column."""
_PLACES = (_EDGE, 170, 255, 340, 425)
"""Where the columns of the table of answers begin, mm."""
_SOURCE = "The numbers on this poster are computed by the package gpbnb; its book explains each."


class Panel(NamedTuple):
    """A part of the story: its heading, its text and its figure."""

    heading: str
    text: str
    figure: Figure


def poster() -> str:
    """Return the poster as SVG, with its size in millimetres and its figures within it."""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}mm" height="{HEIGHT}mm" '
        f'viewBox="0 0 {WIDTH} {HEIGHT}" font-family="{FONTS}">',
        "<title>How many digits did Gravity Probe B need?</title>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>',
        _line("How many digits did Gravity Probe B need?", _EDGE, 48, _TITLE, "bold"),
        *_paragraph(_lead(), _EDGE, 64, 8.4, 120),
    ]
    top, row = 96.0, 0.0
    for k, panel in enumerate(panels()):
        drawn, height = _panel(panel, _EDGE + k % 2 * (_COLUMN + _GAP), top)
        lines += drawn
        row = max(row, height)
        if k % 2:
            top, row = top + row, 0.0
    table = summary.table()
    lines.append(_line("The answers", _EDGE, top + _HEADING, _HEADING, "bold"))
    top += 2.4 * _HEADING
    for k, cells in enumerate((table.header, *table.body)):
        for x, words in zip(_PLACES, cells, strict=True):
            lines.append(_line(words, x, top + 1.45 * _SMALL * k, _SMALL, "normal" if k else "bold"))
    bottom = top + 1.45 * _SMALL * len(table.body)
    if bottom > HEIGHT - 24:
        raise ArithmeticError(f"got {bottom:.0f} mm of panels and answers; needed at most {HEIGHT - 24}")
    lines += [*_paragraph(_SOURCE, _EDGE, HEIGHT - 14, _SMALL, 140), "</svg>"]
    return "\n".join(lines) + "\n"


def _lead() -> str:
    found = {each.source: each for each in summary.find()}
    printed = found["Report, own criterion"].decimal
    many = next(each for source, each in found.items() if source.endswith("simulated years"))
    every = found["Every admissible record"]
    return (
        f"In 1984 a report asked for {printed[0]} or {printed[1]} decimal digits. Its formula is not a bound. Emulated "
        f"years need {many.bits} bits, or {answers.decimal_digits(FloatFormat(2, many.bits or 0)):.1f} digits. A "
        f"guarantee for every admissible record takes {every.bits}, and {every.deviation} if the filter estimates "
        "deviations."
    )


def panels() -> Iterator[Panel]:
    """Yield the parts of the story in order, two in a row."""
    everything = rows()
    observed = answers.find_answers()
    digits = answers.decimal_digits(FloatFormat(2, observed.bits))
    fig, (ax,) = style.figure(height=3.8)
    kalman.waterfall(ax, Fraction(1, summary.DRIFT), digits)
    yield Panel(
        f"1. The report: {observed.printed[0]} digits, or {observed.printed[1]}",
        "Formula (125) of 1984 has two terms. Both printed numbers are wrong. For an error of one milliarcsecond, and "
        "with every error of the formula corrected, it asks for even more.",
        fig,
    )
    count, passed = stages(everything)["kalman"], inherited(everything)
    yield Panel(
        "2. Why it fails",
        f"Of {count.statements} statements about the Kalman filter, {count.wrong} are wrong. "
        f"{sum(number for (later, _), number in passed.items() if later == 'kalman')} of them inherit an error from an "
        "earlier part.",
        argument(everything, 3.9),
    )
    shown = [run for run in observed.runs if run.case.base == 2 and run.case.form is Form.HUNG]
    shown = [run for run in shown if run.case.precision in (18, 24, 32, 40, 53)]
    shown = [run for run in shown if run.case.rounding is Rounding.NEAREST]
    fig, (ax,) = style.figure(height=3.1)
    years.years(shown, "rate", ax, tolerance=1.0)
    yield Panel(
        "3. Run the filter for a year instead",
        f"Every operation of {shown[0].steps[-1]:,} steps is rounded, exactly as a computer would. Each curve is one "
        "precision, and the dotted line is the allowed error.",
        fig,
    )
    simple = threshold.shares(threshold.SWEEP.load())
    binary = [e for e in simple if e.fmt.base == 2 and e.fmt.rounding.value == "nearest" and e.form == "hung"]
    needed = threshold.needed([each for each in binary if each.states == "absolute"]).observed
    many = next(each for each in binary if each.states == "absolute" and each.fmt.precision == needed)
    fig, (ax,) = style.figure(height=3.1)
    years.shares(binary, ax)
    yield Panel(
        f"4. Not one year, but {many.records}",
        f"Other noise, other errors. With {needed} bits, {many.within} of {many.records} years stay within one "
        "milliarcsecond. A filter that estimates deviations from the predicted drift needs fewer.",
        fig,
    )
    found = certificates.tracker_guarantee()
    outcome = attack(found, steps=2000, candidates=200, center=[750, 0], plans=1)
    fig, (ax,) = style.figure(height=3.9)
    noise = random_errors(found, steps=2000, center=[750, 0])
    guarantees.draw_errors(ax, found, guarantees.errors_of(found, outcome.z), noise, 0, "position (m)")
    bits = {row.states: horizon.bits(row) for row in horizon.load()}
    yield Panel(
        "5. A bound for every record, for ever",
        "A finite computation bounds the error for all measurements within limits. An adversary reaches "
        f"{100 * outcome.ratio:.0f} % of this tracker's bound. A year of Gravity Probe B takes {bits['absolute']} "
        "bits.",
        fig,
    )
    checked = [each for each in certificates.load() if each.verdict == "proved"]
    yield Panel(
        "6. And a certificate",
        f"{len(checked)} guarantees come with a certificate of {min(each.size for each in checked):,} to "
        f"{max(each.size for each in checked):,} bytes, which a short program of its own proves. The graph shows what "
        "a bound is made of: two sums of the position cause nearly all of it.",
        STEP.still(),
    )


def _panel(panel: Panel, x: float, top: float) -> tuple[list[str], float]:
    """Return a part of the story as SVG, and its height."""
    lines = [_line(panel.heading, x, top + _HEADING, _HEADING, "bold")]
    text = [*_paragraph(panel.text, x, top + 2.4 * _HEADING, _TEXT, _WRAP)]
    at = top + 2.4 * _HEADING + 1.45 * _TEXT * len(text) - 4
    source = address(panel.figure, style.TEXT)
    box = re.search(r"viewBox='([^']*)'", source)
    if box is None:
        raise ArithmeticError("got a figure without a viewBox; needed one as gpbnb.report.display.vector writes it")
    _, _, across, down = map(float, box[1].split())
    plt.close(panel.figure)
    height = _COLUMN * down / across
    lines += [
        *text,
        f'<image x="{x:g}" y="{at:.1f}" width="{_COLUMN:g}" height="{height:.1f}" href="{escape(source)}"/>',
    ]
    return lines, at + height + 9 - top


def _line(words: str, x: float, y: float, size: float, weight: str = "normal") -> str:
    return f'<text x="{x:g}" y="{y:.1f}" font-size="{size:g}" font-weight="{weight}">{escape(words)}</text>'


def _paragraph(words: str, x: float, y: float, size: float, letters: int) -> Iterator[str]:
    for k, line in enumerate(textwrap.wrap(words, letters)):
        yield _line(line, x, y + 1.45 * size * k, size)
