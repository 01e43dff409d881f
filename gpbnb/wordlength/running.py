"""Answer a question of the command line, and write its report."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64, NAMED, format_text
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guarantee import limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.files import replace_file
from gpbnb.filters.forms import CONSTANT_GAIN
from gpbnb.filters.model import LinearModel
from gpbnb.filters.settled import settled_filter
from gpbnb.filters.simulation import simulated_inputs, simulated_measurements
from gpbnb.filters.system import LinearSystem
from gpbnb.filters.words import WordFormats
from gpbnb.wordlength.answer import Basis
from gpbnb.wordlength.bounding import guarantee
from gpbnb.wordlength.c_files import refuse_others
from gpbnb.wordlength.code import VECTORS, write_code
from gpbnb.wordlength.emulation import emulate
from gpbnb.wordlength.models import FilterSource, read_filter, read_measurements
from gpbnb.wordlength.options import QUANTITIES, WRITTEN
from gpbnb.wordlength.report import DEFAULT_STEPS, Part, Question, Report, usual_steps


class CommandInput(NamedTuple):
    """What a command line asks, with the files that it names as they were read.

    Parameters
    ----------
    options : the options, as :func:`gpbnb.wordlength.options.read` returns them.
    own : the model in its file; with a constant gain, the question is about a linear system.
    question : the question.
    origin : where measurements or inputs come from.
    """

    options: argparse.Namespace
    own: LinearModel | LinearSystem
    question: Question
    origin: str


class Certified(NamedTuple):
    """The text of a certificate, and the format for which it proves a guarantee."""

    text: str
    fmt: FloatFormat | FixedFormat


class WrittenCode(NamedTuple):
    """The files of a filter in C, and the format in which it computes."""

    files: tuple[Path, ...]
    fmt: FloatFormat | FixedFormat | WordFormats


def read_files(options: argparse.Namespace) -> CommandInput:
    """Read the files of a command line, and reject those that do not fit the others or its options."""
    if options.code:
        refuse_others(options.code, "filter")
    source, own = _filter(options)
    bases: Sequence[Basis] = options.basis or ("emulation", "guarantee" if options.fixed else "bound")
    z, origin = _inputs(options, source.model, bases, own)
    fmt, rounding = _format(options), Rounding(options.rounding or "nearest")
    question = Question(
        source,
        options.tolerance,
        z,
        options.steps,
        "innovation" if options.form in (None, CONSTANT_GAIN) else options.form,
        bases,
        None if options.fixed else _limits(options, bases, source.model),
        FloatFormat(options.base or 2, 2, rounding, options.emin, options.emax),
        fmt,
        options.mixed,
        options.fixed,
        options.coefficients,
        options.seed or 0,
    )
    return CommandInput(options, own, question, origin)


def _filter(given: argparse.Namespace) -> tuple[FilterSource, LinearModel | LinearSystem]:
    """Return the filter of a command line, with a constant gain as a linear system; and the model in its file."""
    read = read_filter(given.model, read_measurements(given.inputs) if given.inputs else None)
    if given.form != CONSTANT_GAIN:
        return read, read.model
    if isinstance(read.model, LinearSystem):
        raise _no_form(given)
    settled = settled_filter(read.model)
    return FilterSource(settled, {CONSTANT_GAIN: settled}), read.model


def _no_form(given: argparse.Namespace) -> ValueError:
    return ValueError(f"got --form {given.form} for a linear system; needed none: only a Kalman filter has forms")


def _inputs(
    given: argparse.Namespace,
    model: LinearModel | LinearSystem,
    bases: Sequence[Basis],
    own: LinearModel | LinearSystem,
) -> tuple[Any, str]:
    """Return the measurements or inputs of a command line, None if a model simulates them, and their origin.

    `own` is the model in its file, which simulates the measurements of its filter with a constant gain.
    """
    z = read_measurements(given.measurements) if given.measurements else None
    source = (
        str(given.measurements).encode(errors="surrogateescape").decode(errors="backslashreplace")
        if z is not None
        else ""
    )
    if z is not None:
        _check_rows(given, z, model)
    if isinstance(model, LinearSystem):
        if given.form not in (None, CONSTANT_GAIN):
            raise _no_form(given)
        if given.mixed and not given.fixed:
            raise ValueError("got --mixed for a linear system; needed --fixed with it: only a Kalman filter has blocks")
        if given.simulate and given.form == CONSTANT_GAIN:
            raise _simulates_itself(given)
        if given.form == CONSTANT_GAIN and z is None:
            z = simulated_measurements(cast(LinearModel, own), given.steps or usual_steps(own), given.seed or 0)
            return z, f"simulated by the model, seed {given.seed or 0}"
        if given.simulate:
            z = simulated_inputs(given.simulate, _level(given), given.steps or DEFAULT_STEPS, model.m, given.seed or 0)
            source = f"simulated, {given.simulate} of level {_shown(_level(given))}"
        if z is None and (given.fixed or {"emulation", "bound"} & {*bases}):
            raise ValueError(
                "got a linear system without inputs; needed --measurements, a CSV file with its inputs, or --simulate"
            )
    elif given.fixed:
        raise ValueError(
            "got --fixed for a Kalman filter; needed --format, such as --format Q15, to judge fixed point, or --form "
            '"constant gain"'
        )
    elif given.simulate:
        raise _simulates_itself(given)
    return z, source


def _simulates_itself(given: argparse.Namespace) -> ValueError:
    return ValueError(
        f"got --simulate {given.simulate} for a Kalman filter; needed none: its model simulates its measurements"
    )


def _check_rows(given: argparse.Namespace, z: NDArray[np.float64], model: LinearModel | LinearSystem) -> None:
    """Reject a file with other columns than the model has measurements or inputs, or with other rows than steps."""
    kind = "input" if isinstance(model, LinearSystem) and given.form != CONSTANT_GAIN else "measurement"
    rows, columns = z.shape
    if columns != model.m:
        raise ValueError(
            f"{given.measurements.name}: got {columns} columns; needed {model.m}, one for each {kind}; remove others, "
            "such as the time, and write decimal points, not commas"
        )
    if given.steps not in (None, rows):
        raise ValueError(
            f"{given.measurements.name}: got {rows} rows and --steps {given.steps}; needed one row for each step; "
            "leave --steps away, which is for simulated numbers"
        )


def certificate(asked: CommandInput, report: Report) -> Certified:
    """Return the certificate of the first guarantee in a report, or reject a report without one."""
    part = _part(asked, report, "guarantee")
    digits = next(each.digits for each in report.answers if each.label == part.label)
    if digits is None:
        raise ValueError("got no precision with a guarantee; needed one for a certificate; allow a larger tolerance")
    fmt = asked.question.fmt or replace(asked.question.like, precision=digits)
    found = guarantee(part.model, fmt, limits(**_sizes(asked.options)), form=part.form, horizon=report.steps)
    return Certified(found.certificate(), fmt)


def _part(asked: CommandInput, report: Report, basis: str) -> Part:
    """Return the single question on a basis, for the form or the structure of the answer."""
    return next(each for each in asked.question.parts() if each.basis == basis and each.structure == report.structure)


def write_code_of(asked: CommandInput, report: Report) -> WrittenCode:
    """Write the filter of a command line as C, into the folder of its option ``--code``.

    The format is the one that is judged, or the answer in fixed point, or else the first of binary32 and binary64 that
    meets the tolerance, on the first basis. A digital filter has the structure that gives the answer of the report.
    """
    folder, form, own, question, z = asked.options.code, asked.options.form, asked.own, asked.question, asked.question.z
    fmt: Any = report.formats if question.fixed else question.fmt or _type_within_tolerance(asked, report)
    within = limits(measurement=np.abs(z).max(axis=0)) if question.fixed else question.within
    if not isinstance(own, LinearModel):
        design, structures = question.source.design, question.source.structures
        model: Any = design or structures.get(report.structure) or question.model
        form = report.structure if design else None
        return WrittenCode(write_code(model, fmt, folder, form=form, within=within), fmt)
    if z is None:
        z = simulated_measurements(own, question.count, question.seed)
    vectors = None if np.isnan(z[:VECTORS]).any() else z[:VECTORS]
    return WrittenCode(write_code(own, fmt, folder, form=form, inputs=vectors, within=within), fmt)


def _type_within_tolerance(asked: CommandInput, report: Report) -> FloatFormat:
    """Return binary32 if it meets the tolerance of a command line, else binary64."""
    question = asked.question
    part = _part(asked, report, question.bases[0])
    for fmt in (BINARY32, BINARY64):
        if replace(question, fmt=fmt).answer(part, question.z).met:
            return fmt
    raise ValueError(
        f"got --code {asked.options.code}, and neither binary32 nor binary64 meets the tolerance; needed a larger "
        "tolerance, or --format with fixed point"
    )


def uncovered(proof: Certified | None, code: WrittenCode) -> str:
    """Say that a certificate does not cover code in another format; empty if it does, or if there is none."""
    if proof is None or code.fmt == proof.fmt or isinstance(code.fmt, WordFormats):
        return ""
    name = format_text(code.fmt)
    return f"the certificate does not cover this code, which is in {name}: add --format {name} for both in one format"


def write(report: Report, page: Path) -> None:
    """Write a report as a page and as JSON of the same name; each file is written completely or not at all."""
    replace_file(page, report.to_html().encode())
    replace_file(page.with_suffix(".json"), f"{report.to_json()}\n".encode())


def write_run(asked: CommandInput, report: Report, file: Path) -> None:
    """Write each step of a run in the format of the answer as CSV: estimates or outputs, and their errors."""
    question, (_, _, model, form, _) = asked.question, _part(asked, report, asked.question.bases[0])
    seed = question.seed if question.z is None else 0
    run = emulate(model, question.data, report.formats, form=form, seed=seed)
    numbers = run.x if isinstance(model, LinearModel) else run.y
    kind = "output" if run.form is None else "state"
    names = report.names or [f"{kind} {i}" for i in range(run.errors.shape[1])]
    lines = [WRITTEN, ",".join(["step", *names, *(f"error of {name}" for name in names)])]
    values = np.zeros((0, len(names))) if numbers is None else numbers.to_float()
    lines += [",".join(map(repr, [k, *row])) for k, row in enumerate(np.hstack([values, run.errors]).tolist(), 1)]
    replace_file(file, ("\n".join(lines) + "\n").encode())


def _level(given: argparse.Namespace) -> Any:
    return 1.0 if given.level is None else np.asarray(exact(given.level), dtype=np.float64)


def _shown(level: Any) -> str:
    return ", ".join(f"{each:.6g}" for each in np.ravel(level).tolist())


def _format(given: argparse.Namespace) -> FloatFormat | FixedFormat | None:
    """Return the one format that is judged; None for a search."""
    rounding = None if given.rounding is None else Rounding(given.rounding)
    if given.format is None:
        if given.digits is None:
            return None
        return FloatFormat(given.base or 2, given.digits, rounding or Rounding.NEAREST, given.emin, given.emax)
    fmt = NAMED[given.format] if isinstance(given.format, str) else FixedFormat(*given.format)
    return fmt if rounding is None else replace(fmt, rounding=rounding)


def _sizes(given: argparse.Namespace) -> dict[str, Any]:
    """Return the largest sizes of a command line, by the quantity that each limits."""
    return {each: size for each in QUANTITIES if (size := getattr(given, each)) is not None}


def _limits(
    given: argparse.Namespace, bases: Sequence[Basis], model: LinearModel | LinearSystem
) -> FilterLimits | None:
    """Return the limits that the bases need; None if they need none."""
    bounds = [each for each in bases if each in ("guarantee", "probable")]
    if not bounds:
        return None
    of_system, sizes = isinstance(model, LinearSystem), _sizes(given)
    needed = "--measurement" if of_system else "--state and --innovation, or --measurement"
    if not sizes or (of_system and set(sizes) != {"measurement"}):
        options = ", ".join(f"--{each}" for each in sizes)
        raise ValueError(f"got --basis {bounds[0]} with {options or 'no limits'}; needed {needed}")
    return limits(**sizes)
