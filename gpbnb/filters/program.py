r"""One step of a filter as a program: rounded operations in the order in which they run.

A step is written for arrays of any kind, as in :mod:`gpbnb.filters.steps` and :mod:`gpbnb.filters.structures`, and
recorded once. All of these use the same rows, so they cannot disagree:

* :mod:`gpbnb.filters.recording` brings them on the machine, which runs them in any format;
* :mod:`gpbnb.bounds` follows the effect of a rounding error in each operation on the result of the step;
* :func:`matrices` computes the linear function of (x, z) that the step approximates;
* :mod:`gpbnb.filters.words` runs them on integers, with formats of their own for coefficients, data and sums;
* :mod:`gpbnb.wordlength.code` prints them as C.

Covariance and gain of a Kalman filter do not depend on the measurements. Once they are known, the estimate needs only
products with known coefficients, sums and differences: a *linear program*. A filter given by its transfer function has
constant coefficients from the start, and each of its structures is another program.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import algebra_of
from gpbnb.arithmetic.interpreting import Call
from gpbnb.arithmetic.kernels import tags
from gpbnb.arithmetic.machine import CODES, NAMES, OPERANDS, operands_of
from gpbnb.arithmetic.tape import Places, Tape, exact_result, known_truth
from gpbnb.arithmetic.traced import TracedFormat
from gpbnb.filters.steps import corrected

MULTIPLY, ADD, SUBTRACT, AT_LEAST, AT_MOST = tags.MULTIPLY, tags.ADD, tags.SUBTRACT, tags.AT_LEAST, tags.AT_MOST
"""Codes of operations of a linear program; AT_LEAST and AT_MOST limit a value by a coefficient, as a controller limits
its output."""

LINEAR = (MULTIPLY, ADD, SUBTRACT)
"""Codes of operations that are linear functions of their values."""

_LIMITS = {1: AT_MOST, 4: AT_LEAST}
"""The limit that a choice makes, by the order in which its comparison of value and limit holds."""


@dataclass(frozen=True, eq=False)
class Program:
    """Operations of one step, with the places of its arguments and results.

    Parameters
    ----------
    tape : the tape on which they were recorded. Its labels belong to the rows of the tape, not to other rows.
    rows : (o, 5), operations of the machine: a code, three operands, and the place of the result.
    formats : (o,), number of the format of each operation.
    states : places of the arrays of states; -1 for a state that no operation reads.
    inputs : places of the arrays of inputs, such as measurements.
    coefficients : places of the arrays of the model, each with a cycle of its own.
    after : places of the next states; the last p of them are outputs.
    results : places of the other arrays that a step returns.
    definite : the truth value that holds while a covariance is definite.
    late : places of states that are known to depend on the inputs, and of coefficients whose cycle is too long to wait
        until they repeat, such as known inputs.
    p : number of outputs of the system.
    state_names, coefficient_names : for generated code.
    stored : places of results stored even if only sums use them, outputs of sections.
    calls : of functions between operations.
    """

    tape: Tape
    rows: NDArray[Any]
    formats: NDArray[np.int64]
    states: Sequence[Places]
    inputs: Sequence[Places]
    coefficients: Sequence[Places]
    after: Sequence[Places]
    results: Sequence[Places] = ()
    definite: int = 1
    late: Sequence[Places] = ()
    p: int = 0
    state_names: tuple[str, ...] = ()
    coefficient_names: tuple[str, ...] = ()
    stored: frozenset[int] = frozenset()
    calls: Sequence[Call] = ()

    @property
    def n(self) -> int:
        """Number of states, with the outputs."""
        return sum(each.size for each in self.states)

    @property
    def m(self) -> int:
        """Number of inputs."""
        return sum(each.size for each in self.inputs)

    def quantity(self, row: int) -> str:
        """Name what an operation computes."""
        found = ""
        for begin, name in self.tape.labels:
            if begin <= row:
                found = name
        return found

    # -- a linear program -----------------------------------------------------------------------------------
    # Its values are numbered: the n states, the m inputs, then the result of each operation.

    @cached_property
    def places(self) -> NDArray[np.int64]:
        """The place of each value."""
        results = self.rows[self.rows[:, 0] != CODES["compare"], 4]
        return flat([*self.states, *self.inputs, results])

    @cached_property
    def _values(self) -> NDArray[np.int64]:
        """The number of the value at each place; -1 for a coefficient."""
        found = np.full(self.tape.sizes[0], -1)
        found[self.places] = np.arange(len(self.places))
        return found

    @cached_property
    def operations(self) -> NDArray[np.int64]:
        """Code and two operands of each operation, (o, 3); ValueError if one is neither linear nor a limit.

        MULTIPLY, AT_LEAST and AT_MOST take a coefficient and a value, ADD and SUBTRACT two values.
        """
        number, coefficients = np.full(self.tape.sizes[0], -1), flat(self.coefficients)
        number[coefficients] = np.arange(len(coefficients))
        value, found, compared = self._values, list[tuple[int, int, int]](), dict[int, tuple[int, int, int]]()
        for code, a, b, c, out in self.rows.tolist():
            name = NAMES[code]
            if name == "compare":
                compared[out] = a, b, c
            elif name == "multiply" and number[a] >= 0 and value[b] >= 0:
                found.append((MULTIPLY, number[a], value[b]))
            elif name in ("add", "subtract") and min(value[a], value[b]) >= 0:
                found.append((ADD if name == "add" else SUBTRACT, value[a], value[b]))
            elif name == "choose" and compared[a] in ((b, c, 1), (b, c, 4)) and number[c] >= 0:
                found.append((_LIMITS[compared[a][2]], number[c], value[b]))
            else:
                raise ValueError(f"got a step with {name}; needed sums, products with coefficients, and limits")
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    @cached_property
    def outputs(self) -> NDArray[np.int64]:
        """The values that become the states, all at once, (n,)."""
        return self._values[flat(self.after)]

    @cached_property
    def _users(self) -> list[list[int]]:
        """The operations that use the result of each operation."""
        first, users = self.n + self.m, [list[int]() for _ in self.operations]
        for o, (code, a, b) in enumerate(self.operations.tolist()):
            for value in values_of(code, a, b):
                if value >= first:
                    users[value - first].append(o)
        return users

    @cached_property
    def _effects(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Numbers of effects; an operation used once, as a term of a sum, has that of the sum, up to its sign."""
        users, outputs, first = self._users, set(self.outputs.tolist()), self.n + self.m
        groups, roots = [-1] * len(users), list[int]()
        for o in range(len(users) - 1, -1, -1):
            used = users[o]
            if len(used) == 1 and self.operations[used[0], 0] in (ADD, SUBTRACT) and first + o not in outputs:
                groups[o] = groups[used[0]]
            else:
                groups[o] = len(roots)
                roots.append(o)
        return np.array(groups, dtype=np.int64), np.array(roots, dtype=np.int64)

    @property
    def groups(self) -> NDArray[np.int64]:
        """Operations whose rounding errors have the same effect on the result share a number, (o,)."""
        return self._effects[0]

    @property
    def roots(self) -> NDArray[np.int64]:
        """For each group, an operation in it."""
        return self._effects[1]

    @cached_property
    def wide(self) -> NDArray[np.bool_]:
        """Whether a result stays in the accumulator, if the processor has one, (o,).

        That is a result that only sums and differences use, unless it is the output of a section. Any other result is
        stored in the format of the data, with one rounding.
        """
        sums = [bool(used) and all(self.operations[o, 0] in (ADD, SUBTRACT) for o in used) for used in self._users]
        kept = {*self.outputs.tolist(), *self._values[list(self.stored)].tolist()}
        first = self.n + self.m
        return np.array([each and first + o not in kept for o, each in enumerate(sums)], dtype=np.bool_)

    @property
    def is_linear(self) -> bool:
        """Whether every operation is a linear function of its values."""
        return bool(np.isin(self.operations[:, 0], LINEAR).all())


