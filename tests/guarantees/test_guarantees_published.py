"""Published filters and numbers beside ours, rows of the survey that come out again, and stored certificates."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest

from gpbnb.report.guarantees import certificates, comparison, survey, table
from gpbnb.report.guarantees.comparison import error_coefficients
from gpbnb.report.guarantees.published import fixif_longitudinal
from tests.oracles import floating


def numbered():
    return [each for each in comparison.rows() if each.published is not None]


@pytest.mark.long  # the bounds of all published filters
def test_no_bound_of_ours_is_larger_than_a_published_one():
    for each in numbered():
        assert each.ours == pytest.approx(each.published, rel=1e-8) or each.ours < each.published, each.program


@pytest.mark.long  # the bounds of all published filters
def test_a_number_is_missing_only_with_a_reason_and_every_row_has_its_source():
    for each in comparison.rows():
        assert each.source
        assert each.note
    assert len(comparison.table().body) == len(comparison.rows())


@pytest.mark.long  # a thousand steps in Fractions, in which the controller forgets
def test_the_lead_lag_controller_is_that_of_the_program_in_a_plain_loop():
    r, system, fmt = floating(2, 24, "even"), comparison.lead_lag(), comparison.SINGLE
    bound, rng, worst = comparison.output_errors(system, fmt, 1.0)[0], np.random.default_rng(2), Fraction(0)
    u = np.concatenate([np.ones(600), rng.uniform(-1, 1, 600)])
    found = system.outputs(u.reshape(-1, 1), fmt)[:, 0, 0]
    A = [Fraction(each) for each in ("0.499", "-0.05", "0.010")]
    a = [r(each) for each in A]
    x0 = x1 = e0 = e1 = Fraction(0)
    for value, given in zip(found, u, strict=True):
        yc = r(Fraction(float(given)))
        x0 = r(r(a[0] * x0) + r(r(a[1] * x1) + yc))
        x1 = r(r(a[2] * x0) + x1)
        assert Fraction(float(value)) == x1
        e0 = A[0] * e0 + A[1] * e1 + Fraction(float(given))
        e1 = A[2] * e0 + e1
        worst = max(worst, abs(x1 - e1))
    # roundings to nearest partly cancel in sums over about a thousand steps, the time in which the controller forgets
    assert 0 < float(worst) <= bound < 1000 * float(worst)


def test_every_printed_digit_of_fixif_is_ours():
    given = fixif_longitudinal()
    ours = error_coefficients(given["A"], given["B"], given["C"], given["D"], given["input_bound"])
    assert [round(float(each), 6) for each in ours] == given["published_E"]


@pytest.mark.long  # rows of the survey with all their runs
@pytest.mark.parametrize("seed", [8, 9, 26, 27])
def test_a_row_comes_out_again(seed: int) -> None:
    (row,) = (row for row in survey.load() if row.seed == seed)
    assert survey.compute(seed) == row


def test_every_certificate_of_the_book_is_stored_and_proved() -> None:
    rows = certificates.load()
    assert [row.name for row in rows] == list(certificates.guarantees())
    assert {row.verdict for row in rows} == {"proved"}


@pytest.mark.long  # whole certificates of published filters
@pytest.mark.parametrize("name", ["tracker, limits four times as wide", "tracker within 0.01 m"])
def test_a_certificate_comes_out_again(name: str) -> None:
    (row,) = (row for row in certificates.load() if row.name == name)
    found = certificates.checked(name)
    assert abs(found.size - row.size) < 20  # last digits of guessed numbers depend on the machine
    assert (found.name, found.verdict) == (row.name, row.verdict)


@pytest.mark.long  # the bits that each filter needs are searched for
@pytest.mark.parametrize("name", ["elaenia, gold", "filterpy, velocity", "Dyer and McReynolds"])
def test_a_guarantee_of_a_published_filter_comes_out_again(name: str) -> None:
    """It takes 4 s: the bits that each filter needs are searched for."""
    (row,) = (row for row in table.load() if row.name == name)
    assert table.compute(table.case_named(name))[:-1] == row[:-1]


def test_a_certificate_that_promises_too_much_is_not_proved() -> None:
    given = json.loads(certificates.tracker_guarantee().certificate())
    given["bound"] = [f"{Fraction(each) / 2}" for each in given["bound"]]
    assert certificates.verdict("half", json.dumps(given)).verdict.startswith("not proved: ")
