r"""One step of a linear filter as a list of rounded operations, in the order of the compiled kernels.

Covariance and gain of a Kalman filter do not depend on the measurements. Once they are known, the estimate needs only
products with known coefficients, sums and differences: a *linear program*. The same list of operations serves
three purposes, so that they cannot disagree:

* :func:`execute` runs it in any format, digit for digit like the filter itself;
* :func:`functionals` computes the exact linear function of (x, z) that each intermediate value approximates;
* :func:`effects` computes the effect of a rounding error in each operation on the result of the step.

The coefficients are arguments and not part of the program, because they change from step to step. A product with a zero
coefficient is exact, and so is a sum with this product; the compiled kernels omit both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.kernels import doubledouble
from gpbnb.arithmetic.kernels.compiling import compiled, inner
from gpbnb.arithmetic.kernels.scalar import add, load, multiply, put, store, subtract
from gpbnb.arithmetic.kernels.tags import DoubleDouble

MULTIPLY, ADD, SUBTRACT = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Program:
    """Operations of one step.

    Parameters
    ----------
    n, m : number of states and of inputs.
    operations : (o, 3), code and two operands. Values are numbered: the n states, the m inputs, then the result of each
        operation. MULTIPLY takes a coefficient and a value; ADD and SUBTRACT take two values.
    outputs : (n,), the values that become the states.
    coefficients : number of coefficients.
    groups : (o,), operations whose rounding errors have the same effect on the result share a number.
    roots : for each group, an operation in it.
    """

    n: int
    m: int
    operations: NDArray[np.int64]
    outputs: NDArray[np.int64]
    coefficients: int
    groups: NDArray[np.int64]
    roots: NDArray[np.int64]

    @property
    def roundings(self) -> NDArray[np.int64]:
        """Number of operations that share each effect, (groups,)."""
        return np.bincount(self.groups, minlength=len(self.roots))


class Builder:
    """Build a :class:`Program`, one operation at a time; values are plain ints."""

    def __init__(self, n: int, m: int) -> None:
        self.n, self.m = n, m
        self._operations: list[tuple[int, int, int]] = []
        self._signs: dict[tuple[int, int], int] = {}

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

    def finish(self, outputs: Sequence[int], coefficients: int) -> Program:
        operations = np.array(self._operations, dtype=np.int64).reshape(-1, 3)
        groups, roots = _grouped(operations, list(outputs), self.n + self.m)
        return Program(
            self.n,
            self.m,
            operations,
            np.array(outputs, dtype=np.int64),
            coefficients,
            np.array(groups),
            np.array(roots),
        )

    def _append(self, code: int, a: int, b: int) -> int:
        self._operations.append((code, a, b))
        return self.n + self.m + len(self._operations) - 1


def _grouped(operations: NDArray[np.int64], outputs: list[int], first: int) -> tuple[list[int], list[int]]:
    """Number the effects: an operation used once, as a term of a sum, has the effect of that sum, up to its sign."""
    users: list[list[int]] = [[] for _ in operations]
    for o, (code, a, b) in enumerate(operations):
        for value in (b,) if code == MULTIPLY else (a, b):
            if value >= first:
                users[value - first].append(o)
    groups, roots = [-1] * len(operations), list[int]()
    for o in range(len(operations) - 1, -1, -1):
        used = users[o]
        if len(used) == 1 and operations[used[0]][0] != MULTIPLY and first + o not in outputs:
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


def innovation_program(n: int, m: int) -> Program:
    r"""Innovation form, (98): :math:`u + \hat K(z - Hu)`, :math:`u = \Phi x`; coefficients Φ (n, n), H (m, n), K."""
    (Phi, H, K), count = coefficient_matrices((n, n), (m, n), (n, m))
    build = Builder(n, m)
    u = build.product(Phi, build.states)
    y = build.product(H, u)
    g = [build.subtract(z, a) for z, a in zip(build.inputs, y, strict=True)]
    v = build.product(K, g)
    return build.finish([build.add(a, b) for a, b in zip(u, v, strict=True)], count)


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


def state_space_program(n: int, m: int) -> Program:
    """Program of a filter :math:`Ax + Bz`, each row one sum from left to right; coefficients A (n, n), B (n, m)."""
    (A, B), count = coefficient_matrices((n, n), (n, m))
    build = Builder(n, m)
    inputs = [*build.states, *build.inputs]
    return build.finish(build.product(np.hstack([A, B]), inputs), count)


def biquad_program() -> Program:
    """Program of a second-order section, transposed direct form II; states s1, s2, output; b0, b1, b2, a1, a2."""
    build = Builder(3, 1)
    (s1, s2, _), (z,) = build.states, build.inputs
    y = build.add(build.multiply(0, z), s1)
    first = build.subtract(build.add(build.multiply(1, z), s2), build.multiply(3, y))
    second = build.subtract(build.multiply(2, z), build.multiply(4, y))
    return build.finish([first, second, y], 5)


def controller_program() -> Program:
    """Program of a PID controller with a decaying integral; the states are integral, last error and output.

    The coefficients are ``leak, Ki, Kp, Kd``. The integral becomes leak · integral + Ki e, and the output
    Kp e + integral + Kd (e - last e).
    """
    build = Builder(3, 1)
    (integral, last, _), (error,) = build.states, build.inputs
    integral = build.add(build.multiply(0, integral), build.multiply(1, error))
    steep = build.multiply(3, build.subtract(error, last))
    output = build.add(build.add(build.multiply(2, error), integral), steep)
    return build.finish([integral, error, output], 4)


# -- execution --------------------------------------------------------------------------------------------------------


@inner
def execute(fmt: Any, operations: Any, outputs: Any, coefficients: Any, x: Any, z: Any, values: Any) -> None:
    """Take one step in the arithmetic of a tag: x becomes the next state; `values` is a workspace."""
    n, m = x.shape[0], z.shape[0]
    for i in range(n):
        put(fmt, values, i, load(fmt, x, i))
    for i in range(m):
        put(fmt, values, n + i, load(fmt, z, i))
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        right = load(fmt, values, b)
        if code == MULTIPLY:
            put(fmt, values, n + m + o, multiply(fmt, load(fmt, coefficients, a), right))
        elif code == ADD:
            put(fmt, values, n + m + o, add(fmt, load(fmt, values, a), right))
        else:
            put(fmt, values, n + m + o, subtract(fmt, load(fmt, values, a), right))
    for i in range(n):
        store(fmt, x, i, load(fmt, values, outputs[i]))


@compiled
def advance(fmt: Any, operations: Any, outputs: Any, coefficients: Any, start: Any, z: Any, x: Any, X: Any) -> None:
    """Take a step with each of the measurements z and keep every state in X.

    Parameters
    ----------
    coefficients : (steps, c), one row for each step; after the last row, those from `start` on repeat.
    """
    values = np.empty((x.shape[0] + z.shape[1] + operations.shape[0], *x.shape[1:]), x.dtype)
    rows = coefficients.shape[0]
    for k in range(z.shape[0]):
        row = k if k < rows else start + (k - start) % (rows - start)
        execute(fmt, operations, outputs, coefficients[row], x, z[k], values)
        X[k] = x


def steps_in_python(
    program: Program, round_: Callable[[Any], Any], coefficients: Any, x: Sequence[Any], z: Sequence[Any]
) -> list[Any]:
    """Take one step with numbers of any type, each result rounded by a function; slow and obvious."""
    values = [*x, *z]
    for code, a, b in program.operations.tolist():
        left = coefficients[a] if code == MULTIPLY else values[a]
        exactly = left * values[b] if code == MULTIPLY else left + values[b] if code == ADD else left - values[b]
        values.append(round_(exactly))
    return [values[i] for i in program.outputs]


# -- linear functions -------------------------------------------------------------------------------------------------


@compiled
def functionals(operations: Any, coefficients: Any, first: int, rows: Any, sizes: Any) -> None:
    """Compute the linear function of (x, z) that each value approximates.

    Parameters
    ----------
    coefficients : (c, 2), double-double. first : n + m.
    rows : (n + m + o, n + m, 2), to be filled, double-double; relative to `sizes`, errors are below 2**-90.
    sizes : (n + m + o, n + m), to be filled: the result with all signs made positive.
    """
    exactly = DoubleDouble()
    rows[:first] = 0.0
    sizes[:first] = 0.0
    for i in range(first):
        rows[i, i, 0] = 1.0
        sizes[i, i] = 1.0
    for o in range(operations.shape[0]):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        for j in range(first):
            right = (rows[b, j, 0], rows[b, j, 1])
            if code == MULTIPLY:
                c = (coefficients[a, 0], coefficients[a, 1])
                s = doubledouble.multiply(exactly, c, right) if c[0] != 0.0 and right[0] != 0.0 else (0.0, 0.0)
                size = abs(c[0]) * sizes[b, j]
            else:
                left = (rows[a, j, 0], rows[a, j, 1])
                if code == SUBTRACT:
                    right = (-right[0], -right[1])
                s = doubledouble.add(exactly, left, right)
                size = sizes[a, j] + sizes[b, j]
            rows[first + o, j, 0], rows[first + o, j, 1] = s[0], s[1]
            sizes[first + o, j] = size


@compiled
def effects(operations: Any, outputs: Any, coefficients: Any, first: int, G: Any, sizes: Any) -> None:
    """Compute the effect of an error in each value on the states after the step.

    Parameters
    ----------
    coefficients : (c,), float64.
    G : (n + m + o, n), to be filled; relative to `sizes`, errors are below (3 o + 3) 2**-53.
    sizes : (n + m + o, n), to be filled: the result with all signs made positive.
    """
    n = outputs.shape[0]
    G[:] = 0.0
    sizes[:] = 0.0
    for i in range(n):
        G[outputs[i], i] += 1.0
        sizes[outputs[i], i] += 1.0
    for o in range(operations.shape[0] - 1, -1, -1):
        code, a, b = operations[o, 0], operations[o, 1], operations[o, 2]
        for i in range(n):
            g, size = G[first + o, i], sizes[first + o, i]
            if size == 0.0:
                continue
            if code == MULTIPLY:
                G[b, i] += coefficients[a] * g
                sizes[b, i] += abs(coefficients[a]) * size
            else:
                G[a, i] += g
                G[b, i] += g if code == ADD else -g
                sizes[a, i] += size
                sizes[b, i] += size
