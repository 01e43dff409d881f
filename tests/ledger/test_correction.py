"""Bound (125) above its correction: the formulas are those of the ledger, the digits follow from counts made here."""

from __future__ import annotations

import re

import numpy as np
import pytest

from gpbnb.report.gravity_probe_b import summary
from gpbnb.report.ledger import correction
from gpbnb.report.ledger.corrections import intended
from gpbnb.report.ledger.statements import statement


def test_a_part_that_is_not_in_the_formula_cannot_be_marked():
    with pytest.raises(ValueError, match=r"got the parts \['zeta'\]; needed parts of"):
        correction.marked(statement(correction.RESULT).relation(), {"B": "b", "zeta": "a"})


def test_the_digits_follow_from_counting_step_by_step():
    k, n, m = 3_153_600, 10, 2
    j = np.arange(1, k + 1, dtype=float)

    def digits(loop, entry, sign, more):
        loops, entries = (
            loop + more * (j - 1),
            entry + more * (j - 1),
        )  # roundings of the loop and of the input of step j
        after = loops[::-1].cumsum()[::-1] - loops
        coefficient = (loops.sum() + sign * (after + entries)).sum()
        return float(1 + np.log10(coefficient * summary.DRIFT / 2))

    loop, entry = 6 * n + 3 * m + 5, 4 * n + 3 * m + 4
    found = [
        digits(loop + n + 1, entry + 1, -1, 0),
        digits(loop, entry, -1, 0),
        digits(loop, entry, 1, 0),
        digits(loop, entry, 1, 3 * n + m + 2),
    ]
    first, second = correction.changes()
    assert f"(125) demands {found[0]:.2f} decimal digits" in first
    by = [float(each.replace("−", "-")) for each in re.findall(r"by ([+−][\d.]+)", first)]
    assert by == pytest.approx(np.diff(found), abs=0.01)
    # A reader who adds them up finds the sum that is written.
    assert f"With all three, (125) demands {found[-1]:.2f} digits" in first
    assert round(found[0], 2) + sum(by) == pytest.approx(round(found[-1], 2), abs=1e-9)
    rows = {each.source: each.bits for each in summary.find()}
    year, every = (1 + (rows[name] - 1) * np.log10(2) for name in ("One simulated year", "Every admissible record"))
    assert f"within 1 mas with {year:.1f} decimal digits" in second
    assert f"every admissible record, scaled from 53 bits, demands {every:.1f}." in second


def test_the_page_shows_both_formulas_and_a_line_for_each_letter():
    html = correction.with_correction().html
    assert html.index('class="correction-printed"') < html.index('class="correction-corrected"')
    assert html.count("<li>") == len({*correction.PRINTED.values()}) == len({*correction.CORRECTED.values()})
    for each, marks in (
        (statement(correction.RESULT), correction.PRINTED),
        (intended(correction.RESULT), correction.CORRECTED),
    ):
        assert correction.marked(each.relation(), marks) in html
