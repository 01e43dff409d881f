"""What commands say of themselves, and that each gets its own arguments."""

from __future__ import annotations

import runpy
import sys

import pytest
from test_commands import COMMANDS

from gpbnb import __main__ as top
from gpbnb.report.ledger import command as ledger
from gpbnb.wordlength import __main__ as wordlength

LISTED = {
    "wordlength": "how many digits your own filter needs",
    "ledger": "every printed equation, number and claim, with its verdict",
    "bounds.check": "prove the claim of a certificate, without the rest of the package",
    "report.guarantees.certificates": "write and check certificates of the book's guarantees",
    "report.stored": "list the stored sweeps, verify a sample of them, or compute them again",
}


@pytest.mark.parametrize(
    ("command", "statuses"),
    [
        (
            wordlength,
            "Exit status: 0 if a precision meets the tolerance, 1 if none does, 2 if a file or an option is wrong, 130 "
            "if it is interrupted.",
        ),
        (
            ledger,
            "Exit status: 0 if the findings are written, 2 if an option or the output file is wrong, 130 if it is "
            "interrupted.",
        ),
    ],
)
def test_the_help_tells_the_exit_statuses(command, statuses, capsys):
    with pytest.raises(SystemExit, match="0"):
        command.main(["--help"])
    assert statuses in " ".join(capsys.readouterr().out.split())


# -- python -m gpbnb ----------------------------------------------------------------------------------------


def test_every_command_is_listed_with_what_it_does(capsys):
    assert {"gpbnb", *(f"gpbnb.{name}" for name in LISTED)} == set(COMMANDS)
    assert top.main([]) == 0
    about, _, below = capsys.readouterr().out.partition("commands:\n")
    assert "\n\nRounding errors in recursive filters, integrators and matrix computations.\n\n" in about
    listed = dict(line.split(maxsplit=1) for line in below.splitlines()[: len(LISTED)])
    assert listed.keys() == LISTED.keys()
    assert all(listed[name].startswith(LISTED[name]) for name in LISTED)


def test_a_command_gets_its_own_arguments(monkeypatch):
    ran = []
    monkeypatch.setattr(sys, "argv", ["before"])
    monkeypatch.setattr(runpy, "run_module", lambda name, run_name, **_: ran.append((name, run_name, sys.argv)))
    assert top.main(["report.stored", "verify", "--sample", "2"]) == 0
    assert ran == [("gpbnb.report.stored", "__main__", ["report.stored", "verify", "--sample", "2"])]


def test_an_unknown_command_is_told_the_known_ones(capsys):
    with pytest.raises(SystemExit):
        top.main(["bake"])
    shown = capsys.readouterr().err
    assert shown.startswith("usage: python -m gpbnb ")
    assert f"got 'bake'; needed one of {', '.join(LISTED)}" in shown
