"""Models whose code is written, compiled and compared with the emulation."""

from __future__ import annotations

import shutil
import subprocess
import tempfile

import numpy as np

from gpbnb import LinearModel, write_code
from gpbnb.wordlength.c_files import FLAGS

SANITIZER = "-fsanitize=undefined -fno-sanitize-recover=all"


def installed(names=("gcc", "clang")):
    """The compilers of these that are installed."""
    return [each for each in names if shutil.which(each)]


def disagreement(given, fmt, form, z, exact=True):
    """What the test of the generated code says against its emulation with these inputs; empty if they agree."""
    with tempfile.TemporaryDirectory() as folder:
        write_code(given, fmt, folder, form=form, inputs=z, exact=exact)
        build = f"{installed()[0]} {FLAGS} -Werror -O0 {SANITIZER} -o run filter.c test_filter.c -lm"
        for command in (build.split(), ["./run"]):
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            if done.returncode:
                return done.stderr or done.stdout or f"exit status {done.returncode}"
    return ""


def driven():
    """A Kalman filter with two known inputs, one of which moves the position, too."""
    u = np.random.default_rng(3).uniform(-1, 1, (40, 2))
    B, Q = [["0.005", 0], ["0.1", "0.3"]], [["0.001", 0], [0, "0.01"]]
    return LinearModel([[1, "0.1"], [0, 1]], [[1, 0]], Q, [["0.5"]], [0, 0], [[1, 0], [0, 1]], "driven", B=B, u=u)


def models():
    """Kalman filters: one state, three states and two correlated sensors, and one whose sensor changes."""
    return {
        "one state": LinearModel([["0.95"]], [[1]], [["0.25"]], [["0.5"]], ["0.5"], [[2]], "one state"),
        "three states": LinearModel(
            [[1, "0.1", 0], [0, 1, "0.1"], [0, 0, "0.9"]], [[1, 0, 0], ["0.5", 1, 0]],
            np.diag([1, 2, 3]) / 16, [[1, 0.25], [0.25, 2]], [0, 0, 0], np.diag([4, 4, 4]), "three states",
        ),
        "a cycle of three": LinearModel(
            [["0.9", "0.2"], ["-0.1", "0.8"]], [[[1, 0]], [["0.6", "0.8"]], [[0, 1]]],
            [[[0.25, 0.0], [0.0, 0.5]]], [[[1]], [["0.5"]], [[2]]], [0, 0], np.diag([1, 2]), "a cycle of three",
        ),
    }  # fmt: skip
