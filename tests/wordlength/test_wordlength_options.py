"""gpbnb.wordlength.options and running: what is taken as it is written, and what happens to files."""

from __future__ import annotations

import argparse
import os
import stat
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import numpy as np
import pytest

import gpbnb
from gpbnb.arithmetic.kernels.backends import Compiled
from gpbnb.bounds.guess import FilterLimits
from gpbnb.filters.simulation import simulated_inputs
from gpbnb.report import ledger_options
from gpbnb.report.ledger.render import FORMATS
from gpbnb.wordlength import options, report
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.answer import Basis
from gpbnb.wordlength.asked import tolerances_of

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


def test_the_light_lists_are_those_of_the_library():
    assert get_args(Basis) == options.BASES
    assert FilterLimits._fields == options.QUANTITIES
    assert tuple(FORMATS) == ledger_options.FORMATS
    for kind in options.SIGNALS:
        assert simulated_inputs(kind, 1, 3, 2).shape == (3, 2)


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


def test_every_named_format_is_taken(folder, computed):
    taken = [name for name in gpbnb.NAMED_FORMATS if isinstance(getattr(gpbnb, name).backend, Compiled)]
    for name in taken:
        assert main([str(folder / "system.toml"), "--tolerance", "1", "--simulate", "step", "--format", name]) == 0
    assert [question.fmt for question in computed] == [getattr(gpbnb, name) for name in taken]


def test_a_format_without_compiled_loops_is_not_offered(folder, computed, capsys):
    """Refused before anything is computed, in any spelling, by a message and a help that name only what is taken."""
    refused = []
    for name in (*gpbnb.NAMED_FORMATS, "float128"):
        status = main([str(folder / "system.toml"), "--tolerance", "1", "--simulate", "step", "--format", name])
        if status == 2:
            refused.append(name)
            message = capsys.readouterr().err
            assert "which has no compiled loops; needed one of BINARY16, " in message
            assert "BINARY128, BF" not in message.partition("needed")[2]
    assert refused == ["BINARY128", "DECIMAL128", "float128"]
    help_text = " ".join(options.parser().format_help().split())
    assert "BINARY64, BFLOAT16" in help_text
    assert "DECIMAL64, IBM_HEX32" in help_text


def test_simulated_inputs_are_those_of_a_converter_of_16_bits():
    step = simulated_inputs("step", (2, 0.5), 4, 2)
    assert step.tolist() == [[2, 0.5]] * 4
    sine = simulated_inputs("sine", 3, 200, 1)[:, 0]
    assert np.abs(sine - 3 * np.sin(2 * np.pi * np.arange(1, 201) / 100)).max() <= 4 / 2**17 * (1 + 1e-9)
    assert abs(sine).max() == 3
    noise = simulated_inputs("noise", 0.1, 40_000, 1)
    assert noise.std() == pytest.approx(0.1, rel=4 / np.sqrt(2 * 40_000))  # four standard errors
    assert np.array_equal(noise, simulated_inputs("noise", 0.1, 40_000, 1, seed=0))
    for given, unit in ((sine, 4 / 2**16), (noise, 0.125 / 2**16)):
        assert not (given / unit % 1).any()


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


def test_numbers_are_read_exactly(folder, computed):
    """The nearest float64 of 0.1 is larger than it."""
    limits = ["--basis", "guarantee", "--state", "9", "--innovation", "0.1"]
    assert main([str(folder / "filter.toml"), "--tolerance", "1/10,inf", *limits]) == 0
    assert computed[0].tolerance == ["1/10", "inf"]
    assert computed[0].within.innovation >= Fraction("0.1")
    assert tolerances_of(computed[0].tolerance, 2, "states")[0] <= Fraction("0.1")
    with pytest.raises(ValueError, match=r"got tolerance 1e-400; needed at least 2\*\*-1074"):
        tolerances_of("1e-400", 1, "states")
