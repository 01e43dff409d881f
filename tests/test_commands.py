"""Every command of the package: --help only helps, and nothing is written into the package by default."""

from __future__ import annotations

from pathlib import Path

import pytest
from forks import answering

import gpbnb
from gpbnb.report.stored import SWEEPS, main
from gpbnb.sweeps import Sweep

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


def test_the_commands_are_found():
    assert {
        "gpbnb.wordlength",
        "gpbnb.ledger",
        "gpbnb.report.stored",
    } <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_only_helps(command, helped):
    """Asked for help, a command once computed for 40 s and wrote its table into the package."""
    before = stored()
    status, printed, errors = helped(command)
    assert status == 0, errors
    assert printed.startswith(f"usage: python -m {command}")
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
