"""What an answer says about itself: runs that show too little, and what limits a filter in fixed point."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest
from scipy import signal

from gpbnb import BINARY16, FixedFormat, FloatFormat, LinearSystem, WordFormats, limits, required_precision
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.filters.sections import scaled
from gpbnb.filters.structures import DIRECT, cascade, sections_of
from gpbnb.filters.system import LinearFilter
from gpbnb.filters.words import run_words
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.fixed import scaled_sections
from gpbnb.wordlength.required import judge

SLOW = LinearSystem([["0.99997"]], [["0.00003"]], name="slow")
MEMORY = "shorter than the memory of the system, whose slowest response takes 160000 steps to decay to 1 %"
SECTIONS = signal.butter(2, 300, fs=48_000, output="sos")
LOW_PASS = LinearSystem.from_sections(SECTIONS)


def answers(steps, tolerance):
    u = np.random.default_rng(0).standard_normal((steps, 1))
    yield required_precision(SLOW, u, tolerance)
    yield judge(SLOW, FloatFormat(2, 24), u, tolerance)
    yield required_precision(SLOW, u, tolerance, kind="fixed")


def test_a_run_shorter_than_the_memory_of_a_system_says_so():
    """0.99997**153504 is 1 %; after 1000 steps, the answer is too low by half of its bits."""
    assert 153_503 < math.log(0.01) / math.log(0.99997) < 153_504
    for found in answers(1000, 1e-3):
        assert str(found).count(MEMORY) == 1
        assert "the run of 1000 steps" in str(found)
    assert all(MEMORY not in str(found) for found in answers(160_000, 1e-3))
    long, short = (next(answers(steps, 1e-3)).digits for steps in (160_000, 1000))
    assert short < long / 2


def test_a_bound_and_a_system_that_never_forgets_have_no_such_warning():
    u = np.ones((1000, 1))
    assert "memory" not in str(required_precision(SLOW, u, 1e-3, basis="bound"))
    assert "memory" not in str(required_precision(SLOW, u, 1e-3, kind="fixed", basis="guarantee"))
    assert "memory" not in str(required_precision(LinearSystem.sum(running=True), u[:100], 1))


def test_an_output_within_its_tolerance_says_that_zero_would_do():
    system = LinearSystem([["0.5"]], [[1]], [[1], [100]], output_names=["low (V)", "high"])
    found = str(required_precision(system, np.ones((20, 1)), [3, 3]))
    assert 'output "low" never exceeds 2 in this run, so that zero would be within the tolerance of 3' in found
    assert "high" not in found
    assert "never exceeds" not in str(required_precision(system, np.ones((20, 1)), [1, math.inf]))


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_coefficients_that_limit_a_filter_are_named(basis):
    u = np.ones((3000, 1))
    found = required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis)
    assert found.format is None
    assert found.why.startswith("the coefficients limit the filter, whatever the fraction bits of the data: stored in")
    assert "15 significant bits, they give 1" in found.why
    enough = int(found.why.split(";")[1].split()[0])
    assert required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis, coefficient_bits=enough).format is not None
    assert required_precision(LOW_PASS, u, 1e-3, kind="fixed", basis=basis, coefficient_bits=enough - 1).format is None


def test_coefficients_in_a_format_and_a_stored_filter_that_is_not_stable_are_named():
    words = WordFormats(FixedFormat(2, 15), FixedFormat(1, 14))
    found = required_precision(LOW_PASS, np.ones((3000, 1)), 1e-3, kind="fixed", like=words)
    assert "stored in fixed point of 16 bits, 14 of them fraction, they give" in found.why
    near = LinearSystem.from_coefficients(["1e-7"], [1, "-1.9995", "0.99950006"])
    found = required_precision(near, np.ones((100, 1)), 1e-3, kind="fixed", basis="guarantee")
    assert "stored in 15 significant bits, words are refused: the system is stable, but not with" in found.why


@pytest.mark.parametrize("basis", ["emulation", "guarantee"])
def test_a_cascade_says_what_scaling_its_sections_saves(basis):
    """A low-pass of order 8, whose sections have gains from about 1e-5 to 1e3."""
    sos, u = signal.butter(8, 0.05, output="sos"), np.random.default_rng(1).uniform(-1, 1, (300, 1))
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


def test_a_cascade_without_an_answer_says_whether_scaling_gives_one():
    sos, u = signal.butter(8, 0.01, output="sos"), np.random.default_rng(1).uniform(-1, 1, (2000, 1))
    found = required_precision(LinearSystem.from_sections(sos), u, 1e-6, kind="fixed", coefficient_bits=40)
    assert found.format is None
    best = required_precision(LinearSystem.from_sections(sos, scale=True), u, 1e-6, kind="fixed", coefficient_bits=40)
    assert f"(scale=True; in a TOML file, scale = true beside sos), {best.digits} fraction bits in a word of" in str(
        found
    )
    assert "scale" not in str(required_precision(LOW_PASS, np.ones((50, 1)), 1e-30, kind="fixed"))


@pytest.mark.parametrize("form", DIRECT)
def test_the_sections_of_a_cascade_are_scaled_as_its_design_scales_them(form):
    sos = signal.ellip(6, 1, 60, 0.1, output="sos")
    given, scaled = (LinearSystem.from_sections(sos, form, scale=scale) for scale in (False, True))
    assert (scaled_sections(given).made.coefficients == scaled.made.coefficients).all()
    assert scaled_sections(scaled) is None
    assert scaled_sections(LinearSystem.from_sections(sos, "lattice")) is None
    moving = LinearSystem.from_filter(given.made, x0=np.ones(given.n))
    assert scaled_sections(moving) is None


def test_a_first_section_without_states_does_not_hide_the_form_of_the_others():
    sections = [([Fraction(1)], []), *sections_of(signal.ellip(6, 1, 60, 0.1, output="sos"))]
    found = {}
    for form in DIRECT:
        made, want = (cascade(each, form) for each in (sections, scaled(sections, form)))
        system = LinearSystem.from_filter(LinearFilter(made.program, made.coefficients, cascade=made.cascade))
        found[form] = scaled_sections(system).made.coefficients.tolist()
        assert found[form] == want.coefficients.tolist()
    assert found["direct form II"] != found["direct form II transposed"]


def test_a_tolerance_below_the_last_bit_still_blames_the_fraction_bits():
    found = required_precision(LOW_PASS, np.ones((50, 1)), 1e-30, kind="fixed")
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


def test_of_all_structures_the_one_with_the_shortest_word_answers(tmp_path, capsys):
    """Here direct form II needs as few fraction bits, but more integer bits, and stands first in the list."""
    (tmp_path / "low.toml").write_text('b = [0.02, 0.04, 0.02]\na = [1, -1.56, 0.64]\nstructure = "all"\n')
    given = [str(tmp_path / "low.toml"), "--tolerance", "0.001", "--simulate", "noise", "--steps", "200", "--fixed"]
    assert main([*given, "--basis", "emulation"]) == 0
    printed = capsys.readouterr()
    lines = re.findall(r"^(.+), emulation: \d+ .* in a word of (\d+) bits", printed.out + printed.err, re.MULTILINE)
    words = {name: int(bits) for name, bits in lines}
    named, answer = printed.out.splitlines()[-1].split(": ", 1)
    assert len(words) > 5
    assert f"in a word of {min(words.values())} bits" in answer
    assert words[named] == min(words.values())


def test_a_tolerance_for_other_outputs_is_refused_in_fixed_point():
    system = LinearSystem.from_coefficients(["0.1"], [1, "-0.9"])
    with pytest.raises(ValueError, match="needed an error above 0 for each of the 1 outputs"):
        required_precision(system, np.ones((50, 1)), [0.001, 1], kind="fixed")


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


def test_a_slow_system_that_no_precision_suits_names_its_slowness():
    slow = LinearSystem([["0.9999999"]], [[1]])
    found = str(required_precision(slow, np.ones((20, 1)), 1e-3, basis="bound"))
    assert found.endswith("because the system is slow: its slowest response takes 47000000 steps to decay to 1 %")


@pytest.mark.parametrize("basis", ["emulation", "bound", "guarantee"])
def test_a_coefficient_beyond_a_format_is_named_alike_on_every_basis(basis):
    sections = LinearSystem.from_sections(signal.butter(4, 0.02, output="sos"))
    z, within = np.full((20, 1), 0.5), limits(measurement=0.5) if basis == "guarantee" else None
    found = str(judge(sections, FixedFormat(0, 15), z, 1e-3, basis=basis, within=within))
    assert re.search(r"a1_1( = |: got a result of about )-1\.", found)
    words = "16-bit fixed point (15 fraction bits)"
    verdict = {
        "emulation": f"{words} misses the tolerance, in a run of 20 steps",
        "bound": f"nothing is proved for {words}, without a bound on this run of 20 steps",
        "guarantee": f"nothing is proved for {words}, without a guarantee for ever",
    }[basis]
    assert found.startswith(f"{verdict}: ")


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


def test_refusals_describe_formats_in_words():
    system = LinearSystem([["0.5"]], [[1]])
    for basis in ("emulation", "bound", "guarantee"):
        z, within = np.full((3, 1), 100), limits(measurement=100) if basis == "guarantee" else None
        found = str(judge(system, FixedFormat(3, 12), z, 1, basis=basis, within=within))
        assert "16-bit fixed point (12 fraction bits)" in found
        assert "FixedFormat(" not in found
    words = WordFormats(FixedFormat(2, 12), FixedFormat(0, 15))
    with pytest.raises(OverflowError, match="beyond the range of fixed point of 16 bits, 15 of them fraction; needed"):
        run_words(LOW_PASS, np.ones((3, 1)), words)
