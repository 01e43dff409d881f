"""``python -m gpbnb``: list the commands, or run one of them."""

from __future__ import annotations

import argparse
import runpy
import sys
from collections.abc import Sequence

import gpbnb
from gpbnb.interrupts import interruptible

COMMANDS = {
    "wordlength": "how many digits your own filter needs, with a report",
    "ledger": "every printed equation, number and claim, with its verdict",
    "bounds.check": "prove the claim of a certificate, without the rest of the package",
    "report.guarantees.certificates": "write and check certificates of the book's guarantees",
    "report.stored": "list the stored sweeps, verify a sample of them, or compute them again",
}
"""Commands, each also available as ``python -m gpbnb.<command>``."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    lines = "\n".join(f"  {name:<30} {help_}" for name, help_ in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb",
        description="Rounding errors in recursive filters, integrators and matrix computations.",
        epilog=f"commands:\n{lines}\n\npython -m gpbnb COMMAND --help explains a command.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"gpbnb {gpbnb.__version__}")
    parser.add_argument("command", nargs="?", help="one of the commands below")
    parser.add_argument(
        "arguments", nargs=argparse.REMAINDER, help="arguments of the command; COMMAND --help lists them"
    )
    given = parser.parse_args(arguments)
    if given.command is None:
        parser.print_help()
        return 0
    if given.command not in COMMANDS:
        parser.error(f"got {given.command!r}; needed one of {', '.join(COMMANDS)}")
    sys.argv = [given.command, *given.arguments]
    return interruptible(f"python -m gpbnb {given.command}", lambda: _run(given.command))


def _run(command: str) -> int:
    try:
        runpy.run_module(f"gpbnb.{command}", run_name="__main__", alter_sys=False)
    except ImportError as error:
        if "gpbnb[report]" not in str(error):
            raise
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(interruptible("python -m gpbnb", main))
