"""The options of ``python -m gpbnb.wordlength``, read and checked before the libraries that compute are imported."""

from __future__ import annotations

import argparse
import os
import re
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import gpbnb
from gpbnb.arithmetic.rounding import rounding_named
from gpbnb.files import is_written
from gpbnb.filters.forms import CONSTANT_GAIN, form_named, plain_name
from gpbnb.names import NAMED_FORMATS, WITHOUT_LOOPS, format_parts
from gpbnb.wordlength.numbers import plain_integer, plain_number

BASES = ("emulation", "bound", "guarantee", "probable")
"""What an answer may be based on, as in ``gpbnb.wordlength.answer.Basis``."""

KINDS = ("float", "fixed", "words", "blocks")
"""What is searched, as in ``gpbnb.wordlength.answer.Kind``."""

IN_FIXED_POINT = ("fixed", "words")
"""Kinds of searches in fixed point."""

BASES_OF_NUMBERS = (2, 10, 16)
"""Bases of the formats that are searched."""

_FORMATS = tuple(name for name in NAMED_FORMATS if name not in WITHOUT_LOOPS)

QUANTITIES = ("state", "innovation", "measurement")
"""What may have limits, as in :class:`gpbnb.bounds.guess.FilterLimits`."""

SIGNALS = ("step", "sine", "noise")
"""Inputs that are simulated, as by :func:`gpbnb.filters.simulation.simulated_inputs`."""

EPILOG = """
The model is a TOML file with Phi, H, Q, R, x0 and P0, or with A, B and perhaps C, D, x0. A filter may have known inputs
B and u (or --inputs) and known offsets b of the states and d of the measurements. A digital filter has b and a, or sos,
and perhaps structure, such as "direct form I", "cascade of direct form II transposed", "lattice" or "all"; its
structures are compared side by side, and with "all", the one that needs the fewest digits (in fixed point, the
shortest word) gives the answer and the code. Beside sos, there may be pairing, order, and scale = true, which scales
the sections of a cascade by powers of two. A controller has Kp and Ki, and perhaps Kd, leak, limits, integral_limits,
back_calculation. Numbers are read as decimals. NPZ, MAT and JSON files with the same names are read, too.
Functions of your own stand in a Python file, named from the folder of the model file: step = "model.py:step" and x0 for
a system, f, h, Q, R, x0 and P0 for a nonlinear filter, or function = "model.py:run" for a function of a format and the
measurements. The command runs that file: read no model that you do not trust.
With --form "constant gain", a Kalman filter is the linear system with the gain that it approaches; its inputs are the
measurements.
The file may name states, measurements, inputs and outputs, each with its unit: states = ["tilt (°)", "rate (°/s)"].
The bases guarantee and probable hold for ever and need limits: --state and --innovation, or --measurement. A system
needs --measurement.
Exit status: 0 if a precision meets the tolerance, 1 if none does, 2 if a file or an option is wrong, 130 if it is
interrupted.
"""


_OPTIONS = f"""
--measurements FILE: CSV file with one row per step: measurements of a filter, by default simulated, or inputs of a
  system
--inputs FILE: CSV file with the known inputs u of the filter, one row per step
--simulate {{{",".join(SIGNALS)}}}: inputs of a linear system, in place of --measurements
--level NUMBERS: of the simulated inputs: height of a step or sine, standard deviation of noise; one number, or one for
  each input; default: 1
--steps N: number of steps to simulate; default: 1000, or as many as there are known inputs
--seed N: seed of what is simulated; default: 0
--format NAME: judge one format in place of a search: {", ".join(_FORMATS)}, Q15, or Q3.12 with 3 integer bits and 12
  fraction bits
--digits N: judge this precision in place of a search
--base BASE: 2, 10 or 16; default: 2
--rounding ROUNDING: rounding rule, such as "nearest" or "chop"; default: nearest
--emin N: exponent of the smallest normal number; default: unlimited
--emax N: exponent of the largest number; default: unlimited
--form FORM: form of the covariance update of a Kalman filter, such as "innovation", "Joseph", "UD" or "Cholesky", or
  "constant gain" for the linear system with the gain that the filter approaches; default: innovation
--kind {{{",".join(KINDS)}}}: what is searched: digits of floating point; fraction bits of fixed point; for a linear
  system, words of data, coefficients and sums; for a Kalman filter, the precision of each block (state, gain,
  covariance, innovation covariance), which names the block that limits the filter; default: float
--coefficients N: for a linear system in fixed point: significant bits of each coefficient, which has its own binary
  point; default: 15; with --kind words, the most to try; default: 24
--basis {{{",".join(BASES)}}}: how to find the precision; may be given more than once; default: emulation and bound
--state LIMITS: for the bases guarantee and probable: largest size of each state of the filter without rounding, one
  number or one for each, such as 5,0.1
--innovation LIMITS: the same for each innovation
--measurement LIMITS: the same for each measurement, or for each input of a system
--report FILE: HTML file to write, with a JSON file of the same name beside it
--certificate FILE: for the basis guarantee: JSON file to write, which python -m gpbnb.bounds.check verifies on its own
--csv FILE: CSV file to write: each step of a run in the answer, with its estimates or outputs and their errors
--code DIR: folder for the filter as C99 with test vectors, in the format judged, in the answer in fixed point, or in
  binary32 or binary64 if one of them meets the tolerance
"""
"""Options with a value, or with all values that they may have, as the help shows them."""


