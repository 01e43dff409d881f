"""An option that would change nothing is refused, and a count has a limit before a loop begins."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import (
    BINARY32,
    LinearModel,
    LinearSystem,
    NonlinearModel,
    NonlinearSystem,
    emulate,
    guarantee,
    limit_cycles,
    limits,
    required_precision,
    survey_records,
    write_code,
)

FILTER = LinearModel([[1]], [[1]], [["0.01"]], [[1]], [0], [[1]])
SYSTEM = LinearSystem([["0.9"]], [["0.1"]])
STEP = NonlinearSystem(lambda fmt, x, u: (x + u / 8, x), [0])
Z, WITHIN = np.ones(9), limits(measurement=1)
ONE = [[1]], [[1]], [0], [[1]]
CALLS = {
    "a seed beside measurements": (lambda _: emulate(FILTER, Z, "float32", seed=1), "got seed 1"),
    "a seed of a system": (lambda _: required_precision(SYSTEM, Z, 0.1, seed=1), "got seed 1"),
    "highest in words": (lambda _: required_precision(SYSTEM, Z, 0.1, kind="words", highest=9), "got highest=9"),
    "highest of blocks": (lambda _: required_precision(FILTER, Z, 0.1, kind="blocks", highest=9), "got highest=9"),
    "limits of blocks": (lambda _: required_precision(FILTER, Z, 0.1, kind="blocks", within=WITHIN), "got limits and"),
    "most of a system": (lambda _: guarantee(SYSTEM, "float32", WITHIN, most=5), "got most=5"),
    "a block of a tree": (lambda _: LinearSystem.sum(9, "tree", 4), "got block 4"),
    "sigma points": (lambda _: NonlinearModel(abs, None, abs, None, *ONE, points=(1, 2, 1)), "got points"),
    "limits of a step": (lambda folder: write_code(STEP, "float32", folder, within=WITHIN), "got limits"),
    "a number of test vectors": (lambda folder: write_code(SYSTEM, "float32", folder, inputs=9), "got inputs 9"),
    "steps to settle": (lambda _: guarantee(FILTER, "float32", WITHIN, most=10**12), "at most 1,000,000"),
    "states of cycles": (lambda _: limit_cycles(SYSTEM, "Q3.4", most=10**12), "at most 268,435,456"),
    "an input of cycles": (lambda _: limit_cycles(SYSTEM, "Q3.4", [1, 2]), "got an input of shape"),
    "decimals": (lambda _: np.round(BINARY32.array([3]), 10**9), "at most 100,000"),
    "steps of records": (lambda _: survey_records(FILTER, 10**6, 0.1, ["float32"], steps=101), "at most 100"),
}


@pytest.mark.parametrize("call", CALLS)
def test_it_is_refused(call, tmp_path):
    ask, message = CALLS[call]
    with pytest.raises(ValueError, match=message):
        ask(tmp_path)
