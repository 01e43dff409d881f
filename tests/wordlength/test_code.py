"""Generated C code: bit for bit as its emulation, without a warning; its operations; refusals."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from built_code import SANITIZER, disagreement, driven, installed, models

from gpbnb import (
    BINARY32,
    BINARY64,
    FixedFormat,
    FloatFormat,
    LinearModel,
    LinearSystem,
    WordFormats,
    emulate,
    write_code,
)
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.forms import WITH_PROGRAM
from gpbnb.filters.run import Run
from gpbnb.wordlength.c_files import FLAGS
from gpbnb.wordlength.c_integers import Integers, used_functions
from gpbnb.wordlength.code import prepared
from tests.corpus import conformance

needs_compiler = pytest.mark.skipif(not installed(), reason="no gcc and no clang")


@pytest.mark.long  # a slice of the conformance, which runs a compiler for each build
@needs_compiler
@pytest.mark.parametrize("name", [f"code {i}" for i in range(0, 60, 11)])
def test_code_has_the_digits_of_its_emulation(name):
    _, builds, steps, faults = conformance.built(name, 2026)
    assert faults == []
    assert builds >= len(conformance.LEVELS)
    assert steps > 3


@needs_compiler
@pytest.mark.parametrize("fmt", [BINARY32, FixedFormat(6, 20, "half up", "saturate")], ids=["binary32", "fixed"])
def test_known_inputs_follow_the_measurements(fmt, tmp_path):
    z = np.random.default_rng(2).uniform(-1, 1, (40, 1))
    for form in ("innovation", "joseph", "ud"):
        assert disagreement(driven(), fmt, form, z) == ""
    assert disagreement(replace(driven(), u=["0.3", -1]), fmt, "innovation", z) == ""
    path, *_ = write_code(driven(), fmt, tmp_path)
    assert "whose input holds the measurements, then the known inputs" in header(path)
    assert "const filter_number input[3]" in path.read_text()
    moved = emulate(driven(), z, fmt).x.to_float()
    assert not np.array_equal(moved, emulate(driven().without_inputs(), z, fmt).x.to_float())


def built(folder, flags=FLAGS):
    """Compile and run the test of the code in a folder; return its exit status and what it says."""
    compiler = installed()[0]
    command = [compiler, *flags.split(), "-O2", "-o", "run", "test_filter.c", "filter.c"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run(["./run"], cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


GROWING = LinearSystem([["1.5"]], [[1]])
BIQUAD = FilterDesign(["0.1", "0.2", "0.1"], [1, "-1.2", "0.5"], name="a low-pass section")


# -- the operations of a covariance ----------------------------------------------------------------------------------


DIVISIONS = """
#include <inttypes.h>
#include <stdio.h>
{helpers}
int main(void)
{{
    int64_t a, b;
    while (scanf("%" SCNd64 "%" SCNd64, &a, &b) == 2)
        printf("%" PRId64 "\\n", divide(a, b));
    return 0;
}}
"""


@needs_compiler
@pytest.mark.parametrize(
    ("integer", "fraction", "overflow", "roundings"),
    [
        (8, 55, "wrap", ("nearest", "even", "half up", "chop", "up", "down", "odd")),
        (8, 55, "saturate", ("nearest", "up", "odd")),
        (63, -3, "wrap", ("even", "half up", "chop", "down")),
    ],
)
def test_the_longest_words_are_divided_as_fractions(integer, fraction, overflow, roundings, tmp_path):
    """Also the lowest number of 64 bits, whose negative has 65, without undefined behaviour."""
    edges = [2**63 - 1, 2**62, 2**40 + 1, 3, 1]
    drawn = np.random.default_rng(9).integers(-(2**63), 2**63 - 1, 12).tolist()
    numbers = [-(2**63), *edges, *(-each for each in edges), *drawn, *(each >> 40 for each in drawn)]
    for rounding in roundings:
        fmt = FixedFormat(integer, fraction, rounding, overflow)
        helpers = used_functions(Integers(WordFormats(fmt), fmt.precision + abs(fraction)).functions(), "divide")
        (tmp_path / "run.c").write_text(DIVISIONS.format(helpers=helpers))
        command = [installed()[0], *FLAGS.split(), "-Werror", *SANITIZER.split(), "-o", "run", "run.c"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        within = [each for each in numbers if fmt.lowest <= each * fmt.unit <= fmt.largest]
        pairs = [(a, b) for a in within for b in within if b]
        given = "\n".join(f"{a} {b}" for a, b in pairs)
        done = subprocess.run(["./run"], cwd=tmp_path, input=given, capture_output=True, text=True, check=True)
        assert done.stderr == ""
        assert list(map(int, done.stdout.split())) == [fmt.round(Fraction(a, b)) / fmt.unit for a, b in pairs]


def sparse(seed):
    """A small model with many zeros, which covariances may have in their factors, too."""
    rng = np.random.default_rng(seed)
    n, m = rng.integers(1, 4), rng.integers(1, 3)

    def drawn(*shape):
        return np.where(rng.random(shape) < 0.55, 0, rng.choice([0.125, 0.5, 1.0, -0.5, 1.5], shape))

    def covariance(root, diagonal=0.0):
        return np.tril(root) @ np.tril(root).T + np.diag(np.full(len(root), diagonal))

    covariances = covariance(drawn(n, n)), covariance(drawn(m, m), rng.choice([1 / 64, 0.25, 1.0]))
    return LinearModel(drawn(n, n), drawn(m, n), *covariances, drawn(n), covariance(drawn(n, n)), f"sparse {seed}")


@needs_compiler
def test_what_zeros_leave_without_use_ends_the_code_as_the_emulation():
    """An inverse that a zero row of H multiplies may overflow; a factor that multiplies a zero gain is not computed."""
    formats = BINARY32, FixedFormat(2, 13, "even"), FixedFormat(3, 6, "even", "saturate")
    models = [(sparse(seed), formats[seed % 3]) for seed in range(40, 43)]
    cases = [(model, fmt, form) for model, fmt in models for form in WITH_PROGRAM if fits(model, fmt, form)]
    assert len(cases) > 7
    z = np.random.default_rng(0).uniform(-1, 1, (12, 2))
    assert [disagreement(model, fmt, form, z[:, : model.m]) for model, fmt, form in cases] == [""] * len(cases)


def fits(model, fmt, form):
    """Whether a format holds the model, and definite factors of its covariances."""
    try:
        return bool(prepared(model, fmt, form))
    except (ValueError, OverflowError):
        return False


@needs_compiler
def test_a_zero_pivot_stops_the_code_in_the_step_that_stops_the_emulation(tmp_path):
    fmt = FixedFormat(4, 11, "down", "saturate")
    model = LinearModel([["0.5"]], [["1/64"]], [[0]], [["1/2048"]], [1], [[1]], "fades")
    run = Run(model, fmt, "innovation", ())
    run.take(np.zeros((50, 1)))
    write_code(model, fmt, tmp_path, form="innovation", inputs=np.zeros((50, 1)))
    assert built(tmp_path)[0] == 0
    vectors = (tmp_path / "filter_vectors.txt").read_text().splitlines()
    assert run.indefinite
    assert [line.split()[0] for line in vectors[: run.indefinite]] == ["0"] * (run.indefinite - 1) + ["1"]


@needs_compiler
def test_an_overflow_ends_the_code_in_the_step_that_ends_the_emulation(tmp_path):
    for fmt in (BINARY32, BINARY64, FixedFormat(4, 11), WordFormats(FixedFormat(4, 11), 12, FixedFormat(6, 20))):
        write_code(GROWING, fmt, tmp_path, inputs=np.ones((3000, 1)))
        assert built(tmp_path)[0] == 0
        last = (tmp_path / "filter_vectors.txt").read_text().splitlines()[-1]
        assert last.startswith("-2 ")
        assert "_OVERFLOW = 3" in (tmp_path / "filter.h").read_text()


# -- constant gain ---------------------------------------------------------------------------------------------------


# -- the header ------------------------------------------------------------------------------------------------------


def header(path):
    """The first comment of a header, in one line."""
    return " ".join(re.sub(r"^ \* ?", "", path.read_text().split("*/")[0], flags=re.M).split())


# -- refusals --------------------------------------------------------------------------------------------------------


@needs_compiler
def test_fast_math_is_refused_by_the_compiler(tmp_path):
    write_code(BIQUAD, BINARY32, tmp_path)
    command = [installed()[0], "-std=c99", "-ffast-math", "-c", "filter.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "-ffast-math changes the order of operations; define FILTER_FAST_MATH" in done.stderr


@needs_compiler
@pytest.mark.skipif(not shutil.which("make"), reason="no make")
def test_two_filters_in_one_folder_do_not_share_a_name(tmp_path):
    write_code(BIQUAD, BINARY32, tmp_path, name="low")
    write_code(models()["one state"], FixedFormat(8, 23), tmp_path, form="UD", name="kalman")
    command = [installed()[0], *FLAGS.split(), "-Werror", "-shared", "-fPIC", "-o", "both", "low.c", "kalman.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    done = subprocess.run(["make", "CC=" + installed()[0]], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert "100 steps with the digits of the emulation" in done.stdout


# -- the command -----------------------------------------------------------------------------------------------------


def cmsis(system, fmt, folder):
    """The coefficients that a header lists for CMSIS-DSP, as text, and the sentence about them; None without them."""
    header = write_code(system, fmt, folder)[0].read_text()
    found = re.search(r"/\* (b0, [^*]*) \*/\n#define FILTER_CMSIS \{(.*?)\}", header, re.DOTALL)
    return found and ([each.strip() for each in found[2].replace("\\", "").split(",")], found[1])


def test_a_header_has_the_coefficients_of_sections_in_the_order_of_cmsis(tmp_path):
    sos = [["0.1", "0.2", "0.1", 1, "-0.5", "0.25"], ["0.3", "-2", 0, 1, "-0.6", 0]]
    system = LinearSystem.from_sections(sos)
    for fmt, number in (("float32", np.float32), ("float64", np.float64)):
        texts, _ = cmsis(system, fmt, tmp_path)
        found = [float.fromhex(each.removesuffix("f")) for each in texts]
        b0, b1, b2, _, a1, a2 = np.array([[number(each) for each in row] for row in sos]).T
        assert np.reshape(found, (2, 5)).T.tolist() == [each.tolist() for each in (b0, b1, b2, -a1, -a2)]
    # Integers n that stand for n / 2**15 or n / 2**31, times 2**postShift; q15 has a zero after b0.
    b = [["0.1", "0", "0.2", "0.1"], ["0.3", "0", "-2", "0"]]
    a = [["0.5", "-0.25"], ["0.6", "0"]]
    texts, what = cmsis(system, "Q3.12", tmp_path)
    assert "arm_biquad_cascade_df1_q15 with postShift = 1;" in what
    exactly = [FixedFormat(3, 12).round(each) for above, below in zip(b, a, strict=True) for each in above + below]
    assert [Fraction(int(each), 2**14) for each in texts] == exactly
    texts, what = cmsis(system, WordFormats(FixedFormat(3, 28), 12), tmp_path)
    assert "arm_biquad_cascade_df1_q31 with postShift = 1;" in what
    assert Fraction(int(texts[0]), 2**30) == FloatFormat(2, 12).round("0.1")
    third = LinearSystem.from_coefficients([1], [1, 0, 0, "0.5"])
    short = WordFormats(FixedFormat(3, 12), 12)  # 12 bits of 0.1 do not fit a word of 16 that also holds -2
    none = [(system, short), (system, "Q3.40"), (third, "float32"), (third, "Q3.12"), (GROWING, "float32")]
    assert [cmsis(each, fmt, tmp_path) for each, fmt in none] == [None] * 5