def flat(places: Sequence[Places]) -> NDArray[np.int64]:
    """Return the places of some arrays, one after the other."""
    return np.concatenate([np.zeros(0, np.int64), *(each.ravel() for each in places)])


def values_of(code: int, a: int, b: int) -> tuple[int, ...]:
    """Return the values among the two operands of an operation of a linear program; the others are coefficients."""
    return (a, b) if code in (ADD, SUBTRACT) else (b,)


Step = Callable[[Any, Any, Any], Sequence[Any]]
"""A function of the coefficients (c,), states (n,) and inputs (m,) of a step that returns the next states."""


def recorded(
    step: Step,
    n: int,
    m: int,
    coefficients: int,
    p: int = 0,
    state_names: Sequence[str] = (),
    coefficient_names: Sequence[str] = (),
    stored: Sequence[Any] = (),
) -> Program:
    """Record a step of a filter with n states, m inputs, and a number of coefficients.

    Results that are `stored`, even if only sums use them, may be added to that list by the step.
    """
    tape = Tape(n + m + coefficients)
    x, u, c = np.split(np.arange(1, 1 + tape.inputs), [n, n + m])
    after = step(*map(TracedFormat(tape).made, (c, x, u)))
    return Program(
        tape,
        tape.instructions,
        tape.formats,
        [x],
        [u],
        [c],
        [np.array([_place(each) for each in after], dtype=np.int64)],
        p=p,
        state_names=tuple(state_names),
        coefficient_names=tuple(coefficient_names),
        stored=frozenset(map(_place, stored)),
    )


