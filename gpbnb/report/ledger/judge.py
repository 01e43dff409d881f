"""The one judge: a row of data says where a printed statement must hold, and what it is called if it does not.

A row of ``checks/<topic>.csv`` judges some statements. Its columns:

- *statements*: their ids; ``*.eq4`` stands for eq4 of both reports.
- *domain*: an expression for the true values of the names and labels in the statement: one mapping, or one for each of
  several instances. A statement without a domain is not judged.
- *mode*: ``exact``; ``first order``; ``bound`` and ``bound to first order``, where every bound is attained as well;
  ``close``, to the digits that are printed; ``largest errors``, as :mod:`gpbnb.report.ledger.largest` says.
- *also*: an expression that must be true besides; without a domain, it judges the statement alone.
- *verdict*: what a mismatch is called, or else what the statement is, such as ``given``; *root*: its root error.
- *recomputed*, *note*, *otherwise*: what the ledger says; *otherwise* replaces the note of a mismatch. Expressions in
  braces are filled in. ``found`` is the outcome, ``printed`` the statement, and ``document`` where it is printed.

The functions of the topic give the names of these expressions their values, as do the values of a single mapping.
"""

from __future__ import annotations

import re
import string
from collections import ChainMap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp

from gpbnb.arithmetic.formats import prints_as
from gpbnb.arithmetic.rounding import Rounding
from gpbnb.report.display.tables import scientific
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.dotted import DottedMatrix
from gpbnb.report.ledger.finding import DISAGREEMENTS, Finding, Verdict, compare
from gpbnb.report.ledger.formula import OPERATORS, Link, Number, Part, Relation, Undefined, Words
from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.largest import allows
from gpbnb.report.ledger.legibility import charged
from gpbnb.report.ledger.statements import Statement, rows_of

Names = Mapping[str, Any]
SECOND_ORDER = Fraction(1, 10**60)
"""Differences below this value are of second order, since roundings are at most 1e-40 and the data are of order one."""
ATTAINED, TIGHT = Fraction(99, 100), 1 - Fraction(1, 10**9)
"""A bound counts as attained if the value reaches this share of it, in a tight instance the second one."""
EPSILON = sp.Symbol("epsilon")
"""The rounding error of printed terms that are symbols; to first order, its square is dropped."""
_LITERAL = re.compile(r"-?[\d.]+([eE][+-]?\d+)?")
CLOSE, EQUAL = 1e-2, 1e-9
"""Relative differences that ≈ and = allow in the mode ``close``."""


DIGITS = 50
"""Digits to which two sides are evaluated if they contain exponentials or roots."""
NOTHING = sp.Float("1e-40", DIGITS)
"""Largest difference that rounding errors of the evaluation can cause."""


@dataclass(frozen=True)
class StatementOutcome:
    """The outcome of a statement in all instances; `loose` counts the printed bounds that no instance attains."""

    instances: int
    violated: int
    loose: int

    @property
    def holds(self) -> bool:
        """Whether the statement holds in every instance."""
        return 0 == self.violated < self.instances

    @property
    def right(self) -> bool:
        """Whether it holds and every bound is attained, so that no bound can be tightened."""
        return self.holds and not self.loose

    @property
    def count(self) -> str:
        """Number of instances in which it holds."""
        if self.holds:
            return f"holds in all {self.instances} instances"
        return f"holds in {self.instances - self.violated} of {self.instances} instances"

    def __str__(self) -> str:
        if not self.loose:
            return self.count
        never = f"{'the bound is' if self.loose == 1 else 'the bounds are'} never attained"
        return f"{self.count}, {'but' if self.holds else 'and'} {never}"


