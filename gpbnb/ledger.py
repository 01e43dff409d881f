"""``python -m gpbnb.ledger``: the command of ``gpbnb.report.ledger``."""

from collections.abc import Sequence

from gpbnb.interrupts import interruptible
from gpbnb.report.ledger_options import ledger_parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    ledger_parser().parse_args(arguments)  # help and wrong options are answered before the checks are imported
    from gpbnb.report.ledger.command import main as run

    return run(arguments)


if __name__ == "__main__":
    raise SystemExit(interruptible("python -m gpbnb.ledger", main))
