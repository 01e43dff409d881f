r"""One step of a linear filter as a list of rounded operations, in the order of the compiled kernels.

Covariance and gain of a Kalman filter do not depend on the measurements. Once they are known, the estimate needs only
products with known coefficients, sums and differences: a *linear program*. A filter given by its transfer function has
constant coefficients from the start, and each of its structures is another program. The same list of operations serves
several purposes, so that they cannot disagree:

* :mod:`gpbnb.filters.linear_steps` runs it in any format, digit for digit like the filter itself;
* :mod:`gpbnb.bounds.adversary` follows the effect of a rounding error in each operation on the result of the step;
* :func:`matrices` computes the linear function of (x, z) that the step approximates;
* :mod:`gpbnb.filters.words` runs it on integers, with formats of their own for coefficients, data and sums;
* :mod:`gpbnb.wordlength.code` prints it as C.

A step that also computes the covariance is not linear: it multiplies and divides values. :mod:`gpbnb.filters.listing`
lists its recorded operations with the same codes, and those of a step of your own, for C code.

The coefficients are arguments and not part of the program, because they may change from step to step. A product with a
zero coefficient is exact, and so is a sum with this product; the compiled kernels omit both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# fmt: off
(
    MULTIPLY, ADD, SUBTRACT, AT_LEAST, AT_MOST, PRODUCT, DIVIDE, CONSTANT, CHOOSE, LESS, EQUAL, MODULO, ROOT, FLOOR,
    CEILING, TRUNCATE, NEAREST,
) = range(17)
# fmt: on
"""Codes of operations. AT_LEAST and AT_MOST limit a value by a coefficient, as a controller limits its output. PRODUCT
and DIVIDE take two values, CONSTANT is a coefficient. CHOOSE is its first value if the guard of the operation is not
zero, else its second. LESS and EQUAL are one if they hold for two values, else zero. MODULO is the exact rest of a
division that truncates its quotient, ROOT a square root, and the last four are the nearest whole number below, above,
toward zero, and on either side, ties to even."""

_NAMES = (
    "arctan2", "hypot", "float_power", "exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "cbrt", "sin", "cos",
    "tan", "arcsin", "arccos", "arctan", "sinh", "cosh", "tanh", "arcsinh", "arccosh", "arctanh",
)  # fmt: skip
FUNCTIONS = {name: NEAREST + 1 + i for i, name in enumerate(_NAMES)}
"""Codes of functions that C has, by their names in NumPy; the first three take two values."""

LINEAR = (MULTIPLY, ADD, SUBTRACT)
"""Codes of operations that are linear functions of their values."""

_ON_TWO_VALUES = (ADD, SUBTRACT, PRODUCT, DIVIDE, CHOOSE, LESS, EQUAL, MODULO, *list(FUNCTIONS.values())[:3])

DIVISOR, POSITIVE, NOT_NEGATIVE, RADICAND, IN_RANGE = range(5)
"""Kinds of checks. A divisor of zero and a radicand below zero end a run; a value that should be positive, or not
negative, and is not, is the sign of a covariance that is no longer definite. IN_RANGE marks a value that nothing uses,
whose overflow ends the run nevertheless."""


NEVER_OVERFLOW = frozenset((AT_LEAST, AT_MOST, CONSTANT, CHOOSE, LESS, EQUAL, MODULO))
"""Codes of operations whose result is in range if their values are."""


def values_of(code: int, a: int, b: int) -> tuple[int, ...]:
    """Return the values among the two operands of an operation; the others are coefficients."""
    if code in _ON_TWO_VALUES:
        return a, b
    return () if code == CONSTANT else (b,)


class Operations(NamedTuple):
    """Operations of a step as the compiled loops of the bounds take them; fields of :class:`Program`."""

    operations: NDArray[np.int64]
    outputs: NDArray[np.int64]
    groups: NDArray[np.int64]
    roots: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Program:
    """Operations of one step.

    Values are numbered: the n states, the m inputs, then the result of each operation. After the operations of a step,
    state i takes the value ``outputs[i]``, all at once. Every state is stored in the format of the data.

    Parameters
    ----------
    n, m : number of states and of inputs.
    operations : (o, 3), code and two operands. MULTIPLY, AT_LEAST and AT_MOST take a coefficient and a value, CONSTANT
        a coefficient; ROOT and the codes after it take a value as second operand, or two values; all others take two.
    outputs : (n,), the values that become the states.
    coefficients : number of coefficients.
    groups : (o,), operations whose rounding errors have the same effect on the result share a number.
    roots : for each group, an operation in it.
    wide : (o,), whether a result stays in the accumulator, if the processor has one: a result that only sums and
        differences use, unless it is the output of a section. Any other result is stored in the format of the data,
        with one rounding.
    p : number of outputs of the system. The last p states hold them, and no operation reads these.
    state_names, coefficient_names : (n,) and (coefficients,), names for generated code.
    guards : (o,), for each operation a value that must not be zero for it to run, or -1; empty if all run always.
    checks : values and what they should be, such as :data:`POSITIVE`.
    """

    n: int
    m: int
    operations: NDArray[np.int64]
    outputs: NDArray[np.int64]
    coefficients: int
    groups: NDArray[np.int64]
    roots: NDArray[np.int64]
    wide: NDArray[np.bool_]
    p: int = 0
    state_names: tuple[str, ...] = ()
    coefficient_names: tuple[str, ...] = ()
    guards: tuple[int, ...] = ()
    checks: tuple[tuple[int, int], ...] = ()

    @property
    def compiled(self) -> Operations:
        """The operations as the compiled loops of the bounds take them."""
        return Operations(self.operations, self.outputs, self.groups, self.roots)

    @property
    def roundings(self) -> NDArray[np.int64]:
        """Number of operations that share each effect, (groups,)."""
        return np.bincount(self.groups, minlength=len(self.roots))

    @property
    def is_linear(self) -> bool:
        """Whether every operation is a linear function of its values."""
        return bool(np.isin(self.operations[:, 0], LINEAR).all())


class Builder:
    """Build a :class:`Program`, one operation at a time; values are plain ints."""

    def __init__(self, n: int, m: int) -> None:
        self.n, self.m = n, m
        self._operations: list[tuple[int, int, int]] = []
        self._guards: list[int] = []
        self._stored = set[int]()
        #: The value that must not be zero for the following operations to run; -1 for none.
        self.guard = -1
        #: Values and what they should be.
        self.checks: list[tuple[int, int]] = []

    @property
    def states(self) -> list[int]:
        return list(range(self.n))

    @property
    def inputs(self) -> list[int]:
        return list(range(self.n, self.n + self.m))

    def multiply(self, coefficient: int, value: int) -> int:
        return self._append(MULTIPLY, coefficient, value)

    def add(self, a: int, b: int) -> int:
        return self._append(ADD, a, b)

    def subtract(self, a: int, b: int) -> int:
        return self._append(SUBTRACT, a, b)

    def row(self, coefficients: Sequence[int], values: Sequence[int]) -> int:
        """Add a sum of products, from left to right; the first product is not added to zero."""
        total = self.multiply(coefficients[0], values[0])
        for c, v in zip(coefficients[1:], values[1:], strict=True):
            total = self.add(total, self.multiply(c, v))
        return total

    def product(self, matrix: NDArray[np.int64], values: Sequence[int]) -> list[int]:
        """Add the product of a matrix of coefficients and a column; see :meth:`row` for each entry."""
        return [self.row([int(c) for c in row], values) for row in matrix]

    def at_least(self, coefficient: int, value: int) -> int:
        return self._append(AT_LEAST, coefficient, value)

    def at_most(self, coefficient: int, value: int) -> int:
        return self._append(AT_MOST, coefficient, value)

    def append(self, code: int, a: int, b: int = 0) -> int:
        """Add an operation by its code."""
        return self._append(code, a, b)

    def listed(self) -> list[tuple[int, tuple[int, int, int], int]]:
        """Return the value, the code with its operands, and the guard of each operation."""
        values = range(self.n + self.m, self.n + self.m + len(self._operations))
        return list(zip(values, self._operations, self._guards, strict=True))

    def stored(self, value: int) -> int:
        """Store a value in the format of the data even if only sums use it."""
        self._stored.add(value)
        return value

    def finish(
        self,
        outputs: Sequence[int],
        coefficients: int,
        p: int = 0,
        state_names: Sequence[str] = (),
        coefficient_names: Sequence[str] = (),
    ) -> Program:
        operations = np.array(self._operations, dtype=np.int64).reshape(-1, 3)
        users = _users(operations, self.n + self.m)
        groups, roots = _grouped(operations, users, list(outputs), self.n + self.m)
        sums = [bool(used) and all(operations[o][0] in (ADD, SUBTRACT) for o in used) for used in users]
        stored = self._stored | set(outputs)
        wide = [each and self.n + self.m + o not in stored for o, each in enumerate(sums)]
        return Program(
            self.n,
            self.m,
            operations,
            np.array(outputs, dtype=np.int64),
            coefficients,
            np.array(groups, dtype=np.int64),
            np.array(roots, dtype=np.int64),
            np.array(wide, dtype=np.bool_),
            p,
            tuple(state_names),
            tuple(coefficient_names),
            tuple(self._guards) if max(self._guards, default=-1) >= 0 else (),
            tuple(self.checks),
        )

    def _append(self, code: int, a: int, b: int) -> int:
        self._operations.append((code, a, b))
        self._guards.append(self.guard)
        return self.n + self.m + len(self._operations) - 1


def _users(operations: NDArray[np.int64], first: int) -> list[list[int]]:
    """List the operations that use the result of each operation."""
    users: list[list[int]] = [[] for _ in operations]
    for o, (code, a, b) in enumerate(operations.tolist()):
        for value in values_of(code, a, b):
            if value >= first:
                users[value - first].append(o)
    return users


def _grouped(
    operations: NDArray[np.int64], users: list[list[int]], outputs: list[int], first: int
) -> tuple[list[int], list[int]]:
    """Number the effects: an operation used once, as a term of a sum, has the effect of that sum, up to its sign."""
    groups, roots = [-1] * len(operations), list[int]()
    for o in range(len(operations) - 1, -1, -1):
        used = users[o]
        if len(used) == 1 and operations[used[0]][0] in (ADD, SUBTRACT) and first + o not in outputs:
            groups[o] = groups[used[0]]
        else:
            groups[o] = len(roots)
            roots.append(o)
    return groups, roots


def coefficient_matrices(*shapes: tuple[int, int]) -> tuple[list[NDArray[np.int64]], int]:
    """Number the entries of some matrices consecutively; return their numbers and the total."""
    at, numbered = 0, list[NDArray[np.int64]]()
    for rows, columns in shapes:
        numbered.append(np.arange(at, at + rows * columns, dtype=np.int64).reshape(rows, columns))
        at += rows * columns
    return numbered, at


def loop_program(n: int, m: int) -> Program:
    r"""Program of Hung's form (1984), (111): :math:`\hat F x + \hat K z`; coefficients F (n, n), K (n, m)."""
    (F, K), count = coefficient_matrices((n, n), (n, m))
    build = Builder(n, m)
    u, v = build.product(F, build.states), build.product(K, build.inputs)
    return build.finish([build.add(a, b) for a, b in zip(u, v, strict=True)], count)


