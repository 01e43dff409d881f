"""Operations of a whole step of a Kalman filter, covariance included, from the generic step run on tracing numbers.

:mod:`gpbnb.filters.kalman_step` and :mod:`gpbnb.filters.array_steps` take numbers of any kind. A :class:`Traced` number
adds each operation on it to a :class:`~gpbnb.filters.program.Builder`, so the resulting program has the operations of
the step in their order, and no second description of a step exists.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.algebra import Algebra, Inverse, Matrix, inverse_in_order, product_in_order
from gpbnb.filters.array_steps import observe_ud, observed, predict_ud
from gpbnb.filters.forms import Form
from gpbnb.filters.kalman_step import StepModel, kalman_step
from gpbnb.filters.program import (
    ADD,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    DIVISOR,
    IN_RANGE,
    MULTIPLY,
    NEVER_OVERFLOW,
    NOT_NEGATIVE,
    POSITIVE,
    PRODUCT,
    SUBTRACT,
    Builder,
    Program,
    coefficient_matrices,
    entries,
    values_of,
)


@dataclass(frozen=True, eq=False)
class Traced:
    """A number that adds the operations on it to a program.

    Parameters
    ----------
    trace : the program under construction.
    value : number of its value; None for a coefficient.
    coefficient : number of the coefficient; -1 for a value.
    """

    trace: Trace
    value: int | None
    coefficient: int = -1

    def _loaded(self) -> int:
        if self.value is None:
            return self.trace.build.append(CONSTANT, self.coefficient)
        return self.value

    def _with(self, code: int, other: Any) -> Any:
        if isinstance(other, np.ndarray):  # it takes one entry after the other
            return NotImplemented
        return self.trace.operation(code, self, self.trace.number(other))

    def __add__(self, other: Any) -> Any:
        return self._with(ADD, other)

    def __sub__(self, other: Any) -> Any:
        return self._with(SUBTRACT, other)

    def __mul__(self, other: Any) -> Any:
        return self._with(PRODUCT, other)

    def __truediv__(self, other: Any) -> Any:
        return self._with(DIVIDE, other)

    def __rmul__(self, other: Any) -> Traced:
        return self.trace.number(other) * self

    def __radd__(self, other: Any) -> Traced:
        return self.trace.number(other) + self

    def __rsub__(self, other: Any) -> Traced:
        return self.trace.number(other) - self

    def __neg__(self) -> Traced:
        return self.trace.number(0) - self

    def __eq__(self, other: object) -> bool:
        """Note that a divisor must not be zero, and continue as if it were not."""
        self._must_be(DIVISOR, other)
        return False

    def __gt__(self, other: object) -> bool:
        """Note that a value should be positive, and continue as if it were."""
        self._must_be(POSITIVE, other)
        return True

    def __lt__(self, other: object) -> bool:
        """Note that a value should not be negative, and continue as if it were not."""
        self._must_be(NOT_NEGATIVE, other)
        return False

    def _must_be(self, kind: int, other: object) -> None:
        if other != 0:
            raise ValueError(f"got a comparison of a traced number with {other!r}; needed one with zero")
        self.trace.build.checks.append((self._loaded(), kind))

    def if_nonzero(self, changed: Callable[[], Any], unchanged: Any) -> Any:
        """Record what changes if this number is not zero, and the choice; see ``array_steps.if_nonzero``."""
        build, guard = self.trace.build, self._loaded()
        outer = build.guard
        build.guard = guard if outer < 0 else build.append(CHOOSE, guard, self.trace.loaded(self.trace.number(0)))
        both = zip(np.ravel(changed()), np.ravel(unchanged), strict=True)
        found = [self.trace.operation(CHOOSE, *pair) for pair in both]
        build.guard = outer
        return np.array(found, dtype=object)


class Trace:
    """A program under construction from operations on its numbers."""

    def __init__(self, n: int, m: int, zero: int, one: int) -> None:
        self.build = Builder(n, m)
        #: Matrices that were inverted; the first is the innovation covariance.
        self.inverted: list[Matrix] = []
        self._constants = {0: Traced(self, None, zero), 1: Traced(self, None, one)}

    def number(self, given: Any) -> Traced:
        """Return a traced number as it is, and 0 or 1 as coefficients."""
        return given if isinstance(given, Traced) else self._constants[given]

    def values(self, numbers: Sequence[int], *shape: int) -> Matrix:
        """Return values of the program as a matrix."""
        return self._matrix([Traced(self, each) for each in numbers], shape)

    def coefficients(self, numbers: NDArray[np.int64]) -> Matrix:
        """Return coefficients as a matrix."""
        return self._matrix([Traced(self, None, each) for each in numbers.ravel().tolist()], numbers.shape)

    def operation(self, code: int, a: Traced, b: Traced) -> Traced:
        """Add an operation; a product with a coefficient is the one that linear programs have."""
        if code == PRODUCT and a.value is None:
            return Traced(self, self.build.append(MULTIPLY, a.coefficient, self.loaded(b)))
        if code == PRODUCT and b.value is None:
            return Traced(self, self.build.append(MULTIPLY, b.coefficient, self.loaded(a)))
        return Traced(self, self.build.append(code, self.loaded(a), self.loaded(b)))

    def loaded(self, number: Traced) -> int:
        """Return the value of a number; a coefficient becomes one."""
        if number.value is None:
            return self.build.append(CONSTANT, number.coefficient)
        return number.value

    def _matrix(self, numbers: Sequence[Traced], shape: Sequence[int]) -> Matrix:
        found = np.empty(len(numbers), dtype=object)
        found[:] = numbers
        return found.reshape(shape)

    def algebra(self) -> Algebra:
        """Return the algebra of traced numbers; pivots are noted as divisors that should be positive."""

        def inverse(a: Matrix, identity: Matrix) -> Inverse:
            self.inverted.append(a)
            found = inverse_in_order(a, identity)
            for pivot in map(self.loaded, found.pivots):
                self.build.checks += [(pivot, DIVISOR), (pivot, NOT_NEGATIVE)]
            return found

        return Algebra(self._identity, product_in_order, inverse)

    def _identity(self, n: int) -> Matrix:
        return self._matrix([self._constants[int(i == j)] for i in range(n) for j in range(n)], (n, n))


class TracedStep(NamedTuple):
    """A step of a Kalman filter on traced numbers.

    Parameters
    ----------
    trace : its operations. The states are x (n), then the entries of P at `places`, or of U in the UD form.
        Coefficients are Phi (n, n), H (m, n), Q (n, n), R (m, m), B (n, p), then 0 and 1; Q and R are factors in the UD
        form. The inputs are z (m), then u (p).
    coefficients : names of the coefficients.
    places : rows and columns of the entries of the covariance that are states.
    x, P : estimate (n,) and covariance (n, n), or factor, after the step.
    K : gain (n, m). In the UD form, which takes one measurement after the other, each column is the gain of one.
    innovation : innovation covariance (m, m); in the UD form, which has none, it is empty.
    """

    trace: Trace
    coefficients: list[str]
    places: list[tuple[int, int]]
    x: Matrix
    P: Matrix
    K: Matrix
    innovation: Matrix


def traced_step(n: int, m: int, form: Form, p: int = 0) -> TracedStep:
    """Take a step of a Kalman filter in a form on traced numbers, with p known inputs."""
    (Phi, H, Q, R, B), zero = coefficient_matrices((n, n), (m, n), (n, n), (m, m), (n, p))
    upper = form is Form.UD
    places = [(i, j) for i in range(n) for j in range(n) if not upper or i <= j]
    trace = Trace(n + len(places), m + p, zero, zero + 1)
    states = trace.build.states
    x, P = trace.values(states[:n], n), np.full((n, n), trace.number(0), dtype=object)
    for (i, j), state in zip(places, states[n:], strict=True):
        P[i, j] = Traced(trace, state)
    z, u = trace.values(trace.build.inputs[:m], m), trace.values(trace.build.inputs[m:], p, 1)
    model = StepModel(*(trace.coefficients(each) for each in (Phi, H, Q, R)))
    letters = ("Phi", "H", *(("UQ", "UR") if upper else ("Q", "R")), "B")
    shapes = [each.shape for each in (Phi, H, Q, R, B)]
    names = [each for letter, shape in zip(letters, shapes, strict=True) for each in entries(letter, *shape)]
    names += ["zero", "one"]
    if upper:
        P, _ = predict_ud(model.Phi, P, model.Q)
        ahead = product_in_order(model.Phi, x[:, None])[:, 0]
        ahead = ahead + product_in_order(trace.coefficients(B), u)[:, 0] if p else ahead
        x, P, gains, _ = observed(observe_ud, model.H, model.R, z, ahead, P)
        return TracedStep(trace, names, places, x, P, np.stack(gains, axis=1), trace.values([], 0, m))
    known = product_in_order(trace.coefficients(B), u) if p else None
    found = kalman_step(trace.algebra(), form, model, x[:, None], P, z[:, None], known)
    trace.build.checks += [(trace.loaded(found.P[i, i]), POSITIVE) for i in range(n)]
    return TracedStep(trace, names, places, found.x[:, 0], found.P, found.K, trace.inverted[0])


def kalman_program(n: int, m: int, form: Form, p: int = 0) -> Program:
    """List the operations of a step of a Kalman filter in a form, with the states and coefficients of a TracedStep."""
    trace, coefficients, places, x, P, *_ = traced_step(n, m, form, p)
    after = [trace.loaded(each) for each in (*x, *(P[place] for place in places))]
    covariance = "U" if form is Form.UD else "P"
    state_names = [*entries("x", n), *(f"{covariance}[{i}][{j}]" for i, j in places)]
    return trace.build.finish(after, len(coefficients), 0, state_names, coefficients)


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
