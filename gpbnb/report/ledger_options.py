"""The options of ``python -m gpbnb.ledger``, read before the checks are imported, which takes seconds."""

from __future__ import annotations

import argparse
from pathlib import Path

import gpbnb

FORMATS = ("csv", "markdown", "json", "text")
"""How findings are written, as in :mod:`gpbnb.report.ledger.render`."""


def ledger_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    made = argparse.ArgumentParser(
        prog="python -m gpbnb.ledger",
        description="Check every statement of the three documents and write the findings.",
        epilog="Exit status: 0 if the findings are written, 2 if an option or the output file is wrong, 130 if it is "
        "interrupted.",
    )
    made.add_argument("--format", choices=FORMATS, default="csv", help="default: csv")
    made.add_argument("--document", help="hung1984, hung1982 or savage2016; default: all")
    made.add_argument("--chapter", help="chapter number as in the document, such as II; default: all")
    made.add_argument(
        "--section", nargs="+", metavar="S", help="one or more section numbers; 9 includes 9.1 and 9.2; default: all"
    )
    made.add_argument(
        "--output", type=Path, metavar="FILE", help="file to write, replacing any existing file; default: stdout"
    )
    made.add_argument("--version", action="version", version=f"gpbnb {gpbnb.__version__}")
    return made