def innovation_program(n: int, m: int, p: int = 0) -> Program:
    r"""Innovation form, (98): :math:`u + \hat K(z - Hu)`, :math:`u = \Phi x`; coefficients Φ (n, n), H (m, n), K.

    The first p states are outputs as well.
    """
    (Phi, H, K), count = coefficient_matrices((n, n), (m, n), (n, m))
    build = Builder(n + p, m)
    u = build.product(Phi, build.states[:n])
    y = build.product(H, u)
    g = [build.subtract(z, a) for z, a in zip(build.inputs, y, strict=True)]
    v = build.product(K, g)
    x = [build.add(a, b) for a, b in zip(u, v, strict=True)]
    names = entries("Phi", n, n) + entries("H", m, n) + entries("K", n, m)
    return build.finish([*x, *x[:p]], count, p, [*entries("x", n), *entries("y", p)], names)


def entries(letter: str, *shape: int) -> list[str]:
    """Name the entries of a matrix as C does, from 0."""
    return [letter + "".join(f"[{i}]" for i in index) for index in np.ndindex(shape)]


def sequential_program(n: int, m: int) -> Program:
    """Program of the UD form, which decorrelates the measurements and takes them one by one.

    Coefficients Φ (n, n), the decorrelating factor U (m, m, its strict upper part), decorrelated H (m, n), and the gain
    of each measurement, K (n, m).
    """
    (Phi, U, H, K), count = coefficient_matrices((n, n), (m, m), (m, n), (n, m))
    build = Builder(n, m)
    x = build.product(Phi, build.states)
    seen = build.inputs
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            seen[i] = build.subtract(seen[i], build.multiply(int(U[i, k]), seen[k]))
    for i in range(m):
        y = seen[i]
        for j in range(n):
            y = build.subtract(y, build.multiply(int(H[i, j]), x[j]))
        x = [build.add(x[j], build.multiply(int(K[j, i]), y)) for j in range(n)]
    return build.finish(x, count)


