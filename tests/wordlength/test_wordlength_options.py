"""gpbnb.wordlength.options and running: what is taken as it is written, and what happens to files."""

from __future__ import annotations

import argparse
import os
import stat
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import gpbnb
from gpbnb.wordlength import options, report
from gpbnb.wordlength.__main__ import main

SYSTEM = 'A = [[0.875]]\nB = [[0.125]]\ninputs = ["sensor (V)"]\noutputs = ["level (V)"]\n'
FILTER = "Phi = [[1]]\nH = [[1]]\nQ = [[0.01]]\nR = [[1]]\nx0 = [0]\nP0 = [[1]]\n"
REPORT = SimpleNamespace(
    entries={"text": "12 bits", "shortest": ""},
    answer=SimpleNamespace(met=True),
    to_html=lambda: "<p>new</p>",
    to_json=lambda: "{}",
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "system.toml").write_text(SYSTEM)
    (tmp_path / "filter.toml").write_text(FILTER)
    (tmp_path / "z.csv").write_text("1\n2\n")
    return tmp_path


@pytest.fixture
def computed(monkeypatch):
    """Questions that were computed; none of them takes time."""
    asked = []
    monkeypatch.setattr(report, "study", lambda question, *_: asked.append(question) or REPORT)
    return asked


@pytest.mark.parametrize("option", ["--report", "--certificate"])
def test_a_device_or_pipe_is_refused_and_stays(option, folder, capsys, computed):
    # Replacing /dev/null by a page, as root, would harm every program on the machine.
    os.mkfifo(folder / "pipe.html")
    os.symlink(folder / "pipe.html", folder / "link.html")
    for name in ("pipe.html", "link.html"):
        given = [str(folder / "system.toml"), "--tolerance", "1", "--basis", "guarantee", "--measurement", "1"]
        assert main([*given, option, str(folder / name)]) == 2
        assert f"{name} is a device or pipe; needed a file in a folder" in capsys.readouterr().err
        assert stat.S_ISFIFO((folder / "pipe.html").stat().st_mode)
    assert computed == []


@pytest.mark.parametrize("module", ["gpbnb.wordlength", "gpbnb", "gpbnb.ledger"])
def test_help_and_refusals_import_nothing_that_computes(module, tmp_path):
    """They took a second or two of imports."""
    code = """
import runpy, sys
sys.argv = ["x", *sys.argv[2:]]
try:
    runpy.run_module(MODULE, run_name="__main__", alter_sys=True)
except SystemExit as end:
    heavy = {"numba", "scipy", "sympy", "matplotlib", "flint"} & set(sys.modules)
    print(sorted(heavy), end.code)
"""
    for arguments, status in ((["--help"], 0), (["--no-such-option"], 2)):
        done = subprocess.run(
            [sys.executable, "-c", code.replace("MODULE", repr(module)), "x", *arguments],
            capture_output=True,
            text=True,
            cwd=Path(gpbnb.__file__).parents[1],
        )
        assert done.stdout.splitlines()[-1] == f"[] {status}", done.stderr
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert isinstance(options.parser(), argparse.ArgumentParser)
