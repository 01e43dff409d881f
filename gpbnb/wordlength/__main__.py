"""``python -m gpbnb.wordlength model.toml --tolerance 0.01``: the wordlength of your own filter, with a report."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from gpbnb.bounds.envelope import Limits
from gpbnb.bounds.guarantee import limits
from gpbnb.filters.model import LinearModel
from gpbnb.filters.named import form_named, rounding_named
from gpbnb.sweeps import plain_number
from gpbnb.wordlength.models import read_measurements, read_model
from gpbnb.wordlength.report import study
from gpbnb.wordlength.requirement import Basis
from gpbnb.wordlength.system import LinearSystem

EPILOG = """
The model is a TOML file with Phi, H, Q, R, x0 and P0, or with A, B and perhaps C, D, x0. A filter may have known inputs
B and u (or --inputs) and known offsets b of the states and d of the measurements. Numbers are read as decimals.
The bases guarantee and probable hold for ever and need limits: --state and --innovation, or --measurement. A system
needs --measurement.
Exit status: 0 if a precision meets the tolerance, 1 if none does, 2 if a file or an option is wrong.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb.wordlength",
        description="Find how many digits a filter needs, so that rounding stays within a tolerance.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("model", type=Path, help="TOML file")
    parser.add_argument(
        "--tolerance", required=True, help="largest allowed error: one number, or one per state, such as 0.01,inf"
    )
    parser.add_argument(
        "--measurements",
        type=Path,
        help="CSV file with one row per step: measurements of a filter, by default simulated, or inputs of a system",
    )
    parser.add_argument("--inputs", type=Path, help="CSV file with the known inputs u of the filter, one row per step")
    parser.add_argument("--steps", type=int, help="number of steps to simulate; default: 1000")
    parser.add_argument("--base", type=int, default=2, help="2, 10 or 16; default: 2")
    parser.add_argument("--rounding", default="nearest", help='rounding rule, such as "nearest" or "chop"')
    parser.add_argument(
        "--form",
        help='form of the covariance update of a Kalman filter, such as "innovation", "Joseph", "UD" or "Cholesky"; '
        "default: innovation",
    )
    parser.add_argument(
        "--basis",
        action="append",
        choices=get_args(Basis),
        help="how to find the precision; may be given more than once; default: emulation and bound",
    )
    for quantity in Limits._fields:
        parser.add_argument(
            f"--{quantity}",
            metavar="LIMITS",
            help=f"for the bases guarantee and probable: largest size of each {quantity} of the filter without "
            "rounding, one number or one for each, such as 5,0.1",
        )
    parser.add_argument("--report", type=Path, help="HTML file to write, with a JSON file of the same name beside it")
    given = parser.parse_args(arguments)
    command = _printable(shlex.join(["python", "-m", "gpbnb.wordlength", *map(str, arguments or sys.argv[1:])]))
    try:
        tolerance = _numbers("tolerance", given.tolerance)
        form_named(given.form or "innovation"), rounding_named(given.rounding)
        _check_files(given.report, [each for each in (given.model, given.measurements, given.inputs) if each])
        model = read_model(given.model, read_measurements(given.inputs) if given.inputs else None)
        z = read_measurements(given.measurements) if given.measurements else None
        bases: Sequence[Basis] = given.basis or ("emulation", "bound")
        if isinstance(model, LinearSystem):
            if given.form:
                raise ValueError(
                    f"got --form {given.form} for a linear system; needed none: only a Kalman filter has forms"
                )
            if z is None and {"emulation", "bound"} & {*bases}:
                raise ValueError(
                    "got a linear system without inputs; needed --measurements, a CSV file with its inputs"
                )
        sizes = {each: text for each in Limits._fields if (text := getattr(given, each)) is not None}
        within = _limits(model, bases, {each: _numbers(each, text) for each, text in sizes.items()})
        report = study(
            model,
            tolerance,
            z,
            given.steps,
            given.base,
            given.rounding,
            given.form or "innovation",
            bases,
            _printable(str(given.measurements)) if given.measurements else "",
            command,
            lambda text: print(text, file=sys.stderr, flush=True),
            within=within,
        )
        if given.report:
            given.report.write_text(report.to_html(), encoding="utf-8")
            given.report.with_suffix(".json").write_text(report.to_json() + "\n", encoding="utf-8")
    except (ValueError, OSError, ArithmeticError) as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    print(report.text)
    return 0 if report.digits is not None else 1


def _printable(text: str) -> str:
    """Return a text of the command line with escapes in place of bytes that are not UTF-8."""
    return text.encode(errors="surrogateescape").decode(errors="backslashreplace")


def _check_files(report: Path | None, sources: Sequence[Path]) -> None:
    """Reject one file for two purposes, and a report that cannot be written, before anything is computed."""
    written = []
    if report:
        if not report.name or report.suffix.lower() == ".json":
            raise ValueError(f"got --report {report}; needed the name of an HTML file; JSON is written beside it")
        written = [report, report.with_suffix(".json")]
    for path in written:
        if path.is_dir() or not path.parent.is_dir():
            what = "is a folder" if path.is_dir() else "is in no folder that exists"
            raise ValueError(f"got --report {report}, but {path} {what}; needed a file in a folder")
    files = [*sources, *written]
    for place, path in enumerate(files):
        for other in files[:place]:
            if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
                raise ValueError(f"got {other} and {path}, which are one file; needed a file for each purpose")


def _numbers(option: str, text: str) -> float | list[float]:
    """Read the value of an option, one number or several with commas between."""
    try:
        found = [plain_number(each.strip()) for each in text.split(",")]
    except ValueError:
        raise ValueError(f"got --{option} {text}; needed numbers with commas between: 0.01,inf") from None
    return found if len(found) > 1 else found[0]


def _limits(model: LinearModel | LinearSystem, bases: Sequence[Basis], sizes: Mapping[str, Any]) -> Limits | None:
    """Return the limits that the bases need; None if they need none."""
    asked = [each for each in bases if each in ("guarantee", "probable")]
    options = ", ".join(f"--{each}" for each in sizes)
    if not asked:
        if sizes:
            raise ValueError(f"got {options} without a basis that uses limits; needed --basis guarantee or probable")
        return None
    of_system = isinstance(model, LinearSystem)
    needed = "--measurement" if of_system else "--state and --innovation, or --measurement"
    if not sizes or (of_system and set(sizes) != {"measurement"}):
        raise ValueError(f"got --basis {asked[0]} with {options or 'no limits'}; needed {needed}")
    return limits(model.n, model.m, **sizes)


if __name__ == "__main__":
    sys.exit(main())
