"""Checks of the title page of hung1984, and of what the first chapters say about contracts and plans."""

from __future__ import annotations

from datetime import date, timedelta

from gpbnb.report.ledger.checks.budget.general import span
from gpbnb.report.ledger.checks.budget.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, Verdict, compare, given
from gpbnb.report.ledger.statements import Statement, load_statements, statement


@CHECKS.add("hung1984.title.title")
def title(printed: Statement) -> Finding:
    other = [each for each in load_statements() if each.id.startswith("hung1982.I") and "GP-B " in each.text]
    named = printed.says("experiment")
    return compare(
        bool(other) and all(named in each.text for each in other),
        f"{len(other)} statements of hung1982 name the experiment GP-B",
        Verdict.INCONSISTENT,
        otherwise_note="the experiment is called GP-B",
    )


@CHECKS.add("hung1984.title.contract")
def contract_on_the_title_page(printed: Statement) -> Finding:
    other = statement("hung1982.I.contract").says("contract")
    return compare(
        printed.says("contract") == other,
        f"hung1982, ch. I, has the number {other} for the same contract",
        Verdict.INCONSISTENT,
        otherwise_note="the two reports belong to one contract",
    )


@CHECKS.add("hung1984.title.date")
def date_of_the_report(printed: Statement) -> Finding:
    period = statement("hung1984.I.report-period")
    end = date(*(int(period.number(f"to {part}").value) for part in ("year", "month", "day")))
    issued = date(*(int(printed.number(part).value) for part in ("year", "month", "day")))
    months, days = span(end + timedelta(days=1), issued)
    return given(f"the date of the report, {months} months and {days} days after its period")


_SUBJECTS = {"refinement": "main result", "second-task": "carriers"}


@CHECKS.add("hung1984.I.refinement", "hung1984.I.second-task")
def tasks(printed: Statement) -> Finding:
    subject = _SUBJECTS[printed.id.rsplit(".", 1)[1]]
    (chapter,) = {each.chapter for each in load_statements() if each.document == "hung1984" and each.item == subject}
    return compare(
        printed.says("chapter") == chapter,
        f"the results of this task are in chapter {chapter}",
        Verdict.INCONSISTENT,
        otherwise_note="the other chapter has the results of the other task",
    )


@CHECKS.add("hung1982.II.two-ways")
def two_ways(printed: Statement) -> Finding:
    ways = [each for each in load_statements() if each.id.startswith("hung1982.II.classification-by-")]
    return compare(
        {"two": 2, "three": 3}[printed.says("ways")] == len(ways),
        f"the report classifies by {' and by '.join(each.id.rpartition('-')[2] for each in ways)}",
    )
