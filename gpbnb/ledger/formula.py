r"""The machine-readable form of a printed statement: read, evaluated and typeset.

A form is one or more parts, separated by semicolons. Each part is one of:

- a relation: a chain of Python comparisons, as in ``abs(Q_tilde/Q) <= (n + m + 1)*beta``;
- a number: ``label: literal unit``, as in ``total: 1.253 mas``; the literal keeps its digits, the unit is optional;
- words: ``label: printed phrase | another phrase | ...``; the first phrase is what the document says, and the others
  are what it could have said instead.

In a relation a name is a symbol; ``x_hat_k`` is typeset as :math:`\hat x_k`; ``P[k-1]`` has an index; ``A.T`` and
``A.inv`` are a transpose and an inverse; ``Sum(term, (j, 2, n))``, ``Prod``, ``Int``, ``norm``, ``abs``, ``sqrt``,
``diff`` and ``approx(a, b)`` are typeset as mathematics; any other call is a function. ``...`` stands for the dots of a
printed sequence; a part that contains it can be typeset but not evaluated. The name ``dots`` stands for the terms that
a printed series leaves out; a check gives it a value, such as ``sp.O(mu**4)``.

``a ≈ b`` is a comparison like ``==``; the check decides how close is close enough.
``cases((a, v < 0), (b, v >= 0))`` is a value by cases. ``Max(term, (j, 1, n))`` prints the maximum over j, and
``Largest`` prints the same as a subscript. ``group(x)`` and ``bracket(x)`` keep printed parentheses and brackets, and
``op(x, y)`` stands for any operation x * y.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.alphabets import greeks

OPERATORS: dict[type[ast.cmpop], tuple[str, str, Callable[[Any, Any], Any]]] = {
    ast.Eq: ("==", "=", operator.eq),
    ast.NotEq: ("!=", r"\ne ", operator.ne),
    ast.LtE: ("<=", r"\le ", operator.le),
    ast.Lt: ("<", "<", operator.lt),
    ast.GtE: (">=", r"\ge ", operator.ge),
    ast.Gt: (">", ">", operator.gt),
    ast.Is: ("≈", r"\approx ", operator.eq),
}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.MatMult: operator.matmul,
}


@dataclass(frozen=True)
class Link:
    """One comparison of a chain: ``left symbol right``, both sides evaluated."""

    left: Any
    symbol: str
    right: Any

    @property
    def holds(self) -> bool:
        """Whether the comparison holds exactly; matrices are compared entry by entry.

        Raises
        ------
        ValueError : the symbol is ``≈``; the check must say how close is close enough.
        """
        if self.symbol == "≈":
            raise ValueError(f"{self.left} ≈ {self.right}: compare the two sides of ≈ in the check")
        left, right = self.left, self.right
        if self.symbol == "==" and isinstance(left, sp.Basic | sp.MatrixBase):
            difference = left - right
            zero = sp.simplify(difference)
            return bool(zero.is_zero_matrix if isinstance(zero, sp.MatrixBase) else zero == 0)
        compare = next(function for symbol, _, function in OPERATORS.values() if symbol == self.symbol)
        return bool(np.all(compare(left, right)))


@dataclass(frozen=True)
class Relation:
    """A printed equation or inequality, as a chain of Python comparisons."""

    text: str

    @property
    def tree(self) -> ast.expr:
        """The syntax tree; each number keeps its printed digits as ``literal``."""
        text = self.text.replace("≈", " is ")
        tree = ast.parse(text, mode="eval").body
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant):
                node.literal = ast.get_source_segment(text, node)  # type: ignore[attr-defined]
        return tree

    @property
    def sides(self) -> tuple[Relation, ...]:
        """The sides of the chain, each as a relation without a comparison."""
        text, tree = self.text.replace("≈", " is "), self.tree
        nodes = (tree.left, *tree.comparators) if isinstance(tree, ast.Compare) else (tree,)
        return tuple(Relation(ast.get_source_segment(text, node) or "") for node in nodes)

    def terms(
        self, names: Mapping[str, Any] | None = None, number: Callable[[Fraction], Any] = sp.Rational
    ) -> tuple[Any, ...]:
        """Evaluate each term of the last side: ``x == a - b`` has the terms a and -b."""
        tree = self.tree
        evaluate = _Evaluation(names or {}, number)
        return tuple(
            -evaluate(term) if negative else evaluate(term)
            for negative, term in _terms(tree.comparators[-1] if isinstance(tree, ast.Compare) else tree)
        )

    def links(
        self, names: Mapping[str, Any] | None = None, number: Callable[[Fraction], Any] = sp.Rational
    ) -> tuple[Link, ...]:
        """Evaluate both sides of each comparison.

        Parameters
        ----------
        names : values of names, as in ``{"n": 3}``; functions for calls and for indices:
            ``{"a": lambda i, j: ...}`` gives ``a[i, j]``. ``{"T": f, "inv": g}`` replace the attributes ``.T`` and
            ``.inv``; ``{"matrix": f}`` makes a matrix of a list in brackets. A name that is missing becomes a SymPy
            symbol, an indexed name the symbol ``a[i,j]``, and a call a SymPy function.
        number : turns the exact value of a printed number into the arithmetic wanted; SymPy rationals by default.

        Returns
        -------
        links : one a comparison; a part without a comparison has none.
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
        return _typeset(self.tree, 0)

    def markdown(self) -> str:
        return f"${self.latex()}$"


