"""Statements that say the same have the same verdict."""

import ast
from functools import cache
from itertools import combinations

import pytest
import sympy as sp

from gpbnb.report.ledger import load_statements, rows
from gpbnb.report.ledger.finding import DISAGREEMENTS, Verdict
from gpbnb.report.ledger.formula import Number, Relation, Words
from gpbnb.report.ledger.statements import Statement

MATRICES = ("A", "B", "C", "D", "E", "F", "H", "I", "M", "P", "P_kp", "Phi", "phi", "R", "u", "x", "K_k")
NAMES = {
    **{name: sp.Symbol(name, commutative=False) for name in MATRICES},
    **{name: sp.Function(name) for name in ("abs", "norm", "op", "fl", "T", "inv")},
    "x_R": sp.Symbol("x_hat"),  # the letter of 1982 for that of 1984
    "group": lambda inside: inside,
    "bracket": lambda inside: inside,
    "matrix": sp.Matrix,
}


def comparisons(relation):
    """The comparisons of a chain; each is the difference of its sides, so that the order of terms does not matter."""
    tree = relation.tree
    if not isinstance(tree, ast.Compare):
        yield ast.unparse(tree)
        return
    sides = [tree.left, *tree.comparators]
    for left, op, right in zip(sides[:-1], tree.ops, sides[1:], strict=True):
        texts = differences(ast.unparse(left), ast.unparse(right))
        yield type(op).__name__, min(texts) if isinstance(op, ast.Eq | ast.Is) else texts[0]


@cache  # both reports print most formulas
def differences(left, right):
    """The left side minus the right side, and the reverse, as texts."""
    try:
        (link,) = Relation(f"{left} == {right}").links(NAMES)
        difference = sp.expand(link.left - link.right)
        return str(difference), str(sp.expand(-difference))
    except (AttributeError, TypeError, ValueError):  # matrices in brackets, cases, sums with symbols
        return f"{left}|{right}", f"{right}|{left}"


def content(statement):
    """What a statement says, part by part; a claim in words counts with its sentence."""
    said = set()
    for part in statement.parts:
        match part:
            case Relation() if "..." not in part.text:
                said |= set(comparisons(part))
            case Relation():
                said.add(part.text)
            case Number():
                said.add((part.label, part.literal, part.unit))
            case Words():
                said.add((part.label, part.printed, statement.text))
    return frozenset(said)


@pytest.fixture(scope="module")
def judged():
    """What each statement says, and its verdict."""
    return {row.statement.id: (content(row.statement), row.finding.verdict) for row in rows() if row.statement.form}


def test_equal_statements_have_the_same_verdict(judged):
    groups = {}
    for key, (said, _) in judged.items():
        groups.setdefault(said, []).append(key)
    pairs = [pair for keys in groups.values() for pair in combinations(keys, 2)]
    assert len(pairs) > 80
    assert [pair for pair in pairs if judged[pair[0]][1] is not judged[pair[1]][1]] == []


def test_twins_of_the_two_reports_with_one_form_have_the_same_verdict(judged):
    forms = {statement.id: statement.form for statement in load_statements()}
    twins = [(key, key.replace("hung1984.II.", "hung1982.III.")) for key in judged if key.startswith("hung1984.II.")]
    same = [pair for pair in twins if pair[1] in judged and forms[pair[0]] == forms[pair[1]]]
    assert len(same) > 80
    assert [pair for pair in same if judged[pair[0]][1] is not judged[pair[1]][1]] == []


def test_no_part_of_a_right_statement_is_wrong_elsewhere(judged):
    """A statement that says less than a verified one is not judged wrong."""
    right = [said for said, verdict in judged.values() if verdict is Verdict.VERIFIED]
    wrong = {key: said for key, (said, verdict) in judged.items() if verdict in DISAGREEMENTS}
    less = {key for key, said in wrong.items() if any(said < other for other in right)}
    assert less == set()


def test_no_statement_is_wrong_if_each_of_its_parts_is_right_elsewhere(judged):
    right = frozenset().union(*(said for said, verdict in judged.values() if verdict is Verdict.VERIFIED))
    wrong = {key for key, (said, verdict) in judged.items() if verdict in DISAGREEMENTS and said <= right}
    assert wrong == set()


def sample(form, text="{{1}}"):
    return Statement("hung1984.II.x", "hung1984", "II", "1", "x", "equation", text, form)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("a == b + c", "b == a - c", True),
        ("a == b == c", "c == b; a == b", True),
        ("a <= b*(1 + c)", "a <= b*c + b", True),
        ("a <= b", "b <= a", False),
        ("a == 2*b", "a == 3*b", False),
        ("A*B == C", "B*A == C", False),
        ("x_R == abs(y)", "abs(y) == x_hat", True),
        ("mass: 1.20 kg", "mass: 1.2 kg", False),
        ("verb: grows | shrinks", "verb: grows | stays", True),
    ],
)
def test_what_counts_as_the_same(one, other, same):
    assert (content(sample(one)) == content(sample(other))) is same
