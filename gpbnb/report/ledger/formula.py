r"""The machine-readable form of a printed statement: read, evaluated and typeset.

A form is one or more parts, separated by semicolons. Each part is one of:

- a relation: a chain of Python comparisons, as in ``abs(Q_tilde/Q) <= (n + m + 1)*beta``;
- a number: ``label: literal unit``, as in ``total: 1.253 mas``; the literal keeps its digits, the unit is optional;
- words: ``label: printed phrase | another phrase | ...``; the first phrase is printed in the document, and the others
  are alternatives that it could have used.

In a relation a name is a symbol; ``x_hat_k`` is typeset as :math:`\hat x_k`; ``P[k-1]`` has an index; ``A.T`` and
``A.inv`` are a transpose and an inverse; ``Sum(term, (j, 2, n))``, ``Prod``, ``Int``, ``norm``, ``abs`` and ``sqrt``
are typeset as mathematics; any other call is a function. ``...`` stands for the dots of a
printed sequence or sum: for the members between its neighbours, in which each number that differs changes by one from
member to member. A matrix with dots is a :class:`~gpbnb.report.ledger.dotted.DottedMatrix`, which equals every matrix
that has the printed cells in their places. Dots in a product can be typeset but not evaluated. The name ``dots`` stands
for the terms that a printed series omits; a check gives it a value, such as ``sp.O(mu**4)``.

``a ≈ b`` is a comparison like ``==``; the check decides how close is close enough.
``cases((a, v < 0), (b, v >= 0))`` is a value by cases. ``Max(term, (j, 1, n))`` prints the maximum over j, and
``Largest`` prints the same as a subscript; ``Sum(term)`` and ``Max(term)`` have no printed range. ``pm(x)`` is ±x, and
``digits(d, e)`` is .de. ``group(x)`` and ``bracket(x)`` keep printed parentheses and brackets, and
``op(x, y)`` stands for any operation x * y.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import sympy as sp

from gpbnb.report.ledger.dotted import DottedMatrix
from gpbnb.report.ledger.typesetting import number_latex, typeset

OPERATORS: dict[type[ast.cmpop], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
    ast.LtE: ("<=", operator.le),
    ast.Lt: ("<", operator.lt),
    ast.GtE: (">=", operator.ge),
    ast.Gt: (">", operator.gt),
    ast.Is: ("≈", operator.eq),
}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


class Undefined(ValueError):
    """A printed expression has no value, because an index has no quantity or operands do not fit."""


@dataclass(frozen=True)
class Link:
    """One comparison of a chain, ``left symbol right``, with both sides evaluated."""

    left: Any
    symbol: str
    right: Any


@lru_cache(maxsize=4096)
def _tree(text: str) -> ast.expr:
    tree = ast.parse(text, mode="eval").body
    lines = text.encode().splitlines()  # ast.get_source_segment splits the text anew for each node
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant):
            literal = lines[node.lineno - 1][node.col_offset : node.end_col_offset]
            node.literal = literal.decode()  # type: ignore[attr-defined]
    return tree


@lru_cache(maxsize=4096)
def _sides(relation: Relation) -> tuple[Relation, ...]:
    text, tree = relation.text.replace("≈", " is "), relation.tree
    nodes = (tree.left, *tree.comparators) if isinstance(tree, ast.Compare) else (tree,)
    return tuple(Relation(ast.get_source_segment(text, node) or "") for node in nodes)


@lru_cache(maxsize=4096)
def _latex(relation: Relation) -> str:
    return typeset(relation.tree, 0)


@dataclass(frozen=True)
class Relation:
    """A printed equation or inequality, as a chain of Python comparisons."""

    text: str

    @property
    def tree(self) -> ast.expr:
        """The syntax tree, which must not be changed; each number keeps its printed digits as ``literal``."""
        return _tree(self.text.replace("≈", " is "))

    @property
    def sides(self) -> tuple[Relation, ...]:
        """The sides of the chain, each as a relation without a comparison."""
        return _sides(self)

    @property
    def equates(self) -> bool:
        """Whether each comparison is = or ≈."""
        tree = self.tree
        return isinstance(tree, ast.Compare) and all(isinstance(op, ast.Eq | ast.Is) for op in tree.ops)

    def links(
        self, names: Mapping[str, Any] | None = None, number: Callable[[Fraction], Any] = sp.Rational
    ) -> tuple[Link, ...]:
        """Evaluate both sides of each comparison.

        Parameters
        ----------
        names : values of names, as in ``{"n": 3}``. Functions give the values of calls and of indexed names:
            ``{"a": lambda i, j: ...}`` defines ``a[i, j]``. ``{"T": f, "inv": g}`` replace the attributes ``.T`` and
            ``.inv``; ``{"matrix": f}`` makes a matrix of a list in brackets. A name that is missing becomes a SymPy
            symbol, an indexed name the symbol ``a[i,j]``, and a call a SymPy function.
        number : function that converts the exact value of a printed number to another type; by default SymPy rationals.

        Returns
        -------
        links : one for each comparison; a part without a comparison has none.
        """
        tree = self.tree
        if not isinstance(tree, ast.Compare):
            return ()
        evaluate = _Evaluation(names or {}, number)
        sides = [evaluate(side) for side in (tree.left, *tree.comparators)]
        symbols = [OPERATORS[type(op)][0] for op in tree.ops]
        return tuple(Link(*link) for link in zip(sides[:-1], symbols, sides[1:], strict=True))

    def value(self, names: Mapping[str, Any] | None = None, number: Callable[[Fraction], Any] = sp.Rational) -> Any:
        """Evaluate the last side of the chain: the right side of an equation."""
        tree = self.tree
        return _Evaluation(names or {}, number)(tree.comparators[-1] if isinstance(tree, ast.Compare) else tree)

    def latex(self) -> str:
        """Typeset the relation."""
        return _latex(self)

    def markdown(self) -> str:
        """Typeset the relation as a formula in Markdown."""
        return f"${self.latex()}$"


def _terms(node: ast.expr) -> list[tuple[bool, ast.expr]]:
    """Return the terms of a sum, each with a flag that tells whether it is subtracted."""
    match node:
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return [*_terms(left), *_terms(right)]
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return [*_terms(left), *((not negative, term) for negative, term in _terms(right))]
    return [(False, node)]


@dataclass(frozen=True)
class Number:
    """A printed number: its label, its digits as printed, and its unit."""

    label: str
    literal: str
    unit: str = ""

    @property
    def value(self) -> Fraction:
        """The exact value of the printed digits."""
        return Fraction(self.literal)

    @property
    def text(self) -> str:
        """The number as the file of statements has it."""
        return f"{self.label}: {self.literal} {self.unit}".strip()

    def latex(self) -> str:
        """Typeset the digits and the unit."""
        unit = rf"\ \text{{{self.unit.replace(chr(37), chr(92) + chr(37))}}}" if self.unit else ""
        return number_latex(self.literal) + unit

    def markdown(self) -> str:
        """Typeset the number as a formula in Markdown."""
        return f"${self.latex()}$"


@dataclass(frozen=True)
class Words:
    """A claim in words: the document's phrase, and alternatives that it could have used."""

    label: str
    printed: str
    others: tuple[str, ...]

    @property
    def text(self) -> str:
        """The claim as the file of statements has it."""
        return f"{self.label}: {' | '.join((self.printed, *self.others))}"

    def markdown(self) -> str:
        """The claim as it is printed."""
        return self.printed