def _terms(node: ast.expr) -> list[tuple[bool, ast.expr]]:
    """The terms of a sum, each with whether it is subtracted."""
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
        return f"{self.label}: {self.literal} {self.unit}".strip()

    def latex(self) -> str:
        unit = rf"\ \text{{{self.unit}}}" if self.unit else ""
        return number_latex(self.literal) + unit

    def markdown(self) -> str:
        return f"${self.latex()}$"


@dataclass(frozen=True)
class Words:
    """A claim in words: what the document says, and what it could have said instead."""

    label: str
    printed: str
    others: tuple[str, ...]

    @property
    def text(self) -> str:
        return f"{self.label}: {' | '.join((self.printed, *self.others))}"

    def markdown(self) -> str:
        return self.printed


Part = Relation | Number | Words
_LABELLED = re.compile(r"\s*([A-Za-z][\w .()-]*?)\s*:\s*(.+?)\s*", re.DOTALL)
_NUMBER = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?\d+/\d+)(?:\s+(\S.*))?")


def read(form: str) -> tuple[Part, ...]:
    """Read the parts of a form.

    Raises
    ------
    ValueError : a part is neither a relation nor a number nor words with an alternative.
    """
    return tuple(_part(text.strip()) for text in form.split(";")) if form.strip() else ()


def _part(text: str) -> Part:
    labelled = _LABELLED.fullmatch(text)
    if labelled and "|" in labelled[2]:
        first, *others = (phrase.strip() for phrase in labelled[2].split("|"))
        if not first or not others or not all(others) or len({first, *others}) <= len(others):
            raise ValueError(f"{text!r} needs different phrases on both sides of |")
        return Words(labelled[1], first, tuple(others))
    if labelled:
        number = _NUMBER.fullmatch(labelled[2])
        if not number:
            raise ValueError(
                f"{text!r}: {labelled[2]!r} is not a number with a unit; write words as 'label: this | that'"
            )
        return Number(labelled[1], number[1], number[2] or "")
    try:
        relation = Relation(text)
        _typeset(relation.tree, 0)
    except (SyntaxError, KeyError, TypeError) as error:
        raise ValueError(f"{text!r} is not a relation ({error})") from error
    return relation


# -- evaluation -----------------------------------------------------------------------------------