def _place(number: Any) -> int:
    return int(number.components[0])


def matrices_of(c: Any, *shapes: tuple[int, int]) -> list[Any]:
    """Return consecutive coefficients as matrices."""
    ends = np.cumsum([rows * columns for rows, columns in shapes])
    parts = zip(ends, shapes, strict=True)
    return [c[end - rows * columns : end].reshape(rows, columns) for end, (rows, columns) in parts]


def dot(coefficients: Any, values: Any) -> Any:
    """Return a sum of products, from left to right; the first product is not added to zero."""
    total = coefficients[0] * values[0]
    for c, v in zip(coefficients[1:], values[1:], strict=True):
        total = total + c * v
    return total


def innovation_program(n: int, m: int, p: int = 0) -> Program:
    r"""Innovation form, (98): :math:`u + \hat K(z - Hu)`, :math:`u = \Phi x`; coefficients Φ (n, n), H (m, n), K.

    The first p states are outputs as well.
    """

    def step(c: Any, x: Any, z: Any) -> list[Any]:
        Phi, H, K = matrices_of(c, (n, n), (m, n), (n, m))
        after = corrected(algebra_of(c.format), H, K, Phi @ x[:n], z)
        return [*after, *after[:p]]

    names = entries("Phi", n, n) + entries("H", m, n) + entries("K", n, m)
    return recorded(step, n + p, m, n * (n + 2 * m), p, [*entries("x", n), *entries("y", p)], names)


def entries(letter: str, *shape: int) -> list[str]:
    """Name the entries of a matrix as C does, from 0."""
    return [letter + "".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]


