"""Section 2: splitting and rounding a number."""

from __future__ import annotations

import math
from fractions import Fraction

import sympy as sp

from gpbnb.report.ledger.checks.rounding.instances import (
    FOUR,
    Names,
    all_numbers,
    judge,
    link_holds,
    number_names,
    power,
    relations,
    samples,
    split_text,
)
from gpbnb.report.ledger.checks.rounding.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare
from gpbnb.report.ledger.formula import Relation
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement, statement

HALF = Fraction(1, 2)


def split_is_printed(relation: Relation, names: Names) -> bool:
    """Whether the terms of a printed number ``x = .1234e2 + .56e-2`` are those of its split (2)."""
    b, t, e = names["b"], names["t"], names["e"]
    terms = relation.terms(names, number=lambda q: q)
    return relation.equates and terms == (names["u"] * b**e, names["v"] * b ** (e - t))


RADICANDS = {r"$\sqrt2$": 2, r"$\sqrt4$": 4}


@CHECKS.add(*both("s2.claim-infinite-digits"))
def infinite_digits(printed: Statement) -> Finding:
    radicand = RADICANDS[printed.says("example")]
    places, bases = range(40), (2, 10, 16)
    finite = [
        (b, k) for b in bases for k in places if math.isqrt(radicand * b ** (2 * k)) ** 2 == radicand * b ** (2 * k)
    ]
    digits = "finite" if finite or sp.sqrt(radicand).is_rational else "infinite"
    return compare(
        printed.says("digits") == digits == "infinite",
        f"a number with finitely many digits is rational, but $\\sqrt{{{radicand}}}$ is not; no "
        f"number with fewer than {len(places)} places in base {', '.join(map(str, bases))} has the "
        f"square {radicand}",
    )


def _digits(printed: Statement, names: Names) -> bool:
    """Whether u has the printed number of digits, t, and generally no fewer."""
    count = {"$t$": names["t"], "$t+1$": names["t"] + 1}[printed.says("digits")]
    return bool((names["u"] * names["b"] ** names["t"]).denominator == 1 and count == names["t"])


def _splits(printed: Statement, names: Names) -> set[tuple[Fraction, Fraction, Fraction]]:
    """Return the splits of a number into u, v and e that the printed conditions admit."""
    unit = Fraction(1) / names["b"] ** names["t"]
    found = set()
    for e in (names["e"] - 1, names["e"], names["e"] + 1):
        whole = math.trunc(names["x"] / names["b"] ** e / unit)
        for u in (unit * k for k in range(whole - 3, whole + 4)):
            each = {**names, "u": u, "v": (names["x"] / names["b"] ** e - u) / unit, "e": e}
            if all(link_holds(link) for r in relations(printed) for link in r.links(each, number=lambda q: q)):
                found.add((u, each["v"], e))
    return found


def _admits_only_the_nearest(printed: Statement, names: Names) -> bool:
    """Whether the conditions admit the truncated number and its neighbour away from zero, if that is near enough."""
    b, t, u, v, e = (names[letter] for letter in "btuve")
    sign = 1 if names["x"] > 0 else -1
    away = (u + sign / b**t, v - sign, e)
    if abs(away[0]) == 1:  # a carry
        away = (sign / b, away[1] / b, e + 1)
    return _splits(printed, names) == ({(u, v, e), away} if abs(away[1]) < 1 else {(u, v, e)})


@CHECKS.add(*both("eq2"))
def split(printed: Statement) -> Finding:
    whole = judge(relations(printed), all_numbers())
    rest = judge(relations(printed), [names for names in all_numbers() if names["v"] != 0])
    digits = all(_digits(printed, names) for names in all_numbers())
    return compare(
        whole.holds and digits and all(_admits_only_the_nearest(printed, names) for names in all_numbers()),
        f"for all numbers, the printed condition {whole}; for numbers with $v\\ne0$ it {rest}",
        Verdict.MISPRINT if rest.holds and digits else Verdict.WRONG,
        otherwise_note="the condition must be $0\\le|v|$: the printed condition excludes $v=0$, that is, numbers "
        "with at most $t$ digits; nothing later uses $v\\ne0$",
    )


