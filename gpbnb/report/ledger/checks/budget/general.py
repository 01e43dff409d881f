"""Check the general descriptions: hung1984, ch. I, and the goal, period and contracts in hung1982, ch. I."""

from __future__ import annotations

import math
import re
from datetime import date, datetime, timedelta

from gpbnb.report.budget import theory
from gpbnb.report.ledger.checks import rolling
from gpbnb.report.ledger.checks.budget.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, answer, compare, given, unverifiable
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