def judge(stated: Statement | Iterable[Part], domain: Names | Iterable[Names], mode: str = "exact") -> StatementOutcome:
    """Judge what is stated in each instance of a domain.

    Besides the values of names, an instance may say: ``holds``, False where the statement must not hold; ``part``, the
    number of the only part that it is about; ``expression``, the value of a part that compares nothing; ``tight``,
    where the first bound of each relation must be attained; ``close``, the share by which equal sides may differ; and
    ``numbers``, the type of printed numbers, Fraction by default.
    """
    parts = stated.parts if isinstance(stated, Statement) else tuple(stated)
    count = violated = 0
    attained: dict[tuple[int, int], bool] = {}
    missed = set()
    undefined: list[Undefined] = []
    for names in [domain] if isinstance(domain, Mapping) else domain:
        count += 1
        held, reached = False, dict[tuple[int, int], bool]()
        try:
            held, reached = _held(parts, names, mode)
        except Undefined as error:
            undefined.append(error)
        violated += held != names.get("holds", True)
        if names.get("holds", True):
            attained |= {place: here or attained.get(place, False) for place, here in reached.items()}
            first = {i: (i, j) for i, j in reversed(reached)}
            missed |= {place for place in first.values() if names.get("tight") and not reached[place]}
    if undefined and len(undefined) == count:
        raise undefined[0]
    loose = {place for place, here in attained.items() if not here} | missed
    return StatementOutcome(count, violated, len(loose))


def _held(parts: tuple[Part, ...], names: Names, mode: str) -> tuple[bool, dict[tuple[int, int], bool]]:
    """Whether the parts hold in an instance, and for each bound, by its part and link, whether it is attained."""
    held, reached = bool(parts), {}
    for i, part in enumerate(parts, start=1):
        if names.get("part", i) != i:
            continue
        match part:
            case Words():
                held &= _is_said(names[part.label], part.printed)
            case Number():
                held &= _is_printed(names[part.label], part)
            case Relation() if mode == "largest errors":
                held &= allows(part, names)
            case Relation() if "*...*" not in part.text:
                sides = part.sides
                if len(sides) == 1:
                    held &= sign(part.value(names, names.get("numbers", Fraction)) - names["expression"]) == 0
                for j, link in enumerate(part.links(names, names.get("numbers", Fraction))):
                    held &= holds(link, mode, sides[j + 1], names.get("close", EQUAL))
                    if mode.startswith("bound") and link.symbol in ("<=", "<", ">=", ">"):
                        zero = "0" in (sides[j].text, sides[j + 1].text)
                        reached[i, j] = attains(link, zero, TIGHT if names.get("tight") else ATTAINED)
    return bool(held), reached


def _is_said(true: Any, phrase: str) -> bool:
    """Whether a phrase is the true one, one of them, or true by a function."""
    return bool(true(phrase)) if callable(true) else phrase == true if isinstance(true, str) else phrase in true


def _is_printed(true: Any, number: Number) -> bool:
    """Whether the printed digits are those of the true value, or true by a function."""
    if callable(true):
        return bool(true(number.literal))
    return bool(true == 0) if number.value == 0 else prints_as(true, number.literal, *Rounding.documented())


def holds(link: Link, mode: str = "exact", side: Relation | None = None, equal: float = EQUAL) -> bool:
    """Whether one comparison holds; matrices are compared entry by entry.

    For the mode ``close``, `side` is the printed right side, and `equal` the share by which equal sides may differ.
    """
    symbol = {"≈": "=="}.get(link.symbol, link.symbol)
    if DottedMatrix in (type(link.left), type(link.right)):
        compare = next(function for name, function in OPERATORS.values() if name == symbol)
        return bool(compare(link.left, link.right))
    left, right = entries(link.left), entries(link.right)
    if left.shape != right.shape:
        return False
    if mode == "close" and symbol in ("==", "!="):
        share = CLOSE if link.symbol == "≈" else equal
        close = all(_close(a, b, share, side) for a, b in zip(left.flat, right.flat, strict=True))
        return close == (symbol == "==")
    slack = SECOND_ORDER if mode.endswith("first order") or link.symbol == "≈" else 0
    signs = [sign(a - b, slack) for a, b in zip(left.flat, right.flat, strict=True)]
    match symbol:
        case "==":
            return not any(signs)
        case "!=":
            return any(signs)
        case "<=" | ">=":
            return set(signs) <= {0, -1 if symbol == "<=" else 1}
        case _:
            return set(signs) <= {-1 if symbol == "<" else 1}


