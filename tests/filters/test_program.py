"""Programs without their exact operations give the results of the whole ones, and end where these end."""

from __future__ import annotations

import numpy as np
import pytest

from gpbnb import FloatFormat
from gpbnb.arithmetic.kernels.tags import CHOOSE, COMBINE, COMPARE
from gpbnb.arithmetic.machine import NAMES, Memory, code_of, evaluate, operands_of, tables
from gpbnb.arithmetic.tape import Tape
from gpbnb.filters.program import Program, flat, without_exact

GIVEN, KNOWN = 3, 7


def drawn(rng):
    """A random program of few operations, some of which run only if a truth value holds."""
    tape, numbers, truths = Tape(GIVEN + KNOWN), list(range(GIVEN + KNOWN + 1)), []

    def place(kind):
        return np.array(rng.choice(kind))

    def operate():
        name = rng.choice(["add", "subtract", "multiply", "divide", "compare", "combine", "choose", "negative"])
        if name == "compare":
            truths.append(int(tape.record(name, place(numbers), place(numbers), int(rng.integers(1, 7)))))
        elif name == "combine" and truths:
            truths.append(int(tape.record(name, place(truths), place(truths), int(rng.integers(16)))))
        elif name == "choose" and truths:
            numbers.append(int(tape.record(name, place(truths), place(numbers), place(numbers))))
        elif name == "negative":
            numbers.append(int(tape.record(name, place(numbers))))
        elif name not in ("combine", "choose"):
            numbers.append(int(tape.record(name, place(numbers), place(numbers))))

    for _ in range(12):
        operate()
        if truths and rng.random() < 0.3:
            a, b, truth = place(numbers), place(numbers), place(truths)
            changed = tape.only_if(truth, lambda a=a, b=b: tape.record(rng.choice(["add", "divide"]), a, b))
            numbers.append(int(tape.record("choose", truth, changed, a)))
    states = np.arange(1, 1 + GIVEN)
    return Program(
        tape, tape.instructions, tape.formats, [states], [], [np.arange(1 + GIVEN, 1 + GIVEN + KNOWN)],
        [np.array(numbers[-3:])], definite=(truths or [1])[-1],
    )  # fmt: skip


def run(program, x, c):
    kind, formats = tables([FloatFormat(2, 53, "even")])
    numbers, known = program.tape.sizes
    values, truths = np.zeros((numbers, 1)), np.zeros((known, 1), np.uint8)
    values[flat(program.states), 0], values[flat(program.coefficients), 0], truths[1] = x, c, 1
    rows = program.rows
    code = code_of(rows, np.zeros(len(rows), np.int64))
    done = evaluate(Memory(values, truths), kind, formats, code) if len(rows) else 0
    if done < len(rows):
        return "stops"
    return values[flat(program.after), 0].tolist(), bool(truths[program.definite, 0])


@pytest.mark.parametrize("seed", range(3))
def test_what_is_left_gives_the_results_of_the_whole(seed):
    rng, shorter, stops = np.random.default_rng(seed), 0, 0
    for _ in range(50):
        program, c = drawn(rng), rng.choice([0, 0, 1, 1, 2, -1, 0.5], KNOWN)
        short = without_exact(program, np.array([c]))
        for x in rng.choice([0, 1, -1, 2, 3], (4, GIVEN)):
            whole = run(program, x, c)
            assert run(short, x, c) == whole
            stops += whole == "stops"
        shorter += len(short.rows) < len(program.rows)
        used = {("number", place) for place in flat(short.after)} | {("truth", short.definite)}
        for code, *given, _ in short.rows.tolist():
            numbers, truths = operands_of(code, *given)
            used |= {("number", place) for place in numbers} | {("truth", place) for place in truths}
        for code, *_, out in short.rows.tolist():
            if code in (CHOOSE, COMPARE, COMBINE):
                assert ("number" if code == CHOOSE else "truth", out) in used, NAMES[code]
    assert shorter > 30
    assert stops > 10
