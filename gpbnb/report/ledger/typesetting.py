"""Typeset the machine-readable form of a printed statement in LaTeX."""

from __future__ import annotations

import ast
import re

from sympy.core.alphabets import greeks

_SIGNS: dict[type[ast.cmpop], str] = {
    ast.Eq: "=",
    ast.NotEq: r"\ne ",
    ast.LtE: r"\le ",
    ast.Lt: "<",
    ast.GtE: r"\ge ",
    ast.Gt: ">",
    ast.Is: r"\approx ",
}

_GREEK = {name: name for small in greeks for name in (small, small.capitalize())} | {"lamda": "lambda"}
_ACCENTS = ("hat", "tilde", "dot", "underline")
_TEMPLATES = {
    ("Sum", 1): r"\sum %s",
    ("Max", 1): r"\max %s",
    ("pm", 1): r"\left(\pm %s\right)",
    ("norm", 1): r"\left\|%s\right\|",
    ("abs", 1): r"\left|%s\right|",
    ("group", 1): r"\left(%s\right)",
    ("bracket", 1): r"\left[%s\right]",
    ("mark", 2): r"\underbrace{%s}_{\text{(%s)}}",
    ("op", 2): "%s*%s",
    ("sqrt", 1): r"\sqrt{%s}",
    ("exp", 1): "e^{%s}",
}
"""How calls with so many arguments are typeset."""
_NAMED = ("sin", "cos")


def name_latex(name: str) -> str:
    r"""Typeset a name: ``x_hat_k`` as ``\hat x_{k}``, ``Deltaphi_2`` as ``\Delta \phi_{2}``."""
    base, *rest = name.rstrip("_").split("_")
    text = _base(base)
    subscripts = []
    for word in rest:
        if word in _ACCENTS:
            text = rf"\{word} {{{text}}}" if len(text) > 1 else rf"\{word} {text}"
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


def typeset(node: ast.expr, level: int) -> str:
    """Typeset an expression, in parentheses if its operator binds less tightly than `level`."""
    match node:
        case ast.Constant(value=value):
            return r"\cdots" if value is Ellipsis else number_latex(getattr(node, "literal", None) or ast.unparse(node))
        case ast.Name(id=name):
            return name_latex(name)
        case ast.Compare(left=left, ops=ops, comparators=rights):
            text = typeset(left, 0)
            for op, right in zip(ops, rights, strict=True):
                text += _SIGNS[type(op)] + typeset(right, 0)
            return text
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _wrap("-" + typeset(operand, 2), level > 1)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            b = typeset(right, 1)
            return _wrap(f"{typeset(left, 1)}+{_wrap(b, b.startswith('-'))}", level > 1)
        case ast.BinOp(left=left, op=ast.Sub(), right=right):
            return _wrap(f"{typeset(left, 1)}-{typeset(right, 2)}", level > 1)
        case ast.BinOp(op=ast.Mult()) if positive := _without_minus(node):
            return _wrap("-" + typeset(positive, 2), level > 1)
        case ast.BinOp(left=left, op=ast.Mult(), right=right):
            a, b = typeset(left, 2), typeset(right, 2)
            return _wrap(a + _times(a, b) + b, level > 3)
        case ast.BinOp(left=left, op=ast.Div(), right=right):
            return rf"\frac{{{typeset(left, 0)}}}{{{typeset(right, 0)}}}"
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return f"{typeset(left, 4)}^{{{typeset(right, 0)}}}"
        case ast.Subscript(value=value, slice=index):
            return _with_index(typeset(value, 4), index)
        case ast.Attribute(value=value, attr=attribute):
            return f"{typeset(value, 4)}^{{{ {'T': 'T', 'inv': '-1'}[attribute] }}}"
        case ast.Call(func=function, args=arguments):
            return _call(function, arguments)
        case ast.List(elts=rows) if rows and all(isinstance(row, ast.List) for row in rows):
            lines = (" & ".join(typeset(cell, 0) for cell in row.elts) for row in rows if isinstance(row, ast.List))
            return r"\begin{bmatrix}" + r" \\ ".join(lines) + r"\end{bmatrix}"
        case ast.List(elts=cells) | ast.Tuple(elts=cells):
            return rf"\left[{', '.join(typeset(cell, 0) for cell in cells)}\right]"
    raise TypeError(f"got {ast.unparse(node)}; needed an expression that can be typeset")


def _without_minus(node: ast.expr) -> ast.expr | None:
    """Return the product without the minus sign of its first factor; None if that factor has none."""
    match node:
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return operand
        case ast.BinOp(left=left, op=ast.Mult() as op, right=right) if first := _without_minus(left):
            return ast.BinOp(first, op, right)
    return None


def _times(a: str, b: str) -> str:
    """Return the symbol between two factors."""
    if b[:1].isdigit() or b[:1] == ".":
        return r"\times "
    return r"\," if a[-1:].isalpha() and b[:1].isalpha() else ""


def _with_index(base: str, index: ast.expr) -> str:
    indices = index.elts if isinstance(index, ast.Tuple) else [index]
    texts = [typeset(i, 0) for i in indices]
    joined = "".join(texts) if all(len(t) == 1 for t in texts) else ",".join(texts)
    stem = re.fullmatch(r"(.*)_\{([^{}]*)\}", base)
    return f"{stem[1]}_{{{stem[2]},{joined}}}" if stem else f"{base}_{{{joined}}}"


def _call(function: ast.expr, arguments: list[ast.expr]) -> str:
    name = function.id if isinstance(function, ast.Name) else ""
    if name == "cases":
        lines = [[typeset(e, 0) for e in a.elts] for a in arguments if isinstance(a, ast.Tuple)]
        return (
            r"\begin{cases}"
            + r" \\ ".join(rf"{value} & \text{{if }} {where}" for value, where in lines)
            + r"\end{cases}"
        )
    if name in ("Sum", "Prod", "Int", "Max", "Largest") and len(arguments) == 2 and isinstance(arguments[1], ast.Tuple):
        term, bounds = typeset(arguments[0], 2), [typeset(b, 0) for b in arguments[1].elts]
        if name == "Max":
            return rf"\max_{{{bounds[0]}}}{term}"
        if name == "Largest":
            return rf"{term}_{{\max}}"
        if name == "Int":
            return rf"\int_{{{bounds[1]}}}^{{{bounds[2]}}}{term}\,d{bounds[0]}"
        return rf"\{'sum' if name == 'Sum' else 'prod'}_{{{bounds[0]}={bounds[1]}}}^{{{bounds[2]}}}{term}"
    inside = [typeset(argument, 0) for argument in arguments]
    if (name, len(inside)) in _TEMPLATES:
        return _TEMPLATES[name, len(inside)] % tuple(inside)
    if name == "digits":
        return f".{''.join(inside)}"
    if name in _NAMED:
        return rf"\{name}\left({', '.join(inside)}\right)"
    return rf"{typeset(function, 4)}\left({', '.join(inside)}\right)"
