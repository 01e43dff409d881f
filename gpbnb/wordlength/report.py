"""A report on the wordlength of one filter, computed once and written as JSON and as one HTML page."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import format_text
from gpbnb.arithmetic.rounding import digit_unit, digits_text
from gpbnb.bounds.guess import FilterLimits
from gpbnb.files import WRITTEN, machine
from gpbnb.filters.blocks import BlockFormats
from gpbnb.filters.forms import Form, form_named
from gpbnb.filters.model import LinearModel
from gpbnb.filters.poles import stored_response
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.word_formats import WordFormats
from gpbnb.wordlength.answer import Basis, Kind, Requirement, format_in_words
from gpbnb.wordlength.asked import exactly, is_filter, kind_of, tolerances_of
from gpbnb.wordlength.emulation import emulate
from gpbnb.wordlength.models import FilterSource
from gpbnb.wordlength.options import IN_FIXED_POINT
from gpbnb.wordlength.required import judge, required_precision

SIDE_BY_SIDE = (Form.INNOVATION, Form.JOSEPH, Form.UD)
"""Forms that a report compares; the requested form comes first."""

BITS = FloatFormat(2, 2)
"""What is searched if nothing else is asked: binary, rounded to nearest, with unlimited exponents."""


@dataclass(frozen=True)
class Question:
    """What is asked about one filter, by the command or by a script.

    Parameters
    ----------
    source : the filter, perhaps in several structures. The first gives the answer, or, if the source compares all, that
        which needs the fewest digits on the first basis.
    tolerance, form, bases, within : as in :func:`gpbnb.required_precision`; the first basis gives the answer.
    z : (steps, m), measurements or inputs; or the number of steps of what needs none.
    origin : where they come from.
    like : a format with the base, the rounding and the range of those to search.
    fmt : the one format to judge, in place of a search.
    kind, coefficient_bits : what is searched, as in :func:`gpbnb.required_precision`.
    own : the model in its file, if the question is about its filter with a constant gain.
    """

    source: FilterSource
    tolerance: str | float | Sequence[str | float]
    z: Any
    origin: str = "given"
    form: str = "innovation"
    bases: Sequence[Basis] = ("emulation", "bound")
    within: FilterLimits | None = None
    like: FloatFormat = BITS
    fmt: FloatFormat | FixedFormat | None = None
    kind: Kind = "float"
    coefficient_bits: int | None = None
    own: LinearModel | None = None

    @property
    def model(self) -> Any:
        """The filter in its first structure."""
        return self.source.model

    @property
    def steps(self) -> int:
        """Number of steps."""
        return self.z if isinstance(self.z, int) else len(self.z)

    def parts(self) -> list[Part]:
        """Return the single questions, one for each basis and form or structure."""
        model, form = self.model, form_named(self.form)
        if not is_filter(model):
            systems = self.source.structures or {"": model}
            return [
                Part(f"{name}, {basis}" if name else basis, basis, each, None, name)
                for name, each in systems.items()
                for basis in self.bases
            ]
        model.check_sizes()
        has_forms = self.kind != "blocks" and getattr(model, "method", "extended") == "extended"
        forms = [form, *(each for each in SIDE_BY_SIDE if each is not form and has_forms)]
        return [Part(f"{each}, {basis}", basis, model, each) for each in forms for basis in self.bases]

    def answer(self, part: Part) -> Requirement:
        """Answer one of the single questions, by a search or by judging the one format."""
        asked: dict[str, Any] = {"form": part.form, "basis": part.basis}
        asked["within"] = self.within if part.basis in ("guarantee", "probable") else None
        if self.fmt is not None:
            return judge(part.model, self.fmt, self.z, self.tolerance, **asked)
        if self.kind in IN_FIXED_POINT:
            asked |= {"rounding": self.like.rounding, "coefficient_bits": self.coefficient_bits}
        else:
            asked["like"] = self.like
        return required_precision(part.model, self.z, self.tolerance, kind=self.kind, **asked)


class Part(NamedTuple):
    """One basis, and one form or structure, of a question."""

    label: str
    basis: Basis
    model: Any
    form: Form | None
    structure: str = ""


class Report(NamedTuple):
    """What the command found.

    Parameters
    ----------
    entries : plain numbers and texts, as in the JSON file. None stands for a number that is missing or infinite.
        `answers` has one for each basis and form or structure, the requested one first; `errors` are over tolerances.
    found : the single questions, each with its answer.
    part, answer : those that `entries` tells first.
    """

    entries: dict[str, Any]
    found: list[tuple[Part, Requirement]]
    part: Part
    answer: Requirement

    def to_json(self) -> str:
        """Return the report as JSON, without NaN or infinity."""
        return json.dumps(self.entries, indent=1, ensure_ascii=False, allow_nan=False)

    def to_html(self) -> str:
        """Return the report as one HTML page that needs no other file."""
        return page(self.entries)


def study(asked: Question, command: str = "", tell: Callable[[str], Any] = lambda text: None) -> Report:
    """Find the answer for each basis and form or structure, and collect what explains it.

    `command` reproduces the report, `tell` is called with a line of text before and after each search.
    """
    parts, structures = asked.parts(), asked.source.structures
    lacking = dict(asked.source.lacking) if len(structures) > 1 else {}
    found: list[tuple[Part, Requirement]] = []
    for part in parts:
        tell(f"{part.label} …")
        answer = asked.answer(part)
        found.append((part, answer))
        tell(f"{part.label}: {answer}")
    for name, why in lacking.items():
        tell(f"{name}, left out: {why}")
    first, main = _fewest(found) if asked.source.compares_all else found[0]
    met, model, fmt, within = main.met, asked.model, asked.fmt, asked.within
    stored = _stored(structures.get(first.structure), main) if met else ""
    if stored:
        tell(f"{first.structure}: {stored}")
    count = model.n if is_filter(model) else getattr(model, "p", np.size(asked.tolerance))
    tolerances = tolerances_of(asked.tolerance, count, "outputs")
    like = fmt or asked.like
    errors = _errors(model, asked.z, main.format if met else None, asked.form, tolerances)
    entries = {
        "written": WRITTEN,
        "name": getattr(model, "name", getattr(model, "__name__", "a function")),
        "kind": "Kalman filter" if isinstance(model, LinearModel) else kind_of(model).removeprefix("a "),
        "digits": main.digits if met else None,
        "text": f"{first.structure}: {main}" if len(structures) > 1 else str(main),
        "base": like.base,
        "rounding": like.rounding.value,
        "steps": asked.steps,
        "tolerance": [
            _finite(float(exactly(each))) for each in np.broadcast_to(asked.tolerance, len(tolerances)).tolist()
        ],
        "source": asked.origin,
        "answers": [
            {
                "label": part.label,
                "basis": answer.basis,
                "digits": answer.digits if answer.met else None,
                "text": str(answer),
                "tried": [(digits, _finite(ratio)) for digits, ratio in answer.tried],
            }
            for part, answer in found
        ],
        "errors": errors,
        "command": command,
        "versions": machine(),
        "limits": {} if within is None else {key: list(map(_finite, each)) for key, each in within._asdict().items()},
        "format": "" if fmt is None else format_text(fmt),
        "met": met,
        "names": getattr(model, "state_names" if is_filter(model) else "output_names", ()),
        "measurement_names": getattr(model, "measurement_names" if is_filter(model) else "input_names", ()),
        "exponents": _exponents(like),
        "fixed": asked.kind in IN_FIXED_POINT,
        "structure": first.structure,
        "lacking": lacking,
        "stored": stored,
        "shortest": _shorter(found, main, fmt is not None),
    }
    return Report(entries, found, first, main)


def _stored(system: LinearSystem | None, answer: Requirement) -> str:
    """Return in words what storing the coefficients does to a linear system at an answer; empty for another model."""
    fmt = answer.format
    if (
        system is None
        or not isinstance(fmt, FloatFormat | FixedFormat | WordFormats)
        or not system.as_filter().program.is_linear
    ):
        return ""
    kept = fmt if not isinstance(fmt, WordFormats) else fmt.coefficients or fmt.data
    words = digits_text(kept, kind="significant") if isinstance(kept, int) else format_in_words(kept)
    try:
        return str(stored_response(system, fmt)._replace(format=words))
    except (ValueError, OverflowError):  # a filter that is not stable has no response
        return ""


def _fewest(
    found: Sequence[tuple[Part, Requirement]],
) -> tuple[Part, Requirement]:
    """Return the answer with the fewest digits on the first basis, in fixed point with the shortest word.

    Among equals, it is the one with the smallest error; the first of all if none is met.
    """
    of_basis = [(part, each) for part, each in found if part.basis == found[0][0].basis]
    met = [(part, each) for part, each in of_basis if each.met]

    return min(met or of_basis[:1], key=lambda pair: (_length(pair[1]), pair[1].ratio))


def _length(answer: Requirement) -> int:
    """Return the digits of a format, or the bits of a word without its sign."""
    fmt = answer.format.data if isinstance(answer.format, WordFormats) else answer.format
    return 0 if fmt is None or isinstance(fmt, BlockFormats) else int(fmt.precision)


def _shorter(found: Sequence[tuple[Part, Requirement]], answer: Requirement, judged: bool) -> str:
    """Name the structure that needs fewer digits than an answer, or that meets the tolerance where it does not."""
    part, best = _fewest(found)
    if not (part.structure and best.met and best is not answer) or (answer.met and _length(best) >= _length(answer)):
        return ""
    named = f'{part.structure}, {{}} (structure = "{part.structure}", or "all")'
    fmt: Any = best.format
    if judged:
        return named.format(f"which meets the tolerance in {format_in_words(fmt)}")
    if isinstance(fmt, WordFormats):
        return "shortest: " + named.format(f"word of {1 + _length(best)} bits")
    return "fewest digits: " + named.format(digits_text(_length(best), fmt.base))


def _errors(model: Any, z: Any, fmt: Any, form: str, tolerances: np.ndarray) -> tuple[float | None, ...]:
    """Return the largest error / tolerance of each state of a Kalman filter at the answer."""
    if fmt is None or not is_filter(model):
        return ()
    largest = emulate(model, z, fmt, form=form).largest
    return tuple(_finite(float(e / t)) if math.isfinite(t) else None for e, t in zip(largest, tolerances, strict=True))


def _exponents(fmt: FloatFormat | FixedFormat) -> str:
    """Describe the range of the exponents; empty if it is unlimited."""
    if isinstance(fmt, FixedFormat):
        return f"none: fixed point, from {float(fmt.lowest):.6g} to {float(fmt.largest):.6g}"
    return "" if fmt.limits is None else f"{fmt.emin} to {fmt.emax}"


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


# -- the page -------------------------------------------------------------------------------------------------

_STYLE = """
:root { color-scheme: light dark }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 46rem; margin: 2rem auto; padding: 0 1rem;
  overflow-wrap: anywhere }
