"""What an answer says about itself: runs that show too little, and what limits a filter in fixed point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from gpbnb import FixedFormat, FloatFormat, LinearSystem, WordFormats, required_fraction_bits, required_precision
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.judging import judge

SLOW = LinearSystem([["0.99997"]], [["0.00003"]], name="slow")
MEMORY = "shorter than the memory of the system, whose slowest response takes 160000 steps to decay to 1 %"
SECTIONS = signal.butter(2, 300, fs=48_000, output="sos")
LOW_PASS = LinearSystem.from_sections(SECTIONS)


def answers(steps, tolerance):
    u = np.random.default_rng(0).standard_normal((steps, 1))
    yield required_precision(SLOW, steps, tolerance, z=u)
    yield judge(SLOW, FloatFormat(2, 24), steps, tolerance, z=u)
    yield required_fraction_bits(SLOW, u, tolerance)


def test_a_run_shorter_than_the_memory_of_a_system_says_so():
    """0.99997**153504 is 1 %; after 1000 steps, the answer is too low by half of its bits."""
    assert 153_503 < math.log(0.01) / math.log(0.99997) < 153_504
    for found in answers(1000, 1e-3):
        assert str(found).count(MEMORY) == 1
        assert "the run of 1000 steps" in str(found)
    assert all(MEMORY not in str(found) for found in answers(160_000, 1e-3))
    long, short = (next(answers(steps, 1e-3)).precision for steps in (160_000, 1000))
    assert short < long / 2


def test_a_bound_and_a_system_that_never_forgets_have_no_such_warning():
    u = np.ones((1000, 1))
    assert "memory" not in str(required_precision(SLOW, 1000, 1e-3, z=u, basis="bound"))
    assert "memory" not in str(required_fraction_bits(SLOW, u, 1e-3, "guarantee"))
    assert "memory" not in str(required_precision(LinearSystem.sum(running=True), 100, 1, z=u[:100]))


def test_an_output_within_its_tolerance_says_that_zero_would_do():
    system = LinearSystem([["0.5"]], [[1]], [[1], [100]], output_names=["low (V)", "high"])
    found = str(required_precision(system, 20, [3, 3], z=np.ones((20, 1))))
    assert 'output "low" never exceeds 2 in this run, so that zero would be within the tolerance of 3' in found
    assert "high" not in found
    assert "never exceeds" not in str(required_precision(system, 20, [1, math.inf], z=np.ones((20, 1))))


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_coefficients_that_limit_a_filter_are_named(basis):
    u = np.ones((3000, 1))
    found = required_fraction_bits(LOW_PASS, u, 1e-3, basis)
    assert found.fmt is None
    assert found.why.startswith("the coefficients limit the filter, whatever the fraction bits of the data: stored in")
    assert "15 significant bits, they give 1" in found.why
    enough = int(found.why.split(";")[1].split()[0])
    assert required_fraction_bits(LOW_PASS, u, 1e-3, basis, coefficient_bits=enough).fmt is not None
    assert required_fraction_bits(LOW_PASS, u, 1e-3, basis, coefficient_bits=enough - 1).fmt is None


def test_coefficients_in_a_format_and_a_stored_filter_that_is_not_stable_are_named():
    words = WordFormats(FixedFormat(2, 15), FixedFormat(1, 14))
    found = required_fraction_bits(LOW_PASS, np.ones((3000, 1)), 1e-3, like=words)
    assert "stored in fixed point of 16 bits, 14 of them fraction, they give" in found.why
    near = LinearSystem.from_coefficients(["1e-7"], [1, "-1.9995", "0.99950006"])
    found = required_fraction_bits(near, np.ones((100, 1)), 1e-3, "guarantee")
    assert "stored in 15 significant bits, words are refused: the system is stable, but not with" in found.why


def test_a_tolerance_below_the_last_bit_still_blames_the_fraction_bits():
    found = required_fraction_bits(LOW_PASS, np.ones((50, 1)), 1e-30)
    assert found.why.endswith("fraction bits are the most tried")


def test_the_command_takes_the_bits_of_coefficients(tmp_path, capsys):
    rows = ", ".join(str([float(c) for c in row]) for row in SECTIONS)
    (tmp_path / "low.toml").write_text(f"sos = [{rows}]\n")
    given = [str(tmp_path / "low.toml"), "--tolerance", "0.001", "--simulate", "step", "--steps", "3000", "--fixed"]
    assert main([*given, "--basis", "emulation"]) == 1
    assert "--coefficients in the command" in capsys.readouterr().out
    assert main([*given, "--basis", "emulation", "--coefficients", "24", "--code", str(tmp_path / "code")]) == 0
    assert "fraction bits in a word of" in capsys.readouterr().out
    assert (tmp_path / "code").is_dir()
    for more, message in (
        (["--coefficients", "54"], "got --coefficients 54; needed 1 to 53 significant bits"),
        (["--coefficients", "24", "--mixed"], "got --coefficients and --mixed; needed --fixed with it, without"),
    ):
        assert main([*given, *more]) == 2
        assert message in capsys.readouterr().err
    assert main([*given[:-1], "--coefficients", "24"]) == 2
    assert "got --coefficients; needed --fixed with it" in capsys.readouterr().err