def without_exact(program: Program, coefficients: NDArray[Any]) -> Program:
    """Leave out operations that are exact and change nothing: a product with zero or one, and a sum with zero.

    No digit changes. A value that nothing uses any more remains, and is noted as one that must stay in range: its
    overflow ends a run of the step.

    Parameters
    ----------
    coefficients : (p, c), exact stored coefficients of each step of a cycle.
    """
    return _Shortening(program, coefficients).finish()


class _Shortening:
    """A program whose values are replaced by others that equal them, where an operation changes nothing."""

    def __init__(self, program: Program, coefficients: NDArray[Any]) -> None:
        self.program, self.first = program, program.n + program.m
        self.zeros, self.ones = (np.all(coefficients == each, axis=0) for each in (0, 1))
        self.operations: list[tuple[int, int, int]] = program.operations.tolist()
        self.guards = list(program.guards or (-1,) * len(self.operations))
        self.same = list(range(self.first))
        for o in range(len(self.operations)):
            self._replace(o)

    def _constant(self, value: int, found: NDArray[np.bool_]) -> bool:
        if value < self.first:
            return False
        code, a, _ = self.operations[value - self.first]
        return code == CONSTANT and bool(found[a])

    def _replace(self, o: int) -> None:
        """Find the value that operation o equals, with operands already replaced."""
        code, a, b = self.operations[o]
        if len(values_of(code, a, b)) == 2:
            a = self.same[a]
        b = self.same[b] if code != CONSTANT else b
        guard = self.same[self.guards[o]] if self.guards[o] >= 0 else -1
        self.operations[o], self.guards[o] = (code, a, b), guard
        self.same.append(self._equal(self.first + o, code, a, b, guard))

    def _equal(self, itself: int, code: int, a: int, b: int, guard: int) -> int:
        def zero(value: int) -> bool:
            return self._constant(value, self.zeros)

        def one(value: int) -> bool:
            return self._constant(value, self.ones)

        if code == CHOOSE:
            return a if a == b or (zero(a) and zero(b)) else b if zero(guard) else itself
        if code == MULTIPLY and (self.zeros[a] or zero(b)):
            self.operations[itself - self.first] = (CONSTANT, a if self.zeros[a] else self._coefficient(b), 0)
            self.guards[itself - self.first] = -1
        elif code == MULTIPLY and self.ones[a]:
            return b
        elif code in (ADD, SUBTRACT) and zero(b):
            return a
        elif code == ADD and zero(a):
            return b
        elif code == PRODUCT and (zero(a) or one(b)):
            return a
        elif code == PRODUCT and (zero(b) or one(a)):
            return b
        elif code == DIVIDE and (zero(a) or one(b)):
            return a
        return itself

    def _coefficient(self, value: int) -> int:
        return self.operations[value - self.first][1]

    def _may_overflow(self, o: int) -> bool:
        runs = self.guards[o] < 0 or not self._constant(self.guards[o], self.zeros)
        return runs and self.same[self.first + o] == self.first + o and self.operations[o][0] not in NEVER_OVERFLOW

    def finish(self) -> Program:
        """Return the program; its states, inputs and coefficients keep their numbers."""
        program, first = self.program, self.first
        outputs = [self.same[each] for each in program.outputs.tolist()]
        checks = [(self.same[value], kind) for value, kind in program.checks]
        used = {*outputs, *(value for value, _ in checks)}
        for o in range(len(self.operations) - 1, -1, -1):
            if first + o not in used and self._may_overflow(o):
                checks.append((first + o, IN_RANGE))
                used.add(first + o)
            if first + o in used:
                used |= {*values_of(*self.operations[o])} | ({self.guards[o]} - {-1})
        kept = [o for o in range(len(self.operations)) if first + o in used]
        at = {value: value for value in range(first)} | {first + o: first + i for i, o in enumerate(kept)} | {-1: -1}
        operations = []
        for o in kept:
            code, a, b = self.operations[o]
            values = values_of(code, a, b)
            operations.append((code, at[a] if len(values) == 2 else a, at[b] if values else 0))
        guards = tuple(at[self.guards[o]] for o in kept)
        return replace(
            program,
            operations=np.array(operations, dtype=np.int64).reshape(-1, 3),
            outputs=np.array([at[each] for each in outputs], dtype=np.int64),
            guards=guards if max(guards, default=-1) >= 0 else (),
            checks=tuple((at[value], kind) for value, kind in dict.fromkeys(checks)),
            groups=program.groups[kept],
            wide=program.wide[kept],
        )


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