h1 { font-size: 1.6rem; line-height: 1.25 } h2 { font-size: 1.2rem; margin-top: 2rem; break-after: avoid }
table { border-collapse: collapse; width: 100% } tr, pre { break-inside: avoid }
th, td { text-align: left; padding: .25rem .8rem .25rem 0; vertical-align: top; border-bottom: 1px solid GrayText }
th, td { overflow-wrap: break-word } td:first-child { min-width: 6rem } td:last-child { overflow-wrap: anywhere }
pre { white-space: pre-wrap; font-size: .85rem }
.answer { font-size: 1.25rem; border-left: .3rem solid; padding-left: .8rem }
@page { size: A4; margin: 14mm } @media print { body { font-size: 11px; max-width: none; margin: 0; padding: 0 } }
"""


_MEANINGS = {
    "emulation": "An emulation holds for these {}.",
    "bound": "A bound holds for the arithmetic of this run, whatever its roundings.",
    "guarantee": "A guarantee holds for ever, for all {} within the limits.",
    "probable": "A probable error is three standard deviations, if roundings are independent of each other and values "
    "are as large as the limits allow.",
}


def page(entries: dict[str, Any]) -> str:
    """Return the entries of a report as a self-contained HTML page."""
    report = SimpleNamespace(**entries)
    kind, base = ("fraction", 2) if report.fixed else ("", report.base)
    unit = f"{kind} {digit_unit(base)}".strip()
    of = {"state": report.names, "innovation": report.measurement_names, "measurement": report.measurement_names}
    of_filter = report.kind.endswith("filter")
    what, given = ("Form", "measurements") if of_filter else ("Structure", "inputs")
    meant = [_MEANINGS[each].format(given) for each in dict.fromkeys(each["basis"] for each in report.answers)]
    if not report.exponents and not report.fixed:
        meant.append("These runs have unlimited exponents; a format that is judged has its own range.")
    rows = [
        (each["label"], "none" if each["digits"] is None else str(each["digits"]), each["text"])
        for each in report.answers
    ]
    tried = [
        (each["label"], ", ".join(f"{t}: {ratio:.3g}" for t, ratio in each["tried"] if ratio is not None))
        for each in report.answers
    ]
    question = [
        ("steps", f"{report.steps}"),
        (given, report.source),
        ("tolerance", _numbers(report.tolerance, report.names)),
        *((f"limit on the {name}", _numbers(each, of.get(name, ()))) for name, each in report.limits.items()),
        ("rounding", report.rounding),
        *([("exponents", report.exponents)] if report.exponents else []),
    ]
    states = report.names or [str(i + 1) for i in range(len(report.errors))]
    shares = ["not limited" if each is None else f"{each:.3g}" for each in report.errors]
    of_states = list(zip(states, shares, strict=True)) if shares else []
    about = "\n".join(f"{key}: {value}" for key, value in report.versions.items())
    each_form = f"{what.lower()} and basis"
    parts = [
        f"<h1>Wordlength for {html.escape(report.name)}</h1>",
        f'<p class="answer">{html.escape(report.text)}.</p>',
        f"<p>{html.escape(report.shortest[:1].upper() + report.shortest[1:])}.</p>" if report.shortest else "",
        f"<p>At this answer, {html.escape(report.stored)}.</p>" if report.stored else "",
        _section("Basis of the answer", ("question", "value"), question),
        f"<p>{' '.join(meant)}</p>",
        _section(f"{what}s and bases compared", (each_form, unit, "answer"), rows),
        *(f"<p>{html.escape(f'Left out: {name}: {why}')}.</p>" for name, why in report.lacking.items()),
        _section("Error / tolerance at each precision", (each_form, f"{unit}: error / tolerance"), tried),
        _section("Error of each state at the answer", ("state", "error / tolerance"), of_states),
        "<h2>How to reproduce this report</h2>",
        f"<pre>{html.escape(report.command or 'gpbnb.wordlength.report.study(...)')}\n\n{html.escape(about)}</pre>",
    ]
    return _PAGE.format(
        written=WRITTEN,
        title=html.escape(f"Wordlength for {report.name}"),
        style=_STYLE,
        body="\n".join(filter(None, parts)),
    )


_PAGE = """<!doctype html>
<!-- {written} -->
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""


def _numbers(limits: Sequence[float | None], names: Sequence[str] = ()) -> str:
    """List numbers, each after its name if there are names."""
    texts = ["any" if each is None else f"{each:.6g}" for each in limits]
    if len(names) == len(texts):
        texts = [f"{name}: {text}" for name, text in zip(names, texts, strict=True)]
    return ", ".join(texts)


def _section(heading: str, header: Sequence[str], body: Sequence[Sequence[str]]) -> str:
    """Return a table below its heading; nothing if it has no rows."""
    head = "".join(f'<th scope="col">{html.escape(cell)}</th>' for cell in header)
    lines = ["".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in body]
    rows = "\n".join(f"<tr>{line}</tr>" for line in lines)
    table = f"<table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody>\n</table>"
    return f"<h2>{heading}</h2>\n{table}" if lines else ""
