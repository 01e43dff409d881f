"""Calls that are refused, in refused.txt by the function that refuses: each with its exception and the whole message.

`python -m tests.test_refused` writes the messages of today into the file; `git diff` shows what has changed. A call
that is accepted, or that computes before it refuses, says so in place of a message.
"""

from __future__ import annotations

import contextlib
import io
import math
import operator
import os
import tempfile
from dataclasses import replace
from datetime import date
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from unittest import mock

import control
import mpmath
import numpy as np
import pytest
from flint import arb
from scipy import signal

import gpbnb
from gpbnb.arithmetic.array import FloatArray
from gpbnb.arithmetic.bounds import gamma, gamma_probabilistic
from gpbnb.arithmetic.derivatives import jacobian
from gpbnb.arithmetic.rational import column_sum_norm, exact, max_norm, row_sum_norm
from gpbnb.bounds import inverse
from gpbnb.bounds.gains import schedule
from gpbnb.bounds.guarantee import from_schedule
from gpbnb.bounds.guess import FilterLimits
from gpbnb.bounds.system import output_errors
from gpbnb.filters import emulation
from gpbnb.filters.blocks import BLOCKS
from gpbnb.filters.design import FilterDesign
from gpbnb.filters.run import Run, Sums
from gpbnb.filters.simulation import simulated_inputs
from gpbnb.report.integration import precision, theory
from gpbnb.wordlength import report
from gpbnb.wordlength.__main__ import main
from gpbnb.wordlength.code import prepared
from gpbnb.wordlength.models import read_measurements
from gpbnb.wordlength.required import judge
from tests.filters.test_model import GOOD as TWO

STORED = Path(__file__).with_name("refused.txt")
FILES = {
    "m.toml": "Phi=[[1,1],[0,1]]\nH=[[1,0]]\nQ=[[1,0],[0,1]]\nR=[[1]]\nx0=[0,0]\nP0=[[1,0],[0,1]]\n",
    "s.toml": "A=[['0.9']]\nB=[['0.1']]\n",
    "z.csv": "1\n2\n3\n",
    "timed.csv": "t (s),z (m)\n0,1\n1,2\n2,3\n",
    "data.json": "1\n2\n3\n",
    "own.json": "{}",
    "notes.html": "{}",
    "own.py": "def step(fmt, x, u):\n    return x, u\n\n\ndef mean(fmt, z):\n    return z[0]\n\n\nrate = 3\n",
    "syntax.py": "def f(x):\n    retrn x\n",
    "lacks.py": "import nowhere_at_all\n",
    "leaves.py": "raise SystemExit(3)\n",
}


class Refused(Exception):
    """What the command wrote as it refused."""


def command(arguments):
    """Ask the command, with a tolerance and the simplest basis if it is given none."""
    asked = arguments.split()
    for option, value in {"--tolerance": "1", "--basis": "emulation"}.items():
        asked += [] if option in asked else [option, value]
    with contextlib.redirect_stderr(io.StringIO()) as shown, contextlib.redirect_stdout(io.StringIO()):
        status = main(asked)
    if status == 2:
        raise Refused(shown.getvalue().removeprefix("python -m gpbnb.wordlength: ").rstrip("\n"))


def given(content, name="given.toml"):
    """Write a file; return its name."""
    Path(name).write_bytes(content.encode() if isinstance(content, str) else content)
    return name


def model(**changes):
    return gpbnb.LinearModel(**TWO | changes)


def mapping(**changes):
    return {name: each for name, each in (TWO | changes).items() if each is not None}


def driven():
    return model(B=[[1], [0]], u=[[1]] * 5)


def nonlinear(**changes):
    noise = {"Q": [[0, 0], [0, "0.01"]], "R": [["0.5", "0.1"], ["0.1", 1]], "x0": [0, 1], "P0": [[1, 0], [0, 1]]}
    return gpbnb.NonlinearModel(**{"f": lambda x: x, "F": None, "h": lambda x: x, "H": None} | noise | changes)


def ask(model=None, z=60, tolerance=1e-3, **options):
    return gpbnb.required_precision(model or gpbnb.LinearModel(**TWO), z, tolerance, **options)


