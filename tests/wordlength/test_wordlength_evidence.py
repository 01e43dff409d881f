"""What an answer says about itself: runs that show too little, and what limits a filter in fixed point."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from gpbnb import BINARY16, FixedFormat, FloatFormat, LinearSystem, limits, required_precision
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.required import judge

SLOW = LinearSystem([["0.99"]], [["0.01"]], name="slow")
MEMORY = "shorter than the memory of the system, whose slowest response takes 460 steps to decay to 1 %"
SECTIONS = signal.butter(2, 300, fs=48_000, output="sos")
LOW_PASS = LinearSystem.from_sections(SECTIONS)


def answers(steps, tolerance):
    u = np.random.default_rng(0).standard_normal((steps, 1))
    yield required_precision(SLOW, u, tolerance)
    yield judge(SLOW, FloatFormat(2, 24), u, tolerance)
    yield required_precision(SLOW, u, tolerance, kind="fixed")


def test_a_run_shorter_than_the_memory_of_a_system_says_so():
    """0.99**458 is 1 %; after 30 steps, the answer is too low by five bits."""
    assert 458 < math.log(0.01) / math.log(0.99) < 459
    short, long = ([*answers(steps, 1e-3)] for steps in (30, 460))
    for found in short:
        assert str(found).count(MEMORY) == 1
        assert "the run of 30 steps" in str(found)
    assert all(MEMORY not in str(found) for found in long)
    assert short[0].digits == long[0].digits - 5


def test_an_output_within_its_tolerance_throughout_is_named():
    """The outputs end with 3 and -1/2; zero would do for the second."""
    system = LinearSystem(np.zeros((2, 2), int), [[1, 0], [0, 1]], output_names=["first", "second"])
    u = np.array([[0, 0], [3, "0.25"], [1, "-0.5"], [0, 0]], dtype=object)
    notes = required_precision(system, u, (1, 1)).notes
    assert (
        'output "second" never exceeds 0.5 in this run, so that zero would be within the tolerance of 1'
        in "; ".join(notes)
    )
    assert "first" not in "; ".join(notes)


def test_a_bound_and_a_system_that_never_forgets_have_no_such_warning():
    u = np.ones((100, 1))
    assert "memory" not in str(required_precision(SLOW, u, 1e-3, basis="bound"))
    assert "memory" not in str(required_precision(SLOW, u, 1e-3, kind="fixed", basis="guarantee"))
    assert "memory" not in str(required_precision(LinearSystem.sum(running=True), u, 1))


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_coefficients_that_limit_a_filter_are_named(basis):
    u = np.ones((600, 1))
    found = required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis)
    assert found.format is None
    assert found.why.startswith("the coefficients limit the filter, whatever the fraction bits of the data: stored in")
    assert "15 significant bits, they give 1" in found.why
    enough = int(found.why.split(";")[1].split()[0])
    assert required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis, coefficient_bits=enough).format is not None
    assert required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis, coefficient_bits=enough - 1).format is None


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_a_cascade_says_what_scaling_its_sections_saves(basis):
    """A low-pass of order 6, whose sections have gains far from one."""
    sos, u = signal.butter(6, 0.05, output="sos"), np.random.default_rng(1).uniform(-1, 1, (300, 1))
    given, scaled = (LinearSystem.from_sections(sos, scale=scale) for scale in (False, True))
    found, best = (
        required_precision(each, u, 1e-4, kind="fixed", basis=basis, coefficient_bits=24) for each in (given, scaled)
    )
    word = 1 + best.format.data.precision
    assert word < found.format.data.precision - 10
    how = "(scale=True; in a TOML file, scale = true beside sos)"
    saved = f"{how}, {best.digits} fraction bits in a word of {word} bits are enough"
    assert str(found).count(f"; with its sections scaled by powers of two {saved}") == 1
    assert not any("scaled" in note for note in best.notes)


def test_the_command_takes_the_bits_of_coefficients(tmp_path, capsys):
    rows = ", ".join(str([float(c) for c in row]) for row in SECTIONS)
    (tmp_path / "low.toml").write_text(f"sos = [{rows}]\n")
    given = [
        str(tmp_path / "low.toml"),
        "--tolerance",
        "0.001",
        "--simulate",
        "step",
        "--steps",
        "600",
        "--kind=fixed",
    ]
    assert main([*given, "--basis", "emulation"]) == 1
    assert "--coefficients in the command" in capsys.readouterr().out
    assert main([*given, "--basis", "emulation", "--coefficients", "24", "--code", str(tmp_path / "code")]) == 0
    assert "fraction bits in a word of" in capsys.readouterr().out
    assert (tmp_path / "code").is_dir()
    for more, message in (
        (["--coefficients", "54"], "got coefficient_bits 54; needed a whole number, at least 1 and at most 53"),
        (["--base", "10"], "got --kind fixed and --base; needed --kind alone: fixed point has base 2"),
    ):
        assert main([*given, *more]) == 2
        assert message in capsys.readouterr().err
    assert main([*given[:-1], "--coefficients", "24"]) == 2
    assert "got --kind float and --coefficients; needed --kind fixed or --kind words" in capsys.readouterr().err


# -- what a refusal says ----------------------------------------------------------------------------------------------


def test_a_design_that_float64_has_made_unstable_is_told_where_to_find_sections():
    u = np.ones((500, 1))
    long = LinearSystem.from_coefficients(*signal.butter(12, 0.02))
    assert long.unstable()
    advice = 'take second-order sections from the design tool, as output="sos" of SciPy gives them'
    assert str(required_precision(long, u, 1e-3)).endswith(advice)
    short = LinearSystem.from_coefficients([1], [1, -2.5, 1])
    assert "sections" not in str(required_precision(short, u, 1e-3))


def test_a_direct_form_that_no_precision_suits_says_by_how_much_it_misses():
    long = LinearSystem.from_coefficients(*signal.butter(8, 0.02))
    found = required_precision(long, np.ones((500, 1)), 1e-7)
    assert f"; 53 bits give {found.tried[-1][1]:.3g} times the tolerance; second-order sections usually" in str(found)
    lasting = required_precision(long, np.ones((500, 1)), 1e-4, basis="bound")
    assert f"; 53 bits give {lasting.tried[-1][1]:.3g} times the tolerance; second-order" in str(lasting)


def test_a_bound_that_is_too_large_proves_no_miss():
    system, u, within = LinearSystem([["0.875"]], [["0.125"]]), np.ones((60, 1)), limits(measurement=1)
    text = {
        "emulation": "BINARY16 misses the tolerance: its error is {} times as large, observed in 60 steps",
        "bound": "nothing is proved for BINARY16: the bound on this run of 60 steps is {} times the tolerance",
        "guarantee": "nothing is proved for BINARY16: the guaranteed bound for ever is {} times the tolerance",
        "probable": "BINARY16 misses the tolerance: three times the probable error is {} times the tolerance",
    }
    for basis, expected in text.items():
        used = within if basis in ("guarantee", "probable") else None
        found = judge(system, BINARY16, u, 1e-4, basis=basis, within=used)
        assert found.ratio > 1
        assert str(found) == expected.format(f"{found.ratio:.3g}")
    saturated = FixedFormat(3, 4, Rounding.CHOP, overflow="saturate")
    found = str(judge(system, saturated, u, 1e-4))
    assert found.startswith("8-bit fixed point (4 fraction bits, chopped, saturated) misses the tolerance: its error")
