"""C code of steps that are functions: bit for bit as their emulation; how a run ends; refusals."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest
from built_code import disagreement, installed

from gpbnb import BINARY16, BINARY32, BINARY64, FixedFormat, FloatFormat, NonlinearSystem, WordFormats, write_code
from gpbnb.wordlength.c_files import FLAGS
from tests.step_functions import SYSTEMS


def short_words():
    for i, rounding in enumerate(("nearest", "even", "half up", "chop", "up", "down", "odd")):
        yield FixedFormat(4, 11, rounding, "saturate") if i % 2 else FixedFormat(0, 15, rounding, "wrap")


def one_of_each(fmt, x, u):
    """Operations that fixed point has beyond sums, products and quotients."""
    a, b = u
    root, rest = np.sqrt(abs(a)), np.fmod(a, np.where(b == 0, fmt.array("0.3"), b))
    whole = [np.floor(a), np.ceil(a), np.trunc(b), np.rint(b)]
    return np.stack([rest]), np.stack([root, abs(b), -a, *whole])


@pytest.mark.skipif(not shutil.which("gcc"), reason="no gcc")
def test_short_words_in_every_rounding():
    """Also for the most negative number, whose opposite has no word. A compiler builds each, which takes long."""
    system = NonlinearSystem(one_of_each, [0], 2, "each")
    z = np.random.default_rng(0).uniform(-1, 1, (800, 2))
    assert [disagreement(system, fmt, None, z) for fmt in short_words()] == [""] * 7


def last_status(system, fmt, u, folder):
    """Compile and run the test of the code; return the status of the last test vector and the number of vectors."""
    write_code(system, fmt, folder, inputs=u)
    command = [installed()[0], *FLAGS.split(), "-Werror", "-O2", "-o", "run", "test_filter.c", "filter.c", "-lm"]
    subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
    done = subprocess.run(["./run"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    vectors = (folder / "filter_vectors.txt").read_text().splitlines()
    return int(vectors[-1].split()[0]), len(vectors)


@pytest.mark.skipif(not installed(), reason="no gcc and no clang")
@pytest.mark.parametrize("fmt", [BINARY32, FixedFormat(4, 11), FixedFormat(4, 59)], ids=str)
@pytest.mark.parametrize(
    ("step", "status"),
    [
        (lambda fmt, x, u: (x + u / 8, 1 / (x - 1)), "STOPPED"),
        (lambda fmt, x, u: (x + u / 8, np.fmod(x, x - 1)), "STOPPED"),
        (lambda fmt, x, u: (x + u / 8, np.sqrt(1 - x)), "STOPPED"),
        (lambda fmt, x, u: (x * 2 + u, x), "OVERFLOW"),
        # The overflow has no effect: nothing uses it, a choice or a limit hides it.
        (lambda fmt, x, u: ([x + u / 8, (x + u) * x * x * 8][0], x), "OVERFLOW"),
        (lambda fmt, x, u: (x + u / 8, np.where(x >= 0, x, x * x * 8)), "OVERFLOW"),
        (lambda fmt, x, u: (x + u / 8, np.clip(x * x * 8, -1, 1)), "OVERFLOW"),
        (lambda fmt, x, u: (x + u / 8, np.fmod(x, 8 * x * x + 1)), "OVERFLOW"),
    ],
)
def test_the_code_ends_in_the_step_in_which_the_emulation_ends(step, status, fmt, tmp_path):
    huge = fmt in (BINARY32, BINARY64) and status == "OVERFLOW"
    u = np.full(2000, float(fmt.largest) / 256 if huge else 1.0)
    found, vectors = last_status(NonlinearSystem(step, [0]), fmt, u, tmp_path)
    assert found == -2
    assert vectors < len(u)
    assert f"FILTER_{status}" in (tmp_path / "filter.h").read_text()


@pytest.mark.parametrize(
    ("fmt", "form", "message"),
    [
        (FloatFormat(2, 24), None, "no type; needed BINARY32, which rounds ties to even"),
        (BINARY16, None, "got BINARY16, for which C99 has no type"),
        (WordFormats(FixedFormat(10, 21), 12), None, "got formats of words for a nonlinear system"),
        (FixedFormat(10, 21, "stochastic"), None, "stochastic rounding"),
        (BINARY32, "cascade", "got 'cascade' for a NonlinearSystem, which has its structure; needed None; its step"),
    ],
)
def test_what_has_no_code_is_refused(fmt, form, message, tmp_path):
    with pytest.raises(ValueError, match=re.escape(message)):
        write_code(SYSTEMS[0], fmt, tmp_path, form=form)


def test_a_function_without_a_counterpart_is_refused(tmp_path):
    turning = NonlinearSystem(lambda fmt, x, u: (x + u, np.sin(x)), [0])
    with pytest.raises(ValueError, match=r"got np\.sin in the step, for which C has no function"):
        write_code(turning, BINARY32, tmp_path / "code")
    assert not (tmp_path / "code").exists()


@pytest.mark.parametrize("fmt", [FixedFormat(40, -8), FixedFormat(0, 63)], ids=str)
def test_a_root_of_words_with_an_unusual_point_is_refused(fmt, tmp_path):
    rooted = NonlinearSystem(lambda fmt, x, u: (x, np.sqrt(abs(u))), [0])
    with pytest.raises(ValueError, match=r"got a square root of \d+ bits with -?\d+ after the point"):
        write_code(rooted, fmt, tmp_path)


def test_a_header_claims_no_bound(tmp_path):
    text = write_code(SYSTEMS[0], BINARY32, tmp_path)[0].read_text()
    assert "a PI controller with two clips, in BINARY32" in text
    assert "bounds" not in text