class _Once(argparse.Action):
    """Store the value of an option, and refuse a second one."""

    def __call__(self, parser: Any, namespace: argparse.Namespace, values: Any, option_string: Any = None) -> None:
        if getattr(namespace, self.dest) is not None:
            raise argparse.ArgumentError(self, "given twice; needed once")
        setattr(namespace, self.dest, values)


def parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        prog="python -m gpbnb.wordlength",
        description="Find how many digits a filter needs, so that rounding stays within a tolerance.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    made.register("action", None, _Once)  # for the options that are stored
    made.add_argument("--version", action="version", version=f"gpbnb {gpbnb.__version__}")
    made.add_argument("model", type=Path, help="TOML, JSON, NPZ or MAT file")
    tolerance = "largest allowed error: one number, or one per state or output, such as 0.01,1/3,inf"
    made.add_argument("--tolerance", required=True, metavar="NUMBERS", help=tolerance)
    for option, value, text in re.findall(r"^(--\w+) (\S+): (.*(?:\n  .*)*)", _OPTIONS, re.MULTILINE):
        given: dict[str, Any] = {"action": "append"} if option == "--basis" else {}
        given |= {"choices": value[1:-1].split(",")} if value[0] == "{" else {"metavar": value}
        made.add_argument(option, type=Path if value in ("FILE", "DIR") else str, help=" ".join(text.split()), **given)
    made.add_argument("--quiet", action="store_true", help="write nothing but the answer: no progress")
    return made


