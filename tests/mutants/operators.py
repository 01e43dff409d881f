"""Faults that numerical code may hold, as operators of cosmic-ray.

Each operator changes one place of a module: a sign, a constant, a comparison, an index, a term, the order of two
arguments, a norm, or a label. Imports, annotations, decorators, docstrings and error messages stay as they are.
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple

from cosmic_ray.ast import get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Example, Operator

Node = Any

_SIGNS = {"+": "-", "-": "+", "*": "/", "/": "*", "//": "/", "**": "*"}
_COMPARISONS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
_REVERSED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_LOGIC = {"and": "or", "or": "and", "True": "False", "False": "True"}
#: Names that stand for one another's opposite: norms, extremes, directions of rounding, colours of a figure.
_OPPOSITES = {
    "max": "min",
    "maximum": "minimum",
    "argmax": "argmin",
    "ceil": "floor",
    "sum": "max",
    "mean": "median",
    "abs": "float",
    "sqrt": "abs",
    "sin": "cos",
    "any": "all",
    "column_sum_norm": "row_sum_norm",
    "NEAREST": "CHOP",
    "VALID": "REFUTED",
    "OBSERVED": "REFERENCE",
    "up": "down",
    "lower": "upper",
    "nextafter": "max",
}
_OPPOSITES |= {other: one for one, other in _OPPOSITES.items() if other not in ("abs", "float", "max")}


def untouched(node: Node) -> bool:
    """Whether a node belongs to what no operator changes."""
    child, parent = node, node.parent
    while parent is not None:
        kind = parent.type
        if kind in ("import_name", "import_from", "decorator", "decorators", "raise_stmt", "assert_stmt"):
            return True
        if kind == "annassign" and child is not parent.children[-1]:
            return True
        if kind == "annassign" and "=" not in [each.get_code().strip() for each in parent.children]:
            return True
        if kind == "param" and child is getattr(parent, "annotation", None):
            return True
        if kind == "tfpdef":
            return True
        # Whether sequences are as long as one another is a check of the code, not of its results.
        if kind == "argument" and parent.children[0].get_code().strip() == "strict":
            return True
        if kind == "funcdef" and child is parent.annotation:
            return True
        if kind == "if_stmt" and "TYPE_CHECKING" in parent.children[1].get_code():
            return True
        if kind == "expr_stmt" and parent.children[0].get_code().strip() in ("__all__", "__version__"):
            return True
        if kind == "classdef" and child.type in ("arglist", "name"):
            return True
        child, parent = parent, parent.parent
    return False


class _Each(Operator):
    """An operator whose changes of a node are listed by a function: each is a way to rewrite the node."""

    @abstractmethod
    def changes(self, node: Node) -> list[Callable[[], None]]: ...

    def mutation_positions(self, node: Node) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
        changes = self.changes(node)
        if changes and not untouched(node):
            for _ in changes:
                yield node.start_pos, node.end_pos

    def mutate(self, node: Node, index: int) -> Node:
        self.changes(node)[index]()
        return node


def _write(leaf: Node, value: str) -> Callable[[], None]:
    return lambda: setattr(leaf, "value", value)


class Sign(_Each):
    """Another arithmetic operator; a sign that is lost or gained."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type != "operator":
            return []
        if node.parent.type == "factor" and node.value in "+-":
            return [_write(node, {"-": "+", "+": "-"}[node.value])]
        if node.parent.type in ("arith_expr", "term", "power") and node.value in _SIGNS:
            return [_write(node, _SIGNS[node.value])]
        return []

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("x = a - b", "x = a + b"), Example("x = -a", "x = +a"), Example("x = a ** b", "x = a * b"))


def _indexing(node: Node) -> bool:
    inner = node
    while inner.parent is not None and inner.parent.type in ("subscript", "subscriptlist", "factor", "arith_expr"):
        inner = inner.parent
    parent = inner.parent
    return parent is not None and parent.type == "trailer" and parent.children[0].value == "["


def _numbers(node: Node) -> list[Callable[[], None]]:
    text = node.value
    if re.fullmatch(r"\d+", text):
        value = int(text)
        return [_write(node, str(value + 1)), *([_write(node, str(value - 1))] if value else [])]
    if re.fullmatch(r"[\d.]+(e[-+]?\d+)?", text):
        value = float(text)
        return [_write(node, repr(2 * value if value else 1.0)), _write(node, repr(value + 1))]
    return []


class Constant(_Each):
    """Another number."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        return [] if node.type != "number" or _indexing(node) else _numbers(node)

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return Example("x = 2", "x = 3"), Example("x = 2", "x = 1", 1), Example("x = 0.5", "x = 1.0")


class Index(_Each):
    """The neighbour in a subscript or a slice."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        return _numbers(node) if node.type == "number" and _indexing(node) else []

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return Example("x = a[1]", "x = a[2]"), Example("x = a[1:]", "x = a[0:]", 1)