class _Evaluation:
    """Compute the value of an expression tree with the names given."""

    def __init__(self, names: Mapping[str, Any], number: Callable[[Fraction], Any]) -> None:
        self.names, self.number = names, number

    def __call__(self, node: ast.expr) -> Any:
        match node:
            case ast.Compare(left=left, ops=ops, comparators=rights):
                sides = [self(side) for side in (left, *rights)]
                return all(OPERATORS[type(op)][2](a, b) for a, op, b in zip(sides[:-1], ops, sides[1:], strict=True))
            case ast.Constant(value=int() | float()):
                return self.number(Fraction(getattr(node, "literal", None) or ast.unparse(node)))
            case ast.Name(id=name):
                return self.names[name] if name in self.names else sp.Symbol(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self(operand)
            case ast.BinOp(left=left, op=op, right=right):
                return _BINARY[type(op)](self(left), self(right))
            case ast.Subscript(value=ast.Name(id=name), slice=index):
                return self._indexed(name, index)
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
                return function(*map(self, arguments))
            case ast.Call(func=ast.Subscript(value=ast.Name(id=name), slice=index), args=arguments):
                return self.names[name](*self._indices(index), *map(self, arguments))
            case ast.List(elts=rows) | ast.Tuple(elts=rows):
                found = [[self(cell) for cell in row.elts] if isinstance(row, ast.List) else self(row) for row in rows]
                return self.names["matrix"](found) if "matrix" in self.names and isinstance(node, ast.List) else found
        raise ValueError(f"{ast.unparse(node)} cannot be evaluated")

    def _indices(self, index: ast.expr) -> list[Any]:
        return [self(i) for i in (index.elts if isinstance(index, ast.Tuple) else [index])]

    def _indexed(self, name: str, index: ast.expr) -> Any:
        indices = self._indices(index)
        found = self.names.get(name)
        if found is None:
            return sp.Symbol(f"{name}[{','.join(map(str, indices))}]")
        return found(*indices) if callable(found) else found[tuple(indices) if len(indices) > 1 else indices[0]]

    def _repeated(self, name: str, arguments: list[ast.expr]) -> Any:
        term, bounds = arguments
        if not isinstance(bounds, ast.Tuple) or not isinstance(bounds.elts[0], ast.Name):
            raise ValueError(f"{name} needs (index, first, last)")
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
            raise ValueError(f"{name} needs a range of numbers, got {first} to {last}")
        inner = _Evaluation({**self.names, index: sp.Symbol(index, integer=name != "Int")}, self.number)(term)
        operation = {"Sum": sp.summation, "Prod": sp.product, "Int": sp.integrate}[name]
        return operation(inner, (sp.Symbol(index, integer=name != "Int"), first, last))

    def _cases(self, arguments: list[ast.expr]) -> Any:
        """The value of the only case whose condition holds."""
        values = [
            self(argument.elts[0])
            for argument in arguments
            if isinstance(argument, ast.Tuple) and self(argument.elts[1])
        ]
        if len(values) != 1:
            raise ValueError(f"{len(values)} cases hold; exactly one is needed")
        return values[0]


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": abs, "sqrt": sp.sqrt, "exp": sp.exp, "log": sp.log, "sin": sp.sin, "cos": sp.cos, "tan": sp.tan,
    "max": sp.Max, "min": sp.Min, "diff": sp.diff, "group": lambda inside: inside,
}  # fmt: skip


# -- typesetting ----------------------------------------------------------------------------------

_GREEK = {name: name for small in greeks for name in (small, small.capitalize())} | {"lamda": "lambda"}
_ACCENTS = ("hat", "tilde", "bar", "dot", "ddot", "underline", "overline")
_NAMED = ("sin", "cos", "tan", "exp", "log", "ln", "max", "min", "dim")


def name_latex(name: str) -> str:
    r"""Typeset a name: ``x_hat_k`` as ``\hat x_{k}``, ``Deltaphi_2`` as ``\Delta \phi_{2}``."""
    base, *rest = name.rstrip("_").split("_")
    text = _base(base)
    subscripts = []
    for word in rest:
        if word in _ACCENTS:
            text = rf"\{word} {{{text}}}" if len(text) > 1 else rf"\{word} {text}"
        elif word == "prime":
            text += "'"
        elif word == "star":
            text += "^*"
        else:
            subscripts.append(_base(word))
    if subscripts:
        text += f"_{{{','.join(subscripts) if len(subscripts) > 1 else subscripts[0]}}}"
    return text


def number_latex(literal: str) -> str:
    r"""Typeset a number with its printed digits: ``.7654e3`` as ``.7654\times10^{3}``."""
    digits, _, exponent = literal.lower().partition("e")
    return digits + (rf"\times10^{{{int(exponent)}}}" if exponent else "")


def _base(word: str) -> str:
    if word in _GREEK:
        return rf"\{_GREEK[word]}"
    if word.lower().startswith("delta") and len(word) > len("delta"):
        return rf"\{word[: len('delta')]} {_base(word[len('delta') :])}"
    if word == "dots":
        return r"\cdots"
    if word == "degree":
        return r"^{\circ}"
    if word == "inf":
        return r"\infty"
    return rf"\text{{{word}}}" if len(word) > 2 and word.isalpha() else word


def _wrap(text: str, needed: bool) -> str:
    return rf"\left({text}\right)" if needed else text


