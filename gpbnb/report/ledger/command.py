"""The command ``python -m gpbnb.ledger``."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path

from gpbnb.files import replace_file
from gpbnb.report.ledger.checking import counts, examine
from gpbnb.report.ledger.render import FORMATS, describe
from gpbnb.report.ledger.statements import Statement, load_statements, select
from gpbnb.report.ledger_options import ledger_parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    parser = ledger_parser()
    arguments = parser.parse_args(argv)
    try:
        chosen = select(load_statements(), arguments.document, arguments.chapter, arguments.section)
        _check_output(arguments.output)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    try:
        rows = examine(chosen, _progress)
        content = FORMATS[arguments.format](rows).encode()
        if arguments.output is not None:
            replace_file(arguments.output, content)
        else:
            sys.stdout.buffer.write(content)
            sys.stdout.buffer.flush()
        print(f"{len(rows)} entries: {describe(counts(rows))}", file=sys.stderr)
    except BrokenPipeError:
        # The reader of the pipe has closed it, so discard what the interpreter flushes at exit.
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for stream in (sys.stdout, sys.stderr):
            os.dup2(nowhere, stream.fileno())
    except OSError as error:
        parser.error(f"the ledger cannot be written: {error}")
    return 0


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


def _check_output(path: Path | None) -> None:
    if path is None:
        return
    if path.exists() and not path.is_file():
        raise ValueError(f"got --output {path}; needed a regular file; name one, or omit --output for stdout")
    if not path.parent.is_dir():
        raise ValueError(f"got --output {path}; needed an existing directory {path.parent}; create it first")
