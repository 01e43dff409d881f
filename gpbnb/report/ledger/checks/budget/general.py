"""Check the general descriptions: hung1984, ch. I, and the goal, period and contracts in hung1982, ch. I."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import reduce
from operator import mul

from gpbnb.arithmetic.formats import FloatFormat
from gpbnb.arithmetic.linalg import dot
from gpbnb.report.budget import theory
from gpbnb.report.ledger.checks import rolling
from gpbnb.report.ledger.checks.budget.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare, given, unverifiable
from gpbnb.report.ledger.html import chapter
from gpbnb.report.ledger.statements import Statement, load_statements, quote, statement
from gpbnb.report.measurement import ARCSEC, MAS

# -- hung1984, ch. I ------------------------------------------------------------------------------


@CHECKS.add("hung1984.I.contents")
def contents(printed: Statement) -> Finding:
    entries = [entry for entry in load_statements() if entry.document == "hung1984"]
    return unverifiable(
        f"the chapters are {', '.join(dict.fromkeys(entry.chapter for entry in entries if entry.chapter != '-'))}",
        "the scan has no page numbers and no distribution list",
    )


@CHECKS.add("hung1984.I.two-tasks")
def two_tasks(printed: Statement) -> Finding:
    fixed, spoiled, left = revised_sum(), revised_product(), revised_chain()
    made = fixed and not spoiled and not left
    return compare(
        printed.claims("the corrections", {"have been made": made, "have not all been made": not made}),
        "bound (18) of 1982, which the two-digit sum 5.6 + 5.9 − 11 violates, is "
        f"{'corrected' if fixed else 'not corrected'}; equation (20), right in 1982, is "
        f"{'made wrong' if spoiled else 'kept'}; bound (31), wrong in 1982, is "
        f"{'kept' if left else 'corrected'}",
        otherwise_note=(
            "not all errors are corrected: bound (31) is still wrong, and the main result depends on it; "
            f"see the {chapter('rounding')}"
        ),
        root="product-error-relative-to-product",
    )


def revised_sum() -> bool:
    """Whether a sum that exceeds (18) of 1982 obeys (18) of 1984."""
    fmt = FloatFormat(10, 2)
    x = fmt.array(["5.6", "5.9", "-11"])
    beta, terms = fmt.unit_roundoff, x.to_fractions()
    true = sum(terms)
    error = abs(((x[0] + x[1]) + x[2]).to_fractions() - true)
    of_1982 = 2 * beta * abs(true)
    of_1984 = beta * (2 * abs(true) + abs(terms[2]))
    return bool(of_1982 < error <= of_1984)


def revised_product() -> bool:
    """Whether (20) of 1984, n + m + 1, but not (20) of 1982, differs from the number of roundings in a quotient."""
    n, m = 3, 2
    count = (reduce(mul, [Roundings()] * n) / reduce(mul, [Roundings()] * m)).count
    return count == n + m - 1 and count != n + m + 1


@dataclass(frozen=True)
class Roundings:
    """A placeholder for any number that counts the products and quotients that led to it."""

    count: int = 0

    def __mul__(self, other: Roundings) -> Roundings:
        return Roundings(self.count + other.count + 1)

    __truediv__ = __mul__


def revised_chain() -> bool:
    """Whether a cancelling product of a row and a column of two exceeds (31), which is the same in both reports."""
    fmt = FloatFormat(10, 4)
    row, column = fmt.array(["1.001", "-1.002"]), fmt.array(["1.001", "1"])
    true = sum(row.to_fractions() * column.to_fractions())
    error = abs(dot(row, column).to_fractions() - true)
    return bool(error > 2 * fmt.unit_roundoff * abs(true))


@CHECKS.add("hung1984.I.1-f-study")
def one_over_f_study(printed: Statement) -> Finding:
    entries = [entry for entry in load_statements() if entry.id.startswith("hung1984.III.")]
    left = [entry for entry in entries if entry.kind == "open"]
    count = sum(rolling.CHECKS.run(entry).verdict is Verdict.ANSWERED for entry in left)
    return answer(
        bool(left) and count == len(left),
        f"this book answers {count} of the {len(left)} studies that ch. III leaves open",
        "the answers are in the ledger of hung1984, ch. III",
    )


def period(printed: Statement) -> tuple[int, int] | None:
    """Return whole months and days of a printed period with its last day; None if a printed day does not exist."""
    printed_days = ([printed.number(f"{word} {part}").value for part in ("year", "month", "day")]
                    for word in ("from", "to"))  # fmt: skip
    try:
        start, end = (date(*map(int, numbers)) for numbers in printed_days)
    except ValueError:
        return None
    return span(start, end + timedelta(days=1))


@CHECKS.add("hung1984.I.report-period")
def period_1984(printed: Statement) -> Finding:
    found = period(printed)
    months, days = found or (0, 0)
    return compare(
        found is not None and months == printed.number("duration").value and days == 0,
        f"{months} months and {days} days, including the last day",
    )


@CHECKS.add("hung1984.I.contract")
def contract(printed: Statement) -> Finding:
    title_page = statement("hung1984.title.contract").says("contract")
    return compare(
        printed.says("contract") == title_page,
        title_page,
        Verdict.MISPRINT,
        otherwise_note="the title page and hung1982 have an S where this page has a 5",
    )


# -- hung1982, ch. I ------------------------------------------------------------------------------


@CHECKS.add("hung1982.I.drift-rate")
def drift_rate(printed: Statement) -> Finding:
    limit = float(printed.number("drift rate").value) * ARCSEC / MAS
    others = math.sqrt(max(theory.GOAL**2 - limit**2, 0.0))
    return unverifiable(
        (f"a gyro at this limit uses up the goal alone: it leaves {others:g} milliarcseconds for all other sources"),
        "the documents contain no data on the drift of the gyros",
    )


@CHECKS.add("hung1982.I.design-goal")
def design_goal(printed: Statement) -> Finding:
    goal = float(printed.number("goal").value) * ARCSEC / MAS
    return given(
        f"Figure II-2 is based on the same goal, {goal:g} milliarcsecond a year; it confirms the "
        "decimal point, which the scan has lost"
    )


@CHECKS.add("hung1982.II.rss-basis")
def rss_basis(printed: Statement) -> Finding:
    return given(f"the total that Figure II-2 assumes, {printed.number('total').literal} milliarcsecond")


@CHECKS.add("hung1982.I.previous-contract")
def previous_contract(printed: Statement) -> Finding:
    listed = quote("hung1982.II.references")
    numbers = re.findall(r"NAS8-\d+", listed)
    award = datetime.strptime(printed.says("award"), "%B %Y").date()
    end, start = date(1981, 2, 18), date(1981, 6, 24)
    return compare(
        "18 February 1981" in listed and [printed.says("contract")] == numbers and award < end < start,
        f"its final report, the first reference of ch. II, gives the number {' and '.join(numbers)}; "
        f"it appeared {span(award, end)[0]} months after the award and {span(end, start)[0]} months "
        "before the period of this contract",
    )


@CHECKS.add("hung1982.I.contract")
def contract_1982(printed: Statement) -> Finding:
    title_page = statement("hung1984.title.contract").says("contract")
    return compare(
        printed.says("contract") == title_page,
        f"{title_page}, as on the title page of hung1984",
        Verdict.INCONSISTENT,
    )


@CHECKS.add("hung1982.I.chapters-ii-and-iii")
def chapters(printed: Statement) -> Finding:
    where = {entry.item: entry.chapter for entry in load_statements() if entry.document == "hung1982"}
    found = [where["classification by statistics"], where["main result"]]
    return compare(
        [printed.says("classifications"), printed.says("error analysis")] == found,
        f"they are chapters {' and '.join(found)}",
        Verdict.INCONSISTENT,
    )


@CHECKS.add("hung1982.I.chapter-reference")
def chapter_reference(printed: Statement) -> Finding:
    entries = [entry for entry in load_statements() if entry.document == "hung1982"]
    (where,) = {entry.chapter for entry in entries if entry.item == "six frames"}
    return compare(
        printed.says("chapter") == where,
        f"the measurement geometry is chapter {where}",
        Verdict.MISPRINT,
        otherwise_note="two letters are interchanged; there is no chapter VI",
    )


@CHECKS.add("hung1982.I.report-period")
def period_1982(printed: Statement) -> Finding:
    months, days = period(printed) or (0, 0)
    restored = span(date(1981, 6, 24), date(1982, 9, 1))
    return compare(
        months == printed.number("duration").value,
        (
            f"the period is {months} months and {days} days with the printed year, and {restored[0]} "
            f"months and {restored[1]} days with 1981"
        ),
        Verdict.MISPRINT,
        otherwise_note="the year must be 1981, which the scan shows as 1987",
    )


def span(start: date, end: date) -> tuple[int, int]:
    """Return whole months and remaining days from `start` to `end`."""
    months = 12 * (end.year - start.year) + end.month - start.month - (end.day < start.day)
    later = start.year * 12 + start.month - 1 + months
    return months, (end - date(later // 12, later % 12 + 1, start.day)).days
