"""Alter the machine-readable form of a statement: each result says something else than the document."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from functools import cache, lru_cache

from gpbnb.report.ledger.formula import Number, Part, Relation, Words
from gpbnb.report.ledger.statements import Statement

COMPARISON = "comparison"
"""Begins the name of an alteration that exchanges = with ≠, ≤ with <, or makes an inequality an equation."""
_OTHER = {ast.Eq: ast.NotEq, ast.NotEq: ast.Eq, ast.LtE: ast.Eq, ast.GtE: ast.Eq, ast.Lt: ast.Eq, ast.Gt: ast.Eq}
_STRICT = {ast.LtE: ast.Lt, ast.Lt: ast.LtE, ast.GtE: ast.Gt, ast.Gt: ast.GtE}
_OPPOSITE = {ast.LtE: ast.GtE, ast.GtE: ast.LtE, ast.Lt: ast.GtE, ast.Gt: ast.LtE}


def altered(statement: Statement) -> Iterator[tuple[str, Statement]]:
    """Name every alteration of a statement, and make it."""
    forms = [part.text for part in statement.parts]
    for i, part in enumerate(statement.parts):
        for name, text in _every(part):
            yield f"{i + 1} {name}", replace(statement, form="; ".join([*forms[:i], text, *forms[i + 1 :]]))


@cache
def _every(part: Part) -> tuple[tuple[str, str], ...]:
    return tuple(_of_part(part))


def _of_part(part: Part) -> Iterator[tuple[str, str]]:
    match part:
        case Words():
            for other in part.others:
                yield f"says {other!r}", f"{part.label}: {other} | {part.printed}"
        case Number():
            for name, literal in _of_literal(part.literal):
                yield name, replace(part, literal=literal).text
        case Relation():
            yield from _of_relation(part)


def _of_literal(literal: str) -> Iterator[tuple[str, str]]:
    if "/" in literal:
        value = Fraction(literal)
        yield "numerator", f"{value.numerator + 1}/{value.denominator}"
        yield "denominator", f"{value.numerator}/{value.denominator + 1}"
        yield "sign", f"{-value.numerator}/{value.denominator}"
        return
    digits, mark, exponent = literal.lower().partition("e")
    last = max(i for i, character in enumerate(digits) if character.isdigit())
    changed = str((int(digits[last]) + 1) % 10)
    yield "last digit", digits[:last] + changed + digits[last + 1 :] + mark + exponent
    yield "power of ten", f"{digits}e{int(exponent or 0) + 1}"
    yield "sign", literal[1:] if literal.startswith("-") else f"-{literal.lstrip('+')}"


def _of_relation(relation: Relation) -> Iterator[tuple[str, str]]:
    """The usual alterations; where they are few, dropped factors and the opposite sign as well."""
    usual = dict(_usual(relation))
    yield from usual.items()
    if sum(COMPARISON not in name for name in usual) < 3:
        tree = relation.tree
        for k, node in enumerate(ast.walk(tree)):
            if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
                yield f"dropped factor at {k}", _with(tree, node, node.left)
        if "twice the last side" in usual and isinstance(tree, ast.Compare):
            last = tree.comparators[-1]
            yield "minus the last side", _with(tree, last, ast.UnaryOp(ast.USub(), last))


def _usual(relation: Relation) -> Iterator[tuple[str, str]]:
    """Signs, coefficients, exponents, indices, dropped terms, digits, and the direction of an inequality."""
    tree = relation.tree
    seen = {ast.unparse(tree)}
    for k, node in enumerate(ast.walk(tree)):
        for name, change in _of_node(node):
            text = _with(tree, node, change)
            if text not in seen:
                seen.add(text)
                yield f"{name} at {k}", text
    if isinstance(tree, ast.Compare) and ast.unparse(last := tree.comparators[-1]) != "0":
        yield "twice the last side", _with(tree, last, ast.BinOp(ast.Constant(2), ast.Mult(), last))


def _of_node(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    match node:
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            yield "sign", ast.BinOp(left, ast.Sub(), right)
            yield "dropped term", left
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            yield "sign", ast.BinOp(left, ast.Add(), right)
            yield "dropped term", left
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            yield "exponent", ast.BinOp(left, ast.Pow(), ast.BinOp(right, ast.Add(), ast.Constant(1)))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            yield "sign", operand
        case ast.Constant(value=int() | float()):
            literal = getattr(node, "literal", None) or repr(node.value)
            name, text = next(_of_literal(literal))
            yield f"coefficient, {name}", ast.parse(text, mode="eval").body
        case ast.Subscript(value=value, slice=index) if not isinstance(index, ast.Tuple):
            yield "index", ast.Subscript(value, ast.BinOp(index, ast.Add(), ast.Constant(1)), ast.Load())
            yield "lower index", ast.Subscript(value, ast.BinOp(index, ast.Sub(), ast.Constant(1)), ast.Load())
        case ast.Subscript(value=value, slice=ast.Tuple(elts=indices)):
            for i, index in enumerate(indices):
                moved = [*indices[:i], ast.BinOp(index, ast.Add(), ast.Constant(1)), *indices[i + 1 :]]
                yield f"index {i + 1}", ast.Subscript(value, ast.Tuple(moved, ast.Load()), ast.Load())
        case ast.Call(func=ast.Name(id="sin" | "cos" as name), args=arguments):
            yield "function", ast.Call(ast.Name("cos" if name == "sin" else "sin", ast.Load()), arguments, [])
        case ast.Compare(left=left, ops=ops, comparators=rights):
            for i, op in enumerate(ops):
                place = "" if i == 0 else f" {i + 1}"
                for name, others in (
                    ("direction", _OPPOSITE),
                    (COMPARISON, _OTHER),
                    (f"{COMPARISON}, strict", _STRICT),
                ):
                    if type(op) in others:
                        other = others[type(op)]()
                        yield f"{name}{place}", ast.Compare(left, [*ops[:i], other, *ops[i + 1 :]], rights)


def _with(tree: ast.AST, place: ast.AST, new: ast.AST) -> str:
    """The text of a tree with another node in one place; the tree itself stays as it is."""
    if tree is place:
        return ast.unparse(new)
    parent, field = _parents(tree)[place]
    value = getattr(parent, field)
    setattr(parent, field, [new if item is place else item for item in value] if isinstance(value, list) else new)
    try:
        return ast.unparse(tree)
    finally:
        setattr(parent, field, value)


@lru_cache(maxsize=64)
def _parents(tree: ast.AST) -> dict[ast.AST, tuple[ast.AST, str]]:
    """The parent of each node, and the field of the parent that holds the node."""
    return {
        node: (parent, field)
        for parent in ast.walk(tree)
        for field, value in ast.iter_fields(parent)
        for node in (value if isinstance(value, list) else [value])
        if isinstance(node, ast.AST)
    }
