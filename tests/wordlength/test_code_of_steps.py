"""C code of steps that are functions: bit for bit as their emulation; how a run ends; refusals."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from built_code import disagreement, installed

from gpbnb import (
    BINARY32,
    BINARY64,
    FixedFormat,
    NonlinearModel,
    NonlinearSystem,
    emulate,
    write_code,
)
from gpbnb.wordlength.c_files import FLAGS

SHORT = [
    FixedFormat(4, 11, rounding, "saturate") if i % 2 else FixedFormat(0, 15, rounding, "wrap")
    for i, rounding in enumerate(("even", "nearest", "half up", "chop", "up", "down", "odd"))
]
REST = [pytest.param(fmt, marks=pytest.mark.long) for fmt in SHORT[2:]]  # a C compiler builds each


def one_of_each(fmt, x, u):
    """Operations that fixed point has beyond sums, products and quotients."""
    a, b = u
    divisor = np.where(b == 0, fmt.array("0.3"), b)
    whole = [np.floor(a), np.ceil(a), np.trunc(b), np.rint(b)]
    return np.stack([np.fmod(a, divisor)]), np.stack([np.sqrt(abs(a)), abs(b), -a, a % divisor, *whole])


@pytest.mark.skipif(not shutil.which("gcc"), reason="no gcc")
@pytest.mark.parametrize("fmt", [*SHORT[:2], *REST], ids=str)
def test_short_words_in_every_rounding(fmt):
    """Also for the most negative number, whose opposite has no word."""
    system = NonlinearSystem(one_of_each, [0], 2, "each")
    z = np.random.default_rng(0).uniform(-1, 1, (300, 2))
    assert disagreement(system, fmt, None, z) == ""


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
@pytest.mark.parametrize("fmt", [BINARY32, FixedFormat(4, 59)], ids=str)
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


def turning(fmt, x, u):
    """A state, and functions of it that C's library does not round correctly."""
    y = np.stack([np.sin(x[0]), np.arctan2(-u[0] * 0, x[0] - 2), np.exp(-x[0]), np.float_power(x[0] + 3, u[0])])
    return x / 2 + u, np.append(y, np.hypot(np.cbrt(y[0]), np.arctanh(y[0] / 2)))


@pytest.mark.skipif(not installed(), reason="no gcc and no clang")
@pytest.mark.parametrize("fmt", [BINARY32, BINARY64], ids=["binary32", "binary64"])
def test_functions_of_c_stay_within_the_tolerance_that_the_header_states(fmt, tmp_path):
    """And the test of the code finds a vector that is off by more."""
    system, u = NonlinearSystem(turning, [0]), np.random.default_rng(1).uniform(-1, 1, (60, 1))
    header, *_ = write_code(system, fmt, tmp_path, inputs=u, exact=False)
    stated = float(re.search(r"allows each state at most ([\d.e-]+):", header.read_text().replace("\n * ", " "))[1])
    allowed = re.search(r"tolerance\[\] = \{(.*)\}", (tmp_path / "test_filter.c").read_text())[1].split(", ")
    even, up, down = (emulate(system, u, replace(fmt, rounding=each)).y.to_float() for each in ("even", "up", "down"))
    expected = 4 * np.maximum(abs(up - even), abs(down - even)).max(axis=0)
    assert [float(each) for each in allowed[1:]] == pytest.approx(expected.tolist(), rel=1e-8)
    assert stated == pytest.approx(max(map(float, allowed)), rel=0.05)
    command = [installed()[0], *FLAGS.split(), "-Werror", "-O2", "-o", "run", "test_filter.c", "filter.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    done = subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "60 steps near those of the emulation\n")
    rows = [row.split() for row in (tmp_path / "filter_vectors.txt").read_text().splitlines()]
    for column in range(2, 8):
        moved = [[*row[:column], (float.fromhex(row[column]) + 1.1 * stated).hex(), *row[column + 1 :]] for row in rows]
        (tmp_path / "moved.txt").write_text("\n".join(map(" ".join, moved)))
        done = subprocess.run(["./run", "moved.txt"], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (1, f"step 1: number {column - 2} differs\n")


def beacon(method, sight, **options):
    """A vehicle whose step and sight are functions; its noise has a cycle of two, and it has a known input."""

    def moved(x, u):
        return np.stack([x[0] + x[1], x[1] / (2 + x[0] * x[0]) + u[0]])

    Q, u = [np.diag([0.01, 2**-10]), np.diag([0.02, 2**-10])], np.linspace(-1, 1, 40).reshape(-1, 1)
    return NonlinearModel(
        moved, None, sight, None, Q, np.diag([2**-4, 2**-10]), [0, 1], np.eye(2), u=u, method=method, **options
    )


def seen(x, u):
    return np.stack([x[0] * x[0] * x.format.array("0.1"), np.sqrt(x[1] * x[1] + 1)])


def bearing(x, u):
    return np.stack([np.hypot(3 - x[0], 4), np.arctan2(4, 3 - x[0])])


FORMS = ["innovation", "UD", "Potter", "Carlson"]


@pytest.mark.skipif(not installed(), reason="no gcc and no clang")
@pytest.mark.parametrize(
    ("fmt", "forms"),
    [(BINARY32, FORMS), (FixedFormat(8, 23, "half up", "saturate"), ["innovation", "UD"])],
    ids=["binary32", "fixed"],
)
def test_nonlinear_filters_have_the_digits_of_their_emulation(fmt, forms):
    z = np.random.default_rng(4).uniform(-1, 1, (40, 2))
    assert [disagreement(beacon("extended", seen), fmt, form, z) for form in forms] == [""] * len(forms)
    assert disagreement(beacon("unscented", seen), fmt, None, z) == ""
    assert disagreement(beacon("extended", bearing, angles=[1]), BINARY32, "UD", z, exact=False) == ""
