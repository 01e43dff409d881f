"""A report on the wordlength of one filter, computed once and written as JSON and as one HTML page."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from gpbnb.bounds.envelope import Limits
from gpbnb.filters.array_forms import AnyForm
from gpbnb.filters.forms import Form
from gpbnb.filters.inputs import simulated_measurements
from gpbnb.filters.missing import without_missing
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import form_named
from gpbnb.sweeps import machine
from gpbnb.wordlength.precision import largest_errors, required_precision
from gpbnb.wordlength.ranges import binary_ranges
from gpbnb.wordlength.requirement import Basis, Requirement
from gpbnb.wordlength.system import LinearSystem

SIDE_BY_SIDE = (Form.INNOVATION, Form.JOSEPH, Form.UD)
"""Forms that a report compares; the requested form comes first."""


@dataclass(frozen=True)
class Answer:
    """One search as plain numbers; `tried` holds precision and error / tolerance, None if there is no number."""

    label: str
    basis: str
    digits: int | None
    text: str
    tried: tuple[tuple[int, float | None], ...]


@dataclass(frozen=True)
class Report:
    """The findings of the command, as plain numbers and texts.

    Parameters
    ----------
    name, kind : name of the model, and "Kalman filter" or "linear system".
    digits : the answer, None if there is none. text : the answer in words, with its basis.
    base, rounding, steps, tolerance : the question.
    source : origin of the measurements.
    answers : one answer for each basis and form, the requested one first.
    errors : error / tolerance of each state at the answer; None if the tolerance is infinite.
    ranges : name, smallest and largest power of two.
    command : the command that reproduces the report. versions : versions of the machine and packages.
    limits : for the bases "guarantee" and "probable", the limits on each state, innovation and measurement of the
        filter without rounding; None if there is no limit.
    """

    name: str
    kind: str
    digits: int | None
    text: str
    base: int
    rounding: str
    steps: int
    tolerance: tuple[float | None, ...]
    source: str
    answers: tuple[Answer, ...]
    errors: tuple[float | None, ...]
    ranges: tuple[tuple[str, int, int], ...]
    command: str
    versions: dict[str, str]
    limits: dict[str, tuple[float | None, ...]] = field(default_factory=dict)

    @property
    def limiting(self) -> int | None:
        """The index, from 0, of the state with the largest error / tolerance."""
        ratios = [(ratio, i) for i, ratio in enumerate(self.errors) if ratio is not None]
        return max(ratios)[1] if ratios else None

    def to_json(self) -> str:
        """Return the report as JSON, with the limiting state and without NaN or infinity."""
        return json.dumps({**asdict(self), "limiting": self.limiting}, indent=1, ensure_ascii=False, allow_nan=False)

    def to_html(self) -> str:
        """Return the report as one HTML page that needs no other file."""
        return page(self)


def study(
    model: LinearModel | LinearSystem,
    tolerance: float | Sequence[float],
    z: Any = None,
    steps: int | None = None,
    base: int = 2,
    rounding: str = "nearest",
    form: str = "innovation",
    bases: Sequence[Basis] = ("emulation", "bound"),
    source: str = "",
    command: str = "",
    tell: Callable[[str], Any] = lambda text: None,
    progress: bool = False,
    within: Limits | None = None,
) -> Report:
    """Find the answer for each basis and form, and collect what explains it.

    Parameters
    ----------
    z : (steps, m), measurements or inputs; by default simulated, for a Kalman filter.
    steps : number of steps to simulate; by default the number of measurements, or 1000.
    bases : as in :func:`gpbnb.wordlength.precision.required_precision`; the first gives the answer.
    tell : function called with a line of text before each search.
    within : result of :func:`gpbnb.bounds.guarantee.limits`, for the bases "guarantee" and "probable".

    Raises ------ ValueError : for a reason given in :func:`gpbnb.wordlength.precision.required_precision`; missing
    measurements with a
        basis that holds for all of them.
    OverflowError : for a reason given there.
    """
    given = z is not None
    count = steps if steps is not None else 1000 if z is None else len(z)
    if isinstance(model, LinearSystem):
        if form_named(form) is not Form.INNOVATION:
            raise ValueError(f"got the {form_named(form)} form; needed none: only a LinearModel has forms")
        questions: list[tuple[str, Basis, AnyForm | None]] = [(basis, basis, None) for basis in bases]
    else:
        first = form_named(form)
        forms = [first, *(each for each in SIDE_BY_SIDE if each is not first)]
        questions = [(f"{each}, {basis}", basis, each) for each in forms for basis in bases]
        model.check_sizes()
        if given and {*bases} & {"guarantee", "probable"} and without_missing(model, z)[0] is not model:
            raise ValueError(
                "got measurements of which some are missing, and a basis that holds for ever; needed measurements "
                "without gaps; leave them out for this basis, which does not depend on them"
            )
        if not given:
            z = simulated_measurements(model, count)
    found: list[tuple[str, Requirement]] = []
    for label, basis, chosen in questions:
        tell(f"{label} …")
        chosen = Form.INNOVATION if chosen is None else chosen
        answer = required_precision(
            model, count, tolerance, base, rounding, chosen, basis, z, within=within, progress=progress
        )
        found.append((label, answer))
        tell(f"{label}: {answer}")
    main = found[0][1]
    width = model.p if isinstance(model, LinearSystem) else model.n
    tolerances = np.broadcast_to(np.asarray(tolerance, dtype=np.float64), (width,))
    errors: tuple[float | None, ...] = ()
    ranges: tuple[tuple[str, int, int], ...] = ()
    if isinstance(model, LinearModel):
        errors = _errors(model, z, main, form_named(form), tolerances)
        sound, filled = without_missing(model, z)
        ranges = tuple((each.name, each.least, each.largest) for each in binary_ranges(sound, filled))
    return Report(
        model.name,
        "Kalman filter" if isinstance(model, LinearModel) else "linear system",
        main.precision,
        str(main),
        base,
        str(rounding),
        count,
        tuple(_finite(float(each)) for each in tolerances),
        source or ("given" if given else "simulated by the model, seed 0" if z is not None else "none"),
        tuple(_plain(label, answer) for label, answer in found),
        errors,
        ranges,
        command,
        machine(),
        {} if within is None else {name: tuple(map(_finite, each.tolist())) for name, each in within._asdict().items()},
    )


def _errors(
    model: LinearModel, z: Any, answer: Requirement, form: AnyForm, tolerances: np.ndarray
) -> tuple[float | None, ...]:
    """Return the largest error / tolerance of each state at the answer."""
    if answer.fmt is None:
        return ()
    sound, filled = without_missing(model, z)
    largest = largest_errors(sound, filled, answer.fmt, form)
    return tuple(_finite(float(e / t)) if math.isfinite(t) else None for e, t in zip(largest, tolerances, strict=True))


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _plain(label: str, answer: Requirement) -> Answer:
    tried = tuple((digits, _finite(ratio)) for digits, ratio in answer.tried)
    return Answer(label, answer.basis, answer.precision, str(answer), tried)


# -- the page -------------------------------------------------------------------------------------------------

_STYLE = """
:root { color-scheme: light dark; --text: #1b1b1b; --page: #fff; --soft: #f3f3f3; --line: #ccc; --grid: #ddd;
  --c0: #0b5cad; --c1: #a3341f; --c2: #2e7d32; --c3: #7b3fa0; --c4: #7a5b00; --c5: #555 }
@media (prefers-color-scheme: dark) {
  :root { --text: #e8e8e8; --page: #16181b; --soft: #24272b; --line: #4a4f55; --grid: #33373c;
    --c0: #6db3f8; --c1: #ff9c86; --c2: #7fd183; --c3: #d3a2f2; --c4: #e3c15a; --c5: #b5b5b5 }
}
body { font: 16px/1.5 system-ui, sans-serif; max-width: 46rem; margin: 2rem auto; padding: 0 1rem; color: var(--text);
  background: var(--page); overflow-wrap: anywhere }
h1 { font-size: 1.6rem; line-height: 1.25 } h2 { font-size: 1.2rem; margin-top: 2rem }
table { border-collapse: collapse; width: 100% } th, td { text-align: left; padding: .25rem .8rem .25rem 0;
  vertical-align: top; border-bottom: 1px solid var(--line); overflow-wrap: break-word }
td:first-child { min-width: 6rem } td:last-child { overflow-wrap: anywhere }
pre { background: var(--soft); padding: .6rem; white-space: pre-wrap; overflow-wrap: anywhere; font-size: .85rem }
svg { display: block; width: 100%; height: auto; fill: var(--text) }
.legend { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; padding: 0; list-style: none; font-size: .9rem }
.legend i { display: inline-block; width: 1.4rem; border-top: .2rem solid; margin-right: .4rem; vertical-align: middle }
.answer { font-size: 1.25rem; border-left: .3rem solid var(--c0); padding-left: .8rem }
@media (max-width: 34rem) { svg { font-size: 20px } th, td { padding-right: .5rem } }
"""


_MEANINGS = {
    "emulation": "An emulation holds for these measurements.",
    "bound": "A bound holds for the arithmetic of this run, whatever its roundings.",
    "guarantee": "A guarantee holds for ever, for all measurements within the limits.",
    "probable": "A probable error is three standard deviations, if roundings are independent of each other and values "
    "are as large as the limits allow.",
}


def page(report: Report) -> str:
    """Return a report as a self-contained HTML page."""
    unit = "bits" if report.base == 2 else f"digits of base {report.base}"
    answer = f"{report.digits} {unit}" if report.digits is not None else "no precision that can be run"
    limiting = ""
    if report.limiting is not None:
        ratio = report.errors[report.limiting]
        limiting = (
            f"<p>State {report.limiting + 1} of {len(report.errors)} limits the answer: its error is {ratio:.2g} of "
            "its tolerance.</p>"
        )
    rows = [(each.label, "none" if each.digits is None else str(each.digits), each.text) for each in report.answers]
    parts = [
        f"<h1>Wordlength for {html.escape(report.name)}</h1>",
        f'<p class="answer">This {report.kind} needs <strong>{html.escape(answer)}</strong> to keep rounding errors '
        "within the tolerance.</p>",
        f"<p>{html.escape(report.text)}.</p>",
        limiting,
        "<h2>Basis of the answer</h2>",
        _table(
            ("question", "value"),
            [
                ("steps", f"{report.steps}"),
                ("measurements", report.source),
                ("tolerance", _numbers(report.tolerance)),
                *((f"limit on the {name}", _numbers(each)) for name, each in report.limits.items()),
                ("rounding", report.rounding),
            ],
        ),
        f"<p>{' '.join(_MEANINGS[each] for each in dict.fromkeys(each.basis for each in report.answers))} "
        "None of this limits the exponent range: see the ranges below.</p>",
        "<h2>Forms and bases compared</h2>",
        _table(("form and basis", unit, "answer"), rows),
        "<h2>Error against precision</h2>",
        _curves(report.answers, unit),
    ]
    if report.errors:
        body = [(str(i + 1), "not limited" if e is None else f"{e:.3g}") for i, e in enumerate(report.errors)]
        parts += ["<h2>Error of each state at the answer</h2>", _table(("state", "error / tolerance"), body)]
    if report.ranges:
        ranges = [(name, _power(2, low), _power(2, high)) for name, low, high in report.ranges]
        parts += ["<h2>Range of the numbers</h2>", _table(("numbers", "smallest", "largest"), ranges)]
    about = "\n".join(f"{key}: {value}" for key, value in report.versions.items())
    parts += [
        "<h2>How to reproduce this report</h2>",
        f"<pre>{html.escape(report.command or 'gpbnb.wordlength.report.study(...)')}\n\n{html.escape(about)}</pre>",
    ]
    title = html.escape(f"Wordlength for {report.name}")
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta name="viewport" '
        f'content="width=device-width, initial-scale=1">\n<title>{title}</title>\n<style>{_STYLE}</style>\n</head>\n'
        f"<body>\n<main>\n{chr(10).join(part for part in parts if part)}\n</main>\n</body>\n</html>\n"
    )


def _numbers(limits: Sequence[float | None]) -> str:
    return ", ".join("any" if each is None else f"{each:.6g}" for each in limits)


def _table(header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    head = "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in header)
    lines = ("".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in body)
    return (
        f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n"
        + "\n".join(f"<tr>{line}</tr>" for line in lines)
        + "\n</tbody>\n</table>"
    )


_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def _power(base: int, exponent: int) -> str:
    return f"{base}{str(exponent).translate(_SUPERSCRIPTS)}"


_COLOURS = 6  # of _STYLE, one a form
_DASHES = (("", "solid"), ("7 3", "dashed"), ("2 3", "dotted"), ("9 3 2 3", "double"))  # one a basis


def _curves(answers: Sequence[Answer], unit: str) -> str:
    """Draw error / tolerance against precision as inline SVG; the dashed line is the tolerance."""
    points = [(t, r) for each in answers for t, r in each.tried if r is not None and r > 0]
    if len(points) < 2:
        return "<p>Too few precisions have a finite error for a figure.</p>"
    left, right = min(t for t, _ in points), max(t for t, _ in points)
    logs = [math.log10(r) for _, r in points]
    low, high = math.floor(min(0.0, *logs)), math.ceil(max(0.0, *logs))

    def place(t: float, log: float) -> tuple[float, float]:
        return 60 + 560 * (t - left) / max(right - left, 1), 30 + 250 * (high - log) / max(high - low, 1)

    drawn = []
    for log in range(low, high + 1, max(1, (high - low) // 6)):
        _, y = place(left, log)
        drawn.append(f'<text x="52" y="{y + 4:.1f}" text-anchor="end">{_power(10, log)}</text>')
        drawn.append(f'<line x1="60" x2="620" y1="{y:.1f}" y2="{y:.1f}" stroke="var(--grid)"/>')
    for t in range(left, right + 1, max(1, (right - left) // 8)):
        x, _ = place(t, low)
        drawn.append(f'<text x="{x:.1f}" y="302" text-anchor="middle">{t}</text>')
    _, one = place(left, 0)
    drawn.append(f'<line x1="60" x2="620" y1="{one:.1f}" y2="{one:.1f}" stroke="var(--text)" stroke-dasharray="6 4"/>')
    legend = []
    bases = list(dict.fromkeys(each.basis for each in answers))
    forms = list(dict.fromkeys(each.label.removesuffix(each.basis) for each in answers))
    for each in answers:
        form, basis = forms.index(each.label.removesuffix(each.basis)), bases.index(each.basis)
        colour, (dash, border) = f"var(--c{form % _COLOURS})", _DASHES[basis % len(_DASHES)]
        line = [place(t, math.log10(r)) for t, r in each.tried if r is not None and r > 0]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in line)
        drawn.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2" stroke-dasharray="{dash}"/>'
        )
        drawn += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in line]
        legend.append(f'<li><i style="border-top: .2rem {border} {colour}"></i>{html.escape(each.label)}</li>')
    return (
        '<svg viewBox="0 0 640 336" role="img" aria-label="Error divided by tolerance, against precision; one line '
        f'for each form and basis" font-size="12" font-family="system-ui, sans-serif">{"".join(drawn)}'
        '<text x="4" y="17">error / tolerance</text>'
        f'<text x="340" y="329" text-anchor="middle">{html.escape(unit)}</text></svg>'
        f'<ul class="legend">{"".join(legend)}</ul>'
        "<p>Error or bound, divided by the tolerance. The dashed line marks the tolerance.</p>"
    )
