"""A few steps of a Kalman filter without compiling its loops: the operations of one step are listed, and replayed.

Compiling the loops of :mod:`gpbnb.filters.kernels.step` for another arithmetic takes as long as many thousand steps.
:func:`gpbnb.arithmetic.kernels.replay.replay` compiles in a tenth of this time, for filters of all sizes and forms, and
takes the same operations. All digits are the same.
"""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import replay as codes
from gpbnb.arithmetic.kernels.replay import replay
from gpbnb.arithmetic.kernels.tags import (
    Binary,
    Decimal,
    DoubleDouble,
    Hardware32,
    Hardware64,
    Hexadecimal,
    Limited,
    LimitedDecimal,
    Random,
    Separate,
    ShortDecimal,
    Tag,
)
from gpbnb.filters.forms import Form
from gpbnb.filters.kernels.step import DONE, INDEFINITE, NEXT_CHECKPOINT, StepArrays
from gpbnb.filters.program import (
    ADD,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    DIVISOR,
    MULTIPLY,
    NOT_NEGATIVE,
    POSITIVE,
    PRODUCT,
    SUBTRACT,
)
from gpbnb.filters.tracing import traced_step

LONGEST = 20_000
"""Largest number of operations of a step that is listed, which takes a third of a second."""

_PER_STEP, _PER_OPERATION = 30e-6, 12e-9  # seconds
_CODES = {
    ADD: codes.ADD,
    SUBTRACT: codes.SUBTRACT,
    MULTIPLY: codes.MULTIPLY,
    PRODUCT: codes.MULTIPLY,
    DIVIDE: codes.DIVIDE,
}
_UNEQUAL = 0b101  # less or greater
_KINDS = (Binary, Hexadecimal, Decimal, ShortDecimal, DoubleDouble, LimitedDecimal, Hardware32, Hardware64)


class ReplayBudget:
    """The time that a process may replay in each kind of arithmetic, before it compiles the loops, or loads them.

    Parameters
    ----------
    before_compiling, before_loading : seconds, in arithmetic whose loops must be compiled, and only be loaded.
    """

    def __init__(self, before_compiling: float = 1.0, before_loading: float = 0.1) -> None:
        self._limits = {False: before_compiling, True: before_loading}
        self._compiled = dict[Any, bool]()
        self._spent = dict[Any, float]()
        self._closed = 0  # blocks that take every step in the compiled loops
        self._lock = threading.Lock()

    def allows(self, kind: Any, seconds: float, ready: Callable[[], bool]) -> bool:
        """Whether so many seconds are left, which are then spent; once they are not, none is left.

        Parameters
        ----------
        ready : whether the loops of this kind are compiled already; asked once.
        """
        if self._closed:
            return False
        if kind not in self._compiled:
            self._compiled[kind] = ready()
        with self._lock:
            spent = self._spent.get(kind, 0.0) + seconds
            enough = spent <= self._limits[self._compiled[kind]]
            self._spent[kind] = spent if enough else math.inf
        return enough

    @contextlib.contextmanager
    def closed(self) -> Iterator[None]:
        """Allow no replay within a ``with`` block, in any thread; time that is left is kept."""
        with self._lock:
            self._closed += 1
        try:
            yield
        finally:
            with self._lock:
                self._closed -= 1


BUDGET = ReplayBudget()


class _Listed(NamedTuple):
    """The operations of a step, and the places of its numbers: the first are x (n), entries of P or U, and z (m)."""

    #: (o, 5), as :func:`replay` takes them.
    instructions: NDArray[np.intc]
    #: number of places before the first result; of the first coefficient; of all places. The last two hold 0 and 1.
    first: int
    coefficients: int
    size: int
    #: number of truth values.
    truths: int
    #: which entries of P or U, row by row, a step takes.
    taken: NDArray[np.int64]
    #: places of the results.
    x: NDArray[np.int64]
    K: NDArray[np.int64]
    P: NDArray[np.int64]
    innovation: NDArray[np.int64]
    #: divisors, and numbers that should be positive, or not negative.
    divisors: NDArray[np.int64]
    positive: NDArray[np.int64]
    not_negative: NDArray[np.int64]


def replay_pays(
    tag: Tag, form: Form, model: StepArrays, z: NDArray[Any], x: NDArray[Any], ready: Callable[[], bool]
) -> bool:
    """Whether some steps cost less by :func:`advance_by_replay` than to compile or load the loops.

    From the first time that they cost more, they always do, because the loops are there.

    Parameters
    ----------
    z, x : measurements, as the loops take them, and the state.
    ready : whether the loops are compiled already; asked once for each kind of arithmetic.
    """
    kind, size = _kind(tag), 6 * (x.shape[0] + z.shape[1]) ** 3  # about the number of operations
    if kind is None or (kind is DoubleDouble and form is not Form.INNOVATION):
        return False
    if x.shape[1] != 1 or model.increment.shape[0] or size > LONGEST:
        return False
    loops = kind, form is Form.UD
    return BUDGET.allows(loops, len(z) * (_PER_STEP + size * _PER_OPERATION), ready)