def _close(left: Any, right: Any, share: float, side: Relation | None) -> bool:
    """Whether a number prints as the literal on the right, or differs from the right side by at most a share of it."""
    if side and _LITERAL.fullmatch(side.text):
        return bool(left == 0) if right == 0 else prints_as(left, side.text, *Rounding.documented())
    return bool(abs(left - right) <= share * abs(right))


def attains(link: Link, zero: bool = False, share: Fraction = ATTAINED) -> bool:
    """Whether some entry reaches its bound, or is zero where the bound is printed as zero."""
    smaller, larger = (link.left, link.right) if link.symbol in ("<=", "<") else (link.right, link.left)
    a, b = entries(smaller), entries(larger)
    if a.shape != b.shape:
        return False
    pairs = list(zip(a.flat, b.flat, strict=True))
    return any((sign(y) == 1 and sign(x - y * share) in (0, 1)) or (zero and sign(x - y) == 0) for x, y in pairs)


def entries(value: Any) -> Any:
    """Return a number or the entries of a matrix of any kind as an array of objects."""
    if isinstance(value, sp.MatrixBase):
        return np.array(value.tolist(), dtype=object).reshape(value.shape)
    if hasattr(value, "slope"):  # numbers and matrices to first order
        value = value.tolist() if value.shape else value
        shape = (len(value), len(value[0])) if isinstance(value, list) else ()
        flat = [each for row in value for each in row] if isinstance(value, list) else [value]
        found = np.empty(len(flat), dtype=object)
        found[:] = flat
        return found.reshape(shape)
    return np.asarray(value, dtype=object)


def sign(x: Any, slack: Any = 0) -> int:
    """Return the sign of a number, or 2 for an expression whose sign is not known.

    A number to first order has the sign of its error if it has no other value.
    """
    if hasattr(x, "slope"):
        return sign(x.value, slack) or sign(x.slope, slack)
    if isinstance(x, sp.Basic):
        if slack and EPSILON in x.free_symbols:
            return sign(x.subs(EPSILON, 0), slack) or sign(x.diff(EPSILON).subs(EPSILON, 0), slack)
        if vanishes(x):
            return 0
        if x.free_symbols:
            return _sign_of_terms(x)
        if not x.is_comparable:
            return 2
        x = sp.N(x, DIGITS)
    return 0 if abs(x) <= slack else 1 if x > 0 else -1


def _sign_of_terms(x: sp.Expr) -> int:
    """Return the common sign of all terms of a rational expression in positive symbols, 2 if they have none."""
    x = sp.cancel(sp.expand(x))
    letters = sorted(x.free_symbols, key=str)
    others = [letter for letter in letters if not letter.is_integer]
    try:
        terms = sp.Poly(sp.numer(x), *others).coeffs() if others else [sp.numer(x)]
    except sp.PolynomialError:
        return 2
    signs = {sp.sign(term.subs({letter: 2 + i for i, letter in enumerate(letters)})) for term in terms}
    return int(signs.pop()) if len(signs) == 1 else 2


def vanishes(expression: Any) -> bool:
    """Whether an expression or every entry of a matrix is zero.

    Rational values are compared exactly. Exponentials and roots of rational values are evaluated to 50 digits. An
    expression with symbols vanishes if it expands to zero.
    """
    if isinstance(expression, sp.MatrixBase):
        return all(vanishes(entry) for entry in expression)
    expression = sp.sympify(expression)
    if expression.free_symbols:
        return bool(sp.expand(expression) == 0)
    if expression.is_Rational:
        return bool(expression == 0)
    value = sp.N(expression, DIGITS)
    return bool(value.is_number and abs(value) < NOTHING)


