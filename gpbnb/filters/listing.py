"""Recorded operations in the codes of a program, from which C code is written.

A tape has truth values and regions that a run leaves out; a program has values that are zero or not, and guards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gpbnb.arithmetic.interpreting import Call
from gpbnb.arithmetic.machine import NAMES
from gpbnb.arithmetic.tape import Tape
from gpbnb.arithmetic.traced import TracedTruth
from gpbnb.filters.forms import ROOTS, Form
from gpbnb.filters.program import (
    ADD,
    AT_LEAST,
    AT_MOST,
    CEILING,
    CHOOSE,
    CONSTANT,
    DIVIDE,
    DIVISOR,
    EQUAL,
    FLOOR,
    FUNCTIONS,
    LESS,
    MODULO,
    MULTIPLY,
    NEAREST,
    NOT_NEGATIVE,
    POSITIVE,
    PRODUCT,
    RADICAND,
    ROOT,
    SUBTRACT,
    TRUNCATE,
    Builder,
    Program,
    entries,
)
from gpbnb.filters.recording import Known, StepKind, whole_step


def kalman_program(form: Form, shapes: dict[str, tuple[int, ...]]) -> Program:
    """List the operations of a step of a Kalman filter.

    Parameters
    ----------
    shapes : shapes of the matrices of the model by their letters, and of the known inputs u, which follow the
        measurements. Coefficients are the entries of the matrices in this order, then 0 and 1.

    Returns
    -------
    program : its states are x (n), then the entries of P, or in the UD form the upper triangle of U.
    """
    m, n = shapes["H"]
    unknown = (Known(letter, shape, bytes([2]) * math.prod(shape)) for letter, shape in shapes.items())
    tape, places, found = whole_step(StepKind(form, n, m, tuple(unknown)))
    del places["carried"]
    return filter_program(form, tape, places, {}, (found.x, found.P), found.definite)


def filter_program(
    form: Form,
    tape: Tape,
    places: dict[str, NDArray[np.int64]],
    others: dict[int, Any],
    after: Sequence[Any],
    definite: Any,
    exact: bool = True,
) -> Program:
    """List the operations of a step of a filter whose states are those of :func:`program_states`.

    Parameters
    ----------
    places : those of x, P and z, of the known inputs u if there are any, and of matrices by their letters. Coefficients
        are the entries of the matrices in this order, then the others, 0 and 1.
    others : values of other coefficients by their places; 0 if they may be zero.
    after : x and P after the step.
    exact : as for :class:`Listing`.
    """
    x, P, z = (places[letter] for letter in "xPz")
    u = places.get("u", np.zeros(0, np.int64))
    matrices = {letter: each for letter, each in places.items() if letter not in ("x", "P", "z", "u")}
    order = [*(at for each in matrices.values() for at in each.ravel().tolist()), *others, 0, tape.one]
    states = program_states(form, x[None], P[None])[0].tolist()
    zeros = dict.fromkeys({*P.ravel().tolist()} - {*states}, len(order) - 2)
    listing = Listing(
        tape,
        states,
        [*z.tolist(), *u.tolist()],
        {at: i for i, at in enumerate(order)} | zeros,
        {tape.one, *(at for at, value in others.items() if value)},
        exact,
    )
    names = [each for letter, at in matrices.items() for each in entries(letter, *at.shape)]
    names += [*(f"c{i}" for i in range(len(others))), "zero", "one"]
    letter = "U" if form is Form.UD else "S" if form in ROOTS else "P"
    named = (np.array(entries(each, *at.shape)).reshape(1, *at.shape) for each, at in (("x", x), (letter, P)))
    state_names, following = (
        program_states(form, *pair)[0].tolist() for pair in (named, (each.components[0][None] for each in after))
    )
    return listing.program(following, len(order), 0, state_names, names, definite)


def program_states(form: Form, x: Any, P: Any) -> Any:
    """Return estimates (k, n), then the entries of P, (k, n, n), that are not always zero, as states of a program."""
    n, upper = x.shape[1], form in (Form.UD, Form.CARLSON)
    kept = [n * i + j for i in range(n) for j in range(n) if not upper or i <= j]
    return np.concatenate([x, P.reshape(len(P), n * n)[:, kept]], axis=1)


_OF_TWO = {"add": ADD, "subtract": SUBTRACT, "multiply": PRODUCT, "divide": DIVIDE}
_CALLS = {"fmod": MODULO, "floor": FLOOR, "ceil": CEILING, "trunc": TRUNCATE, "rint": NEAREST}
_LESS, _SAME, _GREATER = 1, 2, 4
_AND, _OR, _NOT = 8, 14, 1
_ALL = _LESS + _SAME + _GREATER


class _Truth(NamedTuple):
    """A truth value: whether a value is not zero, or is zero if `negated`; without a value, false, or true."""

    value: int | None
    negated: bool


_FALSE, _TRUE = _Truth(None, False), _Truth(None, True)


class Listing:
    """The operations of a tape in the codes of a program.

    Parameters
    ----------
    states, inputs : places on the tape, -1 for a state that the operations do not use.
    coefficients : numbers of coefficients, by their places; 0 and perhaps 1 are coefficients.
    nonzero : places of coefficients that are not zero.
    exact : whether functions are refused whose digits C's library does not guarantee.
    """

    def __init__(
        self,
        tape: Tape,
        states: Sequence[int],
        inputs: Sequence[int],
        coefficients: dict[int, int],
        nonzero: set[int],
        exact: bool = True,
    ) -> None:
        self._tape, self._build, self._nonzero, self._exact = tape, Builder(len(states), len(inputs)), nonzero, exact
        self._values, self._coefficients = {at: i for i, at in enumerate([*states, *inputs])}, coefficients
        self._truths = {0: _FALSE, 1: _TRUE}
        #: Comparisons and combinations that have not been needed yet.
        self._waiting: dict[int, tuple[str, int, int, int]] = {}
        self._loaded: dict[int, int] = {}
        self._comparisons: dict[tuple[int, int, int], int] = {}
        #: The two places of each comparison by size.
        self._ordered: dict[int, tuple[int, int]] = {}
        #: Values that guard regions, by the places of their truth values.
        self._guards: dict[int, int] = {}
        self._regions: list[tuple[int, int]] = []

    def program(
        self,
        after: Sequence[int],
        coefficients: int,
        p: int,
        state_names: Sequence[str],
        names: Sequence[str],
        definite: Any = True,
    ) -> Program:
        """Return the program whose next states are at some places, with p outputs last.

        Parameters
        ----------
        definite : what is true while a covariance is definite; its parts become checks.
        """
        rows, at = self._tape.instructions.tolist(), 0
        for call in self._tape.calls:
            self._operations(rows, at, call.at)
            self._call(call)
            at = call.at
        self._operations(rows, at, len(rows))
        if isinstance(definite, TracedTruth):
            self._require(int(definite.components[0]))
        return self._build.finish([self._value(place) for place in after], coefficients, p, state_names, names)

    def _operations(self, rows: Sequence[Sequence[int]], begin: int, end: int) -> None:
        for o in range(begin, end):
            while self._regions and self._regions[-1][0] <= o:
                self._build.guard = self._regions.pop()[1]
            code, a, b, c, out = rows[o]
            name = NAMES[code]
            if name in ("compare", "combine"):
                self._waiting[out] = name, a, b, c
            elif name == "skip":
                self._begin(a, o + 1 + b)
            elif name == "nonzero":
                self._check(a, DIVISOR)
            elif name == "choose":
                self._values[out] = self._choice(a, b, c)
            elif name == "sqrt":
                self._check(a, RADICAND)
                self._values[out] = self._build.append(ROOT, 0, self._value(a))
            elif name == "negative":
                self._values[out] = self._opposite(a)
            elif name == "absolute":
                self._values[out] = self._chosen(self._order(a, 0, _LESS), self._opposite(a), self._value(a))
            else:
                self._values[out] = self._of_two(_OF_TWO[name], a, b)

    def _begin(self, truth: int, end: int) -> None:
        """Begin a region that runs if a truth value holds, and only if the region around it runs."""
        self._regions.append((end, self._build.guard))
        self._build.guard = self._guards[truth] = self._within(self._number(self._truth(truth)))

    def _within(self, value: int) -> int:
        """Return a value that is zero outside the region that is listed now."""
        return value if self._build.guard < 0 else self._build.append(CHOOSE, value, self._value(0))

    def _require(self, truth: int) -> None:
        """Note as checks what a truth value says about signs."""
        name, a, b, c = self._waiting.get(truth, ("", 0, 0, 0))
        if (name, c) == ("combine", _AND):
            self._require(a)
            self._require(b)
        elif (name, b, c) == ("compare", 0, _GREATER):
            self._check(a, POSITIVE)
        elif (name, a, c) == ("combine", b, _NOT):  # not less than zero
            self._check(self._waiting[a][1], NOT_NEGATIVE)

    def _call(self, call: Call) -> None:
        inexact = call.name in FUNCTIONS
        if not (call.name in _CALLS or call.name == "remainder" or (inexact and not self._exact)):
            raise ValueError(
                f"got np.{call.name} in the step, for which C has no function with the digits of the emulation; needed "
                "+ - * /, comparisons, choices, np.sqrt, np.fmod, np.remainder, np.floor, np.ceil, np.trunc, np.rint; "
                + ("ask with exact=False, or " if inexact else "")
                + "write a polynomial or a table in its place"
            )
        for *places, out in zip(*(each.tolist() for each in (*call.operands, call.results)), strict=True):
            if call.name == "remainder":
                self._values[out] = self._remainder(places[0], places[1], -out)
            elif call.name == "fmod":
                self._values[out] = self._of_two(MODULO, *places)
            elif inexact:
                first, last = (self._value(places[i]) for i in (0, -1))
                self._values[out] = self._build.append(FUNCTIONS[call.name], first if places[1:] else 0, last)
            else:
                self._values[out] = self._build.append(_CALLS[call.name], 0, self._value(places[0]))

    def _remainder(self, x: int, y: int, rest: int) -> int:
        """Add y to fmod(x, y), to which a place is given, if their signs differ."""
        self._values[rest] = self._of_two(MODULO, x, y)
        (below, above), (under, over) = ([self._order(each, 0, k) for k in (_LESS, _GREATER)] for each in (rest, y))
        opposite = self._combination(self._combination(below, over, _AND), self._combination(above, under, _AND), _OR)
        added = self._chosen(opposite, self._value(y), self._value(0))
        return self._build.append(ADD, self._value(rest), added)

    # -- numbers -------------------------------------------------------------------------------------------

    def _always(self, code: int, a: int, b: int = 0) -> int:
        """Add an operation that also runs where the region that is listed now does not."""
        guard, self._build.guard = self._build.guard, -1
        found = self._build.append(code, a, b)
        self._build.guard = guard
        return found

    def _value(self, place: int) -> int:
        """Return the value of a place; a constant is loaded where it is first needed."""
        if place in self._values:
            return self._values[place]
        coefficient = self._coefficients[place]
        if coefficient not in self._loaded:
            self._loaded[coefficient] = self._always(CONSTANT, coefficient)
        return self._loaded[coefficient]

    def _check(self, place: int, kind: int) -> None:
        """Note what a value should be; in a region, its guard sees to that."""
        if self._build.guard < 0:
            self._build.checks.append((self._value(place), kind))

    def _opposite(self, place: int) -> int:
        return self._build.append(SUBTRACT, self._value(0), self._value(place))

    def _of_two(self, code: int, a: int, b: int) -> int:
        if code in (DIVIDE, MODULO) and b not in self._nonzero:
            self._check(b, DIVISOR)
        if code == PRODUCT and b in self._coefficients:
            a, b = b, a
        if code == PRODUCT and a in self._coefficients:
            return self._build.append(MULTIPLY, self._coefficients[a], self._value(b))
        return self._build.append(code, self._value(a), self._value(b))

    def _choice(self, truth: int, a: int, b: int) -> int:
        """Choose one of the numbers at two places; the larger, or smaller, of a number and a constant is a limit."""
        if truth in self._guards:
            return self._guarded(self._guards[truth], self._value(a), self._value(b))
        found = self._truth(truth)
        if found.value in self._ordered:
            less, greater = self._ordered[found.value]
            for code, constant, value in ((AT_LEAST, greater, less), (AT_MOST, less, greater)):
                chosen = (value, constant) if found.negated else (constant, value)
                if constant in self._coefficients and value not in self._coefficients and (a, b) == chosen:
                    return self._build.append(code, self._coefficients[constant], self._value(value))
        return self._chosen(found, self._value(a), self._value(b))

    def _chosen(self, truth: _Truth, a: int, b: int) -> int:
        if truth.negated:
            a, b = b, a
        return b if truth.value is None else self._guarded(self._within(truth.value), a, b)

    def _guarded(self, guard: int, a: int, b: int) -> int:
        outer, self._build.guard = self._build.guard, guard
        found = self._build.append(CHOOSE, a, b)
        self._build.guard = outer
        return found

    # -- truth values --------------------------------------------------------------------------------------

    def _truth(self, place: int) -> _Truth:
        """Return the truth value of a place, which is computed where it is first needed."""
        if place not in self._truths:
            name, a, b, c = self._waiting[place]
            guard, self._build.guard = self._build.guard, -1
            if name == "compare":
                self._truths[place] = self._order(a, b, c)
            else:
                self._truths[place] = self._combination(self._truth(a), self._truth(b), c)
            self._build.guard = guard
        return self._truths[place]

    def _order(self, a: int, b: int, orders: int) -> _Truth:
        """Compare the numbers at two places; the bits of the orders are those of a tape."""
        if orders in (_ALL, 0):
            return _TRUE if orders else _FALSE
        negated = orders.bit_count() == 2
        only = _ALL - orders if negated else orders
        if only == _GREATER:
            a, b = b, a
        if only == _SAME and b == 0:
            return _Truth(self._value(a), not negated)
        code = EQUAL if only == _SAME else LESS
        if (code, a, b) not in self._comparisons:
            value = self._comparisons[code, a, b] = self._build.append(code, self._value(a), self._value(b))
            if code == LESS:
                self._ordered[value] = a, b
        return _Truth(self._comparisons[code, a, b], negated)

    def _combination(self, a: _Truth, b: _Truth, table: int) -> _Truth:
        """Combine two truth values; bit 2 a + b of the table is the result."""
        if a == b:
            return self._row(a, table & 1 | table >> 2 & 2)
        false, true = self._row(b, table & 3), self._row(b, table >> 2)
        if a.negated:
            false, true = true, false
        if a.value is None or false == true:
            return false
        negated = false == _TRUE
        if negated:
            false, true = self._row(false, 1), self._row(true, 1)
        if (false, true) == (_FALSE, _TRUE):
            return _Truth(a.value, negated)
        holds = a.value if true == _TRUE else self._number(true)
        return _Truth(self._chosen(_Truth(a.value, False), holds, self._number(false)), negated)

    @staticmethod
    def _row(b: _Truth, row: int) -> _Truth:
        """Return what a truth value becomes if it is false, bit 0, and if it is true, bit 1."""
        if row in (0, 3):
            return _TRUE if row == 3 else _FALSE
        return b if row == 2 else b._replace(negated=not b.negated)

    def _number(self, truth: _Truth) -> int:
        """Return a value that is zero where a truth value does not hold, and not zero where it holds."""
        if truth.value is None:
            return self._value(0)
        return self._always(EQUAL, truth.value, self._value(0)) if truth.negated else truth.value
