"""Sentences between the equations of sections 10 and 11: definitions and the order of the analysis."""

from __future__ import annotations

from gpbnb.report.ledger.checks.inversion.registry import CHECKS
from gpbnb.report.ledger.finding import Finding, given
from gpbnb.report.ledger.registry import both
from gpbnb.report.ledger.statements import Statement


@CHECKS.add(*both("s11-1.initial-entries"))
def initial_entries(printed: Statement) -> Finding:
    return given("names the entries before the first step")


@CHECKS.add(*both("s10.claim-two-steps"))
def two_steps() -> Finding:
    return given("announces the two cases that section 10 analyses")