Part = Relation | Number | Words
_LABELLED = re.compile(r"\s*([A-Za-z][\w .()-]*?)\s*:\s*(.+?)\s*", re.DOTALL)
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?\d+/\d+)(?:\s+(\S.*))?")


def read(form: str) -> tuple[Part, ...]:
    """Read the parts of a form."""
    return tuple(_part(text.strip()) for text in form.split(";")) if form.strip() else ()


@lru_cache(maxsize=4096)
def _part(text: str) -> Part:
    labelled = _LABELLED.fullmatch(text)
    if labelled and "|" in labelled[2]:
        first, *others = (phrase.strip() for phrase in labelled[2].split("|"))
        if not first or not others or not all(others) or len({first, *others}) <= len(others):
            raise ValueError(f"got {text!r}; needed different phrases on the two sides of |")
        return Words(labelled[1], first, tuple(others))
    if labelled:
        number = _NUMBER.fullmatch(labelled[2])
        if not number:
            raise ValueError(
                f"got {labelled[2]!r} in {text!r}; needed a number with a unit, or words as 'label: this | that'"
            )
        return Number(labelled[1], number[1], number[2] or "")
    try:
        relation = Relation(text)
        relation.latex()
    except (SyntaxError, KeyError, TypeError) as error:
        raise ValueError(f"got {text!r}; needed a relation ({error})") from error
    return relation


