"""Compiled loops run in slices, between which Ctrl-C acts; no slice changes a digit."""

from __future__ import annotations

import signal

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    FixedFormat,
    FloatFormat,
    LinearModel,
    LinearSystem,
    WordFormats,
    emulate,
    limit_cycles,
    linalg,
)
from gpbnb.interrupts import interruptible

FORMATS = [BINARY32, FloatFormat(2, 20, "chop"), FloatFormat(10, 12, "up"), FloatFormat(10, 25)]
SYSTEM = LinearSystem.from_coefficients(["0.2", "0.1"], [1, "-0.6", "0.25"])
RNG = np.random.default_rng(4)
A, B = RNG.uniform(1, 2, (7, 7)) + 9 * np.eye(7), RNG.uniform(1, 2, (7, 5))
ARRAYS = [
    lambda a, b: a * a[0] / a,
    lambda a, b: np.sum(b),
    lambda a, b: np.sum(b, axis=0),
    lambda a, b: np.cumsum(b, axis=0),
    lambda a, b: a @ b,
    lambda a, b: (a > a.T).astype(int),
    lambda a, b: a.format.array(FloatFormat(10, 9).array(b)),
    lambda a, b: linalg.solve(a, b, pivot=True),
]


@pytest.mark.parametrize("fmt", FORMATS, ids=str)
def test_an_array_in_slices_has_the_same_digits(fmt, monkeypatch):
    a, b = fmt.array(A), fmt.array(B)
    whole = [operate(a, b).tolist() for operate in ARRAYS]
    monkeypatch.setattr("gpbnb.interrupts.SLICE", 11)
    assert [operate(a, b).tolist() for operate in ARRAYS] == whole


@pytest.mark.parametrize("fmt", [BINARY32, FloatFormat(2, 20), FloatFormat(10, 7), "Q3.20"], ids=str)
def test_a_run_in_slices_has_the_same_digits(fmt, monkeypatch):
    z = np.concatenate([RNG.uniform(-1, 1, 9), np.zeros(1200)])  # decays beyond the range of float64
    model = LinearModel([["0.5"]], [["1"]], [["0.01"]], [["1"]], ["0"], [["1"]])
    whole = [emulate(each, z, fmt) for each in (SYSTEM, model)]
    monkeypatch.setattr("gpbnb.interrupts.SLICE", 100)
    for each, run in zip((SYSTEM, model), whole, strict=True):
        found = emulate(each, z, fmt)
        assert found.steps == len(z)
        assert found.x.tolist() == run.x.tolist()


def test_limit_cycles_in_slices_are_the_same(monkeypatch):
    words = WordFormats(FixedFormat(2, 5), 8)
    whole = limit_cycles(SYSTEM, words)
    monkeypatch.setattr("gpbnb.interrupts.SLICE", 100)
    found = limit_cycles(SYSTEM, words)
    assert [each.outputs.tolist() for each in found.cycles] == [each.outputs.tolist() for each in whole.cycles]


def test_an_interrupt_acts_before_a_long_product_ends(monkeypatch):
    calls = []

    def interrupted(kind, formats, room, a, b, c, begin, end, count, columns):
        calls.append(end - begin)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr("gpbnb.arithmetic.kernels.matrices.product", interrupted)
    x = FloatFormat(10, 12).array(np.ones((3000, 40)))
    # A shell ignores the signal for what runs in its background.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            x @ np.ones((40, 1000))
    finally:
        signal.signal(signal.SIGINT, before)
    assert calls == [(1 << 22) // 40_000]


def test_an_interrupted_command_says_so_in_one_line_with_the_status_of_shells(capsys):
    def run():
        raise KeyboardInterrupt

    assert interruptible("python -m gpbnb.wordlength", run) == 130
    assert capsys.readouterr().err == "python -m gpbnb.wordlength: interrupted\n"