def without_exact(program: Program, coefficients: NDArray[Any]) -> Program:
    """Leave out operations that are exact and change nothing: a product with zero or one, and a sum with zero.

    The exact stored coefficients are (p, c), for each step of a cycle. No digit changes. Place 0 is the number zero. A
    result that nothing uses any more remains if it may leave the range, since its overflow ends a run of the step.
    """
    zeros, ones = (flat(program.coefficients)[np.all(coefficients == each, axis=0)] for each in (0, 1))
    one = int(ones[0]) if len(ones) else -1
    same, truth = map(np.arange, program.tape.sizes)
    same[zeros], same[ones] = 0, one
    rows = program.rows.copy()
    kept, o = np.ones(len(rows), np.bool_), 0
    while o < len(rows):
        name, out = NAMES[int(rows[o, 0])], rows[o, 4]
        for places, masks in zip((same, truth), OPERANDS, strict=True):
            at = 1 + np.flatnonzero(masks[rows[o, 0]])
            rows[o, at] = places[rows[o, at]]
        a, b, c = rows[o, 1:4].tolist()
        if name == "skip" and a < 2:
            last = o + (0 if a else b)
            kept[o : last + 1] = False
            o = last
        elif name in ("compare", "combine"):
            known = int(known_truth(name, rows[o, 1:2], rows[o, 2:3], c)[0])
            if known >= 0:
                truth[out], kept[o] = known, False
        elif name == "choose" and (a < 2 or b == c):
            same[out], kept[o] = (b if a else c), False
        elif (found := exact_result(name, a, b, one)) >= 0:
            same[out], kept[o] = found, False
            if name == "divide" and a == 0:
                rows[o], kept[o] = (CODES["nonzero"], b, 0, 0, 0), True
        o += 1
    calls = [each._replace(operands=[same[places] for places in each.operands]) for each in program.calls]
    after, definite = [same[each] for each in program.after], int(truth[program.definite])
    used = flat([*after, *(places for each in calls for places in each.operands)])
    kept = _needed(rows, kept, used, definite, program.tape.sizes)
    before = np.concatenate([[0], np.cumsum(kept)])
    skips = np.flatnonzero(rows[:, 0] == CODES["skip"])
    rows[skips, 2] = before[skips + 1 + rows[skips, 2]] - before[skips + 1]
    calls = [each._replace(at=int(before[each.at])) for each in calls]
    return replace(program, rows=rows[kept], formats=program.formats[kept], after=after, definite=definite, calls=calls)


def _needed(rows: Any, kept: Any, used: Any, definite: int, sizes: tuple[int, int]) -> NDArray[np.bool_]:
    """Return which operations remain without those that choose or compare and whose result nothing uses."""
    numbers, truths = (np.zeros(size, np.bool_) for size in sizes)
    numbers[used], truths[definite] = True, True
    kept = kept.copy()
    for o in np.flatnonzero(kept)[::-1].tolist():
        code, *given, out = rows[o].tolist()
        chosen = _CHOICES.get(NAMES[code])
        kept[o] = chosen is None or (numbers, truths)[chosen][out]
        if kept[o]:
            for marks, places in zip((numbers, truths), operands_of(code, *given), strict=True):
                marks[places] = True
    return kept


_CHOICES = {"choose": 0, "compare": 1, "combine": 1}
"""Operations whose result is in range if their operands are, and whether it is a truth value."""


# -- linear functions -------------------------------------------------------------------------------------------------


def exact_functionals(program: Program, coefficients: Sequence[Any] | NDArray[Any]) -> list[dict[int, Fraction]]:
    """Return the exact linear function of (x, z) that each value approximates, as its nonzero coefficients.

    A value with limits is treated as if it stayed within them.
    """
    rows = [{i: Fraction(1)} for i in range(program.n + program.m)]
    for code, a, b in program.operations.tolist():
        if code == MULTIPLY:
            factor = coefficients[a]
            rows.append({j: factor * c for j, c in rows[b].items()} if factor else {})
        elif code in (ADD, SUBTRACT):
            row = dict(rows[a])
            for j, c in rows[b].items():
                total = row.get(j, 0) + (c if code == ADD else -c)
                if total:
                    row[j] = total
                else:
                    del row[j]  # it was the opposite
            rows.append(row)
        else:
            rows.append(rows[b])
    return rows


def matrices(program: Program, coefficients: Sequence[Any] | NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the exact A, (n, n), and B, (n, m), of a step; see :func:`exact_functionals`."""
    rows = exact_functionals(program, coefficients)
    whole = np.full((program.n, program.n + program.m), Fraction(0), dtype=object)
    for i, value in enumerate(program.outputs.tolist()):
        for j, c in rows[value].items():
            whole[i, j] = c
    return whole[:, : program.n], whole[:, program.n :]
