"""The main result of the report of 1984, bound (125), as printed above its correction."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from copy import deepcopy
from fractions import Fraction
from typing import Any

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.report.gravity_probe_b import answers, horizon, summary
from gpbnb.report.kalman import report_bounds
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.html import Html, chapter, typeset
from gpbnb.report.ledger.page import address
from gpbnb.report.ledger.statements import Statement, statement
from gpbnb.report.ledger.typesetting import typeset as typeset_tree

RESULT = "hung1984.II.eq125"
PRINTED = {"k*(7*n+3*m+6)": "a", "k*(3*n+1)": "a", "k*(k-1)/2*(7*n+3*m+6)": "a", "B": "b"}
CORRECTED = {"e": "a", "F**i": "b"}
"""Parts of the two formulas that differ; equal letters stand for what takes the place of what."""


def marked(relation: Relation, marks: Mapping[str, str]) -> str:
    """Typeset a relation with braces and letters under some of its parts.

    Parameters
    ----------
    relation : a printed or corrected relation.
    marks : part, in the notation of :mod:`gpbnb.report.ledger.formula` → letter.
    """
    marking = _Marking({ast.unparse(ast.parse(part, mode="eval").body): letter for part, letter in marks.items()})
    latex = typeset_tree(marking.visit(deepcopy(relation.tree)), 0)
    if missing := marking.letters.keys() - marking.found:
        raise ValueError(f"got the parts {sorted(missing)}; needed parts of {relation.text}")
    return latex


def changes() -> tuple[str, str]:
    """Say what each letter means and what the change does to the digits, as prose with formulas."""
    digits = report_bounds.written_changes(report_bounds.example_digits(Fraction(1, summary.DRIFT)))
    change = {name: step for name, (_, step) in digits.items()}
    year = answers.decimal_digits(FloatFormat(2, answers.fewest_bits()))
    bits = {row.states: horizon.bits(row) for row in horizon.load()}  # of the last row, for the whole year
    every = answers.decimal_digits(FloatFormat(2, bits["absolute"]))
    return (
        "The report counts roundings, as if the error of a step were in proportion to its result. The correction takes "
        "$e$, the error that a step really adds, which cancellation can make larger than any count. For 1 mas after a "
        f"year, (125) demands {digits['1 mas in place of the drift'][0]} decimal digits. Better counting changes this "
        f"by {change['roundings counted once']} if each rounding is counted once, by "
        f"{change['errors of either sign']} with errors of either sign, and by "
        f"{change['covariance errors carried on']} with the errors of the covariance carried on. With all "
        f"three, (125) demands {digits['covariance errors carried on'][0]} digits. Even then it is not a bound.",
        "In (125), $B$ bounds every input, however many steps ago it entered, so nothing is forgotten. The correction "
        "multiplies an error made $i$ steps ago by $F^i$. If $F<1$, the filter forgets it, and the sum stays below a "
        f"limit. If row sums exceed 1, the sum grows without limit; the {chapter('kalman')} therefore measures "
        f"errors in another norm. An emulated year stays within 1 mas with {year:.1f} "
        f"decimal digits, and the bound for every admissible record, scaled from 53 bits, demands {every:.1f}.",
    )


def with_correction() -> Html:
    """Show bound (125) as printed above its correction, with the parts that differ marked, and what they change."""
    printed, corrected = statement(RESULT), intended(RESULT)
    panels = "".join(
        f'<div class="correction-{name}"><p><strong>{title}</strong></p><p>{_formula(each, marks)}</p></div>'
        for name, title, each, marks in (
            ("printed", f'As printed, <a href="{address(printed)}">(125)</a>', printed, PRINTED),
            ("corrected", "Corrected", corrected, CORRECTED),
        )
    )
    listed = "".join(f"<li>{typeset(text)}</li>" for text in changes())
    caption = "Braces and colour mark the parts that differ. A part of (125) and its replacement have the same letter."
    return Html(
        "(125) above its correction",
        f'<figure class="correction"><div class="correction-pair">{panels}</div><figcaption>{caption}</figcaption>'
        f'</figure>\n<ol class="correction-changes" type="a">{listed}</ol>',
    )


def _formula(each: Statement, marks: Mapping[str, str]) -> str:
    return typeset(each.text.replace("{{1}}", rf"$\displaystyle {marked(each.relation(), marks)}$"))


class _Marking(ast.NodeTransformer):
    """Put parts of a syntax tree into calls of ``mark``."""

    def __init__(self, letters: Mapping[str, str]) -> None:
        self.letters = letters
        self.found: set[str] = set()

    def visit(self, node: ast.AST) -> Any:
        text = ast.unparse(node)
        if not isinstance(node, ast.expr) or text not in self.letters:
            return self.generic_visit(node)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            raise ValueError(f"got the sum {text}, which would lose its parentheses; needed one of its terms")
        self.found.add(text)
        return ast.Call(ast.Name("mark"), [node, ast.Name(self.letters[text])], [])
