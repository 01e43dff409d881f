"""The command ``python -m gpbnb.ledger``."""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path

from gpbnb.files import replace_file
from gpbnb.report.ledger.checking import FAILED, MISSING, Row, counts, examine
from gpbnb.report.ledger.checks import TOPICS
from gpbnb.report.ledger.render import FORMATS, describe
from gpbnb.report.ledger.statements import Statement, load_statements, select
from gpbnb.report.ledger_options import ledger_parser

COMPLETE, INCOMPLETE, BROKEN = 0, 1, 3  # argparse uses 2 for wrong arguments


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    parser = ledger_parser()
    arguments = parser.parse_args(argv)
    try:
        chosen = select(load_statements(), arguments.document, arguments.chapter, arguments.section)
        _check_output(arguments.output)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    rows = examine(chosen, TOPICS, _progress)
    content = FORMATS[arguments.format](rows).encode()
    try:
        if arguments.output is not None:
            replace_file(arguments.output, content)
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


_PAUSE = 5.0  # seconds between two lines about progress


def _progress(entries: Sequence[Statement]) -> Iterable[Statement]:
    """Show how many checks have run: as a bar on a terminal, elsewhere as a line every few seconds."""
    if sys.stderr.isatty():
        from tqdm import tqdm  # type: ignore[import-untyped]

        yield from tqdm(entries, desc="checks", unit="entry", leave=False, file=sys.stderr)
        return
    began = last = time.monotonic()
    for done, entry in enumerate(entries):
        if (now := time.monotonic()) - last >= _PAUSE:
            last = now
            line = f"checks: {done} of {len(entries)} after {now - began:.0f} s; now {entry.id}"
            print(line, file=sys.stderr, flush=True)
        yield entry


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
