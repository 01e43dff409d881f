"""gpbnb.report.guarantees.certificates: every guarantee of the book or of a stored table has a certificate or a reason.

A guarantee is found where it is computed, in the cells of the notebooks and in the modules of the report, and where it
is stored, in the rows of the tables.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from gpbnb.report.guarantees import certificates
from gpbnb.report.stored import SWEEPS

ROOT = Path(__file__).parents[2]
STATING = {
    "bounds_in_blocks",
    "case_guarantee",
    "error_coefficients",
    "from_schedule",
    "guarantee",
    "output_errors",
    "peak_gain",
    "required_fraction_bits",
}
"""Functions that compute guarantees; any call is one, too, that asks for the basis "guarantee"."""
BASES = {"guarantee", "bound", "probable", "emulation"}

CHAPTER = tuple(case.make().name for case in certificates.CASES)
TRACKER, NILE, TEN = "tracker, 0 m from its origin", "Nile, local level", "ten states"
WIDER = (TRACKER, "tracker, limits twice as wide", "tracker, limits four times as wide")
LEAST = "least precisions of the chapter's filters"
OUTPUTS = "outputs of digital filters and sums"
FIXED = "filters in fixed point with a constant gain"
YEAR = "Gravity Probe B over a number of steps"
DRAWN, LINEAR = "three thousand random Kalman filters", "two thousand random linear filters"
SMALLEST, STEPS = "filters of one state in three to six bits", "single steps, compared with Gappa"

COMPUTED: dict[tuple[str, str], tuple[str, ...]] = {
    ("code.ipynb", "required_precision(cascade, 1, 0.1, basis='guarantee', within=within)"): (OUTPUTS,),
    ("code.ipynb", "required_precision(cascade, 1, 0.1, basis='guarantee', within=wider)"): (OUTPUTS,),
    ("code.ipynb", "required_word_formats(scaled, inputs, 0.001, 'guarantee')"): (OUTPUTS,),
    ("guarantee.ipynb", "guarantee(tracker(), FloatFormat(2, 24), within)"): (TRACKER,),
    ("guarantee.ipynb", "('guarantee', 'probable')"): ("tracker within 0.01 m",),
    ("guarantee.ipynb", "guarantee(tracker(), FloatFormat(2, 24), wider)"): WIDER,
    ("guarantee.ipynb", "guarantee(slow, FloatFormat(2, 24), small, most=1000)"): ("ten states, innovation form",),
    ("guarantee.ipynb", "guarantee(slow, FloatFormat(2, 24), small, Form.UD)"): (TEN,),
    (
        "guarantee.ipynb",
        "guarantee(published.nile_local_level(), FloatFormat(2, 24), limits(1, 1, state=1500, innovation=1200))",
    ): (NILE,),
    (
        "guarantee.ipynb",
        "error_coefficients(given['A'], given['B'], given['C'], given['D'], given['input_bound'])",
    ): (FIXED,),
    ("processors.ipynb", "fixed_point.required_fraction_bits(given, data, goal, basis)"): (FIXED,),
    (
        "processors.ipynb",
        "fixed_point.required_fraction_bits(fixed_point.constant_gain(moved, z), z, [0.01, 0.01])",
    ): (FIXED,),
    ("processors.ipynb", "fixed_point.required_fraction_bits(livelier, minutes[0], goal, basis)"): (FIXED,),
    ("processors.ipynb", "('emulation', 'guarantee')"): (FIXED,),
    (
        "wordlength.ipynb",
        "required_precision(clock, 200, 0.05, basis='guarantee', within=limits(1, 1, measurement=0.1))",
    ): (OUTPUTS,),
    ("wordlength.ipynb", "required_precision(summed, 1, 1e-09, basis='guarantee', within=terms)"): (OUTPUTS,),
    (
        "gravity_probe_b/horizon.py",
        "bounds_in_blocks(year_model(MODELS[0], 2), fmt, within, assumed, steps, saved=saved)",
    ): (YEAR,),
    ("guarantees/comparison.py", "output_errors(LinearSystem.sum(1024, 'tree'), DOUBLE, 1.0)"): (OUTPUTS,),
    ("guarantees/comparison.py", "output_errors(make(), fmt, 1.0)"): (OUTPUTS,),
    ("guarantees/comparison.py", "peak_gain(made.A, made.B, made.C, made.D)"): (OUTPUTS,),
    (
        "guarantees/comparison.py",
        "error_coefficients(given['A'], given['B'], given['C'], given['D'], given['input_bound'])",
    ): (FIXED,),
    ("guarantees/gappa.py", "case_guarantee(case, case.make(), FORMAT)"): (STEPS,),
    ("guarantees/scalar.py", "guarantee(given.model, fmt, within, given.form, most=LONGEST)"): (SMALLEST,),
    (
        "guarantees/survey.py",
        "from_schedule(filter_schedule(state_space(A, B), fmt), limits(n, m, measurement=Z))",
    ): (LINEAR,),
    ("guarantees/table.py", "('guarantee', 'bound', 'probable', 'emulation')"): (LEAST,),
    ("guarantees/table.py", "case_guarantee(case, made, FORMAT)"): CHAPTER,
    ("guarantees/table.py", "case_guarantee(case, case.make(), FORMAT)"): CHAPTER,
    ("guarantees/table.py", "case_guarantee(case, made, fmt)"): (LEAST,),
    ("guarantees/table.py", "case_guarantee(case, _longitudinal(), fmt)"): (LEAST,),
    (
        "guarantees/table.py",
        "guarantee(made, fmt, within, case.form, most=case.horizon, horizon=case.horizon)",
    ): CHAPTER,
    ("guarantees/table.py", "guarantee(made, fmt, within, case.form, most=100000, horizon=1, budget=budget)"): CHAPTER,
    (
        "guarantees/table.py",
        "from_schedule(schedule, limits(schedule.program.n, schedule.program.m, measurement=case.measurement))",
    ): CHAPTER,
}
"""Calls that compute guarantees, and the names of their certificates or of the reasons for having none."""

STORED: dict[str, str] = {
    "gravity_probe_b/horizon": YEAR,
    "guarantees/filters": DRAWN,
    "guarantees/scalar": SMALLEST,
    "guarantees/survey": LINEAR,
    "guarantees/gappa": STEPS,
    "inversion/variants": "inverses of matrices",
    "inversion/random": "inverses of matrices",
}
"""Tables whose rows share a reason."""
NAMED = ("guarantees/guarantees", "guarantees/certificates")
"""Tables whose rows begin with the name of a filter."""
RUNS = (
    "gravity_probe_b/year",
    "gravity_probe_b/threshold",
    "gravity_probe_b/mission",
    "kalman/ensembles",
    "rolling/drift_rates",
)
"""Tables of observed errors and of bounds for single runs, which are no guarantees."""


def is_basis(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and node.value == "guarantee"


@cache
def calls(code: str) -> tuple[str, ...]:
    """Return the calls that compute a guarantee, and the lists of bases that contain it."""
    return tuple(_calls(code))


def _calls(code: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in STATING or any(map(is_basis, (*node.args, *(each.value for each in node.keywords)))):
                yield ast.unparse(node)
        elif isinstance(node, (ast.Tuple, ast.List)):
            names = {getattr(each, "value", None) for each in node.elts}
            if "guarantee" in names and names <= BASES:
                yield ast.unparse(node)


def sources() -> dict[str, str]:
    """Return the code of every notebook and of every module of the report, but the list of certificates itself."""
    found = {}
    for file in sorted((ROOT / "book").glob("*.ipynb")):
        cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
        found[file.name] = "\n".join("".join(each["source"]) for each in cells if each["cell_type"] == "code")
    report = ROOT / "gpbnb" / "report"
    for file in sorted(report.rglob("*.py")):
        found[file.relative_to(report).as_posix()] = file.read_text(encoding="utf-8")
    del found["guarantees/certificates.py"]
    return found


def unknown_calls(code: dict[str, str]) -> list[tuple[str, str]]:
    return [(file, call) for file, text in code.items() for call in calls(text) if (file, call) not in COMPUTED]


def unknown_rows(tables: Iterable[tuple[str, list[Any]]]) -> list[tuple[str, str]]:
    known = certificates.guarantees().keys() | certificates.WITHOUT.keys()
    missing = []
    for name, rows in tables:
        if name in NAMED:
            missing += [(name, row[0]) for row in rows if row[0] not in known]
        elif name not in (*STORED, *RUNS):
            missing.append((name, "all rows"))
    return missing


def tables() -> list[tuple[str, list[Any]]]:
    return [(sweep.name, list(sweep.load().rows) if sweep.name in NAMED else []) for sweep in SWEEPS]


def test_every_computed_guarantee_has_a_certificate_or_a_reason() -> None:
    assert unknown_calls(sources()) == []


def test_every_stored_guarantee_has_a_certificate_or_a_reason() -> None:
    assert unknown_rows(tables()) == []


def test_each_name_is_that_of_a_certificate_or_of_a_reason_and_none_is_left_over() -> None:
    used = {name for names in COMPUTED.values() for name in names} | {*STORED.values()}
    certified = certificates.guarantees().keys()
    assert not certified & certificates.WITHOUT.keys()
    assert used == certified | certificates.WITHOUT.keys()


def test_no_listed_call_is_gone() -> None:
    code = sources()
    assert {key for key in COMPUTED if key[1] not in set(calls(code[key[0]]))} == set()


def test_every_certificate_of_the_book_is_stored_and_proved() -> None:
    rows = certificates.load()
    assert [row.name for row in rows] == list(certificates.guarantees())
    assert {row.verdict for row in rows} == {"proved"}


@pytest.mark.parametrize(
    "added",
    [
        "guarantee(tracker(), FloatFormat(2, 11), within)",
        "bounds.guarantee.guarantee(other, FORMAT, within)",
        "required_precision(other, 1, 0.1, basis='guarantee')",
        "('guarantee', 'bound')",
    ],
)
@pytest.mark.parametrize("file", ["kalman.ipynb", "guarantees/figures.py"])
def test_an_added_guarantee_is_noticed(file: str, added: str) -> None:
    code = sources()
    code[file] += f"\nmore = {added}\n"
    assert unknown_calls(code) == [(file, added)]


def test_an_added_row_or_table_is_noticed() -> None:
    added = [("guarantees/guarantees", [(TRACKER,), ("another filter",)]), ("guarantees/new", [("one",)])]
    assert unknown_rows(added) == [("guarantees/guarantees", "another filter"), ("guarantees/new", "all rows")]


def test_a_missing_certificate_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    fewer = {name: each for name, each in certificates.guarantees().items() if name != "altimeter"}
    monkeypatch.setattr(certificates, "guarantees", lambda: fewer)
    assert ("guarantees/guarantees", "altimeter") in unknown_rows(tables())