def read(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Read and check the command line, and convert the texts of numbers to numbers."""
    given = parser().parse_args(arguments)
    for name in ("tolerance", "level", *QUANTITIES):
        _replace(given, name, _numbers, "numbers with commas between: 0.01,1/3,inf")
    for name in ("steps", "seed", "digits", "base", "emin", "emax", "coefficients"):
        _replace(given, name, plain_integer, "a whole number")
    _replace(given, "rounding", lambda text: rounding_named(text).value)
    if given.form and plain_name(given.form) == plain_name(CONSTANT_GAIN):
        given.form = CONSTANT_GAIN
    else:
        form_named(given.form or "innovation")
    _replace(given, "format", format_parts)
    given.kind = given.kind or "float"
    if given.format in WITHOUT_LOOPS:
        raise ValueError(
            f"got --format {given.format}, which has no compiled loops; needed one of {', '.join(_FORMATS)}, Q15, or "
            "Q3.12; to search up to 53 bits or 18 decimal digits, leave --format away"
        )
    sources = [each for each in (given.model, given.measurements, given.inputs) if each]
    check_files(given, sources)
    for source in sources:
        try:
            source.open("rb").close()
        except OSError as error:
            raise ValueError(f"got {source}, which cannot be read: {error.strerror}; needed a file") from None
    _check(given)
    return given


def _check(given: argparse.Namespace) -> None:
    """Reject options that are not compatible."""
    if given.base not in (None, *BASES_OF_NUMBERS):
        raise ValueError(f"got --base {given.base}; needed one of {', '.join(map(str, BASES_OF_NUMBERS))}")
    if (given.emin is None) != (given.emax is None):
        raise ValueError("got one of --emin and --emax; needed both, or neither for unlimited exponents")
    if given.code and given.code.exists() and not given.code.is_dir():
        raise ValueError(f"got --code {given.code}, which is a file; needed a folder")
    kind, sizes = f"--kind {given.kind}", ("base", "emin", "emax")
    excluded: list[tuple[Any, str, Sequence[str], str]] = [
        (given.format, "--format", ("digits", *sizes), "--format alone, which sets them all"),
        (given.simulate, "--simulate", ("measurements",), "one of them"),
        (given.measurements, "--measurements", ("seed",), "one of them: a seed is for what is simulated"),
        (given.kind != "float", kind, ("format", "digits"), "one of them: --kind searches, and --format judges"),
        (given.kind in IN_FIXED_POINT, kind, sizes, "--kind alone: fixed point has base 2 and no exponents"),
        (not given.simulate, "no --simulate", ("level",), f"--simulate with one of {', '.join(SIGNALS)}"),
        (given.kind not in IN_FIXED_POINT, kind, ("coefficients",), "--kind fixed or --kind words with them"),
    ]
    asked = [each for each in given.basis or () if each in ("guarantee", "probable")]
    excluded.append((not asked, "no basis that uses limits", QUANTITIES, "--basis guarantee or probable"))
    without = "guarantee" not in (given.basis or ())
    excluded.append((without, "no guarantee", ("certificate",), "--basis guarantee"))
    for holds, what, names, needed in excluded:
        others = [f"--{name}" for name in names if getattr(given, name) is not None]
        if holds and others:
            raise ValueError(f"got {what} and {', '.join(others)}; needed {needed}")


def check_files(given: argparse.Namespace, sources: Sequence[Path]) -> None:
    """Reject one file for two purposes, and a file that may not or cannot be written, before anything is computed."""
    written = [
        (f"--{name} {path}", path) for name in ("report", "certificate", "csv") if (path := getattr(given, name))
    ]
    if report := given.report:
        if not report.name or report.suffix.lower() == ".json":
            raise ValueError(f"got --report {report}; needed the name of an HTML file; JSON is written beside it")
        written.append((f"--report {report}, beside which JSON is written", report.with_suffix(".json")))
    for option, path in written:
        try:
            there = path.exists()
            tempfile.TemporaryFile(dir=path.resolve().parent).close()
        except OSError as error:
            raise ValueError(
                f"got {option}, which cannot be written: {os.strerror(error.errno or 0)}; needed a file in a folder "
                "that exists and that you can write to, on a disk with space"
            ) from None
        if there and not path.is_file():
            kind = "folder" if path.is_dir() else "device or pipe"
            raise ValueError(f"got {option}, but {path} is a {kind}; needed a file in a folder")
    files = [*sources, *(path for _, path in written)]
    for place, path in enumerate(files):
        for other in files[:place]:
            if path.resolve() == other.resolve() or (path.exists() and other.exists() and path.samefile(other)):
                raise ValueError(f"got {other} and {path}, which are one file; needed a file for each purpose")
    for option, path in written:
        if path.exists() and not is_written(path):
            raise ValueError(f"got {option}, and {path} is a file that gpbnb has not written; needed another name")


def _numbers(text: str) -> str | list[str]:
    """Check numbers with commas between, and leave them as text, which is read exactly."""
    found = [each.strip() for each in text.split(",")]
    for each in found:
        above, slash, below = each.partition("/")
        plain_number(above)
        if slash and not (plain_integer(above) and plain_integer(below)):
            raise ValueError("a part of a fraction is zero")
    return found if len(found) > 1 else found[0]


def _replace(given: argparse.Namespace, name: str, convert: Callable[[str], Any], needed: str = "") -> None:
    """Replace the text of an option by what it means."""
    if (text := getattr(given, name)) is None:
        return
    try:
        setattr(given, name, convert(text))
    except ValueError as error:
        raise ValueError(f"got --{name} {text}; needed {needed}" if needed else str(error)) from None


def printable(text: str) -> str:
    """Return a text of the command line with escapes in place of bytes that are not UTF-8."""
    return text.encode(errors="surrogateescape").decode(errors="backslashreplace")
