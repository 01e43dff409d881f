"""``python -m gpbnb.ledger``: the command of :mod:`gpbnb.report.ledger`."""

from gpbnb.report.ledger.command import main

if __name__ == "__main__":
    raise SystemExit(main())