def advance_by_replay(
    tag: Tag,
    form: Form,
    model: StepArrays,
    z: NDArray[Any],
    first: int,
    x: NDArray[Any],
    P: NDArray[Any],
    repeated: tuple[NDArray[Any], ...],
    kept: tuple[NDArray[Any], ...],
    notes: NDArray[np.int64],
) -> bool:
    """Take steps as :func:`gpbnb.filters.kernels.step.advance` or ``advance_ud`` does, and return True; or take none.

    It takes none if an operation has no result in the arithmetic; the loops then take the steps, and report where. In
    the UD form, it also takes none if a variance is not positive, because the loops look only at variances they use.

    Parameters
    ----------
    model : in the UD form, Q and R are their factors. P then holds those of the covariance.
    """
    n, m = x.shape[0], z.shape[1]
    listed = _listed(n, m, form, isinstance(tag, DoubleDouble))
    pair, end = x.shape[2:], len(listed.instructions)
    x0, P0, innovation = repeated
    checkpoint_steps, X, G, C = kept
    state, covariance, after = x[:, 0].copy(), P.reshape(n * n, *pair).copy(), notes.copy()
    values, truths = np.zeros((listed.size, *pair), x.dtype), np.zeros(max(listed.truths, 2), np.uint8)
    values[-1] = model.identity[0, 0]
    for k in range(len(z)):
        if len(x0):
            state, covariance = x0[k, :, 0], P0[k].reshape(n * n, *pair)
        given = [each[(first + k) % len(each)] for each in (model.Phi, model.H, model.Q, model.R)]
        parts = [matrix.reshape(-1, *pair) for matrix in given]
        values[: listed.first] = np.concatenate([state, covariance[listed.taken], z[k, :, 0]])
        values[listed.coefficients : -2] = np.concatenate(parts)
        try:
            if replay(tag, listed.instructions, 0, end, values, truths) < end:
                return False
        except OverflowError:
            return False
        signs = values if values.ndim == 1 else values[:, 0]  # the first part of a number has its sign
        if np.any(signs[listed.divisors] == 0):
            return False
        indefinite = np.any(signs[listed.positive] <= 0) or np.any(signs[listed.not_negative] < 0)
        if indefinite and form is Form.UD:
            return False
        state, covariance = values[listed.x], values[listed.P]
        after[DONE] = first + k + 1
        if indefinite and not after[INDEFINITE]:
            after[INDEFINITE] = first + k + 1
        if len(x0):
            innovation[k] = values[listed.innovation]
        at = after[NEXT_CHECKPOINT]
        if at < len(checkpoint_steps) and checkpoint_steps[at] == first + k + 1:
            X[at, :, 0], G[at], C[at] = state, values[listed.K], covariance.reshape(P.shape)
            after[NEXT_CHECKPOINT] += 1
    x[:, 0], P[:], notes[:] = state, covariance.reshape(P.shape), after
    return True


def only_compiled() -> contextlib.AbstractContextManager[None]:
    """Take every step in the compiled loops within a ``with`` block."""
    return BUDGET.closed()


def _kind(tag: Any) -> Any:
    """Return what the loops are compiled for, or None if a step of this arithmetic is not a list of operations."""
    if isinstance(tag, Limited):
        listed = isinstance(tag.sums, Separate) and not isinstance(tag.mode, Random)
        return (type(tag.digits), type(tag.mode)) if listed else None
    return type(tag) if isinstance(tag, _KINDS) else None


@lru_cache(maxsize=32)
def _listed(n: int, m: int, form: Form, pairs: bool) -> _Listed:
    """List the operations of a step.

    Parameters
    ----------
    pairs : whether numbers are pairs of float64, whose products depend on the order of factors in their last digit.
    """
    step = traced_step(n, m, form)
    trace = step.trace
    x, K, P, S = (
        np.array([trace.loaded(each) for each in np.ravel(matrix)], dtype=np.int64).reshape(np.shape(matrix))
        for matrix in (step.x, step.K, step.P, step.innovation)
    )
    operations = trace.build.listed()
    first, coefficients = operations[0][0], operations[-1][0] + 1
    at = np.arange(coefficients)  # the place of each value; a loaded coefficient has its own
    turned = _of_gain(operations, K) if pairs else set()
    size, rows, truths = coefficients + len(step.coefficients), list[tuple[int, ...]](), dict[int, int]()
    for value, (code, a, b), guard in operations:
        if code == CONSTANT:
            at[value] = coefficients + a
            continue
        if code == CHOOSE:
            if guard not in truths:
                truths[guard] = len(truths)
                rows.append((codes.COMPARE, at[guard], size - 2, _UNEQUAL, truths[guard]))
            rows.append((codes.CHOOSE, truths[guard], at[a], at[b], value))
            continue
        left, right = coefficients + a if code == MULTIPLY else at[a], at[b]
        rows.append((_CODES[code], *((right, left) if value in turned else (left, right)), 0, value))
    instructions = np.array(rows, dtype=np.intc)
    instructions.flags.writeable = False  # as those of a tape, so that the loop is compiled once for both
    checks = (
        at[[value for value, kind in trace.build.checks if kind == wanted]]
        for wanted in (DIVISOR, POSITIVE, NOT_NEGATIVE)
    )
    taken = np.array([i * n + j for i, j in step.places])
    layout = first, coefficients, size, len(truths), taken
    return _Listed(instructions, *layout, at[x], at[K], at[P.ravel()], at[S], *checks)


def _of_gain(operations: Sequence[tuple[int, tuple[int, int, int], int]], K: NDArray[np.int64]) -> set[int]:
    """Return the products that the gain sums up, whose factors the compiled loops take in the other order."""
    codes_of = {value: operation for value, operation, _ in operations}
    waiting, found = K.ravel().tolist(), set[int]()
    while waiting:
        value = waiting.pop()
        code, a, b = codes_of[value]
        if code == ADD:
            waiting += [a, b]
        elif code == PRODUCT:
            found.add(value)
    return found
