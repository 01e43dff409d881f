"""Every command of the package: it is listed, --help only helps, and nothing is written into the package by default."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import pytest
from forks import answering

import gpbnb
from gpbnb import __main__ as top
from gpbnb.report.stored import SWEEPS, main
from gpbnb.report.sweep import Sweep

PACKAGE = Path(gpbnb.__file__).parent
COMMANDS = sorted(
    ".".join(("gpbnb", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__main__")
    for file in PACKAGE.rglob("*.py")
    if '__name__ == "__main__"' in file.read_text(encoding="utf-8")
)
# Loads the libraries once. For each line of input, a process of its own runs the command of that name.
PROGRAM = """
import io, json, os, runpy, sys
import flint, gmpy2, mpmath, numba

def answer(command):
    sys.stdout, sys.stderr = io.StringIO(), io.StringIO()
    sys.argv = [command, "--help"]
    try:
        runpy.run_module(command, run_name="__main__", alter_sys=True)
        status = None
    except SystemExit as end:
        status = end.code
    print(json.dumps([status, sys.stdout.getvalue(), sys.stderr.getvalue()]), file=sys.__stdout__, flush=True)
"""


def stored():
    files = (file for file in PACKAGE.rglob("*.*s*") if file.suffix in (".csv", ".json"))
    return {file: (file.stat().st_mtime_ns, file.stat().st_size) for file in files}


@pytest.fixture(scope="module")
def helped():
    """`helped(command)` asks a command for help in a new process: its exit status, what it prints, and its errors."""
    # A command that computes instead takes 40 s and more.
    with answering(PROGRAM, timeout=30) as ask:
        yield ask


STATUSES = {
    "gpbnb.wordlength": "0 if a precision meets the tolerance, 1 if none does, 2 if a file or an option is wrong, 130 ",
    "gpbnb.ledger": "0 if the findings are written, 2 if an option or the output file is wrong, 130 if it",
}


@pytest.mark.parametrize("command", COMMANDS)
def test_help_only_helps(command, helped):
    """Asked for help, a command once computed for 40 s and wrote its table into the package."""
    before = stored()
    status, printed, errors = helped(command)
    assert status == 0, errors
    assert printed.startswith(f"usage: python -m {command}")
    assert STATUSES.get(command, "") in " ".join(printed.split())
    assert stored() == before


def test_tables_are_written_below_the_working_directory_by_default(monkeypatch, tmp_path, capsys):
    """With the computation replaced: each file goes to the folder for caches, and the package stays as it is."""
    before, written = stored(), []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Sweep, "recompute", lambda self, folder, *_, **__: written.append(folder) or self.file)
    assert main(["recompute", *(sweep.name for sweep in SWEEPS)]) == 0
    assert written == [Path(".cache/sweeps")] * len(SWEEPS)
    assert stored() == before
    assert len(capsys.readouterr().out.splitlines()) == len(SWEEPS)


def test_every_command_is_listed_with_what_it_does(capsys):
    assert {"gpbnb", *(f"gpbnb.{name}" for name in top.COMMANDS)} == set(COMMANDS)
    assert top.main([]) == 0
    lines = capsys.readouterr().out.partition("commands:\n")[2].splitlines()
    assert dict(line.split(maxsplit=1) for line in lines[: len(top.COMMANDS)]) == top.COMMANDS


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
    assert f"got 'bake'; needed one of {', '.join(top.COMMANDS)}" in shown
