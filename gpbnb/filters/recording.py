"""A step of a linear filter as a program, recorded once from the step as it is written for arrays.

:mod:`gpbnb.filters.steps` takes arrays of any kind, also arrays that record their operations, see
:mod:`gpbnb.arithmetic.traced`. What does not depend on the measurements, the covariance and the gain, is a part of its
own, which runs once for all records and whose results may repeat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.algebra import Algebra
from gpbnb.arithmetic.machine import CODES, NAMES, OPERANDS, operands_of, packed_one, takes_numbers
from gpbnb.arithmetic.rounding import Order
from gpbnb.arithmetic.tape import MOST_OPERATIONS, Tape, UntraceableError
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.program import Program, entries, flat
from gpbnb.filters.stepping import DividedStep, divided, record_step
from gpbnb.filters.steps import BlockAlgebra, BlockStorage, LinearStep, StepTaken


@lru_cache(maxsize=64)
def system_step(program: Program, in_order: bool = False, whole: bool = False) -> DividedStep:
    """Return a step of a linear program; the cycle of its coefficients has one member.

    Independent operations of one code run together, which halves the time. With random rounding, `in_order` keeps the
    order of the program, since each operation draws the next random number. A stop names the number of the first output
    that needs the operation. With `whole`, the step also returns each of its values.
    """
    rows, tape, ends = program.rows, Tape(program.tape.inputs), flat(program.after)
    places = tuple(map(np.arange, program.tape.sizes))
    groups = [np.array([o]) for o in range(len(rows))] if in_order else _independent(program)
    computes = (rows[:, 4] == ends[:, None]) & (rows[:, 0] != CODES["compare"])
    computed_by = np.where(computes, np.arange(len(rows)), -1).max(axis=1, initial=-1)
    for group in groups:
        some, name = rows[group], NAMES[int(rows[group[0], 0])]
        given = [some[:, 1 + i] for i in range(3 if name in ("compare", "choose") else 2)]
        for mapped, masks in zip(places, OPERANDS, strict=True):
            given = [mapped[each] if masks[some[0, 0], i] else each for i, each in enumerate(given)]
        needing = np.argmax(computed_by >= group[:, None], axis=1).tolist()
        tape.labels += zip(range(len(tape.instructions), len(rows)), map(str, needing), strict=False)
        places[name == "compare"][some[:, 4]] = tape.record(name, *given)
    after, results = [places[0][ends]], [places[0][program.places]] * whole
    step = replace(
        program, tape=tape, rows=tape.instructions, formats=tape.formats, after=after, results=results, definite=1
    )
    return divided(step, together=True)


def _independent(program: Program) -> list[NDArray[np.int64]]:
    """Return rows of one code that do not need each other, in an order in which each follows those that it needs."""
    sizes, level = program.tape.sizes, list[int]()
    numbers, truths = [0] * sizes[0], [0] * sizes[1]
    for code, *given, out in program.rows.tolist():
        taken = zip((numbers, truths), operands_of(code, *given), strict=True)
        level.append(1 + max(levels[place] for levels, places in taken for place in places))
        (truths if code == CODES["compare"] else numbers)[out] = level[-1]
    keys = program.rows[:, 0], np.array(level, np.int64)
    order = np.lexsort(keys)
    edges = np.flatnonzero(np.any([np.diff(each[order]) != 0 for each in keys], axis=0))
    return [each for each in np.split(order, edges + 1) if len(each)]


class Known(NamedTuple):
    """A matrix of the model: its letter and shape, and which entries are 0 or 1 in every step, by the bytes 0 and 1."""

    letter: str
    shape: tuple[int, ...]
    entries: bytes


class StepKind(NamedTuple):
    """All that the operations of a step depend on."""

    form: Form
    n: int
    m: int
    model: tuple[Known, ...]
    one: bool = True  # whether every format has the number one
    blocks: tuple[int, ...] = (0, 0, 0, 0, 0)  # formats of state, gain, covariance, innovation covariance, model
    sums: tuple[Any, ...] = (False, "left", 32, -1)  # fused, order, block; the format of sums, or -1
    alike: bool = True  # whether a number that several formats have is stored alike in all of them


def step_kind(
    form: Form,
    model: dict[str, NDArray[Any]],
    fmt: Any,
    blocks: tuple[int, ...] = (0, 0, 0, 0, 0),
    sums: tuple[Any, ...] = (False, "left", 32, -1),
) -> StepKind:
    """Return the kind of the steps of a filter whose first format is `fmt`, None for double-double.

    Its matrices by their letters are packed, (p, rows, columns, ...) or (p, rows, ...).
    """
    one = packed_one(fmt)
    m, n = model["H"].shape[1:3]
    parts = model["H"].ndim - 3
    known = []
    for letter, table in model.items():
        zeros, ones = (table == 0, np.zeros(table.shape, np.bool_)) if one is None else (table == 0, table == one)
        if parts:
            zeros, ones = zeros[..., 0], ones.all(axis=-1)
        entries = np.where(zeros.all(axis=0), 0, np.where(ones.all(axis=0), 1, 2)).astype(np.uint8)
        if letter == "u":  # generated code takes known inputs of any size
            entries[:] = 2
        known.append(Known(letter, entries.shape, entries.tobytes()))
    return StepKind(form, n, m, tuple(known), one is not None, blocks, sums, not parts)


@lru_cache(maxsize=64)
def recorded_step(kind: StepKind, together: bool = False) -> DividedStep:
    """Return a step of a filter, divided into what depends on the measurements and what does not, unless together."""
    step = kalman_step(kind)
    return divided(replace(step, results=step.results[:1]), together)


def entries_taken(parts: DividedStep) -> list[NDArray[np.int64]]:
    """Return which entries of each matrix of the model the operations that depend on the measurements take."""
    rows = parts.rest.rows
    taken = rows[:, 1:4][takes_numbers(rows[:, 0])]
    return [np.flatnonzero(np.isin(at, taken)) for at in parts.step.coefficients]


def linear_program(parts: DividedStep, letters: Iterable[str]) -> Program:
    """Return the operations that depend on the measurements, whose matrices of the model are named by their letters.

    Its coefficients are the entries of the model that these operations use, the results of other operations that they
    use, and zero.
    """
    step, rest, shared = parts.step, parts.rest, parts.step.tape.sizes[0] + np.arange(len(parts.shared))
    names, taken = list[str](), list[NDArray[np.int64]]()
    for letter, at, each in zip(letters, step.coefficients, entries_taken(parts), strict=True):
        names += np.array(entries(letter, *at.shape))[each].tolist()
        taken.append(at.ravel()[each])
    gain = dict(zip(step.results[0].ravel().tolist(), entries("K", *step.results[0].shape), strict=True))
    names += [gain.get(each, f"c[{i}]") for i, each in enumerate(parts.shared.tolist())]
    given, n, m = flat([rest.states, *step.inputs, *taken, shared]), len(rest.states), step.inputs[0].size
    tape, place = Tape(1 + len(given)), np.zeros(step.tape.sizes[0] + len(shared), np.int64)
    place[given], zero = np.arange(1, 1 + len(given)), 1 + len(given)
    for code, a, b, _, out in rest.rows.tolist():
        place[out] = tape.record(NAMES[code], place[a], place[b])
    after = place[rest.after]
    for i in np.flatnonzero(after == 0):  # a state that becomes zero
        after[i] = tape.record("multiply", np.array(zero), 1 + i)
    states, inputs, coefficients = np.split(np.arange(1, 1 + zero), [n, n + m])
    return Program(
        tape,
        tape.instructions,
        tape.formats,
        [states],
        [inputs],
        [coefficients],
        [after],
        coefficient_names=(*names, "zero"),
    )


@lru_cache(maxsize=64)
def kalman_step(kind: StepKind) -> Program:
    """Record a step of a filter.

    Its states are x, P and, in the compensated form, the correction for the next step. Its results are the gain
    and, in forms without factors or roots, the innovation covariance.
    """
    n, m = kind.n, kind.m
    compensated = kind.form is Form.COMPENSATED
    shapes = [(n,), (n, n), *([(n,)] if compensated else []), (m,), *(each.shape for each in kind.model)]
    tape = Tape(sum(map(math.prod, shapes)), one=kind.one)
    tape.fuses, tape.alike, tape.most = True, kind.alike, 2 * MOST_OPERATIONS
    formats = [TracedFormat(tape, i) for i in range(max(*kind.blocks, kind.sums[-1]) + 1)]
    of_state, _, of_covariance, _, of_model = kind.blocks
    own = 3 if compensated else 2
    numbers = [of_state, of_covariance, *[of_state] * (own - 1), *[of_model] * len(kind.model)]
    try:
        arrays = list(zip(numbers, shapes, strict=True))
        step, _ = record_step(partial(_kalman_taken, kind), formats, arrays, (own, own + 1))
    except UntraceableError:
        raise ValueError(
            f"got a filter with n = {n} and m = {m}; needed a step of at most {tape.most} operations: about 100 states"
        ) from None
    driven = (at for known, at in zip(kind.model, step.coefficients, strict=True) if known.letter in "ubdB")
    return replace(step, late=[*step.states[::2], *driven])


def _kalman_taken(
    kind: StepKind, formats: Sequence[TracedFormat], states: tuple[Any, ...], given: Sequence[Any]
) -> StepTaken:
    """Take a step on arrays of places, in which the entries of the model that are known stand as constants."""
    (z, *model), tape, known = given, formats[0].tape, dict[str, Any]()
    for each, array in zip(kind.model, model, strict=True):
        exact = np.frombuffer(each.entries, np.uint8).reshape(each.shape)
        places = np.where((exact == 1) & (tape.one > 0), tape.one, array.components[0])
        known[each.letter] = array.format.made(np.where(exact == 0, 0, places))
    x, P, *carried = states
    if kind.form in (Form.UD, Form.CARLSON):
        P = P.format.made(np.triu(P.components[0]))
    fused, order, block, number = kind.sums
    sums = formats[number] if number >= 0 else None
    blocks = block_algebra([formats[i] for i in kind.blocks[:4]], fused, order, block, sums)
    return LinearStep(kind.form, blocks, known, tape.about).taken((x, P, *carried), z)


def filter_program(form: Form, step: Program, letters: Iterable[str], others: Sequence[int]) -> Program:
    """Return a recorded step of a filter as a program whose states are those of :func:`program_states`.

    There is a letter for each of its cycles, which are matrices and, if there are any, the known inputs u. Coefficients
    are the entries of the matrices in this order, then those at other places, and 1.
    """
    (x, P, *_), (z,), tape = step.states, step.inputs, step.tape
    matrices = dict(zip(letters, step.coefficients, strict=True))
    u = matrices.pop("u", np.zeros(0, np.int64))
    names = [each for letter, at in matrices.items() for each in entries(letter, *at.shape)]
    letter = "U" if form is Form.UD else "S" if form in ROOTS else "P"
    named = (np.array(entries(each, *at.shape)).reshape(1, *at.shape) for each, at in (("x", x), (letter, P)))
    ends = (each[None] for each in step.after[:2])
    return replace(
        step,
        states=[program_states(form, x[None], P[None])[0]],
        inputs=[z, u],
        coefficients=[*matrices.values(), np.array([*others, tape.one])],
        after=[program_states(form, *ends)[0]],
        state_names=tuple(program_states(form, *named)[0].tolist()),
        coefficient_names=(*names, *(f"c{i}" for i in range(len(others))), "one"),
        calls=tape.calls,
    )


def program_states(form: Form, x: Any, P: Any) -> Any:
    """Return estimates (k, n), then the entries of P, (k, n, n), that are not always zero, as states of a program."""
    n, upper = x.shape[1], form in (Form.UD, Form.CARLSON)
    kept = [n * i + j for i in range(n) for j in range(n) if not upper or i <= j]
    return np.concatenate([x, P.reshape(len(P), n * n)[:, kept]], axis=1)


def block_algebra(
    formats: Sequence[Any], fused: bool = False, order: Order = "left", block: int = 32, sums: Any = None
) -> BlockAlgebra:
    """Return how matrices of the formats of state, gain, covariance and innovation covariance are computed.

    Products are added as :func:`gpbnb.arithmetic.linalg.matmul` does, in the format `sums` until they are stored, by
    default that of the block.
    """
    state, gain, covariance, innovation = (_algebra(fmt, fused, order, block, sums) for fmt in formats)
    return BlockAlgebra(state, gain, covariance, innovation, BlockStorage(*(fmt.array for fmt in formats)))


def _algebra(fmt: Any, fused: bool, order: Order, block: int, sums: Any) -> Algebra:
    times: Callable[[Any, Any], Any] = partial(linalg.matmul, order=order, fused=fused, block=block)
    if sums is not None:

        def times(a: Any, b: Any) -> Any:
            return fmt.array(linalg.matmul(sums.array(a), sums.array(b), order, fused, block))

    return Algebra(fmt.eye, times)