# -- rows of data ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class CheckRow:
    """A row: where some statements must hold, and what the ledger says about them; see this module."""

    topic: Mapping[str, Any] = field(repr=False)
    domain: str
    mode: str
    also: str
    verdict: str
    root: str
    recomputed: str
    note: str
    otherwise: str

    __hash__ = object.__hash__

    def __call__(self, printed: Statement) -> Finding:
        """Judge a statement."""
        names = {**_NAMES, "printed": printed, "document": printed.document, **self.topic}
        verdict = Verdict(self.verdict or "wrong")
        agrees: bool | None = None
        if self.domain:
            domain = _value(self.domain, names)
            found = judge(printed, domain, self.mode or "exact")
            names = {**names, "found": found, **(domain if isinstance(domain, Mapping) else {})}
            agrees = found.right
        if self.also:
            agrees = agrees is not False and bool(_value(self.also, names))
        recomputed, note, otherwise = (_filled(text, names) for text in (self.recomputed, self.note, self.otherwise))
        if verdict in DISAGREEMENTS:
            return compare(bool(agrees), recomputed, verdict, note, otherwise or note, self.root)
        if verdict is Verdict.ANSWERED:
            return Finding(recomputed, bool(agrees), verdict if agrees else Verdict.OPEN, note)
        if agrees is False:
            return compare(False, recomputed, Verdict.MISPRINT, otherwise_note=otherwise)
        return Finding(recomputed if agrees is None else "", None, verdict, note)

    @property
    def takes_statement(self) -> bool:
        """Whether the statement is judged by what it prints."""
        return bool(self.domain) or "printed" in self.also


class Checks(dict[str, CheckRow]):
    """The checks of one topic, by the ids of their statements."""

    def run(self, printed: Statement) -> Finding:
        """Judge a statement, and decide by the rule of :mod:`gpbnb.report.ledger.legibility` who is charged."""
        return charged(printed.id, self[printed.id](printed))


def read(topic: str, *namespaces: Mapping[str, Any]) -> Checks:
    """Return the checks of a topic, named by its module, from the file of its name; functions come from namespaces."""
    checks = Checks()
    functions: Mapping[str, Any] = ChainMap(*namespaces)  # type: ignore[arg-type]
    name = topic.rpartition(".")[2]
    for row in rows_of(f"checks/{name}.csv"):
        ids = [key for each in row.pop("statements").split() for key in _ids(each)]
        check = CheckRow(functions, **row)
        for key in ids:
            if key in checks:
                raise ValueError(f"got two rows of {key!r} in {name}.csv; needed one; remove one")
            checks[key] = check
    return checks


def _ids(place: str) -> tuple[str, ...]:
    """Return an id, or both ids of a place that two reports have."""
    if place.startswith("*."):
        return f"hung1984.II.{place[2:]}", f"hung1982.III.{place[2:]}"
    return (place,)


_NAMES: Names = {"intended": intended, "judge": judge, "chapter": chapter, "scientific": scientific}
_BUILTINS = {
    f.__name__: f
    for f in (abs, all, any, dict, float, int, len, list, map, max, min, range, round, set, sorted, str, sum, tuple)
}


def _value(expression: str, names: Mapping[str, Any]) -> Any:
    """Evaluate an expression, which can use the names of its topic but import nothing."""
    return eval(expression, {**names, "__builtins__": _BUILTINS})


def _filled(text: str, names: Mapping[str, Any]) -> str:
    """Fill in the expressions in braces, each with its format."""
    found = []
    for literal, expression, spec, _ in string.Formatter().parse(text):
        found.append(literal)
        if expression is not None:
            found.append(format(_value(expression, names), spec or ""))
    return "".join(found)