def _typeset(node: ast.expr, level: int) -> str:
    """Typeset an expression; parentheses where its operator binds less tightly than `level`."""
    match node:
        case ast.Constant(value=value):
            return r"\cdots" if value is Ellipsis else number_latex(getattr(node, "literal", None) or ast.unparse(node))
        case ast.Name(id=name):
            return name_latex(name)
        case ast.Compare(left=left, ops=ops, comparators=rights):
            text = _typeset(left, 0)
            for op, right in zip(ops, rights, strict=True):
                text += OPERATORS[type(op)][1] + _typeset(right, 0)
            return text
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _wrap("-" + _typeset(operand, 2), level > 1)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            b = _typeset(right, 1)
            return _wrap(f"{_typeset(left, 1)}+{_wrap(b, b.startswith('-'))}", level > 1)
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return _wrap(f"{_typeset(left, 1)}-{_typeset(right, 2)}", level > 1)
        case ast.BinOp(left=left, op=ast.Mult() | ast.MatMult(), right=right):
            a, b = _typeset(left, 2), _typeset(right, 2)
            return _wrap(a + _times(a, b) + b, level > 3)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return rf"\frac{{{_typeset(left, 0)}}}{{{_typeset(right, 0)}}}"
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return f"{_typeset(left, 4)}^{{{_typeset(right, 0)}}}"
        case ast.Subscript(value=value, slice=index):
            return _with_index(_typeset(value, 4), index)
        case ast.Attribute(value=value, attr=attribute):
            return f"{_typeset(value, 4)}^{{{ {'T': 'T', 'inv': '-1'}[attribute] }}}"
        case ast.Call(func=function, args=arguments):
            return _call(function, arguments)
        case ast.List(elts=rows) if rows and all(isinstance(row, ast.List) for row in rows):
            lines = (" & ".join(_typeset(cell, 0) for cell in row.elts) for row in rows if isinstance(row, ast.List))
            return r"\begin{bmatrix}" + r" \\ ".join(lines) + r"\end{bmatrix}"
        case ast.List(elts=cells) | ast.Tuple(elts=cells):
            return rf"\left[{', '.join(_typeset(cell, 0) for cell in cells)}\right]"
    raise TypeError(f"{ast.unparse(node)} cannot be typeset")


def _times(a: str, b: str) -> str:
    """What stands between two factors."""
    if b[:1].isdigit() or b[:1] == ".":
        return r"\times "
    return r"\," if a[-1:].isalpha() and b[:1].isalpha() else ""


def _with_index(base: str, index: ast.expr) -> str:
    indices = index.elts if isinstance(index, ast.Tuple) else [index]
    texts = [_typeset(i, 0) for i in indices]
    joined = "".join(texts) if all(len(t) == 1 for t in texts) else ",".join(texts)
    stem = re.fullmatch(r"(.*)_\{([^{}]*)\}", base)
    return f"{stem[1]}_{{{stem[2]},{joined}}}" if stem else f"{base}_{{{joined}}}"


def _call(function: ast.expr, arguments: list[ast.expr]) -> str:
    name = function.id if isinstance(function, ast.Name) else ""
    if name == "cases":
        lines = [[_typeset(e, 0) for e in a.elts] for a in arguments if isinstance(a, ast.Tuple)]
        return (
            r"\begin{cases}"
            + r" \\ ".join(rf"{value} & \text{{if }} {where}" for value, where in lines)
            + r"\end{cases}"
        )
    if name in ("Sum", "Prod", "Int", "Max", "Largest") and len(arguments) == 2 and isinstance(arguments[1], ast.Tuple):
        term, bounds = _typeset(arguments[0], 2), [_typeset(b, 0) for b in arguments[1].elts]
        if name == "Max":
            return rf"\max_{{{bounds[0]}}}{term}"
        if name == "Largest":
            return rf"{term}_{{\max}}"
        if name == "Int":
            return rf"\int_{{{bounds[1]}}}^{{{bounds[2]}}}{term}\,d{bounds[0]}"
        return rf"\{'sum' if name == 'Sum' else 'prod'}_{{{bounds[0]}={bounds[1]}}}^{{{bounds[2]}}}{term}"
    inside = [_typeset(argument, 0) for argument in arguments]
    match name, inside:
        case "norm", [x]:
            return rf"\left\|{x}\right\|"
        case "abs", [x]:
            return rf"\left|{x}\right|"
        case "group", [x]:
            return rf"\left({x}\right)"
        case "bracket", [x]:
            return rf"\left[{x}\right]"
        case "op", [x, y]:
            return f"{x}*{y}"
        case "sqrt", [x]:
            return rf"\sqrt{{{x}}}"
        case "approx", [a, b]:
            return rf"{a}\approx {b}"
        case "diff", [f, x]:
            return rf"\frac{{d}}{{d{x}}}{f}"
        case "exp", [x]:
            return f"e^{{{x}}}"
    if name in _NAMED:
        return rf"\{name}\left({', '.join(inside)}\right)"
    return rf"{_typeset(function, 4)}\left({', '.join(inside)}\right)"
