"""The command ``python -m gpbnb.ledger``."""

from __future__ import annotations

import argparse
import os
import sys
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path

from gpbnb.report.ledger.checking import FAILED, MISSING, Row, counts, examine, examine_once, owners
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.render import FORMATS, describe
from gpbnb.report.ledger.statements import Statement, load_statements, select

COMPLETE, INCOMPLETE, BROKEN = 0, 1, 3  # argparse uses 2 for wrong arguments
_EPILOG = (
    "exit status: 0, every selected entry has a finding; 1, some entries have no check; 2, the "
    "arguments are invalid, or the ledger or the output file cannot be used; 3, a check raised an "
    "exception (the other rows are still written)"
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status.

    Raises
    ------
    SystemExit : with status 2 for bad arguments, 0 after ``--help``.
    """
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb.ledger",
        description="Check every statement of the three documents and write the findings.",
        epilog=_EPILOG,
    )
    parser.add_argument("--format", choices=FORMATS, default="csv", help="default: csv")
    parser.add_argument("--document", help="hung1984, hung1982 or savage2016; default: all")
    parser.add_argument("--chapter", help="chapter number as in the document, such as II; default: all")
    parser.add_argument(
        "--section", nargs="+", metavar="S", help="one or more section numbers; 9 includes 9.1 and 9.2; default: all"
    )
    parser.add_argument(
        "--output", type=Path, metavar="FILE", help="file to write, replacing any existing file; default: stdout"
    )
    parser.add_argument("--fresh", action="store_true", help="run every check again instead of using stored findings")
    arguments = parser.parse_args(argv)
    try:
        inventory = load_statements()
        chosen = select(inventory, arguments.document, arguments.chapter, arguments.section)
        _check_output(arguments.output)
        owners(inventory, TOPICS)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    run = examine if arguments.fresh else examine_once
    rows = run(chosen, TOPICS, _progress)
    content = FORMATS[arguments.format](rows).encode()
    try:
        if arguments.output is not None:
            _replace(arguments.output, content)
        else:
            sys.stdout.buffer.write(content)
            sys.stdout.buffer.flush()
        _report(rows)
    except BrokenPipeError:
        # The reader of the pipe has closed it, so discard what the interpreter flushes at exit.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
    except OSError as error:
        parser.error(f"the ledger cannot be written: {error}")
    outcomes = counts(rows)
    return BROKEN if FAILED in outcomes else INCOMPLETE if MISSING in outcomes else COMPLETE


def _progress(entries: Sequence[Statement]) -> Iterable[Statement]:
    if not sys.stderr.isatty():
        return entries
    from tqdm import tqdm  # type: ignore[import-untyped]

    bar: Iterable[Statement] = tqdm(entries, desc="checks", unit="entry", leave=False, file=sys.stderr)
    return bar


def _report(rows: Sequence[Row]) -> None:
    for row in rows:
        if row.error is not None:
            frame = traceback.extract_tb(row.error.__traceback__)[-1]
            cause = "".join(traceback.format_exception_only(row.error)).strip()
            print(f"the check of {row.statement.id} failed: {cause} ({frame.filename}:{frame.lineno})", file=sys.stderr)
    outcomes = counts(rows)
    print(f"{len(rows)} entries: {describe(outcomes)}", file=sys.stderr)
    print(f"{outcomes.get(MISSING, 0)} entries have no check", file=sys.stderr)


def _check_output(path: Path | None) -> None:
    if path is None:
        return
    if path.exists() and not path.is_file():
        raise ValueError(f"got --output {path}; needed a regular file; name one, or omit --output for stdout")
    if not path.parent.is_dir():
        raise ValueError(f"got --output {path}; needed an existing directory {path.parent}; create it first")


def _replace(path: Path, content: bytes) -> None:
    path = path.resolve()
    draft = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        draft.write_bytes(content)
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)