# -- evaluation -----------------------------------------------------------------------------------

_fraction = lru_cache(maxsize=4096)(Fraction)


class _Evaluation:
    """Compute the value of an expression tree with the names given."""

    def __init__(self, names: Mapping[str, Any], number: Callable[[Fraction], Any]) -> None:
        self.names, self.number = names, number

    def __call__(self, node: ast.expr) -> Any:
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rights):
                sides = [self(side) for side in (left, *rights)]
                return all(OPERATORS[type(op)][1](a, b) for a, op, b in zip(sides[:-1], ops, sides[1:], strict=True))
            case ast.Constant(value=int() | float()):
                return self.number(_fraction(getattr(node, "literal", None) or ast.unparse(node)))
            case ast.Name(id=name):
                return self.names[name] if name in self.names else sp.Symbol(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return _apply(node, operator.neg, self(operand))
            case ast.BinOp(op=ast.Add() | ast.Sub()) if any(_is_dots(term) for _, term in _terms(node)):
                return self._dotted_sum(node)
            case ast.BinOp(left=left, op=op, right=right):
                return _apply(node, _BINARY[type(op)], self(left), self(right))
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                return self._indexed(node, name, index)
            case ast.Attribute(value=value, attr=attribute):
                inner = self(value)
                if attribute in self.names:
                    return self.names[attribute](inner)
                found = getattr(inner, attribute)
                return found() if callable(found) else found
            case ast.Call(func=ast.Name(id=name), args=arguments):
                if name in ("Sum", "Prod", "Int", "Max", "Largest") and name not in self.names:
                    return self._repeated(name, arguments)
                if name == "cases":
                    return self._cases(arguments)
                function = self.names.get(name) or _FUNCTIONS.get(name) or sp.Function(name)
                return _apply(node, function, *self._sequence(arguments))
            case ast.Call(func=ast.Subscript(value=ast.Name(id=name), slice=index), args=arguments):
                indices = self._indices(index)
                if name not in self.names:
                    return sp.Function(f"{name}[{','.join(map(str, indices))}]")(*map(self, arguments))
                return _apply(node, self.names[name], *indices, *map(self, arguments))
            case ast.List(elts=rows) | ast.Tuple(elts=rows):
                if any(isinstance(row, ast.List) for row in rows):
                    found = [
                        [self._cell(cell) for cell in row.elts] if isinstance(row, ast.List) else self(row)
                        for row in rows
                    ]
                    if any(cell is ... for row in found if isinstance(row, list) for cell in row):
                        return _apply(node, DottedMatrix, found)
                else:
                    found = self._sequence(rows)
                return self.names["matrix"](found) if "matrix" in self.names and isinstance(node, ast.List) else found
        raise ValueError(f"got {ast.unparse(node)}; needed an expression that can be evaluated")

    def _cell(self, node: ast.expr) -> Any:
        return ... if _is_dots(node) else self(node)

    def _sequence(self, nodes: list[ast.expr]) -> list[Any]:
        """Evaluate the members of a sequence; dots stand for the members between their neighbours."""
        found: list[Any] = []
        for i, node in enumerate(nodes):
            if not _is_dots(node):
                found.append(self(node))
            elif 0 < i < len(nodes) - 1:
                found += self._between(nodes[i - 1], nodes[i + 1])
            else:
                raise Undefined("got dots at the end of a sequence; needed a member on each side")
        return found

    def _between(self, left: ast.expr, right: ast.expr) -> list[Any]:
        """Evaluate the members between two, whose numbers change by one from each member to the next."""
        pairs = _differing(left, right)
        try:
            ends = [(int(self(a)), int(self(b))) for a, b in pairs]
        except (TypeError, ValueError) as error:
            raise Undefined(
                f"got {ast.unparse(left)}, ..., {ast.unparse(right)}; needed whole numbers that differ"
            ) from error
        distances = {abs(last - first) for first, last in ends}
        if len(distances) != 1:
            raise Undefined(
                f"got {ast.unparse(left)}, ..., {ast.unparse(right)}; needed numbers that all change by the same amount"
            )
        steps = [(last > first) - (last < first) for first, last in ends]
        found = []
        for k in range(1, distances.pop()):
            numbers = [
                ast.parse(str(first + k * step), mode="eval").body for (first, _), step in zip(ends, steps, strict=True)
            ]
            found.append(self(_replaced(left, {id(a): number for (a, _), number in zip(pairs, numbers, strict=True)})))
        return found

    def _dotted_sum(self, node: ast.expr) -> Any:
        terms = _terms(node)
        if any(negative for negative, _ in terms):
            raise Undefined(f"got {ast.unparse(node)}; needed dots between terms that are added")
        total, *others = self._sequence([term for _, term in terms])
        for each in others:
            total = _apply(node, operator.add, total, each)
        return total

    def _indices(self, index: ast.expr) -> list[Any]:
        return [self(i) for i in (index.elts if isinstance(index, ast.Tuple) else [index])]

    def _indexed(self, node: ast.expr, name: str, index: ast.expr) -> Any:
        indices = self._indices(index)
        found = self.names.get(name)
        if found is None:
            return sp.Symbol(f"{name}[{','.join(map(str, indices))}]")
        if callable(found):
            return _apply(node, found, *indices)
        return _apply(node, found.__getitem__, tuple(indices) if len(indices) > 1 else indices[0])

    def _repeated(self, name: str, arguments: list[ast.expr]) -> Any:
        term, bounds = arguments
        if not isinstance(bounds, ast.Tuple) or not isinstance(bounds.elts[0], ast.Name):
            raise ValueError(f"got {name} without a range; needed (index, first, last)")
        index, (first, last) = bounds.elts[0].id, map(self, bounds.elts[1:])
        if name != "Int" and getattr(first, "is_Integer", True) and getattr(last, "is_Integer", True):
            terms = [
                _Evaluation({**self.names, index: self.number(Fraction(i))}, self.number)(term)
                for i in range(int(first), int(last) + 1)
            ]
            if name in ("Max", "Largest"):
                return max(terms)
            total = self.number(Fraction(0 if name == "Sum" else 1))
            for each in terms:
                total = total + each if name == "Sum" else total * each
            return total
        if name in ("Max", "Largest"):
            raise ValueError(f"got {name} from {first} to {last}; needed whole numbers")
        inner = _Evaluation({**self.names, index: sp.Symbol(index, integer=name != "Int")}, self.number)(term)
        operation = {"Sum": sp.summation, "Prod": sp.product, "Int": sp.integrate}[name]
        return operation(inner, (sp.Symbol(index, integer=name != "Int"), first, last))

    def _cases(self, arguments: list[ast.expr]) -> Any:
        """Return the value of the only case whose condition holds."""
        values = [
            self(argument.elts[0])
            for argument in arguments
            if isinstance(argument, ast.Tuple) and self(argument.elts[1])
        ]
        if len(values) != 1:
            raise Undefined(f"got {len(values)} cases that hold; needed exactly one")
        return values[0]


def _is_dots(node: ast.expr) -> bool:
    return isinstance(node, ast.Constant) and node.value is Ellipsis


def _differing(left: ast.AST, right: ast.AST) -> list[tuple[ast.expr, ast.expr]]:
    """Return the parts of two expressions in which they differ, where they have the same structure otherwise."""
    if ast.dump(left) == ast.dump(right):
        return []
    if type(left) is not type(right) or isinstance(left, ast.Constant | ast.Name | ast.UnaryOp):
        return [(left, right)]  # type: ignore[list-item]
    found: list[tuple[ast.expr, ast.expr]] = []
    for a, b in zip(ast.iter_child_nodes(left), ast.iter_child_nodes(right), strict=False):
        found += _differing(a, b)
    return found


def _replaced(node: Any, others: Mapping[int, ast.expr]) -> Any:
    """Return a copy of a tree with other nodes in the places named by the ids of nodes."""
    if id(node) in others:
        return others[id(node)]
    if isinstance(node, list):
        return [_replaced(each, others) for each in node]
    if not isinstance(node, ast.AST):
        return node
    copy = type(node)(**{field: _replaced(value, others) for field, value in ast.iter_fields(node)})
    if hasattr(node, "literal"):
        copy.literal = node.literal  # type: ignore[attr-defined]
    return copy


def _apply(node: ast.expr, operation: Callable[..., Any], *operands: Any) -> Any:
    try:
        return operation(*operands)
    except (ArithmeticError, LookupError, TypeError, ValueError) as error:
        raise Undefined(f"got {ast.unparse(node)}, which has no value here: {error}") from error


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs, "sqrt": sp.sqrt, "exp": sp.exp, "sin": sp.sin, "cos": sp.cos, "group": lambda inside: inside,
}  # fmt: skip
