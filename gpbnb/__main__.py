"""``python -m gpbnb``: list the commands, or run one of them."""

from __future__ import annotations

import argparse
import runpy
import sys
from collections.abc import Sequence

COMMANDS = {
    "wordlength": "how many digits your own filter needs, with a report",
    "ledger": "every printed equation, number and claim, with its verdict",
    "report.stored": "list the stored sweeps, or verify a sample of them",
    "report.rolling": "compute the stored drift rates again",
    "report.inversion": "compute the stored sweeps over inverses again",
    "report.gravity_probe_b.year": "compute the emulated years again",
    "report.kalman.ensembles": "compute the random filters again",
    "report.gravity_probe_b.threshold": "compute the years of hundreds of records again",
    "report.gravity_probe_b.mission": "compute the years of the mission model again",
    "report.gravity_probe_b.horizon": "compute the bounds for a year of Gravity Probe B again",
    "report.guarantees.survey": "compute the survey of guarantees again",
    "report.guarantees.filters": "compute random Kalman filters against their guarantees again",
    "report.guarantees.scalar": "compute the worst errors of scalar filters again",
    "report.guarantees.table": "compute the table of guarantees again",
}
"""Commands, each also available as ``python -m gpbnb.<command>``."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    lines = "\n".join(f"  {name:<34} {help_}" for name, help_ in COMMANDS.items())
    parser = argparse.ArgumentParser(
        prog="python -m gpbnb",
        description="Rounding errors in recursive filters, integrators and matrix computations.",
        epilog=f"commands:\n{lines}\n\npython -m gpbnb COMMAND --help explains a command.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
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
    runpy.run_module(f"gpbnb.{given.command}", run_name="__main__", alter_sys=False)
    return 0


if __name__ == "__main__":
    sys.exit(main())