class Comparison(_Each):
    """A bound that is in rather than out, or the other direction."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type != "operator" or node.parent.type != "comparison":
            return []
        return [_write(node, table[node.value]) for table in (_COMPARISONS, _REVERSED) if node.value in table]

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return Example("x = a < b", "x = a <= b"), Example("x = a < b", "x = a > b", 1)


class Logic(_Each):
    """`or` for `and`, False for True, a condition that is dropped or reversed."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type == "keyword" and node.value in _LOGIC:
            return [_write(node, _LOGIC[node.value])]
        if node.type == "keyword" and node.value == "not" and node.parent.type == "not_test":
            return [_write(node, "")]
        return []

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return Example("x = a and b", "x = a or b"), Example("x = True", "x = False")


def _without(node: Node, place: int) -> Callable[[], None]:
    def drop() -> None:
        if place:
            node.children = node.children[: place - 1] + node.children[place + 1 :]
        else:
            prefix = node.children[0].get_first_leaf().prefix
            keep = 1 if node.children[1].value == "-" else 2
            node.children = node.children[keep:]
            node.children[0].get_first_leaf().prefix = prefix

    return drop


class Term(_Each):
    """A term of a sum or a factor of a product that is dropped."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type == "arith_expr":
            return [_without(node, place) for place in range(0, len(node.children), 2)]
        if node.type == "term":
            operators = [child.value for child in node.children[1::2]]
            places = [0] if operators[0] in ("*", "@") else []
            return [_without(node, place) for place in [*places, *range(2, len(node.children), 2)]]
        return []

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (
            Example("x = a + b - c", "x = b - c"),
            Example("x = a + b - c", "x = a - c", 1),
            Example("x = a * b", "x = a", 1),
        )


class Argument(_Each):
    """Two neighbouring positional arguments in the wrong order."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type != "arglist":
            return []
        plain = [i for i, child in enumerate(node.children) if child.type not in ("argument", "operator")]
        pairs = [(i, j) for i, j in pairwise(plain) if j == i + 2]
        return [
            self._swap(node, i, j)
            for i, j in pairs
            if node.children[i].get_code().strip() != node.children[j].get_code().strip()
        ]

    @staticmethod
    def _swap(node: Node, i: int, j: int) -> Callable[[], None]:
        def swap() -> None:
            one, other = node.children[i].get_first_leaf(), node.children[j].get_first_leaf()
            one.prefix, other.prefix = other.prefix, one.prefix
            node.children[i], node.children[j] = node.children[j], node.children[i]

        return swap

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example("x = f(a, b)", "x = f(b, a)"),)


class Norm(_Each):
    """The opposite of an extreme, a norm, a direction of rounding or a colour."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type != "name" or node.value not in _OPPOSITES or node.parent.type in ("param", "funcdef", "argument"):
            return []
        following = node.get_next_leaf()
        called = following is not None and following.value == "("
        if node.value.isupper() or called:
            return [_write(node, _OPPOSITES[node.value])]
        return []

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return Example("x = max(a)", "x = min(a)"), Example("c = VALID", "c = REFUTED")


def _strings(scope: Node) -> Iterator[Node]:
    for child in getattr(scope, "children", ()):
        if child.type == "string":
            documentation = child.parent.type in ("simple_stmt", "file_input") or (
                child.parent.type == "strings" and child.parent.parent.type == "simple_stmt"
            )
            if not documentation:
                yield child
        elif child.type not in ("funcdef", "classdef"):
            yield from _strings(child)


class Label(_Each):
    """A string that changes places with the next one of the same function."""

    def changes(self, node: Node) -> list[Callable[[], None]]:
        if node.type != "string":
            return []
        scope = node.parent
        while scope.type not in ("funcdef", "file_input"):
            scope = scope.parent
        found = [each for each in _strings(scope) if not untouched(each)]
        places = [i for i, each in enumerate(found) if each is node]
        if not places or places[0] + 1 >= len(found) or found[places[0] + 1].value == node.value:
            return []
        other = found[places[0] + 1]

        def swap() -> None:
            node.value, other.value = other.value, node.value

        return [swap]

    @classmethod
    def examples(cls) -> tuple[Example, ...]:
        return (Example('x = f("a", "b")', 'x = f("b", "a")'),)


OPERATORS: dict[str, type[_Each]] = {
    each.__name__.lower(): each for each in (Sign, Constant, Index, Comparison, Logic, Term, Argument, Norm, Label)
}


class Mutant(NamedTuple):
    """One change of one file."""

    operator: str
    occurrence: int
    line: int


def mutants(source: str) -> list[Mutant]:
    """List all changes of a source."""
    found, tree = [], get_ast(source)
    for name, operator_class in OPERATORS.items():
        operator, count = operator_class(), 0
        stack = [tree]
        while stack:
            node = stack.pop()
            for start, _ in operator.mutation_positions(node):
                found.append(Mutant(name, count, start[0]))
                count += 1
            stack += reversed(getattr(node, "children", ()))
    return found


def mutated(source: str, mutant: Mutant) -> str | None:
    """Apply a change to a source; None if there is no such place."""
    return mutate_code(source, OPERATORS[mutant.operator](), mutant.occurrence)
