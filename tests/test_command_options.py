"""The options of every command: their defaults, what their help says, and that each changes what it says."""

from __future__ import annotations

import argparse
import importlib
import runpy
import sys
from pathlib import Path

import pytest
from test_commands import COMMANDS

from gpbnb import __main__ as top
from gpbnb.report.ledger import command as ledger
from gpbnb.wordlength import __main__ as wordlength

LIMITS = "guarantee and probable: largest size of each {} of the filter without rounding"
#: What each command does, and each option with its default and what it is for.
OPTIONS = {
    "wordlength.__main__": (
        "how many digits a filter needs",
        {
            "--version": (argparse.SUPPRESS, "show program's version number and exit"),
            "model": (None, "TOML file"),
            "--tolerance": (None, "largest allowed error: one number, or one per state or output"),
            "--measurements": (None, "CSV file with one row per step: measurements of a filter, by default simulated"),
            "--inputs": (None, "CSV file with the known inputs u"),
            "--simulate": (None, "inputs of a linear system, in place of --measurements"),
            "--level": (None, "height of a step or sine, standard deviation of noise; one number, or one for each in"),
            "--steps": (None, "number of steps to simulate; default: 1000"),
            "--format": (
                None,
                "judge one format in place of a search: BINARY16, BINARY32, BINARY64, BFLOAT16, TF32",
            ),
            "--digits": (None, "judge this precision in place of a search"),
            "--base": (None, "2, 10 or 16; default: 2"),
            "--rounding": (None, 'rounding rule, such as "nearest" or "chop"; default: nearest'),
            "--emin": (None, "exponent of the smallest normal number; default: unlimited"),
            "--emax": (None, "exponent of the largest number; default: unlimited"),
            "--form": (None, 'covariance update of a Kalman filter, such as "innovation", "Joseph", "UD"'),
            "--fixed": (False, "answer for a linear system in fraction bits of fixed point"),
            "--coefficients": (None, "with --fixed: significant bits of each coefficient"),
            "--mixed": (False, "lower each block of a Kalman filter"),
            "--basis": (None, "how to find the precision; may be given more than once; default: emulation and bound"),
            "--state": (None, LIMITS.format("state")),
            "--innovation": (None, LIMITS.format("innovation")),
            "--measurement": (None, LIMITS.format("measurement")),
            "--report": (None, "HTML file to write, with a JSON file of the same name beside it"),
            "--certificate": (None, "for the basis guarantee: JSON file to write, which python -m gpbnb.bounds.check"),
            "--code": (None, "folder for the filter as C99 with test vectors"),
        },
    ),
    "ledger": (
        "Check every statement of the three documents",
        {
            "--format": ("csv", "default: csv"),
            "--document": (None, "hung1984, hung1982 or savage2016; default: all"),
            "--chapter": (None, "chapter number as in the document, such as II; default: all"),
            "--section": (None, "one or more section numbers; 9 includes 9.1 and 9.2; default: all"),
            "--output": (None, "file to write, replacing any existing file; default: stdout"),
            "--version": (argparse.SUPPRESS, "show program's version number and exit"),
        },
    ),
}
LISTED = {
    "wordlength": "how many digits your own filter needs",
    "ledger": "every printed equation, number and claim, with its verdict",
    "bounds.check": "prove the claim of a certificate, without the rest of the package",
    "report.guarantees.attack": "attack guarantees with emulated runs",
    "report.guarantees.certificates": "write and check certificates of the book's guarantees",
    "report.stored": "list the stored sweeps, verify a sample of them, or compute them again",
}


class Parsed(Exception):
    """Raised in place of reading the arguments."""


@pytest.mark.parametrize("module", OPTIONS)
def test_each_option_has_its_default_and_its_help(module, monkeypatch):
    def parse(parser, arguments):
        raise Parsed(parser)

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    with pytest.raises(Parsed) as raised:
        importlib.import_module(f"gpbnb.{module}").main([])
    (parser,) = raised.value.args
    about, options = OPTIONS[module]
    assert parser.prog == f"python -m gpbnb.{module}".removesuffix(".__main__")
    assert about in parser.description
    _, *actions = parser._actions  # the first is --help
    assert [(action.option_strings or [action.dest])[0] for action in actions] == list(options)
    for action, (default, words) in zip(actions, options.values(), strict=True):
        assert (str(action.default) if isinstance(action.default, Path) else action.default) == default
        assert words in action.help


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
            "exit status: 0, every selected entry has a finding; 1, some entries have no check; 2, the arguments are "
            "invalid, or the ledger or the output file cannot be used; 3, a check raised an exception",
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
