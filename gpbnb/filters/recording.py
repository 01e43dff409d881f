"""A step of a linear filter as a program, recorded once from the step as it is written for arrays.

:mod:`gpbnb.filters.steps` takes arrays of any kind, also arrays that record their operations, see
:mod:`gpbnb.arithmetic.traced`. What does not depend on the measurements, the covariance and the gain, stands in a
program of its own, which runs once for all records and whose results may repeat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic import linalg
from gpbnb.arithmetic.algebra import Algebra, inverse_in_order
from gpbnb.arithmetic.machine import packed_one
from gpbnb.arithmetic.rounding import Order
from gpbnb.arithmetic.tape import MOST_OPERATIONS, Tape, UntraceableError, laid_out
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.program import Program, entries
from gpbnb.filters.stepping import DividedStep, RecordedStep, divided, truth_of
from gpbnb.filters.steps import BlockAlgebra, BlockStorage, LinearStep, LinearTaken


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
    compensated: bool = False
    alike: bool = True  # whether a number that several formats have is stored alike in all of them


def step_kind(
    form: Form,
    model: dict[str, NDArray[Any]],
    fmt: Any,
    blocks: tuple[int, ...] = (0, 0, 0, 0, 0),
    sums: tuple[Any, ...] = (False, "left", 32, -1),
    compensated: bool = False,
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
        known.append(Known(letter, entries.shape, entries.tobytes()))
    return StepKind(form, n, m, tuple(known), one is not None, blocks, sums, compensated, not parts)


@lru_cache(maxsize=64)
def recorded_step(kind: StepKind, together: bool = False) -> DividedStep:
    """Return a step of a filter, divided into what depends on the measurements and what does not, unless together."""
    return divided(kalman_step(kind)[0], together)


@lru_cache(maxsize=64)
def kalman_step(kind: StepKind) -> tuple[RecordedStep, LinearTaken]:
    """Record a step of a filter, whose states are x and P, then what compensated summation carries; it gives K."""
    tape, places, found = whole_step(kind)
    states = ("x", "P", "carried") if kind.compensated or kind.form is Form.COMPENSATED else ("x", "P")
    late = [places[letter].ravel() for letter in (*states[::2], "u", "b", "d", "B") if letter in places]
    recorded = RecordedStep(
        tape,
        tape.instructions,
        tape.formats,
        [places[letter] for letter in states],
        [places["z"]],
        [places[known.letter] for known in kind.model],
        [getattr(found, letter).components[0] for letter in states],
        [found.K.components[0]],
        truth_of(found.definite),
        np.concatenate(late),
    )
    return recorded, found


def whole_step(kind: StepKind) -> tuple[Tape, dict[str, NDArray[np.int64]], LinearTaken]:
    """Record a step of a filter; return its tape, the places of what it takes, and what it gives."""
    n, m = kind.n, kind.m
    shapes = {"x": (n,), "P": (n, n), "carried": (n,), "z": (m,), **{each.letter: each.shape for each in kind.model}}
    places = dict(zip(shapes, laid_out(shapes.values()), strict=True))
    tape = Tape(sum(each.size for each in places.values()), one=kind.one)
    tape.fuses, tape.alike, tape.most = True, kind.alike, 2 * MOST_OPERATIONS
    formats = [TracedFormat(tape, i) for i in range(max(*kind.blocks, kind.sums[-1]) + 1)]
    state, gain, covariance, innovation, stored = (formats[i] for i in kind.blocks)
    given = dict[str, Any]()
    for known in kind.model:
        exact = np.frombuffer(known.entries, np.uint8).reshape(known.shape)
        seen = np.where(exact == 0, 0, np.where((exact == 1) & (tape.one > 0), tape.one, places[known.letter]))
        given[known.letter] = stored.made(seen)
    P = np.triu(places["P"]) if kind.form in (Form.UD, Form.CARLSON) else places["P"]
    x, z, carried = (state.made(places[letter]) for letter in ("x", "z", "carried"))
    fused, order, block, number = kind.sums
    sums = formats[number] if number >= 0 else None
    blocks = block_algebra((state, gain, covariance, innovation), fused, order, block, sums)
    step = LinearStep(kind.form, blocks, given, tape.about, kind.compensated)
    try:
        return tape, places, step.taken(x, covariance.made(P), carried, z)
    except UntraceableError:
        raise ValueError(
            f"got a filter with n = {n} and m = {m}; needed a step of at most {tape.most} operations: about 100 states"
        ) from None


def kalman_program(form: Form, shapes: dict[str, tuple[int, ...]]) -> Program:
    """Return a whole step of a Kalman filter, whose states are those of :func:`program_states`.

    Given are shapes of the matrices of the model by their letters, and of the known inputs u, which follow the
    measurements. Coefficients are the entries of the matrices in this order, then 1.
    """
    m, n = shapes["H"]
    unknown = (Known(letter, shape, bytes([2]) * math.prod(shape)) for letter, shape in shapes.items())
    tape, places, found = whole_step(StepKind(form, n, m, tuple(unknown)))
    del places["carried"]
    after = [found.x.components[0], found.P.components[0]]
    return filter_program(form, tape, places, [], after, truth_of(found.definite))


def filter_program(
    form: Form,
    tape: Tape,
    places: dict[str, NDArray[np.int64]],
    others: Sequence[int],
    after: Sequence[NDArray[np.int64]],
    definite: int,
) -> Program:
    """Return a recorded step of a filter as a program whose states are those of :func:`program_states`.

    Places are those of x, P and z, of the known inputs u if there are any, and of matrices by their letters; `after`
    those of x and P after the step. Coefficients are the entries of the matrices in this order, then those at other
    places, and 1.
    """
    x, P, z = (places[letter] for letter in "xPz")
    matrices = {letter: each for letter, each in places.items() if letter not in ("x", "P", "z", "u")}
    names = [each for letter, at in matrices.items() for each in entries(letter, *at.shape)]
    letter = "U" if form is Form.UD else "S" if form in ROOTS else "P"
    named = (np.array(entries(each, *at.shape)).reshape(1, *at.shape) for each, at in (("x", x), (letter, P)))
    ends = (each[None] for each in after)
    return Program(
        tape.instructions.astype(np.int64),
        tape.sizes,
        program_states(form, x[None], P[None])[0],
        np.concatenate([z, places.get("u", np.zeros(0, np.int64))]),
        np.array([*(at for each in matrices.values() for at in each.ravel().tolist()), *others, tape.one]),
        program_states(form, *ends)[0],
        0,
        tuple(program_states(form, *named)[0].tolist()),
        (*names, *(f"c{i}" for i in range(len(others))), "one"),
        calls=tape.calls,
        definite=definite,
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

    return Algebra(lambda n: fmt.array(np.eye(n, dtype=int)), times, inverse_in_order)
