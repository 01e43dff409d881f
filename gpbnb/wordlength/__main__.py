"""``python -m gpbnb.wordlength model.toml --tolerance 0.01``: the wordlength of your own filter, with a report."""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from gpbnb.kalman.named import form_named, rounding_named
from gpbnb.wordlength.models import read_measurements, read_model
from gpbnb.wordlength.report import study

EPILOG = """
The model is a TOML file with Phi, H, Q, R, x0 and P0, or with A, B and perhaps C, D, x0. A filter may have known inputs
B and u (or --inputs) and known offsets b of the states and d of the measurements. Numbers are read as decimals.
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
        "--measurements", type=Path, help="CSV file with one row per step; default: simulated measurements"
    )
    parser.add_argument("--inputs", type=Path, help="CSV file with the known inputs u of the filter, one row per step")
    parser.add_argument("--steps", type=int, help="number of steps to simulate; default: 1000")
    parser.add_argument("--base", type=int, default=2, help="2, 10 or 16; default: 2")
    parser.add_argument("--rounding", default="nearest", help='rounding rule, such as "nearest" or "chop"')
    parser.add_argument(
        "--form",
        default="innovation",
        help='form of the covariance update, such as "innovation", "Joseph", "UD" or "Cholesky"',
    )
    parser.add_argument(
        "--basis",
        action="append",
        choices=("emulation", "bound"),
        help="how to find the precision; may be given twice; default: both",
    )
    parser.add_argument("--report", type=Path, help="HTML file to write, with a JSON file of the same name beside it")
    given = parser.parse_args(arguments)
    command = shlex.join(["python", "-m", "gpbnb.wordlength", *map(str, arguments or sys.argv[1:])])
    try:
        try:
            tolerance = [float(each) for each in given.tolerance.split(",")]
        except ValueError:
            raise ValueError(
                f"got --tolerance {given.tolerance}; needed numbers with commas between: 0.01,inf"
            ) from None
        form_named(given.form), rounding_named(given.rounding)
        model = read_model(given.model, read_measurements(given.inputs) if given.inputs else None)
        z = read_measurements(given.measurements) if given.measurements else None
        report = study(
            model,
            tolerance if len(tolerance) > 1 else tolerance[0],
            z,
            given.steps,
            given.base,
            given.rounding,
            given.form,
            given.basis or ("emulation", "bound"),
            str(given.measurements) if given.measurements else "simulated by the model, seed 0",
            command,
            lambda text: print(text, file=sys.stderr, flush=True),
        )
        if given.report:
            given.report.write_text(report.to_html(), encoding="utf-8")
            given.report.with_suffix(".json").write_text(report.to_json() + "\n", encoding="utf-8")
    except (ValueError, OSError, ArithmeticError) as error:
        print(f"{parser.prog}: {error}", file=sys.stderr)
        return 2
    print(report.text)
    return 0 if report.digits is not None else 1


if __name__ == "__main__":
    sys.exit(main())
