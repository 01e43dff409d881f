"""Every command of the package: --help only helps, and nothing is written into the package by default."""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from pathlib import Path

import pytest

import gpbnb

PACKAGE = Path(gpbnb.__file__).parent
COMMANDS = sorted(
    ".".join(("gpbnb", *file.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__main__")
    for file in PACKAGE.rglob("*.py")
    if '__name__ == "__main__"' in file.read_text(encoding="utf-8")
)


def stored():
    return {file: (file.stat().st_mtime_ns, file.stat().st_size) for file in PACKAGE.rglob("*.*s*")}


def test_the_commands_are_found():
    assert {"gpbnb.rolling", "gpbnb.inversion", "gpbnb.ledger", "gpbnb.sweeps", "gpbnb.kalman.year"} <= set(COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_only_helps(command):
    """Asked for help, `gpbnb.rolling` computed for 40 s and wrote its table into the package."""
    before = {file: state for file, state in stored().items() if file.suffix in (".csv", ".json")}
    begin = time.perf_counter()
    found = subprocess.run([sys.executable, "-m", command, "--help"], capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    assert found.stdout.startswith(f"usage: python -m {command}")
    assert {file: state for file, state in stored().items() if file.suffix in (".csv", ".json")} == before
    assert time.perf_counter() - begin < 60


@pytest.mark.parametrize(
    "module",
    ["gpbnb.rolling.__main__", "gpbnb.inversion.__main__", "gpbnb.kalman.threshold", "gpbnb.kalman.mission_runs"],
)
def test_long_commands_write_to_the_given_folder(module, monkeypatch, tmp_path):
    """With the computation replaced: each file goes to the folder, and the package stays as it is."""
    command = importlib.import_module(module)
    written = []
    monkeypatch.chdir(tmp_path)
    for name in ("run", "finished"):
        monkeypatch.setattr("gpbnb.sweeps.sweep.Sweep." + name, lambda *args, **kwargs: [])
    monkeypatch.setattr(
        "gpbnb.sweeps.sweep.Sweep.store",
        lambda self, results, seconds=None, file=None: written.append(Path(file or self.file)),
    )
    monkeypatch.setattr("gpbnb.sweeps.sweep.Sweep.load", lambda self, file: _Loaded())
    assert command.main([]) == 0
    assert written
    assert all(PACKAGE not in file.resolve().parents for file in written)


class _Loaded:
    def records(self):
        return [{"trials": "0"}]