@CHECKS.add(*both("s2.example-2a"), *both("s2.example-2b"))
def example_2(printed: Statement) -> Finding:
    number, *parameters = relations(printed)
    (link,) = number.links({}, number=lambda q: q)
    names = number_names(Fraction(link.left))
    right = split_is_printed(number, names) and judge(parameters, [names]).holds
    return compare(
        right,
        f"{split_text(link.left)} for {float(link.left):.9g} in base 10 with four digits",
        Verdict.MISPRINT,
        otherwise_note="the first power must be $10^{-1}$, to agree with $e=-1$ in the same line",
    )


@CHECKS.add(*both("s2.claim-t-digit-mantissa"))
def carry(printed: Statement) -> Finding:
    x = Fraction("99.996")
    rounded = FOUR.round(x)
    changes = {FOUR.split(FOUR.round(each))[2] - FOUR.split(each)[2] for each in (x, *samples())}
    said = {"$b^e$": {0}, "$b^{e+1}$": {1}, "$b^e$ or $b^{e+1}$ after a carry": {0, 1}}[printed.says("exponent")]
    return compare(
        changes == said,
        f"99.996 has $e={FOUR.split(x)[2]}$ and rounds to {power(rounded)}, which has $e={FOUR.split(rounded)[2]}$",
        Verdict.MISPRINT,
        otherwise_note="a carry beyond the first digit increases the exponent by one; (3) and (5) still hold",
    )


@CHECKS.add(*both("eq3"))
def rounding_rule(printed: Statement) -> Finding:
    found = judge(relations(printed), all_numbers())
    return compare(
        found.right,
        f"the printed rule gives the nearest number and {found}",
        note=(
            "the rule rounds ties away from zero; IEEE 754 of 1985 rounds them to the even neighbour, "
            "with the same bound (5)"
        ),
    )


@CHECKS.add(*both("s2.claim-conventional"))
def conventional(printed: Statement) -> Finding:
    rule = statement("hung1984.II.eq3").relation()
    covered = {"negative": 0, "positive": 0}
    for names in all_numbers():
        (link,) = rule.links(names, number=lambda q: q)
        nearest = 2 * abs(link.right - names["x"]) <= names["b"] ** (names["e"] - names["t"])
        covered["positive" if names["x"] > 0 else "negative"] += nearest
    numbers = "any number" if sum(covered.values()) == len(all_numbers()) else "positive numbers alone"
    return compare(
        printed.says("numbers") == numbers,
        f"rule (3) returns a nearest number for {covered['positive']} positive and "
        f"{covered['negative']} negative numbers out of {len(all_numbers())}",
    )


@CHECKS.add(*both("s2.claim-u-v-same-sign"))
def same_sign(printed: Statement) -> Finding:
    signs = {names["u"] * names["v"] > 0 for names in all_numbers() if names["v"]}
    found = {(True,): "the same sign", (False,): "opposite signs"}.get(tuple(signs), "either sign")
    names = number_names(Fraction("765.4567"))
    u, v = names["u"] + Fraction(1, 10**4), names["v"] - 1
    return compare(
        printed.says("signs") == found,
        f"$u$ and $v$ have {found} in the splits of {len(all_numbers())} numbers",
        note=(
            f"the claim holds unless $v=0$; (2) alone would also allow $u={float(u):g}$, $v={float(v):g}$ for 765.4567"
        ),
    )


def _case_is_printed(number: Relation, rest: tuple[Relation, ...]) -> tuple[bool, bool, Fraction]:
    """Whether the split of an example (3) is the printed one, and whether the rest and the number are right."""
    x = Fraction(number.links({}, number=lambda q: q)[0].right)
    names = number_names(x)
    (condition,) = rest[0].links(names, number=lambda q: q)
    threshold = abs(condition.right) == HALF and condition.right * names["v"] > 0 and link_holds(condition)
    follows = threshold and judge(rest[1:], [names]).holds
    return split_is_printed(number, names) and judge([number], [names]).holds, follows, x


@CHECKS.add(*both("s2.example-3a"), *both("s2.example-3b"), *both("s2.example-3c"))
def example_3(printed: Statement) -> Finding:
    number, *rest = relations(printed)
    split_right, follows, x = _case_is_printed(number, tuple(rest))
    letter = "x_R" if printed.document == "hung1982" else "\\hat x"
    return compare(
        split_right and follows,
        f"{split_text(x)}; ${letter}=$ {power(FOUR.round(x))}",
        Verdict.MISPRINT if follows else Verdict.WRONG,
        otherwise_note="the digit 4 of $-.7654\\times10^3$ is missing in the first line of both reports, and present "
        "in the next",
    )