def blocks(**changes):
    return gpbnb.BlockFormats(**dict.fromkeys(BLOCKS, gpbnb.BINARY32) | changes)


def stepped(step):
    return prepared(gpbnb.NonlinearSystem(step, [1]), gpbnb.BINARY32, None)


NAMES = {name: getattr(gpbnb, name) for name in gpbnb.__all__} | {
    each.__name__: each
    for each in (
        *(ask, blocks, command, driven, given, mapping, model, nonlinear, stepped, replace, FloatArray, Run, Sums),
        *(
            FilterLimits,
            from_schedule,
            schedule,
            judge,
            jacobian,
            output_errors,
            simulated_inputs,
            read_measurements,
            exact,
        ),
        *(gamma, gamma_probabilistic, max_norm, column_sum_norm, row_sum_norm, exact, Decimal, Fraction, date),
        *(arb, control, math, mpmath, operator),
    )
}
NAMES |= {
    "np": np,
    "emulation": emulation,
    "inverse": inverse,
    "precision": precision,
    "theory": theory,
    "signal": signal,
    "D4": (D4 := gpbnb.FloatFormat(10, 4)),
    "B8": (B8 := gpbnb.FloatFormat(2, 8)),
    "FMT": gpbnb.FloatFormat(2, 24),
    "V": D4.array(["1.5", "-2", "0"]),
    "W": B8.array([1, 2, 3]),
    "ONE": np.ones((2, 2)),
    "rows": lambda n: D4.array(np.arange(1, n * n + 1).reshape(n, n)),
    "WALK": gpbnb.LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]]),
    "SYSTEM": gpbnb.LinearSystem([["0.9"]], [["0.1"]]),
    "BIQUAD": FilterDesign(["0.1", "0.2", "0.1"], [1, "-1.2", "0.5"]),
    "STEP": gpbnb.NonlinearSystem(lambda fmt, x, u: (x + u / 8, x), [0]),
    "WITHIN": gpbnb.limits(measurement=0.001),
    "MIMO": ([[0.5, 0.1], [-0.2, 0.8]], [[1.0, 0.3], [0.2, -1.0]], [[1.0, 2.0], [0.5, -1.0]], [[0.1, 0], [0, 0.2]]),
    "TOML": FILES["m.toml"],
}


def stored():
    """For each function the calls, with what is stored of them."""
    found = {}
    for part in STORED.read_text(encoding="utf-8").split("\n\n"):
        head, *lines = part.strip("\n").splitlines()
        found[head.removeprefix("# ")] = list(zip(lines[::2], [each.strip() for each in lines[1::2]], strict=True))
    return found


@contextlib.contextmanager
def folder():
    """The files, in the current folder, in which nothing is computed or changed."""
    with tempfile.TemporaryDirectory() as path, contextlib.chdir(path), pytest.MonkeyPatch.context() as patch:
        for name, text in FILES.items():
            Path(name).write_text(text, encoding="utf-8")
        Path("folder").mkdir()
        os.symlink("z.csv", "linked.html")
        os.link("z.csv", "hard.html")
        patch.setattr(report, "study", mock.Mock(side_effect=AssertionError("something was computed")))
        yield
        assert not Path("code").exists()
        assert {name: Path(name).read_text(encoding="utf-8") for name in FILES} == FILES


def answer(call):
    try:
        eval(call, dict(NAMES))
    except Exception as error:
        return f"{type(error).__name__}: {error}".replace("\n", "\\n")
    return "accepted"


def agrees(found, message):
    """Of a message that ends in …, only what comes before it is compared; no call is stored as accepted."""
    if found == "accepted":
        return False
    return found.startswith(message[:-1]) if message.endswith("…") else found == message


@pytest.mark.parametrize("function", stored())
def test_a_call_is_refused_with_the_stored_message(function):
    with folder():
        for call, message in stored()[function]:
            found = answer(call)
            assert agrees(found, message), call


def renewed(calls):
    for call, message in calls:
        found = answer(call)
        yield f"{call}\n    {message if agrees(found, message) else found}"


if __name__ == "__main__":
    with folder():
        parts = ["\n".join([f"# {function}", *renewed(calls)]) for function, calls in stored().items()]
    STORED.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
