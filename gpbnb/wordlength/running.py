"""Answer a question of the command line, and write its report."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.fixed import FixedFormat
from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.named import BINARY32, BINARY64, NAMED
from gpbnb.arithmetic.rational import exact
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.bounds.guarantee import Guarantee, limits
from gpbnb.bounds.guess import FilterLimits
from gpbnb.files import WRITTEN, replace_file
from gpbnb.filters.forms import CONSTANT_GAIN
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import whole_number
from gpbnb.filters.nonlinear_run import simulated
from gpbnb.filters.settled import settled_filter
from gpbnb.filters.simulation import simulated_inputs
from gpbnb.filters.system import LinearSystem
from gpbnb.wordlength.answer import Basis, format_in_words
from gpbnb.wordlength.asked import CANNOT, FUNCTION, is_filter, kind_of
from gpbnb.wordlength.bounding import guarantee
from gpbnb.wordlength.c_files import refuse_others
from gpbnb.wordlength.code import VECTORS, write_code
from gpbnb.wordlength.emulation import emulate
from gpbnb.wordlength.models import FilterSource, read_filter, read_measurements
from gpbnb.wordlength.options import IN_FIXED_POINT, QUANTITIES, printable
from gpbnb.wordlength.report import Question, Report

DEFAULT_STEPS = 1000
"""Steps that are simulated if no number is given."""


def read_files(options: argparse.Namespace) -> Question:
    """Read the files of a command line, and reject those that do not fit the others or its options."""
    if options.code:
        refuse_others(options.code, "filter")
    source = read_filter(options.model, read_measurements(options.inputs) if options.inputs else None)
    own, settles = source.model, options.form == CONSTANT_GAIN
    if options.form and not is_filter(own):
        raise ValueError(f"got --form {options.form} for {kind_of(own)}; needed none: only a Kalman filter has forms")
    if settles:
        if not isinstance(own, LinearModel):
            raise ValueError(f"got --form {options.form!r} for {kind_of(own)}, whose gain depends on estimates")
        settled = settled_filter(own)
        source = FilterSource(settled, {CONSTANT_GAIN: settled})
    of_system, kind = isinstance(source.model, LinearSystem), kind_of(source.model)
    usual = {"float": "bound", "blocks": ""}.get(options.kind, "guarantee" if of_system else "bound")
    usual = "" if kind in CANNOT["be bounded along a run"] else usual
    bases: Sequence[Basis] = options.basis or tuple(filter(None, ("emulation", usual)))
    z, origin = _data(options, source.model, own)
    if isinstance(z, int) and not (kind == FUNCTION and options.steps) and {"emulation", "bound"} & {*bases}:
        other = "--steps, if it takes none" if kind == FUNCTION else "--simulate"
        raise ValueError(f"got {kind} without inputs; needed --measurements, a CSV file with its inputs, or {other}")
    rounding = Rounding(options.rounding or "nearest")
    return Question(
        source,
        options.tolerance,
        z,
        origin,
        "innovation" if settles or not options.form else options.form,
        bases,
        _limits(options, bases, of_system, z),
        FloatFormat(options.base or 2, 2, rounding, options.emin, options.emax),
        _format(options),
        options.kind,
        options.coefficients,
        own if settles else None,
    )


def _data(given: argparse.Namespace, model: Any, own: Any) -> tuple[Any, str]:
    """Return the measurements or inputs of a command line, or the number of steps of what needs none; and their origin.

    `own` is the model in its file, which simulates the measurements of its filter with a constant gain.
    """
    if given.measurements:
        z = read_measurements(given.measurements)
        _check_rows(given, z, model)
        return z.ravel() if kind_of(model) == FUNCTION and z.shape[1] == 1 else z, printable(str(given.measurements))
    described = own.steps if is_filter(own) else None
    steps, seed = given.steps or described or DEFAULT_STEPS, given.seed or 0
    if given.simulate and (is_filter(own) or kind_of(own) == FUNCTION):
        why = "its model simulates its measurements" if is_filter(own) else "give --measurements, whose rows it takes"
        raise ValueError(f"got --simulate {given.simulate} for {kind_of(own)}; needed none: {why}")
    if is_filter(own):
        return simulated(own, whole_number("steps", steps), seed), f"simulated by the model, seed {seed}"
    if not given.simulate:
        return whole_number("steps", steps), "none"
    level = 1.0 if given.level is None else np.asarray(exact(given.level), dtype=np.float64)
    shown = ", ".join(f"{each:.6g}" for each in np.ravel(level).tolist())
    z = simulated_inputs(given.simulate, level, steps, model.m, seed)
    return z, f"simulated, {given.simulate} of level {shown}"


def _check_rows(given: argparse.Namespace, z: NDArray[np.float64], model: Any) -> None:
    """Reject a file with other columns than the model has measurements or inputs, or with other rows than steps."""
    kind = "measurement" if is_filter(model) or given.form == CONSTANT_GAIN else "input"
    rows, columns = z.shape
    if kind_of(model) != FUNCTION and columns != model.m:
        raise ValueError(
            f"{given.measurements.name}: got {columns} columns; needed {model.m}, one for each {kind}; remove others, "
            "such as the time, and write decimal points, not commas"
        )
    if given.steps not in (None, rows):
        raise ValueError(
            f"{given.measurements.name}: got {rows} rows and --steps {given.steps}; needed one row for each step; "
            "leave --steps away, which is for simulated numbers"
        )


def certificate(asked: Question, report: Report) -> Guarantee:
    """Return the first guarantee in a report, which has a certificate, or reject a report without one."""
    structure = report.part.structure
    part, fmt = next(
        (each, answer.format)
        for each, answer in report.found
        if (each.basis, each.structure) == ("guarantee", structure)
    )
    if fmt is None:
        raise ValueError("got no precision with a guarantee; needed one for a certificate; allow a larger tolerance")
    within: Any = asked.within or _of_inputs(asked)
    return guarantee(part.model, fmt, within, form=part.form, horizon=asked.steps)  # type: ignore[arg-type]


def _of_inputs(asked: Question) -> FilterLimits:
    """Return limits on the inputs of a linear system that are no larger than those given."""
    return limits(measurement=np.abs(asked.z).max(axis=0))


def write_code_of(folder: Path, asked: Question, report: Report) -> tuple[tuple[Path, ...], Any]:
    """Write the filter of a command line as C into a folder; return files and format.

    The format is the one that is judged, or the answer in fixed point, or else the first of binary32 and binary64 that
    meets the tolerance, on the first basis. A digital filter has the structure that gives the answer of the report.
    """
    fixed, source, within = asked.kind in IN_FIXED_POINT, asked.source, asked.within
    types = (each for each in (BINARY32, BINARY64) if replace(asked, fmt=each).answer(report.part).met)
    fmt: Any = report.answer.format if fixed else asked.fmt or next(types, None)
    if fmt is None:
        raise ValueError(
            f"got --code {folder}, and neither binary32 nor binary64 meets the tolerance; needed a larger tolerance, "
            "or --format with fixed point"
        )
    if within is None and fixed and isinstance(asked.model, LinearSystem):
        within = _of_inputs(asked)
    model: Any = asked.own or source.design or source.structures.get(report.part.structure) or asked.model
    form = CONSTANT_GAIN if asked.own else report.part.structure if source.design else None
    if not is_filter(model):
        return write_code(model, fmt, folder, form=form, within=within), fmt
    vectors = None if np.isnan(asked.z[:VECTORS]).any() else asked.z[:VECTORS]
    return write_code(model, fmt, folder, form=form or asked.form, inputs=vectors, within=within), fmt


def uncovered(proved: Any, written: Any) -> str:
    """Say that a certificate for one format does not cover code in another; empty if it does."""
    if written == proved:
        return ""
    name = format_in_words(written)
    return f"the certificate does not cover this code, which is in {name}: add --format {name} for both in one format"


def write(report: Report, page: Path) -> None:
    """Write a report as a page and as JSON of the same name; each file is written completely or not at all."""
    replace_file(page, report.to_html().encode())
    replace_file(page.with_suffix(".json"), f"{report.to_json()}\n".encode())


def write_run(asked: Question, report: Report, file: Path) -> None:
    """Write each step of a run in the format of the answer as CSV: estimates or outputs, and their errors."""
    run = emulate(report.part.model, asked.z, report.answer.format, form=report.part.form)
    numbers = run.y if run.form is None else run.x
    kind = "output" if run.form is None else "state"
    names = report.entries["names"] or [f"{kind} {i}" for i in range(run.errors.shape[1])]
    lines = [f"# {WRITTEN}", ",".join(["step", *names, *(f"error of {name}" for name in names)])]
    values = np.zeros((0, len(names))) if numbers is None else numbers.to_float()
    lines += [",".join(map(repr, [k, *row])) for k, row in enumerate(np.hstack([values, run.errors]).tolist(), 1)]
    replace_file(file, ("\n".join(lines) + "\n").encode())


def _format(given: argparse.Namespace) -> FloatFormat | FixedFormat | None:
    """Return the one format that is judged; None for a search."""
    rounding = None if given.rounding is None else Rounding(given.rounding)
    if given.format is None:
        if given.digits is None:
            return None
        return FloatFormat(given.base or 2, given.digits, rounding or Rounding.NEAREST, given.emin, given.emax)
    fmt = NAMED[given.format] if isinstance(given.format, str) else FixedFormat(*given.format)
    return fmt if rounding is None else replace(fmt, rounding=rounding)


def _limits(given: argparse.Namespace, bases: Sequence[Basis], of_system: bool, z: Any) -> FilterLimits | None:
    """Return the limits that the bases need; None if they need none, or if those of the inputs serve."""
    bounds = [each for each in bases if each in ("guarantee", "probable")]
    sizes = {each: size for each in QUANTITIES if (size := getattr(given, each)) is not None}
    if not bounds or (not sizes and of_system and not isinstance(z, int)):
        return None
    needed = "--measurement" if of_system else "--state and --innovation, or --measurement"
    if not sizes or (of_system and set(sizes) != {"measurement"}):
        options = ", ".join(f"--{each}" for each in sizes)
        raise ValueError(f"got --basis {bounds[0]} with {options or 'no limits'}; needed {needed}")
    return limits(**sizes)
